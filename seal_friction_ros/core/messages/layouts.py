"""The messages of this project, each field once: names by the record, kinds by its row in `LAYOUTS`.

From these rows follow the definitions (`DEFINITIONS`), the formats of the live coder (`coder`), and the offsets of the
coders of many messages (`blocks`, `compiled_coder`).

Message layouts: ``msg_defs/msg``.
"""

import struct
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages import records
from seal_friction_ros.core.messages.cdr import ORIGIN, laid_out, struct_at
from seal_friction_ros.core.messages.definitions import PRIMITIVES, Definition, Field, short_name

PACKAGE = 'seal_friction_msgs'
PRESSURE_TYPE = f'{PACKAGE}/msg/CylinderPressure'
VELOCITY_TYPE = f'{PACKAGE}/msg/RodVelocity'
FORCE_TYPE = f'{PACKAGE}/msg/ForceSum'
POSITION_TYPE = f'{PACKAGE}/msg/RodPosition'
REFERENCE_TYPE = f'{PACKAGE}/msg/ServoReference'
ESTIMATE_TYPE = f'{PACKAGE}/msg/FrictionEstimate'
FEEDFORWARD_TYPE = f'{PACKAGE}/msg/FrictionFeedForward'
TICK_TYPE = f'{PACKAGE}/msg/WatchdogTick'
CONFIGURATION_TYPE = f'{PACKAGE}/msg/EstimatorConfiguration'
MACHINE_TYPE = f'{PACKAGE}/msg/MachineFriction'
TEMPERATURE_TYPE = 'sensor_msgs/msg/Temperature'
CLOCK_TYPE = 'rosgraph_msgs/msg/Clock'
NEWEST_TYPE = 'std_msgs/msg/UInt8MultiArray'
NUMBER_TYPE, NUMBERS_TYPE = 'std_msgs/msg/Float64', 'std_msgs/msg/Float64MultiArray'
JOINTS_TYPE, WRENCH_TYPE = 'sensor_msgs/msg/JointState', 'geometry_msgs/msg/WrenchStamped'

CLOCK_TOPIC = '/clock'  # Simulated time, an input of nodes with ``use_sim_time``.

INPUTS: dict[str, str] = {
    'cylinder_pressure': PRESSURE_TYPE,
    'force_sum': FORCE_TYPE,
    'servo_reference': REFERENCE_TYPE,
    'rod_position': POSITION_TYPE,
    'seal_temperature': TEMPERATURE_TYPE,
    'rod_velocity': VELOCITY_TYPE,
}
"""Topic that the estimator subscribes to -> message type. The position is only recorded."""

OUTPUTS: dict[str, str] = {'friction_estimate': ESTIMATE_TYPE, 'friction_feedforward': FEEDFORWARD_TYPE}
"""Topic that the estimator publishes -> message type."""

LONGEST_FRAME = 1024  # [bytes] our choice; a longer frame name is not valid
SECOND = 1_000_000_000  # [ns]

Check = Callable[[Any], object]  # Raises ValueError for a record that is not valid.


class Layout(NamedTuple):
    """A message with a header: stamp and frame name, then numbers, the first of them a float64."""

    message_type: str
    record: type  # named tuple: the stamp [ns], the numbers in the order of the message, and for some the frame name
    codes: str  # type of each number as of `struct`: d float64, I uint32, B uint8, b int8
    check: Check | None = None
    older_numbers: tuple[int, ...] = ()  # how many numbers the message had before it grew, most first

    @property
    def keeps_frame(self) -> bool:
        """Whether the record has the frame name."""
        return 'frame_id' in self.record.__annotations__

    @property
    def fields(self) -> tuple[str, ...]:
        """Name of each number."""
        return tuple(self.record.__annotations__)[1 : 1 + len(self.codes)]

    @property
    def offsets(self) -> tuple[int, ...]:
        """Distance of each number from the first one [bytes]."""
        places = laid_out(DEFINITIONS, self.message_type, (1,))[-len(self.codes) :]
        return tuple(place.offset - places[0].offset for place in places)

    @property
    def size(self) -> int:
        """Size of all numbers [bytes]."""
        return self.offsets[-1] + struct.calcsize(self.codes[-1])


LAYOUTS = (
    Layout(PRESSURE_TYPE, records.Pressure, 'dd'),
    Layout(FORCE_TYPE, records.Force, 'd'),
    Layout(VELOCITY_TYPE, records.Velocity, 'd'),
    Layout(POSITION_TYPE, records.Position, 'd'),
    Layout(REFERENCE_TYPE, records.ServoReference, 'ddd'),
    Layout(TEMPERATURE_TYPE, records.Temperature, 'dd'),
    Layout(TICK_TYPE, records.WatchdogTick, 'd'),
    Layout(ESTIMATE_TYPE, records.FrictionEstimate, 'ddddBbIdddddd', lambda found: FrictionState(found.state), (12, 8)),
    Layout(FEEDFORWARD_TYPE, records.FeedForward, 'ddI'),
)
LAYOUT_OF = {layout.message_type: layout for layout in LAYOUTS}

_ARRAY = {'layout': 'std_msgs/MultiArrayLayout'}
_OTHERS: dict[str, dict[str, str]] = {
    'builtin_interfaces/Time': {'sec': 'int32', 'nanosec': 'uint32'},
    'std_msgs/Header': {'stamp': 'builtin_interfaces/Time', 'frame_id': 'string'},
    'std_msgs/MultiArrayDimension': {'label': 'string', 'size': 'uint32', 'stride': 'uint32'},
    'std_msgs/MultiArrayLayout': {'dim': 'std_msgs/MultiArrayDimension[]', 'data_offset': 'uint32'},
    CLOCK_TYPE: {'clock': 'builtin_interfaces/Time'},
    CONFIGURATION_TYPE: {'json': 'string'},
    NUMBER_TYPE: {'data': 'float64'},
    NUMBERS_TYPE: {**_ARRAY, 'data': 'float64[]'},
    NEWEST_TYPE: {**_ARRAY, 'data': 'uint8[]'},
    JOINTS_TYPE: {
        'header': 'std_msgs/Header', 'name': 'string[]', 'position': 'float64[]', 'velocity': 'float64[]',
        'effort': 'float64[]',
    },
    'geometry_msgs/Vector3': dict.fromkeys('xyz', 'float64'),
    'geometry_msgs/Wrench': dict.fromkeys(('force', 'torque'), 'geometry_msgs/Vector3'),
    WRENCH_TYPE: {'header': 'std_msgs/Header', 'wrench': 'geometry_msgs/Wrench'},
    MACHINE_TYPE: {
        'header': 'std_msgs/Header', 'estimated': 'string[]', 'estimates': f'{PACKAGE}/FrictionEstimate[]',
        'fed_forward': 'string[]', 'feedforwards': f'{PACKAGE}/FrictionFeedForward[]',
    },
}  # fmt: skip
_KINDS = {code: kind for kind, code in PRIMITIVES.items()}
_STAMPED = {
    layout.message_type: {
        'header': 'std_msgs/Header',
        **{name: _KINDS[code] for name, code in zip(layout.fields, layout.codes, strict=True)},
    }
    for layout in LAYOUTS
}
DEFINITIONS: Definition = {
    short_name(type_name): tuple(
        Field(name, kind.removesuffix('[]'), 'sequence' if kind.endswith('[]') else '') for name, kind in fields.items()
    )
    for type_name, fields in {**_OTHERS, **_STAMPED}.items()
}
"""Every message that this project writes, as `definitions.parse_definition` gives it."""

HEAD = len(laid_out(DEFINITIONS, 'std_msgs/Header', (1,)))
"""Number of what a stamped message begins with: encapsulation, seconds, nanoseconds, length of the frame name, name."""
_, SECONDS_AT, NANOSECONDS_AT, LENGTH_AT, FRAME_AT = (
    place.offset for place in laid_out(DEFINITIONS, 'std_msgs/Header', (1,))
)  # [bytes]


@compilable
def numbers_at(frame_length: Any) -> Any:
    """Offset [bytes] of the first number behind a frame name of ``frame_length`` bytes, its end included."""
    return ORIGIN + (FRAME_AT - ORIGIN + frame_length + 7) // 8 * 8


@lru_cache(maxsize=256)
def struct_of(type_name: str, *lengths: int, numbers: int | None = None) -> struct.Struct:
    """Format of a message of this project, its encapsulation first, then numbers, lengths and texts in their order.

    ``lengths`` are those of its texts (with their ends) and lists. After the frame name follow so many ``numbers``;
    None: all.
    """
    places = laid_out(DEFINITIONS, type_name, lengths)
    return struct_at(places if numbers is None else places[: HEAD + numbers])


GROWN = {
    layout.message_type: tuple(
        struct_of(layout.message_type, 1).size - struct_of(layout.message_type, 1, numbers=numbers).size
        for numbers in layout.older_numbers
    )
    for layout in LAYOUTS
}
"""By how many bytes each message is longer than it was, each time; what it had before is its beginning."""
