"""The rubber of the finite-element O-ring: derivatives of its energy, small strains, no part of it in pure volume."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.oring_contact.material import (
    Rubber,
    elastic_modulus_of_hardness,
    hardness_of_elastic_modulus,
    modulus_of_ogden,
    rubber_field,
    rubber_of_tension,
    shear_response,
    volume_response,
    von_mises_stress,
)

UNDEFORMED = np.array([1.0, 0.0, 0.0, 1.0, 1.0])
RUBBER = Rubber(elastic_modulus=6e6)
DEFORMED = UNDEFORMED + np.array([0.12, -0.3, 0.21, -0.15, 0.08])


def slopes(function, at: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Derivative by central differences, over the last axis."""
    columns = []
    for i in range(len(at)):
        change = np.zeros(len(at))
        change[i] = step
        columns.append((function(at + change) - function(at - change)) / (2.0 * step))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize('response', [lambda f: shear_response(RUBBER, f), volume_response])
def test_stress_and_stiffness_are_the_derivatives_of_the_energy(response):
    at = response(DEFORMED)
    scale = np.abs(at.stiffness).max()
    assert slopes(lambda f: response(f).energy, DEFORMED) == pytest.approx(at.stress, abs=1e-8 * scale)
    assert slopes(lambda f: response(f).stress, DEFORMED) == pytest.approx(at.stiffness, abs=1e-8 * scale)


def test_free_rubber_bears_nothing_and_swelling_costs_no_shear_energy():
    assert shear_response(RUBBER, UNDEFORMED).energy == pytest.approx(0.0, abs=1e-9)
    swollen = UNDEFORMED * 1.2
    assert shear_response(RUBBER, swollen).energy == pytest.approx(0.0, abs=1e-9)
    assert von_mises_stress(RUBBER, swollen) == pytest.approx(0.0, abs=1e-6)


def test_turning_the_section_costs_nothing():
    c, s = np.cos(0.7), np.sin(0.7)
    turned = np.array([c, -s, s, c, 1.0])
    assert shear_response(RUBBER, turned).energy == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize('stretch', [0.7, 0.999, 1.001, 1.5])
def test_a_strip_pulled_along_the_hoop_carries_the_stress_of_mooney_and_rivlin(stretch: float):
    c10, c01 = RUBBER.terms.values()
    thinner = stretch**-0.5
    pulled = np.array([thinner, 0.0, 0.0, thinner, stretch])
    expected = 2.0 * (stretch**2 - 1.0 / stretch) * (c10 + c01 / stretch)  # Cauchy stress
    assert von_mises_stress(RUBBER, pulled) == pytest.approx(abs(expected), rel=1e-12)


@pytest.mark.parametrize('shear', [0.3, -1.2])
@pytest.mark.parametrize('turn', [0.0, 0.9])
def test_a_sheared_section_carries_the_stress_of_mooney_and_rivlin_however_it_is_turned(shear: float, turn: float):
    """2 C10 B - 2 C01 / B: shear stress 2 (C10 + C01) g, normal stresses apart by 2 C10 g^2 and 2 C01 g^2."""
    c10, c01 = RUBBER.terms.values()
    c, s = np.cos(turn), np.sin(turn)
    sheared = np.array([c, c * shear - s, s, s * shear + c, 1.0])
    normal, by_c10, by_c01 = (2.0 * factor * shear**2 for factor in (c10 + c01, c10, c01))
    expected = np.sqrt(0.5 * (normal**2 + by_c10**2 + by_c01**2) + 3.0 * (2.0 * (c10 + c01) * shear) ** 2)
    assert von_mises_stress(RUBBER, sheared) == pytest.approx(expected, rel=1e-12)


def test_volume_is_that_of_section_and_circumference_together():
    assert volume_response(np.array([1.2, 0.5, -0.1, 0.9, 1.1])).energy == pytest.approx((1.08 + 0.05) * 1.1)


def test_at_small_strain_it_has_its_young_modulus():
    strain = 1e-5
    pulled = np.array([(1 + strain) ** -0.5, 0.0, 0.0, (1 + strain) ** -0.5, 1 + strain])
    assert von_mises_stress(RUBBER, pulled) / strain == pytest.approx(6e6, rel=1e-4)


def test_hardness_70_is_5_5_mpa_as_gent_has_it_and_back():
    assert elastic_modulus_of_hardness(70.0) == pytest.approx(5.52e6, rel=1e-3)
    assert hardness_of_elastic_modulus(elastic_modulus_of_hardness(83.0)) == pytest.approx(83.0, rel=1e-12)


@pytest.mark.parametrize('hardness', [10.0, 99.0, float('nan')])
def test_a_hardness_beyond_the_rule_is_refused(hardness: float):
    with pytest.raises(ValueError, match='20 to 95'):
        elastic_modulus_of_hardness(hardness)


def test_what_is_no_rubber_is_refused():
    with pytest.raises(ValueError, match='not a nearly incompressible rubber'):
        Rubber(elastic_modulus=1e9, bulk_modulus=2e9)


YEOH = Rubber(elastic_modulus=6e6, mooney_ratio=0.2, yeoh_second=-0.1, yeoh_third=0.05)


def test_the_rubber_of_yeoh_has_the_derivatives_of_its_energy():
    gradient = np.array([1.3, 0.2, -0.1, 0.8, 1.1])
    response = shear_response(YEOH, gradient)
    step = 1e-6
    steps = step * np.eye(5)
    around = [[shear_response(YEOH, gradient + sign * s) for s in steps] for sign in (1.0, -1.0)]
    slope = [up.energy - down.energy for up, down in zip(*around, strict=True)]
    curve = [up.stress - down.stress for up, down in zip(*around, strict=True)]
    assert response.stress.ravel() == pytest.approx(np.ravel(slope) / (2.0 * step), rel=1e-6)
    assert response.stiffness.ravel() == pytest.approx(np.ravel(curve) / (2.0 * step), rel=1e-6, abs=1.0)


def tension(rubber: Rubber, stretch: np.ndarray) -> np.ndarray:
    """Nominal stress of a free bar: dW/d lambda along the incompressible path."""
    step = 1e-6

    def energy(at: np.ndarray) -> np.ndarray:
        zero = np.zeros_like(at)
        return shear_response(rubber, np.stack((at**-0.5, zero, zero, at, at**-0.5), axis=-1)).energy

    return (energy(stretch + step) - energy(stretch - step)) / (2.0 * step)


def test_a_tension_test_gives_its_rubber_back():
    stretch = np.linspace(0.8, 2.0, 25)
    yeoh = rubber_of_tension(stretch, tension(replace(YEOH, mooney_ratio=0.0), stretch))
    assert (yeoh.elastic_modulus, yeoh.yeoh_second, yeoh.yeoh_third) == pytest.approx((6e6, -0.1, 0.05), rel=1e-4)
    rivlin = Rubber(elastic_modulus=5e6, mooney_ratio=0.3)
    found = rubber_of_tension(stretch, tension(rivlin, stretch), 'mooney')
    assert (found.elastic_modulus, found.mooney_ratio) == pytest.approx((5e6, 0.3), rel=1e-4)


def test_a_curve_that_is_no_tension_test_is_refused():
    with pytest.raises(ValueError, match='four points or more'):
        rubber_of_tension(np.array([1.0, 1.1, 1.2, 1.3]), np.zeros(4))
    with pytest.raises(ValueError, match='not that of a rubber of mooney'):
        rubber_of_tension(np.linspace(1.1, 2.0, 9), -np.linspace(1.0, 2.0, 9), 'mooney')
    with pytest.raises(ValueError, match="'gent' is none of mooney, yeoh, ogden"):
        rubber_of_tension(np.linspace(1.1, 2.0, 9), np.ones(9), 'gent')


# -- Ogden ------------------------------------------------------------------------------------------------------------

OGDEN = Rubber(1e6, ogden_moduli=(0.63e6, 1.2e3, -1e4), ogden_exponents=(1.3, 5.0, -2.0))
"""Ratios of the constants that R. W. Ogden found for the rubber of Treloar (1972)."""


def test_the_rubber_of_ogden_has_the_derivatives_of_its_energy_where_both_stretches_are_equal_too():
    for at in (DEFORMED, UNDEFORMED, UNDEFORMED * np.array([1.3, 1.0, 1.0, 1.3, 0.7])):
        found = shear_response(OGDEN, at)
        assert slopes(lambda f: shear_response(OGDEN, f).energy, at) == pytest.approx(found.stress, abs=1e-2)
        assert slopes(lambda f: shear_response(OGDEN, f).stress, at) == pytest.approx(found.stiffness, abs=1e-1)


@pytest.mark.parametrize('stretches', [(1.7, 0.8), (0.6, 2.1), (1.2, 1.2)])
def test_ogden_has_the_stress_of_its_principal_stretches_however_the_section_is_turned(
    stretches: tuple[float, float],
):
    first, second = stretches
    hoop = 1.0 / (first * second)
    c, s = np.cos(0.7), np.sin(0.7)
    turned = np.array([c * first, -s * second, s * first, c * second, hoop])

    def stress(stretch: float) -> float:
        return sum(alpha * constant * stretch**alpha for alpha, constant in OGDEN.terms.items())

    a, b, h = map(stress, (first, second, hoop))
    expected = np.sqrt(0.5 * ((a - b) ** 2 + (b - h) ** 2 + (h - a) ** 2))
    assert von_mises_stress(OGDEN, turned) == pytest.approx(expected, rel=1e-11)


def test_with_the_exponents_2_and_minus_2_ogden_is_mooney_and_rivlin():
    moduli = tuple(alpha * constant for alpha, constant in RUBBER.terms.items())
    same = Rubber(RUBBER.elastic_modulus, ogden_moduli=moduli, ogden_exponents=(2.0, -2.0))
    for one, other in zip(shear_response(same, DEFORMED), shear_response(RUBBER, DEFORMED), strict=True):
        assert one == pytest.approx(other, rel=1e-12)


def test_constants_of_ogden_meet_the_tension_test_of_treloar():
    """Nominal stress [MPa] of vulcanised rubber, L. R. G. Treloar 1944; constants: R. W. Ogden 1972."""
    rubber = replace(OGDEN, elastic_modulus=modulus_of_ogden(OGDEN.ogden_moduli, OGDEN.ogden_exponents))
    stretch = np.array([1.12, 1.61, 2.42, 3.01, 3.58, 4.03, 4.76, 5.36, 5.76, 6.16, 6.62, 7.05])
    stress = np.array([0.14, 0.41, 0.67, 0.85, 1.04, 1.21, 1.58, 1.94, 2.29, 2.67, 3.39, 4.12])
    assert tension(rubber, stretch) / 1e6 == pytest.approx(stress, rel=0.12)
    assert tension(rubber, stretch[3:]) / 1e6 == pytest.approx(stress[3:], rel=0.05)
    fitted = rubber_of_tension(stretch, 1e6 * stress, 'ogden')
    assert tension(fitted, stretch) / 1e6 == pytest.approx(stress, rel=0.08)
    shear = fitted.elastic_modulus / 3e6
    assert 0.35 < shear < 0.5  # [MPa]; Treloar: 4 kgf/cm2, which is 0.39


def test_elements_of_ogden_beside_those_of_mooney_have_their_own_stress():
    field = rubber_field((OGDEN, RUBBER), np.array([0, 1]))
    both = shear_response(field, np.stack((DEFORMED, DEFORMED))[:, None])
    for i, rubber in enumerate((OGDEN, RUBBER)):
        assert both.stress[i, 0] == pytest.approx(shear_response(rubber, DEFORMED).stress[0], rel=1e-11)


@pytest.mark.parametrize(
    ('series', 'reason'),
    [
        ({'ogden_moduli': (1e6,)}, 'as many of one as of the other'),
        ({'ogden_moduli': (1e6, 1e5), 'ogden_exponents': (2.0, 2.0)}, 'no exponent twice'),
        ({'ogden_moduli': (1e6, 1e5), 'ogden_exponents': (2.0, -2.0)}, 'the sign of its exponent'),
        ({'prony_shares': (0.6, 0.5), 'prony_times': (1.0, 2.0)}, 'shares below 1 in sum'),
        ({'prony_shares': (0.6,)}, 'as many of one as of the other'),
        ({'prony_shares': (0.6,), 'prony_times': (0.0,)}, r'prony_times\[0\] = 0.0 s is below'),
    ],
)
def test_a_series_that_is_no_rubber_is_refused(series: dict[str, tuple[float, ...]], reason: str):
    with pytest.raises(ValueError, match=reason):
        Rubber(6e6, **series)


def test_a_modulus_relaxes_by_its_series():
    rubber = Rubber(6e6, prony_shares=(0.3, 0.2), prony_times=(1.0, 1e3))
    at = [replace(rubber, time_since_mounting=time).modulus for time in (0.0, 1.0, 1e9)]
    assert at == pytest.approx([6e6, 6e6 * (1.0 - 0.3 * (1.0 - np.exp(-1.0)) - 0.2e-3), 3e6], rel=1e-5)
    pulled = UNDEFORMED * np.array([1.2**-0.5, 1.0, 1.0, 1.2**-0.5, 1.2])
    relaxed = replace(rubber, time_since_mounting=1e9)
    assert von_mises_stress(relaxed, pulled) == pytest.approx(0.5 * von_mises_stress(rubber, pulled))
