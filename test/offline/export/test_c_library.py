"""The exported C library computes what replay computes, to the byte, and stands alone."""

import ctypes
import itertools
import math
import platform
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from core.estimation.test_compiled_pipeline import ACTUATORS, DEFAULT, TYPES, noisy, receipts, with_seals
from harness.c_library import CEstimator, first_configuration, to_struct
from offline.commands.test_main import PULL_TEST
from paths import ROOT

from seal_friction_ros import Estimator
from seal_friction_ros.core.estimation.configuration import first_snapshot, parse_snapshot, snapshot_text
from seal_friction_ros.core.estimation.loop import LoopSample, RodLoad, friction_on_rod, receive_sample
from seal_friction_ros.core.estimation.pipeline import answered, init, is_tick_due
from seal_friction_ros.core.friction.states import StateFriction
from seal_friction_ros.core.friction.temperature import COLDEST, HOTTEST
from seal_friction_ros.core.messages.coder import decode, encode, type_of
from seal_friction_ros.core.messages.records import (
    Clock,
    Force,
    FrictionEstimate,
    Pressure,
    ServoReference,
    Status,
    Temperature,
    Velocity,
    WatchdogTick,
    numbers_in,
)
from seal_friction_ros.offline.bags.actuator_bag import open_actuator
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.export import c_library
from seal_friction_ros.offline.export.c_library import digest, example_samples, sources
from seal_friction_ros.offline.export.c_types import fields_of, meanings_of
from seal_friction_ros.offline.replay.replay import Replay

BAGS = ('pull_test', 'faults')
SEALS = ['ms28775_114@a', 'ms28775_114@b']
ELASTIC = {'presliding': True, 'presliding_against_motion': True, 'velocity_resolution': 0.01}


@pytest.fixture(scope='module')
def default(tmp_path_factory) -> CEstimator:
    """The default actuator with a force and adaptation, as a library."""
    return CEstimator(DEFAULT, tmp_path_factory.mktemp('default'))


@pytest.fixture
def fresh(default: CEstimator) -> CEstimator:
    default.call('reset')
    return default


def without_frame(answers: list[tuple[str, bytes]]) -> list[tuple[str, bytes]]:
    return [(name, encode(decode(name, data), b'')) for name, data in answers]


def assert_same(library: CEstimator, parameters, messages) -> None:
    """The library answers each message, received and sent at a time, with the bytes of Python; so do the states."""
    state = init(parameters)
    for message, received, sent in messages:
        state, expected = answered(parameters, state, message, received, sent)
        assert library.receive(message, received, sent) == without_frame(expected), message
    assert repr(library.known()) == repr(state)


def sampled(samples: int, seed: int) -> Iterator[tuple[object, int, int]]:
    """Messages of a rod with sensor faults, some late, with a tick and simulated time now and then."""
    pieces = noisy(samples, seed)
    for i, ((kind, data), received) in enumerate(zip(pieces, receipts(pieces), strict=True)):
        late = 40_000_000 if i % 50 == 7 else 0
        yield decode(TYPES[kind], data), received, received - late
        if i % 400 == 13:
            yield WatchdogTick(received, 0.02), received, received
        if i > 2000 and i % 100 == 0:
            yield Clock(received - 10**18), received, received


def test_random_messages_with_faults_give_the_bytes_and_the_state_of_replay(fresh: CEstimator):
    assert_same(fresh, DEFAULT, sampled(1000, 1))


def test_every_law_and_an_elastic_actuator_give_the_bytes_of_replay(tmp_path: Path):
    parameters = with_seals(ACTUATORS['others'], **ELASTIC)
    assert_same(CEstimator(parameters, tmp_path, 'others'), parameters, sampled(700, 2))


@pytest.mark.parametrize('bag', BAGS)
def test_a_reference_bag_gives_its_recorded_bytes(bag: str, tmp_path: Path):
    source = open_actuator(ROOT / 'bags' / bag)
    configuration = first_configuration(bag)
    library = CEstimator(configuration.parameters(), tmp_path)
    replay, compared = Replay(source.path), 0
    for step in replay.steps():
        name = step.message.type_name
        if name in TYPES.values():
            received = step.message.log_time
            sent = step.message.publish_time if configuration.tells_sending else received
            found = library.receive(decode(name, step.message.data), received, sent)
            assert found == without_frame([(answer.type_name, answer.data) for answer in step.answers])
            compared += len(found)
    assert compared > 300


def test_a_step_of_a_loop_is_that_of_python(fresh: CEstimator):
    state, random, answers = init(DEFAULT), np.random.default_rng(5), list[tuple[str, bytes]]()
    for i in range(1500):
        values = [0.05 * math.sin(i / 90), *(1e6 * random.random(2)).tolist(), *random.normal(size=3).tolist(), 20.0]
        sample = LoopSample(i * 1_000_000, *(math.nan if random.random() < 0.03 else value for value in values))
        answers.clear()
        receive_sample(DEFAULT, state, sample, lambda one, _: answers.append((type_of(one), encode(one, b''))))
        assert fresh.step(sample) == answers
    assert repr(fresh.known()) == repr(state)


def test_a_saved_state_goes_on_after_a_reset_and_a_library_of_another_layout_refuses_it(
    fresh: CEstimator, tmp_path: Path, monkeypatch
):
    for message, *times in sampled(300, 3):
        fresh.receive(message, *times)
    saved, before = (ctypes.c_uint8 * (8 + 8 * len(list(numbers_in(fresh.known())))))(), repr(fresh.known())
    fresh.call('save', saved)
    fresh.call('reset')
    assert repr(fresh.known()) == repr(init(DEFAULT))
    assert fresh.call('load', saved, returns=ctypes.c_bool)
    assert repr(fresh.known()) == before
    monkeypatch.setattr(c_library, 'fields_of', lambda kind: dict(reversed(fields_of(kind).items())))
    other = CEstimator(DEFAULT, tmp_path)  # the same configuration, whose saved numbers stand in another order
    before = repr(other.known())
    assert not other.call('load', saved, returns=ctypes.c_bool)
    assert repr(other.known()) == before
    other.call('save', own := type(saved)())
    assert other.call('load', own, returns=ctypes.c_bool)


@pytest.mark.parametrize('sanitizers', ['address,undefined,float-cast-overflow', 'thread'])
def test_a_hostile_integrator_of_two_libraries_in_threads_finds_nothing(sanitizers: str, tmp_path: Path):
    """Garbage into each function, init again, states cut, changed and of the other library: see ``integrator.c``."""
    configurations = {'rod': with_seals(ACTUATORS['others'], **ELASTIC), 'piston': DEFAULT}
    for name, parameters in configurations.items():
        for file, text in sources(parameters, name, name).items():
            (tmp_path / file).write_text(text)
    flags = ['-std=c11', '-O0', '-Wall', '-Wextra', '-Werror', f'-fsanitize={sanitizers}', '-fno-sanitize-recover=all']
    files = [str(Path(__file__).with_name('integrator.c')), '-I.', 'rod.c', 'piston.c', '-lm', '-pthread']
    subprocess.run(['cc', *flags, *files, '-o', 'integrator'], cwd=tmp_path, check=True)
    run = subprocess.run(['./integrator'], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, '')


TEMPERATURES = (COLDEST - 1.0, COLDEST + 1.0, HOTTEST - 1.0, HOTTEST + 1.0)  # [K]
GARBAGE = (math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, -5e-324, 2e-308, 1e308, -1e308, 1e154, -3e6)


def garbage(number: int, share: float) -> Iterator[tuple[object, int, int]]:
    """Messages of a rod, a share of their numbers garbage; stamps that go back, times of other clocks."""
    random, now = np.random.default_rng(9), 0

    def one(usual: float) -> float:
        return GARBAGE[random.integers(len(GARBAGE))] if random.random() < share else usual

    def time(usual: int) -> int:
        return int(random.choice([0, 1, 10**9, 2 * 10**18])) if random.random() < share else usual

    for i in range(number):
        now += int(random.choice([1_000_000, 0, 3_000_000_000], p=[0.96, 0.03, 0.01]))
        speed = 0.05 * math.sin(i / 50)
        kinds = (
            Velocity(time(now), one(speed)), Velocity(time(now), one(speed)), Force(time(now), one(40.0 * speed)),
            Pressure(time(now), one(3e6), one(1e6)), Temperature(-time(now), one(20.0)), WatchdogTick(time(now), 0.02),
            ServoReference(time(now), one(0.0), one(speed), one(0.1)), Clock(time(now) - time(0)),
        )  # fmt: skip
        yield kinds[random.integers(7 + (random.random() < share))], (received := time(now)), time(received)


@pytest.mark.parametrize('share', [0.02, 0.3])
def test_garbage_gives_the_bytes_and_the_state_of_replay(fresh: CEstimator, share: float):
    assert_same(fresh, DEFAULT, garbage(1500, share))


def test_friction_on_a_rod_is_finite_and_that_of_python_for_any_numbers(tmp_path: Path):
    parameters = with_seals(ACTUATORS['others'])
    function = CEstimator(parameters, tmp_path, 'others').library.others_friction_on_rod
    function.restype = type(to_struct(StateFriction(0, 0, 0.0)))
    for numbers in itertools.product((*GARBAGE[:4], 5e-324, 1e308, -1e308, 3e6, 0.05), repeat=5):
        found, expected = (
            function(to_struct(RodLoad(*numbers))),
            friction_on_rod(parameters.estimator, RodLoad(*numbers)),
        )
        assert (found.state, found.direction, found.friction_force) == expected, numbers
        assert math.isfinite(found.friction_force)
    at_the_limit, beyond = (friction_on_rod(parameters.estimator, RodLoad(0.1, p, 0.0)) for p in (4.5e7, 1e9))
    assert beyond == at_the_limit


def test_the_watchdog_is_due_when_it_is_in_python(fresh: CEstimator):
    due = []
    for message, received, sent in sampled(250, 4):
        fresh.receive(message, received, sent)
        for now in (received, received + 20_000_000):
            due.append(fresh.call('is_tick_due', ctypes.c_int64(now), returns=ctypes.c_bool))
            assert due[-1] == is_tick_due(fresh.known(), now)
    assert True in due
    assert False in due


def test_a_time_beyond_its_bounds_is_refused_and_changes_nothing(fresh: CEstimator):
    before = repr(fresh.known())
    for stamp, received in ((2**62, 5), (5, -1), (5, 2**62)):
        with pytest.raises(AssertionError):
            fresh.receive(Velocity(stamp, 0.1), received, received)
    assert repr(fresh.known()) == before


def test_friction_on_a_rod_is_that_of_python(default: CEstimator):
    function, random = default.library.seal_friction_friction_on_rod, np.random.default_rng(6)
    function.restype = type(to_struct(StateFriction(0, 0, 0.0)))
    for _ in range(500):
        load = RodLoad(*(random.normal(size=4) * [0.01, 1e6, 1e6, 40.0] * (random.random(4) > 0.1)).tolist())
        found, expected = function(to_struct(load)), friction_on_rod(DEFAULT.estimator, load)
        assert (found.state, found.direction, found.friction_force) == expected


@pytest.fixture(scope='module')
def exported(tmp_path_factory) -> Path:
    """The folder that the command makes."""
    folder = tmp_path_factory.mktemp('exported') / 'friction_c'
    assert main(['export', 'c', *SEALS, '--bag', PULL_TEST, '--out', str(folder)]) == 0
    return folder


def test_the_folder_makes_the_examples_and_both_answer_what_python_computes(exported: Path):
    subprocess.run(['make', '-s'], cwd=exported, check=True)  # compares both
    in_c = (exported / 'answers.csv').read_text()
    samples = np.genfromtxt(exported / 'example.csv', delimiter=',', names=True)
    columns = {name: samples[name] for name in samples.dtype.names if name != 'stamp'}
    log = np.genfromtxt(in_c.splitlines(), delimiter=',', names=True)
    replayed = Estimator(SEALS).over({'time': samples['stamp'] * 1e-9, **columns})
    assert len(log) > 300
    for name in ('friction_force', 'coulomb_friction', 'coulomb_friction_std', 'state', 'status'):
        assert np.array_equal(log[name], replayed[name]), name


def test_make_fails_where_the_examples_answer_differently(exported: Path, tmp_path: Path):
    folder = shutil.copytree(exported, tmp_path / 'copy')
    source = folder / 'example.c'
    source.write_text(source.read_text().replace('feed_forward.force : 0.0', 'feed_forward.force : 1.0'))
    run = subprocess.run(['make', '-s'], cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode != 0
    assert 'differ' in run.stdout + run.stderr


def test_a_log_is_verified_by_the_configuration_of_the_export_after_its_seal_file_changed(tmp_path: Path):
    seal, folder = tmp_path / 'rod.yaml', tmp_path / 'friction_c'
    shutil.copy(ROOT / 'config' / 'seals' / 'ms28775_114_prior_art.yaml', seal)
    assert main(['export', 'c', f'{seal}@a', '--out', str(folder)]) == 0
    seal.write_text(seal.read_text().replace('squeeze_friction: 87', 'squeeze_friction: 97'))
    subprocess.run(['make', '-s', 'CFLAGS=-O0'], cwd=folder, check=True)
    log, samples = (np.genfromtxt(folder / file, delimiter=',', names=True) for file in ('answers.csv', 'example.csv'))
    columns = {'time': samples['stamp'] * 1e-9, **{name: samples[name] for name in samples.dtype.names[1:]}}
    exported = parse_snapshot((folder / 'configuration.json').read_text()).configuration
    changed = Estimator([f'{seal}@a'])
    assert np.array_equal(log['friction_force'], Estimator(configuration=exported).over(columns)['friction_force'])
    assert not np.array_equal(log['friction_force'], changed.over(columns)['friction_force'])
    of_now = digest(snapshot_text(first_snapshot(changed.configuration)))
    assert of_now.encode() not in (folder / 'libseal_friction.so').read_bytes()


def test_a_machine_with_a_c_compiler_alone_makes_and_runs_the_example(exported: Path, tmp_path: Path):
    folder = shutil.copytree(
        exported, tmp_path / 'copy', ignore=shutil.ignore_patterns('*.o', '*.a', '*.so', 'example_*')
    )
    for tool in ('make', 'cc', 'as', 'ld', 'ar', 'sh', 'cmp', 'tail'):
        (tmp_path / tool).symlink_to(str(shutil.which(tool)))
    subprocess.run(['make', '-s', 'CFLAGS=-O0'], cwd=folder, check=True, env={'PATH': str(tmp_path)})
    assert (folder / 'answers.csv').stat().st_size > 10_000
    assert not (folder / 'example_cpp').exists()


def test_the_library_tells_its_configuration_and_needs_nothing_but_libm(exported: Path):
    document = (exported / 'configuration.json').read_text()
    assert document == snapshot_text(first_snapshot(Estimator(SEALS).configuration))
    library = exported / 'libseal_friction.so'
    assert digest(document).encode() in library.read_bytes()
    linked = subprocess.run(['ldd', library], capture_output=True, text=True, check=True).stdout
    needed = {line.split()[0].split('/')[-1] for line in linked.splitlines()}
    assert {name for name in needed if not name.startswith(('linux-vdso', 'ld-linux'))} <= {'libm.so.6', 'libc.so.6'}
    symbols = subprocess.run(['nm', library], capture_output=True, text=True, check=True).stdout
    wanted = set(re.findall(r' U (\w+)', symbols))
    assert wanted <= {'exp', 'log', 'pow', 'sqrt', 'tanh', 'memcpy', 'memset', 'memcmp'}  # no allocation among them
    assert not re.findall(r' [bBdD] (?!_|completed)(\w+)', symbols)  # no hidden state


def test_a_folder_of_somebody_else_a_name_that_c_does_not_take_and_no_seals_are_refused(tmp_path: Path, capsys):
    (tmp_path / 'mine.txt').write_text('mine')
    assert main(['export', 'c', 'delft_o_ring', '--out', str(tmp_path)]) == 2
    assert 'a folder but no C library' in capsys.readouterr().err
    for name in ('my-lib', 'example'):
        assert main(['export', 'c', 'delft_o_ring', '--name', name, '--out', str(tmp_path / 'new')]) == 2
        assert f'--name {name}' in capsys.readouterr().err
    assert main(['export', 'c', '--out', str(tmp_path / 'new')]) == 2
    assert 'no seals' in capsys.readouterr().err
    assert not (tmp_path / 'new').exists()


def test_a_compiler_that_fails_is_told_in_one_line(tmp_path: Path, capsys, monkeypatch):
    (tmp_path / 'cc').write_text('#!/bin/sh\necho "cc: error: no space left" >&2\nexit 1\n')
    (tmp_path / 'cc').chmod(0o755)
    monkeypatch.setenv('PATH', str(tmp_path), prepend=':')
    for kind in ('c', 'fmu'):
        assert main(['export', kind, 'delft_o_ring', '--out', str(tmp_path / f'new.{kind}')]) == 2
        assert 'fails: cc: error: no space left\n' in capsys.readouterr().err


def test_a_library_named_like_a_module_compiles_with_all_warnings_but_not_to_inaccurate_numbers(tmp_path: Path):
    made = sources(DEFAULT, '{}', 'pipeline')
    for file in ('pipeline.c', 'pipeline.h'):
        (tmp_path / file).write_text(made[file])
    check = ['cc', '-std=c11', '-Wall', '-Wextra', '-Wconversion', '-Werror', '-fsyntax-only', 'pipeline.c']
    subprocess.run(check, cwd=tmp_path, check=True)
    refused = subprocess.run([*check, '-ffinite-math-only'], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert '#error' in refused.stderr
    for_others = [*check[:-1], '-E', '-U__GNUC__', 'pipeline.c']  # a compiler that has no pragma of its own
    kept = subprocess.run(for_others, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert '#pragma STDC FP_CONTRACT OFF' in kept
    assert 'an answer counts if its has_ is true' in made['pipeline.h']
    fused = ['-mfma'] if platform.machine() == 'x86_64' else []  # others have fused operations by default
    subprocess.run(['cc', '-std=gnu17', '-O2', *fused, '-S', 'pipeline.c'], cwd=tmp_path, check=True)
    assert not re.search(r'\bv?fn?m(add|sub|la|ls)', (tmp_path / 'pipeline.s').read_text())


def test_both_examples_read_stamps_as_numbers_and_refuse_those_out_of_bounds(exported: Path):
    def ran(rows: str) -> set[tuple[int, str]]:
        (exported / 'rows.csv').write_text(f'names\n{rows}')
        programs = [[f'./example_{language}', 'rows.csv'] for language in ('c', 'cpp')]
        runs = [subprocess.run(one, cwd=exported, capture_output=True, text=True, check=False) for one in programs]
        return {(run.returncode, run.stdout.partition('\n')[2]) for run in runs}

    plain = ran('1000000000,0.05,3e6,1e6,40.0\n1700000000000000001,0.05,,1e6\n')
    assert len(plain) == 1
    assert ran('1e9,0.05,3e6,1e6,40.0\n\n1700000000000000001,0.05,none,1e6\n') == plain
    assert ran('-1,0.05,3e6,1e6\n') == {(1, '')}


def test_a_stamp_that_goes_back_is_taken_with_its_status(fresh: CEstimator):
    for stamp in (2_000_000, 1_000_000):
        answers = fresh.step(LoopSample(stamp, 0.05, 3e6, 1e6))
    (estimate,) = [one for one in (decode(*each) for each in answers) if isinstance(one, FrictionEstimate)]
    assert estimate.status & Status.STAMP_NOT_INCREASING


class Odd(NamedTuple):
    """A record."""

    force: float  # [N] `a*/b`


def test_the_load_of_a_rod_tells_which_temperature_counts():
    assert f'not {COLDEST:g} to {HOTTEST:g} K' in meanings_of(RodLoad)['temperature']
    scaled = with_seals(ACTUATORS['others']).estimator
    assert scaled.has_temperature_scale
    at = {kelvin: friction_on_rod(scaled, RodLoad(0.05, 3e6, 1e6, 0.0, kelvin - 273.15)) for kelvin in TEMPERATURES}
    of_file = friction_on_rod(scaled, RodLoad(0.05, 3e6, 1e6))
    assert [kelvin for kelvin in TEMPERATURES if at[kelvin] == of_file] == [COLDEST - 1.0, HOTTEST + 1.0]


def test_a_comment_of_a_member_stays_a_comment_in_c():
    assert meanings_of(Odd) == {'force': '[N] a* /b'}


def test_the_example_runs_clean_under_the_sanitizers(tmp_path: Path):
    for file, text in sources(first_configuration('faults').parameters(), '{}', 'rod').items():
        (tmp_path / file).write_text(text)
    (tmp_path / 'example.csv').write_text(example_samples())
    flags = 'CFLAGS=-O0 -Werror -fsanitize=address,undefined -fno-sanitize-recover=all'
    subprocess.run(['make', '-s', 'example_c', flags], cwd=tmp_path, check=True)
    run = subprocess.run(['./example_c', 'example.csv'], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert len(run.stdout.splitlines()) == 1001
    assert run.stderr == ''
