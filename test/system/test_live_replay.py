"""Bags played over a real graph into the live node give, byte for byte, the estimates of their offline replay."""

from pathlib import Path

import pytest
from fault_stage import stage
from harness.commands import run_json
from harness.example_bags import rewrite
from live_replay import play
from paths import ROOT
from rclpy.parameter import Parameter

from seal_friction_ros.offline.bags.bag import read_messages
from seal_friction_ros.offline.replay.replay import replay

BAGS = sorted(path.parent for path in (ROOT / 'bags').glob('*/metadata.yaml'))
BEGINNING = 10**9  # [ns] of a bag that is played at its own pace


@pytest.mark.parametrize('rate', [0.0, *(pytest.param(rate, marks=pytest.mark.long) for rate in (1.0, 10.0))])
@pytest.mark.parametrize('bag', BAGS, ids=lambda bag: bag.name)
def test_what_comes_out_live_is_the_offline_replay_byte_for_byte(bag: Path, rate: float, tmp_path: Path):
    if rate == 1.0:
        end = next(read_messages(bag)).log_time + BEGINNING
        bag = rewrite(bag, tmp_path / 'beginning', lambda _, message: message if message.log_time < end else None)
    run = play(bag, rate, tmp_path)
    assert len(run.live) == len(run.offline) > 50
    assert run.live == run.offline
    assert run.verifies


def test_the_command_says_whether_they_are_identical():
    (row,) = run_json('test/system/live_replay.py', str(BAGS[0]), '--rate', '0')
    assert row['identical']
    assert row['estimates'][0] > 0


def test_twenty_recordings_in_a_row_verify(tmp_path: Path):
    with stage({'record': True, 'record_directory': str(tmp_path), 'record_name': '0'}) as place:
        for number in range(1, 21):
            place.run(30 + number)
            place.estimator.set_parameters([Parameter('record_name', value=str(number))])
            place.restart()  # finishes the bag and begins the next one
    found = [replay(tmp_path / str(number)) for number in range(20)]
    assert [result.identical for result in found] == [True] * 20
    assert [result.recorded_estimates for result in found[1:]] == [31 + number for number in range(1, 20)]
