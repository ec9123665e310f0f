"""The rubber of the finite-element O-ring: derivatives of its energy, small strains, no part of it in pure volume."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.oring_contact.material import (
    Rubber,
    elastic_modulus_of_hardness,
    hardness_of_elastic_modulus,
    mooney_rivlin_constants,
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
    c10, c01 = mooney_rivlin_constants(RUBBER)
    thinner = stretch**-0.5
    pulled = np.array([thinner, 0.0, 0.0, thinner, stretch])
    expected = 2.0 * (stretch**2 - 1.0 / stretch) * (c10 + c01 / stretch)  # Cauchy stress
    assert von_mises_stress(RUBBER, pulled) == pytest.approx(abs(expected), rel=1e-12)


@pytest.mark.parametrize('shear', [0.3, -1.2])
@pytest.mark.parametrize('turn', [0.0, 0.9])
def test_a_sheared_section_carries_the_stress_of_mooney_and_rivlin_however_it_is_turned(shear: float, turn: float):
    """2 C10 B - 2 C01 / B: shear stress 2 (C10 + C01) g, normal stresses apart by 2 C10 g^2 and 2 C01 g^2."""
    c10, c01 = mooney_rivlin_constants(RUBBER)
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
    with pytest.raises(ValueError, match="'ogden' is none of mooney, yeoh"):
        rubber_of_tension(np.linspace(1.1, 2.0, 9), np.ones(9), 'ogden')
