"""What all commands share: JSON values and types of options."""

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import pytest

from seal_friction_ros.offline.commands.command_line import (
    add_workers,
    at_least,
    json_value,
    non_negative,
    workers_of,
)
from seal_friction_ros.offline.work.cluster import Cluster


class Pair(NamedTuple):
    one: float
    other: Path


@dataclass
class Record:
    pair: Pair
    values: tuple[float, ...]


def test_records_paths_and_numbers_that_are_not_finite_are_json_values():
    record = Record(Pair(math.nan, Path('a/b')), (1.0, math.inf))
    assert json_value({1: record, 'x': [True, None, 3]}) == {
        '1': {'pair': {'one': None, 'other': 'a/b'}, 'values': [1.0, None]},
        'x': [True, None, 3],
    }


@pytest.mark.parametrize('text', ['-1', 'inf', 'nan', 'x'])
def test_only_finite_numbers_of_at_least_0_are_non_negative(text):
    assert non_negative('0') == 0.0
    with pytest.raises((argparse.ArgumentTypeError, ValueError)):
        non_negative(text)


@pytest.mark.parametrize('text', ['0', '-2', '1.5', 'x'])
def test_only_whole_numbers_of_at_least_1_are_at_least_one(text):
    assert at_least(1)('1') == 1
    with pytest.raises((argparse.ArgumentTypeError, ValueError)):
        at_least(1)(text)


def test_workers_and_jobs_are_one_option_and_the_default_is_every_core():
    parser = argparse.ArgumentParser()
    add_workers(parser, 'bags')
    assert workers_of(parser.parse_args(['--jobs', '3'])) == 3
    assert workers_of(parser.parse_args(['--workers', '2'])) == 2
    assert workers_of(parser.parse_args([])) >= 1
    assert workers_of(parser.parse_args(['--scheduler', 'tcp://a:1'])) == Cluster('tcp://a:1')
    with pytest.raises(SystemExit):
        parser.parse_args(['--scheduler', 'tcp://a:1', '--workers', '2'])
