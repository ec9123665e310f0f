"""Prediction of readings left out: whose offset is taken, which readings make the band, and what the band is."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, Variation, candidate_laws
from seal_friction_ros.core.identification.fitting import fit
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.validation import (
    PredictionUncertainty,
    band_coverage,
    cross_validate,
    deviations_in_std,
    deviations_of_left_out,
    group_losses,
    plain_mean,
    predict,
    prediction_uncertainty,
)

CONSTANT = next(law for law in candidate_laws(Variation()) if law.name == 'constant_coulomb')
LEVEL = 'coulomb_friction_at_any_pressure'


def runs(frictions, offsets):
    """Four readings of two seals in each run, with the friction [N] and the offset [N] of the run."""
    n = len(frictions)
    source, direction = np.repeat(np.arange(n), 4), np.tile([1.0, -1.0], 2 * n)
    at = OperatingConditions(np.full((4 * n, 2), 1e6), 0.02 * direction, direction)
    force = direction * np.repeat(frictions, 4) + np.repeat(offsets, 4)
    names = tuple(map(str, range(n)))
    return FrictionReadings(at, force, source, source, np.zeros(4 * n, int), names, 'file', are_samples=False)


def test_a_run_that_was_left_out_gets_its_offset_from_its_own_two_directions():
    readings = runs([20.0, 20.0, 26.0], [3.0, -2.0, 50.0])
    trained, tested = readings.taken(readings.source < 2), readings.taken(readings.source == 2)
    values, friction, deviation = predict(CONSTANT, trained, tested, {LEVEL: 9.0})
    assert values == pytest.approx({LEVEL: 10.0})  # of one of two seals
    assert friction == pytest.approx(np.full(4, 20.0))
    assert deviation == pytest.approx(np.full(4, 6.0))
    one_way = tested.taken(tested.at.direction > 0.0)
    assert predict(CONSTANT, trained, one_way, {LEVEL: 9.0})[2] == pytest.approx([56.0, 56.0])  # nothing tells it
    shifted = replace(trained, force=trained.force + 0.5)
    again = predict(CONSTANT, trained, shifted, {LEVEL: 9.0})[2]
    assert again == pytest.approx(0.5 * shifted.at.direction)  # the offset of a known run is the one that it had


def test_each_group_is_predicted_by_the_others_and_counted():
    readings, ticks = runs([20.0, 22.0, 30.0], [3.0, -2.0, 5.0]), []
    found = cross_validate(CONSTANT, readings, {LEVEL: 10.0}, ticks.append)
    expected = np.array([26.0, 25.0, 21.0])  # all readings at one pressure weigh the same
    assert found.predicted == pytest.approx(np.repeat(expected, 4))
    assert found.deviation == pytest.approx(np.repeat([-6.0, -3.0, 9.0], 4))
    assert [each[LEVEL] for each in found.values] == pytest.approx(expected / 2.0)
    scale = 24.0  # [N] mean friction of the three
    assert found.losses == pytest.approx(np.array([6.0, 3.0, 9.0]) / scale)
    assert group_losses(readings, np.tile([1.0, -7.0], 6)) == pytest.approx(np.full(3, 5.0 / scale))
    assert ticks == [1, 1, 1]
    assert found.rms == pytest.approx(np.sqrt((36.0 + 9.0 + 81.0) / 3.0))
    assert found.error == pytest.approx(18.0 / 72.0)
    assert found.mean_deviation == pytest.approx(6.0)
    mean = plain_mean(readings)
    assert mean.predicted == pytest.approx(np.repeat(expected, 4))
    assert mean.losses == pytest.approx(found.losses)
    assert mean.deviation == pytest.approx(found.deviation)
    assert mean.values == ()


def test_a_deviation_has_a_relative_and_an_absolute_part():
    band = PredictionUncertainty(0.1, 3.0)
    assert band.std(np.array([0.0, 40.0])) == pytest.approx([3.0, 5.0])
    friction = np.linspace(5.0, 100.0, 200)
    size = np.sqrt((0.1 * friction) ** 2 + 3.0**2) * np.tile([1.0, -1.0], 100)
    found = prediction_uncertainty(friction, size, 4)
    # Every deviation is one standard deviation: 1.96 of the band are one of it, and a new group adds a quarter.
    assert found.relative == pytest.approx(0.1 / BAND_95 * np.sqrt(1.25))
    assert found.absolute == pytest.approx(3.0 / BAND_95 * np.sqrt(1.25))
    more = prediction_uncertainty(friction, size, 4, 0.2)
    assert more.relative == pytest.approx(np.hypot(found.relative, 0.2))
    assert more.absolute == found.absolute
    # A friction near 0 counts as 5 % of the mean: a deviation there does not make the relative part infinite.
    mixed = np.concatenate((np.full(99, 20.0), [0.0]))
    relative = prediction_uncertainty(mixed, np.concatenate((np.full(99, 2.0), [0.099])), 10**9)
    assert relative.relative == pytest.approx(0.1 / BAND_95, rel=1e-3)
    assert relative.absolute == pytest.approx(0.0, abs=1e-3)
    none = prediction_uncertainty(friction, np.zeros(200), 4)
    assert (none.relative, none.absolute) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_the_band_of_a_group_is_made_from_the_others_and_that_of_two_groups_from_both():
    readings = runs([20.0, 22.0, 30.0], [3.0, -2.0, 5.0])
    values = fit(CONSTANT, readings).values
    found = deviations_of_left_out(CONSTANT, readings, values)
    for run in range(3):
        out = readings.source == run
        one = deviations_in_std(CONSTANT, readings.taken(~out), readings.taken(out), values)
        assert found[out] == pytest.approx(one)
    # Of runs of 20 and 22 N each is off by 2 N from the other: 2 N and half as much more in square hold 95 %.
    assert found[readings.source == 2] == pytest.approx(np.full(4, 9.0 / (2.0 / BAND_95 * np.sqrt(1.5))), rel=0.1)
    assert band_coverage(CONSTANT, readings, values) == np.mean(found <= BAND_95)
    two = readings.taken(readings.source < 2)
    both = deviations_of_left_out(CONSTANT, two, values)
    std = 2.0 / BAND_95 * np.sqrt(1.5)
    assert both == pytest.approx(np.full(8, 1.0 / std), rel=0.1)
    added = deviations_in_std(CONSTANT, two, readings.taken(readings.source == 2), values, 0.5)
    assert added == pytest.approx(np.full(4, 9.0 / np.hypot(std, 0.5 * 21.0)), rel=0.05)
    ticks = []
    deviations_of_left_out(CONSTANT, readings, values, ticks.append)
    assert ticks == [1] * 6  # of each group both others


def test_the_offset_of_a_run_is_told_whatever_pressures_its_directions_have():
    """Friction 2 N + 0.5 N/bar; the run to predict has 10 bar out and 30 bar back, an offset of 4 N, and scatter."""
    line = next(law for law in candidate_laws(Variation()) if law.name == 'pressure_power_law_1')
    values = {'friction_at_no_pressure': 2.0, 'friction_at_one_bar': 0.5, 'pressure_exponent': 1.0}
    bars = np.array([10.0, 10.0, 20.0, 20.0, 30.0, 30.0, *[10.0] * 3, *[30.0] * 3])
    direction = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, *[1.0] * 3, *[-1.0] * 3])
    source = np.repeat([0, 1], 6)
    scatter = np.array([0.0] * 6 + [0.0, 0.0, 3.0, 0.0, 0.0, -6.0])
    at = OperatingConditions(1e5 * bars[:, np.newaxis], 0.02 * direction, direction)
    force = direction * line.friction(at, values) + 4.0 * source + scatter
    level = np.searchsorted([10.0, 20.0, 30.0], bars)
    readings = FrictionReadings(at, force, source, source, level, ('a', 'b'), 'file', are_samples=False)
    found, friction, deviation = predict(line, readings.taken(source == 0), readings.taken(source == 1), values)
    assert found['friction_at_one_bar'] == pytest.approx(0.5)
    assert friction == pytest.approx([7.0] * 3 + [17.0] * 3)
    # The scatter is 1 N in the mean out and -2 N back: half of the sum, -0.5 N, counts as offset.
    assert deviation == pytest.approx(direction[6:] * (scatter[6:] + 0.5))
