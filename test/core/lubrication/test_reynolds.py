"""The film of a given gap: against closed forms, conserved, complementary."""

import numpy as np
import pytest
from harness import given_gap
from harness.given_gap import OPEN, film_of_gap
from scipy.optimize import brentq

from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.lubrication.reynolds import FilmEnds

VISCOSITY = 0.01  # [Pa s]
MEAN_VELOCITY = 0.5  # [m/s]


def plane_slider(cells: int) -> tuple[float, float]:
    """Largest pressure and largest error of the pressure, over the exact largest pressure."""
    length, inlet, outlet = 1e-2, 20e-6, 10e-6
    x = (np.arange(cells) + 0.5) * length / cells
    h = inlet + (outlet - inlet) * x / length
    exact = 12.0 * VISCOSITY * MEAN_VELOCITY * length / (inlet**2 - outlet**2) * (inlet - h) * (h - outlet) / h**2
    film = film_of_gap(h, length / cells, MEAN_VELOCITY, VISCOSITY)
    assert film.saturation.min() == 1.0
    return film.pressure.max() / exact.max(), np.abs(film.pressure - exact).max() / exact.max()


class Parabola:
    """Film from x = -a that ruptures where pressure and its slope vanish (Swift, Stieber).

    With x = s tan(g), s = sqrt(2 R h_0): p = 12 eta u s / h_0^2 [I_2 - I_3 / cos(g*)^2], I_n the integral of
    cos(g)^(2n - 2), g* at rupture.
    """

    radius, least, reach = 1e-2, 1e-6, 6e-4  # [m]

    def __init__(self):
        self.scale = np.sqrt(2.0 * self.radius * self.least)
        self.inlet = np.arctan(-self.reach / self.scale)
        rupture = brentq(lambda g: self.pressure(g, g), 1e-3, 1.2)
        self.flow = MEAN_VELOCITY * self.least / np.cos(rupture) ** 2
        self.largest = self.pressure(np.linspace(self.inlet, rupture, 200_001), rupture).max()

    def pressure(self, g, rupture):
        def second(g):
            return g / 2.0 + np.sin(2.0 * g) / 4.0

        def third(g):
            return 3.0 * g / 8.0 + np.sin(2.0 * g) / 4.0 + np.sin(4.0 * g) / 32.0

        across = second(g) - second(self.inlet) - (third(g) - third(self.inlet)) / np.cos(rupture) ** 2
        return 12.0 * VISCOSITY * MEAN_VELOCITY * self.scale / self.least**2 * across

    def film(self, cells: int, velocity: float = MEAN_VELOCITY, ends: FilmEnds = OPEN):
        width = 2.0 * self.reach / cells
        x = -self.reach + (np.arange(cells) + 0.5) * width
        return film_of_gap(self.least + x**2 / (2.0 * self.radius), width, velocity, VISCOSITY, ends)


def test_plane_slider_is_the_closed_form_with_an_error_of_second_order():
    errors = [plane_slider(cells)[1] for cells in (100, 200, 400, 800)]
    assert errors[-1] < 1e-5
    assert all(1.9 < order < 2.1 for order in np.log2(np.array(errors[:-1]) / errors[1:]))


def test_pressure_of_the_cavitating_parabola_is_within_half_a_percent_at_800_cells_and_much_closer():
    exact = Parabola()
    film = exact.film(800)
    assert film.pressure.max() == pytest.approx(exact.largest, rel=2e-4)
    assert film.flow[0] == pytest.approx(exact.flow, rel=1e-4)
    assert film.saturation.min() < 0.1


def test_cavitating_parabola_converges_with_second_order_on_the_whole():
    exact = Parabola()
    errors = [abs(exact.film(cells).pressure.max() / exact.largest - 1.0) for cells in (100, 400, 1600)]
    assert all(order > 1.7 for order in np.log2(np.array(errors[:-1]) / errors[1:]) / 2.0)


def test_mass_is_conserved_and_pressure_and_void_exclude_each_other():
    exact = Parabola()
    film = exact.film(800)
    assert np.ptp(film.flow) <= 1e-12 * film.flow.mean()
    assert (film.pressure / exact.largest * (1.0 - film.saturation)).max() <= 1e-12
    assert film.pressure.min() >= -1e-12 * exact.largest
    assert film.saturation.max() <= 1.0 + 1e-12


def test_film_that_ruptured_forms_again_where_the_outlet_is_under_pressure():
    film = Parabola().film(400, ends=FilmEnds(pressure_right=2e4))
    void = np.flatnonzero(film.saturation < 0.99)
    assert len(void) > 0
    assert void[-1] < 399
    assert film.pressure[-1] == pytest.approx(2e4, rel=0.02)
    assert np.ptp(film.flow) <= 1e-10 * film.flow.mean()  # large gap: rounding of the pressure, not the scheme


def test_motion_the_other_way_mirrors_the_film():
    forth, back = (Parabola().film(200, velocity) for velocity in (MEAN_VELOCITY, -MEAN_VELOCITY))
    assert np.allclose(back.pressure[::-1], forth.pressure, atol=1e-9 * forth.pressure.max())
    assert np.allclose(back.flow[::-1], -forth.flow, rtol=1e-12)


def test_what_flows_in_starved_flows_out_whatever_the_gap():
    film = Parabola().film(200, ends=FilmEnds(saturation_left=0.01))
    gap_at_inlet = Parabola.least + Parabola.reach**2 / (2.0 * Parabola.radius)
    assert film.flow == pytest.approx(0.01 * MEAN_VELOCITY * gap_at_inlet, rel=0.01)
    assert film.pressure.max() < 0.2 * Parabola().largest


def test_squeezed_film_loses_what_leaves_through_its_ends():
    cells, width, step = 100, 1e-5, 1e-4
    before, after = np.full(cells, 11e-6), np.full(cells, 10e-6)
    film = film_of_gap(after, width, 0.0, VISCOSITY, old_thickness=before, time_step=step)
    lost = (before - film.saturation * after).sum() * width
    assert (film.flow[-1] - film.flow[0]) * step == pytest.approx(lost, rel=1e-12)
    x = (np.arange(cells) + 0.5) * width - 0.5 * cells * width
    speed = 1e-6 / step
    exact = 6.0 * VISCOSITY * speed / 10e-6**3 * ((0.5 * cells * width) ** 2 - x**2)
    assert film.pressure == pytest.approx(exact, abs=1e-3 * exact.max())


def test_pulled_apart_a_film_cavitates_and_keeps_its_mass():
    cells, width, step = 100, 1e-5, 1e-4
    before = np.full(cells, 10e-6)
    film = film_of_gap(np.full(cells, 11e-6), width, 0.0, VISCOSITY, old_thickness=before, time_step=step)
    inside = film.saturation[1:-1]
    assert inside.max() < 1.0
    gained = (film.saturation * 11e-6 - before).sum() * width
    assert (film.flow[0] - film.flow[-1]) * step == pytest.approx(gained, abs=1e-12 * before.sum() * width)


def test_no_solution_is_an_error(monkeypatch):
    monkeypatch.setattr(given_gap, 'ITERATIONS', 2)
    with pytest.raises(NotConvergedError, match='film_of_gap: no solution after 2 iterations'):
        Parabola().film(100)
