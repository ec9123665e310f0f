"""What a machine without messages of this package publishes and takes: sensor_msgs, geometry_msgs, trajectory_msgs.

Pressures are absolute, as `sensor_msgs/FluidPressure` defines them. The load cell sits between rod and load and has the
force along x: all axial forces on the rod except those of the pressures and the seals, positive on extension.
"""

from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectoryPoint

from seal_friction_ros.core.servo.cylinder import AMBIENT
from seal_friction_ros.core.servo.motions import Setpoint
from seal_friction_ros.core.servo.sensors import Readings
from seal_friction_ros.core.servo.simulator_options import StandardMessages

_SECOND = 1_000_000_000  # [ns]
_REFERENCES = {
    'joint_state': ('joint_reference', JointState),
    'trajectory_point': ('reference_point', JointTrajectoryPoint),
}


def outputs(options: StandardMessages) -> dict[str, Any]:
    """Type of the message on each topic."""
    topics: dict[str, Any] = {'joint_states': JointState, 'pressure_a': FluidPressure, 'pressure_b': FluidPressure}
    if options.load_cell:
        topics['load_cell'] = WrenchStamped
    return topics | dict([_REFERENCES[options.reference]])


def _time(stamp: int) -> Time:
    seconds, nanoseconds = divmod(stamp, _SECOND)
    return Time(sec=seconds, nanosec=nanoseconds)


def reference_messages(stamp: int, reference: Setpoint, joint: str) -> dict[str, Any]:
    """Reference of the sample at ``stamp`` [ns], by topic; a point of a trajectory has no stamp."""
    position, velocity, acceleration = map(float, reference)
    state = JointState(name=[joint], position=[position], velocity=[velocity])
    state.header.stamp = _time(stamp)
    motion = {'positions': [position], 'velocities': [velocity], 'accelerations': [acceleration]}
    return {'joint_reference': state, 'reference_point': JointTrajectoryPoint(**motion, time_from_start=Duration())}


def sensor_messages(stamp: int, readings: Readings, options: StandardMessages) -> dict[str, Any]:
    """Readings of the sample at ``stamp`` [ns], by topic; a lost reading has no message.

    ``readings.force_sum`` is the force in the load cell.
    """
    messages: dict[str, Any] = {}
    for chamber, pressure in zip('ab', readings.pressure or (), strict=False):
        messages[f'pressure_{chamber}'] = FluidPressure(fluid_pressure=pressure + AMBIENT)
    if readings.force_sum is not None and options.load_cell:
        messages['load_cell'] = WrenchStamped()
        messages['load_cell'].wrench.force.x = readings.force_sum
    if readings.position is not None and (readings.velocity is not None or not options.velocity):
        messages['joint_states'] = JointState(name=[options.joint], position=[readings.position])
        if options.velocity:
            messages['joint_states'].velocity = [readings.velocity]
    for message in messages.values():
        message.header.stamp = _time(stamp)
    return messages


def _effort_of_joint(message: JointState, joint: str) -> float | None:
    """Effort of a joint [N]; None where it has none."""
    names, efforts = list(message.name), message.effort
    place = names.index(joint) if joint in names else len(efforts)
    return float(efforts[place]) if place < len(efforts) else None


def _first_value(message: Float64MultiArray, _joint: str) -> float | None:
    """First value of an array [N]; None of an empty one."""
    return float(message.data[0]) if len(message.data) else None


FEEDFORWARDS: dict[str, tuple[str, Any, Callable[[Any, str], float | None]]] = {
    'joint_state': ('effort_command', JointState, _effort_of_joint),
    'array': ('effort_commands', Float64MultiArray, _first_value),
}
"""Topic, type and reader of a feed-forward in a standard message, by the value of ``feedforward_message``."""
