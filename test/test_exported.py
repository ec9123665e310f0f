"""Exported FMUs simulate what Python computes, the exported C builds with clang, too, and the C++ of the docs runs."""

import ctypes
import dataclasses
import math
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from harness.compensation import COMPENSATING
from harness.fmu import got, put, running
from paths import ROOT

from seal_friction_ros import Estimator
from seal_friction_ros.core.estimation.loop import LoopSample, RodLoad, friction_on_rod, receive_sample
from seal_friction_ros.core.estimation.pipeline import init
from seal_friction_ros.core.friction.states import StateFriction
from seal_friction_ros.core.messages.records import FeedForward, FrictionEstimate
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.export.c_library import sources
from seal_friction_ros.offline.export.fmu import export_fmu

SEALS = ['ms28775_114@a', 'ms28775_114@b']
CONFIGURATION = dataclasses.replace(Estimator(SEALS).configuration, feedforward=COMPENSATING)
PARAMETERS = CONFIGURATION.parameters()
STEP = 1e-3  # [s]
MODELS = [('estimator', '3'), ('friction', '3'), ('estimator', '2'),
          pytest.param(('friction', '2'), marks=pytest.mark.long)]  # fmt: skip


@pytest.fixture(scope='module', params=MODELS)
def exported(request, tmp_path_factory) -> tuple[str, Path]:
    """A model and its FMU; the friction, which has no feed-forward, as the command makes it."""
    model, fmi = request.param
    path = tmp_path_factory.mktemp('fmu') / f'{model}.fmu'
    if model == 'friction':
        assert main(['export', 'fmu', *SEALS, '--model', model, '--fmi', fmi, '--out', str(path)]) == 0
    else:
        assert export_fmu(CONFIGURATION, path, model, fmi).has_binary
    return model, path


def samples() -> Iterator[LoopSample]:
    """A rod that goes to and fro, with faults."""
    random = np.random.default_rng(8)
    for i in range(600):
        values = [0.05 * math.sin(i / 90), 3e6, 1e6, 40.0 * math.sin(i / 90), 0.05 * math.sin(i / 90), 0.1, 20.0]
        faulty = [math.nan if random.random() < 0.03 else value for value in values]
        yield LoopSample(round(i * STEP * 1e9), *faulty)


def test_a_simulation_of_the_fmu_is_that_of_python_to_the_bit(exported):
    model, path = exported
    answers: list[Any] = []
    state = init(PARAMETERS)
    with running(path) as (fmu, variables):
        if model == 'friction':  # before any input
            expected = friction_on_rod(PARAMETERS.estimator, RodLoad(0.0, 0.0, 0.0))
            assert got(fmu, variables, [*expected._fields]) == list(expected)
        for i, sample in enumerate(samples()):
            if model == 'estimator':
                answers.clear()
                receive_sample(PARAMETERS, state, sample, lambda answer, _: answers.append(answer))
                put(fmu, variables, sample)
                fmu.doStep(i * STEP, STEP)
                estimate, force = answers[0], [one for one in answers if isinstance(one, FeedForward)]
                assert got(fmu, variables, [*FrictionEstimate._fields[1:]]) == list(estimate[1:])
                if force:
                    names = [f'feedforward_{name}' for name in FeedForward._fields[1:]]
                    assert got(fmu, variables, names) == list(force[0][1:])
            else:
                load = RodLoad(*sample[1:5], sample.temperature)
                put(fmu, variables, load)
                expected = friction_on_rod(PARAMETERS.estimator, load)
                assert got(fmu, variables, [*expected._fields]) == list(expected)


def test_a_tool_accepts_and_simulates_the_fmu(exported):
    model, path = exported
    assert validate_fmu(str(path)) == []
    times = np.arange(0.0, 0.5, STEP)
    side = np.sign(np.sin(20.0 * times))
    columns = {'time': times, 'velocity': 0.05 * side, 'pressure_a': 0.0 * times + 3e6, 'pressure_b': 0.0 * times + 1e6,
               'force_sum': 40.0 * side}  # fmt: skip
    given = np.array(list(zip(*columns.values(), strict=True)), dtype=[(name, float) for name in columns])
    for kind in ('CoSimulation',) if model == 'estimator' else ('CoSimulation', 'ModelExchange'):
        found = simulate_fmu(str(path), stop_time=0.4, output_interval=STEP, input=given, fmi_type=kind)
        assert set(np.sign(found['friction_force'])) >= {-1.0, 1.0}, kind


def test_a_refused_step_takes_no_time_and_no_token_makes_no_instance(exported):
    model, path = exported
    with running(path) as (fmu, variables):
        fmu.doStep(0.5, STEP)
        if model == 'estimator':
            with pytest.raises(FMICallException):
                fmu.doStep(-1.0, STEP)
        assert got(fmu, variables, ['time']) == [0.5 + STEP]
        function = fmu.dll[f'fmi{"2Instantiate" if isinstance(fmu, FMU2Slave) else "3InstantiateCoSimulation"}']
        function.restype, function.argtypes = ctypes.c_void_p, None
        assert function(*[None] * 12) is None


def test_garbage_makes_no_garbage_and_a_reset_instance_is_a_new_one(exported):
    model, path = exported
    is_estimator = model == 'estimator'
    outputs = FrictionEstimate._fields[1:] if is_estimator else StateFriction._fields
    given = [sample if is_estimator else RodLoad(*sample[1:5]) for sample in samples()]
    numbers, random = (math.nan, math.inf, -math.inf, 5e-324, 1e308, -1e308, -0.0, 3e6), np.random.default_rng(4)
    garbage = [type(one)(*random.choice(numbers, len(one)).tolist()) for one in given]

    def ran(fmu: Any, variables: dict[str, Any], inputs: list[Any], starts: Sequence[float]) -> Iterator[list[float]]:
        for at, one in zip(starts, inputs, strict=True):
            put(fmu, variables, one)
            with suppress(FMICallException):  # a time that is none
                fmu.doStep(at, STEP)
            yield got(fmu, variables, outputs)

    times = [i * STEP for i in range(len(given))]
    with running(path) as (bad, variables), running(path) as (good, _):
        pairs = zip(
            ran(bad, variables, garbage, random.choice([*numbers, 0.1, -0.1], len(given)).tolist()),
            ran(good, variables, given, times), strict=True,
        )  # fmt: skip
        alone = []
        for of_garbage, of_samples in pairs:
            assert np.all(np.isfinite(of_garbage))
            alone.append(of_samples)
        velocity, before = variables['velocity'].valueReference, got(bad, variables, ['velocity', *outputs])
        for reference in (99, variables[outputs[0]].valueReference):  # of nothing, and of an output
            with pytest.raises(FMICallException):
                (bad.setReal if isinstance(bad, FMU2Slave) else bad.setFloat64)([velocity, reference], [0.123, 1.0])
            assert np.array_equal(got(bad, variables, ['velocity', *outputs]), before, equal_nan=True)
        bad.reset()
        assert list(ran(bad, variables, given, times)) == alone


def test_the_sources_in_the_fmu_build_with_clang_without_a_warning(exported):
    folder = Path(extract(exported[1])) / 'sources'
    clang = [sys.executable, '-m', 'ziglang', 'cc', '-std=c11', '-O0', '-Wall', '-Wextra', '-Werror', '-c']
    for file in folder.glob('*.c'):
        made = subprocess.run(
            [*clang, file.name, '-o', f'{file.stem}.o'], cwd=folder, capture_output=True, text=True, check=False
        )
        assert (made.returncode, made.stderr) == (0, '')
        assert (folder / f'{file.stem}.o').stat().st_size > 0
    symbols = subprocess.run(['nm', 'fmu.o'], cwd=folder, capture_output=True, text=True, check=True).stdout
    assert ('friction_on_rod' in symbols) == (exported[0] == 'friction')  # the estimator computes none of a plant


def test_the_functions_of_the_fmu_are_those_of_the_headers_of_the_standard(exported):
    folder, headers = Path(extract(exported[1])) / 'sources', Path(fmpy.__file__).with_name('c-code')
    header = f'fmi{read_model_description(exported[1]).fmiVersion[0]}Functions.h'
    flags = ['-std=c11', '-O0', '-Wall', '-Wextra', '-Werror', '-I', str(headers), '-include', header, '-c']
    made = subprocess.run(['cc', *flags, 'fmu.c'], cwd=folder, capture_output=True, text=True, check=False)
    assert (made.returncode, made.stderr) == (0, '')  # a function of other parameters is an error
    symbols = subprocess.run(['nm', 'fmu.o'], cwd=folder, capture_output=True, text=True, check=True).stdout
    declared = re.findall(r'fmi\d\w+TYPE\s+(fmi\d\w+);', (headers / header).read_text())
    assert set(re.findall(r' T (\w+)', symbols)) == set(declared)


DRIVER = """
#include "controller.cpp"
#include <cstdio>

struct Loop : FrictionCompensation {
  Loop() {
    on_init(), on_export_reference_interfaces(), on_activate({});
    command_interfaces_.resize(1);
    state_interfaces_ = {{0.05}, {3e6}, {1e6}};
  }

  void run(double effort, double velocity, int samples) {
    for (int i = 0; i < samples; i++) {
      if (!std::isnan(velocity)) reference_interfaces_ = {effort, velocity};
      update_and_write_commands({now_ += 1000000}, {});
    }
    std::printf("%.17g\\n", command_interfaces_[0].value);
  }

  int64_t now_ = 0;
};

int main() {
  Loop loop;
  loop.run(NAN, NAN, 1);
  loop.run(5.0, 0.05, 500);
  loop.run(NAN, NAN, 500);
}
"""


def built_from_docs(word: str, driver: str, folder: Path, *arguments: str) -> list[float]:
    """What a driver prints that includes the C++ of docs/controllers.md with a word in it.

    The headers of ros2_control and rclcpp are stand-ins, those of the messages the real ones.
    """
    page = (ROOT / 'docs' / 'controllers.md').read_text()
    (source,) = (text for text in re.findall(r'```cpp\n(.*?)```', page, re.DOTALL) if word in text)
    (folder / 'controller.cpp').write_text(source)
    (folder / 'driver.cpp').write_text(driver)
    prefixes = [Path(sys.prefix), *map(Path, filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(':')))]
    messages = [f'-isystem{each}' for prefix in prefixes for each in sorted(prefix.glob('include/*'))]
    headers = ['-I', str(ROOT / 'test' / 'harness' / 'ros2_control'), *messages]
    flags = ['-std=c++17', '-O0', '-Wall', '-Wextra', '-Werror']
    subprocess.run(['c++', *flags, *headers, 'driver.cpp', *arguments, '-o', 'driver'], cwd=folder, check=True)
    printed = subprocess.run(['./driver'], cwd=folder, check=True, capture_output=True, text=True).stdout
    return [float(number) for number in printed.split()]


def test_the_controller_of_the_docs_adds_a_force_that_fades_when_upstream_stops(tmp_path: Path):
    for name, text in sources(PARAMETERS, '{}', 'seal_friction').items():
        (tmp_path / name).write_text(text)
    subprocess.run(['cc', '-std=c11', '-O0', '-c', 'seal_friction.c'], cwd=tmp_path, check=True)
    before, moving, stopped = built_from_docs('seal_friction.h', DRIVER, tmp_path, 'seal_friction.o')
    assert (before, stopped) == (0.0, 5.0)  # [N]
    assert moving > 6.0


SUBSCRIBER = """
#include "controller.cpp"
#include <cstdio>

int main() {
  using Message = seal_friction_msgs::msg::FrictionFeedForward;
  rclcpp::Node node;
  FeedForward feedforward(node);
  auto subscription = std::static_pointer_cast<rclcpp::Subscription<Message>>(node.newest.lock());
  auto told = [&] (int64_t milliseconds) {
    node.get_clock()->time = 1700000000000000000 + 1000000 * milliseconds;
    std::printf("%g\\n", feedforward.force());
  };
  told(0);
  Message message;
  message.header.stamp.sec = 1700000000;
  message.force = 7.5;
  subscription->take(message);
  for (int64_t age : {0, 49, 51, -49, -51}) told(age);
  return subscription->topic != "friction_feedforward";
}
"""


def test_the_subscriber_of_the_docs_gives_the_force_while_it_is_fresh(tmp_path: Path):
    assert built_from_docs('class FeedForward', SUBSCRIBER, tmp_path) == [0.0, 7.5, 7.5, 0.0, 7.5, 0.0]  # [N]
