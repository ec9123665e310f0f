"""The film against numbers and closed forms that others published."""

import csv

import numpy as np
import pytest
from harness.given_gap import Film, film_of_gap
from harness.identify_run import DATA

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.lubrication.reynolds import FilmEnds

VISCOSITY = 0.01  # [Pa s]
MEAN_VELOCITY = 0.5  # [m/s]
AMBIENT = 1e5  # [Pa] above the cavitation pressure
ENDS = FilmEnds(AMBIENT, AMBIENT)


def centres(cells: int) -> FloatArray:
    return (np.arange(cells) + 0.5) / cells


# -- Bertocchi, Dini, Giacopini, Fowell, Baldini 2013: slider with a pocket, 30 times as wide as long ------------------

LENGTH = 20e-3  # [m]


def bertocchi(cells: int) -> Film:
    """Viscosity by Barus and density by Dowson and Higginson at the pressure of the film, found by repetition."""
    x = LENGTH * centres(cells)
    gap = 1.1e-6 - 0.1e-6 * x / LENGTH + np.where((x > 4e-3) & (x < 10e-3), 0.4e-6, 0.0)
    film, before = film_of_gap(gap, LENGTH / cells, MEAN_VELOCITY, VISCOSITY, ENDS), np.zeros(cells)
    while np.abs(film.pressure - before).max() > 1e-9 * film.pressure.max():
        before = film.pressure
        above = np.maximum(before - AMBIENT, -AMBIENT)
        density = (2.22e9 + 1.66 * above) / (2.22e9 + above)
        viscosity = VISCOSITY * np.exp(1.2e-8 * above)
        film = film_of_gap(gap, LENGTH / cells, MEAN_VELOCITY, viscosity, ENDS, density=density)
    return film


def bertocchi_published() -> tuple[FloatArray, FloatArray]:
    """Place over the length, and pressure of the wide slider [Pa]."""
    path = DATA / 'ehl' / 'bertocchi_2013_pocket.csv'
    if not path.exists():
        pytest.skip(f'{path.name} of the shared data is not there')
    with path.open(encoding='utf-8') as lines:
        rows = list(csv.DictReader(lines))
    place = np.array([float(row['x_over_length']) for row in rows])
    return place, np.array([float(row['pressure_wide_MPa']) for row in rows]) * 1e6


def test_the_slider_with_a_pocket_is_that_of_bertocchi():
    """Every digitised point lies within 1 % of the axes from the curve; straight up, on its steep flank, within 4 %."""
    place, published = bertocchi_published()
    film = bertocchi(2000)
    scale = published.max()
    assert film.pressure.max() == pytest.approx(scale, rel=5e-3)
    away = np.hypot(place[:, None] - centres(2000), (published[:, None] - film.pressure) / scale)
    assert away.min(axis=1).max() < 0.01
    off = np.abs(np.interp(place, centres(2000), film.pressure) - published) / scale
    assert off.max() < 0.04
    assert np.sqrt(np.mean(off**2)) < 0.013


def test_the_largest_pressure_of_the_slider_with_a_pocket_is_converged():
    largest = [bertocchi(cells).pressure.max() for cells in (500, 1000, 2000)]
    assert abs(largest[2] - largest[1]) < 1e-4 * largest[2]


# -- Fowell, Olver, Gosman, Spikes, Pegg 2007: parallel pad with a pocket, which sucks lubricant in --------------------

PAD, POCKET_FROM, POCKET_TO = 20e-3, 4e-3, 10e-3  # [m]
LAND_GAP, POCKET_GAP = 1e-6, 1.4e-6  # [m]


def fowell() -> tuple[float, float, float]:
    """Flow [m^2/s], place at which the film of the pocket forms again [m], largest pressure [Pa], all in closed form.

    Between steps of the gap the pressure is linear. Up to the pocket it falls from ambient to cavitation, which sets
    the flow; behind the pocket it falls to ambient by the same flow.
    """
    flow = MEAN_VELOCITY * LAND_GAP + LAND_GAP**3 * AMBIENT / (12.0 * VISCOSITY * POCKET_FROM)
    largest = AMBIENT * (1.0 + (PAD - POCKET_TO) / POCKET_FROM)
    slope = 12.0 * VISCOSITY * (MEAN_VELOCITY * POCKET_GAP - flow) / POCKET_GAP**3
    return flow, POCKET_TO - largest / slope, largest


def test_the_pocket_of_fowell_sucks_in_what_the_closed_form_says():
    cells = 4000
    x = PAD * centres(cells)
    gap = np.where((x > POCKET_FROM) & (x < POCKET_TO), POCKET_GAP, LAND_GAP)
    film = film_of_gap(gap, PAD / cells, MEAN_VELOCITY, VISCOSITY, ENDS)
    flow, formed, largest = fowell()
    void = x[film.saturation < 1.0 - 1e-9]
    assert film.flow == pytest.approx(np.full(cells + 1, flow), rel=1e-6)
    assert film.pressure.max() == pytest.approx(largest, rel=1e-3)
    assert void.min() == pytest.approx(POCKET_FROM, abs=2.0 * PAD / cells)
    assert void.max() == pytest.approx(formed, abs=2.0 * PAD / cells)


# -- Sommerfeld 1904: long journal bearing -----------------------------------------------------------------------------


def test_a_journal_bearing_under_high_pressure_is_that_of_sommerfeld():
    """Cavitates nowhere: 12 eta u R / c^2 times e sin(g) (2 + e cos(g)) / ((2 + e^2) (1 + e cos(g))^2)."""
    cells, radius, clearance, eccentricity, high = 400, 0.02, 2e-5, 0.6, 5e6
    angle = 2.0 * np.pi * centres(cells)
    gap = clearance * (1.0 + eccentricity * np.cos(angle))
    film = film_of_gap(gap, 2.0 * np.pi * radius / cells, MEAN_VELOCITY, VISCOSITY, FilmEnds(high, high))
    shape = eccentricity * np.sin(angle) * (2.0 + eccentricity * np.cos(angle))
    shape /= (2.0 + eccentricity**2) * (1.0 + eccentricity * np.cos(angle)) ** 2
    exact = 12.0 * VISCOSITY * MEAN_VELOCITY * radius / clearance**2 * shape
    assert film.saturation.min() == 1.0
    assert film.pressure - high == pytest.approx(exact, abs=2e-4 * exact.max())
