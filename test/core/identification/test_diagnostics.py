"""What readings tell of themselves: scatter, regressors that go together, and sources that differ."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, Variation, candidate_laws
from seal_friction_ros.core.identification.diagnostics import (
    RunChange,
    collinear_regressors,
    outlying_level,
    repeatability,
    shared_levels,
    swept_logs_compared,
    traded_off,
)
from seal_friction_ros.core.identification.fitting import fit
from seal_friction_ros.core.identification.readings import FrictionReadings

BAR = 1e5  # [Pa]


def made(bars, frictions, velocity=0.02, source=0, samples=False, names=('log',)):
    """One reading each way for each row."""
    n = len(bars)
    direction = np.tile([1.0, -1.0], n)
    pressure = np.repeat(np.asarray(bars, float), 2)[:, np.newaxis] * BAR
    speed = np.repeat(np.broadcast_to(velocity, n), 2)
    level = np.unique(pressure, return_inverse=True)[1].reshape(-1)
    at = OperatingConditions(pressure, direction * speed, direction)
    of = np.repeat(np.broadcast_to(source, n), 2)
    force = direction * np.repeat(np.asarray(frictions, float), 2)
    return FrictionReadings(at, force, of, level, level, names, 'pressure', samples)


def test_repeatability_is_the_pooled_share_within_the_pressures():
    readings = made([10, 10, 20, 20], [9.0, 11.0, 38.0, 42.0])
    pooled = np.sqrt((4 * 0.1**2 + 4 * 0.05**2) / 6.0)
    assert repeatability(readings, np.zeros(1)) == pytest.approx(pooled)
    assert np.isnan(repeatability(readings.taken(np.array([0, 4])), np.zeros(1)))  # nothing was repeated


def pair(correlation):
    """Two columns of eight with this correlation."""
    x = np.array([-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0])
    z = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
    return x, correlation * x + np.sqrt(1.0 - correlation**2) * z


@pytest.mark.parametrize(('correlation', 'told'), [(0.89, False), (0.91, True), (-0.89, False), (-0.91, True)])
def test_speed_and_pressure_go_together_from_nine_tenths_on(correlation, told):
    x, y = pair(correlation)
    readings = made(50.0 + 10.0 * y, np.full(8, 20.0), 0.05 + 0.01 * x, samples=True)
    readings = replace(readings, chamber_pressures=np.zeros((16, 2)))
    found = collinear_regressors(readings)
    assert bool(found) is told
    assert not told or found == [('speed', 'pressure of the seals', pytest.approx(correlation))]
    still = replace(readings, at=readings.at._replace(velocity=0.05 * readings.at.direction))
    assert collinear_regressors(still) == []  # what was not varied goes with nothing
    unknown = replace(readings, at=readings.at._replace(velocity=np.full(16, np.nan)))
    assert collinear_regressors(unknown) == []


def test_held_pressures_are_compared_by_their_means_and_take_three():
    readings = replace(made([10, 20, 40], [10.0] * 3, [0.01, 0.02, 0.04]), chamber_pressures=np.zeros((6, 2)))
    assert [found.correlation for found in collinear_regressors(readings)] == pytest.approx([1.0])
    assert collinear_regressors(readings.taken(readings.level < 2)) == []


def test_velocity_and_pressure_difference_go_together():
    readings = made(np.full(4, 20.0), [10.0] * 4, [0.01, 0.02, 0.03, 0.04], samples=True)
    chambers = np.column_stack((20.0 + 1e3 * readings.at.velocity, 20.0 - 1e3 * readings.at.velocity)) * BAR
    (found,) = collinear_regressors(replace(readings, chamber_pressures=chambers))
    assert found == ('velocity', 'pressure difference', pytest.approx(1.0))


@pytest.mark.parametrize(('correlation', 'told'), [(0.94, False), (0.96, True), (-0.94, False), (-0.96, True)])
def test_parameters_are_traded_off_from_0_95_on(correlation, told):
    parameters = [SimpleNamespace(name=name) for name in 'abc']
    matrix = np.eye(3)
    matrix[0, 2] = matrix[2, 0] = correlation
    found = traded_off(SimpleNamespace(law=SimpleNamespace(parameters=parameters), correlation=matrix))
    assert found == ([('a', 'c', correlation)] if told else [])


@pytest.mark.parametrize(
    ('friction', 'other', 'ratio', 'changed'),
    [(20.0, 22.9, 1.145, False), (20.0, 23.1, 1.155, True), (23.1, 20.0, 1.155, True), (20.0, 0.0, np.inf, True)],
)
def test_runs_that_differ_by_more_than_15_percent_have_changed(friction, other, ratio, changed):
    change = RunChange(2e6, 'one', friction, 'other', other)
    assert change.ratio == pytest.approx(ratio)
    assert change.is_changed is changed


def test_each_source_is_compared_with_the_first_at_the_pressures_that_they_share():
    readings = made([10, 20, 20, 10, 20], [10.0, 20.0, 30.0, 12.0, 26.0], source=[0, 0, 1, 2, 2], names=('a', 'b', 'c'))
    assert shared_levels(readings) == [
        (10 * BAR, 'a', 10.0, 'c', 12.0),
        (20 * BAR, 'a', 20.0, 'b', 30.0),
        (20 * BAR, 'a', 20.0, 'c', 26.0),
    ]
    assert shared_levels(replace(readings, are_samples=True)) == []


def test_swept_logs_are_compared_by_their_share_of_the_law_of_all():
    constant = next(law for law in candidate_laws(Variation()) if law.name == 'constant_coulomb')
    readings = made([10, 20, 10, 20], [10.0, 10.0, 14.0, 14.0], source=[0, 0, 1, 1], samples=True, names=('a', 'b'))
    (found,) = swept_logs_compared(readings, fit(constant, readings))
    assert found == (None, 'a', pytest.approx(10.0), 'b', pytest.approx(14.0))
    assert swept_logs_compared(replace(readings, are_samples=False), fit(constant, readings)) == []


# --- outliers ---

CONSTANT = next(law for law in candidate_laws(Variation()) if law.name == 'constant_coulomb')
LINE = next(law for law in candidate_laws(Variation()) if law.name == 'pressure_power_law_1')


def test_an_outlier_is_so_many_standard_errors_of_a_new_pressure_from_the_law_of_the_others():
    """A constant from three pressures of 20 N; the fourth is off by 30 % and 8 % are expected, and its own error."""
    readings = made([10, 20, 30, 40], [20.0, 20.0, 20.0, 26.0])
    found = outlying_level([CONSTANT], readings)
    assert found == (
        3,
        pytest.approx(26.0),
        pytest.approx(20.0),
        pytest.approx(0.3 / (0.08 * np.sqrt(4.0 / 3.0)), rel=1e-3),
    )
    low = outlying_level([CONSTANT], made([10, 20, 30, 40], [14.0, 20.0, 20.0, 20.0]))
    assert low == (
        0,
        pytest.approx(14.0),
        pytest.approx(20.0),
        pytest.approx(0.3 / (0.08 * np.sqrt(4.0 / 3.0)), rel=1e-3),
    )
    assert outlying_level([CONSTANT], readings.taken(readings.level > 0)) is None  # of three pressures none


def test_the_scatter_at_the_other_pressures_counts_as_noise():
    frictions = np.array([18.0, 22.0, 21.0, 19.0, 40.0])
    found = outlying_level([CONSTANT], made([10, 20, 30, 40, 50], frictions))
    others = frictions[:4]
    expected = np.sum(1.0 / others) / np.sum(1.0 / others**2)  # each weighted with its own friction
    residual = np.sqrt(np.sum((others / expected - 1.0) ** 2) / 3.0)
    noise = np.hypot(residual, 0.08)
    size = (40.0 / expected - 1.0) / (noise * np.sqrt(1.0 + 1.0 / 4.0))
    assert found == (4, pytest.approx(40.0), pytest.approx(expected), pytest.approx(size, rel=1e-3))


def test_an_extrapolated_pressure_is_less_sure_and_the_law_that_fits_the_others_best_is_asked():
    """Friction 2 N + 0.5 N/bar at five pressures; the sixth is far away. Its leverage is that of a weighted line."""
    bars = np.array([10.0, 20.0, 30.0, 40.0, 50.0, 150.0])
    line = 2.0 + 0.5 * bars
    frictions = np.where(bars > 100.0, 1.6 * line, line)
    found = outlying_level([CONSTANT, LINE], made(bars, frictions))
    x = np.column_stack((np.ones(6), bars)) / line[:, np.newaxis]
    leverage = x[5] @ np.linalg.inv(x[:5].T @ x[:5]) @ x[5]
    assert (found.level, found.expected) == (5, pytest.approx(line[5], rel=1e-6))
    assert found.standard_deviations == pytest.approx(0.6 / (0.08 * np.sqrt(1.0 + leverage)), rel=0.01)


def test_repeatability_of_samples_is_compared_in_cells_of_speed_pressure_and_direction():
    """Twelve speeds times six pressures: within each cell two readings each way, 1 N off their mean of 20 N."""
    bars, speeds = np.repeat(10.0 * np.arange(1, 7), 24), np.tile(np.repeat(0.01 * np.arange(1, 13), 2), 6)
    level = 100.0 * bars + 1e4 * speeds  # far more between the cells than within them
    readings = made(bars, level + np.tile([1.0, -1.0], 72), speeds, samples=True)
    force = readings.force + np.where(readings.at.direction > 0.0, 5e3, 0.0)
    readings = replace(readings, force=force)
    mean = readings.magnitudes(np.zeros(1)).mean()
    assert repeatability(readings, np.zeros(1)) == pytest.approx(np.sqrt(2.0) / mean)
