"""Sizes of the units, by the definitions of NIST SP 811 and not by the constants of the module."""

import pytest

from seal_friction_ros.core.foundation.units import QUANTITIES, UNITS, ZEROS

PUBLISHED = {  # NIST SP 811, appendix B.8
    'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9,
    'mm': 1e-3, 'um': 1e-6, 'in': 2.54e-2,
    'mm/s': 1e-3, 'in/s': 2.54e-2,
    'kPa': 1e3, 'MPa': 1e6, 'bar': 1e5, 'psi': 6.894757e3,
    'kN': 1e3, 'lbf': 4.448222,
    'mm2': 1e-6, 'in2': 6.4516e-4,
    'deg': 1.745329e-2,
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
