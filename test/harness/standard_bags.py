"""Bags with standard messages, written by rosbags from the signals in a bag of this project."""

from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer

from harness.foreign_messages import foreign_store
from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.layouts import INPUTS
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.offline.bags.bag import read_messages

AMBIENT = 100_000.0  # [Pa]
JOINT_STATE, FLUID = 'sensor_msgs/msg/JointState', 'sensor_msgs/msg/FluidPressure'
WRENCH = 'geometry_msgs/msg/WrenchStamped'
MAPPING = """\
name: bench
topics: {/joint_states: sensor_msgs/msg/JointState, /set: sensor_msgs/msg/JointState,
         /p_a: sensor_msgs/msg/FluidPressure, /p_b: sensor_msgs/msg/FluidPressure,
         /load: geometry_msgs/msg/WrenchStamped}
ambient_pressure: 1.0 bar
actuators:
  axis:
    seals: [ms28775_114@a, ms28775_114@b]
    inputs:
      velocity: /joint_states velocity[axis]
      position: /joint_states position[axis]
      pressure_a: /p_a
      pressure_b: /p_b
      reference_position: /set position[axis]
      reference_velocity: /set velocity[axis]
      reference_acceleration: /set effort[axis]
    force_sum: {load_force: {topic: /load, field: wrench.force.z, gain: -1.0}}
"""


def write_standard(  # noqa: C901  one branch for each kind of message
    source: Path, path: Path, storage: StoragePlugin = StoragePlugin.MCAP, clock_offset: int = 0
) -> Path:
    """The inputs in the bag ``source`` as standard messages."""
    store = foreign_store()
    types = store.types

    def header(stamp: int):
        time = types['builtin_interfaces/msg/Time'](*divmod(stamp + clock_offset, 1_000_000_000))
        return types['std_msgs/msg/Header'](time, 'rod')

    def joints(stamp: int, *values: float):
        columns = (np.array([9.0, value]) for value in values)
        empty = [np.array([])] * (3 - len(values))
        return types[JOINT_STATE](header(stamp), ['other', 'axis'], *columns, *empty)

    def wrench(stamp: int, force: float):
        vector = types['geometry_msgs/msg/Vector3']
        return types[WRENCH](
            header(stamp), types['geometry_msgs/msg/Wrench'](vector(0.0, 0.0, -force), vector(0.0, 0.0, 0.0))
        )

    with Writer(path, version=9, storage_plugin=storage) as writer:
        topics = {'/joint_states': JOINT_STATE, '/set': JOINT_STATE, '/p_a': FLUID, '/p_b': FLUID, '/load': WRENCH}
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in topics.items()}

        def write(topic: str, log_time: int, message) -> None:
            kind = topics[topic]
            writer.write(connections[topic], log_time, bytes(store.serialize_cdr(message, kind)))

        position = 0.0
        for given in read_messages(source):
            if given.type_name not in INPUTS.values():
                continue
            record, at = decode(given.type_name, given.data), given.log_time
            if isinstance(record, Pressure):
                write('/p_a', at, types[FLUID](header(record.stamp), record.chamber_a + AMBIENT, 0.0))
                write('/p_b', at, types[FLUID](header(record.stamp), record.chamber_b + AMBIENT, 0.0))
            elif isinstance(record, Force):
                write('/load', at, wrench(record.stamp, record.force))
            elif isinstance(record, ServoReference):
                write('/set', at, joints(record.stamp, record.position, record.velocity, record.acceleration))
            elif isinstance(record, Position):
                position = record.position
            elif isinstance(record, Velocity):
                write('/joint_states', at, joints(record.stamp, position, record.velocity))
    return path
