"""The Python interface: what the commands do, to the same numbers, with errors of one line."""

import inspect
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas
import pytest
import xarray
from paths import ROOT

import seal_friction_ros
from seal_friction_ros import (
    Columns,
    Estimator,
    FrictionState,
    RecordedAxisSettings,
    Status,
    TuningSettings,
    compare,
    identify,
    load_seal,
    read_bag,
    replay,
    report,
    tune,
)
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.messages import layouts
from seal_friction_ros.core.messages.coder import DECODERS, encode
from seal_friction_ros.files import config_path
from seal_friction_ros.offline.bags.actuator_bag import ActuatorBag, open_actuator
from seal_friction_ros.offline.bags.bag import read_messages
from seal_friction_ros.offline.bags.recorded_run import read_run

PULL_TEST, FAULTS = ROOT / 'bags' / 'pull_test', ROOT / 'bags' / 'faults'
SEAL = 'ms28775_114'
BLOCKED = """
import importlib.abc, sys
class Blocker(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name.partition('.')[0] not in {*sys.stdlib_module_names, 'numpy', 'seal_friction_ros'}:
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Blocker())
before = set(sys.modules)
import seal_friction_ros
print(len(dir(seal_friction_ros)), *sorted(set(sys.modules) - before - sys.stdlib_module_names))
"""


def test_the_import_needs_the_standard_library_alone_and_loads_no_other_module():
    run = subprocess.run(
        [sys.executable, '-c', BLOCKED], capture_output=True, text=True, check=True, cwd=ROOT,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
    )  # fmt: skip
    names, *loaded = run.stdout.split()
    assert loaded == ['seal_friction_ros']
    assert int(names) > len(seal_friction_ros.__all__)


def test_every_name_of_the_interface_is_there_typed_and_documented():
    assert set(seal_friction_ros.__all__) <= set(dir(seal_friction_ros))
    with pytest.raises(AttributeError, match='no attribute'):
        _ = seal_friction_ros.nothing
    for name in seal_friction_ros.__all__:
        found = getattr(seal_friction_ros, name)
        assert found.__doc__, name
        if inspect.isfunction(found):
            assert '' not in {one.annotation for one in inspect.signature(found).parameters.values()}
            assert 'return' in found.__annotations__, name


# -- a seal -----------------------------------------------------------------------------------------------------------


def test_the_friction_of_a_seal_is_that_of_the_estimator_with_the_sign_of_the_velocity():
    seal = load_seal(SEAL)
    expected = actuator_friction((MountedSeal(seal, 'a'),), 35e5, 0.0, 0.05)
    friction = expected.coulomb_friction + expected.velocity_friction
    assert seal.friction(35e5, 0.05) == friction
    assert seal.friction(35e5, -0.05) == -friction
    assert seal.friction(35e5, 0.0) == 0.0
    assert seal.friction_std(35e5, 0.05) == expected.coulomb_friction_std
    assert seal.breakaway(35e5) == expected.coulomb_friction + expected.stiction > friction


def test_arrays_broadcast_and_what_is_not_known_stays_unknown():
    seal = load_seal(config_path('seals', SEAL))
    pressures, speeds = np.array([[0.0], [35e5], [np.nan]]), np.array([-0.1, 0.1])
    friction = seal.friction(pressures, speeds)
    assert friction.shape == (3, 2)
    assert friction[1].tolist() == [-seal.friction(35e5, 0.1), seal.friction(35e5, 0.1)]
    assert np.isnan(friction[2]).all()
    assert seal.breakaway([0.0, 35e5]).tolist() == [seal.breakaway(0.0), seal.breakaway(35e5)]


# -- a bag, and the estimator -----------------------------------------------------------------------------------------


@pytest.mark.parametrize('bag', [PULL_TEST, FAULTS])
def test_the_inputs_of_a_bag_through_the_estimator_give_its_bytes(bag: Path):
    """Faults included: inputs that stop, jump and are no numbers, and a reference."""
    actuator = open_actuator(bag)
    made, recorded = dict(answers_of(actuator, bag)), {}
    for message in read_messages(bag):
        if message.topic in actuator.topics.answers.values():
            recorded.setdefault(message.topic, []).append(message.data)
    assert made == recorded
    assert sum(map(len, recorded.values())) >= 900


def answers_of(actuator: ActuatorBag, bag: Path) -> Iterator[tuple[str, list[bytes]]]:
    """Topic and bytes of what an `Estimator` answers to each input of a bag, in order."""
    estimator, answers = Estimator(configuration=read_bag(bag).configuration), {}
    for message in read_messages(bag):
        if message.topic in actuator.topics.inputs:
            record = DECODERS[message.type_name](message.data)
            for answer in estimator.receive(record, message.log_time, message.publish_time):
                kind = layouts.ESTIMATE_TYPE if hasattr(answer, 'state') else layouts.FEEDFORWARD_TYPE
                frame = getattr(record, 'frame_id', b'')
                answers.setdefault(actuator.topics.answers[kind], []).append(encode(answer, frame))
    yield from answers.items()


def test_the_columns_of_a_bag_are_its_run_and_go_through_the_estimator():
    columns, run = read_bag(PULL_TEST), read_run(PULL_TEST)
    for name in columns:
        assert np.array_equal(columns[name], getattr(run, name), equal_nan=True)
    made = Estimator(configuration=columns.configuration).over(columns)
    fields = ('friction_force', 'coulomb_friction_std', 'state', 'status', 'adaptation_scale', 'residual')
    assert all(np.array_equal(made[name], columns[name]) for name in fields)
    assert np.isnan(made['feedforward_force']).all()
    assert columns.start == run.start
    assert repr(columns).startswith('Columns of 900 samples: time, velocity')


def test_another_seal_makes_the_estimates_of_a_bag_anew():
    seal = load_seal('delft_o_ring')
    anew = read_bag(PULL_TEST, seals=['delft_o_ring@a', 'delft_o_ring@b'])
    sliding = (anew['state'] == FrictionState.SLIDING) & (anew['status'] & Status.MOTION_UNCERTAIN == 0)
    speeds = [anew[name][sliding] for name in ('pressure_a', 'pressure_b', 'velocity')]
    expected = seal.friction(speeds[0], speeds[2]) + seal.friction(speeds[1], speeds[2])
    np.testing.assert_allclose(anew['friction_force'][sliding], expected, rtol=1e-12)
    assert sliding.sum() > 100
    assert np.array_equal(anew['velocity'], read_bag(PULL_TEST)['velocity'])


def test_a_step_takes_what_is_new_and_a_reference_makes_a_feedforward():
    parameters = ROOT / 'config' / 'friction_estimator.yaml'
    estimator, one = Estimator([f'{SEAL}@a', f'{SEAL}@b'], parameters), load_seal(SEAL)
    for tick in range(40):
        found = estimator.step(0.01 * tick, 0.05, 35e5, 35e5, 40.0, reference_velocity=0.05)
    assert found.friction_force == pytest.approx(2 * one.friction(35e5, 0.05))
    assert found.status == 0
    assert estimator.feedforward is not None
    assert estimator.step(0.4, 0.05, np.nan).status == 0  # the pressure of 0.01 s ago still holds
    assert estimator.step(5.0, 0.05, np.nan).status & Status.PRESSURE_STALE


def test_columns_become_a_data_frame_and_a_data_set():
    columns = read_bag(PULL_TEST)
    frame, data = columns.to_pandas(), columns.to_xarray()
    assert isinstance(frame, pandas.DataFrame)
    assert isinstance(data, xarray.Dataset)
    assert frame.index.name == 'time'
    assert frame['friction_force'].sum() == data['friction_force'].values.sum() == columns['friction_force'].sum()
    made = Estimator(configuration=columns.configuration).over(frame.reset_index())
    assert np.array_equal(made['friction_force'], columns['friction_force'])


# -- what the commands do ---------------------------------------------------------------------------------------------


def test_replay_and_compare_are_the_commands(tmp_path: Path):
    assert replay(PULL_TEST).identical
    out = tmp_path / 'other'
    assert not replay(str(PULL_TEST), seals='delft_o_ring', out=out).identical
    found = compare(PULL_TEST, out)
    assert not found.agree
    assert found.fields['friction_force'].largest > 1.0
    assert compare(PULL_TEST, out, atol=1e3, tolerances={'friction_force': None}).agree


def test_identify_writes_a_seal_that_it_gives(tmp_path: Path):
    out = tmp_path / 'mine.yaml'
    found = identify(ROOT / 'data' / 'thesis' / 'friction_tests.csv', name='mine', chambers=('a', 'b'), out=out)
    assert found.document['name'] == load_seal(out).name == 'mine'
    assert load_seal(out).friction(35e5, 0.05) == pytest.approx(load_seal(SEAL).friction(35e5, 0.05), rel=0.05)
    out.write_text('of somebody')
    with pytest.raises(ValueError, match='not overwriting it'):
        identify(PULL_TEST, out=out)


def test_report_writes_the_page_and_gives_its_numbers(tmp_path: Path):
    numbers = report(PULL_TEST, tmp_path / 'page.html')
    assert numbers['level'] == 'good'
    assert (tmp_path / 'page.html').is_file()


@pytest.mark.parametrize(
    ('call', 'said'),
    [
        (lambda: load_seal('nothing'), 'config/seals has no nothing'),
        (lambda: load_seal(ROOT), 'Is a directory'),
        (lambda: read_bag('nowhere'), 'nowhere: not a readable bag'),
        (lambda: replay('nowhere'), 'nowhere: not a readable bag'),
        (lambda: compare(PULL_TEST, 'nowhere'), 'nowhere: not a readable bag'),
        (lambda: identify('nowhere.csv'), 'nowhere.csv: No such file'),
        (lambda: identify([]), 'no source'),
        (lambda: tune(PULL_TEST), 'no message of seal_friction_msgs/msg/ServoReference'),
        (lambda: tune(settings=RecordedAxisSettings()), 'but TuningSettings are needed'),
        (lambda: tune(PULL_TEST, settings=TuningSettings()), 'but RecordedAxisSettings are needed'),
        (Estimator, 'no seals: name a seal file'),
        (lambda: Estimator(SEAL, 'nowhere.yaml'), 'nowhere.yaml: No such file'),
        (lambda: Estimator(SEAL).over({'time': [0.0]}), 'samples have no column velocity'),
        (
            lambda: Estimator(SEAL).over({'time': [0.0], 'velocity': [0.1, 0.2], 'pressure_a': [1.0]}),
            'differ in length',
        ),
        (lambda: Estimator(SEAL).step(math.nan, 0.1, 1e6), 'time = nan s is not finite'),
        (lambda: Estimator(SEAL).step(math.inf, 0.1, 1e6), 'time = inf s is not finite'),
        (lambda: load_seal(SEAL).friction('much', 0.1), 'could not convert string'),
    ],
)
def test_bad_input_is_one_line(call, said: str):
    with pytest.raises(ValueError, match=said) as error:
        call()
    assert '\n' not in str(error.value)


def test_a_missing_package_is_named():
    columns = Columns({'time': np.zeros(1)})
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, 'pandas', None)
        with pytest.raises(seal_friction_ros.MissingPackageError, match='pandas is not installed'):
            columns.to_pandas()
