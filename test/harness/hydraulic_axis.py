"""A hydraulic axis 63/36 mm with a controller of its own, as a process: ``python hydraulic_axis.py``.

Its physics are not the package's: bristle seals whose friction rises with the pressure of the rod chamber and with the
pressure difference, a first-order pressure supply, proportional control of position and velocity with the load fed
forward. It speaks standard messages: a shuffled JointState, absolute FluidPressure, a load cell as WrenchStamped, and
takes the feed-forward as third number of a Float64MultiArray. Each line of its output is the tracking error of
`REPORT` seconds.
"""

import json
import math
import random
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64MultiArray

AREA_A = math.pi / 4 * 0.063**2  # [m^2]
AREA_B = AREA_A - math.pi / 4 * 0.036**2  # [m^2]
ROD, LOAD = 9.0, 80.0  # [kg] on either side of the load cell
AMBIENT = 101_325.0  # [Pa]
SUPPLY = 8e6  # [Pa] mean of the chambers
LAG = 0.004  # [s] of the force
PERIOD, STEP = 0.002, 2.5e-4  # [s] of the messages and of the integration
BRISTLES, DAMPING = 4e6, 500.0  # [N/m] and [N s/m] of the seals before they slide
VISCOUS = 200.0  # [N s/m]
HOLD = 0.05  # [s] for which a command acts
REPORT = 0.25  # [s]

ROD_SEAL = {
    'name': 'axis_rod',
    'source': 'harness/hydraulic_axis.py',
    'coulomb_law': 'pressure_power_law',
    'pressure_power_law': {'friction_at_no_pressure': 25.0, 'friction_at_one_bar': 9.0, 'pressure_exponent': 0.7},
    'velocity_terms': {'viscous_friction': VISCOUS},
    'stiction': 40.0,
    'uncertainty': {'relative_std': 0.05, 'absolute_std': 1.0},
    'identified_pressure': [0.0, 2e7],
}
PISTON_SEAL = ROD_SEAL | {
    'name': 'axis_piston',
    'pressure_power_law': {'friction_at_no_pressure': 40.0, 'friction_at_one_bar': 3.5, 'pressure_exponent': 0.8},
    'velocity_terms': {},
}
MACHINE: dict[str, Any] = {
    'name': 'hydraulic_axis',
    'topics': {
        '/joint_states': 'sensor_msgs/msg/JointState',
        '/port_a': 'sensor_msgs/msg/FluidPressure',
        '/port_b': 'sensor_msgs/msg/FluidPressure',
        '/load_cell': 'geometry_msgs/msg/WrenchStamped',
        '/reference': 'sensor_msgs/msg/JointState',
    },
    'ambient_pressure': AMBIENT,
    'actuators': {
        'boom': {
            'seals': ['axis_rod.yaml@b', 'axis_piston.yaml@difference'],
            'bore': '63 mm',
            'rod': '36 mm',
            'inputs': {
                'velocity': '/joint_states velocity[boom]',
                'position': '/joint_states position[boom]',
                'pressure_a': '/port_a fluid_pressure',
                'pressure_b': '/port_b fluid_pressure',
                'reference_position': '/reference position[boom]',
                'reference_velocity': '/reference velocity[boom]',
            },
            'force_sum': {
                'pressures': True,
                'load_force': {'topic': '/load_cell', 'field': 'wrench.force.z', 'gain': -1.0},
            },
            'output': {'topic': '/effort_ff', 'type': 'std_msgs/msg/Float64MultiArray', 'index': 2, 'gain': 1.0},
            'parameters': {'feedforward': {'force_limit': 600.0}},
        }
    },
}


def write_machine(folder: Path) -> Path:
    """Write mapping and seal files of the axis; the path of the mapping file."""
    for seal in (ROD_SEAL, PISTON_SEAL):
        (folder / f'{seal["name"]}.yaml').write_text(json.dumps(seal))
    path = folder / 'axis.yaml'
    path.write_text(json.dumps(MACHINE))
    return path


def sliding_friction(pressure_a: float, pressure_b: float, velocity: float) -> float:
    """Friction of both seals that slide [N], without the viscous part."""
    rod = 25.0 + 9.0 * (max(pressure_b, 0.0) / 1e5) ** 0.7
    piston = 40.0 + 3.5 * (abs(pressure_a - pressure_b) / 1e5) ** 0.8
    return (rod + piston) * (1.0 + 0.25 * math.exp(-((velocity / 0.008) ** 2)))


class Axis(Node):
    """The axis, in real time."""

    def __init__(self) -> None:
        super().__init__('hydraulic_axis')
        self._random = random.Random(1)  # noqa: S311  no secret
        sensors = qos_profile_sensor_data
        self._joints = self.create_publisher(JointState, '/joint_states', sensors)
        self._reference = self.create_publisher(JointState, '/reference', 10)
        self._ports = [self.create_publisher(FluidPressure, f'/port_{port}', sensors) for port in 'ab']
        self._cell = self.create_publisher(WrenchStamped, '/load_cell', sensors)
        self.create_subscription(Float64MultiArray, '/effort_ff', self._on_command, 10)
        self._command, self._commanded = 0.0, -math.inf
        self._position = self._velocity = self._bristle = self._force = 0.0
        self._start = self._last = self._reported = time.monotonic()
        self._squares, self._count = 0.0, 0
        self.create_timer(PERIOD, self._on_timer)

    def _on_command(self, message: Float64MultiArray) -> None:
        self._command, self._commanded = message.data[2], time.monotonic()

    def _on_timer(self) -> None:
        now = time.monotonic()
        command = self._command if now - self._commanded < HOLD else 0.0
        steps = min(int((now - self._last) / STEP), 1000)
        for number in range(steps):
            made = self._step(self._last - self._start + number * STEP, command)
        self._last += steps * STEP
        if steps:
            self._publish(*made)
        if now - self._reported >= REPORT:
            line = {'time': now, 'rms': math.sqrt(self._squares / self._count), 'force': command}
            sys.stdout.write(f'{json.dumps(line)}\n')
            sys.stdout.flush()
            self._squares, self._count, self._reported = 0.0, 0, now

    def _step(self, moment: float, command: float) -> tuple[float, float, float, float, float]:
        """One step of the physics; reference, its velocity, both pressures and the force on the load cell."""
        rate = 2.0 * math.pi * 0.8  # [rad/s]
        wanted, speed = 0.02 * math.sin(rate * moment), 0.02 * rate * math.cos(rate * moment)
        load = -6000.0 - 3000.0 * math.sin(0.9 * moment)
        asked = 150e3 * (wanted - self._position) + 4e3 * (speed - self._velocity) - load + command
        self._force += STEP / LAG * (asked - self._force)
        pressure_b = max((SUPPLY * AREA_A - self._force) / (AREA_A + AREA_B), 0.0)
        pressure_a = (self._force + pressure_b * AREA_B) / AREA_A
        level = sliding_friction(pressure_a, pressure_b, self._velocity)
        rate_of_bristle = self._velocity - BRISTLES * abs(self._velocity) / level * self._bristle
        longest = 1.2 * level / BRISTLES
        self._bristle = max(-longest, min(longest, self._bristle + STEP * rate_of_bristle))
        friction = BRISTLES * self._bristle + DAMPING * rate_of_bristle + VISCOUS * self._velocity
        acceleration = (pressure_a * AREA_A - pressure_b * AREA_B + load - friction) / (ROD + LOAD)
        self._velocity += STEP * acceleration
        self._position += STEP * self._velocity
        self._squares += (wanted - self._position) ** 2
        self._count += 1
        return wanted, speed, pressure_a, pressure_b, LOAD * acceleration - load

    def _publish(self, wanted: float, speed: float, pressure_a: float, pressure_b: float, cell: float) -> None:
        stamp, noise = self.get_clock().now().to_msg(), self._random.gauss
        self._joints.publish(joint_state(stamp, self._measured(noise(0.0, 2e-4)), self._random))
        for publisher, pressure in zip(self._ports, (pressure_a, pressure_b), strict=True):
            port = FluidPressure(fluid_pressure=pressure + AMBIENT + noise(0.0, 3e3))
            port.header.stamp = stamp
            publisher.publish(port)
        wrench = WrenchStamped()
        wrench.header.stamp, wrench.wrench.force.z = stamp, cell + noise(0.0, 3.0)
        self._cell.publish(wrench)
        self._reference.publish(joint_state(stamp, [('stick', 0.7, 0.0), ('boom', wanted, speed)], self._random))

    def _measured(self, noise: float) -> list[tuple[str, float, float]]:
        """Position [m] of an encoder of 1 um and velocity [m/s] of each joint."""
        boom = 'boom', round(self._position / 1e-6) * 1e-6, self._velocity + noise
        return [('slew', 0.1, 0.0), boom, ('stick', 0.7, 0.0)]


def joint_state(stamp: Any, joints: Iterable[tuple[str, float, float]], order: random.Random) -> JointState:
    """Message of some joints in any order."""
    shuffled = list(joints)
    order.shuffle(shuffled)
    message = JointState()
    message.header.stamp = stamp
    message.name, message.position, message.velocity = (list(column) for column in zip(*shuffled, strict=True))
    return message


def main() -> None:
    """Run the axis until it is interrupted."""
    rclpy.init()
    with suppress(KeyboardInterrupt):
        rclpy.spin(Axis())


if __name__ == '__main__':
    sys.exit(main())
