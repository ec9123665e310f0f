"""A machine of several actuators: raw messages in, answers of each actuator out.

``state = init(machine)``, then ``receive(machine, state, plan, plan.read(data), received, emits)`` for the bytes of
every message, live and in replay alike. A message is read once, whatever it holds for whichever actuator. A message
of this project is a record of the estimator already (`record_plan`). What another message holds becomes records
(`records_of`), and those take the path of one actuator (`pipeline.receive`) in this order: temperature, pressure,
force, position, reference, velocity, since the velocity makes the estimate.

A record made from several messages has the stamp of the oldest of them, and is made when that stamp changes: so one
that stops makes the record old, which the estimator flags. A number that a message does not hold (another joint, an
empty list) is not taken, and its input gets old; a NaN is taken, and the estimator flags it. Messages without a stamp
are stamped on receipt.

An actuator whose arithmetic fails keeps its last state and says so in `ActuatorState.fault`; its command is 0. The
others go on.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.core.estimation.feedforward import newest_force
from seal_friction_ros.core.estimation.pipeline import (
    RECEIVERS,
    ZERO_CELSIUS,
    PipelineParameters,
    PipelineState,
    acting_since,
)
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.machine.differentiator import NO_WINDOW, Differentiator, Window, differentiate
from seal_friction_ros.core.machine.machine_file import Actuator, ForceSum, LoadTable, MachineFile, Signal
from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.core.messages.definitions import Definition
from seal_friction_ros.core.messages.fields import Reader
from seal_friction_ros.core.messages.records import (
    NEVER,
    Force,
    Input,
    Output,
    Position,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
)

GRAVITY = 9.80665  # [m/s^2] standard acceleration, ISO 80000-3
AMBIENT_TIMEOUT = 60.0  # [s] our choice: the weather changes the ambient pressure by less than 1 hPa in a minute
_BACKWARD_DIFFERENCE = Differentiator(2, 0.05, 0.0)  # of a reference position, which comes at 20 Hz or faster

QUANTITIES = (
    'velocity', 'position', 'pressure_a', 'pressure_b', 'pressure_difference', 'load_force', 'angle', 'ambient',
    'reference_position', 'reference_velocity', 'reference_acceleration', 'temperature',
)  # fmt: skip
"""What a message can hold for an actuator; the number of each is its place in `Memory`."""
_PLACE = {name: place for place, name in enumerate(QUANTITIES)}
_POSITION, _ANGLE, _AMBIENT = _PLACE['position'], _PLACE['angle'], _PLACE['ambient']
_LOAD_FORCE, _DIFFERENCE = _PLACE['load_force'], _PLACE['pressure_difference']
_A, _B = _PLACE['pressure_a'], _PLACE['pressure_b']
_TEMPERATURE = _PLACE['temperature']
_OLDER_QUANTITIES = _TEMPERATURE  # how many there were before the temperature
_REFERENCE = tuple(_PLACE[f'reference_{name}'] for name in ('position', 'velocity', 'acceleration'))

KEPT = (Pressure, Force)  # records that are kept for the next velocity, and no more

Emit = Callable[[str, Output, bytes], object]  # Takes an answer: name of the actuator, record, frame name.


class Wiring(NamedTuple):
    """Places in `QUANTITIES` of what makes each record of an actuator; empty for a record that is not made."""

    pressure: tuple[int, ...]
    force: tuple[int, ...]
    reference: int  # that makes a reference; -1: there is none
    velocity: int  # that makes a velocity: itself or the position
    forces: int  # what pressure and force sum are made of, as bits
    motions: int  # what position, reference and velocity are made of, as bits


@dataclass(frozen=True)
class MachineActuator:
    """One actuator, ready to run."""

    mapping: Actuator
    wiring: Wiring
    constants: tuple[float, ...]  # [SI] of each quantity that no message tells; NaN for others
    absolute: frozenset[int]  # pressures from which the ambient pressure is taken off
    configuration: Configuration
    pipeline: PipelineParameters

    @property
    def name(self) -> str:
        """Its name."""
        return self.mapping.name


class _Taken(NamedTuple):
    """A number of a message that an actuator takes."""

    number: int  # in `Reading.numbers`
    quantity: int
    gain: float
    offset: float


class TopicPlan(NamedTuple):
    """How the messages of a topic are read, and what of them goes where."""

    topic: str
    read: Callable[[bytes], Any]  # makes a `Reading`, or a record of the estimator; ValueError for other bytes
    taken: tuple[tuple[int, tuple[_Taken, ...]], ...]  # number of an actuator, what it takes; (): the record itself
    holds_records: bool = False  # whether a message is a record of the estimator


@dataclass(frozen=True)
class Machine:
    """All actuators, and the topics that they listen to."""

    file: MachineFile
    actuators: tuple[MachineActuator, ...]
    plans: Mapping[str, TopicPlan]  # topic -> plan


class Memory(NamedTuple):
    """What the newest messages held for an actuator."""

    values: tuple[float, ...]  # [SI] of each of `QUANTITIES`
    stamps: tuple[int, ...]  # [ns] of each; `NEVER` before the first
    pressure_stamp: int = NEVER  # of the last record
    force_stamp: int = NEVER
    window: Window = NO_WINDOW  # of the position
    reference_window: Window = NO_WINDOW


@dataclass(slots=True)
class ActuatorState:
    """What one message leaves for the next, of one actuator."""

    pipeline: PipelineState
    memory: Memory
    force: float = 0.0  # [N] newest feed-forward
    fault: str = ''  # why the actuator did not take its last message; empty: it did


class MachineState(NamedTuple):
    """What one message leaves for the next."""

    actuators: tuple[ActuatorState, ...]


# -- making -----------------------------------------------------------------------------------------------------------


def make_machine(
    file: MachineFile, configurations: Mapping[str, Configuration], definitions: Mapping[str, Definition]
) -> Machine:
    """Machine from its mapping file; ValueError, with topic and field, if a type is not known or has no such field.

    Configurations are by name of the actuator, definitions by type of the topic (``package/Name``); the built-in
    mapping uses none of these.
    """
    actuators = tuple(_actuator(mapping, file, configurations[mapping.name]) for mapping in file.actuators)
    if file.document is None:
        return Machine(file, actuators, {topic: record_plan(topic, kind, (0,)) for topic, kind in file.topics.items()})
    wanted: dict[str, list[tuple[int, int, Signal]]] = {}
    for number, mapping in enumerate(file.actuators):
        signals = mapping.signals()
        if isinstance(file.ambient_pressure, Signal) and actuators[number].absolute:
            signals['ambient'] = file.ambient_pressure
        for name, signal in signals.items():
            wanted.setdefault(signal.topic, []).append((number, _PLACE[name], signal))
    plans = {topic: _plan(topic, file.topics[topic], signals, definitions) for topic, signals in wanted.items()}
    return Machine(file, actuators, plans)


def record_plan(topic: str, kind: str, numbers: Iterable[int]) -> TopicPlan:
    """Plan of a topic whose messages are records of the estimator, for the actuators with these ``numbers``."""
    return TopicPlan(topic, DECODERS[kind], tuple((number, ()) for number in numbers), holds_records=True)


def _plan(
    topic: str, kind: str, wanted: list[tuple[int, int, Signal]], definitions: Mapping[str, Definition]
) -> TopicPlan:
    if kind not in definitions:
        raise ValueError(f'{topic}: the type {kind} is neither installed nor defined in the bag')
    paths = list(dict.fromkeys(signal.field for _, _, signal in wanted))
    with named_errors(topic):
        reader = Reader(definitions[kind], kind, paths)
    taken: dict[int, list[_Taken]] = {}
    for number, quantity, signal in wanted:
        entry = _Taken(paths.index(signal.field), quantity, signal.gain, signal.offset)
        taken.setdefault(number, []).append(entry)
    return TopicPlan(topic, reader.read, tuple((number, tuple(entries)) for number, entries in taken.items()))


def _actuator(mapping: Actuator, file: MachineFile, configuration: Configuration) -> MachineActuator:
    sources = {**mapping.sources(), 'ambient': file.ambient_pressure}
    constants = [math.nan] * len(QUANTITIES)
    for name, source in sources.items():
        if isinstance(source, float):
            constants[_PLACE[name]] = source
    if mapping.force_sum is not None and mapping.force_sum.holds_unknown_load:
        configuration = _with_load(configuration)
    signals = mapping.signals()
    absolute = frozenset(_PLACE[name] for name, signal in signals.items() if signal.absolute)
    wiring, parameters = _wiring(mapping, signals), configuration.parameters()
    return MachineActuator(mapping, wiring, tuple(constants), absolute, configuration, parameters)


def _wiring(mapping: Actuator, signals: Mapping[str, Signal]) -> Wiring:
    pressure = tuple(_PLACE[name] for name in signals if name.startswith('pressure'))
    force: set[int] = set()
    terms = mapping.force_sum
    if terms is not None:
        force |= {_PLACE[name] for name in ('load_force', 'angle') if name in signals}
        if terms.pressures:
            force |= set(pressure)
        if terms.spring or terms.load_over_position:
            force.add(_POSITION)
    reference = next((_PLACE[name] for name in ('reference_velocity', 'reference_position') if name in signals), -1)
    velocity = _PLACE['velocity' if 'velocity' in signals else 'position']
    forces, motions = {*pressure, *force}, {_POSITION, reference, velocity} - {-1}
    bits = (sum(1 << quantity for quantity in quantities) for quantities in (forces, motions))
    return Wiring(pressure, tuple(sorted(force)), reference, velocity, *bits)


def _with_load(configuration: Configuration) -> Configuration:
    """Configuration whose force sum holds a load that no signal tells, so that friction at rest is not known."""
    documents = tuple(
        {**document, 'force_sum_correction': {**document.get('force_sum_correction', {}), 'contains_load': True}}
        for document in configuration.seal_documents
    )
    return replace(configuration, seal_documents=documents)


def first_memory(actuator: MachineActuator) -> Memory:
    """Memory of an actuator before the first message."""
    return Memory(actuator.constants, (NEVER,) * len(QUANTITIES))


def init(machine: Machine) -> MachineState:
    """State before the first message."""
    first = (ActuatorState(pipeline.init(one.pipeline), first_memory(one)) for one in machine.actuators)
    return MachineState(tuple(first))


# -- running ----------------------------------------------------------------------------------------------------------


def receive(
    machine: Machine,
    state: MachineState,
    plan: TopicPlan,
    message: Any,
    received: int,
    emits: Sequence[pipeline.Emit],
    sent: int | None = None,
) -> None:
    """Take one message.

    Args:
        machine: From `make_machine`.
        state: From `init` or of the message before; it becomes the next state.
        plan: Of the topic of the message: one of ``machine.plans``, or `record_plan` of a tick or simulated time.
        message: As ``plan.read`` makes it.
        received: When it was received [ns], on the clock of `pipeline.receive`.
        emits: Called with the answers of each actuator, see `named_emits`.
        sent: When its publisher sent it [ns], as `pipeline.receive`.
    """
    for number, taken in plan.taken:
        actuator, known = machine.actuators[number], state.actuators[number]
        parameters, running = actuator.pipeline, known.pipeline
        since = acting_since(parameters.feedforward, received, received if sent is None else sent)
        if type(message) in KEPT:  # two of three messages: nothing in them can fail half-way
            RECEIVERS[type(message)](parameters, running, message, received, since, pipeline.no_answer)
            continue
        memory, made, kept = known.memory, running.feedforward, running.kept()  # all or nothing
        records: Sequence[Input] = (message,)
        try:
            if taken:
                stamp = message.stamp
                if stamp is None:
                    stamp = stamp_of(running, received, since)
                memory, records = records_of(actuator, memory, taken, message.numbers, stamp, message.frame_id)
            for record in records:
                RECEIVERS[type(record)](parameters, running, record, received, since, emits[number])
        except (ArithmeticError, ValueError) as error:
            running.restore(kept)
            known.force, known.fault = 0.0, f'{plan.topic}: {type(error).__name__}: {error}'
            continue
        except BaseException:  # an answer could not be sent
            running.restore(kept)
            raise
        known.memory, known.fault = memory, ''
        if running.feedforward is not made:
            known.force = newest_force(running.feedforward)


def named_emits(machine: Machine, emit: Emit) -> list[pipeline.Emit]:
    """For `receive`: what calls ``emit`` with each answer of an actuator, its name first."""
    return [partial(emit, actuator.name) for actuator in machine.actuators]


def stamp_of(known: PipelineState, received: int, since: int) -> int:
    """Stamp [ns] of a message that has none: when it was sent, if it came in time; ``since`` as of `acting_since`."""
    return (received if since == NEVER else since) + known.clock_offset


def due(state: MachineState, now: int) -> list[int]:
    """Numbers of the actuators on which the watchdog must act, see `pipeline.is_tick_due`."""
    return [number for number, known in enumerate(state.actuators) if pipeline.is_tick_due(known.pipeline, now)]


def memory_document(memory: Memory) -> dict[str, Any]:
    """Memory for JSON, to the bit: numbers that are not whole are hexadecimal, NaN included."""
    return {
        'values': [value.hex() for value in memory.values],
        'stamps': list(memory.stamps),
        'pressure_stamp': memory.pressure_stamp,
        'force_stamp': memory.force_stamp,
        'windows': [
            [list(window.stamps), [position.hex() for position in window.positions]]
            for window in (memory.window, memory.reference_window)
        ],
    }


def parse_memory(document: Any) -> Memory:
    """Memory from its document: inverse of `memory_document`; ValueError if it is not such a document."""
    try:
        given = [(document['stamps'], document['values']), *document['windows']]
        (stamps, values), *parts = ((tuple(map(int, one)), tuple(map(float.fromhex, other))) for one, other in given)
        if len(values) == len(stamps) == _OLDER_QUANTITIES:  # of a bag from before there was a temperature
            values, stamps = (*values, math.nan), (*stamps, NEVER)
        windows = [Window(*part) for part in parts]
        memory = Memory(values, stamps, int(document['pressure_stamp']), int(document['force_stamp']), *windows)
    except (TypeError, LookupError, AttributeError, OverflowError) as error:
        raise ValueError(f'memory of an actuator: {type(error).__name__}: {error}') from None
    lengths = {len(memory.values), len(memory.stamps)}
    if lengths != {len(QUANTITIES)} or any(len(w.stamps) != len(w.positions) for w in windows):
        raise ValueError(f'memory of an actuator: not {len(QUANTITIES)} values and stamps')
    return memory


def missing(machine: Machine, number: int, topic: str, data: bytes) -> list[str]:
    """What a message on a topic of ``machine.plans`` does not hold that an actuator wants, for example a joint.

    One text each. Raises ValueError if it does not match its type.
    """
    plan = machine.plans[topic]
    wanted = [entry.number for taker, entries in plan.taken if taker == number for entry in entries]
    if not wanted:
        return []
    reading = plan.read(data)
    without = [place for place, value in enumerate(reading.numbers) if value is None]
    texts = dict(zip(without, reading.missing, strict=True))
    return list(dict.fromkeys(texts[place] for place in wanted if place in texts))


def records_of(
    actuator: MachineActuator,
    memory: Memory,
    taken: tuple[_Taken, ...],
    numbers: tuple[float | None, ...],
    stamp: int,
    frame_id: bytes,
) -> tuple[Memory, list[Input]]:
    """Records that one message makes for an actuator, in the order in which the estimator takes them; the next memory.

    Of the ``numbers`` of the message, None where it does not hold one, the actuator takes what is ``taken``. ``stamp``
    [ns] and ``frame_id`` are those of the message.
    """
    given_values, given_stamps, pressure_stamp, force_stamp, window, reference_window = memory
    values, stamps, changed = list(given_values), list(given_stamps), 0
    for number, quantity, gain, offset in taken:
        given = numbers[number]
        if given is not None:
            values[quantity] = gain * given + offset
            stamps[quantity] = stamp
            changed |= 1 << quantity
    records: list[Input] = []
    if changed >> _TEMPERATURE & 1:
        records.append(Temperature(stamp, values[_TEMPERATURE] - ZERO_CELSIUS))
    if changed & actuator.wiring.forces:
        pressure_stamp, force_stamp = _add_forces(actuator, values, stamps, pressure_stamp, force_stamp, records)
    if changed & actuator.wiring.motions:
        windows = window, reference_window
        window, reference_window = _add_motion(actuator, values, windows, changed, stamp, frame_id, records)
    return Memory(tuple(values), tuple(stamps), pressure_stamp, force_stamp, window, reference_window), records


def _add_forces(
    actuator: MachineActuator,
    values: list[float],
    stamps: list[int],
    pressure_stamp: int,
    force_stamp: int,
    records: list[Input],
) -> tuple[int, int]:
    """Append pressure and force sum, each if the oldest of its parts has a new stamp; returns these stamps."""
    wiring, terms = actuator.wiring, actuator.mapping.force_sum
    stamp, other = stamps[wiring.pressure[0]], stamps[wiring.pressure[-1]]  # one place or two; `min` takes longer
    oldest = stamp if stamp < other else other
    oldest_of_force = force_stamp
    if terms is not None:
        alike = wiring.force == wiring.pressure
        oldest_of_force = oldest if alike else min(map(stamps.__getitem__, wiring.force))
    if oldest == pressure_stamp and oldest_of_force == force_stamp:
        return pressure_stamp, force_stamp
    pressure = _pressures(actuator, values, stamps)
    if pressure is not None and oldest != pressure_stamp:
        pressure_stamp = oldest
        records.append(Pressure(oldest, *pressure))
    if terms is not None and oldest_of_force != force_stamp and (pressure is not None or not terms.pressures):
        force_stamp = oldest_of_force
        records.append(Force(force_stamp, force_sum(terms, actuator.mapping, values, pressure or (0.0, 0.0))))
    return pressure_stamp, force_stamp


def _add_motion(
    actuator: MachineActuator,
    values: list[float],
    windows: tuple[Window, Window],
    changed: int,
    stamp: int,
    frame_id: bytes,
    records: list[Input],
) -> tuple[Window, Window]:
    """Append position, reference and velocity; returns the next windows of position and reference."""
    wiring, differentiator = actuator.wiring, actuator.mapping.differentiator
    window, reference_window = windows
    if changed >> _POSITION & 1:
        records.append(Position(stamp, values[_POSITION]))
    if wiring.reference >= 0 and changed >> wiring.reference & 1:
        reference_window, reference = _reference(wiring, values, reference_window, stamp, frame_id)
        records += [] if reference is None else [reference]
    if changed >> wiring.velocity & 1:
        velocity: float | None = values[wiring.velocity]
        if differentiator is not None:
            window, velocity = differentiate(differentiator, window, stamp, values[_POSITION])
        if velocity is not None:
            records.append(Velocity(stamp, velocity, frame_id))
    return window, reference_window


def _pressures(actuator: MachineActuator, values: list[float], stamps: list[int]) -> tuple[float, float] | None:
    """Pressures of both chambers [Pa, gauge]; None while the ambient pressure is not known.

    A difference alone is shown as one chamber under pressure: the piston seal sees its magnitude, and with equal areas
    the force is the same.
    """
    ambient = 0.0
    if actuator.absolute:
        ambient, age = values[_AMBIENT], 0.0
        if stamps[_AMBIENT] != NEVER:
            age = (max([stamps[quantity] for quantity in actuator.absolute]) - stamps[_AMBIENT]) * 1e-9
        if math.isnan(ambient) or abs(age) > AMBIENT_TIMEOUT:
            return None
    if _DIFFERENCE in actuator.wiring.pressure:
        difference = values[_DIFFERENCE]
        return (0.0, -difference) if difference < 0.0 else (difference, 0.0)
    absolute = actuator.absolute
    return values[_A] - (ambient if _A in absolute else 0.0), values[_B] - (ambient if _B in absolute else 0.0)


def force_sum(terms: ForceSum, mapping: Actuator, values: list[float], pressure: tuple[float, float]) -> float:
    r"""Force sum [N], positive on extension, of the terms that are declared.

    .. math:: \Sigma F = p_a A_a - p_b A_b + F_{load} - m g \sin\alpha - k (x - x_0) - F_L(x)

    The areas are those of ``mapping``, ``values`` are of `QUANTITIES`, the pressures of both chambers in [Pa, gauge].
    """
    total = 0.0
    if terms.pressures:
        total += pressure[0] * mapping.area_a - pressure[1] * mapping.area_b
    if terms.load_force is not None:
        total += values[_LOAD_FORCE]
    if terms.weight is not None:
        angle = values[_ANGLE]
        total -= terms.weight.mass * GRAVITY * (math.sin(angle) if math.isfinite(angle) else math.nan)
    if terms.spring is not None:
        total -= terms.spring.stiffness * (values[_POSITION] - terms.spring.rest_position)
    if terms.load_over_position is not None:
        total -= load_at(terms.load_over_position, values[_POSITION])
    return total


def load_at(table: LoadTable, position: float) -> float:
    """Load [N] at a position [m], straight between the points; NaN beyond them, where nobody knows it."""
    places, forces = table.positions, table.forces
    if not places[0] <= position <= places[-1]:
        return math.nan
    right = min(bisect_right(places, position), len(places) - 1)
    share = (position - places[right - 1]) / (places[right] - places[right - 1])
    return forces[right - 1] + share * (forces[right] - forces[right - 1])


def _reference(
    wiring: Wiring, values: list[float], window: Window, stamp: int, frame_id: bytes
) -> tuple[Window, ServoReference | None]:
    """Reference of the newest values; without a velocity among them, that of the last two positions."""
    position, velocity, acceleration = (values[quantity] for quantity in _REFERENCE)
    if wiring.reference == _REFERENCE[0]:
        window, made = differentiate(_BACKWARD_DIFFERENCE, window, stamp, position)
        if made is None:
            return window, None
        velocity = made
    acceleration = 0.0 if math.isnan(acceleration) else acceleration
    return window, ServoReference(stamp, position, velocity, acceleration, frame_id)
