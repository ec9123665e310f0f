"""Random sessions on the live node: ``python test/system/rough_sessions.py [--moments 6000] [--seeds 4] [--json]``.

A node in a process of its own records while it gets numbers of any size, NaN, bytes that are no message, stamps that
leap and repeat, frame names of any length, missing joints, other settings, resets of the adaptation, and deactivation
and activation. One actuator and three, answers each and together. Required: the node lives and
writes no traceback, every force it sends is finite, and every bag replays to the byte.
"""

import math
import random
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from seal_friction_msgs.msg import FrictionFeedForward
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, tell
from harness.compensation import LIVE
from harness.machines import EXCAVATOR
from harness.processes import free_domain, node_process
from harness.spin_nodes import SpunNodes, ros_context

from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.layouts import INPUTS
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Temperature, Velocity
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.managed_node import message_class
from seal_friction_ros.offline.replay.replay import replay

NAMES = ('boom', 'arm', 'bucket')
ODD = (math.nan, math.inf, -math.inf, 1e300, -0.0, 5e-324)
STEPS = (*[1_000_000] * 20, 0, -1_000_000, 100_000_000, 3_000_000_000)  # [ns] between two stamps
STROKE = 300  # moments
PACE = 5e-4  # [s] between two moments, at least
BETWEEN_CHANGES = 150  # moments
Messages = dict[str, bytes]


class Case(NamedTuple):
    """Which node, and how it runs."""

    answers: str  # 'one': friction_estimator; 'each', 'together': machine_estimator

    @property
    def module(self) -> str:
        """Module of the node."""
        return 'friction_estimator' if self.answers == 'one' else 'machine_estimator'


CASES = tuple(Case(answers) for answers in ('one', 'each', 'together'))


class Outcome(NamedTuple):
    """What a session left."""

    forces: int  # that the node sent
    not_finite: int  # among them
    samples: int  # velocities in its bags
    bags: int
    differing: list[str]  # bags with answers whose replay differs, and how
    faults: list[str]  # of the process

    @property
    def is_good(self) -> bool:
        """Whether all that is required holds, and there was something to require it of."""
        return self.forces > 0 and self.samples > 0 and not (self.not_finite or self.differing or self.faults)


def near(chance: random.Random, value: float, spread: float) -> float:
    """A number around a value, and now and then an odd one."""
    return chance.choice(ODD) if chance.random() < 0.03 else chance.gauss(value, spread)


def of_one(chance: random.Random, stamp: int, side: float) -> Messages:
    """Messages of this package for one moment."""
    frame = chance.choice((b'', b'rod', b'x' * 300))
    records = {
        'rod_velocity': Velocity(stamp, near(chance, 0.05 * side, 3e-3), frame),
        'cylinder_pressure': Pressure(stamp, near(chance, 2e6, 1e5), near(chance, 1e6, 1e5)),
        'force_sum': Force(stamp, near(chance, 40.0 * side, 5.0)),
        'servo_reference': ServoReference(stamp, 0.0, near(chance, 0.05 * side, 1e-3), near(chance, 0.0, 0.1), frame),
        'seal_temperature': Temperature(stamp, near(chance, 20.0, 5.0), near(chance, 0.0, 1.0)),
        'rod_position': Position(stamp, near(chance, 0.0, 0.1)),
    }
    return {topic: encode(record) for topic, record in records.items()}


def of_machine(chance: random.Random, stamp: int, side: float) -> Messages:
    """Standard messages of a machine of three for one moment."""
    names = list(NAMES) if chance.random() < 0.97 else chance.sample(NAMES, chance.randrange(4))
    found: Messages = {}
    for topic in ('/joint_states', '/set'):
        message = JointState(name=names, velocity=[near(chance, 0.05 * side, 2e-3) for _ in names])
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        message.header.frame_id = chance.choice(('', 'rod', 'y' * 200))
        found[topic] = serialize_message(message)
    for topic in ('/a', '/b'):
        count = 3 if chance.random() < 0.98 else chance.randrange(5)
        found[topic] = serialize_message(Float64MultiArray(data=[near(chance, 20.0, 1.0) for _ in range(count)]))
    return found


class Driver(Node):
    """Sends the messages, changes settings and states, and looks at the forces."""

    def __init__(self, case: Case, **kwargs: Any) -> None:
        super().__init__('driver', **kwargs)
        self.forces = self.not_finite = 0
        types: dict[str, Any] = {topic: message_class(type_name) for topic, type_name in INPUTS.items()}
        if case.answers != 'one':
            types = {'/joint_states': JointState, '/set': JointState}
            types |= dict.fromkeys(('/a', '/b'), Float64MultiArray)
            self.create_subscription(Float64MultiArray, '/effort', lambda m: self._hear(m.data), qos.STREAM)
        else:
            heard = 'friction_feedforward'
            self.create_subscription(FrictionFeedForward, heard, lambda m: self._hear([m.force]), qos.STREAM)
        self.senders = {topic: self.create_publisher(kind, topic, qos.STREAM) for topic, kind in types.items()}
        self.settings = self.create_client(SetParameters, f'{case.module}/set_parameters')
        self.states = self.create_client(ChangeState, f'{case.module}/change_state')
        self.reset = self.create_client(Trigger, f'{case.module}/reset_adaptation')

    def _hear(self, forces: Any) -> None:
        self.forces += 1
        self.not_finite += not all(map(math.isfinite, forces))

    def change(self, chance: random.Random, case: Case) -> Iterator[tuple[Any, Any]]:
        """One change: clients and their requests, in order."""
        prefix = '' if case.answers == 'one' else f'{chance.choice(NAMES)}.'
        settings = {
            'feedforward.scale': chance.choice((0.0, 0.5, 1.0)),
            'adaptation.mode': chance.choice(('off', 'observe', 'on')),
            'velocity_resolution': chance.choice((0.0, 1e-3, 0.05)),
            'feedforward.use_measured_velocity': chance.random() < 0.5,
        }
        what = chance.choice([*settings, 'reset', 'restart'])
        if what == 'reset':
            yield self.reset, Trigger.Request()
        elif what == 'restart':
            for number in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
                yield self.states, ChangeState.Request(transition=Transition(id=number))
        else:
            value = Parameter(prefix + what, value=settings[what]).to_parameter_msg()
            yield self.settings, SetParameters.Request(parameters=[value])


def rubbish(chance: random.Random) -> bytes:
    """Bytes that are no message but begin as one."""
    return b'\x00\x01\x00\x00' + chance.randbytes(chance.randrange(120))


def session(case: Case, seed: int, moments: int, folder: Path) -> Outcome:
    """Run one session.

    Raises:
        RuntimeError: The node does not answer.
    """
    chance, domain, log = random.Random(seed), free_domain(), folder / 'log'  # noqa: S311  no secret
    values: dict[str, Any] = {'record': True, 'record_directory': str(folder)}
    made: Callable[[random.Random, int, float], Messages] = of_one
    if case.answers == 'one':
        values |= {**LIVE, 'stamp_age_max': 0.0, 'record_state_period': 0.5}
    else:
        made, path = of_machine, folder / 'robot.yaml'
        path.write_text(f'answers: {case.answers}\n{EXCAVATOR}')
        values |= {'machine': str(path), **{f'{name}.stamp_age_max': 0.0 for name in NAMES}}
    with node_process(case.module, domain, values, log) as process, ros_context(domain) as context:
        driver = Driver(case, context=context)
        nodes, stamp = SpunNodes(context, driver), 10**18

        def ask(client: Any, request: Any) -> None:
            if not nodes.spin_until(client.service_is_ready) or not nodes.spin_until(client.call_async(request).done):
                raise RuntimeError(f'{client.srv_name} does not answer: {log.read_text()[-1000:]}')

        ask(driver.reset, Trigger.Request())
        for moment in range(moments):
            stamp += chance.choice(STEPS)
            messages = made(chance, stamp, 1.0 if moment // STROKE % 2 else -1.0)
            for topic in chance.sample(sorted(messages), len(messages)):
                if chance.random() > 0.07:
                    is_rubbish = chance.random() < 0.01
                    driver.senders[topic].publish(rubbish(chance) if is_rubbish else messages[topic])
            if moment % BETWEEN_CHANGES == BETWEEN_CHANGES - 1:
                for client, request in driver.change(chance, case):
                    ask(client, request)
            nodes.spin(PACE)
        alive = process.poll() is None
        driver.destroy_node()
    faults = [] if alive else [f'ended with {process.returncode}']
    faults += ['traceback'] * log.read_text().count('Traceback')
    results = {bag.name: replay(bag) for bag in sorted(folder.iterdir()) if bag.is_dir()}
    differing = [f'{n}: {r.first_difference}' for n, r in results.items() if r.recorded_estimates and not r.identical]
    samples = sum(result.velocity_samples for result in results.values())
    return Outcome(driver.forces, driver.not_finite, samples, len(results), differing, faults)


def main() -> int:
    """Run the sessions; print a table, or JSON; 1 if a requirement does not hold."""
    parser = parser_of(__doc__, seeds=(4, 'sessions of each case'), moments=(6000, 'of a session'))
    arguments = parser.parse_args()
    found: dict[str, Outcome] = {}
    for number, case in enumerate(CASES * arguments.seeds):
        with tempfile.TemporaryDirectory() as folder:
            name = f'{case.answers}, seed {number}'
            found[name] = session(case, number, arguments.moments, Path(folder))
    tell({name: outcome._asdict() for name, outcome in found.items()}, as_json=arguments.json)
    return int(not all(outcome.is_good for outcome in found.values()))


if __name__ == '__main__':
    sys.exit(main())
