"""Verified replay of one long bag by several workers: each takes a stretch between two recorded states.

The node records a snapshot every ``record_state_period`` on ``~/state``. A worker begins with one of them, compares the
answers up to another, and then its own snapshot with that one. If every stretch is identical and ends in the state in
which the next one begins, the replay in one go is identical, too: that is what is proven. Within the bag no answer may
lack, not even the last one of a stretch. In any other case nothing is concluded, and the bag is to be replayed in one
go, which finds the first difference.
"""

from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from seal_friction_ros.core.estimation.configuration import ALGORITHM_VERSION, Snapshot, parse_snapshot, snapshot_text
from seal_friction_ros.core.messages.blocks import Kind, UnsuitedError
from seal_friction_ros.core.messages.coder import decode_text
from seal_friction_ros.files import default_configuration
from seal_friction_ros.offline.bags.actuator_bag import Topics
from seal_friction_ros.offline.bags.block_reader import Stretch, read_in_bulk, times_of
from seal_friction_ros.offline.bags.mcap_reader import ERRORS, LAST_TIME
from seal_friction_ros.offline.replay.answer_comparison import ReplayResult
from seal_friction_ros.offline.replay.compiled_replay import Run, compile_first, kinds_of_topics
from seal_friction_ros.offline.work.cluster import Cluster
from seal_friction_ros.offline.work.executor import Workers, try_all

STRETCHES = 4  # for each worker (our choice): so the last one to finish keeps the others waiting a little only
_OF_A_CLUSTER = 64  # stretches: how many workers it has may change
_BEGIN, _END = (0, 0), (1 << 30, LAST_TIME + 1)  # before and after every message: number of the file, log time [ns]


def stretches_of(bag: Path, topics: Topics, most: int) -> list[Stretch]:
    """At most so many stretches, of about as many recorded states each, or one. Raises as `times_of`."""
    states = times_of(bag, topics.state)
    step = -(-(len(states) + 1) // most)
    places = [_BEGIN, *states[step - 1 :: step], _END]
    return [Stretch(*first, *end) for first, end in pairwise(places)]


def verify_stretches(bag: Path, topics: Topics, workers: Workers) -> ReplayResult | None:
    """Result of `replay` of a long bag with its own configuration, if it is identical; computed by several workers.

    None: nothing is known, the bag is to be replayed in one go. Raises ValueError if the cluster cannot be used.
    """
    if not topics.configuration:
        return None
    try:
        stretches = stretches_of(bag, topics, _OF_A_CLUSTER if isinstance(workers, Cluster) else STRETCHES * workers)
    except (OSError, *ERRORS):
        return None
    if len(stretches) == 1:
        return None
    calls = [partial(_verified, bag.absolute(), topics, stretch) for stretch in stretches]
    label = f'replay {bag.name} in {len(calls)} stretches'
    outcomes = try_all(label, calls, workers, prepare=partial(compile_first, [bag]))
    found = [outcome.result for outcome in outcomes if outcome.result is not None]
    if len(found) < len(stretches):
        return None
    samples, estimates, feedforwards = map(sum, zip(*(result[:3] for result in found), strict=True))
    version = min(result.recorded_version for result in found)
    return ReplayResult(samples, estimates, feedforwards, 0, '', version)


def _verified(bag: Path, topics: Topics, stretch: Stretch) -> ReplayResult | None:
    """Result of a stretch; None if it is not identical, or does not end in the recorded state."""
    kind_of = kinds_of_topics(topics)
    try:
        run = Run(default_configuration())
        if (stretch.file, stretch.first) != _BEGIN:
            known = parse_snapshot(_state_at(bag, topics, stretch.file, stretch.first))
            if known.version != ALGORITHM_VERSION:
                return None
            run = Run(known.configuration, known.state)
        is_last = (stretch.last_file, stretch.end) == _END
        result = run.compared(read_in_bulk(bag, kind_of, stretch), topics, may_be_cut=is_last)
        if result.differing:
            return None
        if not is_last:
            recorded = _state_at(bag, topics, stretch.last_file, stretch.end)
            if snapshot_text(Snapshot(run.configuration, run.state)) != recorded:
                return None
    except (UnsuitedError, OSError, *ERRORS):
        return None
    return result


def _state_at(bag: Path, topics: Topics, file: int, time: int) -> str:
    """Text of the state that was recorded at a log time [ns]; ValueError if there is none."""

    def kind_of(topic: str, _: str) -> Kind:
        return Kind.CONFIGURATION if topic == topics.state else Kind.OTHER

    for messages in read_in_bulk(bag, kind_of, Stretch(file, time, file, time + 1)):
        for number in np.flatnonzero(messages.kinds == Kind.CONFIGURATION).tolist():
            return decode_text(messages.message(number))
    raise ValueError(f'{bag}: no message on {topics.state} at {time} ns')
