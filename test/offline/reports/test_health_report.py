"""The page of the health of the seals, with reversals and without any."""

from pathlib import Path

import numpy as np
from harness.report_page import checked_page

from seal_friction_ros.core.estimation.findings import GOOD, LOOK, Limits
from seal_friction_ros.offline.replay.bag_health import BagHealth
from seal_friction_ros.offline.reports.health_report import write_health_report


def day(start: float, scale: float, count: int) -> BagHealth:
    """A bag with so many reversals, all of one scale."""
    ones = np.ones(count)
    return BagHealth(
        start + np.arange(count),
        scale * ones,
        0.02 * ones,
        0.0 * ones,
        40.0 * ones,
        1.0,
        np.ones(0),
        None,
        GOOD if count else LOOK,
        '20 of 20 strokes' if count else 'no steady sliding',
        'nothing',
    )


def test_the_page_begins_with_the_alarm_or_says_that_there_is_none(tmp_path: Path):
    calm, worn = day(1.7e9, 1.0, 40), day(1.7e9 + 86400.0, 2.0, 40)
    report = write_health_report(['mon', 'tue'], [calm, worn], tmp_path / 'page.html', Limits())
    page = checked_page(report.page)
    assert page.texts['p.said'][0].startswith('Bad: tue: friction is 2.00 times')
    assert 'data of 2023-11-14 to 2023-11-15' in page.texts['p.made'][0]
    report = write_health_report(['mon'], [calm], tmp_path / 'calm.html', Limits())
    assert checked_page(report.page).texts['p.said'] == ['Good: 20 of 20 strokes.']


def test_a_bag_without_a_reversal_still_makes_a_page(tmp_path: Path):
    report = write_health_report(['mon'], [day(0.0, 1.0, 0)], tmp_path / 'page.html', Limits())
    assert checked_page(report.page).texts['p.said'] == ['Look: No steady sliding.']


def test_the_page_tells_why_samples_were_left_out(tmp_path: Path):
    one = day(1.7e9, 1.0, 40)._replace(used=60, left_out={'at rest': 30, 'not finite': 10})
    page = checked_page(write_health_report(['mon'], [one], tmp_path / 'page.html', Limits()).page)
    said = '60 of 100 samples used (60 %); not used: at rest 30 %, not finite 10 %'
    assert said in page.prose
