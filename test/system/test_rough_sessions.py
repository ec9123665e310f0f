"""A short random session of each kind of node: it lives, and its bags replay to the byte."""

import pytest
from rough_sessions import CASES, Case, Outcome, session


@pytest.mark.parametrize('case', [Case('one'), Case('each')], ids=str)
def test_a_rough_session_ends_well(tmp_path, case):
    outcome = session(case, 7, 500, tmp_path)
    assert outcome.is_good, outcome


@pytest.mark.long
@pytest.mark.parametrize('case', CASES, ids=str)
def test_rough_sessions_of_every_case_end_well(tmp_path, case):
    outcome = session(case, 11, 2000, tmp_path)
    assert outcome.is_good, outcome
    assert outcome.bags > 1


def test_an_error_is_not_a_good_end():
    good = Outcome(10, 0, 10, 1, [], [])
    assert good.is_good
    worse = [{'forces': 0}, {'not_finite': 1}, {'samples': 0}, {'differing': ['a: b']}, {'faults': ['traceback']}]
    assert not any(good._replace(**change).is_good for change in worse)
