"""Exported FMUs simulate what Python computes, and the exported C builds with clang, too."""

import dataclasses
import math
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from harness.compensation import COMPENSATING
from paths import ROOT

from seal_friction_ros import Estimator
from seal_friction_ros.core.estimation.loop import LoopSample, RodLoad, friction_on_rod, receive_sample
from seal_friction_ros.core.estimation.pipeline import init
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


@contextmanager
def running(path: Path) -> Iterator[tuple[Any, dict[str, Any]]]:
    """An instance of an FMU after its initialisation, and its variables by name."""
    description, folder = read_model_description(path), extract(path)
    kind = FMU2Slave if description.fmiVersion == '2.0' else FMU3Slave
    identifier = description.coSimulation.modelIdentifier
    fmu = kind(guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName='one')
    fmu.instantiate()
    if kind is FMU2Slave:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    yield fmu, {variable.name: variable for variable in description.modelVariables}
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(folder)


def put(fmu: Any, variables: dict[str, Any], record: Any) -> None:
    """Set the inputs that are named as fields of a record."""
    names = [name for name in record._fields if name != 'stamp']
    function = fmu.setReal if isinstance(fmu, FMU2Slave) else fmu.setFloat64
    function([variables[name].valueReference for name in names], [getattr(record, name) for name in names])


def got(fmu: Any, variables: dict[str, Any], names: list[str]) -> list[float]:
    found = []
    for name in names:
        variable = variables[name]
        is_real = variable.type in ('Real', 'Float64')
        function = 'get' + ({True: 'Real', False: 'Integer'} if isinstance(fmu, FMU2Slave) else
                            {True: 'Float64', False: 'Int64'})[is_real]  # fmt: skip
        found += getattr(fmu, function)([variable.valueReference])
    return found


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


def test_the_sources_in_the_fmu_build_with_clang_without_a_warning(exported):
    folder = Path(extract(exported[1])) / 'sources'
    clang = [sys.executable, '-m', 'ziglang', 'cc', '-std=c11', '-O0', '-Wall', '-Wextra', '-Werror', '-c']
    for file in folder.glob('*.c'):
        subprocess.run([*clang, file.name, '-o', f'{file.stem}.o'], cwd=folder, check=True)


def test_the_controller_of_the_docs_compiles_against_stand_in_headers(tmp_path: Path):
    page = (ROOT / 'docs' / 'controllers.md').read_text()
    (source,) = (text for text in re.findall(r'```cpp\n(.*?)```', page, re.DOTALL) if 'seal_friction.h' in text)
    (tmp_path / 'controller.cpp').write_text(source)
    (tmp_path / 'seal_friction.h').write_text(sources(PARAMETERS, '{}', 'seal_friction')['seal_friction.h'])
    headers = ROOT / 'test' / 'harness' / 'ros2_control'
    check = ['c++', '-std=c++17', '-Wall', '-Wextra', '-Werror', '-fsyntax-only', '-I', str(headers), 'controller.cpp']
    subprocess.run(check, cwd=tmp_path, check=True)
