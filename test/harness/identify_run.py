"""Runs of ``seal_friction identify`` on measurements, for tests."""

import io
import json
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from paths import ROOT

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings, step
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, init_running
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.messages.records import Force, FrictionEstimate, Pressure
from seal_friction_ros.files import load_configuration, read_yaml
from seal_friction_ros.offline.commands.main import main

DATA = ROOT.parent / 'shared' / 'data'
THESIS = ROOT / 'data' / 'thesis' / 'friction_tests.csv'
BARS = (1, 3, 5, 7)
DELFT = {
    'O-ring257': [4.7, 5.8, 7.1, 7.9],
    'X-ring257': [4.6, 6.5, 8.6, 15.5],
    'NAPN': [3.35, 6.91, 9.73, 11.93],
    'Stadium_lc': [4.78, 5.07, 6.38, 8.04, 10.47],
}
"""[N] half-range friction at 1, 3, 5, 7 bar, of Stadium_lc at 1 to 5 bar; README of the data"""
FRICTION_ID, OTHER = 'FrictionIDMovesWithBiasCurr.exp', '2022.01.28T16.46.31_new.exp'
KEYS = ('law', 'parameters', 'standard_errors', 'pressure_Pa', 'measured_N', 'fitted_N', 'cross_validation_error',
        'warnings')  # fmt: skip


def data(name: str) -> Path:
    path = DATA / name
    if not path.exists():
        pytest.skip(f'{name} of the shared data is not there')
    return path


def few_of_the_thesis(folder: Path) -> Path:
    """Its readings at four pressures, for tests that ask for no number of the thesis."""
    header, *rows = THESIS.read_text().splitlines()
    path = folder / 'few.csv'
    path.write_text('\n'.join([header, *(row for row in rows if row.split(',')[1] in ('100', '400', '700', '1000'))]))
    return path


def delft(ring: str) -> list[str]:
    return [str(data(f'delft/{ring}_{bar}bar.csv')) for bar in BARS]


class Run:
    """One run of the command, its figures and its seal file."""

    def __init__(self, folder: Path, *arguments: str, name: str = 'seal') -> None:
        self.out = folder / f'{name}.yaml'
        figures, errors = io.StringIO(), io.StringIO()
        with redirect_stdout(figures), redirect_stderr(errors):
            self.code = main(['identify', *arguments, '--out', str(self.out), '--json'])
        self.errors = errors.getvalue()
        self.figures = json.loads(figures.getvalue()) if self.code == 0 else {}

    @property
    def document(self):
        return read_yaml(self.out)

    def ladder(self, law: str):
        return next(rung for rung in self.figures['ladder'] if rung['law'] == law)

    def has_warning(self, *words: str) -> bool:
        return any(all(word in warning for word in words) for warning in self.figures['warnings'])


THESIS_RIG = ('--seal', 'ms28775_114', '--seal-chambers', 'a,b')


def estimates_of(run: Run, pressure: float, velocity: float, force: float = 0.0) -> FrictionEstimate:
    """What the estimator says with the identified seals at one sample."""
    chambers = tuple(run.figures['seal_chambers'])
    selection = SealSelection((str(run.out),) * len(chambers), chambers)
    parameters = load_configuration(selection, EstimatorSettings()).parameters().estimator
    sample = RodSample(10, velocity, Pressure(10, pressure, pressure), Force(10, force))
    state = init_running(PipelineParameters(parameters, FeedForwardSettings())).estimator
    return step(parameters, state, sample)[1]
