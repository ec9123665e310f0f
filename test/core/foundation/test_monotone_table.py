"""The table evaluates as scipy's interpolator does, and keeps to its points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from seal_friction_ros.core.foundation.monotone_table import MonotoneTable

hundredths = st.integers(-5000, 5000).map(lambda n: n / 100.0)  # as measured: no differences of 1e-300
steps = st.lists(st.tuples(st.floats(0.01, 100.0), hundredths), min_size=1, max_size=8)
shares = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=10)


def points(increments):
    x, y = np.cumsum([(0.0, 0.0), *increments], axis=0).T
    return [float(v) for v in x], [float(v) for v in y]


@given(steps, shares)
def test_it_is_scipys_pchip_between_the_points(increments, where):
    x, y = points(increments)
    table, reference = MonotoneTable(x, y, 'test'), PchipInterpolator(x, y)
    for share in where:
        at = x[0] + share * (x[-1] - x[0])
        assert table(at) == pytest.approx(float(reference(at)), rel=1e-9, abs=1e-9 * (1.0 + max(map(abs, y))))


@given(steps)
def test_it_goes_through_every_point(increments):
    x, y = points(increments)
    table = MonotoneTable(x, y, 'test')
    assert [table(at) for at in x] == pytest.approx(y, rel=1e-12, abs=1e-9)


@given(steps, st.floats(0.0, 1e300))
def test_it_is_constant_beyond_both_ends(increments, beyond):
    x, y = points(increments)
    table = MonotoneTable(x, y, 'test')
    assert table(x[0] - beyond) == y[0]
    assert table(x[-1] + beyond) == y[-1]


@given(steps, shares)
def test_it_does_not_leave_the_two_points_around(increments, where):
    x, y = points(increments)
    table = MonotoneTable(x, y, 'test')
    for share in where:
        at = x[0] + share * (x[-1] - x[0])
        i = min(int(np.searchsorted(x, at, side='right')), len(x) - 1)
        low, high = sorted((y[i - 1], y[i]))
        assert low - 1e-9 <= table(at) <= high + 1e-9


def test_the_end_slope_is_the_derivative_at_the_last_point():
    x, y = [0.0, 1.0, 3.0], [1.0, 2.0, 7.0]
    table = MonotoneTable(x, y, 'test')
    assert table.end_slope == pytest.approx((table(3.0) - table(3.0 - 1e-7)) / 1e-7, rel=1e-5)
    assert table.end_slope > 0.0


@pytest.mark.parametrize(
    ('x', 'y', 'complaint'),
    [
        ([], [], 'at least two points'),
        ([1.0], [1.0], 'at least two points'),
        ([1.0, 2.0], [1.0], 'as many ordinates, got 2 and 1'),
        ([1.0, 1.0], [1.0, 2.0], 'do not increase'),
        ([2.0, 1.0], [1.0, 2.0], 'do not increase'),
        ([1.0, 2.0, 2.0], [1.0, 2.0, 3.0], 'do not increase'),
        ([1.0, float('nan')], [1.0, 2.0], 'not every point is finite'),
        ([1.0, 2.0], [1.0, float('inf')], 'not every point is finite'),
        ([0.0, 1e-200, 1.0], [0.0, 1e-5, 2e-5], 'points too close together or too far apart'),
        ([0.0, 5e-324, 1.0], [0.0, 1.0, 2.0], 'points too close together or too far apart'),
    ],
)
def test_points_that_make_no_table_are_refused_by_name(x, y, complaint):
    with pytest.raises(ValueError, match=f'^friction chart: .*{complaint}'):
        MonotoneTable(x, y, 'friction chart')
