"""A servo actuator that is not there: the topics of a real one, in real time or faster, from ``core.servo``."""

import math
import sys
import threading
import time
from collections import Counter, deque
from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rosgraph_msgs.msg import Clock as ClockMessage

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.feedforward import FeedForward
from seal_friction_ros.core.estimation.messages import FEEDFORWARD_TYPE, INPUTS, REFERENCE_TYPE, decode, encode
from seal_friction_ros.core.estimation.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.servo.controller import Limited, ServoController
from seal_friction_ros.core.servo.motions import Chirp, PullTest, Reference, Sine, Step, Trapezoid, Wave
from seal_friction_ros.core.servo.plant import Cylinder, Load, ServoValve
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, outputs, step
from seal_friction_ros.core.servo.pull_rig import PullRig, init_pull_rig, pull_rig, step_pull_rig
from seal_friction_ros.core.servo.sensors import Readings, SensorSettings, read
from seal_friction_ros.files import load_seals
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.executor import run
from seal_friction_ros.nodes.managed_node import ManagedNode, message_class
from seal_friction_ros.nodes.parameters import Group

FRAME = b'rod'
WAVES: dict[str, type[Any]] = {'sine': Sine, 'step': Step, 'trapezoid': Trapezoid, 'chirp': Chirp}
"""What the reference can be besides ``topic`` and ``pull_test``."""

PLANT: dict[str, type[Any]] = {'valve': ServoValve, 'cylinder': Cylinder, 'load': Load, 'controller': ServoController}
_OUTPUTS = ('cylinder_pressure', 'force_sum', 'servo_reference', 'rod_position', 'rod_velocity')  # velocity last
_LONGEST_CATCH_UP = 0.1  # [s] what a longer stall cost is left out of the simulation
_SWITCH_INTERVAL = 2e-4  # [s] diagnostics keep a tick waiting no longer than this; Python's own choice is 5 ms
_SECOND = 1_000_000_000  # [ns]
_HARMLESS = ('limited FORCE', 'limited SPOOL')  # as hard as the servo can


@dataclass(frozen=True)
class SimulatorSettings:
    """What the node does, one field per ROS parameter.

    Raises:
        ValueError: A value is out of bounds, ``wave`` is none of those there are, or time shall run at another pace
            with nobody told so.
    """

    wave: str = parameter(
        'sine',
        unit='',
        description='Reference: sine, step, trapezoid, chirp; topic; or pull_test, a rig without servo.',
    )
    use_feedforward: bool = parameter(
        True, unit='', description='Add what comes on friction_feedforward to the force command.'
    )
    feedforward_timeout: float = parameter(
        0.05, unit='s', lower=1e-3, upper=10.0, description='A feed-forward older than this counts as 0 N.'
    )
    reference_timeout: float = parameter(
        0.5, unit='s', lower=1e-3, upper=60.0, description='wave: topic. Without a new reference the rod is held.'
    )
    rate: float = parameter(
        1000.0, unit='Hz', lower=10.0, upper=10000.0, live=False, description='Samples and control steps per second.'
    )
    inner_step: float = parameter(
        1e-4, unit='s', lower=1e-6, upper=0.1, live=False, description='Longest time step of valve, cylinder and load.'
    )
    start_position: float = parameter(
        0.0, unit='m', lower=-10.0, upper=10.0, live=False, description='Where the rod is at the start.'
    )
    publish_clock: bool = parameter(
        False, unit='', live=False, description='Publish /clock, from 0 s, for nodes with use_sim_time.'
    )
    time_factor: float = parameter(
        1.0,
        unit='1',
        lower=0.01,
        upper=1000.0,
        live=False,
        description='Times real time; needs publish_clock if not 1.',
    )

    def __post_init__(self) -> None:
        check(self)
        names = (*WAVES, 'topic', 'pull_test')
        if self.wave not in names:
            raise ValueError(f'SimulatorSettings.wave = {self.wave!r} is none of {", ".join(names)}')
        if self.time_factor != 1.0 and not self.publish_clock:
            raise ValueError(
                f'SimulatorSettings.time_factor = {self.time_factor} needs publish_clock, and use_sim_time elsewhere'
            )


class ServoSimulator(ManagedNode):
    """Lifecycle node around ``core.servo`` and ``core.pull_rig``.

    Raises:
        ValueError: A parameter is of the wrong type or out of bounds.
    """

    GROUPS = (
        Group(SimulatorSettings),
        Group(SealSelection),
        *(Group(record_type, f'{name}.', live=False) for name, record_type in PLANT.items()),
        *(Group(record_type, f'{name}.') for name, record_type in WAVES.items()),
        Group(PullTest, 'pull_test.', live=False),
        Group(SensorSettings, 'sensors.'),
    )

    def __init__(self, **kwargs: Any) -> None:
        self._sensor_publishers: dict[str, Any] = {}
        self._clock_publisher: Any = None
        self._thread: threading.Thread | None = None
        self._running = False
        self._listeners: list[Any] = []
        super().__init__('servo_simulator', self.GROUPS, **kwargs)

    # --- lifecycle ---

    def make(self) -> None:
        """Build the servo, compile it, make publishers and subscriptions."""
        self._settings = self.settings(SimulatorSettings)
        self._build()
        for topic in _OUTPUTS:
            if topic != 'servo_reference' or self._settings.wave in WAVES:
                self._sensor_publishers[topic] = self.create_lifecycle_publisher(
                    message_class(INPUTS[topic]), topic, qos.STREAM, qos_overriding_options=qos.overridable()
                )
        if self._settings.publish_clock:
            self._clock_publisher = self.create_publisher(ClockMessage, '/clock', qos.CLOCK)
        self._listen('friction_feedforward', FEEDFORWARD_TYPE, self._on_feedforward)
        if self._settings.wave == 'topic':
            self._listen('servo_reference', REFERENCE_TYPE, self._on_reference)

    def _listen(self, topic: str, type_name: str, callback: Any) -> None:
        options = qos.overridable()
        self._listeners.append(
            self.create_subscription(
                message_class(type_name), topic, callback, qos.STREAM, raw=True, qos_overriding_options=options
            )
        )

    def _build(self) -> None:
        period = 1.0 / self._settings.rate
        seals = load_seals(self.settings(SealSelection))
        self._rig: PullRig | None = None
        if self._settings.wave == 'pull_test':
            self._rig = pull_rig(self.settings(PullTest), seals, period)
            step_pull_rig(self._rig, init_pull_rig(self._rig), 0.0)  # compiles
        else:
            self._servo = self._servo_parameters()
            step(self._servo, init(self._servo, self._settings.start_position), Reference(0.0))  # compiles
        read(self.settings(SensorSettings), 0, Readings(None, None, None, None))  # loads the random numbers

    def _servo_parameters(self, changed: dict[type, Any] | None = None) -> ServoParameters:
        made = changed or {}
        settings = made.get(SimulatorSettings, None) or self.settings(SimulatorSettings)
        period = 1.0 / settings.rate
        return ServoParameters(
            seals=load_seals(made.get(SealSelection, None) or self.settings(SealSelection)),
            control_period=period,
            inner_step=period / math.ceil(period / settings.inner_step - 1e-9),
            **{name: made.get(kind, None) or self.settings(kind) for name, kind in PLANT.items()},
        )

    def release(self) -> None:
        """Give publishers and subscriptions back."""
        for publisher in (*self._sensor_publishers.values(), self._clock_publisher):
            if publisher is not None:
                self.destroy_publisher(publisher)
        for listener in self._listeners:
            self.destroy_subscription(listener)
        self._sensor_publishers.clear()
        self._listeners.clear()
        self._clock_publisher = None

    def start(self) -> None:
        """Put the rod where it starts, at rest, and let time run."""
        settings = self._settings
        self._take_over()
        self._wave_since = 0
        self._index = 0
        self._period = round(_SECOND / settings.rate)
        self._origin = 0 if settings.publish_clock else self.get_clock().now().nanoseconds
        self._feedforward: FeedForward | None = None
        self._reference: ServoReference | None = None
        self._under_way: deque[tuple[int, Readings]] = deque()
        self._counts: Counter[str] = Counter()
        self._recent: Counter[str] = Counter()
        self._reported = (time.monotonic(), 0)
        self._began = (time.monotonic(), time.process_time())
        if self._rig is not None:
            self._rig_state = init_pull_rig(self._rig)
            self._outputs = outputs(self._rig.servos[0], self._rig_state.plant)
        else:
            self._state = init(self._servo, settings.start_position)
            self._outputs = outputs(self._servo, self._state.plant)
        self._tick_wall = self._period / settings.time_factor
        self._failure = ''
        self._running = True
        self._thread = threading.Thread(target=self._run, name='time', daemon=True)
        self._thread.start()
        self.get_logger().info('simulating')

    def finish(self) -> None:
        """Stop time."""
        self.active = False
        self._running = False
        if self._thread is not None:
            self._thread.join()
        self._thread = None

    # --- parameters ---

    def check_change(self, changed: dict[type, Any]) -> None:
        """Refuse a plant that is unstable or unphysical, and a wave that needs other topics than there are."""
        settings = changed.get(SimulatorSettings)
        if self.configured and settings is not None and settings.wave != self._settings.wave:
            self._check_waves(settings.wave)
        if not self.configured and (changed.keys() & {SimulatorSettings, SealSelection, *PLANT.values()}):
            self._servo_parameters(changed)

    def _check_waves(self, wave: str) -> None:
        if not {wave, self._settings.wave} <= WAVES.keys():
            raise ValueError('wave: to and from topic and pull_test only while the node is unconfigured')

    def on_change(self) -> None:
        """Take a changed wave, sensor or switch over; another wave begins at its beginning."""
        settings = self.settings(SimulatorSettings)
        if self.active and settings.wave != self._settings.wave:
            self._wave_since = self._index
        self._settings = settings
        self._take_over()

    def _take_over(self) -> None:
        self._sensors = self.settings(SensorSettings)
        self._delay = round(self._sensors.delay * self._settings.rate)  # [samples]
        self._wave: Wave | None = self.settings(WAVES[self._settings.wave]) if self._settings.wave in WAVES else None

    # --- what comes in ---

    def _on_feedforward(self, data: bytes) -> None:
        try:
            self._feedforward = decode(FEEDFORWARD_TYPE, data)
        except ValueError as error:
            self._malformed('friction_feedforward', error)

    def _on_reference(self, data: bytes) -> None:
        try:
            self._reference = decode(REFERENCE_TYPE, data)
        except ValueError as error:
            self._malformed('servo_reference', error)

    def _malformed(self, topic: str, error: ValueError) -> None:
        if self.active:
            self._recent[f'{topic} malformed'] += 1
            self.get_logger().error(f'{topic}: {error}', throttle_duration_sec=1.0)

    # --- time ---

    def _run(self) -> None:
        """Let time run, in a thread of its own: a timer of rclpy costs half as much again as all of a sample."""
        self._due = float(time.perf_counter_ns())
        try:
            while self._running:
                late = time.perf_counter_ns() - self._due
                if late < 0.0:
                    time.sleep(-late * 1e-9)
                    continue
                self._count_late(late)
                self._tick()
                self._due += self._tick_wall
        except Exception as error:  # noqa: BLE001  a thread must not end without a word
            self._failure = f'stopped: {error!r}'
            self.get_logger().error(self._failure)

    def _count_late(self, late: float) -> None:
        """Count a tick that comes ``late`` [ns] by more than a period; after a stall, go on from now."""
        if self._clock_publisher is None and late > self._tick_wall:
            self._recent['missed ticks'] += 1
        if late > _LONGEST_CATCH_UP * _SECOND:
            lost = int(late // self._tick_wall)
            self._due += lost * self._tick_wall
            if self._clock_publisher is None:  # stamps stay with the clock of the others
                self._origin += lost * self._period
                self._recent['missed ticks'] += lost

    def _tick(self) -> None:
        """Publish the servo as it is now; then let the controller act, and time go on to the next sample."""
        stamp = self._origin + self._index * self._period
        reference = self._reference_at(stamp)
        truth, limited = self._outputs, 0
        readings = Readings((truth.pressure_a, truth.pressure_b), truth.velocity, truth.force_sum, truth.position)
        self._under_way.append((stamp, read(self._sensors, self._index, readings)))
        if self._clock_publisher is not None:
            seconds, nanoseconds = divmod(stamp, _SECOND)
            self._clock_publisher.publish(ClockMessage(clock=Time(sec=seconds, nanosec=nanoseconds)))
        if reference is not None and 'servo_reference' in self._sensor_publishers:
            data = encode(ServoReference(stamp, *reference, FRAME))
            self._sensor_publishers['servo_reference'].publish(data)
        while len(self._under_way) > self._delay:
            self._publish(*self._under_way.popleft())
        if self._rig is not None:
            time_now = self._index * self._period * 1e-9
            self._rig_state, self._outputs = step_pull_rig(self._rig, self._rig_state, time_now)
        elif reference is not None:
            self._state, self._outputs = step(self._servo, self._state, reference, self._feedforward_at(stamp))
            limited = self._outputs.command.limited
        if limited:
            self._recent.update(f'limited {bit.name}' for bit in Limited if limited & bit)
        self._index += 1

    def _reference_at(self, stamp: int) -> Reference | None:
        """Reference at ``stamp`` [ns]; None on a rig that has none."""
        if self._wave is not None:
            return self._wave.at((self._index - self._wave_since) * self._period * 1e-9)
        if self._rig is not None:
            return None
        newest = self._reference
        if newest is None:
            return Reference(self._settings.start_position)
        if abs(stamp - newest.stamp) * 1e-9 > self._settings.reference_timeout:
            self._recent['references too old'] += 1
            return Reference(newest.position)
        return Reference(newest.position, newest.velocity, newest.acceleration)

    def _feedforward_at(self, stamp: int) -> float:
        newest = self._feedforward
        if newest is None or not self._settings.use_feedforward:
            return 0.0
        if abs(stamp - newest.stamp) * 1e-9 > self._settings.feedforward_timeout:
            self._recent['feed-forwards too old'] += 1
            return 0.0
        return newest.force

    def _publish(self, stamp: int, readings: Readings) -> None:
        send = self._sensor_publishers
        if readings.pressure is not None:
            send['cylinder_pressure'].publish(encode(Pressure(stamp, *readings.pressure), FRAME))
        if readings.force_sum is not None:
            send['force_sum'].publish(encode(Force(stamp, readings.force_sum), FRAME))
        if readings.position is not None:
            send['rod_position'].publish(encode(Position(stamp, readings.position), FRAME))
        if readings.velocity is not None:
            send['rod_velocity'].publish(encode(Velocity(stamp, readings.velocity, FRAME)))

    # --- diagnostics ---

    def diagnostics(self) -> dict[str, DiagnosticStatus]:
        """Whether time keeps its pace, and what was wrong with references and feed-forward."""
        status = DiagnosticStatus(level=DiagnosticStatus.OK, message='simulating')
        if not self.active:
            status.message = 'inactive'
            return {'simulator': status}
        since, index = self._reported
        now = (time.monotonic(), self._index)
        self._reported = now
        seconds, whole = max(now[0] - since, 1e-3), max(now[0] - self._began[0], 1e-3)
        recent, self._recent = self._recent, Counter()
        self._counts += recent
        if self._failure:
            status.level, status.message = DiagnosticStatus.ERROR, self._failure
        elif any(not name.endswith(_HARMLESS) for name in recent):
            status.level = DiagnosticStatus.WARN
            status.message = ', '.join(f'{count} {name}' for name, count in sorted(recent.items()))
        force = self._feedforward.force if self._feedforward is not None else math.nan
        values = {
            'rate [Hz]': f'{(now[1] - index) / seconds:.1f}',
            'time factor': f'{(now[1] - index) * self._period * 1e-9 / seconds:.3f}',
            'share of a core [%]': f'{100.0 * (time.process_time() - self._began[1]) / whole:.1f}',
            'ticks': str(self._index),
            'missed ticks': '0',
            'feed-forward [N]': f'{force:.3f}',
            **{name: str(count) for name, count in sorted(self._counts.items())},
        }
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        return {'simulator': status}


def main() -> int:
    """Run the node: ``servo_simulator --ros-args --params-file config/servo_simulator.yaml``."""
    sys.setswitchinterval(_SWITCH_INTERVAL)
    return run(ServoSimulator, ServoSimulator.autostart, ServoSimulator.finish)


if __name__ == '__main__':
    sys.exit(main())
