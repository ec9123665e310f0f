"""A bag through the estimator, with no ROS graph and no clock: the same messages give the same bytes as live."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.estimation.configuration import (
    Configuration,
    SealSelection,
    Snapshot,
    first_snapshot,
    parse_snapshot,
    snapshot_text,
)
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.messages import (
    CONFIGURATION_TYPE,
    ESTIMATE_TYPE,
    FEEDFORWARD_TYPE,
    decode,
    decode_text,
    encode_text,
)
from seal_friction_ros.core.estimation.pipeline import answered, init
from seal_friction_ros.files import default_configuration, load_configuration, load_parameter_file
from seal_friction_ros.offline.bags.bag import (
    CONFIGURATION_TOPIC,
    BagError,
    BagMessage,
    BagWriter,
    TopicInfo,
    bag_topics,
    read_messages,
)
from seal_friction_ros.offline.bags.topics import ANSWER_TOPICS, Topics, find_topics
from seal_friction_ros.offline.replay.verdict import Stream, Verdict, verdict_of
from seal_friction_ros.offline.work.progress import progress


def chosen_configuration(params: Path | None, seal: Path | None) -> Configuration | None:
    """Configuration from a ROS parameter file and a seal file for all seals; None if neither is given.

    Raises:
        ValueError: A file cannot be read or makes no sense.
    """
    if params is None and seal is None:
        return None
    selection, settings, feedforward = SealSelection(), EstimatorSettings(), FeedForwardSettings()
    if params:
        selection, settings, feedforward = load_parameter_file(params)
    if seal:
        selection = SealSelection((str(seal),) * len(selection.seals), selection.seal_chambers)
    return load_configuration(selection, settings, feedforward)


Show = Callable[[str, int], AbstractContextManager[Callable[[float], None]]]
"""Shows progress: from what is done and how many messages it has, a context in which to say how many more are done."""


class Step(NamedTuple):
    """One message and what the estimator answers."""

    message: BagMessage
    answers: tuple[tuple[str, bytes], ...]
    """message type and bytes of each"""


def steps(messages: Iterable[BagMessage], topics: Topics, override: Configuration | None) -> Iterator[Step]:
    """Each message in order, with the serialised answers to it.

    The configuration is the newest one in the bag, or ``override``, or the default where there is neither. What was
    used comes out: configuration messages hold ``override`` where it is given, and there is one at the start if the
    bag has none.

    Raises:
        BagError: A message is not what its type says.
    """
    configuration = override or default_configuration()
    parameters = configuration.parameters()
    state = init(parameters)
    inputs = {topics.pressure, topics.velocity, topics.force, topics.reference} - {''}
    if not topics.configuration:
        data = encode_text(snapshot_text(first_snapshot(configuration)))
        yield Step(BagMessage(CONFIGURATION_TOPIC, CONFIGURATION_TYPE, 0, data), ())
    for message in messages:
        answers: list[tuple[str, bytes]] = []
        used = message
        try:
            if message.topic in inputs:
                state, answers = answered(parameters, state, decode(message.type_name, message.data))
            elif message.topic == topics.configuration:
                configuration, state = parse_snapshot(decode_text(message.data))
                if override:
                    used = message._replace(data=encode_text(snapshot_text(Snapshot(override, state))))
                else:
                    parameters = configuration.parameters()
        except ValueError as error:
            raise BagError(f'message on {message.topic} at {message.log_time} ns: {error}') from None
        yield Step(used, tuple(answers))


BULK_FROM = 500_000
"""Messages from which on a bag is replayed compiled: to compile takes as long as this many messages one by one."""


def replay(
    bag: Path,
    override: Configuration | None = None,
    out: Path | None = None,
    namespace: str = '',
    *,
    bulk_from: int = BULK_FROM,
    show: Show = progress,
) -> Verdict:
    """Replay a bag; compare with the estimates it holds; with ``out``, write inputs and new estimates as a new bag.

    Args:
        bag: The bag.
        override: Configuration instead of what the bag says.
        out: Bag to write.
        namespace: Only topics below it are looked at.
        bulk_from: Without ``out``, a bag of so many messages is replayed compiled, to the same verdict.
        show: What shows the progress: as `progress`.

    Raises:
        BagError: The bag cannot be read, or ``out`` exists already. Nothing is left at ``out`` then.
    """
    known = bag_topics(bag)
    topics = find_topics(bag, namespace, known)
    total = count_messages(known)
    with show(f'replay {bag.name}', total) as advance:
        verdict = None
        if out is None and total >= bulk_from:
            from seal_friction_ros.offline.replay.compiled_replay import replay_in_bulk  # noqa: PLC0415  loads the compiler

            verdict = replay_in_bulk(bag, topics, override, advance)
        if verdict is None:
            verdict = _replay_one_by_one(bag, topics, override, out, advance)
    return verdict


def _replay_one_by_one(
    bag: Path, topics: Topics, override: Configuration | None, out: Path | None, advance: Callable[[int], None]
) -> Verdict:
    replayed = _counted(steps(read_messages(bag), topics, override), advance)
    if out is None:
        return _compare(replayed, topics)
    with BagWriter(out) as writer:
        return _compare(_written(replayed, topics, writer), topics)


def count_messages(topics: Mapping[str, TopicInfo]) -> int:
    """Number of messages on all topics."""
    return sum(info.message_count for info in topics.values())


def _counted(replayed: Iterable[Step], advance: Callable[[int], None]) -> Iterator[Step]:
    for count, step in enumerate(replayed, start=1):
        if count % 1000 == 0:
            advance(1000)
        yield step


def _written(replayed: Iterable[Step], topics: Topics, writer: BagWriter) -> Iterator[Step]:
    names = {name: getattr(topics, name) for name in topics._fields}
    answered = {ESTIMATE_TYPE: names['estimate'], FEEDFORWARD_TYPE: names['feedforward']}
    for step in replayed:
        message = step.message
        used = message.topic in topics or message.type_name == CONFIGURATION_TYPE
        if used and message.type_name not in answered:
            log_time = writer.write(*message)
            for type_name, data in step.answers:
                writer.write(answered[type_name] or ANSWER_TOPICS[type_name], type_name, log_time, data)
        yield step


def _compare(replayed: Iterable[Step], topics: Topics) -> Verdict:
    """Recorded answers against new ones, in order.

    A recorded estimate answers the velocity sample before it, and an estimate without one differs. A recording may stop
    between a message and its answer, as one that was cut off does, so an answer to its last message may be missing.
    """
    velocities = 0
    cut = False
    compared = {ESTIMATE_TYPE: topics.estimate, FEEDFORWARD_TYPE: topics.feedforward}
    streams = {type_name: Stream(type_name) for type_name, topic in compared.items() if topic}
    for message, answers in replayed:
        velocities += message.topic == topics.velocity
        for type_name, data in answers:
            if type_name in streams:
                streams[type_name].wait(data)
        if message.topic and message.topic == compared.get(message.type_name):
            streams[message.type_name].take(message.data)
        cut = bool(answers) or message.type_name == ESTIMATE_TYPE
    return verdict_of(velocities, streams, is_cut=cut)
