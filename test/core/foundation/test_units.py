"""Sizes of the units, by the definitions of NIST SP 811 and not by the constants of the module."""

import pytest

from seal_friction_ros.core.foundation.units import QUANTITIES, UNITS, ZEROS, in_si, unit_named

PUBLISHED = {  # NIST SP 811, appendix B.8
    'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0, 'h': 3600.0,
    'mm': 1e-3, 'cm': 1e-2, 'um': 1e-6, 'in': 2.54e-2,
    'mm/s': 1e-3, 'in/s': 2.54e-2,
    'kPa': 1e3, 'MPa': 1e6, 'bar': 1e5, 'mbar': 1e2, 'psi': 6.894757e3,
    'kN': 1e3, 'lbf': 4.448222,
    'mm2': 1e-6, 'cm2': 1e-4, 'in2': 6.4516e-4,
    'deg': 1.745329e-2, 'g': 1e-3, 't': 1e3, 'kHz': 1e3,
    'N/mm': 1e3, 'kN/m': 1e3, 'kN s/m': 1e3, 'mm/s2': 1e-3,
}  # fmt: skip


@pytest.mark.parametrize('unit', sorted(PUBLISHED))
def test_a_unit_has_its_published_size(unit):
    assert UNITS[unit] == pytest.approx(PUBLISHED[unit], rel=1e-6)


def test_every_other_unit_is_that_of_si():
    assert {UNITS[unit] for unit in UNITS.keys() - PUBLISHED.keys()} == {1.0}
    assert ZEROS == {'K': 0.0, 'degC': 273.15}


def test_a_quantity_begins_with_its_si_unit_and_every_unit_is_of_one():
    assert {UNITS[units[0]] for units in QUANTITIES.values()} == {1.0}
    assert {unit for units in QUANTITIES.values() for unit in units} == set(UNITS)


@pytest.mark.parametrize(
    ('heading', 'unit'),
    [
        ('P(psig)', 'psi'), ('Spd(in/s)', 'in/s'), ('time(s)', 's'), ('x_mm', 'mm'), ('Pressure A [bar]', 'bar'),
        ('velocity_mm_per_s', 'mm/s'), ('Temp (°C)', 'degC'), ('p (bar abs)', 'bar'), ('force_lbs', 'lbf'),
        ('velocity', ''), ('m', ''), ('pressure_a', ''), ('', ''),
    ],
)  # fmt: skip
def test_a_heading_names_its_unit(heading, unit):
    assert unit_named(heading) == unit


def test_a_temperature_in_degc_has_its_zero_and_a_difference_has_none():
    assert in_si('20 degC', 'K', 'oil') == pytest.approx(293.15)
    assert in_si('20 degC', 'K', 'oil', is_difference=True) == pytest.approx(20.0)
    assert in_si(20, 'K', 'oil') == 20.0
