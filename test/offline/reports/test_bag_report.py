"""The page of a bag: self-contained, escaped, the same bytes each time, and quick for long bags."""

import dataclasses
import json
import math

import numpy as np
import pytest
from harness.closed_loop_bags import write_closed_loop
from harness.report_page import checked_page

from seal_friction_ros.core.estimation.configuration import SealSelection, first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.core.messages.coder import encode, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, FORCE_TYPE, PRESSURE_TYPE, VELOCITY_TYPE
from seal_friction_ros.core.messages.records import Force, Pressure, Velocity
from seal_friction_ros.files import load_configuration
from seal_friction_ros.offline.bags.bag import BagError, BagWriter, read_messages
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.replay.replay import replay
from seal_friction_ros.offline.reports.bag_evaluation import evaluate_run
from seal_friction_ros.offline.reports.bag_figures import run_figures
from seal_friction_ros.offline.reports.bag_report import write_report
from seal_friction_ros.offline.reports.figure_style import house_style, render, thinned
from seal_friction_ros.offline.reports.formatting import number

RATE = 100  # [Hz]
CONFIGURATION = load_configuration(SealSelection(), EstimatorSettings())


def make_bag(folder, *, name='bag', frame=b'rod', topic='/rod_velocity', pressures=(1e6, 4e6), configuration=None):
    """Two strokes at each pressure, with a lost velocity so that there is something to say."""
    snapshot = first_snapshot(CONFIGURATION)
    seals = CONFIGURATION.parameters().estimator.seals
    rows = []
    for pressure in pressures:
        friction = actuator_friction(seals, pressure, pressure)
        for side in (1, -1):
            static = friction.coulomb_friction + friction.stiction
            rows += [(0.0, pressure, side * static * (k + 1) / 40) for k in range(40)]
            rows += [(side * 0.02, pressure, 1.1 * side * friction.coulomb_friction + 2.0)] * 60
    rows[70] = (math.nan, *rows[70][1:])
    with BagWriter(folder / f'{name}_in') as writer:
        text = encode_text(snapshot_text(snapshot) if configuration is None else configuration)
        if configuration is None:
            writer.write('/friction_estimator/configuration', CONFIGURATION_TYPE, 1, text)
        for i, (velocity, pressure, force) in enumerate(rows):
            stamp = (i + 1) * 1_000_000_000 // RATE
            data = encode(Pressure(stamp, pressure, pressure))
            writer.write('/cylinder_pressure', PRESSURE_TYPE, stamp, data)
            writer.write('/force_sum', FORCE_TYPE, stamp, encode(Force(stamp, force)))
            data = encode(Velocity(stamp, velocity, frame))
            writer.write(topic, VELOCITY_TYPE, stamp, data)
    replay(folder / f'{name}_in', out=folder / name)
    return folder / name


@pytest.mark.renders
def test_the_page_stands_alone_and_each_figure_lies_beside_it(tmp_path):
    summary = write_report(make_bag(tmp_path), tmp_path / 'out' / 'report.html')
    page = checked_page(summary.page)
    assert page.figures == [
        'live_estimate', 'friction_over_pressure', 'deviation', 'friction_over_velocity', 'inputs', 'status',
    ]  # fmt: skip
    assert {path.stem for path in summary.figures} == set(page.figures)
    assert {path.parent for path in summary.figures} == {tmp_path / 'out' / 'report_figures'}
    assert 'http' not in page.prose


def test_the_page_shows_the_numbers_the_seal_and_the_settings(tmp_path):
    summary = write_report(make_bag(tmp_path), tmp_path / 'report.html')
    page = checked_page(summary.page)
    levels = summary.numbers['friction']['sliding']
    sliding, breakaway = (table for table in page.tables if table[0][0] == 'pressure [bar]')
    assert [row[1] for row in sliding[1:]] == [number(level['measured']) for level in levels]
    assert [row[6] for row in sliding[1:]] == [number(-9.1, 1, signed=True)] * 2
    assert [row[7] for row in breakaway[1:]] == ['2 of 2 starts'] * 2
    for level in levels:
        assert level['deviation_percent'] == pytest.approx(-9.09, abs=0.01)  # the rig has 1.1 times the friction
        assert level['offset'] == pytest.approx(2.0)
    assert page.tiles['mean absolute deviation over the pressures'] == '9.1 %'
    assert page.tiles['measured strokes in the 95 % band'] == '4 of 4'
    bits = {row['status bit']: (row['estimates'], row['share [%]']) for row in page.table('status bit')}
    assert bits == {'velocity not finite': ('1', '0.25'), 'motion uncertain': ('4', '1.00')}
    assert '/force_sum' in [row['topic'] for row in page.table('topic')]
    assert page.table('seal') == [{'seal': 'placeholder', 'chamber': chamber} for chamber in 'ab']
    (stick_velocity,) = (row for row in page.table('setting') if row['setting'] == 'stick_velocity')
    assert (stick_velocity['value'], stick_velocity['unit']) == ('0.001', 'm/s')
    assert 'area_deformation_gain' in page.texts['pre'][0]
    json.dumps(summary._asdict(), default=str, allow_nan=False)


@pytest.mark.renders
@pytest.mark.long
def test_the_same_bag_gives_the_same_bytes(tmp_path):
    bag = make_bag(tmp_path)
    first = write_report(bag, tmp_path / 'a' / 'report.html')
    second = write_report(bag, tmp_path / 'b' / 'report.html')
    for one, other in zip((first.page, *first.figures), (second.page, *second.figures), strict=True):
        assert one.read_bytes() == other.read_bytes(), one.name


def test_what_comes_from_a_bag_is_escaped(tmp_path):
    evil = '<script>alert(1)</script>"&\''
    bag = make_bag(tmp_path, frame=evil.encode(), topic=f'/{evil}', name='<b>bag$x$')
    page = checked_page(write_report(bag, tmp_path / 'report.html').page)
    assert page.texts['h1'] == ['Seal friction: <b>bag$x$']
    assert f'/{evil}' in [row['topic'] for row in page.table('topic')]
    assert f'Frame of the velocity samples: {evil}' in page.texts['p']


@pytest.fixture(scope='module')
def closed_loop(tmp_path_factory):
    return write_closed_loop(tmp_path_factory.mktemp('bag') / 'closed_loop', seconds=1.5)


@pytest.mark.long  # `test_tracking_evaluation` has the numbers
@pytest.mark.renders
def test_a_closed_loop_is_shown_with_its_numbers(closed_loop, tmp_path):
    summary = write_report(closed_loop, tmp_path / 'report.html')
    page = checked_page(summary.page)
    without, compensated = summary.numbers['tracking']
    assert 'Tracking' in page.texts['h2']
    assert {'tracking', 'friction_and_feedforward'} <= set(page.figures)
    rows = page.table('stretch')
    for stretch, row in zip((without, compensated), rows, strict=True):
        assert row['RMS error [µm]'] == number(stretch['rms'] * 1e6, 1)
        assert row['dwell [ms]'] == number(stretch['dwell'] * 1e3, 1)
    assert number(compensated['rms_change'], 1, signed=True) in page.tables[0][2]
    assert compensated['rms_change'] < -60.0
    assert (without['settings']['scale'], compensated['settings']['scale']) == (0.0, 0.9)


def test_without_a_reference_there_is_no_tracking(tmp_path):
    summary = write_report(make_bag(tmp_path), tmp_path / 'report.html')
    assert 'racking' not in summary.page.read_text()
    assert summary.numbers['tracking'] == []


def test_a_loop_that_was_never_changed_is_shown_alone(tmp_path):
    bag = write_closed_loop(tmp_path / 'bag', scales=(0.9,), seconds=1.2)
    summary = write_report(bag, tmp_path / 'report.html')
    (stretch,) = summary.numbers['tracking']
    assert stretch['rms_change'] is None
    assert 'no stretch without feed-forward' in summary.page.read_text()
    assert 'tracking' in {path.stem for path in summary.figures}


def test_a_loop_that_is_too_short_is_said(tmp_path):
    bag = write_closed_loop(tmp_path / 'bag', seconds=0.3)
    summary = write_report(bag, tmp_path / 'report.html')
    assert summary.numbers['tracking'] == []
    assert 'too short' in summary.page.read_text()


def test_a_configuration_that_is_missing_or_not_understood_is_said_or_shown_as_text(tmp_path):
    with BagWriter(tmp_path / 'bare') as writer:
        for message in read_messages(make_bag(tmp_path)):
            if message.type_name != CONFIGURATION_TYPE:
                writer.write(*message)
    bag = tmp_path / 'bare'
    assert 'holds no configuration' in write_report(bag, tmp_path / 'none.html').page.read_text()
    with BagWriter(tmp_path / 'other') as writer:
        writer.write('/configuration', CONFIGURATION_TYPE, 0, encode_text('<b>{"version": 99}'))
        for message in read_messages(bag):
            writer.write(*message)
    page = checked_page(write_report(tmp_path / 'other', tmp_path / 'other.html').page)
    assert page.texts['pre'] == ['<b>{"version": 99}']


def test_nothing_is_written_for_a_bag_without_estimates(tmp_path):
    make_bag(tmp_path)
    with pytest.raises(BagError, match='replay'):
        write_report(tmp_path / 'bag_in', tmp_path / 'out' / 'report.html')
    assert not (tmp_path / 'out').exists()


def test_a_bag_in_which_nothing_slides_makes_a_page(tmp_path):
    with BagWriter(tmp_path / 'still_in') as writer:
        data = encode(Velocity(1, 0.0, b''))
        writer.write('/rod_velocity', VELOCITY_TYPE, 1, data)
    replay(tmp_path / 'still_in', out=tmp_path / 'still')
    summary = write_report(tmp_path / 'still', tmp_path / 'still.html')
    assert 'No steady sliding' in summary.page.read_text()
    assert summary.numbers['friction']['sliding'] == []


def test_thinning_keeps_the_ends_and_every_spike():
    values = np.zeros(1_000_000)
    values[[123_456, 777_777]] = 5.0, -7.0
    values[400_000:500_000] = np.nan
    kept = thinned(values)
    assert len(kept) < 4000
    assert kept[0] == 0
    assert kept[-1] == len(values) - 1
    assert {123_456, 777_777} <= set(kept.tolist())
    assert list(kept) == sorted(kept)


@pytest.mark.renders
@pytest.mark.long  # makes a long bag
def test_figures_of_a_long_bag_stay_small(tmp_path):
    short = read_run(make_bag(tmp_path))
    times = 250  # 100 000 estimates
    step = short.time[-1] + 1.0 / RATE
    tiled = {
        field.name: np.tile(getattr(short, field.name), times)
        for field in dataclasses.fields(short)
        if isinstance(getattr(short, field.name), np.ndarray)
    }
    tiled['time'] += np.repeat(np.arange(times) * step, len(short.time))
    run = dataclasses.replace(short, **tiled)
    evaluation = evaluate_run(run)
    with house_style():
        figures = [plot.figure for plot in run_figures(run, evaluation)]
        sizes = [len(render(figure)['svg']) for figure in figures]
    assert sum(sizes) < 5_000_000
    lines = [line for figure in figures for ax in figure.axes for line in ax.lines]
    assert max(len(line.get_xdata()) for line in lines) < 5000
    assert len(evaluation.friction.sliding[0].events) == 2 * times
