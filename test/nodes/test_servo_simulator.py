"""The simulated servo on a real graph: what a real one would publish, closed with the estimator; bad input is named."""

import itertools
import math
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from harness.compensation import LIVE, SCALE
from harness.counted_estimator import CountedEstimator
from harness.processes import free_domain, graph_environment
from harness.spin_nodes import SpunNodes, ros_context
from paths import ROOT
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from seal_friction_msgs.msg import (
    CylinderPressure,
    ForceSum,
    FrictionFeedForward,
    RodPosition,
    RodVelocity,
    ServoReference,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.core.servo.cylinder import AMBIENT, Cylinder
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.plant import Load
from seal_friction_ros.core.servo.simulator_options import StandardMessages
from seal_friction_ros.nodes import servo_simulator, standard_messages
from seal_friction_ros.nodes.servo_simulator import ServoSimulator
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.replay.replay import replay

TOPICS = {
    'cylinder_pressure': CylinderPressure,
    'force_sum': ForceSum,
    'servo_reference': ServoReference,
    'rod_position': RodPosition,
    'rod_velocity': RodVelocity,
}
SLOW = {'rate': 500.0}  # [Hz] most of what is shown here needs no more
STEADY = {'publish_clock': True}  # stamps count the samples, however long the machine stalls
MESSAGES = len(TOPICS) + 1  # of a sample, the clock among them


class Listener(Node):
    """Hears everything the simulator says, and can speak as reference and as feed-forward."""

    def __init__(self, **kwargs):
        super().__init__('listener', **kwargs)
        self.heard = {name: [] for name in TOPICS}
        for name, kind in TOPICS.items():
            self.create_subscription(kind, name, self.heard[name].append, 1000)
        self.diagnostics, self.clocks = [], []
        self.create_subscription(DiagnosticArray, '/diagnostics', self.diagnostics.append, 10)
        self.create_subscription(Clock, '/clock', self.clocks.append, 1000)
        self.reference = self.create_publisher(ServoReference, 'servo_reference', 10)
        self.feedforward = self.create_publisher(FrictionFeedForward, 'friction_feedforward', 10)

    def values(self):
        """Newest diagnostics of the simulator by key, level and message among them."""
        for array in reversed(self.diagnostics):
            for status in array.status:
                if status.name.endswith(': simulator'):
                    said = {value.key: value.value for value in status.values}
                    return {**said, 'level': status.level, 'message': status.message}
        return {}


class CountedSimulator(ServoSimulator):
    """With the number of forces of the estimator that it has ``heard``."""

    def __init__(self, **kwargs):
        self.heard = 0
        super().__init__(**kwargs)

    def _on_feedforward(self, data):
        super()._on_feedforward(data)
        self.heard += 1


class Stage(SpunNodes):
    """Simulator, listener and, if wanted, estimator."""

    def __init__(self, context, nodes):
        super().__init__(context, *nodes)
        self.simulator, self.listener, *others = nodes
        self.estimator = others[0] if others else None

    def start(self):
        assert self.simulator.trigger_configure() == TransitionCallbackReturn.SUCCESS
        self.connect()
        assert self.simulator.trigger_activate() == TransitionCallbackReturn.SUCCESS

    def wait(self, condition):
        assert self.spin_until(condition)

    def wait_for_diagnostics(self, text, send=lambda: None):
        """Wait until the diagnostics of the simulator contain a text; ``send`` is called again and again."""

        def is_diagnosed():
            send()
            self.simulator.publish_diagnostics()
            self.spin(0.01)
            return text in self.listener.values().get('message', '')

        self.wait(is_diagnosed)

    def set(self, **values):
        named = {name.replace('__', '.'): value for name, value in values.items()}
        return self.simulator.set_parameters_atomically(parameters(named))


def said(simulator, key):
    """A number in the diagnostics of the simulator."""
    return float({value.key: value.value for value in simulator.diagnostics()['simulator'].values}[key])


def parameters(values):
    return [Parameter(name, value=value) for name, value in values.items()]


@contextmanager
def stage(values=None, estimator=None, *, autostart=True):
    with ros_context() as context:
        nodes = [
            CountedSimulator(context=context, parameter_overrides=parameters({**SLOW, **(values or {})})),
            Listener(context=context),
        ]
        if estimator is not None:
            nodes.append(CountedEstimator(context=context, parameter_overrides=parameters(estimator)))
            assert nodes[2].autostart()
        try:
            made = Stage(context, nodes)
            if autostart:
                made.start()
            yield made
        finally:
            for node in (nodes[0], *nodes[2:]):
                node.finish()
            for node in nodes:
                node.destroy_node()


class IdealTime:
    """In the place of ``time``: passes only while the simulator sleeps, and exactly as long as it sleeps.

    ``may_pass`` holds it up, however busy the machine: the simulator sleeps until that is true.
    """

    def __init__(self):
        self.now = 0  # [ns]
        self.may_pass = lambda: True

    def __getattr__(self, name):
        return getattr(time, name)

    def perf_counter_ns(self):
        return self.now

    def sleep(self, seconds):
        self.now += round(seconds * 1e9)
        time.sleep(1e-4)  # lets the others run
        while not self.may_pass():
            time.sleep(1e-4)


def nanoseconds(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


def test_every_topic_comes_at_every_sample_and_the_reference_is_the_wave_asked_for():
    with stage({**STEADY, 'sine.amplitude': 0.002, 'sine.frequency': 3.0}) as s:
        heard = s.listener.heard
        s.wait(lambda: min(map(len, heard.values())) > 100)
        stamps = [nanoseconds(m.header.stamp) for m in heard['servo_reference']]
        steps = [b - a for a, b in itertools.pairwise(stamps)]
        assert min(steps) == 2_000_000
        assert all(step % 2_000_000 == 0 for step in steps)  # a busy machine may lose messages
        wave = Sine(amplitude=0.002, frequency=3.0)
        first = heard['servo_reference'][0]
        first = pytest.approx((first.position, first.velocity), abs=1e-12)  # the position alone comes twice a period
        start = next(i for i in range(1000) if (wave.at(i * 2e-3).position, wave.at(i * 2e-3).velocity) == first)
        for stamp, message in zip(stamps[:90], heard['servo_reference'], strict=False):
            wanted = wave.at(start * 2e-3 + (stamp - stamps[0]) * 1e-9)
            assert (message.position, message.velocity) == pytest.approx((wanted.position, wanted.velocity), abs=1e-12)
        pressures = [m.chamber_a for m in heard['cylinder_pressure']]
        assert all(0.0 < p < 7e6 for p in pressures)
        assert len(set(pressures)) > 50


def test_a_rounded_reference_has_the_velocity_of_its_steps():
    resolution = 5e-6  # [m]
    with stage({'reference_resolution': resolution}) as s:
        heard = s.listener.heard['servo_reference']
        s.wait(lambda: len(heard) > 200)
        for before, now in itertools.pairwise(heard[:200]):
            assert now.position / resolution == pytest.approx(round(now.position / resolution), abs=1e-9)
            if nanoseconds(now.header.stamp) - nanoseconds(before.header.stamp) == 2_000_000:
                assert now.velocity == pytest.approx((now.position - before.position) / 2e-3, abs=1e-12)
                assert now.acceleration == pytest.approx((now.velocity - before.velocity) / 2e-3, abs=1e-9)
        assert s.set(reference_resolution=0.0).successful
        s.wait(lambda: heard[-1].velocity % (resolution / 2e-3) > 1e-6)


def test_with_the_estimator_the_loop_closes_and_what_was_recorded_verifies(tmp_path, monkeypatch):
    estimator = {**LIVE, 'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag', 'use_sim_time': True}
    estimator['refuse_second_publisher'] = False  # the listener publishes, too
    for bound in ('lateness_max', 'estimate_timeout', 'reference_timeout'):
        estimator[f'feedforward.{bound}'] = 1.0  # [s] for which a busy machine may hold the nodes up
    plant = {**STEADY, 'sensors.force_noise': 0.5, 'sine.frequency': 0.83}
    in_step = IdealTime()
    monkeypatch.setattr(servo_simulator, 'time', in_step)
    with stage(plant, estimator, autostart=False) as s:
        ended = threading.Event()
        in_step.may_pass = lambda: (
            ended.is_set()
            or (
                s.simulator.active
                and s.estimator.taken >= MESSAGES * s.simulator.ticks
                and s.simulator.heard >= s.estimator.forces
            )
        )
        try:
            s.start()
            s.wait(lambda: s.estimator.sent > 2000)  # estimates and feed-forwards
            s.wait(lambda: abs(said(s.simulator, 'feed-forward [N]')) > 20.0)
        finally:
            ended.set()
    verdict = replay(tmp_path / 'bag')
    assert verdict.identical
    assert verdict.recorded_feedforwards > 0.98 * verdict.recorded_estimates > 900
    run = read_run(tmp_path / 'bag')
    status = run.status[1:]  # the clock is at 0 s, as before it came, when the first sample comes
    usual = int(Status.MOTION_UNCERTAIN)  # near rest, at reversals
    is_in_order = (run.input_age == 0.0).all()  # a busy machine may take the messages of a sample in another order:
    other = 0 if is_in_order else int(Status.MODEL_DISAGREES)  # then the force sum is that of the sample before
    assert np.bitwise_or.reduce(status) & ~other == usual
    assert np.count_nonzero(status[100:] & usual) <= 0.05 * len(status)
    assert float(abs(run.feedforward_force[200:]).max()) == pytest.approx(SCALE * run.coulomb_friction.max(), rel=0.1)


def test_a_bad_reference_is_limited_and_named():
    with stage({'wave': 'topic', 'reference_timeout': 10.0}) as s:
        s.wait(lambda: s.listener.heard['rod_position'] and s.listener.reference.get_subscription_count())
        for position, velocity, name in (
            (math.nan, 0.0, 'REFERENCE_NOT_FINITE'),
            (0.0, math.inf, 'REFERENCE_NOT_FINITE'),
            (1.0, 0.0, 'REFERENCE_OUT_OF_STROKE'),
            (-0.02, 0.0, 'REFERENCE_TOO_FAST'),
        ):
            message = ServoReference(position=position, velocity=velocity)
            message.header.stamp = s.simulator.get_clock().now().to_msg()
            s.listener.reference.publish(message)
            s.wait_for_diagnostics(name)
            assert s.listener.values()['level'] == b'\x01'
            if name == 'REFERENCE_OUT_OF_STROKE':
                s.wait(lambda: s.listener.heard['rod_position'][-1].position > 0.02)
        positions = [m.position for m in s.listener.heard['rod_position']]
        assert all(abs(p) <= 0.025 for p in positions)  # [m] end stops; references go to 24 mm


def test_a_feed_forward_that_is_old_or_no_number_counts_as_nothing():
    with stage() as s:
        s.wait(s.listener.feedforward.get_subscription_count)
        message = FrictionFeedForward(force=1000.0)
        message.header.stamp.sec = 5
        s.listener.feedforward.publish(message)
        s.wait_for_diagnostics('feed-forwards too old')

        def send_nan():
            message = FrictionFeedForward(force=math.nan)
            message.header.stamp = s.simulator.get_clock().now().to_msg()
            s.listener.feedforward.publish(message)

        s.wait_for_diagnostics('FEEDFORWARD_NOT_FINITE', send_nan)
        assert all(abs(m.position) < 0.002 for m in s.listener.heard['rod_position'])


def test_the_wave_changes_while_it_runs_and_the_plant_does_not():
    with stage() as s:
        s.wait(lambda: len(s.listener.heard['servo_reference']) > 20)
        assert s.set(wave='step', step__size=0.004).successful
        s.wait(lambda: s.listener.heard['servo_reference'][-1].position == 0.004)
        s.wait(lambda: abs(s.listener.heard['rod_position'][-1].position - 0.004) < 1e-3)
        refused = s.set(load__mass=3.0)
        assert not refused.successful
        assert 'load.mass' in refused.reason
        assert 'unconfigured' in refused.reason
        assert not s.set(wave='square').successful
        assert not s.set(wave='topic').successful


@pytest.mark.parametrize(
    ('values', 'reason'),
    [
        ({'controller__force_bandwidth': 50000.0}, 'the closed loop is unstable'),
        ({'cylinder__bore_diameter': 0.01}, 'bore_diameter = 0.01 m is not above rod_diameter'),
        ({'valve__return_pressure': 9e6}, 'supply_pressure'),
        ({'inner_step': 0.01, 'rate': 100.0}, 'too long'),
        ({'time_factor': 5.0}, 'publish_clock'),
        ({'fluid': 'water'}, 'hydraulic, pneumatic'),
        ({'cylinder__type': 'telescopic'}, 'balanced, single_rod'),
        ({'messages': 'standard', 'wave': 'topic'}, 'needs messages: own'),
        ({'standard__reference': 'pose'}, 'joint_state, trajectory_point'),
    ],
)
def test_an_invalid_plant_is_refused_with_the_reason(values, reason):
    with stage(autostart=False) as s:
        refused = s.set(**values)
        assert not refused.successful
        assert reason in refused.reason


def test_an_invalid_plant_from_the_start_stays_unconfigured():
    with stage({'controller.force_bandwidth': 50000.0}, autostart=False) as s:
        assert s.simulator.trigger_configure() != TransitionCallbackReturn.SUCCESS
        assert not s.simulator.configured
        assert not s.simulator.autostart()


class StandardListener(Node):
    """Hears every topic of a machine with standard messages, and sends it efforts."""

    def __init__(self, options, **kwargs):
        super().__init__('listener', **kwargs)
        topics = {**standard_messages.outputs(options), 'joint_reference': JointState}
        self.heard = {name: [] for name in topics}
        for name, kind in topics.items():
            self.create_subscription(kind, name, self.heard[name].append, 1000)
        self.efforts = self.create_publisher(JointState, 'effort_command', 10)
        self.arrays = self.create_publisher(Float64MultiArray, 'effort_commands', 10)


@contextmanager
def standard_stage(values):
    """A simulated machine with standard messages and its listener."""
    with ros_context() as context:
        machine = {**SLOW, 'messages': 'standard', **values}
        simulator = ServoSimulator(context=context, parameter_overrides=parameters(machine))
        listener = StandardListener(simulator.settings(StandardMessages), context=context)
        made = Stage(context, [simulator, listener])
        try:
            made.start()
            yield made
        finally:
            simulator.finish()
            simulator.destroy_node()
            listener.destroy_node()


def test_standard_messages_say_what_the_machine_is_absolute_pressures_among_them():
    with standard_stage({'cylinder.type': 'single_rod', 'controller.force_bandwidth': 200.0, 'rate': 1000.0}) as s:
        heard = s.listener.heard
        s.wait(lambda: min(map(len, heard.values())) > 50)
        assert {name for name, _ in s.simulator.get_topic_names_and_types()}.isdisjoint(
            {'/cylinder_pressure', '/force_sum', '/servo_reference', '/rod_position', '/rod_velocity'}
        )
        by_stamp = {
            name: {nanoseconds(message.header.stamp): message for message in messages}
            for name, messages in heard.items()
        }
        common = sorted(set.intersection(*(set(messages) for messages in by_stamp.values())))
        assert len(common) > 40
        cylinder = s.simulator.settings(Cylinder)
        for stamp in common:
            joint = by_stamp['joint_states'][stamp]
            assert list(joint.name) == ['rod']
            assert abs(joint.position[0] - by_stamp['joint_reference'][stamp].position[0]) < 2e-3
            a, b = (by_stamp[f'pressure_{chamber}'][stamp].fluid_pressure for chamber in 'ab')
            assert 1e5 < a < b < 7.1e6  # [Pa, absolute] the smaller area b has the higher pressure
            load = -s.simulator.settings(Load).viscous_damping * joint.velocity[0]  # all that is on this rod
            assert by_stamp['load_cell'][stamp].wrench.force.x == pytest.approx(load, abs=1e-6)
            assert abs((a - AMBIENT) * cylinder.area_a - (b - AMBIENT) * cylinder.area_b) < 200.0  # [N]


def test_machine_without_force_sensor_and_with_an_encoder_says_no_more_than_it_measures():
    values = {'standard.load_cell': False, 'standard.velocity': False, 'sensors.position_resolution': 1e-5}
    with standard_stage({**values, 'standard.joint': 'slide'}) as s:
        heard = s.listener.heard
        s.wait(lambda: len(heard['joint_states']) > 50 and len(heard['pressure_b']) > 50)
        assert '/load_cell' not in {name for name, _ in s.simulator.get_topic_names_and_types()}
        for message in heard['joint_states']:
            assert list(message.name) == ['slide']
            assert len(message.velocity) == 0
            assert message.position[0] / 1e-5 == pytest.approx(round(message.position[0] / 1e-5), abs=1e-6)


def test_reference_as_a_point_of_a_trajectory_has_the_motion_of_the_wave():
    with standard_stage({'standard.reference': 'trajectory_point', 'sine.amplitude': 0.002}) as s:
        heard = s.listener.heard['reference_point']
        s.wait(lambda: len(heard) > 300)
        assert max(point.positions[0] for point in heard) == pytest.approx(0.002, rel=0.05)
        assert max(point.velocities[0] for point in heard) == pytest.approx(2 * math.pi * 5.0 * 0.002, rel=0.05)


@pytest.mark.parametrize('kind', ['joint_state', 'array'])
def test_an_effort_in_a_standard_message_pushes_the_rod_and_an_old_one_does_not(kind):
    with standard_stage({'feedforward_message': kind, 'wave': 'step', 'step.size': 0.0}) as s:
        position = s.listener.heard['joint_states']
        s.wait(lambda: len(position) > 20)

        def push(force):
            if kind == 'joint_state':
                s.listener.efforts.publish(JointState(name=['other', 'rod'], effort=[1e4, force]))
            else:
                s.listener.arrays.publish(Float64MultiArray(data=[force]))

        def pushed(force):
            push(force)
            s.spin(0.005)
            return position[-1].position[0] * force > 0.0 and abs(position[-1].position[0]) > 1e-4

        s.wait(lambda: pushed(100.0))  # [N]; 1e5 N/m hold against it
        s.wait(lambda: pushed(-100.0))
        s.wait(lambda: 'feed-forwards too old' in str(s.simulator.diagnostics()['simulator']))


@pytest.mark.parametrize('name', [pytest.param('pneumatic_axis', marks=pytest.mark.long), 'single_rod_cylinder'])
def test_machine_of_a_parameter_file_runs(name):
    path = str(ROOT / 'config' / 'simulated_machines' / f'{name}.yaml')
    with ros_context() as context:
        simulator = ServoSimulator(context=context, cli_args=['--ros-args', '--params-file', path])
        try:
            assert simulator.trigger_configure() == TransitionCallbackReturn.SUCCESS
            assert simulator.trigger_activate() == TransitionCallbackReturn.SUCCESS
            s = Stage(context, [simulator, Node('listener', context=context)])
            s.wait(lambda: said(simulator, 'ticks') > 100)
            assert simulator.diagnostics()['simulator'].level != DiagnosticStatus.ERROR
        finally:
            simulator.finish()
            simulator.destroy_node()


def test_time_runs_faster_with_a_clock_for_the_others(monkeypatch):
    monkeypatch.setattr(servo_simulator, 'time', IdealTime())
    with stage({'publish_clock': True, 'time_factor': 5.0}) as s:
        s.wait(lambda: len(s.listener.clocks) > 50 and len(s.listener.heard['rod_velocity']) > 50)
        s.simulator.finish()
        passed = servo_simulator.time.now
        ticks = passed // 400_000  # [ns] of a sample of 2 ms, five times as fast
        s.wait(lambda: min(len(s.listener.clocks), len(s.listener.heard['rod_velocity'])) >= ticks)
    clocks = [nanoseconds(message.clock) for message in s.listener.clocks]
    assert clocks == list(range(0, 2_000_000 * len(clocks), 2_000_000))  # from 0 s
    stamps = [nanoseconds(message.header.stamp) for message in s.listener.heard['rod_velocity']]
    assert stamps[:ticks] == clocks[:ticks]
    assert clocks[-1] == pytest.approx(5 * passed, abs=2 * 2_000_000)


def test_sensors_of_the_same_seed_say_the_same_and_a_delay_keeps_the_stamp_of_the_measurement():
    values = {**STEADY, 'sensors.velocity_noise': 1e-3, 'sensors.seed': 5, 'sensors.drop_out': 0.2}
    velocities = []
    for delay in (0.0, 0.1):
        with stage({**values, 'sensors.delay': delay}) as s:
            heard = s.listener.heard
            s.wait(lambda heard=heard: len(heard['rod_velocity']) > 100)
            s.simulator.finish()
            s.spin(0.05)  # what is on its way

            def late(heard=heard):
                """Lateness of the newest velocity [s]."""
                reference, velocity = heard['servo_reference'][-1], heard['rod_velocity'][-1]
                return (nanoseconds(reference.header.stamp) - nanoseconds(velocity.header.stamp)) * 1e-9

            s.wait(lambda late=late, delay=delay: late() < delay + 0.03)  # velocities on their way
            s.spin(0.05)
            assert late() == pytest.approx(delay, abs=0.03)
            velocities.append({m.velocity for m in heard['rod_velocity'][:100]})
    assert len(velocities[0] & velocities[1]) > 50


def test_deactivated_it_is_silent_and_starts_again_from_the_beginning():
    with stage() as s:
        s.wait(lambda: len(s.listener.heard['rod_velocity']) > 20)
        s.simulator.trigger_deactivate()
        count = s.simulator.ticks  # ticks; each one was heard
        s.wait(lambda: len(s.listener.heard['rod_velocity']) >= count)
        s.spin(0.05)  # 25 samples
        assert len(s.listener.heard['rod_velocity']) == count
        s.simulator.trigger_activate()
        s.wait(lambda: len(s.listener.heard['rod_velocity']) > count + 20)
        s.simulator.trigger_deactivate()
        s.simulator.trigger_cleanup()
        assert s.simulator.autostart()


@pytest.mark.long  # compiles anew
def test_it_says_that_it_compiles_at_the_first_start_and_no_more(tmp_path):
    environment = graph_environment(free_domain()) | {'NUMBA_CACHE_DIR': str(tmp_path), 'PYTHONPATH': str(ROOT)}
    command = [sys.executable, '-c', 'from seal_friction_ros.nodes import entry_points as e; e.servo_simulator()']
    said = []
    for _ in range(2):
        with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
            said.append('')
            for line in process.stderr:
                said[-1] += line
                if 'simulating' in line:
                    process.send_signal(signal.SIGINT)
    assert ['compiling the simulation, once' in each for each in said] == [True, False], said
