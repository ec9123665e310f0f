"""The verdict of a page follows from its numbers: the reason first, and what to do next."""

import pytest

from seal_friction_ros.core.estimation.findings import BAD, GOOD, LOOK
from seal_friction_ros.offline.reports import verdicts

LAW = {'law': 'law', 'error': 0.05, 'largest': 0.08, 'coverage': 0.95, 'unsound': ''}


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
    ],
)
def test_an_identified_law_is_judged_on_readings_that_it_has_not_seen(changed, level):
    assert verdicts.of_identification(**{**LAW, **changed}).level == level


def test_an_outlier_is_a_reason_to_look():
    verdict = verdicts.of_identification(*LAW.values(), 'one pressure is an outlier')
    assert verdict.level == LOOK
    assert verdict.text.endswith('; one pressure is an outlier.')


@pytest.mark.parametrize('mass', [-0.415, 0.0])
def test_a_moving_mass_that_no_machine_has_is_an_alarm(mass):
    given = {'is_better': True, 'has_placeholder': False, 'fitted': True}
    verdict = verdicts.of_tuning('better', mass=mass, **given)
    assert verdict.level == BAD
    assert f'{mass:.3g} kg' in verdict.text
    assert verdicts.of_tuning('better', mass=0.4, **given).level == LOOK


def test_a_change_within_the_noise_is_no_change():
    names = ('before', 'after')
    assert verdicts.of_runs([('friction', 0.04, 0.05)], names).level == GOOD
    told = verdicts.of_runs([('friction', -0.36, 0.05)], names)
    assert told.level == LOOK
    assert '-36.0 %' in told.text
    assert 'fit again' in told.next
    assert verdicts.of_runs([('friction', 0.04, 1.6)], names).level == LOOK  # nobody knows
    assert verdicts.of_runs([], names).level == LOOK
