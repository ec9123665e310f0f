"""The feed-forward as the message that a controller takes, as bytes.

Beside the message of this project, a command goes out as

- the effort of a joint in a ``sensor_msgs/JointState``,
- one number of a ``std_msgs/Float64MultiArray``, where all actuators with the same topic share one message,
- the force along x of a frame in a ``geometry_msgs/WrenchStamped``,
- a ``std_msgs/Float64``.

The second and the last have no stamp, so a controller cannot see how old such a command is.

A command is ``gain`` times the force: 1 for an effort [N], else units of the command per newton, for controllers that
take a position, a velocity or a valve command. A command is 0 exactly where the force is 0.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from seal_friction_ros.core.machine.machine import Machine, MachineState
from seal_friction_ros.core.machine.machine_file import MachineFile, Output
from seal_friction_ros.core.messages.coder import encode_efforts, encode_number, encode_numbers, encode_wrench
from seal_friction_ros.core.messages.definitions import short_name
from seal_friction_ros.core.messages.layouts import NUMBER_TYPE, NUMBERS_TYPE, WRENCH_TYPE

_NUMBER, _NUMBERS, _WRENCH = map(short_name, (NUMBER_TYPE, NUMBERS_TYPE, WRENCH_TYPE))


class Command(NamedTuple):
    """A message for a controller."""

    topic: str
    type_name: str  # ``package/Name``
    data: bytes


def commands(file: MachineFile, forces: Mapping[str, float], stamp: int) -> list[Command]:
    """Messages for the controllers, one for each topic, in order of the mapping file, stamped with ``stamp`` [ns].

    ``forces`` has the newest feed-forward of each actuator [N] by name; one that is not finite or not there counts as
    0, as does an element of an array that no actuator has.
    """
    topics: dict[str, list[tuple[Output, float]]] = {}
    for actuator in file.actuators:
        if actuator.output is not None:
            command = actuator.output.gain * forces.get(actuator.name, 0.0)
            part = actuator.output, command if math.isfinite(command) else 0.0
            topics.setdefault(actuator.output.topic, []).append(part)
    return [Command(topic, parts[0][0].type_name, _encoded(parts, stamp)) for topic, parts in topics.items()]


def due_commands(machine: Machine, state: MachineState, has_feedforward: bool, received: int) -> list[Command]:
    """Commands after a message that was received at a time [ns], if it made a feed-forward, or an actuator has failed.

    The command of an actuator that has failed is 0.
    """
    states = state.actuators
    if not has_feedforward and not any(known.fault for known in states):
        return []
    forces = {actuator.name: known.force for actuator, known in zip(machine.actuators, states, strict=True)}
    return commands(machine.file, forces, received + states[0].pipeline.clock_offset)


def check_outputs(file: MachineFile) -> None:
    """Check that actuators which share a topic have places of their own in one type; ValueError if not."""
    seen: dict[tuple[str, int, str], str] = {}
    types: dict[str, str] = {}
    for actuator in file.actuators:
        output = actuator.output
        if output is None:
            continue
        if types.setdefault(output.topic, output.type_name) != output.type_name:
            raise ValueError(f'{actuator.name}: output.type = {output.type_name}: {output.topic} has another type')
        place = output.topic, output.index, output.joint
        if place in seen:
            both = f'{actuator.name} and {seen[place]}'
            raise ValueError(f'{both} have the same place in {output.topic}: give another index or joint')
        seen[place] = actuator.name


def _encoded(parts: list[tuple[Output, float]], stamp: int) -> bytes:
    kind = parts[0][0].type_name
    if kind == _NUMBER:
        return encode_number(parts[0][1])
    if kind == _WRENCH:
        return encode_wrench(stamp, parts[0][0].frame, parts[0][1])
    if kind == _NUMBERS:
        values = [0.0] * (1 + max(output.index for output, _ in parts))
        for output, command in parts:
            values[output.index] = command
        return encode_numbers(values)
    return encode_efforts(stamp, [(output.joint, command) for output, command in parts])
