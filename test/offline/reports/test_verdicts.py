"""The verdict of a page follows from its numbers: the reason first, and what to do next."""

import pytest

from seal_friction_ros.offline.reports import verdicts
from seal_friction_ros.offline.reports.page import BAD, GOOD, LOOK

BAG = verdicts.BagNumbers('bag', 20, 20, 0.0, False, False, '', None)
LAW = verdicts.IdentificationNumbers('law', 0.05, 0.08, 0.95, '', False, False, False)


@pytest.mark.parametrize(
    ('changed', 'level', 'words'),
    [
        ({}, GOOD, '20 of 20'),
        ({'in_band': 18}, GOOD, '18 of 20'),
        ({'in_band': 17}, LOOK, 'identify bag'),
        ({'in_band': 9}, BAD, '9 of 20'),
        ({'strokes': 0, 'in_band': 0}, LOOK, 'No steady sliding'),
        ({'flagged': 0.011}, LOOK, '1.1 %'),
        ({'flagged': 0.2}, BAD, 'status bits'),
        ({'has_placeholder': True}, BAD, 'The estimate used the placeholder seal'),
        ({'has_reference': True}, GOOD, 'tune --bag bag'),
        ({'tracking': 'error cut', 'tracking_change': -80.0}, GOOD, 'Error cut; 20 of 20'),
        ({'tracking': 'error raised', 'tracking_change': 5.0}, BAD, 'Error raised; 20 of 20'),
    ],
)
def test_a_bag_is_judged_by_band_flags_seals_and_loop(changed, level, words):
    verdict = verdicts.of_bag(BAG._replace(**changed))
    assert verdict.level == level
    assert words in f'{verdict.text} {verdict.next}'


@pytest.mark.parametrize(
    ('changed', 'level'),
    [
        ({}, GOOD),
        ({'error': 0.11}, LOOK),
        ({'error': 0.31}, BAD),
        ({'error': float('nan')}, BAD),
        ({'coverage': 0.89}, LOOK),
        ({'coverage': 0.4}, BAD),
        ({'unsound': 'singular'}, BAD),
        ({'outlier': True}, LOOK),
        ({'changed': True}, LOOK),
        ({'drifted': True}, LOOK),
    ],
)
def test_an_identified_law_is_judged_on_readings_that_it_has_not_seen(changed, level):
    assert verdicts.of_identification(LAW._replace(**changed)).level == level


@pytest.mark.parametrize('mass', [-0.415, 0.0])
def test_a_moving_mass_that_no_machine_has_is_an_alarm(mass):
    given = {'is_better': True, 'has_placeholder': False, 'fitted': True, 'bag': True}
    verdict = verdicts.of_tuning('better', mass=mass, **given)
    assert verdict.level == BAD
    assert f'{mass:.3g} kg' in verdict.text
    assert verdicts.of_tuning('better', mass=0.4, **given).level == LOOK


def test_an_alarm_is_worse_than_a_change_and_that_than_none():
    assert verdicts.of_health(['monday: friction'], 1, 50).level == BAD
    assert verdicts.of_health([], 1, 50).level == LOOK
    assert verdicts.of_health([], 0, 0).level == LOOK
    assert verdicts.of_health([], 0, 3).level == LOOK  # too few to tell
    assert verdicts.of_health([], 0, 50).level == GOOD


def test_a_change_within_the_noise_is_no_change():
    names = ('before', 'after')
    assert verdicts.of_runs([('friction', 0.04, 0.05)], names).level == GOOD
    told = verdicts.of_runs([('friction', -0.36, 0.05)], names)
    assert told.level == LOOK
    assert '-36.0 %' in told.text
    assert 'fit again' in told.next
    assert verdicts.of_runs([('friction', 0.04, 1.6)], names).level == LOOK  # nobody knows
    assert verdicts.of_runs([], names).level == LOOK
