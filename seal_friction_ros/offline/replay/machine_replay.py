"""Replay of a bag of a machine: byte for byte the answers and commands of the live node, of every actuator."""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.estimation.messages import (
    CLOCK_TYPE,
    CONFIGURATION_TYPE,
    DECODERS,
    ESTIMATE_TYPE,
    FEEDFORWARD_TYPE,
    OUTPUTS,
    TICK_TYPE,
    Output,
    decode_text,
    encode,
    type_of,
)
from seal_friction_ros.core.machine.answers_together import MACHINE_TYPE, NamedAnswer, encode_together
from seal_friction_ros.core.machine.machine import Machine, MachineState, receive, receive_clock, receive_tick
from seal_friction_ros.core.machine.machine_snapshot import is_machine_text, machine_of_text, parse_machine_text
from seal_friction_ros.core.machine.message_fields import full_name
from seal_friction_ros.core.machine.outputs import due_commands
from seal_friction_ros.offline.bags.bag import BagError, BagMessage, BagWriter, TopicInfo, bag_topics, read_messages
from seal_friction_ros.offline.bags.definitions import read_definitions
from seal_friction_ros.offline.bags.topics import RECORDED
from seal_friction_ros.offline.replay.answer_comparison import AnswerStream, ReplayResult
from seal_friction_ros.offline.work.progress import progress

_TICK = 'watchdog_tick'


class Answer(NamedTuple):
    """One message that the machine makes."""

    topic: str
    type_name: str
    data: bytes


def is_machine_bag(bag: Path, known: Mapping[str, TopicInfo]) -> bool:
    """Whether the bag is of a machine.

    Args:
        bag: The bag.
        known: Its topics.

    Raises:
        BagError: The bag cannot be read.
    """
    if not any(info.type_name == CONFIGURATION_TYPE and info.message_count for info in known.values()):
        return False
    texts = (message.data for message in read_messages(bag) if message.type_name == CONFIGURATION_TYPE)
    first = next(texts, None)
    try:
        return first is not None and is_machine_text(decode_text(first))
    except ValueError:
        return False


class _Replayed:
    """The machine of a bag, and what it answers to each message.

    Args:
        bag: The bag.
        known: Its topics.
    """

    def __init__(self, bag: Path, known: Mapping[str, TopicInfo]) -> None:
        self._bag, self._known = bag, known
        self._machine: Machine | None = None
        self._state: MachineState | None = None
        self._number: dict[str, int] = {}  # topic of the watchdog -> actuator
        self.estimates = 0
        """made so far"""
        self.answers: dict[tuple[str, str], str] = {}
        """name of an actuator and message type -> topic"""

    def take(self, message: BagMessage) -> list[Answer]:
        """Answers to a message.

        Raises:
            BagError: The message does not match its type.
        """
        try:
            if message.type_name == CONFIGURATION_TYPE:
                self._configure(decode_text(message.data))
                return []
            return self._answers(message)
        except ValueError as error:
            where = f'{self._bag}: message on {message.topic} at {message.log_time} ns'
            raise BagError(f'{where}: {error}') from None

    def _configure(self, text: str) -> None:
        types = machine_of_text(text).topics.values()
        self._machine, self._state = parse_machine_text(text, read_definitions(self._bag, types))
        for actuator in self._machine.actuators:
            for topic, kind in OUTPUTS.items():
                self.answers[actuator.name, kind] = self._topic(f'/{actuator.name}/{topic}', kind)
        self.answers['', MACHINE_TYPE] = self._topic('/friction', MACHINE_TYPE)
        for number, actuator in enumerate(self._machine.actuators):
            self._number[self._topic(f'/{actuator.name}/{_TICK}', TICK_TYPE)] = number

    def _topic(self, end: str, kind: str) -> str:
        """Topic in the bag, whatever the namespace of the node was."""
        found = [topic for topic, info in self._known.items() if info.type_name == kind and topic.endswith(end)]
        return found[0] if found else end

    def _sent(self, message: BagMessage) -> int:
        """When a message was sent [ns]: at its receipt where the bag does not tell."""
        is_told = self._machine is not None and self._machine.actuators[0].configuration.tells_sending
        return message.log_time if message.publish_time is None or not is_told else message.publish_time

    def _answers(self, message: BagMessage) -> list[Answer]:
        machine, state = self._machine, self._state
        if machine is None or state is None:
            return []
        sent: list[NamedAnswer] = []

        def collect(name: str, answer: Output, frame_id: bytes) -> None:
            sent.append(NamedAnswer(name, answer, frame_id))

        if message.topic in machine.plans:
            try:
                state = receive(
                    machine, state, message.topic, message.data, message.log_time, collect, self._sent(message)
                )
            except ValueError:
                return []  # as the node: it counts the message as malformed
        elif message.type_name == CLOCK_TYPE:
            clock = DECODERS[CLOCK_TYPE](message.data)
            state = receive_clock(machine, state, clock, message.log_time, self._sent(message))
        elif message.topic in self._number:
            tick = DECODERS[TICK_TYPE](message.data)
            state = receive_tick(machine, state, self._number[message.topic], tick, message.log_time, collect)
        else:
            return []
        self._state = state
        if machine.file.together:
            answers = [Answer(self.answers['', MACHINE_TYPE], MACHINE_TYPE, encode_together(sent))] if sent else []
        else:
            answers = [
                Answer(self.answers[name, type_of(record)], type_of(record), encode(record, frame_id))
                for name, record, frame_id in sent
            ]
        guided = any(type_of(answer.record) == FEEDFORWARD_TYPE for answer in sent)
        self.estimates += sum(type_of(answer.record) == ESTIMATE_TYPE for answer in sent)
        commands = due_commands(machine, state, guided, message.log_time)
        return answers + [Answer(command.topic, full_name(command.type_name), command.data) for command in commands]


def replay_machine(bag: Path, out: Path | None = None) -> ReplayResult:
    """Replay the bag of a machine and compare the answers with the recorded ones.

    With ``out``, write inputs and answers as a new bag, the recorded feed-forward on topics that end with `RECORDED`.

    Args:
        bag: The bag.
        out: Bag to write.

    Raises:
        BagError: The bag cannot be read, or ``out`` exists already; then nothing is left at ``out``.
    """
    known = bag_topics(bag)
    replayed, streams = _Replayed(bag, known), dict[str, AnswerStream]()
    is_cut = False
    total = sum(info.message_count for info in known.values())
    with ExitStack() as stack:
        advance = stack.enter_context(progress(f'replay {bag.name}', total))
        writer = stack.enter_context(BagWriter(out)) if out is not None else None
        for count, message in enumerate(read_messages(bag), start=1):
            if count % 1000 == 0:
                advance(1000)
            made = replayed.take(message)
            for answer in made:
                stream = streams.setdefault(answer.topic, AnswerStream(answer.type_name))
                if answer.topic in known:
                    stream.add_replayed(answer.data)
            if message.topic in streams:
                streams[message.topic].compare_recorded(message.data)
            is_cut = bool(made) or message.topic in streams
            if writer is not None:
                for written in _written(message, made, streams):
                    writer.write(*written)
    return _result(replayed.estimates, streams, is_cut=is_cut)


def _written(message: BagMessage, made: list[Answer], streams: Mapping[str, AnswerStream]) -> Iterator[BagMessage]:
    """What the new bag has of a message and the answers to it."""
    if message.topic not in streams:
        yield message
    elif message.type_name == FEEDFORWARD_TYPE:
        yield message._replace(topic=message.topic + RECORDED)
    for answer in made:
        yield BagMessage(answer.topic, answer.type_name, message.log_time, answer.data)


def _result(estimates: int, streams: Mapping[str, AnswerStream], *, is_cut: bool) -> ReplayResult:
    for stream in streams.values():
        stream.finish(may_lack=int(is_cut))

    def recorded(kind: str) -> int:
        return sum(stream.recorded for stream in streams.values() if stream.type_name == kind)

    first = next((f'{topic}: {stream.first}' for topic, stream in streams.items() if stream.first), '')
    return ReplayResult(
        estimates,
        recorded(ESTIMATE_TYPE) + recorded(MACHINE_TYPE),
        recorded(FEEDFORWARD_TYPE),
        sum(stream.differing for stream in streams.values()),
        first,
    )
