"""Replay of several bags: the result does not depend on the number of processes, and one bad bag spoils no other."""

import json
import os
from pathlib import Path

import pytest
from harness.example_bags import write_inputs
from paths import ROOT

from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay import parallel_replay as module
from seal_friction_ros.offline.replay.parallel_replay import replay_many
from seal_friction_ros.offline.replay.replay import replay

GOOD = [ROOT / 'bags' / 'pull_test', ROOT / 'bags' / 'faults']


@pytest.fixture(scope='module')
def bags(tmp_path_factory) -> list[Path]:
    """Bags of different length; one folder is no bag."""
    folder = tmp_path_factory.mktemp('many')
    inputs = [write_inputs(folder / f'inputs_{samples}', samples) for samples in (400, 3, 50)]
    (folder / 'nothing').mkdir()
    return [*GOOD, folder / 'nothing', *inputs]


def test_results_are_those_of_each_bag_alone_in_the_order_given(bags: list[Path]):
    alone = [None if bag.name == 'nothing' else replay(bag) for bag in bags]
    for workers in (1, 2, 5):
        outcomes = replay_many(bags, workers=workers)
        assert [outcome.result for outcome in outcomes] == alone
        assert [bool(outcome.error) for outcome in outcomes] == [result is None for result in alone]


def test_results_are_the_same_with_the_compiled_estimator(bags: list[Path], monkeypatch):
    expected = replay_many(bags, workers=2)
    monkeypatch.setattr(module, 'BULK_FROM', 0)
    assert replay_many(bags, workers=2) == expected


def test_what_is_printed_does_not_depend_on_the_number_of_workers(bags: list[Path], capsys):
    said = []
    for workers in ('1', '2', '7'):
        assert main(['replay', *map(str, bags), '--verify', '--workers', workers]) == 2
        said.append(capsys.readouterr())
    assert said[0] == said[1] == said[2]
    assert said[0].out.splitlines()[0] == f'{GOOD[0]}: 900 estimates and 0 feed-forwards, identical to the byte'
    assert said[0].err.startswith('seal_friction: ')
    assert said[0].err.count('\n') == 1


def test_the_exit_code_is_that_of_the_worst_bag(bags: list[Path], capsys):
    good, inputs = [str(bag) for bag in GOOD], str(bags[3])
    assert main(['replay', *good, '--verify']) == 0
    assert main(['replay', *good, inputs]) == 0
    assert main(['replay', *good, inputs, '--verify']) == 1
    assert main(['replay', *good, inputs, str(bags[2]), '--verify']) == 2


def test_with_json_there_is_one_object_with_a_record_for_each_bag(bags: list[Path], capsys):
    assert main(['replay', *map(str, bags), '--json']) == 2
    found = json.loads(capsys.readouterr().out)
    assert [record['bag'] for record in found['bags']] == list(map(str, bags))
    assert [record.get('identical') for record in found['bags']] == [True, True, None, False, False, False]
    assert 'metadata.yaml' in found['bags'][2]['error']
    assert not found['identical']


def test_out_is_for_one_bag_and_workers_are_at_least_one(tmp_path: Path, capsys):
    assert main(['replay', *map(str, GOOD), '--out', str(tmp_path / 'out')]) == 2
    assert not (tmp_path / 'out').exists()
    assert '--out is for one bag' in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(['replay', str(GOOD[0]), '--workers', '0'])


def test_a_process_that_dies_costs_its_own_bag_only(bags: list[Path], monkeypatch):
    def replay_or_die(bag: Path, *arguments, **options):
        if bag == GOOD[1]:
            os._exit(9)
        return replay(bag, *arguments, **options)

    monkeypatch.setattr(module, 'replay', replay_or_die)
    first, second = replay_many(GOOD, workers=2)
    assert first.result is not None
    assert first.result.identical
    assert second.result is None
    assert str(GOOD[1]) in second.error
    assert 'ended before it was done' in second.error
