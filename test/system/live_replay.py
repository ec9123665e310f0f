"""Live against offline: ``python test/system/live_replay.py BAG... [--rate R]... [--times N] [--json]``.

Plays each bag into a live estimator, both in processes of their own, and compares the estimates with those of the
offline replay of the bag byte for byte. Exit code 1 if any differ or if the recording does not verify.
"""

import shutil
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell
from harness.processes import free_domain, play_live

from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE
from seal_friction_ros.offline.bags.bag import read_messages
from seal_friction_ros.offline.replay.replay import chosen_configuration, replay


class LiveRun(NamedTuple):
    """One bag played live."""

    live: list[bytes]
    """estimates recorded live"""
    offline: list[bytes]
    """estimates of the offline replay of the same bag"""
    verifies: bool
    """whether the replay of the live recording is identical"""

    @property
    def identical(self) -> bool:
        """Whether live and offline estimates are the same bytes and the recording verifies."""
        return self.live == self.offline and self.verifies


def play(bag: Path, rate: float, folder: Path) -> LiveRun:
    """Play a bag live at ``rate`` times its pace (0: as fast as answered) and replay it offline.

    Both use the default parameters of the node, not those of the bag, and do not check the age of its stamps. On a
    machine with other work messages may come late by up to 10 s.
    """
    play_live(bag, folder / 'live', free_domain(), rate, {'feedforward.lateness_max': 10.0})
    default = folder / 'default.yaml'
    default.write_text('/**:\n  ros__parameters: {stamp_age_max: 0.0, feedforward: {lateness_max: 10.0}}\n')
    replay(bag, chosen_configuration(default, None), folder / 'offline')
    return LiveRun(*(estimates(folder / name) for name in ('live', 'offline')), replay(folder / 'live').identical)


def estimates(bag: Path) -> list[bytes]:
    """Estimates of a bag, as recorded."""
    return [message.data for message in read_messages(bag) if message.type_name == ESTIMATE_TYPE]


def main() -> int:
    """Play the bags; print a table, or JSON."""
    parser = parser_of(__doc__, times=(1, 'runs of each bag at each rate'))
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG')
    parser.add_argument('--rate', type=float, action='append', help='times the pace of the bag; 0: as fast as answered')
    arguments = parser.parse_args()
    rows = []
    for bag in arguments.bags:
        for rate in (arguments.rate or [1.0, 0.0]) * arguments.times:
            folder = Path(tempfile.mkdtemp())
            run = play(bag, rate, folder)
            counts = len(run.live), len(run.offline)
            rows.append({'bag': str(bag), 'rate': rate, 'estimates': counts, 'identical': run.identical})
            if run.identical:
                shutil.rmtree(folder)
            else:
                rows[-1]['kept'] = str(folder)
    tell(rows, as_json=arguments.json, title='estimates live and offline')
    return int(not all(row['identical'] for row in rows))


if __name__ == '__main__':
    sys.exit(main())
