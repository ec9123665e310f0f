"""Tuned settings on rigid seals, on elastic ones, and on LuGre."""

from dataclasses import replace

import numpy as np
import pytest
from harness.compensation import COMPENSATING
from paths import ROOT

from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.pipeline import PipelineParameters
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.servo.closed_loop import Axis, AxisRun
from seal_friction_ros.core.servo.position_servo import ServoParameters
from seal_friction_ros.core.tuning.settings import TuningSettings
from seal_friction_ros.core.tuning.simulated_axis import TuningProblem, on_plants
from seal_friction_ros.files import read_yaml

SEAL = replace(parse_seal(read_yaml(ROOT / 'config/seals/ms28775_114.yaml')), presliding=Presliding(stiffness=1e5))


def problem(seal):
    seals = (MountedSeal(seal, 'a'), MountedSeal(seal, 'b'))
    pipeline = PipelineParameters(EstimatorParameters(EstimatorSettings(), seals), COMPENSATING)
    return TuningProblem(Axis(ServoParameters(seals=seals), pipeline), TuningSettings())


@pytest.mark.long
def test_a_rigid_feed_forward_is_worth_less_on_elastic_seals_and_an_elastic_one_more_than_it():
    rigid = FeedForwardSettings(scale=1.0, lead_time=2.5e-3, slew_limit=1e9)
    of_rigid, of_elements, of_lugre = on_plants(problem(SEAL), rigid)
    assert [of_rigid.plant, of_elements.plant, of_lugre.plant] == ['rigid', 'elements', 'lugre']
    left = of_rigid.tuned.tracking_rms / of_rigid.without.tracking_rms
    for outcome in (of_elements, of_lugre):
        assert outcome.tuned.tracking_rms / outcome.without.tracking_rms > 2.0 * left
        assert outcome.tuned.reversal_rms > of_rigid.tuned.reversal_rms
    _, elements, lugre = on_plants(problem(SEAL), replace(rigid, presliding=True))
    assert elements.tuned.tracking_rms < 0.6 * of_elements.tuned.tracking_rms
    assert lugre.tuned.error_area < of_lugre.tuned.error_area


def test_three_seals_are_more_than_the_elastic_plant_takes():
    three = problem(SEAL)
    seals = tuple(MountedSeal(SEAL, chamber) for chamber in 'aba')
    axis = three.axis._replace(servo=replace(three.axis.servo, seals=seals))
    assert on_plants(replace(three, axis=axis), COMPENSATING) == ()


def test_without_seals_there_are_no_other_plants():
    bare = problem(SEAL)
    axis = bare.axis._replace(servo=replace(bare.axis.servo, seals=()))
    assert on_plants(replace(bare, axis=axis), COMPENSATING) == ()


def test_quality_is_that_of_the_evaluated_part_of_the_sine_without_and_with_the_force(monkeypatch):
    """A rod that lags by 3 mm without, and in the outer tenths by 2 mm with the feed-forward, at 1 kHz and 5 Hz."""
    plants = []

    def runs(self, settings):
        plants.append(self.axis.servo.elastic)
        time = 1e-3 * np.arange(1, 1601)  # [s] two periods of settling, four that count, two more
        reference = np.sin(10.0 * np.pi * time)
        outer = np.abs(reference) >= 0.8
        error = np.where(outer, 2e-3, 0.0) if settings.scale else np.full(1600, 3e-3)
        error[(time < 0.4) | (time > 1.2005)] = 1.0
        zero = np.zeros(1600)
        wrong = AxisRun(time, zero, zero + 9.0, zero, zero, zero)
        return AxisRun(time, reference, reference - error, zero, zero, zero), wrong, wrong

    monkeypatch.setattr(TuningProblem, 'runs', runs)
    with_presliding = problem(SEAL)
    with_presliding = replace(
        with_presliding,
        axis=with_presliding.axis._replace(servo=replace(with_presliding.axis.servo, control_period=1e-3)),
    )
    outcomes = on_plants(with_presliding, COMPENSATING)
    assert [outcome.plant for outcome in outcomes] == ['rigid', 'elements', 'lugre']
    share = np.mean(np.abs(np.sin(10.0 * np.pi * 1e-3 * np.arange(200))) >= 0.8)  # of a period, 41 %
    for outcome in outcomes:
        assert outcome.without == pytest.approx((3e-3, 3e-3, 3e-3 * 0.8 / 8))  # 0.8 s, eight reversals
        assert outcome.tuned == pytest.approx((2e-3 * share**0.5, 2e-3, 2e-3 * share * 0.8 / 8))
    rigid, elements, lugre = plants[::2]
    assert plants[1::2] == [rigid, elements, lugre]
    assert rigid is None
    assert (elements.stiffness, elements.bristle_damping) == (2e5, -1.0)  # two seals of 1e5 N/m
    assert (lugre.stiffness, lugre.bristle_damping) == pytest.approx((2e5, (2e5 * 5.0) ** 0.5))  # 5 kg


def test_without_presliding_in_every_seal_file_there_are_no_other_plants():
    assert on_plants(problem(replace(SEAL, presliding=None)), COMPENSATING) == ()
