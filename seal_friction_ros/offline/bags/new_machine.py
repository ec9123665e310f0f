"""A first mapping file from a bag or from topics: what was found, what was guessed, and what is missing, as comments.

All guesses are our choice: by types, by the names of topics and joints, and by the values.
"""

import json
import math
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from seal_friction_ros.core.machine.gauge_or_absolute import LOWEST_ABSOLUTE
from seal_friction_ros.core.machine.machine_file import FLUID_PRESSURE, ONLY_FIELDS
from seal_friction_ros.core.messages.definitions import Definition, number_paths, short_name
from seal_friction_ros.core.messages.fields import Reader, names_in
from seal_friction_ros.offline.bags.bag import BagError, bag_topics, read_definitions, read_messages
from seal_friction_ros.offline.work.targets import mark

MOST_MESSAGES = 5000  # of a topic that are looked at
MOST_CANDIDATES = 40  # numbers that are listed
JOINT_STATE, WRENCH = 'sensor_msgs/JointState', 'geometry_msgs/WrenchStamped'
ARRAY, NUMBER = 'std_msgs/Float64MultiArray', 'std_msgs/Float64'
KNOWN = (JOINT_STATE, FLUID_PRESSURE, WRENCH, ARRAY, NUMBER)
LARGEST_IN_BAR = 1000.0  # a number on a pressure topic that stays below it is in bar
_REFERENCE = re.compile(r'(set|ref|reference|desired|command|cmd|target|goal)', re.IGNORECASE)
_CHAMBER_B = re.compile(r'(_b|/b|2|rod|rod_side|annulus|retract)$', re.IGNORECASE)


@dataclass
class _Topic:
    """What the messages of a topic hold."""

    kind: str
    names: list[str] = field(default_factory=list)
    count: int = 0
    first: int = 0  # [ns] log time
    last: int = 0  # [ns]
    low: dict[str, float] = field(default_factory=dict)  # path -> lowest value
    high: dict[str, float] = field(default_factory=dict)
    step: dict[str, float] = field(default_factory=dict)  # smallest change
    previous: dict[str, float] = field(default_factory=dict)

    @property
    def rate(self) -> float:
        """Messages per second; 0.0 if unknown."""
        return (self.count - 1) / ((self.last - self.first) * 1e-9) if self.last > self.first else 0.0

    def moves(self, joint: str) -> bool:
        """Whether the position or the velocity of a joint changes."""
        return any(f'{quantity}[{joint}]' in self.step for quantity in ('position', 'velocity'))

    def take(self, path: str, value: float) -> None:
        """Take one value of a field; one that is not finite tells nothing."""
        if math.isfinite(value):
            self.low[path] = min(value, self.low.get(path, value))
            self.high[path] = max(value, self.high.get(path, value))
            change = abs(value - self.previous.get(path, value))
            if change > 0.0:
                self.step[path] = min(change, self.step.get(path, change))
            self.previous[path] = value


def new_machine(bag: Path, silent: Sequence[str] = ()) -> str:
    """Text of a mapping file for the machine in a bag; BagError if it cannot be read, or holds no joint.

    ``silent`` are topics and nodes that were there but sent nothing.
    """
    everything = _look(bag)
    found = {topic: one for topic, one in everything.items() if one.kind in KNOWN}
    joints = {topic: one for topic, one in found.items() if one.kind == JOINT_STATE and one.names}
    measured = {t: one for t, one in joints.items() if not _REFERENCE.search(t)} or joints
    if not measured:
        listed = ', '.join(f'{topic} ({info.type_name})' for topic, info in sorted(bag_topics(bag).items()))
        raise BagError(f'{bag}: no {JOINT_STATE} in it to take joints from; it has {listed or "nothing"}')
    lines = [
        f'# Mapping file, {mark("new")} robot from {_plain(bag.resolve().name)}. "guess": check it.',
        '# "missing": give it, or leave it out. docs/machines.md explains every key. Positive: extension.',
        f'name: {_plain(bag.resolve().name)}',
        'topics:',
    ]
    lines += [f'  {topic}: {one.kind.replace("/", "/msg/")}{_said(one)}' for topic, one in sorted(found.items())]
    lines += [f'  # missing: {what} is there but silent' for what in silent]
    lines += ['ambient_pressure: 101325.0  # [Pa] guess: sea level', 'actuators:']
    joints_of = {name: topic for topic, one in measured.items() for name in one.names}
    actuators = {name: topic for name, topic in joints_of.items() if measured[topic].moves(name)} or joints_of
    if still := [name for name in joints_of if name not in actuators]:
        lines.append(f'  # left out, since they never move in the bag: {", ".join(still)}')
    for number, (name, topic) in enumerate(actuators.items()):
        lines += _actuator(name, number, list(actuators), topic, found)
    return '\n'.join([*lines, *_candidates(everything, lines[lines.index('actuators:') :])]) + '\n'


def _candidates(found: dict[str, _Topic], lines: list[str]) -> list[str]:
    """Numbers that no input uses, as comments, if something is missing: topic, element, range."""
    if not any('missing' in line for line in lines):
        return []

    def is_used(topic: str, path: str) -> bool:
        of_topic = [line for line in lines if re.search(rf'{re.escape(topic)}(?![\w/])', line)]
        return any(path in line or found[topic].kind in ONLY_FIELDS for line in of_topic)

    rows = [
        f'#   {topic} {path}: {one.low[path]:.4g} to {one.high[path]:.4g}, {one.kind.replace("/", "/msg/")}'
        for topic, one in sorted(found.items())
        for path in one.low
        if not is_used(topic, path) and (one.low[path] or one.high[path])
    ]
    return ['# candidates, as TOPIC FIELD; their types go to topics:', *rows[:MOST_CANDIDATES]]


@contextmanager
def recorded_topics(seconds: float, wait: float) -> Iterator[tuple[Path, list[str]]]:
    """Bag with what the topics of the machine show for ``seconds`` [s], and what is silent.

    The bag is gone after the ``with`` block.

    Another process listens, so that this one needs no ROS. It waits ``wait`` [s] at most for the first message.
    BagError if ROS 2 is not installed, or no topic that can be an input has a message.
    """
    if find_spec('rclpy') is None:
        raise BagError('--from-topics needs ROS 2: source your distribution, or run make setup; or use --from-bag')
    types = [kind.replace('/', '/msg/') for kind in KNOWN]
    with TemporaryDirectory() as folder:
        bag = Path(folder) / 'robot'
        task = {'action': 'record', 'types': types, 'seconds': seconds, 'wait': wait, 'out': str(bag)}
        command = [sys.executable, '-m', 'seal_friction_ros.nodes.topic_tool', json.dumps(task)]
        recorder = subprocess.run(command, capture_output=True, text=True, check=False)
        if recorder.returncode:
            said = recorder.stderr.strip().splitlines() or ['the process that listens ended early']
            raise BagError(f'--from-topics: {said[-1].removeprefix("seal_friction topics: ")}')
        yield bag, [line for line in recorder.stdout.splitlines() if line]


def _look(bag: Path) -> dict[str, _Topic]:
    """Topics whose types are known or defined in the bag, and the values in them."""
    kinds = {topic: short_name(info.type_name) for topic, info in bag_topics(bag).items() if info.message_count}
    definitions: dict[str, Definition] = {}
    for kind in dict.fromkeys(kinds.values()):
        try:
            definitions |= read_definitions(bag, [kind])
        except BagError:  # of another type without a definition nothing can be told
            if kind in KNOWN:
                raise
    found = {topic: _Topic(kind) for topic, kind in kinds.items() if kind in definitions}
    readers: dict[str, Reader] = {}
    paths: dict[str, list[str]] = {}
    for message in read_messages(bag):
        one = found.get(message.topic)
        if one is None or one.count >= MOST_MESSAGES:
            continue
        if message.topic not in readers:
            one.first, one.names = message.log_time, names_in(definitions[one.kind], one.kind, message.data)
            paths[message.topic] = _paths(definitions[one.kind], one)
            readers[message.topic] = Reader(definitions[one.kind], one.kind, paths[message.topic])
        one.count, one.last = one.count + 1, message.log_time
        try:
            numbers = readers[message.topic].read(message.data).numbers
        except ValueError:  # one short message is no reason to see nothing
            continue
        for path, value in zip(paths[message.topic], numbers, strict=True):
            if value is not None:
                one.take(path, value)
    return {topic: one for topic, one in found.items() if one.count}


def _paths(definition: Definition, one: _Topic) -> list[str]:
    if one.kind == JOINT_STATE:
        usable = [name for name in one.names if name and not set(name) & set('[]')]
        return [f'{quantity}[{name}]' for quantity in ('position', 'velocity', 'effort') for name in usable]
    if one.kind == ARRAY:
        return [f'data[{i}]' for i in range(64)]
    return [path for path in number_paths(definition, one.kind) if not path.startswith('header.')]


def _said(one: _Topic) -> str:
    names = f'; {", ".join(one.names)}' if one.names else ''
    return f'  # {one.rate:.0f} Hz{names}' if one.rate else ''


def _plain(name: str) -> str:
    text = re.sub(r'\W', '_', name)
    return text if re.match(r'[A-Za-z]', text) else f'm_{text}'


def _actuator(name: str, number: int, names: list[str], topic: str, found: dict[str, _Topic]) -> list[str]:
    one = found[topic]
    lines = [
        f'  {_plain(name)}:',
        '    seals: [placeholder@a, placeholder@b]  # missing: your seal files, one entry a seal: NAME@CHAMBER',
        '    # bore: 40 mm  # missing',
        '    # rod: 22 mm  # missing',
        '    inputs:',
    ]
    motions = ('position', 'velocity')
    lines += [f'      {q}: {topic} {q}[{name}]' for q in motions if f'{q}[{name}]' in one.low]
    reference = [(t, o) for t, o in found.items() if o.kind == JOINT_STATE and name in o.names and t != topic]
    for where, other in reference[:1]:
        given = (q for q in motions if f'{q}[{name}]' in other.low)
        lines += [f'      reference_{q}: {where} {q}[{name}]  # guess: by the topic' for q in given]
    if not reference:
        lines.append('      # reference_velocity: /topic field  # missing: needed by tune and by the feed-forward')
    lines += _pressures(name, number, names, found)
    if f'velocity[{name}]' not in one.low:
        step = one.step.get(f'position[{name}]', 1e-6)
        text = f'{{step: {step:.3g} m, rate: {max(one.rate, 1.0):.0f} Hz}}'
        lines.append(f'    velocity_from_position: {text}  # guess: smallest change; noise: 5e-4 m/s unless given')
    return [*lines, *_load(name, names, found)]


def _pressures(name: str, number: int, names: list[str], found: dict[str, _Topic]) -> list[str]:
    sources = _pressure_sources(name, number, names, found)
    lowest = [found[source[0]].low.get(source[1], math.inf) for source in sources if source]
    is_gauge = min(lowest, default=math.inf) < LOWEST_ABSOLUTE  # sensors of one actuator are of one kind
    lines = []
    for key, source in zip(('pressure_a', 'pressure_b'), sources, strict=True):
        if source is None:
            lines.append(f'      {key}: 0.0  # missing: no topic found; constant 0 Pa, as for an open chamber')
            continue
        topic, path = source
        one, low, high = found[topic], found[topic].low.get(path, 0.0), found[topic].high.get(path, 0.0)
        values = f'{low:.4g} to {high:.4g}'
        if one.kind == FLUID_PRESSURE and not is_gauge:
            text = f'{topic}  # {values} Pa: absolute'
        elif one.kind == FLUID_PRESSURE:
            text = f'{{topic: {topic}, absolute: false}}  # {values} Pa; guess: gauge, by the lowest'
        else:
            unit = 'bar' if high < LARGEST_IN_BAR else 'Pa'
            text = f"{{topic: {topic}, field: '{path}', unit: {unit}}}"
            text += f'  # {values}; guess: the unit, gauge and the order of the array'
        lines.append(f'      {key}: {text}')
    return lines


def _pressure_sources(
    name: str, number: int, names: list[str], found: dict[str, _Topic]
) -> list[tuple[str, str] | None]:
    """Topic and field of the pressure of each chamber; None if nothing was found."""
    fluid = _of_actuator(name, names, FLUID_PRESSURE, found)
    if fluid:
        sides: list[tuple[str, str] | None] = [None, None]
        for topic in fluid:
            side = 1 if _CHAMBER_B.search(topic) else 0
            side = side if sides[side] is None else 1 - side
            sides[side] = topic, 'fluid_pressure'
        return sides
    arrays = [t for t, one in sorted(found.items()) if one.kind == ARRAY and 'pressure' in t.lower()]
    sizes = [len(found[topic].low) for topic in arrays]
    if len(arrays) == 2 and min(sizes) > number:
        arrays.sort(key=lambda topic: bool(_CHAMBER_B.search(topic)))
        return [(arrays[0], f'data[{number}]'), (arrays[1], f'data[{number}]')]
    if len(arrays) == 1 and sizes[0] > 2 * number + 1:
        return [(arrays[0], f'data[{2 * number}]'), (arrays[0], f'data[{2 * number + 1}]')]
    return [None, None]


def _of_actuator(name: str, names: list[str], kind: str, found: dict[str, _Topic]) -> list[str]:
    """Topics of a kind with the name of an actuator in theirs; of the only actuator all of them."""
    topics = [topic for topic, one in sorted(found.items()) if one.kind == kind]
    mine = [topic for topic in topics if name.lower() in topic.lower()]
    return mine or (topics if len(names) == 1 else [])


def _load(name: str, names: list[str], found: dict[str, _Topic]) -> list[str]:
    cells = _of_actuator(name, names, WRENCH, found)
    if not cells:
        return [
            '    # force_sum: {pressures: true}  # missing: bore, rod; add load_force, weight or load_over_position:',
            '    # without them friction at rest is unknown; Coulomb friction and feed-forward work',
        ]
    one = found[cells[0]]
    forces = {path: one.high[path] - one.low[path] for path in one.low if path.startswith('wrench.force')}
    axis = max(forces, key=forces.__getitem__, default='wrench.force.z')
    term = f'{{load_force: {{topic: {cells[0]}, field: {axis}, gain: -1.0}}}}'
    return [
        f'    force_sum: {term}  # guess: the axis that changes most, and the sign',
        '    # missing: pressures: true in force_sum, once bore and rod are given',
    ]
