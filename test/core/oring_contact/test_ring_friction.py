"""Friction as a shear stress over the computed contact, its fit to readings, and rings of other sizes."""

import dataclasses
import math

import numpy as np
import pytest

from seal_friction_ros.core.friction.actuator import Seal, Uncertainty
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.contact_shear import ContactShear, ShearLaw
from seal_friction_ros.core.friction.laws.friction_coefficient import PowerLaw
from seal_friction_ros.core.oring_contact.oring_case import OringNumerics
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.results import WallContact, oring_results
from seal_friction_ros.core.oring_contact.ring_friction import (
    ONE_READING_STD,
    PRIOR_LAW,
    Reading,
    fit_shear_law,
    friction_after,
    friction_law,
    friction_of_contact,
)
from seal_friction_ros.files import config_path, read_yaml

PRESSURES = (0.0, 2e6, 4e6)  # [Pa]


def hertz(load: float, width: float, length: float = 0.05, nodes: int = 20) -> WallContact:
    """Contact with the stress of a pressed cylinder: ``load`` [N] on a ``width`` [m] along ``length`` [m]."""
    place = np.linspace(-1.0, 1.0, nodes + 2)[1:-1]
    peak = 4.0 * load / (math.pi * width * length)
    half = width / 2.0
    return WallContact(half * place, peak * np.sqrt(1.0 - place**2), load, load, peak, (-half, half), length)


CONTACTS = [hertz(20.0, 0.5e-3), hertz(120.0, 0.9e-3), hertz(230.0, 1.1e-3)]


def test_a_constant_shear_stress_acts_on_the_area_and_a_constant_coefficient_on_the_normal_force():
    (contact, *_) = CONTACTS
    assert friction_of_contact(ShearLaw(3e5, 0.0), contact) == pytest.approx(3e5 * 0.5e-3 * 0.05)
    assert friction_of_contact(ShearLaw(3e5, 1.0), contact) == pytest.approx(0.3 * 20.0)
    assert friction_of_contact(PowerLaw(2.0, 0.5), contact) == pytest.approx(2.0 * 20.0**0.5)


def test_the_integral_over_an_elliptic_stress_has_its_closed_form():
    """Mean of (1 - x^2)^(n/2) over the width: sqrt(pi)/2 Gamma(n/2 + 1) / Gamma(n/2 + 3/2)."""
    n = 1.0 / 3.0
    contact = hertz(100.0, 1e-3)
    mean = math.sqrt(math.pi) / 2.0 * math.gamma(n / 2.0 + 1.0) / math.gamma(n / 2.0 + 1.5)
    exact = 1e-3 * 0.05 * (contact.peak_stress / 1e6) ** n * mean
    assert contact.sheared_area(n) == pytest.approx(exact, rel=2e-3)
    assert hertz(100.0, 1e-3, nodes=80).sheared_area(n) == pytest.approx(exact, rel=1e-4)


def test_a_contact_that_shrinks_by_less_than_the_error_of_the_mesh_has_a_law_and_one_that_shrinks_more_is_refused():
    geometry = parse_oring_case(read_yaml(config_path('oring', 'ms28775_114'))).case.geometry
    law, first = ShearLaw(2.5e5, 1.0), hertz(100.0, 0.9e-3)
    level = friction_law(law, geometry, PRESSURES, [first, hertz(98.0, 0.9e-3), hertz(230.0, 1.1e-3)])
    assert level.coulomb_friction(2e6) == level.coulomb_friction(0.0) == pytest.approx(25.0)
    with pytest.raises(ValueError, match='friction falls with pressure, at 2e\\+06 Pa by 4 %: the fluid passes a lip'):
        friction_law(law, geometry, PRESSURES, [first, hertz(96.0, 0.9e-3), hertz(230.0, 1.1e-3)])


def test_the_law_of_a_seal_file_is_the_friction_of_each_contact():
    geometry = parse_oring_case(read_yaml(config_path('oring', 'ms28775_114'))).case.geometry
    for law in (ShearLaw(2.5e5, 0.3), PowerLaw(2.0, 0.5)):
        made = friction_law(law, geometry, PRESSURES, CONTACTS)
        direct = [friction_of_contact(law, contact) for contact in CONTACTS]
        assert [made.coulomb_friction(p) for p in PRESSURES] == pytest.approx(direct)


def readings(law: ShearLaw, factors: tuple[float, ...] = (1.0, 1.0, 1.0)) -> list[Reading]:
    exact = [friction_of_contact(law, contact) for contact in CONTACTS]
    return [Reading(p, 0.01, f * force) for p, f, force in zip(PRESSURES, factors, exact, strict=True)]


@pytest.mark.parametrize('which', [0, 1, 2])
def test_one_reading_fixes_the_factor_keeps_the_exponent_and_leaves_15_percent(which):
    found = fit_shear_law(ShearLaw(1e4, 0.4), PRESSURES, CONTACTS, [readings(ShearLaw(6e4, 0.4))[which]])
    assert found.law.shear_stress == pytest.approx(6e4, rel=1e-3)
    assert found.law.exponent == pytest.approx(0.4, abs=1e-3)
    assert found.relative_std == pytest.approx(ONE_READING_STD)
    assert found.deviations == pytest.approx([0.0])


def test_many_readings_move_the_exponent_and_few_of_one_pressure_do_not():
    truth = ShearLaw(6e4, 0.6)
    many = fit_shear_law(PRIOR_LAW, PRESSURES, CONTACTS, 30 * readings(truth))
    assert many.law.exponent == pytest.approx(0.6, abs=0.03)
    assert many.relative_std < 0.05
    at_one = fit_shear_law(PRIOR_LAW, PRESSURES, CONTACTS, 5 * readings(truth)[:1])
    assert at_one.law.exponent == pytest.approx(PRIOR_LAW.exponent, abs=1e-3)


def test_readings_that_scatter_leave_their_scatter():
    found = fit_shear_law(PRIOR_LAW, PRESSURES, CONTACTS, 10 * readings(PRIOR_LAW, (1.3, 0.7, 1.3)))
    assert found.relative_std == pytest.approx(0.29, abs=0.05)
    assert np.abs(found.deviations).max() > 0.2


@pytest.mark.parametrize(
    ('reading', 'words'),
    [
        (Reading(1e6, 0.01, 0.0), 'a reading of 0 N is not above 0 N'),
        (Reading(5e6, 0.01, 1.0), 'outside the computed 0 to 4e.06 Pa: give --pressures'),
    ],
)
def test_a_reading_that_cannot_be_used_is_refused(reading, words):
    with pytest.raises(ValueError, match=words):
        fit_shear_law(PRIOR_LAW, PRESSURES, CONTACTS, [reading])


def test_another_ring_of_the_same_seal_has_its_shear_law_its_breakaway_ratio_and_a_factor_of_three():
    law = ContactShear(2e5, 0.3, (0.0, 1e6), (1e-5, 3e-5))
    seal = Seal(
        name='mine', coulomb_law=law, uncertainty=Uncertainty(0.1), stiction=1.0, stiction_ratio=0.1,
        friction_scale=1.5, pressure_max=1e6,
    )  # fmt: skip
    found = friction_after(seal)
    assert found.law == ShearLaw(3e5, 0.3)
    assert found.stiction_ratio == pytest.approx(0.1 + 1.0 / 4.0)  # 2 N and 6 N
    assert found.uncertainty == Uncertainty(2.0)
    with pytest.raises(ValueError, match='its constant_coulomb is for its own size'):
        friction_after(dataclasses.replace(seal, coulomb_law=ConstantCoulomb(3.0)))


def test_four_times_the_diameter_at_equal_stress_has_four_times_the_friction():
    """And the coefficient of friction at the normal force of the whole ring has half of that."""
    file = parse_oring_case(read_yaml(config_path('oring', 'ms28775_114')))
    case = dataclasses.replace(file.case, numerics=OringNumerics(lines=13))
    small = case.geometry
    large = dataclasses.replace(
        small,
        ring_inner_diameter=4.0 * small.ring_inner_diameter,
        rod_diameter=4.0 * small.rod_diameter,
        gland_diameter=4.0 * small.rod_diameter + (small.gland_diameter - small.rod_diameter),
    )
    pressures = (1.7e6, 6.9e6)
    for one, other in zip(
        oring_results(case, pressures), oring_results(dataclasses.replace(case, geometry=large), pressures), strict=True
    ):
        assert other.rod.peak_stress == pytest.approx(one.rod.peak_stress, rel=0.05)
        for exponent in (0.0, 1.0 / 3.0, 1.0):
            assert other.rod.sheared_area(exponent) == pytest.approx(4.0 * one.rod.sheared_area(exponent), rel=0.05)
        by_force = PowerLaw(2.08, 0.562)
        assert friction_of_contact(by_force, other.rod) < 2.0 * friction_of_contact(by_force, one.rod)
        assert one.rod.sheared_area(1.0) * 1e6 == pytest.approx(one.rod.force)
