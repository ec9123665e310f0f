"""Tuned settings on rigid seals, on elastic ones, and on LuGre."""

from dataclasses import replace

import pytest
from paths import ROOT

from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.pipeline import PipelineParameters
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.servo.closed_loop import Axis
from seal_friction_ros.core.servo.position_servo import ServoParameters
from seal_friction_ros.core.tuning.other_plants import on_plants
from seal_friction_ros.core.tuning.settings import TuningSettings
from seal_friction_ros.core.tuning.simulated_axis import TuningProblem
from seal_friction_ros.files import read_yaml

SEAL = replace(parse_seal(read_yaml(ROOT / 'config/seals/ms28775_114.yaml')), presliding=Presliding(stiffness=1e5))


def problem(seal):
    seals = (MountedSeal(seal, 'a'), MountedSeal(seal, 'b'))
    pipeline = PipelineParameters(EstimatorParameters(EstimatorSettings(), seals), FeedForwardSettings())
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
    assert on_plants(replace(three, axis=axis), FeedForwardSettings()) == ()


def test_without_presliding_in_every_seal_file_there_are_no_other_plants():
    assert on_plants(problem(replace(SEAL, presliding=None)), FeedForwardSettings()) == ()
