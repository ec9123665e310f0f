"""Every row of docs/degradation.md, tried once on the live node; ``faults.py`` tries each twenty times."""

import math
from collections.abc import Iterator

import pytest
from fault_rows import SIGNAL_ROWS, Row
from fault_stage import Stage, stage, try_row
from faults import TRIALS, Trial, attempt
from harness.commands import run_json

LONG = ('disk nearly full, later with room again',)


@pytest.fixture(scope='module')
def place() -> Iterator[Stage]:
    with stage() as made:
        yield made


@pytest.mark.parametrize('row', SIGNAL_ROWS, ids=lambda row: row.fault)
def test_a_signal_that_fails_does_what_the_table_says_and_comes_back(place: Stage, row: Row):
    assert try_row(place, row) == []


@pytest.mark.parametrize(
    'trial',
    [pytest.param(one, marks=[pytest.mark.long] if one.fault in LONG else [], id=one.fault) for one in TRIALS],
)
def test_graph_process_and_disk_do_what_the_table_says(trial: Trial):
    assert attempt(trial, seed=7) == []


def test_a_row_that_requires_what_does_not_happen_fails(place: Stage):
    stops = SIGNAL_ROWS[0]
    for wrong in (
        Row('', stops.spoil, 'FORCE_STALE', feedforward='fades'),
        Row('', stops.spoil, 'PRESSURE_STALE', feedforward='as usual'),
        Row('', stops.spoil, 'PRESSURE_STALE', feedforward='fades', level='OK'),
    ):
        assert len(try_row(place, wrong)) == 1


def test_the_command_reports_a_fault_that_does_as_required():
    found = run_json('test/system/faults.py', '--only', ' no ', '--times', '1')
    assert found == {'bytes that are no message': [[]], 'an input has no publisher at first': [[]]}


@pytest.mark.long
def test_the_command_measures_the_time_to_zero():
    found = run_json('test/system/time_to_zero.py', '--only', 'stops', '--times', '1')
    # An input stops; it leaps, then stops; /clock stops, also before a reversal.
    assert len(found['received']) == len(found['acting']) == 4 + 4 + 2
    for (received,), (acting,) in zip(found['received'].values(), found['acting'].values(), strict=True):
        assert 0.0 < acting <= received < math.inf  # how long depends on the load
        assert received > 0.2
