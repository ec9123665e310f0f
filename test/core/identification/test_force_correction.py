"""Area that the force sum lacks: told from how the offset follows the pressure of one chamber."""

import numpy as np
import pytest

from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.force_correction import force_correction
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.signal_preparation import Signals

FRICTION, CONSTANT = 20.0, -3.0  # [N]
LEVELS = np.array([0.0, 1e6, 2e6, 3e6, 4e6])  # [Pa]


def prepared(area, noise=(0.0,) * 5, pressures=LEVELS, other=0.0, chamber='a', samples=True):
    """One stroke each way at each pressure of one chamber; ``noise`` is what the offset is off the line [N]."""
    level = np.repeat(np.arange(len(pressures)), 2)
    direction = np.tile([1.0, -1.0], len(pressures))
    pressure = pressures[level]
    force = direction * FRICTION + CONSTANT + area * pressure + np.array(noise)[level]
    both = np.column_stack((pressure, other * pressure))
    at = OperatingConditions(pressure[:, np.newaxis], 0.02 * direction, direction)
    parts = tuple(np.full(11, one) for one in force) if samples else ()
    zeros = np.zeros(len(level), dtype=int)
    chambers = both if chamber == 'a' else both[:, ::-1]
    return FrictionReadings(
        at, force, zeros, level, level, ('log',), 'pressure', False, parts, chamber_pressures=chambers
    )


@pytest.mark.parametrize('chamber', ['a', 'b'])
def test_the_area_is_the_slope_of_the_offset_over_the_pressure_of_its_chamber(chamber):
    found = force_correction(prepared(2e-6, chamber=chamber))
    assert found.chamber == chamber
    assert found.area == pytest.approx(-2e-6)  # it is to be added, so that the force sum lacks it no more
    assert (found.line.constant, found.line.area_error) == pytest.approx((CONSTANT, 2e-6))
    assert found.is_significant
    pressures = np.full(3, 1e6), np.full(3, 4e6)
    signals = Signals(np.arange(3.0), np.ones(3), *pressures, np.full(3, 50.0))
    corrected = found.corrected(signals)
    assert corrected.force_sum == pytest.approx(np.full(3, 50.0 - 2e-6 * (1e6 if chamber == 'a' else 4e6)))
    assert corrected._replace(force_sum=signals.force_sum) == signals


@pytest.mark.parametrize(('change', 'large'), [(1.9, False), (2.1, True), (-1.9, False), (-2.1, True)])
def test_an_area_matters_from_a_tenth_of_the_friction_on(change, large):
    assert force_correction(prepared(change / 4e6)).is_significant is large


def test_the_standard_error_is_that_of_a_regression_and_the_slope_has_to_be_beyond_it():
    noise = np.array([1.0, -2.0, 1.0, 1.0, -1.0])
    noise = noise - np.polyval(np.polyfit(LEVELS, noise, 1), LEVELS)
    error = np.sqrt(np.sum(noise**2) / 3.0 / np.sum((LEVELS - LEVELS.mean()) ** 2))
    for times, sure in ((5.8, False), (5.9, True)):  # Student's t at 99.5 % with three degrees of freedom is 5.841
        found = force_correction(prepared(times * error, noise))
        assert found.standard_error == pytest.approx(error)
        assert abs(found.area) * 4e6 > 0.1 * FRICTION
        assert found.is_significant is sure


@pytest.mark.parametrize(
    'made',
    [
        lambda: prepared(2e-6, pressures=LEVELS[:2]),
        lambda: prepared(2e-6, other=1.0),
        lambda: prepared(2e-6, samples=False),
        lambda: prepared(2e-6, pressures=1e4 * np.arange(5.0)),
    ],
    ids=['two pressures', 'both chambers', 'noted by hand', 'no pressure'],
)
def test_where_it_is_not_known_whose_area_it_is_there_is_none(made):
    assert force_correction(made()) is None


def test_three_pressures_and_a_chamber_that_hardly_moves_are_enough():
    assert force_correction(prepared(2e-6, pressures=LEVELS[:3])).area == pytest.approx(-2e-6)
    assert force_correction(prepared(2e-6, other=0.01)).chamber == 'a'
