"""Simulated servo actuator: publishes the topics of a real one, in real time or faster, from ``core.servo``."""

import math
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock as ClockMessage

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.foundation.compiled import before_compiling, has_compiler
from seal_friction_ros.core.foundation.parameters import ParameterGroup
from seal_friction_ros.core.friction.force_sum_correction import NO_CORRECTION, measured_force_sum, one_correction
from seal_friction_ros.core.messages.coder import decode, encode
from seal_friction_ros.core.messages.layouts import FEEDFORWARD_TYPE, INPUTS, REFERENCE_TYPE
from seal_friction_ros.core.messages.records import FeedForward, Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.core.servo import simulator_options
from seal_friction_ros.core.servo.controller import Limited
from seal_friction_ros.core.servo.cylinder import pressure_force
from seal_friction_ros.core.servo.motions import PullTest, RoundedWave, Setpoint, Wave
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, outputs, step
from seal_friction_ros.core.servo.pull_rig import PullRig, init_pull_rig, pull_rig, step_pull_rig
from seal_friction_ros.core.servo.sensors import Readings, SensorSettings, read
from seal_friction_ros.core.servo.simulator_options import PLANT, WAVES, SimulatorSettings, StandardMessages
from seal_friction_ros.files import load_seals
from seal_friction_ros.nodes import qos, standard_messages
from seal_friction_ros.nodes.executor import run
from seal_friction_ros.nodes.managed_node import ManagedNode, message_class, status_of

FRAME = b'rod'
_OUTPUTS = ('cylinder_pressure', 'force_sum', 'servo_reference', 'rod_position', 'rod_velocity')  # velocity last
_LONGEST_CATCH_UP = 0.1  # [s] the simulation skips the time of a longer stall
_SWITCH_INTERVAL = 2e-4  # [s] longest time that diagnostics delay a tick; Python's default is 5 ms
_SECOND = 1_000_000_000  # [ns]
_NORMAL_LIMITS = ('limited FORCE', 'limited SPOOL')  # a servo at full force or valve opening is no fault


class ServoSimulator(ManagedNode):
    """Lifecycle node around `core.servo.position_servo` and `core.servo.pull_rig`.

    ValueError: A parameter has the wrong type or is out of bounds.
    """

    def __init__(self, **kwargs: Any) -> None:
        self._sensor_publishers: dict[str, Any] = {}
        self._clock_publisher: Any = None
        self._thread: threading.Thread | None = None
        self._running = False
        self._inputs: list[Any] = []
        super().__init__('servo_simulator', simulator_options.SERVO_SIMULATOR_PARAMETERS, **kwargs)

    # --- lifecycle ---

    def make(self) -> None:
        """Create and compile the servo; create publishers and subscriptions."""
        self._settings = self.settings(SimulatorSettings)
        if not has_compiler():
            self.get_logger().warning('numba is not installed: the simulation is slow; apt-get install python3-numba')
        self._period = round(_SECOND / self._settings.rate)
        with before_compiling(partial(self.get_logger().info, 'compiling the simulation, once: up to a minute')):
            self._make_servo()
        self._joint = self.settings(StandardMessages).joint
        options = qos.overridable()
        for topic, kind in self._outputs_by_topic().items():
            publisher = self.create_lifecycle_publisher(kind, topic, qos.STREAM, qos_overriding_options=options)
            self._sensor_publishers[topic] = publisher
        if self._settings.publish_clock:
            self._clock_publisher = self.create_publisher(ClockMessage, '/clock', qos.CLOCK)
        if self._settings.feedforward_message == 'own':
            self._subscribe('friction_feedforward', message_class(FEEDFORWARD_TYPE), self._on_feedforward)
        else:
            topic, kind, force_of = standard_messages.FEEDFORWARDS[self._settings.feedforward_message]
            self._subscribe(topic, kind, lambda message: self._on_effort(force_of(message, self._joint)), raw=False)
        if self._settings.wave == 'topic':
            self._subscribe('servo_reference', message_class(REFERENCE_TYPE), self._on_reference)

    def _outputs_by_topic(self) -> dict[str, Any]:
        if self._settings.messages == 'standard':
            return standard_messages.outputs(self.settings(StandardMessages))
        own = {topic: message_class(INPUTS[topic]) for topic in _OUTPUTS}
        if self._settings.wave not in WAVES:
            del own['servo_reference']
        return own

    def _subscribe(self, topic: str, kind: Any, callback: Any, raw: bool = True) -> None:
        options = {'raw': raw, 'qos_overriding_options': qos.overridable()}
        self._inputs.append(self.create_subscription(kind, topic, callback, qos.STREAM, **options))

    def _make_servo(self) -> None:
        period = 1.0 / self._settings.rate
        seals = load_seals(self.settings(SealSelection))
        self._lacking = one_correction(mounted.seal.force_sum_correction for mounted in seals) or NO_CORRECTION
        self._rig: PullRig | None = None
        if self._settings.wave == 'pull_test':
            self._rig = pull_rig(self.settings(PullTest), seals, period)
            step_pull_rig(self._rig, init_pull_rig(self._rig), 0.0)  # compiles
        else:
            self._servo = self._servo_parameters()
            step(self._servo, init(self._servo, self._settings.start_position), Setpoint(0.0))  # compiles
        read(self.settings(SensorSettings), 0, Readings(None, None, None, None))  # loads the random generator

    def _servo_parameters(self, changed: dict[type, Any] | None = None) -> ServoParameters:
        kinds = (SimulatorSettings, SealSelection, *PLANT.values())
        used = {kind: (changed or {}).get(kind) or self.settings(kind) for kind in kinds}
        return simulator_options.servo_parameters(used[SimulatorSettings], used, load_seals(used[SealSelection]))

    def release(self) -> None:
        """Destroy publishers and subscriptions."""
        for publisher in (*self._sensor_publishers.values(), self._clock_publisher):
            if publisher is not None:
                self.destroy_publisher(publisher)
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        self._sensor_publishers.clear()
        self._inputs.clear()
        self._clock_publisher = None

    def start(self) -> None:
        """Put the rod at its start position, at rest, and start the simulation."""
        settings = self._settings
        self._apply_settings()
        self._wave_start = self.ticks = 0  # [samples]
        self._origin = 0 if settings.publish_clock else self.get_clock().now().nanoseconds
        self._feedforward: FeedForward | None = None
        self._reference: ServoReference | None = None
        self._delayed: deque[tuple[int, Readings]] = deque()
        self._counts: Counter[str] = Counter()
        self._recent: Counter[str] = Counter()
        self._reported = (time.monotonic(), 0)
        self._started = (time.monotonic(), time.process_time())
        if self._rig is not None:
            self._rig_state = init_pull_rig(self._rig)
            self._outputs = outputs(self._rig.servos[0], self._rig_state.plant)
        else:
            self._state = init(self._servo, settings.start_position)
            self._outputs = outputs(self._servo, self._state.plant)
        self._wall_period = self._period / settings.time_factor
        self._failure = ''
        self._running = True
        self._thread = threading.Thread(target=self._run, name='simulation', daemon=True)
        self._thread.start()
        self.get_logger().info('simulating')

    def finish(self) -> None:
        """Stop the simulation."""
        self.active = False
        self._running = False
        if self._thread is not None:
            self._thread.join()
        self._thread = None

    # --- parameters ---

    def check_change(self, changed: Mapping[ParameterGroup, Any]) -> None:
        """Reject, by a ValueError, an unstable or unphysical plant, and a wave that needs other topics."""
        records = {group.record_type: record for group, record in changed.items()}
        if not self.configured:
            if records.keys() & {SimulatorSettings, SealSelection, *PLANT.values()}:
                self._servo_parameters(records)
            return
        waves = {records.get(SimulatorSettings, self._settings).wave, self._settings.wave}
        if len(waves) > 1 and not waves <= WAVES.keys():
            raise ValueError('wave: to and from topic and pull_test only while the node is unconfigured')

    def on_change(self, changed: Collection[Parameter]) -> None:
        """Apply changed settings; a changed wave starts from its beginning."""
        del changed
        settings = self.settings(SimulatorSettings)
        if self.active and settings.wave != self._settings.wave:
            self._wave_start = self.ticks
        self._settings = settings
        self._apply_settings()

    def _apply_settings(self) -> None:
        self._sensors = self.settings(SensorSettings)
        self._delay = round(self._sensors.delay * self._settings.rate)  # [samples]
        self._wave: Wave | None = self.settings(WAVES[self._settings.wave]) if self._settings.wave in WAVES else None
        if self._wave is not None and self._settings.reference_resolution:
            self._wave = RoundedWave(self._wave, self._settings.reference_resolution, self._period * 1e-9)

    # --- inputs ---

    def _on_feedforward(self, data: bytes) -> None:
        with self._counting_malformed('friction_feedforward'):
            self._feedforward = decode(FEEDFORWARD_TYPE, data)

    def _on_effort(self, force: float | None) -> None:
        """Take the force of a standard message; it counts from its receipt."""
        if force is not None and self.active:
            self._feedforward = FeedForward(self._origin + self.ticks * self._period, force, 0.0, 0)

    def _on_reference(self, data: bytes) -> None:
        with self._counting_malformed('servo_reference'):
            self._reference = decode(REFERENCE_TYPE, data)

    @contextmanager
    def _counting_malformed(self, topic: str) -> Iterator[None]:
        try:
            yield
        except ValueError as error:
            if self.active:
                self._recent[f'{topic} malformed'] += 1
                self.get_logger().error(f'{topic}: {error}', throttle_duration_sec=1.0)

    # --- simulation ---

    def _run(self) -> None:
        """Run the simulation in its own thread: an rclpy timer would take half as long as a whole sample."""
        self._due = float(time.perf_counter_ns())
        try:
            while self._running:
                late = time.perf_counter_ns() - self._due
                if late < 0.0:
                    time.sleep(-late * 1e-9)
                    continue
                self._on_late_tick(late)
                self._tick()
                self._due += self._wall_period
        except Exception as error:  # noqa: BLE001  the thread must not end silently
            self._failure = f'stopped: {error!r}'
            self.get_logger().error(self._failure)

    def _on_late_tick(self, late: float) -> None:
        """Count a tick that is ``late`` [ns] by more than a period; after a stall, skip the lost time."""
        if self._clock_publisher is None and late > self._wall_period:
            self._recent['missed ticks'] += 1
        if late > _LONGEST_CATCH_UP * _SECOND:
            lost = int(late // self._wall_period)
            self._due += lost * self._wall_period
            if self._clock_publisher is None:  # stamps follow the clock of the other nodes
                self._origin += lost * self._period
                self._recent['missed ticks'] += lost

    def _tick(self) -> None:
        """Publish the present sample; then simulate controller and plant until the next sample."""
        stamp = self._origin + self.ticks * self._period
        reference = self._reference_at(stamp)
        true, limited = self._outputs, 0
        pressures = true.pressure_a, true.pressure_b
        force_sum = measured_force_sum(self._lacking, true.force_sum, *pressures)
        if self._settings.messages == 'standard':  # a load cell: everything on the rod but pressures and seals
            force_sum = true.force_sum - pressure_force(self._servo.cylinder, *pressures)
        readings = Readings(pressures, true.velocity, force_sum, true.position)
        self._delayed.append((stamp, read(self._sensors, self.ticks, readings)))
        if self._clock_publisher is not None:
            seconds, nanoseconds = divmod(stamp, _SECOND)
            self._clock_publisher.publish(ClockMessage(clock=Time(sec=seconds, nanosec=nanoseconds)))
        self._publish_reference(stamp, reference)
        while len(self._delayed) > self._delay:
            self._publish(*self._delayed.popleft())
        if self._rig is not None:
            time_now = self.ticks * self._period * 1e-9
            self._rig_state, self._outputs = step_pull_rig(self._rig, self._rig_state, time_now)
        elif reference is not None:
            self._state, self._outputs = step(self._servo, self._state, reference, self._feedforward_at(stamp))
            limited = self._outputs.command.limited
        if limited:
            self._recent.update(f'limited {bit.name}' for bit in Limited if limited & bit)
        self.ticks += 1

    def _reference_at(self, stamp: int) -> Setpoint | None:
        """Reference at ``stamp`` [ns]; None on the pull rig."""
        if self._wave is not None:
            return self._wave.at((self.ticks - self._wave_start) * self._period * 1e-9)
        if self._rig is not None:
            return None
        newest = self._reference
        if newest is None:
            return Setpoint(self._settings.start_position)
        if abs(stamp - newest.stamp) * 1e-9 > self._settings.reference_timeout:
            self._recent['references too old'] += 1
            return Setpoint(newest.position)
        return Setpoint(newest.position, newest.velocity, newest.acceleration)

    def _feedforward_at(self, stamp: int) -> float:
        newest = self._feedforward
        if newest is None or not self._settings.use_feedforward:
            return 0.0
        if abs(stamp - newest.stamp) * 1e-9 > self._settings.feedforward_timeout:
            self._recent['feed-forwards too old'] += 1
            return 0.0
        return newest.force

    def _publish_reference(self, stamp: int, reference: Setpoint | None) -> None:
        if reference is None:
            return
        if self._settings.messages == 'standard':
            for topic, message in standard_messages.reference_messages(stamp, reference, self._joint).items():
                if topic in self._sensor_publishers:
                    self._sensor_publishers[topic].publish(message)
        elif 'servo_reference' in self._sensor_publishers:
            data = encode(ServoReference(stamp, *reference, FRAME))
            self._sensor_publishers['servo_reference'].publish(data)

    def _publish(self, stamp: int, readings: Readings) -> None:
        messages: dict[str, Any] = {}
        if self._settings.messages == 'standard':
            messages = standard_messages.sensor_messages(stamp, readings, self.settings(StandardMessages))
        else:
            if readings.pressure is not None:
                messages['cylinder_pressure'] = encode(Pressure(stamp, *readings.pressure), FRAME)
            if readings.force_sum is not None:
                messages['force_sum'] = encode(Force(stamp, readings.force_sum), FRAME)
            if readings.position is not None:
                messages['rod_position'] = encode(Position(stamp, readings.position), FRAME)
            if readings.velocity is not None:
                messages['rod_velocity'] = encode(Velocity(stamp, readings.velocity, FRAME))
        for topic, message in messages.items():
            self._sensor_publishers[topic].publish(message)

    # --- diagnostics ---

    def diagnostics(self) -> dict[str, DiagnosticStatus]:
        """Pace of the simulation, and counts of faulty references and feed-forwards."""
        if not self.active:
            return {'simulator': status_of(DiagnosticStatus.OK, 'inactive')}
        (before, first), (now, index) = self._reported, (time.monotonic(), self.ticks)
        self._reported = now, index
        seconds = max(now - before, 1e-3)
        rate = (index - first) / seconds
        load = (time.process_time() - self._started[1]) / max(now - self._started[0], 1e-3)
        recent, self._recent = self._recent, Counter()
        self._counts += recent
        level, message = DiagnosticStatus.OK, 'simulating'
        if self._failure:
            level, message = DiagnosticStatus.ERROR, self._failure
        elif any(not name.endswith(_NORMAL_LIMITS) for name in recent):
            level = DiagnosticStatus.WARN
            message = ', '.join(f'{count} {name}' for name, count in sorted(recent.items()))
        force = self._feedforward.force if self._feedforward is not None else math.nan
        values = {
            'rate [Hz]': f'{rate:.1f}',
            'time factor': f'{rate * self._period * 1e-9:.3f}',
            'share of a core [%]': f'{100.0 * load:.1f}',
            'ticks': self.ticks,
            'missed ticks': 0,
            'feed-forward [N]': f'{force:.3f}',
            **dict(sorted(self._counts.items())),
        }
        return {'simulator': status_of(level, message, values)}


def main() -> int:
    """Run the node: ``servo_simulator --ros-args --params-file config/servo_simulator.yaml``."""
    sys.setswitchinterval(_SWITCH_INTERVAL)
    return run(ServoSimulator, ServoSimulator.autostart, ServoSimulator.finish)


if __name__ == '__main__':
    sys.exit(main())
