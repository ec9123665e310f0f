"""A bag through the estimator, with no ROS graph and no clock: the same messages give the same bytes as live."""

from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core import wire
from seal_friction_ros.core.configuration import (
    Configuration,
    SealSelection,
    Snapshot,
    first_snapshot,
    parse_snapshot,
    snapshot_text,
)
from seal_friction_ros.core.estimator import EstimatorSettings
from seal_friction_ros.core.feedforward import FeedForwardSettings
from seal_friction_ros.core.pipeline import encoded, init, receive
from seal_friction_ros.files import default_configuration, load_configuration, load_parameter_file
from seal_friction_ros.offline.bag import (
    CONFIGURATION_TOPIC,
    ESTIMATE_TOPIC,
    FEEDFORWARD_TOPIC,
    BagError,
    BagMessage,
    BagWriter,
    bag_topics,
    read_messages,
)
from seal_friction_ros.offline.progress import progress


class Topics(NamedTuple):
    """Names of the estimator's topics in a bag; an empty name where there is no such topic."""

    pressure: str
    velocity: str
    force: str
    reference: str
    position: str
    estimate: str
    feedforward: str
    configuration: str


_TYPES = Topics(
    wire.PRESSURE_TYPE,
    wire.VELOCITY_TYPE,
    wire.FORCE_TYPE,
    wire.REFERENCE_TYPE,
    wire.POSITION_TYPE,
    wire.ESTIMATE_TYPE,
    wire.FEEDFORWARD_TYPE,
    wire.CONFIGURATION_TYPE,
)
_DEFAULT_NAMES = {wire.ESTIMATE_TYPE: ESTIMATE_TOPIC, wire.FEEDFORWARD_TYPE: FEEDFORWARD_TOPIC}


def find_topics(bag: Path, namespace: str = '') -> Topics:
    """The estimator's topics in a bag, found by message type, so that names and remapping do not matter.

    Args:
        bag: The bag.
        namespace: Only topics below it are looked at; for bags of several actuators.

    Raises:
        BagError: There is no velocity, or a type has several topics.
    """
    names = []
    below = f'/{namespace.strip("/")}/'.replace('//', '/')
    topics = {topic: info for topic, info in bag_topics(bag).items() if topic.startswith(below)}
    for wanted in _TYPES:
        found = sorted(topic for topic, info in topics.items() if info.type_name == wanted and info.message_count)
        if len(found) > 1:
            raise BagError(f'{bag}: several topics of {wanted}: {", ".join(found)}: choose with --namespace')
        names.append(found[0] if found else '')
    result = Topics(*names)
    if not result.velocity:
        raise BagError(f'{bag}: no message of {wire.VELOCITY_TYPE} in it, so nothing to estimate from')
    return result


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
        data = wire.encode_text(snapshot_text(first_snapshot(configuration)))
        yield Step(BagMessage(CONFIGURATION_TOPIC, wire.CONFIGURATION_TYPE, 0, data), ())
    for message in messages:
        answers: tuple[tuple[str, bytes], ...] = ()
        used = message
        try:
            if message.topic in inputs:
                state, answer = receive(parameters, state, wire.DECODERS[message.type_name](message.data))
                answers = tuple(encoded(answer))
            elif message.topic == topics.configuration:
                configuration, state = parse_snapshot(wire.decode_text(message.data))
                if override:
                    used = message._replace(data=wire.encode_text(snapshot_text(Snapshot(override, state))))
                else:
                    parameters = configuration.parameters()
        except ValueError as error:
            raise BagError(f'message on {message.topic} at {message.log_time} ns: {error}') from None
        yield Step(used, answers)


@dataclass(frozen=True)
class Verdict:
    """What a replay found."""

    velocity_samples: int
    recorded_estimates: int
    recorded_feedforwards: int
    differing: int
    """estimates and feed-forwards whose bytes differ from the recorded ones, missing and surplus ones included"""
    first_difference: str
    """in words; empty if there is none"""

    @property
    def identical(self) -> bool:
        """Whether all that was recorded was reproduced to the byte, and there was an estimate."""
        return self.recorded_estimates > 0 and not self.differing


def replay(bag: Path, override: Configuration | None = None, out: Path | None = None, namespace: str = '') -> Verdict:
    """Replay a bag; compare with the estimates it holds; with ``out``, write inputs and new estimates as a new bag.

    Raises:
        BagError: The bag cannot be read, or ``out`` exists already. Nothing is left at ``out`` then.
    """
    topics = find_topics(bag, namespace)
    if out is None:
        return _compare(_with_progress(bag, topics, override), topics)
    with BagWriter(out) as writer:
        return _compare(_written(_with_progress(bag, topics, override), topics, writer), topics)


def _with_progress(bag: Path, topics: Topics, override: Configuration | None) -> Iterator[Step]:
    total = sum(info.message_count for info in bag_topics(bag).values())
    with progress(f'replay {bag.name}', total) as advance:
        for count, step in enumerate(steps(read_messages(bag), topics, override), start=1):
            if count % 1000 == 0:
                advance(1000)
            yield step


def _written(replayed: Iterable[Step], topics: Topics, writer: BagWriter) -> Iterator[Step]:
    names = {name: getattr(topics, name) for name in topics._fields}
    answered = {wire.ESTIMATE_TYPE: names['estimate'], wire.FEEDFORWARD_TYPE: names['feedforward']}
    for step in replayed:
        message = step.message
        used = message.topic in topics or message.type_name == wire.CONFIGURATION_TYPE
        if used and message.type_name not in answered:
            log_time = writer.write(*message)
            for type_name, data in step.answers:
                writer.write(answered[type_name] or _DEFAULT_NAMES[type_name], type_name, log_time, data)
        yield step


def _compare(replayed: Iterable[Step], topics: Topics) -> Verdict:
    """Recorded answers against new ones, in order.

    A recorded estimate answers the velocity sample before it, and an estimate without one differs. A recording may stop
    between a message and its answer, as one that was cut off does, so an answer to its last message may be missing.
    """
    velocities = 0
    cut = False
    compared = {wire.ESTIMATE_TYPE: topics.estimate, wire.FEEDFORWARD_TYPE: topics.feedforward}
    streams = {type_name: _Stream() for type_name, topic in compared.items() if topic}
    for message, answers in replayed:
        velocities += message.topic == topics.velocity
        for type_name, data in answers:
            if type_name in streams:
                streams[type_name].pending.append(data)
        if message.topic and message.topic == compared.get(message.type_name):
            streams[message.type_name].take(message)
        cut = bool(answers) or message.type_name == wire.ESTIMATE_TYPE
    for type_name, stream in streams.items():
        stream.finish(type_name, may_lack=int(cut))
    recorded = Counter({type_name: stream.recorded for type_name, stream in streams.items()})
    return Verdict(
        velocities,
        recorded[wire.ESTIMATE_TYPE],
        recorded[wire.FEEDFORWARD_TYPE],
        sum(stream.differing for stream in streams.values()),
        next((stream.first for stream in streams.values() if stream.first), ''),
    )


class _Stream:
    """Recorded messages of one topic against the new ones that wait for them."""

    def __init__(self) -> None:
        self.pending: deque[bytes] = deque()
        self.recorded = self.differing = 0
        self.first = ''

    def take(self, message: BagMessage) -> None:
        """Compare one recorded message."""
        self.recorded += 1
        pending, name = self.pending, f'{_kind(message.type_name)} {self.recorded}'
        while message.data in islice(pending, 1, None) and message.data != pending[0]:  # some were not recorded
            pending.popleft()
            self._differs(f'{name}: the ones before it were not recorded')
        expected = pending.popleft() if pending else b''
        if expected != message.data:
            self._differs(_difference(name, message, expected))

    def finish(self, type_name: str, may_lack: int) -> None:
        """Count what was never recorded, if it is more than what may be missing."""
        if len(self.pending) > may_lack:
            words = f'{len(self.pending)} at the end have no recorded {_kind(type_name)}'
            self._differs(f'velocity samples: {words}', len(self.pending))

    def _differs(self, words: str, count: int = 1) -> None:
        self.differing += count
        self.first = self.first or words


def _kind(type_name: str) -> str:
    return {wire.ESTIMATE_TYPE: 'estimate', wire.FEEDFORWARD_TYPE: 'feed-forward'}[type_name]


def _difference(name: str, recorded: BagMessage, expected: bytes) -> str:
    if not expected:
        return f'{name}: recorded, but no velocity sample before it'
    decode = wire.DECODERS[recorded.type_name]
    try:
        was, now = decode(recorded.data), decode(expected)
    except ValueError as error:
        return f'{name}: {error}'
    fields = [f'{field} {a!r} -> {b!r}' for field, a, b in zip(was._fields, was, now, strict=True) if a != b]
    return f'{name} at {was.stamp} ns: recorded -> replayed: {", ".join(fields) or "frame or padding"}'
