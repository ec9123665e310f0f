"""A bag through the estimator, with no ROS graph and no clock: the same messages give the same bytes as live."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core import wire
from seal_friction_ros.core.configuration import Configuration, SealSelection, Snapshot, parse_snapshot, snapshot_text
from seal_friction_ros.core.estimator import EstimatorSettings, init, step
from seal_friction_ros.core.held_inputs import HeldInputs
from seal_friction_ros.core.wire import (
    decode_force,
    decode_pressure,
    decode_text,
    decode_velocity,
    encode_estimate,
    encode_text,
)
from seal_friction_ros.files import load_configuration, load_parameter_file
from seal_friction_ros.offline.bag import (
    CONFIGURATION_TOPIC,
    ESTIMATE_TOPIC,
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
    estimate: str
    configuration: str


_TYPES = Topics(wire.PRESSURE_TYPE, wire.VELOCITY_TYPE, wire.FORCE_TYPE, wire.ESTIMATE_TYPE, wire.CONFIGURATION_TYPE)


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
    selection, settings = load_parameter_file(params) if params else (SealSelection(), EstimatorSettings())
    if seal:
        selection = SealSelection((str(seal),) * len(selection.seals), selection.seal_chambers)
    return load_configuration(selection, settings)


def estimates(
    messages: Iterable[BagMessage], topics: Topics, override: Configuration | None
) -> Iterator[tuple[BagMessage, bytes]]:
    """Each message in order, with the serialised estimate it triggers; empty where it triggers none.

    The configuration is the newest one in the bag, or ``override``, or the default where there is neither. What was
    used comes out: configuration messages hold ``override`` where it is given, and there is one at the start if the
    bag has none.

    Raises:
        BagError: A message is not what its type says.
    """
    configuration = override or load_configuration(SealSelection(), EstimatorSettings())
    parameters = configuration.parameters()
    state, held = init(parameters), HeldInputs()
    if not topics.configuration:
        data = encode_text(snapshot_text(Snapshot(configuration, state, held)))
        yield BagMessage(CONFIGURATION_TOPIC, wire.CONFIGURATION_TYPE, 0, data), b''
    for message in messages:
        estimate_bytes, used = b'', message
        try:
            if message.topic == topics.velocity:
                velocity = decode_velocity(message.data)
                state, estimate = step(parameters, state, held.rod_sample(velocity.stamp, velocity.velocity))
                estimate_bytes = encode_estimate(estimate, velocity.frame_id)
            elif message.topic == topics.pressure:
                held = held._replace(pressure=decode_pressure(message.data))
            elif message.topic == topics.force:
                held = held._replace(force=decode_force(message.data))
            elif message.topic == topics.configuration:
                configuration, state, held = parse_snapshot(decode_text(message.data))
                if override:
                    data = encode_text(snapshot_text(Snapshot(override, state, held)))
                    used = message._replace(data=data)
                else:
                    parameters = configuration.parameters()
        except ValueError as error:
            raise BagError(f'message on {message.topic} at {message.log_time} ns: {error}') from None
        yield used, estimate_bytes


@dataclass(frozen=True)
class Verdict:
    """What a replay found."""

    velocity_samples: int
    recorded_estimates: int
    differing: int
    """estimates whose bytes differ from the recorded ones, missing and surplus ones included"""
    first_difference: str
    """in words; empty if there is none"""

    @property
    def identical(self) -> bool:
        """Whether every recorded estimate was reproduced to the byte, and there was one."""
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


def _with_progress(bag: Path, topics: Topics, override: Configuration | None) -> Iterator[tuple[BagMessage, bytes]]:
    total = sum(info.message_count for info in bag_topics(bag).values())
    with progress(f'replay {bag.name}', total) as advance:
        for count, pair in enumerate(estimates(read_messages(bag), topics, override), start=1):
            if count % 1000 == 0:
                advance(1000)
            yield pair


def _written(
    pairs: Iterable[tuple[BagMessage, bytes]], topics: Topics, writer: BagWriter
) -> Iterator[tuple[BagMessage, bytes]]:
    for message, estimate in pairs:
        used = message.topic in topics or message.type_name == wire.CONFIGURATION_TYPE
        if used and message.topic != topics.estimate:
            log_time = writer.write(*message)
            if estimate:
                writer.write(topics.estimate or ESTIMATE_TOPIC, wire.ESTIMATE_TYPE, log_time, estimate)
        yield message, estimate


def _compare(pairs: Iterable[tuple[BagMessage, bytes]], topics: Topics) -> Verdict:
    """Recorded estimates against new ones, in order.

    A recording may start between a velocity and its estimate or stop there, so a recorded estimate answers the
    velocity sample before it, and an estimate without one differs.
    """
    velocities = recorded = differing = 0
    first = ''
    pending: deque[bytes] = deque()
    for message, estimate in pairs:
        if estimate:
            velocities += 1
            if topics.estimate:
                pending.append(estimate)
        elif message.topic == topics.estimate:
            recorded += 1
            while message.data in islice(pending, 1, None) and message.data != pending[0]:  # some were not recorded
                pending.popleft()
                differing += 1
                first = first or f'estimate {recorded}: the ones before it were not recorded'
            expected = pending.popleft() if pending else b''
            if expected != message.data:
                differing += 1
                first = first or _difference(recorded, message.data, expected)
    if pending:
        differing += len(pending)
        first = first or f'{len(pending)} velocity samples at the end have no recorded estimate'
    return Verdict(velocities, recorded, differing, first)


def _difference(number: int, recorded: bytes, expected: bytes) -> str:
    if not expected:
        return f'estimate {number}: recorded, but no velocity sample before it'
    try:
        was, now = wire.decode_estimate(recorded), wire.decode_estimate(expected)
    except ValueError as error:
        return f'estimate {number}: {error}'
    fields = [f'{name} {a!r} -> {b!r}' for name, a, b in zip(was._fields, was, now, strict=True) if a != b]
    return f'estimate {number} at {was.stamp} ns: recorded -> replayed: {", ".join(fields) or "frame or padding"}'
