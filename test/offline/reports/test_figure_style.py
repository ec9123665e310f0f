"""What a figure shows of a recording: faults leave the axis and are counted, gaps stay gaps, curves go to the page."""

import base64

import numpy as np
import pytest

from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.plot_data import plot_data

TIME = np.arange(1000) * 1e-3  # [s]


def drawn():
    with style.house_style():
        figure, ax = style.new_figure('title', 3.0)
    return figure, ax


def items(figure) -> list[dict]:
    figure.draw_without_rendering()
    data = plot_data(figure)
    assert data is not None
    arrays = [np.frombuffer(base64.b64decode(text), '<f4') for text in data['arrays']]
    (panel,) = data['panels']
    return [
        {**item, **{k: arrays[item[k]] for k in ('xs', 'ys', 'left', 'right') if k in item}} for item in panel['items']
    ]


def test_one_bad_sample_leaves_the_axis_and_is_marked_at_its_edge_with_the_count():
    figure, ax = drawn()
    force = np.sin(TIME)
    force[500] = 1e9
    usable = np.ones(len(TIME), dtype=bool)
    usable[500] = False
    style.fit_axis(ax, TIME, usable, force)
    low, high = ax.get_ylim()
    assert -0.1 < low < 0.0
    assert 0.8 < high < 1.0
    (mark,) = items(figure)
    assert mark['name'] == '1 beyond, such as 1e+09'
    assert mark['xs'].tolist() == pytest.approx([0.5])
    assert mark['ys'].tolist() == pytest.approx([high])


def test_an_axis_without_a_usable_sample_fits_all_of_them():
    values = np.array([1.0, np.nan, 3.0])
    assert style.usable_range(np.zeros(3, dtype=bool), values) == (1.0, 3.0)
    assert style.usable_range(np.ones(3, dtype=bool), np.full(3, np.nan)) == (0.0, 1.0)


@pytest.mark.parametrize('missing', ['samples', 'values'])
def test_a_curve_has_a_gap_where_data_stop_and_none_where_one_sample_is_missing(missing: str):
    figure, ax = drawn()
    lost = ((TIME >= 0.3) & (TIME < 0.6)) | (np.arange(1000) == 100)
    values = np.where(lost, np.nan, 1.0)
    kept = ~lost if missing == 'samples' else np.ones_like(lost)
    style.thin_line(ax, TIME[kept], values[kept])
    (curve,) = items(figure)
    (gap,) = np.flatnonzero(np.isnan(curve['ys']))
    assert curve['xs'][gap - 1] == pytest.approx(0.299, abs=1e-6)
    assert curve['xs'][gap + 1] == pytest.approx(0.6, abs=1e-6)


def test_a_long_curve_says_what_time_its_lowest_and_highest_values_stand_for():
    figure, ax = drawn()
    time = np.arange(100_000) * 1e-3
    style.thin_line(ax, time, np.sin(1e3 * time))
    figure.draw_without_rendering()
    (panel,) = plot_data(figure)['panels']
    assert panel['resolution'] == pytest.approx(100.0 / style.DETAIL, rel=1e-3)


def test_a_figure_that_is_no_curve_over_x_is_its_picture():
    figure, ax = drawn()
    ax.plot(np.cos(6.0 * TIME), np.sin(6.0 * TIME))  # a loop
    figure.draw_without_rendering()
    assert plot_data(figure) is None


def test_bands_boxes_dots_and_lines_across_reach_the_page():
    figure, ax = drawn()
    style.fill_band(ax, TIME, TIME, 0.1 + TIME, label='band')
    style.shade(ax, TIME, (TIME > 0.2) & (TIME < 0.4), 'shaded')
    ax.plot([0.5, 0.1], [1.0, 2.0], 'o', label='dots')
    style.zero_lines(ax)
    found = {item['kind']: item for item in items(figure)}
    assert set(found) == {'band', 'boxes', 'curve', 'across'}
    assert found['band']['name'] == 'band'
    assert found['boxes']['left'].tolist() == pytest.approx([0.201], abs=1e-6)
    assert found['curve']['xs'].tolist() == pytest.approx([0.1, 0.5])  # in the order of x
    assert (found['across']['axis'], found['across']['at']) == ('y', 0.0)
