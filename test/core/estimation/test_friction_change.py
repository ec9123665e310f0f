"""When a cumulative sum over the reversals says that the friction has changed, and since when."""

from itertools import chain
from statistics import fmean, pvariance

import pytest

from seal_friction_ros.core.estimation.friction_change import FrictionChange, watch
from seal_friction_ros.core.messages.records import NEVER

# Numbers of the module docstring, repeated here so that a change is noticed.
REFERENCE_REVERSALS = 20
LEAST_STD = 0.02  # [-]
ALLOWANCE, THRESHOLD, LARGEST_TERM = 0.5, 12.0, 3.0  # standard deviations

NOTHING = FrictionChange()
EVEN = FrictionChange(20, 1.0, 19 * 0.25, rise_began=19, fall_began=19)
"""After a reference with mean 1 and standard deviation 0.5."""


def watched(ratios, known=NOTHING) -> list[FrictionChange]:
    """What is known after each ratio; the stamps are 0, 1, 2, ... from the beginning of the reference."""
    found = []
    for number, ratio in enumerate(ratios, start=known.reversals):
        known = watch(known, number, ratio)
        found.append(known)
    return found


def first_change(later: float, reference=(1.0,) * REFERENCE_REVERSALS) -> int | None:
    """How many reversals with the ratio ``later`` it takes until a change is found; None: not within a hundred."""
    found = watched(chain(reference, [later] * 100))[len(reference) :]
    return next((number for number, known in enumerate(found, start=1) if known.changes), None)


def test_mean_and_scatter_of_the_first_20_reversals_are_the_reference():
    ratios = [1.0 + 0.01 * ((7 * number) % 11) for number in range(REFERENCE_REVERSALS)]
    found = watched([*ratios, 1.05])
    assert found[19].reference == found[20].reference == pytest.approx(fmean(ratios))
    assert found[19].squares == found[20].squares == pytest.approx(20 * pvariance(ratios))
    assert [known.reversals for known in found] == list(range(1, 22))
    assert [(known.rise, known.fall) for known in found[:20]] == [(0.0, 0.0)] * 20


def test_a_term_is_the_distance_in_standard_deviations_of_the_sample_less_half_of_one():
    (up,) = watched([1.75], EVEN)  # 1.5 standard deviations
    assert (up.rise, up.fall) == (1.5 - ALLOWANCE, 0.0)
    (down,) = watched([0.25], EVEN._replace(rise=3.0, fall=2.0))
    assert (down.rise, down.fall) == (3.0 - 1.5 - ALLOWANCE, 2.0 + 1.5 - ALLOWANCE)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_one_reversal_counts_as_three_standard_deviations_at_most(side):
    (known,) = watched([1.0 + side * 100.0], EVEN)
    assert (known.rise, known.fall) == ((2.5, 0.0) if side > 0.0 else (0.0, 2.5))
    assert first_change(1.0 + side * 100.0) == 5  # 5 * 2.5 is above 12


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_reference_without_scatter_has_a_standard_deviation_of_2_percent(side):
    assert first_change(1.0 + side * 0.45 * LEAST_STD) is None
    assert first_change(1.0 + side * 1.02 * LEAST_STD) == 24  # 23 * 0.52 is not above 12
    assert first_change(1.0 + side * 2.02 * LEAST_STD) == 8


def test_a_wider_scatter_of_the_reference_needs_a_larger_change():
    reference = [0.9, 1.1] * 10  # standard deviation 0.1026
    assert first_change(1.04, reference) is None
    assert first_change(1.29, reference) == 6  # 6 * (2.827 - 0.5) is above 12


@pytest.mark.parametrize('name', ['rise', 'fall'])
@pytest.mark.parametrize(('before', 'changes'), [(11.0, 0), (11.001, 1)])
def test_a_change_is_a_sum_above_12_and_not_12_itself(name, before, changes):
    ratio = 1.75 if name == 'rise' else 0.25
    (known,) = watched([ratio], EVEN._replace(**{name: before}))
    assert known.changes == changes


@pytest.mark.parametrize('later', [1.5, 0.5])
def test_a_change_began_when_its_sum_was_last_0(later):
    ratios = [1.0] * 20 + [1.0] * 7 + [later] * 5  # the last reversal before it has the stamp 26
    found = watched(ratios)
    assert [known.changes for known in found] == [0] * 31 + [1]
    assert found[-1].changed_at == 26
    assert found[-1].before == pytest.approx(1.0)


def test_of_two_sums_the_one_that_is_above_the_threshold_tells_when_the_change_began():
    both = EVEN._replace(rise_began=3, fall_began=7)
    (up,) = watched([9.0], both._replace(rise=11.0, fall=11.0))
    (down,) = watched([-9.0], both._replace(rise=11.0, fall=11.0))
    assert (up.changed_at, down.changed_at) == (3, 7)


def test_after_a_change_a_new_reference_begins_and_the_number_of_changes_stays():
    (known,) = watched([9.0], EVEN._replace(rise=11.0, changes=4))
    assert known == FrictionChange(changes=5, changed_at=19, before=1.0)
    again = watched([2.0] * 20, known)[-1]
    assert (again.reversals, again.reference, again.changes, again.changed_at) == (20, 2.0, 5, 19)


def test_before_the_first_reversal_nothing_is_known():
    assert FrictionChange() == (0, 0.0, 0.0, 0.0, 0.0, NEVER, NEVER, 0, NEVER, 0.0)
