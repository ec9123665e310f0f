"""Friction of a given contact: closed forms for its film and its asperities."""

import math

import numpy as np
import pytest

from seal_friction_ros.core.lubrication.contact import LubricatedContact, film_properties
from seal_friction_ros.core.lubrication.elasticity import half_plane
from seal_friction_ros.core.lubrication.flow_factors import (
    flow_factor_coefficients,
    pressure_flow_factor,
    shear_flow_factor,
    shear_stress_coefficients,
    shear_stress_factors,
)
from seal_friction_ros.core.lubrication.grease import Grease, apparent_viscosity
from seal_friction_ros.core.lubrication.model import fluid_shear, real_area_share, solid_shear
from seal_friction_ros.core.lubrication.reynolds import FilmEnds
from seal_friction_ros.core.lubrication.topography import Topography

CELLS, WIDTH, MODULUS = 20, 5e-6, 1e7  # [1], [m], [Pa]
OIL = Grease(yield_stress=0.0, consistency_index=0.0, base_viscosity=0.5)
SMOOTH = (0.0, shear_stress_coefficients(1.0))
SLOPE = 1e9  # [Pa/m] of the pressure
SLOPING = 2e5 + SLOPE * WIDTH * (np.arange(CELLS) + 0.5)
SLOPING_ENDS = FilmEnds(2e5, 2e5 + SLOPE * WIDTH * CELLS)
GAP = 2e-6  # [m]


def sheared(velocity: float, *, saturation: float = 1.0, roughness=SMOOTH, grease: Grease = OIL) -> float:
    """Shear force between plates under a pressure that rises evenly [N/m]."""
    even = np.ones(CELLS)
    return float(
        fluid_shear(GAP * even, SLOPING, saturation * even, velocity, grease.numbers, WIDTH, SLOPING_ENDS, roughness)
    )


@pytest.mark.parametrize('velocity', [-0.03, 0.0, 0.03])
def test_film_between_plates_shears_by_couette_less_poiseuille(velocity):
    """It is eta U / h - h p' / 2 over the length."""
    exact = (0.5 * velocity / GAP - 0.5 * GAP * SLOPE) * CELLS * WIDTH
    assert sheared(velocity) == pytest.approx(exact, rel=1e-12)


def test_streamers_shear_with_their_share():
    assert sheared(0.03, saturation=0.25) == pytest.approx(0.25 * sheared(0.03), rel=1e-12)


def test_rough_plates_have_the_factors_of_patir_and_cheng_on_both_parts():
    rms = 1e-6
    coefficients = shear_stress_coefficients(1.0)
    by_sliding, by_pressure = shear_stress_factors(coefficients, GAP / rms)
    exact = (by_sliding * 0.5 * 0.03 / GAP - by_pressure * 0.5 * GAP * SLOPE) * CELLS * WIDTH
    assert sheared(0.03, roughness=(rms, coefficients)) == pytest.approx(exact, rel=1e-12)


def test_grease_shears_by_its_stress_at_the_rate_on_the_seal():
    """At gamma = U / h - h p' / (2 eta(U / h)), tau = eta(gamma) gamma."""
    numbers = Grease().numbers
    rate = 0.03 / GAP - 0.5 * GAP * SLOPE / apparent_viscosity(numbers, 0.03 / GAP)
    exact = apparent_viscosity(numbers, rate) * rate * CELLS * WIDTH
    assert sheared(0.03, grease=Grease()) == pytest.approx(exact, rel=1e-12)


def test_film_is_driven_by_the_pressure_beyond_its_ends():
    """Between plates at rest: the first and the last cell feel the step to what is beyond them, over a whole cell."""
    even = np.ones(CELLS)
    force = fluid_shear(GAP * even, 1e5 * even, even, 0.0, OIL.numbers, WIDTH, FilmEnds(3e5, 4e5), SMOOTH)
    assert force == pytest.approx(-0.5 * GAP * ((1e5 - (6e5 - 1e5)) + (8e5 - 1e5 - 1e5)) / 2.0, rel=1e-12)


def test_lightly_loaded_asperities_touch_on_an_area_in_proportion_to_their_pressure():
    """A = erf(x), x = sqrt 2 p / (E* h'): 2 x / sqrt pi for small x, 0.3286 at x = 0.3."""
    contact = LubricatedContact(half_plane(16, 1e-6, MODULUS, 1e-3), Topography(rms_slope=0.8), OIL)
    pressure = contact.topography.contact_stiffness(MODULUS)
    length = contact.topography.separation_length
    whole = contact.topography.real_area_pressure(MODULUS)
    gap = length * np.log(pressure / whole / np.array([1e-4, 0.1, 0.3]))
    share = real_area_share(contact, gap)
    assert share == pytest.approx([2e-4 / math.sqrt(math.pi), 0.1124629, 0.3286268], rel=1e-6)
    assert solid_shear(contact, gap, 2e6) == pytest.approx(2e6 * share.sum() * 1e-6, rel=1e-12)


def test_rough_surfaces_closer_than_a_nanometre_have_its_stress_factors():
    """At 0.5 nm the film is sheared twice as fast as at 1 nm, with the same factor."""
    even, rough = np.ones(CELLS), (2e-6, shear_stress_coefficients(1.0))
    forces = [
        fluid_shear(gap * even, 0.0 * even, even, 0.03, OIL.numbers, WIDTH, FilmEnds(), rough) for gap in (5e-10, 1e-9)
    ]
    assert forces[0] == pytest.approx(2.0 * forces[1], rel=1e-9)


@pytest.mark.parametrize('share', [-1.0, 0.5])
def test_film_of_rough_surfaces_flows_by_the_factors_of_patir_and_cheng(share):
    """M = phi_x h^3 / (12 eta), c = h + sigma (wall - seal) phi_s, eta at the mean shear rate."""
    rms, coefficients, gap = 1e-6, flow_factor_coefficients(1.0), np.array([1e-6, 4e-6])
    mobility, _, carried, _ = film_properties(gap, 0.03, Grease().numbers, (rms, share, coefficients))
    for h, m, c in zip(gap, mobility, carried, strict=True):
        viscosity = apparent_viscosity(Grease().numbers, 0.03 / h)
        assert m == pytest.approx(pressure_flow_factor(coefficients, h / rms)[0] * h**3 / (12.0 * viscosity))
        assert c == pytest.approx(h + rms * share * shear_flow_factor(coefficients, h / rms)[0])


def test_closed_gap_flows_like_one_of_a_nanometre_whatever_it_does():
    rough = (1e-6, 0.5, flow_factor_coefficients(1.0))
    closed, thinnest = (film_properties(np.array([h]), 0.03, OIL.numbers, rough)[:, 0] for h in (-1e-6, 1e-9))
    assert closed[[0, 2]] == pytest.approx(thinnest[[0, 2]], rel=1e-12)
    assert closed[[1, 3]].tolist() == thinnest[[1, 3]].tolist() == [0.0, 0.0]


def test_share_of_the_wall_in_the_roughness_goes_from_all_on_the_seal_to_all_on_the_wall():
    plane = half_plane(16, 1e-6, MODULUS, 1e-3)
    shares = [LubricatedContact(plane, Topography(wall_share=share), OIL).rough[1] for share in (0.0, 0.5, 1.0)]
    assert shares == [-1.0, 0.0, 1.0]


def test_film_is_sheared_as_between_smooth_walls_unless_the_case_asks_for_the_factors():
    plane = half_plane(16, 1e-6, MODULUS, 1e-3)
    with_, without = (
        LubricatedContact(plane, Topography(shear_stress_factors=on), OIL).stress_roughness[0] for on in (True, False)
    )
    assert (with_, without) == (2e-6, 0.0)
