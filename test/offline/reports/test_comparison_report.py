"""A page of two runs or two seals says what has changed, and how large the noise is."""

from pathlib import Path

import pytest
from harness.report_page import checked_page
from paths import ROOT

from seal_friction_ros.core.estimation.findings import GOOD, LOOK
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.reports.comparison_report import common_changes, mean_change, write_comparison

PULL_TEST = ROOT / 'bags' / 'pull_test'


def test_a_run_has_not_changed_against_itself(tmp_path: Path):
    report = write_comparison(PULL_TEST, PULL_TEST, tmp_path / 'page.html')
    assert report.numbers['level'] == GOOD
    assert [one['change'] for one in report.numbers['sliding']] == pytest.approx([0.0] * 3)
    page = checked_page(report.page)
    assert page.figures == ['friction_over_pressure', 'force_over_velocity']
    assert page.texts['p.said'][0].startswith('Good: No change beyond the noise')


def test_charts_of_the_prior_art_are_above_the_law_of_the_tests(tmp_path: Path, capsys):
    page = tmp_path / 'page.html'
    assert main(['compare', 'ms28775_114', 'ms28775_114_prior_art', '--out', str(page)]) == 0
    assert 'from ms28775_114 to ms28775_114_prior_art' in capsys.readouterr().out
    rows = checked_page(page).table('pressure [bar]')
    assert len(rows) == 11
    assert all(row['change [%]'].startswith('+') for row in rows)


def test_pressures_that_only_one_run_has_are_not_compared(tmp_path: Path):
    found = write_comparison(PULL_TEST, PULL_TEST, tmp_path / 'page.html')
    assert found.numbers['level'] in (GOOD, LOOK)
    assert common_changes([], []) == []
    assert mean_change('friction', []) is None


def test_a_bag_and_a_seal_or_a_tolerance_with_a_page_are_refused(tmp_path: Path, capsys):
    out = ['--out', str(tmp_path / 'page.html')]
    assert main(['compare', str(PULL_TEST), 'ms28775_114', *out]) == 2
    assert 'give two of a kind' in capsys.readouterr().err
    assert main(['compare', str(PULL_TEST), str(PULL_TEST), '--rtol', '0.1', *out]) == 2
    assert '--rtol is only for messages of equal stamp' in capsys.readouterr().err
