"""The likely reason of a friction that is not that of the law: each clause up to its bound and not beyond."""

import math
from dataclasses import replace

import numpy as np
import pytest
from paths import ROOT

from seal_friction_ros.core.estimation.adaptation import NO_STROKE, Stroke
from seal_friction_ros.core.estimation.disagreement import Reversal, input_fault, likely_reason, reversal_between
from seal_friction_ros.core.foundation.units import PSI
from seal_friction_ros.core.friction.actuator import MountedSeal, Uncertainty, friction_of_seals, numbers_of_law
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import read_yaml

THESIS = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))  # identified from 0 to 6.9 MPa


def constant(friction=40.0, relative_std=0.01, pressure_min=0.0, pressure_max=7e6, chamber='a'):
    """Numbers of one seal with the same friction [N] at any pressure."""
    seal = replace(
        THESIS,
        coulomb_law=ConstantCoulomb(friction),
        uncertainty=Uncertainty(relative_std=relative_std),
        pressure_min=pressure_min,
        pressure_max=pressure_max,
    )
    return (MountedSeal(seal, chamber).numbers,)


def shown(*ratios, friction=40.0, pressure_a=3e6, pressure_b=0.0, offset=0.0):
    """Reversals with these ratios of the friction to that of the law."""
    return [Reversal(i, ratio, friction, offset, pressure_a, pressure_b) for i, ratio in enumerate(ratios)]


# --- what a reversal shows ---


def stroke(stamp, direction, reading, friction):
    return Stroke(direction, stamp, reading, friction, samples=9, is_identified=True)


def test_two_strokes_show_the_half_difference_as_friction_and_what_it_leaves_as_offset():
    out, back = stroke(3, 1, 66.0, 38.0), stroke(8, -1, -36.0, 42.0)
    ratio = 102.0 / 80.0
    found = reversal_between(out, back, 3e6, 4e6)
    assert found == Reversal(8, ratio, 42.0, pytest.approx(-36.0 + ratio * 42.0), 3e6, 4e6)
    found = reversal_between(back, out, 1e6, 2e6)
    assert found == Reversal(3, ratio, 38.0, pytest.approx(66.0 - ratio * 38.0), 1e6, 2e6)


@pytest.mark.parametrize(
    ('directions', 'frictions'),
    [((1, 1), (40.0, 40.0)), ((-1, -1), (40.0, 40.0)), ((1, 0), (40.0, 40.0)), ((1, -1), (0.0, 0.0))],
)
def test_strokes_of_one_direction_or_without_a_friction_of_the_law_show_none(directions, frictions):
    before, after = (stroke(i, d, 30.0 * d, f) for i, d, f in zip((1, 2), directions, frictions, strict=True))
    assert reversal_between(before, after, 0.0, 0.0) is None


def test_the_first_stroke_is_no_reversal():
    assert reversal_between(NO_STROKE, stroke(8, -1, -36.0, 42.0), 0.0, 0.0) is None


def test_strokes_show_the_weakest_friction_too():
    out, back = stroke(1, 1, 0.3, 0.2), stroke(2, -1, -0.3, 0.2)
    assert reversal_between(out, back, 0.0, 0.0).ratio == pytest.approx(1.5)


# --- an input that no seal explains ---


@pytest.mark.parametrize(
    ('ratio', 'clause'),
    [
        (0.049, 'does not follow the motion'),
        (-0.049, 'does not follow the motion'),
        (0.05, ''),
        (0.5, ''),
        (-0.051, 'the friction drives'),
        (-1.0, 'the friction drives'),
    ],
)
def test_friction_below_5_percent_is_none_and_a_negative_one_a_wrong_sign(ratio, clause):
    said = input_fault(constant(), shown(*[ratio] * 6))
    assert clause in said
    assert bool(said) is bool(clause)


def test_an_input_fault_needs_three_reversals():
    assert input_fault(constant(), shown(-1.0, -1.0)) == ''
    assert 'the friction drives' in input_fault(constant(), shown(-1.0, -1.0, -1.0))
    assert likely_reason(constant(), []) == ''


def test_the_last_twelve_reversals_count_and_no_older_one():
    half = [2.5] * 6 + [1.5] * 6  # the median of an even number lies in the middle
    for older in ([1.5] * 9, [-9.0] * 9):
        assert 'shows 2.00 times the friction' in likely_reason(constant(), shown(*older, *half))
    assert 'the friction drives' in input_fault(constant(), shown(*[1.0] * 20, *[-1.0] * 7, *[1.0] * 5))
    assert input_fault(constant(), shown(*[-1.0] * 20, *[1.0] * 12)) == ''


# --- a halved or doubled area, or another seal ---


@pytest.mark.parametrize(
    ('ratio', 'relative_std', 'is_area'),
    [
        (0.475, 0.01, True),  # within 6 % of a half, if the seal file states less
        (0.465, 0.01, False),
        (0.525, 0.01, True),
        (0.535, 0.01, False),
        (0.41, 0.1, True),  # within two standard deviations of the seal file
        (0.39, 0.1, False),
        (0.59, 0.1, True),
        (0.61, 0.1, False),
        (0.69, 0.4, True),  # a ratio above 0.7 is nearer to 1 than to a half
        (0.71, 0.4, False),
        (1.89, 0.01, True),  # within 6 % of twice the friction, whatever the seal file states
        (1.87, 0.01, False),
        (2.11, 0.01, True),
        (2.13, 0.01, False),
        (1.8, 0.4, False),
        (4.0, 0.01, False),
    ],
)
def test_a_ratio_near_a_half_or_two_may_be_an_area_and_any_other_is_another_seal(ratio, relative_std, is_area):
    said = likely_reason(constant(relative_std=relative_std), shown(*[ratio] * 4))
    assert said.startswith(f'the force sum shows {ratio:.2f} times the friction of the seal file: ')
    assert ('is an area in it halved or doubled?' in said) is is_area
    assert 'another seal' in said


@pytest.mark.parametrize(
    ('ratio', 'is_reason'), [(0.93, True), (0.95, False), (1.0, False), (1.05, False), (1.07, True)]
)
def test_the_friction_of_the_file_is_no_reason_whatever_marked_the_samples(ratio, is_reason):
    assert bool(likely_reason(constant(), shown(*[ratio] * 4))) is is_reason


def test_a_law_without_friction_leaves_6_percent():
    assert 'an area' in likely_reason(constant(friction=0.0), shown(0.475, 0.475, 0.475))
    assert 'an area' not in likely_reason(constant(friction=0.0), shown(0.465, 0.465, 0.465))
    assert 'an area' not in likely_reason(constant(friction=0.5, relative_std=0.0), shown(0.465, 0.465, 0.465))


def test_the_law_states_its_deviation_at_the_pressure_of_the_newest_reversal():
    """Without pressure the resolution of a reading is 0.15 of this friction, at 6 MPa it is nothing."""
    seal = replace(THESIS, uncertainty=Uncertainty(relative_std=0.0, absolute_std=1.0))
    numbers = (MountedSeal(seal, 'a').numbers,)
    low, high = (friction_of_seals(numbers, p, 0.0, 0.0) for p in (0.0, 6e6))
    assert 2.0 * low.coulomb_friction_std / low.coulomb_friction > 0.15
    assert 2.0 * high.coulomb_friction_std / high.coulomb_friction < 0.1
    at = {p: shown(0.44, pressure_a=p) for p in (0.0, 6e6)}
    assert 'an area' in likely_reason(numbers, at[6e6] + at[6e6] + at[0.0])
    assert 'an area' not in likely_reason(numbers, at[0.0] + at[0.0] + at[6e6])


# --- an area, told by an offset that follows a pressure ---


def with_offsets(pressures_a, pressures_b, offsets, ratio=1.0):
    return [
        Reversal(i, ratio, 40.0, float(offset), float(a), float(b))
        for i, (a, b, offset) in enumerate(zip(pressures_a, pressures_b, offsets, strict=True))
    ]


RAMP = np.array([1e6, 2e6, 3e6, 4e6, 5e6, 6e6])
HELD = np.full(6, 2e6)
MIXED, MIXED_TOO = RAMP[[0, 3, 1, 4, 2, 5]], RAMP[[2, 0, 5, 1, 3, 4]]


@pytest.mark.parametrize(
    ('pressures', 'followed', 'name'),
    [
        ((RAMP, HELD), RAMP, 'a'),
        ((HELD, RAMP), RAMP, 'b'),
        ((MIXED, MIXED_TOO), MIXED - MIXED_TOO, 'a less b'),
    ],
)
@pytest.mark.parametrize('area', [20.0, -35.0])  # [mm2]
def test_an_offset_that_is_a_line_over_a_pressure_names_chamber_and_area(pressures, followed, name, area):
    said = likely_reason(constant(), with_offsets(*pressures, 7.0 + area * 1e-6 * followed))
    assert said.endswith(f'pressure of chamber {name}: an area in it is off by {area:.4g} mm2')


def test_a_line_needs_six_reversals():
    reversals = with_offsets(RAMP, HELD, 20e-6 * RAMP)
    assert 'an area in it is off' in likely_reason(constant(), reversals)
    assert 'an area in it is off' not in likely_reason(constant(), reversals[:5])


@pytest.mark.parametrize('ratio', [1.0, 2.5])
@pytest.mark.parametrize(('share', 'is_named'), [(0.99, False), (1.0, True)])
def test_an_offset_that_changes_by_less_than_the_friction_tells_no_area(share, is_named, ratio):
    offsets = share * ratio * 40.0 * np.linspace(0.0, 1.0, 6)
    said = likely_reason(constant(), with_offsets(RAMP, HELD, offsets, ratio))
    assert ('an area in it is off' in said) is is_named


def test_reversals_of_the_wrong_sign_have_friction_too():
    """Those of long ago; the last twelve have the right one."""
    ramp = np.tile(RAMP, 6)
    old = with_offsets(ramp, 0.0 * ramp, 6e-6 * ramp, -1.0)  # 30 N, less than the friction
    assert 'an area in it is off' not in likely_reason(constant(), old + with_offsets(RAMP, HELD, 6e-6 * RAMP) * 2)


@pytest.mark.parametrize(('scatter', 'is_named'), [(0.39, True), (0.42, False)])
def test_a_line_has_a_correlation_of_95_percent(scatter, is_named):
    """Its correlation is 1 / sqrt(1 + 2 s^2 / 3) with the scatter s, which is 0.95 at s = 0.403."""
    line, away = np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]), np.array([1.0, 0.0, -1.0, 1.0, 0.0, -1.0])
    said = likely_reason(constant(), with_offsets(3e6 + 1e6 * line, HELD, 100.0 * (line + scatter * away)))
    assert ('an area in it is off' in said) is is_named


# --- the unit of a pressure ---


def units_of(numbers, pressures, factor, ratio=1.0, scatter=0.0):
    """Reversals of a machine with the friction of the law whose pressures [Pa] are given in a unit of ``factor`` Pa."""
    each = [friction_of_seals(numbers, p, p, 0.0).coulomb_friction for p in pressures]
    given = [friction_of_seals(numbers, p / factor, p / factor, 0.0).coulomb_friction for p in pressures]
    found = []
    for i in range(1, len(pressures)):
        law = 0.5 * (given[i] + given[i - 1])
        true = ratio * math.exp((-1) ** i * scatter) * 0.5 * (each[i] + each[i - 1])
        found.append(Reversal(i, true / law, law, 0.0, pressures[i] / factor, pressures[i] / factor))
    return found


PRESSURES = [1e6, 5e6, 2e6, 6e6, 3e6, 5.5e6, 1.5e6, 4e6]  # [Pa]
NUMBERS = (MountedSeal(THESIS, 'a').numbers,)


@pytest.mark.parametrize(('unit', 'factor'), [('psi', PSI), ('bar', 1e5), ('kPa', 1e3), ('MPa', 1e6)])
@pytest.mark.parametrize('ratio', [0.8, 1.0, 1.25])
def test_the_unit_is_the_one_whose_friction_scatters_least_on_any_day(unit, factor, ratio):
    assert (
        input_fault(NUMBERS, units_of(NUMBERS, PRESSURES, factor, ratio)) == f'the pressure looks like {unit}, not Pa'
    )


def test_pressures_in_pascals_are_never_taken_for_another_unit():
    assert input_fault(NUMBERS, units_of(NUMBERS, PRESSURES, 1.0)) == ''
    assert input_fault(NUMBERS, units_of(NUMBERS, [0.0] * 8, 1.0)) == ''


def test_the_largest_magnitude_that_a_seal_sees_tells_the_unit():
    """One of 3 MPa is in Pa, whatever its sign, and whatever else is small."""
    seals = constant(pressure_min=1e6) + constant(pressure_min=1e6, chamber='b')
    for a, b in ((30.0, -3e6), (-3e6, 30.0), (30.0, 3e6)):
        assert input_fault(seals, shown(1.0, 1.0, 1.0, 1.0, pressure_a=a, pressure_b=b)) == ''
    assert 'bar' in input_fault(seals, shown(1.0, 1.0, 1.0, 1.0, pressure_a=-30.0, pressure_b=2.0))


@pytest.mark.parametrize(
    ('pressure', 'unit'),
    [
        (29.5, ''),  # 2.95 MPa are below the lowest identified pressure, 3 MPa less 1 % of the range
        (29.6, 'bar'),
        (105.6, 'bar'),  # 10.56 MPa are 1.5 times the highest one, 7 MPa and 1 %
        (105.7, ''),
        (428.0, ''),
        (432.0, 'psi'),
        (2900.0, ''),
        (5000.0, 'kPa'),
        (2.9, ''),
        (3.0, 'MPa'),
    ],
)
def test_below_the_identified_pressures_a_unit_leads_inside_them_or_not_far_above(pressure, unit):
    said = input_fault(constant(pressure_min=3e6), shown(1.0, 1.0, 1.0, 1.0, pressure_a=pressure))
    assert said == (f'the pressure looks like {unit}, not Pa' if unit else '')


@pytest.mark.parametrize(('ratio', 'is_named'), [(2.55, True), (2.65, False), (1.0 / 2.55, True), (1.0 / 2.65, False)])
def test_below_the_identified_pressures_the_friction_contradicts_a_unit_beyond_twice_1_3(ratio, is_named):
    said = input_fault(constant(pressure_min=1e6), shown(*[ratio] * 4, pressure_a=30.0))
    assert bool(said) is is_named


def test_of_several_seals_the_range_that_all_of_them_were_identified_in_counts():
    wide, narrow = constant(pressure_min=1e6, pressure_max=7e6), constant(pressure_min=2e6, pressure_max=3e6)
    for seals in (wide + narrow, narrow + wide):
        assert 'bar' in input_fault(seals, shown(1.0, 1.0, 1.0, 1.0, pressure_a=25.0))
        assert input_fault(seals, shown(1.0, 1.0, 1.0, 1.0, pressure_a=15.0)) == ''  # below 2 MPa
        assert input_fault(seals, shown(1.0, 1.0, 1.0, 1.0, pressure_a=50.0)) == ''  # above 1.5 times 3 MPa


def test_seals_without_identified_pressures_tell_no_unit():
    assert input_fault((numbers_of_law(ConstantCoulomb(40.0)),), shown(1.0, 1.0, 1.0, pressure_a=30.0)) == ''


def test_a_reversal_with_the_wrong_sign_or_without_friction_contradicts_every_unit():
    numbers = constant(pressure_min=1e6)
    assert input_fault(numbers, shown(1.0, 1.0, 0.0, 1.0, pressure_a=30.0)) == ''
    assert input_fault(numbers, shown(1.0, 1.0, -0.5, 1.0, pressure_a=30.0)) == ''
    assert input_fault(numbers, shown(1.0, 1.0, 0.9, 1.0, pressure_a=30.0))
