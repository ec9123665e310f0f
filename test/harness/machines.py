"""Machines for tests: mapping files, their definitions, and messages as rclpy writes them."""

import importlib
from collections.abc import Mapping
from typing import Any

import yaml
from rclpy.serialization import serialize_message

from seal_friction_ros.core.machine.machine import Machine, make_machine
from seal_friction_ros.core.machine.machine_file import MachineFile, parse_machine
from seal_friction_ros.core.messages.definitions import Definition, full_name, parse_definition
from seal_friction_ros.files import machine_configurations
from seal_friction_ros.offline.bags.bag import message_definition

BENCH = """
name: bench
topics: {/joint_states: sensor_msgs/msg/JointState, /p_a: sensor_msgs/msg/FluidPressure,
         /p_b: sensor_msgs/msg/FluidPressure, /load: geometry_msgs/msg/WrenchStamped}
actuators:
  axis:
    seals: [ms28775_114@a, ms28775_114@b, ms28775_114@difference]
    bore: 40 mm
    rod: 22 mm
    inputs: {velocity: '/joint_states velocity[axis]', position: '/joint_states position[axis]', pressure_a: /p_a,
             pressure_b: /p_b}
    force_sum: {pressures: true, load_force: {topic: /load, field: wrench.force.z, gain: -1.0}}
"""
EXCAVATOR = """
name: excavator
topics: {/joint_states: sensor_msgs/msg/JointState, /a: std_msgs/msg/Float64MultiArray,
         /b: std_msgs/msg/Float64MultiArray, /set: sensor_msgs/msg/JointState}
actuators:
""" + ''.join(
    f"""
  {name}:
    seals: [ms28775_114@a, ms28775_114@b]
    bore: 40 mm
    rod: 22 mm
    inputs:
      velocity: /joint_states velocity[{name}]
      reference_velocity: /set velocity[{name}]
      pressure_a: {{topic: /a, field: 'data[{i}]', unit: bar}}
      pressure_b: {{topic: /b, field: 'data[{i}]', unit: bar}}
    force_sum: {{pressures: true}}
    output: {{topic: /effort, type: std_msgs/msg/Float64MultiArray, index: {i}}}
    parameters: {{feedforward: {{scale: 0.8}}}}
"""
    for i, name in enumerate(('boom', 'arm', 'bucket'))
)


def message_class(type_name: str) -> Any:
    package, _, name = type_name.replace('/msg/', '/').partition('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


def installed(type_name: str) -> Definition:
    """Definition of an installed type."""
    return parse_definition(type_name, message_definition(full_name(type_name))[0])


def parsed(text: str, **changes: Any) -> MachineFile:
    """Mapping file from its text; ``changes`` of the first actuator, None removes a key."""
    document = yaml.safe_load(text)
    first = next(iter(document['actuators'].values()))
    for key, value in changes.items():
        first[key] = value
        if value is None:
            del first[key]
    return parse_machine(document, 'robot.yaml')


def made(text: str, **changes: Any) -> Machine:
    """Machine from the text of its mapping file."""
    file = parsed(text, **changes)
    definitions: Mapping[str, Definition] = {kind: installed(kind) for kind in file.topics.values()}
    return make_machine(file, machine_configurations(file, 'robot.yaml'), definitions)


def message(type_name: str, stamp: int | None = None, **fields: Any) -> bytes:
    """A message as rclpy writes it; ``a.b`` names a field of a field."""
    made = message_class(type_name)()
    if stamp is not None:
        made.header.stamp.sec, made.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
    for name, value in fields.items():
        *above, last = name.split('__')
        target = made
        for part in above:
            target = getattr(target, part)
        setattr(target, last, value)
    return serialize_message(made)
