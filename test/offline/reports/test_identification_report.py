"""The page of an identification: every figure that the data allow, said where not, the same bytes each time."""

import itertools

import numpy as np
import pytest
from harness.identify_run import THESIS, few_of_the_thesis
from harness.report_page import checked_page

from seal_friction_ros.offline.bags.import_log import Samples, write_samples
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.identification.pipeline import IdentifyOptions, identify
from seal_friction_ros.offline.identification.results import identification_numbers
from seal_friction_ros.offline.reports.figure_style import house_style, render
from seal_friction_ros.offline.reports.identification_report import (
    ONE_RUN,
    calibration_figure,
    ladder_figure,
    write_identification_report,
)

ALL = {'fig24_model_over_pressure', 'measured_against_model', 'calibration', 'residuals', 'ladder',
       'fig16_static_and_dynamic', 'fig17_prior_art_and_tests', 'fig18_coefficient_of_friction',
       'fig19_normal_force'}  # fmt: skip


@pytest.fixture(scope='module')
def thesis(tmp_path_factory):
    folder = tmp_path_factory.mktemp('thesis')
    page = folder / 'page.html'
    arguments = ['identify', str(THESIS), '--seal', 'ms28775_114', '--seal-chambers', 'a,b']
    assert main([*arguments, '--law', 'physics_based', '--out', str(folder / 's.yaml'), '--report', str(page)]) == 0
    return page


@pytest.mark.long  # renders every figure
def test_the_thesis_has_every_figure_as_png_and_svg_and_in_the_page(thesis):
    assert set(checked_page(thesis).figures) == ALL


def test_the_page_tells_the_check_values_of_the_thesis(thesis):
    page = checked_page(thesis)
    ladder = {row['law']: row for row in page.table('law')}
    assert 'no law: mean of the other readings at the same pressure' in ladder
    marks = [mark for row in ladder.values() for mark in row[''].split(', ') if mark]
    assert sorted(marks) == ['recommended', 'saved']
    assert page.tiles['law'] == 'physics_based'
    assert page.tiles['identified pressure'] == '0 to 68.9 bar'
    assert [row['readings'] for row in page.table('pressure [bar]')] == ['6'] * 11
    assert any(text.startswith('Condition number') for text in page.texts['p'])
    assert 'http' not in page.prose


def test_without_geometry_or_starts_the_page_says_which_figures_are_missing(tmp_path):
    dynamic_only = tmp_path / 'dynamic.csv'
    lines = few_of_the_thesis(tmp_path).read_text().splitlines()
    dynamic_only.write_text('\n'.join([lines[0], *(line for line in lines if ',dynamic,' in line)]))
    found = identify([dynamic_only], IdentifyOptions(), 'bare')
    write_identification_report(found, tmp_path / 'page.html')
    text = checked_page(tmp_path / 'page.html').prose
    assert 'Figures 18 and 19 need the geometry of the ring' in text
    assert 'Figure 16 (static friction) needs starts from rest' in text
    assert 'Figure 17 (prior art) needs charts' in text


@pytest.mark.renders
@pytest.mark.long
def test_the_same_sources_give_the_same_page(tmp_path):
    pages = []
    for name in ('one', 'two'):
        found = identify([few_of_the_thesis(tmp_path)], IdentifyOptions(seal='ms28775_114'), 'same')
        folder = tmp_path / name
        folder.mkdir()
        figures = write_identification_report(found, folder / 'page.html')
        pages.append([path.read_bytes() for path in (folder / 'page.html', *sorted(figures))])
    assert pages[0] == pages[1]


def test_what_a_file_name_says_is_escaped(tmp_path):
    evil = tmp_path / '<script>x.csv'
    evil.write_text(few_of_the_thesis(tmp_path).read_text())
    found = identify([evil], IdentifyOptions(), 'same')
    write_identification_report(found, tmp_path / 'page.html')
    page = checked_page(tmp_path / 'page.html')
    assert [row['source'] for row in page.table('source')] == ['<script>x.csv']


def swept() -> Samples:
    """A rod that goes to and fro under a sine, at a slowly changing pressure, with friction that follows both."""
    time = np.arange(6000) / 50.0
    velocity = 0.1 * np.sin(0.4 * time)
    pressure = 3e6 + 2e6 * np.sin(0.11 * time)
    noise = np.random.default_rng(1).normal(size=6000)
    force = np.sign(velocity) * (50.0 + 2e-5 * pressure + 300.0 * np.abs(velocity)) + 5.0 * noise
    return Samples(1_000_000_000 + (time * 1e9).astype(np.int64), pressure, np.zeros(6000), force, velocity)


@pytest.mark.long  # identifies a swept log
def test_a_swept_log_shows_friction_over_velocity(tmp_path):
    write_samples(tmp_path / 'bag', swept(), 'rod')
    found = identify([tmp_path / 'bag'], IdentifyOptions(), 'swept')
    assert found.data.used.left_out_by == 'block'
    figures = write_identification_report(found, tmp_path / 'page.html')
    assert 'friction_over_velocity.svg' in {path.name for path in figures}
    assert (tmp_path / 'page.html').stat().st_size < 3_000_000
    with house_style():
        _, between = calibration_figure(found).figure.axes
    assert ONE_RUN in {text.get_text() for text in between.texts}
    numbers = identification_numbers(found)['calibration']
    assert set(numbers) == {'nominal', 'within_runs', 'between_runs'}
    assert set(numbers['between_runs']) == {None}
    assert all(0.0 <= share <= 1.0 for share in numbers['within_runs'])


@pytest.mark.renders
@pytest.mark.long  # draws every length of the ladder
def test_labels_of_the_ladder_neither_overlap_nor_leave_the_figure(tmp_path):
    write_samples(tmp_path / 'bag', swept(), 'rod')
    found = identify([tmp_path / 'bag'], IdentifyOptions(), 'swept')
    with house_style():
        figure = ladder_figure(found).figure
        render(figure)
        figure.draw_without_rendering()
        labels = figure.axes[0].get_yticklabels()
        boxes = sorted((label.get_window_extent() for label in labels), key=lambda box: -box.y1)
    assert len(boxes) >= 9
    assert min(box.x0 for box in boxes) >= 0.0
    assert all(upper.y0 > lower.y1 for upper, lower in itertools.pairwise(boxes))


def test_nothing_is_left_of_a_report_that_cannot_be_written(tmp_path, capsys):
    blocked = tmp_path / 'file'
    blocked.write_text('')
    few = str(few_of_the_thesis(tmp_path))
    arguments = ['identify', few, '--out', str(tmp_path / 's.yaml'), '--report', str(blocked / 'page.html')]
    assert main(arguments) == 2
    assert not (tmp_path / 's.yaml').exists()
    assert 'cannot write' in capsys.readouterr().err


def test_the_law_of_all_terms_has_a_page_with_the_correlations_of_its_parameters(tmp_path):
    few, out = str(few_of_the_thesis(tmp_path)), tmp_path / 'page.html'
    assert main(['identify', few, '--law', 'all_terms', '--out', str(tmp_path / 's.yaml'), '--report', str(out)]) == 0
    rows = checked_page(out).table('correlation')
    assert [row['correlation'] for row in rows][:2] == ['friction_at_no_pressure', 'friction_at_one_bar']
    assert all(float(row[row['correlation']]) == 1.0 for row in rows)
