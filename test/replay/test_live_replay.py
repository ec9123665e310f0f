"""Bags played over a real graph into the live node, in separate processes, against their offline replay.

Run by itself it does so with bags of your own::

    python test/replay/test_live_replay.py BAG... [--rate R]...

and says for each whether what came out live is, byte for byte, what the offline replay of the bag gives.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

import pytest
from paths import ROOT

from seal_friction_ros.core.estimation.messages import ESTIMATE_TYPE
from seal_friction_ros.nodes.processes import free_domain, play_live
from seal_friction_ros.offline.bags.bag import read_messages
from seal_friction_ros.offline.replay.replay import chosen_configuration, replay

BAGS = sorted(path.parent for path in (ROOT / 'bags').glob('*/metadata.yaml'))


def live_and_offline(bag: Path, rate: float, folder: Path) -> tuple[list[bytes], list[bytes], bool]:
    """Estimates of a bag played live, those of its offline replay, and whether the recording verifies.

    The live node runs with its default parameters, so the offline replay does too, whatever the bag says.
    """
    play_live(bag, folder / 'live', free_domain(), rate)
    default = folder / 'default.yaml'
    default.write_text('/**:\n  ros__parameters: {}\n')
    replay(bag, chosen_configuration(default, None), folder / 'offline')
    live, offline = (estimates(folder / name) for name in ('live', 'offline'))
    return live, offline, replay(folder / 'live').identical


def estimates(bag: Path) -> list[bytes]:
    return [message.data for message in read_messages(bag) if message.type_name == ESTIMATE_TYPE]


@pytest.mark.parametrize('rate', [1.0, 10.0, 0.0])
@pytest.mark.parametrize('bag', BAGS, ids=lambda bag: bag.name)
def test_what_comes_out_live_is_the_offline_replay_byte_for_byte(bag: Path, rate: float, tmp_path: Path):
    live, offline, verified = live_and_offline(bag, rate, tmp_path)
    assert len(live) == len(offline) > 0
    assert live == offline
    assert verified


def test_twenty_recordings_in_a_row_verify(tmp_path: Path):
    verified = []
    for run in range(20):
        play_live(BAGS[0], tmp_path / str(run), free_domain(), 0.0)
        verified.append(replay(tmp_path / str(run)).identical)
    assert verified == [True] * 20


def main() -> int:
    """Play the bags named on the command line; 0 if every one came out as its offline replay."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG')
    parser.add_argument('--rate', type=float, action='append', help='times the pace of the bag; 0: as fast as it goes')
    arguments = parser.parse_args()
    good = True
    for bag in arguments.bags:
        for rate in arguments.rate or [1.0, 0.0]:
            folder = Path(tempfile.mkdtemp())
            live, offline, verified = live_and_offline(bag, rate, folder)
            same = live == offline and verified
            good = good and same
            verdict = 'identical' if same else f'DIFFERENT, see {folder}'
            print(f'{bag} at rate {rate:g}: {len(live)} live, {len(offline)} offline estimates: {verdict}')
            if same:
                shutil.rmtree(folder)
    return 0 if good else 1


if __name__ == '__main__':
    sys.exit(main())
