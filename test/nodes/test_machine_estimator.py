"""A machine with standard messages only: three actuators in one node, live, recorded and replayed."""

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from harness.compensation import SCALE
from harness.machines import BENCH, EXCAVATOR
from harness.spin_nodes import SpunNodes, ros_context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy, qos_profile_sensor_data
from rclpy.time import Time
from seal_friction_msgs.msg import FrictionEstimate, FrictionFeedForward, MachineFriction
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64MultiArray

from seal_friction_ros.core.estimation.configuration import PLACEHOLDER_WARNING
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.nodes.machine_estimator import MachineEstimator
from seal_friction_ros.offline.bags.bag import bag_topics, read_messages
from seal_friction_ros.offline.replay.replay import replay

NAMES = ('boom', 'arm', 'bucket')
PERIOD = 0.002  # [s]


class Drivers(Node):
    """Drivers with best-effort messages, and a controller that listens."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('drivers', **kwargs)
        self.joints = self.create_publisher(JointState, '/joint_states', qos_profile_sensor_data)
        self.set = self.create_publisher(JointState, '/set', 10)
        self.pressures = {name: self.create_publisher(Float64MultiArray, name, 10) for name in ('/a', '/b')}
        self.estimates: dict[str, list[FrictionEstimate]] = {name: [] for name in NAMES}
        self.commands: list[list[float]] = []
        self.wrenches: list[WrenchStamped] = []
        self.diagnostics: list[DiagnosticArray] = []
        for name in NAMES:
            self.create_subscription(FrictionEstimate, f'/{name}/friction_estimate', self.estimates[name].append, 100)
        self.create_subscription(MachineFriction, '/machine_estimator/friction', self._on_answers, 100)
        self.create_subscription(Float64MultiArray, '/effort', lambda m: self.commands.append(list(m.data)), 100)
        self.create_subscription(WrenchStamped, '/boom/wrench', self.wrenches.append, 100)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.diagnostics.append, 10)

    def _on_answers(self, message: MachineFriction) -> None:
        for name, estimate in zip(message.estimated, message.estimates, strict=True):
            self.estimates[name].append(estimate)

    def send(self, velocity: tuple[float, ...], names: tuple[str, ...] = NAMES) -> None:
        """Reference, pressures [bar] and velocities [m/s] of one moment."""
        for publisher in (self.set, self.joints):
            message = JointState(name=names, velocity=velocity)
            message.header.stamp = self.get_clock().now().to_msg()
            if publisher is self.joints:
                for place, pressure in (('/a', 30.0), ('/b', 28.0)):
                    self.pressures[place].publish(Float64MultiArray(data=[pressure] * 3))
            publisher.publish(message)

    def status(self, part: str) -> DiagnosticStatus:
        """Newest diagnostics of a part."""
        found = [s for array in self.diagnostics for s in array.status if s.name.endswith(part)]
        return found[-1]

    def value(self, part: str, key: str) -> str:
        """Newest value of the diagnostics of a part; empty if there is none."""
        return next((v.value for v in self.status(part).values if v.key == key), '') if self.diagnostics else ''


@contextmanager
def machine(tmp_path: Path, text: str = EXCAVATOR, **parameters: Any) -> Iterator[tuple[SpunNodes, Any, Drivers]]:
    """The node with a mapping file, and the drivers."""
    path = tmp_path / 'robot.yaml'
    path.write_text(text)
    off = {f'{name}.stamp_age_max': 0.0 for name in NAMES}
    values = {'machine': str(path), **off, **parameters}
    with ros_context() as context:
        node = MachineEstimator(context=context, parameter_overrides=[Parameter(n, value=v) for n, v in values.items()])
        drivers = Drivers(context=context)
        try:
            assert node.autostart()
            yield SpunNodes(context, node, drivers), node, drivers
        finally:
            node.finish()
            node.destroy_node()
            drivers.destroy_node()


def heard(nodes: SpunNodes, drivers: Drivers) -> None:
    """Spin until the best-effort driver is heard."""

    def offers() -> list[ReliabilityPolicy]:
        return [end.qos_profile.reliability for end in drivers.get_subscriptions_info_by_topic('/joint_states')]

    assert nodes.spin_until(lambda: ReliabilityPolicy.BEST_EFFORT in offers())
    nodes.connect()


def move(nodes: SpunNodes, drivers: Drivers, samples: int) -> None:
    """Slide all rods at three speeds."""
    for _ in range(samples):
        before = {name: len(found) for name, found in drivers.estimates.items()}
        drivers.send((0.05, -0.03, 0.02))
        assert nodes.spin_until(lambda b=before: all(len(drivers.estimates[name]) > b[name] for name in NAMES))
        nodes.spin(PERIOD)


def move_until(nodes: SpunNodes, drivers: Drivers, condition: Callable[[list[float]], object]) -> None:
    """Slide until the newest command is as it should be."""
    for _ in range(1000):
        move(nodes, drivers, 1)
        if drivers.commands and condition(drivers.commands[-1]):
            return
    raise AssertionError(drivers.commands[-1])


@pytest.mark.parametrize('answers', ['each', 'together'])
def test_three_actuators_from_one_joint_state_give_estimates_and_one_command_and_replay_to_the_byte(tmp_path, answers):
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    with machine(tmp_path, f'answers: {answers}\n{EXCAVATOR}', **recording) as (nodes, node, drivers):
        heard(nodes, drivers)
        move_until(nodes, drivers, lambda force: force[0] > 0.0 > force[1] and force[2] > 0.0)
        newest = {name: found[-1] for name, found in drivers.estimates.items()}
        assert [newest[name].direction for name in NAMES] == [1, -1, 1]
        assert all(estimate.coulomb_friction > 1.0 for estimate in newest.values())
        assert node.set_parameters([Parameter('boom.feedforward.scale', value=0)])[0].successful
        move_until(nodes, drivers, lambda force: force[0] == 0.0 > force[1])
        node.finish()
    result = replay(tmp_path / 'bag')
    assert result.identical, result.first_difference
    assert result.velocity_samples == 3 * len(drivers.estimates['boom'])
    assert replay(tmp_path / 'bag', out=tmp_path / 'again').identical
    assert replay(tmp_path / 'again').identical


def test_a_wrench_has_force_frame_and_a_fresh_stamp_and_the_bag_replays_to_the_byte(tmp_path):
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    wrench = '{topic: /boom/wrench, type: geometry_msgs/msg/WrenchStamped, frame: rod}'
    text = EXCAVATOR.replace('{topic: /effort, type: std_msgs/msg/Float64MultiArray, index: 0}', wrench)
    with machine(tmp_path, text, **recording) as (nodes, node, drivers):
        heard(nodes, drivers)
        move_until(nodes, drivers, lambda _: drivers.wrenches and drivers.wrenches[-1].wrench.force.x > 1.0)
        newest = drivers.wrenches[-1]
        age = drivers.get_clock().now() - Time.from_msg(newest.header.stamp)
        assert newest.header.frame_id == 'rod'
        assert 0 < age.nanoseconds < 10**9  # on a busy machine; within 50 ms on an idle one
        node.finish()
    result = replay(tmp_path / 'bag', out=tmp_path / 'again')
    assert result.identical, result.first_difference
    assert replay(tmp_path / 'again').identical
    assert bag_topics(tmp_path / 'again')['/boom/wrench'].message_count >= len(drivers.wrenches)


def test_a_topic_that_no_input_uses_is_recorded_and_the_bag_replays_to_the_byte(tmp_path):
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    text = EXCAVATOR.replace('topics: {', 'topics: {/valve: std_msgs/msg/Float64MultiArray, ', 1)
    with machine(tmp_path, text, **recording) as (nodes, node, drivers):
        valve = drivers.create_publisher(Float64MultiArray, '/valve', 10)
        heard(nodes, drivers)
        for number in range(5):
            valve.publish(Float64MultiArray(data=[float(number)]))
            move(nodes, drivers, 1)
        node.finish()
    assert bag_topics(tmp_path / 'bag')['/valve'].message_count == 5
    result = replay(tmp_path / 'bag')
    assert result.identical, result.first_difference


def test_a_joint_that_no_message_holds_is_named_and_the_others_go_on(tmp_path):
    with machine(tmp_path, EXCAVATOR.replace('velocity[bucket]', 'velocity[buckett]')) as (nodes, node, drivers):
        heard(nodes, drivers)
        for number in range(3):
            drivers.send((0.05, -0.03, 0.02))
            assert nodes.spin_until(lambda n=number: len(drivers.estimates['arm']) > n)
        assert not drivers.estimates['bucket']
        node.publish_diagnostics()
        assert nodes.spin_until(lambda: drivers.diagnostics and 'buckett' in drivers.status('bucket').message)
        assert 'did you mean bucket' in drivers.status('bucket').message
        assert 'buckett' not in drivers.status('arm').message


def test_an_input_whose_messages_are_empty_has_not_arrived(tmp_path, capfd):
    with machine(tmp_path) as (nodes, _, drivers):
        heard(nodes, drivers)
        remarks = ''

        def said(words: str) -> bool:
            nonlocal remarks
            drivers.send(())
            remarks += ''.join(capfd.readouterr())
            return words in remarks

        assert nodes.spin_until(lambda: said('waiting for /joint_states'))
        assert 'waiting for /joint_states (velocity[boom]: velocity has 0 elements)' in remarks
        assert 'has arrived' not in remarks
        move(nodes, drivers, 3)
        assert nodes.spin_until(lambda: 'every input that is needed has arrived' in ''.join(capfd.readouterr()))


def test_a_joint_that_is_named_twice_is_ambiguous_in_the_diagnostics_and_the_others_go_on(tmp_path):
    with machine(tmp_path) as (nodes, node, drivers):
        heard(nodes, drivers)
        for number in range(3):
            drivers.send((0.05, -0.03, 0.02, 0.04), (*NAMES, 'bucket'))
            assert nodes.spin_until(lambda n=number: len(drivers.estimates['arm']) > n)
        assert not drivers.estimates['bucket']
        node.publish_diagnostics()
        assert nodes.spin_until(lambda: drivers.diagnostics and 'ambiguous' in drivers.status('bucket').message)
        assert "'bucket' stands 2 times in name" in drivers.status('bucket').message
        assert 'ambiguous' not in drivers.status('arm').message


def test_malformed_bytes_are_counted_and_the_estimate_goes_on(tmp_path):
    with machine(tmp_path) as (nodes, node, drivers):
        heard(nodes, drivers)
        move(nodes, drivers, 2)
        node.on_input('/joint_states', b'\x00\x01\x00\x00garbage', 0)
        move(nodes, drivers, 2)
        node.publish_diagnostics()
        assert nodes.spin_until(lambda: drivers.value('boom', '/joint_states malformed') == '1')


def test_the_forces_fall_to_0_when_the_node_stops(tmp_path):
    with machine(tmp_path) as (nodes, node, drivers):
        heard(nodes, drivers)
        move_until(nodes, drivers, lambda force: force[0] > 1.0)
        node.finish()
        assert nodes.spin_until(lambda: drivers.commands[-1] == [0.0, 0.0, 0.0])
        assert drivers.commands[-1] == [0.0, 0.0, 0.0]


def test_what_waited_while_the_node_was_held_up_makes_no_force_and_replays_to_the_byte(tmp_path):
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    with machine(tmp_path, **recording) as (nodes, node, drivers):
        heard(nodes, drivers)
        move_until(nodes, drivers, lambda force: force[0] > 10.0)
        drivers.commands.clear()
        for _ in range(50):
            drivers.send((0.05, -0.03, 0.02))
            time.sleep(PERIOD)
        time.sleep(0.25)  # the executor takes nothing meanwhile
        assert nodes.spin_until(lambda: len(drivers.commands) >= 3)  # the watchdog answers for one after the other
        assert [0.0, 0.0, 0.0] in drivers.commands[:3]
        move_until(nodes, drivers, lambda force: force[0] > 10.0)
        node.finish()
    result = replay(tmp_path / 'bag')
    assert result.identical, result.first_difference
    late = [message.log_time - message.publish_time for message in read_messages(tmp_path / 'bag')]
    assert max(late) > 0.2e9


@pytest.mark.parametrize('name', ['bom.feedforward.scale', 'boom.feedfoward.scale', 'feedforward.scale', 'boom.scale'])
def test_a_mistyped_off_switch_ends_the_start(tmp_path, name):
    """A force of 32 N came from a machine whose operator believed it off."""
    with pytest.raises(ValueError, match=f'no parameter {re.escape(name)}') as error, machine(tmp_path, **{name: 0.0}):
        pass
    assert '\n' not in str(error.value)


def test_placeholder_seals_make_no_force_and_a_scale_is_rejected_with_the_reason(tmp_path):
    text = EXCAVATOR.replace('seals: [ms28775_114@a, ms28775_114@b]', 'seals: [placeholder@a, placeholder@b]', 1)
    with machine(tmp_path, text) as (nodes, node, drivers):
        heard(nodes, drivers)
        move_until(nodes, drivers, lambda force: force[1] < -5.0)  # the others have their seals
        assert {force[0] for force in drivers.commands} == {0.0}
        (result,) = node.set_parameters([Parameter('boom.feedforward.scale', value=0.5)])
        assert not result.successful
        assert PLACEHOLDER_WARNING in result.reason
        assert node.set_parameters([Parameter('arm.feedforward.scale', value=0.5)])[0].successful


class SensorDrivers(Node):
    """A C++ driver as most are: every topic with best effort, volatile, depth 5."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('sensor_drivers', **kwargs)
        types = {
            '/joint_states': JointState, '/set': JointState, '/p_a': FluidPressure, '/p_b': FluidPressure,
            '/load': WrenchStamped,
        }  # fmt: skip
        self.senders = {t: self.create_publisher(kind, t, qos_profile_sensor_data) for t, kind in types.items()}
        self.estimates: list[FrictionEstimate] = []
        self.feedforwards: list[FrictionFeedForward] = []
        self.diagnostics: list[DiagnosticArray] = []
        self.create_subscription(
            FrictionEstimate, '/axis/friction_estimate', self.estimates.append, qos_profile_sensor_data
        )
        self.create_subscription(
            FrictionFeedForward, '/axis/friction_feedforward', self.feedforwards.append, qos_profile_sensor_data
        )
        self.create_subscription(DiagnosticArray, '/diagnostics', self.diagnostics.append, 10)

    def send(self, pressures: tuple[float, float] = (3.1e6, 2.9e6)) -> None:
        """One moment of a sliding rod; ``pressures`` as the sensors give them [Pa]."""
        moving = JointState(name=['axis'], position=[0.1], velocity=[0.05])
        load = WrenchStamped()
        load.wrench.force.z = 10.0
        messages = [FluidPressure(fluid_pressure=pressure) for pressure in pressures]
        for topic, message in zip(
            ('/p_a', '/p_b', '/load', '/set', '/joint_states'), [*messages, load, moving, moving], strict=True
        ):
            message.header.stamp = self.get_clock().now().to_msg()
            self.senders[topic].publish(message)


@contextmanager
def sensor_bench(tmp_path: Path, text: str) -> Iterator[tuple[SpunNodes, Any, SensorDrivers]]:
    """The test bench, whose drivers offer the QoS of sensors."""
    path = tmp_path / 'robot.yaml'
    path.write_text(text)
    with ros_context() as context:
        node = MachineEstimator(context=context, parameter_overrides=[Parameter('machine', value=str(path))])
        drivers = SensorDrivers(context=context)
        try:
            assert node.autostart()
            yield SpunNodes(context, node, drivers), node, drivers
        finally:
            node.finish()
            node.destroy_node()
            drivers.destroy_node()


WITH_REFERENCE = BENCH.replace(
    'pressure_b: /p_b}', "pressure_b: /p_b, reference_velocity: '/set velocity[axis]'}"
).replace('topics: {', 'topics: {/set: sensor_msgs/msg/JointState, ')
WITH_REFERENCE += f'    parameters: {{feedforward: {{scale: {SCALE}}}}}\n'


def test_drivers_with_the_qos_of_sensors_give_good_estimates_without_any_qos_parameter(tmp_path):
    with sensor_bench(tmp_path, WITH_REFERENCE) as (nodes, _, drivers):

        def is_answered() -> bool:
            drivers.send()
            nodes.spin(PERIOD)
            # in one direction a load is not told from friction yet
            good = [e for e in drivers.estimates if not e.status & ~(Status.STAMP_AGE | Status.MODEL_DISAGREES)]
            return len(good) > 20 and any(answer.force > 1.0 for answer in drivers.feedforwards)

        assert nodes.spin_until(is_answered)
        assert {topic: sender.get_subscription_count() for topic, sender in drivers.senders.items()} == dict.fromkeys(
            drivers.senders, 1
        )


@pytest.mark.parametrize(
    ('text', 'pressures', 'words'),
    [
        (BENCH.replace('pressure_a: /p_a', 'pressure_a: {topic: /p_a, absolute: false}'), (1.01e5, 2e6), 'pressure_a'),
        (BENCH, (1e3, 2e6), 'write absolute: false'),
        (BENCH, (1.01e5, 2e6), ''),
    ],
)
def test_ambient_pressure_that_is_not_taken_off_or_twice_is_said_by_diagnostics(tmp_path, text, pressures, words):
    with sensor_bench(tmp_path, text) as (nodes, node, drivers):

        def is_heard() -> bool:
            drivers.send(pressures)
            nodes.spin(PERIOD)
            return len(drivers.estimates) > 20

        assert nodes.spin_until(is_heard)
        status = node.diagnostics()['axis']
        assert ('write absolute' in status.message) == bool(words)
        assert words in status.message
        assert not words or status.level != DiagnosticStatus.OK


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (('velocity[boom]', 'velocty[boom]'), 'velocity'),
        (('sensor_msgs/msg/JointState', 'sensor_msgs/msg/JointStat'), 'not installed'),
        (('ms28775_114@a', 'ms28775_115@a'), 'ms28775_115'),
    ],
)
def test_what_is_wrong_in_the_mapping_file_is_one_line_and_the_node_does_not_start(tmp_path, change, words):
    path = tmp_path / 'robot.yaml'
    path.write_text(EXCAVATOR.replace(*change))
    said = started(path)
    assert words in said
    assert '\n' not in said


def started(path: Path) -> str:
    """Why the node does not start; empty if it does."""
    logged: list[str] = []
    with ros_context() as context:
        try:
            node = MachineEstimator(context=context, parameter_overrides=[Parameter('machine', value=str(path))])
        except ValueError as error:
            return str(error)
        logger = node.get_logger()
        node.get_logger = lambda: SimpleNamespace(error=logged.append, warning=logger.warning, info=logger.info)
        node.autostart()
        node.destroy_node()
    return ' '.join(logged)
