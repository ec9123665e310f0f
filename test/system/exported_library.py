"""The exported C library and FMU against compiled replay: ``python test/system/exported_library.py``.

A row for each actuator: random messages of a rod with sensor faults, among them late ones, and how many answers differ
from those of `compiled_pipeline` in a byte. Then as many random samples of a loop, and those of the reference bags:
through the C++ example, and through FMUs of FMI 3.0 and 2.0 by FMPy. Then the builds: gcc and clang (package ziglang)
with all warnings as errors, the sanitizers, and valgrind if there is one. Exit code 1: something differs.
"""

import dataclasses
import hashlib
import math
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from core.estimation.test_compiled_pipeline import (
    ACTUATORS,
    MS,
    TYPES,
    in_memory,
    noisy,
    receipts,
    serialised,
    with_seals,
)
from harness.c_library import CEstimator, first_configuration
from harness.campaign import parser_of, tell_tables
from harness.compensation import COMPENSATING, compensating
from harness.fmu import got, put, running
from paths import ROOT

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.compiled_pipeline import receive_all
from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.core.estimation.loop import LoopSample, RodLoad, friction_on_rod
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, init
from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, FEEDFORWARD_TYPE
from seal_friction_ros.core.messages.records import (
    FeedForward,
    Force,
    FrictionEstimate,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
)
from seal_friction_ros.offline.export.c_library import example_samples, export_c, samples_of, sources
from seal_friction_ros.offline.export.fmu import export_fmu

BLOCK = 20_000  # messages
GCC, CLANG = ['CC=gcc', 'CXX=g++'], ['CC={} -m ziglang cc', 'CXX={} -m ziglang c++']
CLANG = [text.format(sys.executable) for text in CLANG]
BUILDS = {
    'gcc': [*GCC, 'CFLAGS=-O2 -Werror', 'CXXFLAGS=-O2 -Werror'],
    'gcc -O3': [*GCC, 'CFLAGS=-O3 -Werror', 'CXXFLAGS=-O3 -Werror'],
    'clang': [*CLANG, 'CFLAGS=-O2 -Werror', 'CXXFLAGS=-O2 -Werror'],
    'address and undefined behaviour': [
        *GCC, *(f'{name}=-O1 -g -Werror -fsanitize=address,undefined -fno-sanitize-recover=all'
                for name in ('CFLAGS', 'CXXFLAGS')),
    ],
}  # fmt: skip


def blocks(messages: int) -> Iterator[Any]:
    """Messages, their times of receipt and of sending."""
    for seed in range(-(-messages // BLOCK)):
        pieces = noisy(BLOCK // 4, seed)
        times = [1_000_000_000 * 100 * seed + received for received in receipts(pieces)]
        sent = [received - (40_000_000 if i % 50 == 7 else 0) for i, received in enumerate(times)]
        yield pieces, times, sent


def compared(name: str, parameters: PipelineParameters, messages: int, folder: Path) -> dict[str, Any]:
    """Messages, answers, and how many of these differ from compiled replay."""
    library, state, done, answers, differing = CEstimator(parameters, folder, name), init(parameters), 0, 0, 0
    for pieces, times, sent in blocks(messages):
        state, found = receive_all(parameters, state, in_memory(pieces, times, sent))
        places = zip(*(column.tolist() for column in found[1:]), strict=True)
        for (kind, data), received, left, (a, b, c, d) in zip(pieces, times, sent, places, strict=True):
            expected = [found.data[first : first + size].tobytes() for first, size in ((a, b), (c, d)) if size]
            got = [data for _, data in library.receive(decode(TYPES[kind], data), received, left, b'rod')]
            answers, differing = answers + len(got), differing + (got != expected)
        done += len(pieces)
    same = repr(library.known()) == repr(state)
    return {'messages': done, 'answers': answers, 'differing': differing, 'same state': same}


def loop_samples(number: int) -> Iterator[list[LoopSample]]:
    """Blocks of random samples of a rod that goes to and fro, with sensor faults and stamps that leap or go back.

    The force sum is the friction of the actuator `ADAPTING`, a tenth higher, so that it adapts.
    """
    random, stamp, parameters = np.random.default_rng(3), 0, ADAPTING.parameters().estimator
    for start in range(0, number, BLOCK):
        i = np.arange(start, min(start + BLOCK, number))
        speed = np.maximum(np.abs(np.sin(i / 300)) - 0.3, 0.0) * np.copysign(0.05, np.sin(i / 300))
        noise = random.normal(size=(7, len(i)))
        values = np.array([
            speed + 1e-4 * noise[0], 2e6 + 2.2e6 * np.sin(i / 700) + 1e4 * noise[1], 5e5 + 1e4 * noise[2],
            noise[3], speed + 1e-4 * noise[4], 0.1 * noise[5], 20.0 + noise[6],
        ])  # fmt: skip
        loads = map(RodLoad, *values[:3].tolist(), (60.0 * np.sin(i / 300 + 0.3)).tolist())
        values[3] += [1.1 * friction_on_rod(parameters, load).friction_force for load in loads]
        faulty = random.random(values.shape) < 0.02
        values[faulty] = random.choice([math.nan, math.nan, math.inf, -math.inf, 0.0, 1e300, -3e7], faulty.sum())
        is_cut = (i // 400 % 7)[None] == np.arange(7)[:, None]  # each input is away for 0.4 s now and then
        values[is_cut & (i // 2800 % 3 == 1)] = math.nan
        leaps = random.choice([MS, 0, -5 * MS, 300 * MS], len(i), p=[0.997, 0.001, 0.001, 0.001]).tolist()
        stamps = [stamp := max(stamp + leap, 0) for leap in leaps]
        yield [LoopSample(at, *row) for at, row in zip(stamps, values.T.tolist(), strict=True)]


def bag_samples(bag: str) -> Iterator[list[LoopSample]]:
    """Samples of a reference bag, as its export writes them."""
    rows = [row.split(',') for row in samples_of(ROOT / 'bags' / bag).splitlines()[1:]]
    yield [LoopSample(int(stamp), *(float(one or 'nan') for one in rest)) for stamp, *rest in rows]


def messages_of(sample: LoopSample) -> Iterator[Any]:
    """Messages that a sample stands for, in order."""
    stamp, velocity, a, b, force, wanted, acceleration, temperature = sample
    if not math.isnan(a):
        yield Pressure(stamp, a, b)
    if not math.isnan(force):
        yield Force(stamp, force)
    if not math.isnan(temperature):
        yield Temperature(stamp, temperature)
    if not math.isnan(wanted):
        yield ServoReference(stamp, 0.0, wanted, acceleration)
    yield Velocity(stamp, velocity)


def replayed(parameters: PipelineParameters, blocks: Iterable[list[LoopSample]]) -> Iterator[tuple[Any, ...]]:
    """Each sample with its estimate and newest feed-forward by compiled replay, and whether the latter is of now."""
    state, newest = init(parameters), FeedForward(0, 0.0, 0.0, 0)
    for block in blocks:
        messages = [[*messages_of(sample)] for sample in block]
        times = [one.stamp for some in messages for one in some]
        pieces = [serialised(one, b'') for some in messages for one in some]
        state, found = receive_all(parameters, state, in_memory(pieces, times, times))
        last = np.cumsum([len(some) for some in messages]) - 1  # the velocity
        places = zip(*(column[last].tolist() for column in found[1:]), strict=True)
        for sample, (a, b, c, d) in zip(block, places, strict=True):
            newest = decode(FEEDFORWARD_TYPE, found.data[c : c + d].tobytes()) if d else newest
            yield sample, decode(ESTIMATE_TYPE, found.data[a : a + b].tobytes()), newest, bool(d)


def printed(estimate: FrictionEstimate, force: float) -> str:
    """The line of the examples."""
    reals = f'{estimate.friction_force:.17g},{estimate.coulomb_friction:.17g},{estimate.coulomb_friction_std:.17g}'
    return f'{estimate.stamp},{reals},{estimate.state},{estimate.status},{force:.17g}\n'


def bytes_of(numbers: Iterable[float]) -> bytes:
    """Numbers to the byte, so that 0.0 is not -0.0."""
    return b''.join(struct.pack('q' if isinstance(each, int) else 'd', each) for each in numbers)


ADAPTING = dataclasses.replace(
    compensating(presliding=True), adaptation=AdaptationSettings(mode='on', moving_mass=20.0)
)
OUTPUTS = (*FrictionEstimate._fields[1:], *(f'feedforward_{name}' for name in FeedForward._fields[1:]))


def in_loop(configuration: Configuration, blocks: Iterable[list[LoopSample]], folder: Path) -> dict[str, Any]:
    """Samples, and how many answers of the C++ example and of each FMU differ from compiled replay."""
    export_c(configuration, folder)
    done, expected, differing = 0, folder / 'expected.csv', {'C++': 0, 'FMI 3.0': 0, 'FMI 2.0': 0}
    with ExitStack() as stack:
        fmus = {}
        for version in ('3', '2'):
            export_fmu(configuration, folder / 'estimator.fmu', fmi=version)
            fmus[f'FMI {version}.0'] = stack.enter_context(running(folder / 'estimator.fmu'))
        inputs, lines = (stack.enter_context(path.open('w')) for path in (folder / 'example.csv', expected))
        inputs.write('names\n')
        for sample, estimate, force, is_new in replayed(configuration.parameters(), blocks):
            done += 1
            inputs.write(','.join(map(repr, sample)) + '\n')
            lines.write(printed(estimate, force.force if is_new else 0.0))
            answer = bytes_of([*estimate[1:], *force[1:]])
            for name, (fmu, variables) in fmus.items():
                put(fmu, variables, sample)
                fmu.doStep(sample.stamp * 1e-9, 1e-3)
                differing[name] += bytes_of(got(fmu, variables, OUTPUTS)) != answer
    with (folder / 'answers.csv').open('w') as answers:
        subprocess.run(['./example_cpp', 'example.csv'], cwd=folder, check=True, stdout=answers)
    with (folder / 'answers.csv').open() as answers, expected.open() as lines:
        next(answers)
        differing['C++'] = sum(one != other for one, other in zip_longest(answers, lines))
    return {'samples': done, **{f'differing, {name}': number for name, number in differing.items()}}


def built(name: str, options: list[str], folder: Path) -> dict[str, Any]:
    """What the examples print in one build; both languages alike."""
    for file, text in sources(with_seals(ACTUATORS['default']), '{}', 'rod').items():
        (folder / file).write_text(text)
    (folder / 'example.csv').write_text(example_samples())
    subprocess.run(['make', '-s', 'clean'], cwd=folder, check=True)
    languages = ('c',) if name == 'clang' else ('c', 'cpp')  # clang of ziglang compiles its C++ library first: minutes
    examples = [f'example_{language}' for language in languages]
    subprocess.run(['make', '-s', 'lib', *examples, *options], cwd=folder, check=True)
    runs = [[f'./{example}', 'example.csv'] for example in examples]
    if name == 'gcc' and shutil.which('valgrind'):
        runs.append(['valgrind', '-q', '--error-exitcode=9', '--leak-check=full', *runs[0]])
    printed = {subprocess.run(run, cwd=folder, check=True, capture_output=True).stdout for run in runs}
    first = sorted(printed)[0]
    digest = hashlib.sha256(first).hexdigest()[:8]  # one for all builds
    return {'runs': len(runs), 'lines': first.count(b'\n'), 'different outputs': len(printed), 'digest': digest}


def main() -> int:
    """Compare, build and print; 1 if something differs."""
    arguments = parser_of(__doc__ or '', messages=(1_000_000, 'messages, and samples, for each actuator')).parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases = {'default': {}, 'others': {'presliding': True}}
        found = {case: compared(case, with_seals(ACTUATORS[case], **changes), arguments.messages, folder)
                 for case, changes in cases.items()}  # fmt: skip
        loops = {'random samples': in_loop(ADAPTING, loop_samples(arguments.messages), folder)}
        for bag in ('pull_test', 'faults'):
            configuration = dataclasses.replace(first_configuration(bag), feedforward=COMPENSATING)
            loops[bag] = in_loop(configuration, bag_samples(bag), folder)
        builds = {case: built(case, options, folder) for case, options in BUILDS.items()}
    titles = 'C against compiled replay', 'C++ example and FMUs against compiled replay', 'Builds'
    tell_tables(dict(zip(titles, (found, loops, builds), strict=True)), as_json=arguments.json)
    rows = [*found.values(), *loops.values()]
    outputs = {(row['digest'], row['different outputs']) for row in builds.values()}
    differing = sum(value for row in rows for name, value in row.items() if name.startswith('differing'))
    return int(bool(differing) or len(outputs) > 1 or not all(row['same state'] for row in found.values()))


if __name__ == '__main__':
    sys.exit(main())
