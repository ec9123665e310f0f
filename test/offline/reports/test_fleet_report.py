"""The page of a fleet: verdict first, the worst first, sortable, linked; what is hostile in it stays text."""

import math
from pathlib import Path

import numpy as np
import pytest
from harness.browser import chromium
from harness.page_in_browser import opened
from harness.report_page import checked_page

from seal_friction_ros.core.estimation.findings import BAD, GOOD, LOOK
from seal_friction_ros.offline.replay.bag_summary import DIFFERENT, IDENTICAL, LEVEL_COLUMNS, BagSummary
from seal_friction_ros.offline.reports.fleet_report import judged, write_fleet_report
from seal_friction_ros.offline.work.outcome import Outcome

HOUR = 3600.0  # [s]
CALM = BagSummary(
    1.7e9, 100.0, 300_000, IDENTICAL, '', 40, 1.0, 0.02, 0.0, 0.02, 1.0, 0.05, 0.0, GOOD, '20 of 20 strokes',
    'nothing', '', np.zeros((0, len(LEVEL_COLUMNS))),
)  # fmt: skip


def bag(name: str, error: str = '', **changes):
    return judged(Path(name), Outcome(None, error) if error else Outcome(CALM._replace(**changes)))


@pytest.mark.parametrize(
    ('changes', 'level', 'why'),
    [
        ({}, GOOD, '20 of 20 strokes'),
        ({'replay': DIFFERENT, 'difference': 'estimate 3'}, BAD, 'replay differs: estimate 3'),
        ({'level': BAD, 'why': 'too much'}, BAD, 'too much'),
        ({'level': LOOK, 'why': 'it drifts'}, LOOK, 'it drifts'),
        ({'level': BAD, 'why': 'too much', 'replay': DIFFERENT, 'health': 'other type'}, BAD, 'too much'),
        ({'error': 'a/bag: no end'}, BAD, 'damaged: no end'),
        ({'health': 'a/bag: other type'}, LOOK, 'health not told: other type'),
    ],
)
def test_a_bag_is_judged_with_its_reason(changes, level, why):
    found = bag('a/bag', **changes)
    assert (found.level, found.why) == (level, why)


def test_the_page_names_the_worst_and_links_the_pages_there_are(tmp_path):
    folder = tmp_path / 'rig <1> & "2"'
    folder.mkdir()
    (folder / 'good #1.html').write_text('a page')
    bags = [
        bag(f'{folder}/good #1'),
        bag(f'{folder}/<script>alert(1)</script>', 'x: \x1b[2Jdamaged'),
        bag(f'{folder}/\udcff', level=LOOK),
    ]
    report = write_fleet_report(bags, folder, tmp_path / 'fleet.html')
    page = checked_page(report.page)
    assert page.texts['p.said'][0].startswith('Bad: 1 of 3 bags is bad, 1 damaged; 1 to look at.')
    assert [row['verdict'] for row in page.table('bag')] == [BAD, LOOK, GOOD]
    html = report.page.read_text()
    assert '<script>alert' not in html
    assert html.count('<a href') == 1
    assert '<a href="rig%20%3C1%3E%20%26%20%222%22/good%20%231.html">' in html


@pytest.mark.parametrize(
    ('reasons', 'said'),
    [
        ([None], 'Good: The bag is good.'),
        (['x: damaged'], 'Bad: 1 of 1 bag is bad, 1 damaged; 0 to look at.'),
        (['x: damaged', 'x: damaged'], 'Bad: 2 of 2 bags are bad, 2 damaged; 0 to look at.'),
    ],
)
def test_one_bag_is_one_and_several_are_several(reasons, said, tmp_path):
    bags = [bag(f'rig/{number}', *([reason] if reason else [])) for number, reason in enumerate(reasons)]
    page = checked_page(write_fleet_report(bags, Path('rig'), tmp_path / 'fleet.html').page)
    assert page.texts['p.said'][0].startswith(said)


def test_a_good_fleet_is_good_and_its_page_the_same_bytes_again(tmp_path):
    bags = [bag(f'rig/{number}', start=1.7e9 + HOUR * number) for number in range(3)]
    pages = [write_fleet_report(bags, Path('rig'), tmp_path / name / 'fleet.html').page for name in ('a', 'b')]
    assert checked_page(pages[0]).texts['p.said'] == ['Good: All 3 bags are good.']
    assert pages[0].read_bytes() == pages[1].read_bytes()


def test_the_trend_of_a_rig_is_over_its_bags_and_not_over_those_of_others(tmp_path):
    worn = [bag(f'worn/{i}', start=1.7e9 + HOUR * i, scale=1.0 + 0.01 * i) for i in range(5)]
    calm = [bag(f'calm/{i}', start=1.7e9 + HOUR * i) for i in range(5)]
    undated = [bag(f'undated/{i}', start=HOUR * i, scale=1.0 - 0.1 * i) for i in range(5)]
    found = write_fleet_report([*worn, *calm, *undated], Path(), tmp_path / 'f.html').numbers['rigs']
    rigs = {rig['name']: rig for rig in found}
    assert rigs['worn']['trend'] == pytest.approx(24.0 * 0.01)
    assert math.isnan(rigs['calm']['trend'])  # its deviation is above itself
    assert math.isnan(rigs['undated']['trend'])


def test_a_rig_that_changes_is_named_first_with_its_date_whatever_else_is_damaged(tmp_path):
    day = 24.0 * HOUR
    up = [bag(f'rig07/{i}', start=1.7e9 + day * i, scale=1.45 if i >= 12 else 1.0) for i in range(20)]
    calm = [bag(f'rig{rig:02}/{i}', start=1.7e9 + day * i) for rig in range(5) for i in range(20)]
    report = write_fleet_report([bag('rig00/broken', 'x: no end'), *calm, *up], Path(), tmp_path / 'fleet.html')
    assert report.numbers['rigs'][0]['name'] == 'rig07'
    page = checked_page(report.page)
    assert page.texts['p.said'][0].endswith('1 damaged; 0 to look at. rig07: friction +45% since 2023-11-26.')
    assert [row['change'] for row in page.table('rig')][:2] == ['+45%', 'not told']


@pytest.mark.skipif(not chromium(), reason='no browser')
def test_a_head_sorts_by_number_and_what_is_not_told_comes_last(tmp_path):
    scales = {'a': 1.25, 'b': math.nan, 'c': 0.9, 'd': 10.5}
    bags = [bag(name, scale=scale) for name, scale in scales.items()]
    page = write_fleet_report(bags, Path(), tmp_path / 'fleet.html').page
    for width in (1400, 420):
        tab = opened(page, width)
        names = (
            "[...document.querySelector('.filtered').tBodies[0].rows].map((row) => row.cells[0].textContent).join('')"
        )
        head = "[...document.querySelectorAll('.filtered th button')].find((b) => b.textContent === 'friction / file')"
        assert tab.value(names) == 'abcd'
        tab.value(f'{head}.click()')
        assert tab.value(names) == 'cadb'
        assert tab.value(f"{head}.parentElement.getAttribute('aria-sort')") == 'ascending'
        tab.value(f'{head}.click()')
        assert tab.value(names) == 'dacb'
        field = "document.querySelector('.filter')"
        tab.value(f"{field}.value = 'good'; {field}.dispatchEvent(new Event('input'))")
        tab.value(f"{field}.value = 'no such bag'; {field}.dispatchEvent(new Event('input'))")
        assert tab.value("document.querySelectorAll('.filtered tbody tr:not([hidden])').length") == 0
        assert not tab.complaints
