"""The mapping file of a machine: which message holds what, for each actuator, and where the force goes.

An example with every part; most machines need a third of it::

    name: crane
    topics:                                         # every topic that is named below, and its type
      /joint_states: sensor_msgs/msg/JointState
      /pressures: std_msgs/msg/Float64MultiArray
      /load_cell: geometry_msgs/msg/WrenchStamped
      /boom/reference: trajectory_msgs/msg/JointTrajectoryPoint
      /oil_temperature: sensor_msgs/msg/Temperature
    ambient_pressure: 1.013 bar                     # taken off what is absolute; or an input, as below
    answers: each                                   # two messages for each actuator; or together, one for all
    actuators:
      boom:
        seals: [ms28775_114@a, ms28775_114@b]       # as the parameter seals of friction_estimator
        bore: 40 mm                                 # or area_a
        rod: 22 mm                                  # or area_b
        inputs:                                     # TOPIC FIELD, or a mapping, or a number if it is constant
          velocity: /joint_states velocity[boom]
          position: /joint_states position[boom]    # for spring and load_over_position, or instead of a velocity
          pressure_a: {topic: /pressures, field: 'data[0]', unit: bar, absolute: true}
          pressure_b: {topic: /pressures, field: 'data[1]', unit: bar, gain: 1.0, offset: 0.0, absolute: true}
          reference_velocity: /boom/reference velocities[0]
          temperature: /oil_temperature             # of the seals; K, or degC of a sensor_msgs/Temperature
        force_sum:                                  # every axial force on the moving mass except seal friction
          pressures: true                           # p_a A_a - p_b A_b
          load_force: {topic: /load_cell, field: wrench.force.z, gain: -1.0}
          weight: {mass: 80 kg, angle: 90 deg}      # angle of the rod above the horizontal; or an input
          spring: {stiffness: 200 N/m, rest_position: 0.1 m}
          load_over_position: {positions: [0.0, 0.5], forces: [900.0, 1200.0]}  # as identify finds it
                                                    # without a load: load: none, or load: unknown
        output: {topic: /boom/effort, type: sensor_msgs/msg/JointState, joint: boom, gain: 1.0}
        parameters: {feedforward: {scale: 0.8}}     # of friction_estimator, for this actuator

A value is in SI, or a text with its unit. Signs are those of this project: velocity and force positive on extension,
chamber a extends the rod; ``gain: -1.0`` inverts.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.node_options import ADAPTATION_PREFIX, FEEDFORWARD_PREFIX
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.parameters import ParameterGroup, check_names, from_mapping, printable
from seal_friction_ros.core.foundation.units import QUANTITIES, ZEROS, in_si, unit_meant
from seal_friction_ros.core.machine.differentiator import Differentiator, chosen_differentiator
from seal_friction_ros.core.messages.definitions import short_name
from seal_friction_ros.core.messages.layouts import INPUTS as OWN_TOPICS

FLUID_PRESSURE = 'sensor_msgs/FluidPressure'  # absolute by its definition
TEMPERATURE = 'sensor_msgs/Temperature'  # in degC by its definition
STANDARD_ATMOSPHERE = 101_325.0  # [Pa] ISO 2533, at sea level
VELOCITY_NOISE = 5e-4  # [m/s] of a velocity from position: half of stick_velocity; our choice
MOST_ACTUATORS = 64
LARGEST_BORE = 3.0  # [m] no cylinder is as wide; our choice

INPUTS = {
    'velocity': 'velocity',
    'position': 'length',
    'pressure_a': 'pressure',
    'pressure_b': 'pressure',
    'pressure_difference': 'pressure',
    'reference_position': 'length',
    'reference_velocity': 'velocity',
    'reference_acceleration': 'acceleration',
    'temperature': 'temperature',
}
"""Input of an actuator -> its quantity, which gives its units."""

ONLY_FIELDS = {
    FLUID_PRESSURE: 'fluid_pressure',
    TEMPERATURE: 'temperature',
    'std_msgs/Float64': 'data',
    'std_msgs/Float32': 'data',
    'seal_friction_msgs/RodVelocity': 'velocity',
    'seal_friction_msgs/RodPosition': 'position',
    'seal_friction_msgs/ForceSum': 'force',
}
"""Type -> the field that is meant where none is named."""


@dataclass(frozen=True)
class Signal:
    """One number of a message: ``gain`` times the number plus ``offset``, in SI."""

    topic: str
    field: str
    gain: float = 1.0  # with the size of the unit
    offset: float = 0.0  # [SI]
    absolute: bool = False  # a pressure from which the ambient pressure is taken off


Source = Signal | float  # Where a value comes from: a message, or it is constant [SI].


@dataclass(frozen=True)
class Weight:
    """Weight along the rod: -m g sin(angle), with the angle of the rod above the horizontal, positive upwards."""

    mass: float  # [kg]
    angle: Source  # [rad]


@dataclass(frozen=True)
class Spring:
    """Force -k (x - x0) on the rod."""

    stiffness: float  # [N/m]
    rest_position: float  # [m]


@dataclass(frozen=True)
class LoadTable:
    """Load over position, positive if it pushes the rod in, straight between its points; not known beyond them.

    ValueError: the positions do not increase, or there are not as many forces.
    """

    positions: tuple[float, ...]  # [m]
    forces: tuple[float, ...]  # [N]

    def __post_init__(self) -> None:
        if len(self.positions) < 2 or len(self.positions) != len(self.forces):
            counts = f'{len(self.positions)} positions and {len(self.forces)} forces'
            raise ValueError(f'load_over_position has {counts}: give two or more of both')
        if any(b <= a for a, b in zip(self.positions, self.positions[1:], strict=False)):
            raise ValueError('load_over_position.positions do not increase')


@dataclass(frozen=True)
class ForceSum:
    """Terms of the force sum; None: not there."""

    pressures: bool = False
    load_force: Source | None = None  # [N]
    weight: Weight | None = None
    spring: Spring | None = None
    load_over_position: LoadTable | None = None
    holds_unknown_load: bool = False  # whether no term tells the load, so that friction at rest is not known


@dataclass(frozen=True)
class Output:
    """Where a controller takes the force, besides the message of this project.

    The command is ``gain`` times the force: 1 for an effort [N]; for a controller of position, velocity or a valve the
    units of its command per newton.
    """

    topic: str
    type_name: str
    gain: float = 1.0
    index: int = 0  # in a Float64MultiArray
    joint: str = ''  # in a JointState
    frame: str = ''  # of a WrenchStamped


@dataclass(frozen=True)
class Actuator:
    """One actuator of a machine."""

    name: str
    selection: SealSelection
    inputs: Mapping[str, Source]  # see `INPUTS`; a constant one is a number
    area_a: float  # [m^2] of chamber a; 0.0 if not known
    area_b: float  # [m^2] of chamber b
    force_sum: ForceSum | None  # None: there is no force message, and friction at rest is not known
    differentiator: Differentiator | None  # that makes velocity from position
    output: Output | None
    settings: EstimatorSettings
    feedforward: FeedForwardSettings
    adaptation: AdaptationSettings

    def sources(self) -> dict[str, Source | None]:
        """Where each quantity of the actuator comes from, by its name."""
        sources: dict[str, Source | None] = dict(self.inputs)
        if self.force_sum is not None:
            weight = self.force_sum.weight
            sources |= {'load_force': self.force_sum.load_force, 'angle': weight.angle if weight else None}
        return sources

    def signals(self) -> dict[str, Signal]:
        """Every signal of the actuator by name of its quantity."""
        return {name: source for name, source in self.sources().items() if isinstance(source, Signal)}


class MachineFile(NamedTuple):
    """Contents of a mapping file."""

    name: str
    topics: Mapping[str, str]  # topic -> type, ``package/Name``
    ambient_pressure: Source  # [Pa, absolute]
    actuators: tuple[Actuator, ...]
    together: bool = False  # whether the answers to a message are one message
    document: Mapping[str, Any] | None = None  # the file as it was read; None: the built-in mapping, see `own_file`


# -- reading ----------------------------------------------------------------------------------------------------------

_TOPIC = re.compile(r'/[A-Za-z_]\w*(/[A-Za-z_]\w*)*')
_TYPE = re.compile(r'[a-z]\w*(/msg)?/[A-Z]\w*')
_NAME = re.compile(r'[a-z]\w*', re.IGNORECASE)
ANSWERS = ('each', 'together')
_OUTPUT_TYPES = (
    'std_msgs/Float64MultiArray', 'sensor_msgs/JointState', 'geometry_msgs/WrenchStamped', 'std_msgs/Float64',
)  # fmt: skip
_OUTPUT_NAMES = {'joint': 'sensor_msgs/JointState', 'frame': 'geometry_msgs/WrenchStamped'}
"""Key of an output -> the type that needs it; no other type has it."""
_GROUPS = (
    ParameterGroup(EstimatorSettings),
    ParameterGroup(FeedForwardSettings, FEEDFORWARD_PREFIX),
    ParameterGroup(AdaptationSettings, ADAPTATION_PREFIX),
)
_ACTUATOR = (
    'seals', 'bore', 'rod', 'area_a', 'area_b', 'inputs', 'velocity_from_position', 'force_sum', 'output', 'parameters',
)  # fmt: skip
_FORCE_SUM = ('pressures', 'load_force', 'weight', 'spring', 'load_over_position', 'load')


def parse_machine(document: Any, where: str) -> MachineFile:
    """Mapping file from its YAML document; ``where`` names it in error messages.

    ValueError, which names file, actuator and key: a value is missing, unknown or invalid.
    """
    _check_names(document, ('name', 'topics', 'ambient_pressure', 'answers', 'actuators'), where)
    answers = document.get('answers', ANSWERS[0])
    if answers not in ANSWERS:
        raise ValueError(f'{where}: answers = {printable(str(answers))!r}: one of {", ".join(ANSWERS)}')
    name = _text(document, 'name', where)
    topics = {}
    for topic, kind in _mapping(document, 'topics', where).items():
        if not isinstance(topic, str) or not _TOPIC.fullmatch(topic):
            raise ValueError(f'{where}: topics: {printable(topic)!r} is not a topic: write it as /pressures')
        if not isinstance(kind, str) or not _TYPE.fullmatch(kind):
            given = f'{where}: topics.{topic} = {printable(kind)!r}'
            raise ValueError(f'{given} is not a type: write it as sensor_msgs/msg/JointState')
        topics[topic] = short_name(kind)
    given = document.get('ambient_pressure', STANDARD_ATMOSPHERE)
    ambient = _source(given, 'pressure', topics, f'{where}: ambient_pressure')
    if isinstance(ambient, float) and not 3e4 <= ambient <= 1.2e5:
        raise ValueError(f'{where}: ambient_pressure = {ambient:g} Pa is not between 3e4 and 1.2e5 Pa')
    if isinstance(ambient, Signal):
        ambient = replace(ambient, absolute=False)
    entries = _mapping(document, 'actuators', where)
    if not 1 <= len(entries) <= MOST_ACTUATORS:
        raise ValueError(f'{where}: actuators has {len(entries)} entries: give 1 to {MOST_ACTUATORS}')
    actuators = tuple(_actuator(key, value, topics, where) for key, value in entries.items())
    return MachineFile(name, topics, ambient, actuators, answers == ANSWERS[1], document)


def own_file(selection: SealSelection) -> MachineFile:
    """The built-in mapping: one actuator without a name, whose messages are the records of this project."""
    settings = EstimatorSettings(), FeedForwardSettings(), AdaptationSettings()
    return MachineFile('', OWN_TOPICS, 0.0, (Actuator('', selection, {}, 0.0, 0.0, None, None, None, *settings),))


def check_mapping(document: Any, where: str) -> None:
    """Check that a document is a mapping; ValueError if it is not."""
    if not isinstance(document, Mapping):
        raise ValueError(f'{where} is not a mapping of names to values but {printable(document)[:60]!r}')


def _mapping(document: Mapping[Any, Any], key: str, where: str) -> Mapping[Any, Any]:
    if key not in document:
        raise ValueError(f'{where} lacks {key}')
    value = document[key]
    check_mapping(value, f'{where}: {key}')
    return dict(value)


def _text(document: Mapping[Any, Any], key: str, where: str) -> str:
    value = document.get(key)
    if not isinstance(value, str) or not value or not value.isprintable():
        raise ValueError(f'{where}: {key} = {value!r} is not one line of text')
    return value


def _number(value: Any, quantity: str, where: str, *, is_difference: bool = False) -> float:
    """Finite number in SI, or with a unit of its quantity."""
    number = in_si(value, QUANTITIES[quantity][0], where, is_difference=is_difference)
    if not abs(number) < 1e15:
        raise ValueError(f'{where} = {number!r} is not a finite number below 1e15')
    return float(number)


def _positive(value: Any, quantity: str, where: str) -> float:
    number = _number(value, quantity, where)
    if number <= 0.0:
        raise ValueError(f'{where} = {value!r} is not above 0')
    return number


def _source(value: Any, quantity: str, topics: Mapping[str, str], where: str) -> Source:
    """A constant, or a signal: ``TOPIC FIELD`` or a mapping."""
    if isinstance(value, str) and value.startswith('/'):
        words = value.split(maxsplit=1)
        value = dict(zip(('topic', 'field'), words, strict=False))
    if not isinstance(value, Mapping):
        return _number(value, quantity, where)
    check_names(value, ('topic', 'field', 'unit', 'gain', 'offset', 'absolute'), where)
    topic: Any = value.get('topic')
    if not isinstance(topic, str) or topic not in topics:
        known = ', '.join(topics) or 'none'
        raise ValueError(f'{where}: topic {printable(topic)!r} is not among topics: {known}: add it with its type')
    kind = topics[topic]
    field: Any = value.get('field', ONLY_FIELDS.get(kind))
    if not isinstance(field, str):
        raise ValueError(f'{where}: name the field of {kind}, as {topic} FIELD')
    unit: Any = value.get('unit', 'degC' if kind == TEMPERATURE else QUANTITIES[quantity][0])
    size = in_si(f'1 {unit}', QUANTITIES[quantity][0], where, is_difference=True)
    gain = _number(value.get('gain', 1.0), 'number', f'{where}.gain')
    if gain == 0.0:
        raise ValueError(f'{where}.gain = 0: a constant is written as a number')
    absolute = value.get('absolute', kind == FLUID_PRESSURE and quantity == 'pressure')
    if not isinstance(absolute, bool) or (absolute and quantity != 'pressure'):
        raise ValueError(f'{where}.absolute = {absolute!r}: true or false, for a pressure')
    offset = _number(value.get('offset', 0.0), quantity, f'{where}.offset', is_difference=True) + ZEROS.get(unit, 0.0)
    return Signal(topic, field, gain * size, offset, absolute)


def _actuator(name: Any, document: Any, topics: Mapping[str, str], file: str) -> Actuator:
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ValueError(f'{file}: actuators: {printable(name)!r} is not a name of letters, digits and _')
    where = f'{file}: {name}'
    _check_names(document, _ACTUATOR, where)
    given = _mapping(document, 'inputs', where)
    check_names(given, tuple(INPUTS), f'{where}: inputs')
    inputs = {key: _source(value, INPUTS[key], topics, f'{where}: inputs.{key}') for key, value in given.items()}
    area_a, area_b = _areas(document, where)
    force_sum = None
    if 'force_sum' in document:
        force_sum = _force_sum(document['force_sum'], topics, f'{where}: force_sum')
    made = _settings(document.get('parameters', {}), f'{where}: parameters')
    actuator = Actuator(
        name=name,
        selection=from_mapping(SealSelection, {'seals': document.get('seals')}, where),
        inputs=inputs,
        area_a=area_a,
        area_b=area_b,
        force_sum=force_sum,
        differentiator=_differentiator(document, inputs, where),
        output=_output(document['output'], f'{where}: output') if 'output' in document else None,
        settings=made[EstimatorSettings],
        feedforward=made[FeedForwardSettings],
        adaptation=made[AdaptationSettings],
    )
    _check_actuator(actuator, where)
    return actuator


def _areas(document: Mapping[str, Any], where: str) -> tuple[float, float]:
    """Areas of both chambers [m^2]; 0.0 where nothing is given."""
    if 'bore' in document or 'rod' in document:
        if 'area_a' in document or 'area_b' in document:
            raise ValueError(f'{where}: give bore and rod, or area_a and area_b')
        missing = [key for key in ('bore', 'rod') if key not in document]
        if missing:
            raise ValueError(f'{where} lacks {missing[0]}')
        bore, rod = (_positive(document[key], 'length', f'{where}: {key}') for key in ('bore', 'rod'))
        if bore > LARGEST_BORE:
            hint = unit_meant(bore, 'm', LARGEST_BORE)
            raise ValueError(f'{where}: bore = {bore:g} m is above {LARGEST_BORE:g} m{hint}')
        if rod >= bore:
            raise ValueError(f'{where}: rod = {rod:g} m is not below bore = {bore:g} m')
        return circle(bore), circle(bore) - circle(rod)
    given = (key for key in ('area_a', 'area_b') if key in document)
    areas = {key: _positive(document[key], 'area', f'{where}: {key}') for key in given}
    return areas.get('area_a', 0.0), areas.get('area_b', 0.0)


def circle(diameter: float) -> float:
    """Area of a circle [m^2] from its diameter [m]."""
    return 0.7853981633974483 * diameter * diameter


def _force_sum(document: Any, topics: Mapping[str, str], where: str) -> ForceSum:
    _check_names(document, _FORCE_SUM, where)
    pressures, load = document.get('pressures', False), document.get('load', 'unknown')
    if not isinstance(pressures, bool):
        raise ValueError(f'{where}.pressures = {pressures!r} is not true or false')
    if load not in ('none', 'unknown'):
        raise ValueError(f'{where}.load = {load!r} is not none or unknown')
    load_force = None
    if 'load_force' in document:
        load_force = _source(document['load_force'], 'force', topics, f'{where}.load_force')
    weight = _weight(document['weight'], topics, f'{where}.weight') if 'weight' in document else None
    spring = _spring(document['spring'], f'{where}.spring') if 'spring' in document else None
    table = None
    if 'load_over_position' in document:
        table = from_mapping(LoadTable, document['load_over_position'], f'{where}.load_over_position')
    if load_force is not None and load == 'none':
        raise ValueError(f'{where}: load = none and load_force contradict each other: leave one out')
    told = load_force is not None or weight is not None or table is not None or load == 'none'
    if not told and not pressures and spring is None:
        raise ValueError(f'{where} is empty: it has {", ".join(_FORCE_SUM)}')
    return ForceSum(pressures, load_force, weight, spring, table, not told)


def _weight(document: Any, topics: Mapping[str, str], where: str) -> Weight:
    _check_keys(document, ('mass', 'angle'), where)
    mass = _positive(document['mass'], 'mass', f'{where}.mass')
    return Weight(mass, _source(document['angle'], 'angle', topics, f'{where}.angle'))


def _spring(document: Any, where: str) -> Spring:
    _check_keys(document, ('stiffness', 'rest_position'), where)
    stiffness = _positive(document['stiffness'], 'stiffness', f'{where}.stiffness')
    return Spring(stiffness, _number(document['rest_position'], 'length', f'{where}.rest_position'))


def _check_names(document: Any, names: Collection[str], where: str) -> None:
    check_mapping(document, where)
    check_names(document, names, where)


def _check_keys(document: Any, keys: tuple[str, ...], where: str) -> None:
    _check_names(document, keys, where)
    missing = [key for key in keys if key not in document]
    if missing:
        raise ValueError(f'{where} lacks {", ".join(missing)}')


def _differentiator(document: Mapping[str, Any], inputs: Mapping[str, Source], where: str) -> Differentiator | None:
    place = f'{where}: velocity_from_position'
    if 'velocity' in inputs:
        if 'velocity_from_position' in document:
            raise ValueError(f'{place}: there is a velocity among the inputs: leave one out')
        return None
    if not isinstance(inputs.get('position'), Signal):
        raise ValueError(f'{where}: inputs lacks velocity, or position with velocity_from_position')
    values = document.get('velocity_from_position')
    if values is None:
        raise ValueError(f'{where} lacks velocity_from_position: {{step: 5 um, rate: 500 Hz}}, of the encoder')
    _check_names(values, ('step', 'rate', 'noise'), place)
    step = _number(values.get('step'), 'length', f'{place}.step')
    rate = _positive(values.get('rate'), 'frequency', f'{place}.rate')
    noise = _positive(values.get('noise', VELOCITY_NOISE), 'velocity', f'{place}.noise')
    if step < 0.0 or not 1.0 <= rate <= 1e5:
        raise ValueError(f'{place}: step = {step:g} m is not 0 or more, or rate = {rate:g} Hz not within 1 to 1e5')
    with named_errors(place):
        return chosen_differentiator(step, rate, noise)


def _output(document: Any, where: str) -> Output:
    _check_names(document, ('topic', 'type', 'gain', 'index', *_OUTPUT_NAMES), where)
    topic, kind = _text(document, 'topic', where), short_name(_text(document, 'type', where))
    if not _TOPIC.fullmatch(topic):
        raise ValueError(f'{where}.topic = {topic!r} is not a topic: write it as /boom/effort')
    if kind not in _OUTPUT_TYPES:
        raise ValueError(f'{where}.type = {kind!r} is not one of {", ".join(_OUTPUT_TYPES)}')
    index = document.get('index', 0)
    if type(index) is not int or not 0 <= index < 256 or (index and kind != 'std_msgs/Float64MultiArray'):
        raise ValueError(f'{where}.index = {index!r} is not 0 to 255, for a Float64MultiArray')
    names = {key: document.get(key, '') for key in _OUTPUT_NAMES}
    for key, name in names.items():
        if not isinstance(name, str) or not name.isprintable() or bool(name) != (kind == _OUTPUT_NAMES[key]):
            told = f'name the {key} of a {_OUTPUT_NAMES[key].partition("/")[2]}, and of no other type'
            raise ValueError(f'{where}.{key} = {name!r}: {told}')
    gain = _number(document.get('gain', 1.0), 'number', f'{where}.gain')
    return Output(topic=topic, type_name=kind, gain=gain, index=index, **names)


def _settings(document: Any, where: str) -> dict[type, Any]:
    check_mapping(document, where)
    values = _flat(document)
    check_names(values, [name for group in _GROUPS for name in group.names()], where)
    made: dict[type, Any] = {}
    for group in _GROUPS:
        given = {field: values[name] for name, field in group.names().items() if name in values}
        made[group.record_type] = from_mapping(group.record_type, given, where)
    return made


def _flat(values: Mapping[Any, Any], above: str = '') -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f'{above}{name}.') if isinstance(value, Mapping) else {f'{above}{name}': value}
    return flat


def _check_actuator(actuator: Actuator, where: str) -> None:
    inputs = actuator.inputs
    _check_pressures(actuator, where)
    for key in ('velocity', 'reference_velocity', 'reference_position', 'temperature'):
        if isinstance(inputs.get(key), float):
            raise ValueError(f'{where}: inputs.{key} is constant: name a topic and a field')
    if 'reference_acceleration' in inputs and 'reference_velocity' not in inputs:
        raise ValueError(f'{where}: inputs lacks reference_velocity, but has reference_acceleration')
    if actuator.force_sum is not None:
        _check_force_sum(actuator, actuator.force_sum, where)


def _check_pressures(actuator: Actuator, where: str) -> None:
    inputs = actuator.inputs
    both, difference = {'pressure_a', 'pressure_b'} & set(inputs), 'pressure_difference' in inputs
    if difference and both:
        raise ValueError(f'{where}: inputs has pressure_difference and {sorted(both)[0]}: leave one out')
    if not difference and len(both) < 2:
        missing = sorted({'pressure_a', 'pressure_b'} - both)[0]
        raise ValueError(f'{where}: inputs lacks {missing}; write {missing}: 0.0 for a chamber that is open')
    on_chamber = sorted({'a', 'b'} & set(actuator.selection.seal_chambers))
    if difference and on_chamber:
        what = f'a seal sees chamber {on_chamber[0]}, which pressure_difference does not tell'
        raise ValueError(f'{where}: {what}: give pressure_a and pressure_b')
    if not any(isinstance(inputs.get(key), Signal) for key in ('pressure_a', 'pressure_b', 'pressure_difference')):
        raise ValueError(f'{where}: inputs has no pressure that comes in a message')


def _check_force_sum(actuator: Actuator, force: ForceSum, where: str) -> None:
    needs_position = bool(force.spring or force.load_over_position)
    if force.pressures and not (actuator.area_a > 0.0 and actuator.area_b > 0.0):
        raise ValueError(f'{where}: force_sum.pressures needs the areas: give bore and rod, or area_a and area_b')
    if force.pressures and 'pressure_difference' in actuator.inputs and actuator.area_a != actuator.area_b:
        raise ValueError(f'{where}: force_sum.pressures with pressure_difference needs equal areas')
    if needs_position and not isinstance(actuator.inputs.get('position'), Signal):
        raise ValueError(f'{where}: inputs lacks position, which spring and load_over_position need')
    from_messages = [force.load_force, force.weight.angle if force.weight else None]
    if not (force.pressures or needs_position or any(isinstance(source, Signal) for source in from_messages)):
        raise ValueError(f'{where}: force_sum has no term that comes in a message')
