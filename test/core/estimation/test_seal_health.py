"""What ``~/health`` says of starts and loads is what the machine did."""

import math
from dataclasses import replace
from statistics import median

import pytest
from harness.simulated_day import Day, samples
from paths import ROOT

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, step
from seal_friction_ros.core.estimation.records import NO_ESTIMATE
from seal_friction_ros.core.estimation.seal_health import SealHealth, Starts, followed, health_values, with_sample
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import SLIDING, STUCK
from seal_friction_ros.files import read_yaml

SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
FRICTION = actuator_friction(SEALS, 3e6, 3e6).coulomb_friction  # [N]
PARAMETERS = EstimatorParameters(EstimatorSettings(), SEALS, AdaptationSettings('observe'))
MS = 1_000_000  # [ns]


def starts_of(peaks, rest):
    """Starts with these peaks [-], each after a rest [ms], then 500 ms of sliding at the Coulomb friction."""
    known, stamp = Starts(), 0
    for peak in peaks:
        for kind, milliseconds in ((STUCK, rest), (SLIDING, 500)):
            for i in range(milliseconds // 10):
                stamp += 10 * MS
                friction = peak if kind == SLIDING and i == 3 else 1.0
                estimate = NO_ESTIMATE._replace(stamp=stamp, state=kind, coulomb_friction=40.0, friction_force=-40.0)
                known = with_sample(known, estimate._replace(residual=-40.0 * (friction - 1.0)))
    return known


def test_the_friction_of_a_start_is_its_peak_with_its_standard_deviation():
    starts = starts_of([1.5, 1.7, 1.6], rest=1000)
    assert starts.number == 3
    assert starts.mean == pytest.approx(1.6)
    assert starts.std == pytest.approx(0.1 / math.sqrt(3.0))


def test_a_reversal_is_no_start():
    assert starts_of([1.5] * 4, rest=100).number == 0


def test_one_start_has_no_standard_deviation():
    assert math.isnan(starts_of([1.5], rest=1000).std)


def health_after(day, seconds, parameters=PARAMETERS):
    state, health = estimator.init(parameters), SealHealth()
    for sample in samples(day, seconds, 0):
        before = state
        state, _ = step(parameters, state, sample)
        health = followed(health, parameters, before, state)
    return state, health


def values_after(day, seconds):
    state, health = health_after(day, seconds)
    return health_values(PARAMETERS, state.adaptation, health, Starts())


@pytest.mark.parametrize('share', [0.0, 0.5])
def test_the_offset_is_given_as_a_share_of_the_friction(share):
    told = values_after(replace(Day(FRICTION), load=lambda _: share * FRICTION), 20.6)
    assert float(told['offset over friction']) == pytest.approx(share, abs=0.08)


def test_a_friction_that_rises_after_the_first_reversals_is_told_as_a_ratio_to_them():
    told = values_after(replace(Day(FRICTION), scale=lambda time: 1.0 + 0.1 * (time > 25.0)), 35.0)
    assert float(told['scale over that of the first reversals']) == pytest.approx(1.1, abs=0.03)


def test_beyond_the_identified_pressures_nothing_is_learnt_but_reversals_are_seen():
    beyond = tuple(replace(mounted, seal=replace(mounted.seal, pressure_max=1e6)) for mounted in SEALS)
    state, health = health_after(replace(Day(FRICTION), scale=lambda _: 1.3), 12.0, replace(PARAMETERS, seals=beyond))
    assert state.adaptation.learnt.reversals == 0
    assert len(health.reversals) > 5
    assert median(reversal.ratio for reversal in health.reversals) == pytest.approx(1.3, rel=0.05)
