"""Replay of a bag through the estimator, without ROS graph or clock: byte for byte the answers of the live node."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.estimation.configuration import (
    ALGORITHM_VERSION,
    Configuration,
    Recorded,
    SealSelection,
    Snapshot,
    first_snapshot,
    parse_snapshot,
    snapshot_text,
    snapshot_version,
)
from seal_friction_ros.core.estimation.estimator import DEFAULT_ADAPTATION, EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.messages import (
    CONFIGURATION_TYPE,
    DECODERS,
    ESTIMATE_TYPE,
    decode_text,
    encode_text,
)
from seal_friction_ros.core.estimation.pipeline import answered, init
from seal_friction_ros.core.estimation.records import NEVER
from seal_friction_ros.files import default_configuration, load_configuration, load_parameter_file, with_seal
from seal_friction_ros.offline.bags.bag import (
    CONFIGURATION_TOPIC,
    STATE_PERIOD,
    STATE_TYPE,
    BagError,
    BagMessage,
    BagWriter,
    TopicInfo,
    bag_topics,
    read_messages,
)
from seal_friction_ros.offline.bags.topics import ANSWER_TOPICS, RECORDED, Topics, find_topics
from seal_friction_ros.offline.replay.answer_comparison import AnswerStream, ReplayResult, replay_result
from seal_friction_ros.offline.replay.machine_replay import is_machine_bag, replay_machine
from seal_friction_ros.offline.work.progress import progress


def chosen_configuration(params: Path | None, seal: str | Path | None) -> Configuration | None:
    """Configuration from a ROS parameter file and a seal file for all seals; None if neither is given.

    Raises:
        ValueError: A file cannot be read, or a value is invalid.
    """
    if params is None and seal is None:
        return None
    selection, feedforward, adaptation = SealSelection(), FeedForwardSettings(), DEFAULT_ADAPTATION
    settings = EstimatorSettings(
        stamp_age_max=0.0
    )  # [s] off: stamps of a bag that was played are older than its receipt
    if params:
        selection, settings, feedforward, adaptation = load_parameter_file(params)
    if seal:
        selection = with_seal(selection, str(seal))
    return load_configuration(selection, settings, feedforward, adaptation)


class Step(NamedTuple):
    """One message, and the answers of the estimator to it."""

    message: BagMessage
    answers: tuple[tuple[str, bytes], ...]  # message type and bytes of each answer


def steps(messages: Iterable[BagMessage], topics: Topics, override: Configuration | None) -> Iterator[Step]:
    """Each message in order, with the serialised answers of the estimator to it.

    The estimator uses ``override``, or else the newest configuration in the bag, or else the default configuration. The
    configuration messages that are returned hold the configuration used: ``override`` replaces recorded ones, and if
    the bag has none, one is inserted at the start. They are marked as replayed, with the settings that acted. Every
    `STATE_PERIOD` there is the state, too, in place of those in the bag.

    Raises:
        BagError: A message does not match its type.
    """
    configuration = override or default_configuration()
    parameters = configuration.parameters()
    state = init(parameters)
    inputs, tells_sending = topics.inputs, False
    if not topics.configuration:
        data = encode_text(snapshot_text(first_snapshot(configuration)._replace(recorded=Recorded(None))))
        yield Step(BagMessage(CONFIGURATION_TOPIC, CONFIGURATION_TYPE, 0, data), ())
    newest, due = NEVER, NEVER  # [ns] log time of the message before, and of the next state
    for message in messages:
        if message.topic == topics.state:
            continue
        if due <= message.log_time > newest:  # of messages of one time none is before a state and another after it
            if due != NEVER:
                data = encode_text(snapshot_text(Snapshot(configuration, state)))
                yield Step(BagMessage(topics.state, STATE_TYPE, message.log_time, data), ())
            due = message.log_time + round(STATE_PERIOD * 1e9)
        newest = message.log_time
        answers: list[tuple[str, bytes]] = []
        used = message if tells_sending else message._replace(publish_time=message.log_time)
        try:
            if message.topic in inputs:
                record = DECODERS[message.type_name](message.data)
                state, answers = answered(parameters, state, record, message.log_time, used.publish_time)
            elif message.topic == topics.configuration:
                snapshot = parse_snapshot(DECODERS[CONFIGURATION_TYPE](message.data))
                state, tells_sending = snapshot.state, snapshot.configuration.tells_sending
                recorded = snapshot.recorded or Recorded(snapshot.configuration.feedforward)
                if override:
                    snapshot = Snapshot(override, state)
                else:
                    configuration = snapshot.configuration
                    parameters = configuration.parameters()
                used = message._replace(data=encode_text(snapshot_text(snapshot._replace(recorded=recorded))))
        except ValueError as error:
            raise BagError(f'message on {message.topic} at {message.log_time} ns: {error}') from None
        yield Step(used, tuple(answers))


def replay(
    bag: Path, override: Configuration | None = None, out: Path | None = None, namespace: str = ''
) -> ReplayResult:
    """Replay a bag and compare the answers with the recorded ones; with ``out``, write inputs and answers as a new bag.

    The new bag keeps the recorded feed-forward, which acted on the axis, on a topic whose name ends with `RECORDED`.

    Args:
        bag: The bag.
        override: Configuration instead of the recorded one.
        out: Bag to write.
        namespace: Use only topics below it.

    Raises:
        BagError: The bag cannot be read, or ``out`` exists already; then nothing is left at ``out``.
    """
    known = bag_topics(bag)
    if is_machine_bag(bag, known):
        return replay_machine(bag, out)
    topics = find_topics(bag, namespace, known)
    total = count_messages(known)
    with progress(f'replay {bag.name}', total) as advance:
        replayed = _counted(steps(read_messages(bag), topics, override), advance)
        if out is None:
            return _compare(replayed, topics)
        with BagWriter(out) as writer:
            acted = topics.feedforward + RECORDED
            kept = acted if acted in known or _is_replayed(bag, topics) else topics.feedforward
            return _compare(_written(replayed, topics, writer, kept), topics)


def count_messages(topics: Mapping[str, TopicInfo]) -> int:
    """Number of messages on all topics."""
    return sum(info.message_count for info in topics.values())


def _counted(replayed: Iterable[Step], advance: Callable[[int], None]) -> Iterator[Step]:
    for count, step in enumerate(replayed, start=1):
        if count % 1000 == 0:
            advance(1000)
        yield step


def _is_replayed(bag: Path, topics: Topics) -> bool:
    """Whether the answers in a bag are replayed, so that they did not act."""
    texts = (message.data for message in read_messages(bag) if message.topic == topics.configuration)
    first = next(texts, None) if topics.configuration else None
    return first is not None and parse_snapshot(decode_text(first)).recorded is not None


def _of_this_version(message: BagMessage) -> BagMessage:
    """A message of the new bag: its configuration is of the version that makes the answers."""
    if message.type_name != CONFIGURATION_TYPE:
        return message
    snapshot = parse_snapshot(decode_text(message.data))._replace(version=ALGORITHM_VERSION)
    return message._replace(data=encode_text(snapshot_text(snapshot)))


def _written(replayed: Iterable[Step], topics: Topics, writer: BagWriter, acted: str) -> Iterator[Step]:
    """Write inputs, configuration and new answers, and the recorded feed-forward on the topic ``acted``."""
    answered, kept = topics.answers, topics.feedforward + RECORDED
    for step in replayed:
        message = step.message
        is_used = message.topic in (*topics, topics.state) or message.type_name == CONFIGURATION_TYPE
        if is_used and message.type_name not in answered:
            log_time = writer.write(*_of_this_version(message))
            for type_name, data in step.answers:
                writer.write(answered[type_name] or ANSWER_TOPICS[type_name], type_name, log_time, data)
        elif message.topic == acted:
            writer.write(*message._replace(topic=kept))
        yield step


def _compare(replayed: Iterable[Step], topics: Topics) -> ReplayResult:
    """Compare recorded and replayed answers in order.

    A recorded estimate answers the velocity sample before it; an estimate without one is a difference. A recording may
    stop between a message and its answer, so the answer to its last message may be missing.
    """
    velocities, is_cut, compared = 0, False, topics.answers
    versions: set[int] = set()
    streams = {type_name: AnswerStream(type_name) for type_name, topic in compared.items() if topic}
    for message, answers in replayed:
        velocities += message.topic == topics.velocity
        if message.type_name == CONFIGURATION_TYPE and message.topic == topics.configuration:
            versions.add(snapshot_version(decode_text(message.data)))
        for type_name, data in answers:
            if type_name in streams:
                streams[type_name].add_replayed(data)
        if message.topic and message.topic == compared.get(message.type_name):
            streams[message.type_name].compare_recorded(message.data)
        is_cut = bool(answers) or message.type_name == ESTIMATE_TYPE
    return replay_result(velocities, streams, versions, is_cut=is_cut)
