"""Compiled replay of a bag, block by block: the result of `replay`, a hundred times faster.

Compiling takes seconds, so it pays for long bags. Unusual bags are left to `replay`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from seal_friction_ros.core.estimation.compiled_pipeline import Answers, receive_all
from seal_friction_ros.core.estimation.configuration import Configuration, Snapshot, parse_snapshot
from seal_friction_ros.core.estimation.pipeline import PipelineState, init
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.messages.blocks import Bytes, Integers, Kind, Messages, UnsuitedError
from seal_friction_ros.core.messages.coder import decode_text
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, FEEDFORWARD_TYPE, GROWN
from seal_friction_ros.files import default_configuration
from seal_friction_ros.offline.bags import block_reader
from seal_friction_ros.offline.bags.actuator_bag import TYPES, Topics, first_snapshot, open_actuator
from seal_friction_ros.offline.bags.bag import KindOf
from seal_friction_ros.offline.bags.block_reader import read_in_bulk
from seal_friction_ros.offline.bags.mcap_reader import ERRORS
from seal_friction_ros.offline.replay.answer_comparison import AnswerStream, ReplayResult, replay_result
from seal_friction_ros.offline.replay.bag_parts import AS_RECORDED, Chosen
from seal_friction_ros.offline.work.places import Place

_RECORDED = {ESTIMATE_TYPE: Kind.ESTIMATE, FEEDFORWARD_TYPE: Kind.FEEDFORWARD}


def replay_in_bulk(
    bag: Path, topics: Topics, override: Configuration | None, advance: Callable[[int], None]
) -> ReplayResult | None:
    """Replay a bag and compare with the recorded answers, as `replay` does; ``override`` as there.

    ``advance`` is called with the number of messages done since the last call. None: the bag is malformed, unreadable
    or unusual, so that only `replay` can handle it.
    """
    done = 0

    def count(messages: int) -> None:
        nonlocal done
        done += messages
        advance(messages)

    try:
        run = Run(override or default_configuration(), has_override=override is not None)
        return run.compared(read_in_bulk(bag, kinds_of_topics(topics)), topics, count)
    except (UnsuitedError, OSError, *ERRORS):
        advance(-done)
        return None


class Run:
    """The estimator on its way through blocks of messages, with the configuration and the state at the beginning.

    Without a state it is before any message. With ``has_override`` the configuration stays, whatever the bag says.
    """

    def __init__(
        self, configuration: Configuration, state: PipelineState | None = None, *, has_override: bool = False
    ) -> None:
        self.configuration, self._has_override = configuration, has_override
        self._parameters = configuration.parameters()
        self._tells_sending = state is not None and configuration.tells_sending
        self.versions: set[int] = set()  # of the algorithm that made the recorded configurations used
        self.state = init(self._parameters) if state is None else state

    def compared(
        self,
        blocks: Iterable[Messages],
        topics: Topics,
        advance: Callable[[int], None] = lambda _: None,
        *,
        may_be_cut: bool = True,
    ) -> ReplayResult:
        """Answers to the blocks in order, compared with the recorded ones; raises UnsuitedError as `receive_all`.

        ``advance`` is called with the number of messages of each block. ``may_be_cut``: the recording may have stopped
        between the last message and its answer.
        """
        velocities, is_cut = 0, False
        streams = {type_name: _BulkAnswerStream(type_name) for type_name, topic in topics.answers.items() if topic}
        for messages, answers in self.answered(blocks):
            kinds = messages.kinds
            velocities += int(np.count_nonzero(kinds == Kind.VELOCITY))
            for type_name, stream in streams.items():
                stream.compare_block(messages, answers, _RECORDED[type_name])
            if len(kinds):
                answered = answers.estimate_sizes[-1] or answers.feedforward_sizes[-1]
                is_cut = bool(answered) or int(kinds[-1]) in (Kind.ESTIMATE, Kind.OTHER_ESTIMATE)
            advance(len(kinds))
        return replay_result(velocities, streams, self.versions, is_cut=is_cut and may_be_cut)

    def answered(self, blocks: Iterable[Messages]) -> Iterator[tuple[Messages, Answers]]:
        """Blocks of messages and the answers to them; a block ends before each configuration."""
        for block in blocks:
            changes = np.flatnonzero(block.kinds == Kind.CONFIGURATION).tolist()
            ends = sorted({0, *changes, len(block.kinds)})  # no empty ones, which would compile, too
            for first, end in pairwise(ends):
                messages = block.taken(first, end)
                if messages.kinds[0] == Kind.CONFIGURATION:
                    self.configure(parse_snapshot(decode_text(messages.message(0))))
                if not self._tells_sending:
                    messages = messages._replace(sent=messages.received)
                self.state, answers = receive_all(self._parameters, self.state, messages)
                yield messages, answers

    def configure(self, snapshot: Snapshot) -> None:
        """Take a recorded configuration, with its state."""
        configuration, self.state = snapshot.configuration, snapshot.state
        self._tells_sending = configuration.tells_sending
        if not self._has_override:
            self.configuration, self._parameters = configuration, configuration.parameters()
            self.versions.add(snapshot.version)


def compile_now(configurations: Iterable[Configuration] = ()) -> None:
    """Compile in this process, so that worker processes inherit the compiled code.

    Each kind of law in the ``configurations``, which bags are replayed with, is compiled once. None: the default one.
    """
    none = Messages(np.frombuffer(bytes(1), np.uint8), np.zeros(0, np.uint8), *np.zeros((4, 0), np.int64))
    for configuration in list(configurations) or [default_configuration()]:
        parameters = configuration.parameters()
        _, answers = receive_all(parameters, init(parameters), none)
    places = none.offsets, none.sizes
    _compare(0, 0, False, (answers.data, *places), (none.data, *places), none.sizes, none.sizes)
    block_reader.compile_now()


def compile_first(bags: Sequence[Place], chosen: Chosen = AS_RECORDED) -> None:
    """`compile_now` what each bag is replayed with at its beginning; a URL is not read.

    That is the default where a bag has no configuration or is unreadable: the replay itself says what is wrong with it.
    """
    paths = [bag for bag in bags if isinstance(bag, Path)]
    compile_now([chosen.override] if chosen.override else [_first_configuration(bag, chosen) for bag in paths])


def _first_configuration(bag: Path, chosen: Chosen) -> Configuration:
    try:
        source = open_actuator(bag, chosen.namespace, chosen.mapping)
        topic = source.topics.configuration
        first = first_snapshot(bag, source.messages(), topic) if topic else None
    except (ValueError, OSError, *ERRORS):
        first = None
    return default_configuration() if first is None else first.configurations['']


def kinds_of_topics(topics: Topics) -> KindOf:
    """Function that gives the kind of message on a topic.

    It raises `UnsuitedError` for a topic with messages of two types, and for simulated time.
    """
    known = {
        topic: (type_name, Kind[name.upper()])
        for name, topic, type_name in zip(Topics._fields, topics, TYPES, strict=True)
        if topic and name not in ('position', 'clock')
    }

    def kind_of(topic: str, type_name: str) -> Kind:
        """What a message is; UnsuitedError for simulated time and for two types on one topic."""
        other = Kind.OTHER_ESTIMATE if type_name == ESTIMATE_TYPE else Kind.OTHER
        wanted, kind = known.get(topic, (type_name, other))
        if topic == topics.clock:
            raise UnsuitedError(f'{topic}: simulated time')
        if type_name != wanted:
            raise UnsuitedError(f'{topic} has messages of {wanted} and of {type_name}')
        return kind

    return kind_of


class _BulkAnswerStream(AnswerStream):
    """An `AnswerStream` for blocks: compiled code compares the expected order, `AnswerStream` the rest one by one."""

    def compare_block(self, messages: Messages, answers: Answers, kind: Kind) -> None:
        """Compare the recorded messages of a block, of kind ESTIMATE or FEEDFORWARD, with the answers before them."""
        places = answers[1:3] if kind == Kind.ESTIMATE else answers[3:5]
        made = np.flatnonzero(places[1])
        offsets, sizes = places[0][made], places[1][made]
        recorded = np.flatnonzero(messages.kinds == kind)
        available = np.searchsorted(made, recorded).astype(np.int64)  # answers before each recorded message
        ours = (answers.data, offsets, sizes)
        theirs = (messages.data, messages.offsets[recorded], messages.sizes[recorded])
        taken = used = 0
        while taken < len(recorded):
            if not self.pending:
                before = taken
                taken, used, differing = _compare(
                    taken, used, bool(self.first), ours, theirs, available, np.array(GROWN[self.type_name], np.int64)
                )
                self.recorded += taken - before
                self.differing += differing
            if taken < len(recorded):
                self._add_all(answers.data, offsets[used : available[taken]], sizes[used:])
                used = int(available[taken])
                self.compare_recorded(messages.message(recorded[taken]))
                taken += 1
                if len(self.pending) <= used:  # they are all of this block
                    used -= len(self.pending)
                    self.pending.clear()
        self._add_all(answers.data, offsets[used:], sizes[used:])

    def _add_all(self, data: Bytes, offsets: Integers, sizes: Integers) -> None:
        for offset, size in zip(offsets.tolist(), sizes.tolist(), strict=False):
            self.add_replayed(data[offset : offset + size].tobytes())


@compiled
def _compare(
    taken: int,
    used: int,
    is_named: bool,
    ours: tuple[Bytes, Integers, Integers],
    theirs: tuple[Bytes, Integers, Integers],
    available: Integers,
    grown: Integers,
) -> tuple[int, int, int]:
    """Compare recorded messages from number ``taken`` on with answers from number ``used`` on, in the simple case.

    The case is simple while they agree and, once the first difference has a text (``is_named``), while exactly one
    answer waits. A recorded message may be one of ``grown`` [bytes] shorter, as before its type grew. Returns the
    number of the first recorded message that is not simple, of the first answer that waits for it, and the number of
    differences.
    """
    data, offsets, sizes = ours
    recorded, recorded_offsets, recorded_sizes = theirs
    differing = 0
    while taken < len(available) and used < available[taken]:
        size, first, second = recorded_sizes[taken], offsets[used], recorded_offsets[taken]
        same = size == sizes[used] or sizes[used] - size in grown
        if same:
            for k in range(size):
                if data[first + k] != recorded[second + k]:
                    same = False
                    break
        if not same:
            if not is_named or available[taken] - used > 1:
                break
            differing += 1
        taken += 1
        used += 1
    return taken, used, differing
