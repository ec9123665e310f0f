"""Friction as a shear stress over the computed contact, its fit to readings, and rings of other sizes."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad

from seal_friction_ros.core.friction.actuator import Seal, Uncertainty
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.contact_shear import HIGHEST_KNEE, ContactShear, ShearLaw
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


def test_under_a_high_knee_the_coefficient_is_constant_and_far_above_a_low_one_the_logarithm_acts_on_the_area():
    (contact, *_) = CONTACTS
    assert friction_of_contact(ShearLaw(3e11, 1e12), contact) == pytest.approx(0.3 * 20.0)
    more = friction_of_contact(ShearLaw(3e5, 1.0), contact) - friction_of_contact(ShearLaw(3e5, 2.0), contact)
    assert more == pytest.approx(3e5 * math.log(2.0) * 0.5e-3 * 0.05, rel=1e-6)
    assert friction_of_contact(PowerLaw(2.0, 0.5), contact) == pytest.approx(2.0 * 20.0**0.5)


@pytest.mark.parametrize('knee', [1e4, 3e5, 1e7])
def test_the_integral_over_an_elliptic_stress_is_exact(knee):
    """Over the stress of Hertz, by adaptive quadrature."""
    contact = hertz(100.0, 1e-3)
    mean, _ = quad(lambda x: math.asinh(contact.peak_stress / knee * math.sqrt(1.0 - x * x)), 0.0, 1.0)
    assert contact.sheared_area(knee) == pytest.approx(1e-3 * 0.05 * mean, rel=2e-3)
    assert hertz(100.0, 1e-3, nodes=80).sheared_area(knee) == pytest.approx(1e-3 * 0.05 * mean, rel=1e-4)


def test_a_contact_that_shrinks_by_less_than_the_error_of_the_mesh_has_a_law_and_one_that_shrinks_more_is_refused():
    geometry = parse_oring_case(read_yaml(config_path('oring', 'ms28775_114'))).case.geometry
    law, first = ShearLaw(0.25 * HIGHEST_KNEE, HIGHEST_KNEE), hertz(100.0, 0.9e-3)  # 0.25 of the stress
    level = friction_law(law, geometry, PRESSURES, [first, hertz(98.0, 0.9e-3), hertz(230.0, 1.1e-3)])
    assert level.coulomb_friction(2e6) == level.coulomb_friction(0.0) == pytest.approx(25.0, rel=1e-3)
    with pytest.raises(ValueError, match='friction falls with pressure, at 2e\\+06 Pa by 4 %: the fluid passes a lip'):
        friction_law(law, geometry, PRESSURES, [first, hertz(96.0, 0.9e-3), hertz(230.0, 1.1e-3)])


def test_the_law_of_a_seal_file_is_the_friction_of_each_contact():
    geometry = parse_oring_case(read_yaml(config_path('oring', 'ms28775_114'))).case.geometry
    for law in (ShearLaw(1e5, 3e5), PowerLaw(2.0, 0.5)):
        made = friction_law(law, geometry, PRESSURES, CONTACTS)
        direct = [friction_of_contact(law, contact) for contact in CONTACTS]
        assert [made.coulomb_friction(p) for p in PRESSURES] == pytest.approx(direct)


def test_contacts_whose_area_falls_too_much_only_at_other_knees_than_that_found_have_a_law():
    contacts = [hertz(40.0, 0.9e-3), hertz(36.0, 0.96e-3), hertz(230.0, 1.1e-3)]
    first, second, _ = (contact.sheared_area(PRIOR_LAW.knee_stress) for contact in contacts)
    assert second / first == pytest.approx(0.978, abs=1e-3)
    reading = Reading(0.0, 0.01, PRIOR_LAW.shear_stress * first)
    found = fit_shear_law(PRIOR_LAW, PRESSURES, contacts, [reading])
    assert found.law.shear_stress == pytest.approx(PRIOR_LAW.shear_stress, rel=1e-3)
    with pytest.raises(ValueError, match='give pressures all below or all above that'):
        fit_shear_law(ShearLaw(1e5, 2.0 * PRIOR_LAW.knee_stress), PRESSURES, contacts, [reading])


def readings(law: ShearLaw, factors: tuple[float, ...] = (1.0, 1.0, 1.0)) -> list[Reading]:
    exact = [friction_of_contact(law, contact) for contact in CONTACTS]
    return [Reading(p, 0.01, f * force) for p, f, force in zip(PRESSURES, factors, exact, strict=True)]


@pytest.mark.parametrize('which', [0, 1, 2])
def test_one_reading_fixes_the_factor_keeps_the_knee_and_leaves_15_percent(which):
    found = fit_shear_law(ShearLaw(1e4, 4e5), PRESSURES, CONTACTS, [readings(ShearLaw(6e4, 4e5))[which]])
    assert found.law.shear_stress == pytest.approx(6e4, rel=1e-3)
    assert found.law.knee_stress == pytest.approx(4e5, rel=1e-3)
    assert found.relative_std == pytest.approx(ONE_READING_STD)
    assert found.deviations == pytest.approx([0.0])


def test_many_readings_move_the_knee_and_few_of_one_pressure_do_not():
    truth = ShearLaw(6e4, 1e6)
    many = fit_shear_law(PRIOR_LAW, PRESSURES, CONTACTS, 30 * readings(truth))
    assert many.law.knee_stress == pytest.approx(1e6, rel=0.05)
    assert many.relative_std < 0.05
    at_one = fit_shear_law(PRIOR_LAW, PRESSURES, CONTACTS, 5 * readings(truth)[:1])
    assert at_one.law.knee_stress == pytest.approx(PRIOR_LAW.knee_stress, rel=1e-3)


@pytest.mark.parametrize('knee', [1.0, 1e12])
def test_the_knee_of_a_fit_stays_within_the_bounds_of_the_law(knee):
    found = fit_shear_law(ShearLaw(1e5, knee), PRESSURES, CONTACTS, readings(PRIOR_LAW))
    assert 1.0 <= found.law.knee_stress <= 1e12


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


def test_another_ring_of_the_same_seal_has_its_shear_law_its_breakaway_ratio_and_the_std_of_no_reading():
    law = ContactShear(2e5, 3e5, (0.0, 1e6), (1e-5, 3e-5))
    seal = Seal(
        name='mine', coulomb_law=law, uncertainty=Uncertainty(0.1), stiction=1.0, stiction_ratio=0.1,
        friction_scale=1.5, pressure_max=1e6,
    )  # fmt: skip
    found = friction_after(seal)
    assert found.law == ShearLaw(3e5, 3e5)
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
        for knee in (1e3, 3e5, 1e9):
            assert other.rod.sheared_area(knee) == pytest.approx(4.0 * one.rod.sheared_area(knee), rel=0.05)
        by_force = PowerLaw(2.08, 0.562)
        assert friction_of_contact(by_force, other.rod) < 2.0 * friction_of_contact(by_force, one.rod)
        assert one.rod.sheared_area(1e12) * 1e12 == pytest.approx(one.rod.force)
