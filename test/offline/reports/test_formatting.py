"""Numbers and quantities as text."""

import math

import pytest

from seal_friction_ros.core.foundation.units import BAR, PSI
from seal_friction_ros.offline.reports.formatting import (
    DASH,
    MINUS,
    force_unit,
    length_text,
    length_unit,
    number,
    pressure_range,
    pressure_text,
    relative_change,
    signed_percent,
    speed_unit,
    thousands,
)


@pytest.mark.parametrize(
    ('value', 'digits', 'signed', 'text'),
    [
        (1.005, 1, False, '1.0'),
        (-0.04, 1, True, '0.0'),
        (-2.5, 1, True, f'{MINUS}2.5'),
        (2.5, 0, True, '+2'),
        (None, 2, False, DASH),
        (math.nan, 2, True, DASH),
        (-math.inf, 2, False, DASH),
    ],
)
def test_number_has_its_decimals_and_no_minus_zero(value, digits, signed, text):
    assert number(value, digits, signed=signed) == text


def test_shares_and_changes():
    assert [signed_percent(share) for share in (0.125, -0.3, 1e-5)] == ['+12.5 %', f'{MINUS}30 %', '0 %']
    changes = [relative_change(*pair) for pair in ((4.0, 1.0), (1.0, 1.5), (0.0, 1.0))]
    assert changes == [f'{MINUS}75 %', '+50 %', '0 %']
    assert thousands(1234567) == '1\N{THIN SPACE}234\N{THIN SPACE}567'


def test_units_follow_the_size():
    assert (force_unit(1999.0), force_unit(2e3)) == (('N', 1.0), ('kN', 1e3))
    assert (length_unit(9e-4)[0], length_unit(1e-3)[0]) == ('µm', 'mm')
    assert (speed_unit(0.9)[0], speed_unit(1.0)[0]) == ('mm/s', 'm/s')
    assert (length_text(0.99951e-3), length_text(-2.5e-4)) == ('1 mm', '-250 µm')


def test_pressures():
    assert pressure_text(500.0 * PSI) == '34.5 bar (500 psi)'
    assert pressure_range(0.0, 68.9 * BAR) == '0 to 68.9 bar'
