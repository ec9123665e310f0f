"""Where faults are tried: the live node on a graph of its own, and a driver that says what it is told to."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fault_rows import AFTER, BEFORE, FADE_TIME, FAULT, MS, TIMEOUT, Row, Tick, good
from rclpy.context import Context
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from spun import Spun

from seal_friction_ros.core.estimation.feedforward import LONGEST_STEP, FeedForward, FeedForwardSettings, Limited
from seal_friction_ros.core.estimation.messages import (
    DECODERS,
    ESTIMATE_TYPE,
    FEEDFORWARD_TYPE,
    INPUTS,
    OUTPUTS,
    encode,
)
from seal_friction_ros.core.estimation.records import FrictionEstimate, Status, Velocity
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.discovery import set_up_discovery
from seal_friction_ros.nodes.friction_estimator import FrictionEstimator
from seal_friction_ros.nodes.managed_node import message_class
from seal_friction_ros.nodes.processes import free_domain

START = 1_000_000_000_000  # [ns]
SETTINGS = {
    'pressure_timeout': TIMEOUT,
    'force_timeout': TIMEOUT,
    'feedforward.estimate_timeout': TIMEOUT,
    'feedforward.reference_timeout': TIMEOUT,
    'feedforward.fade_time': FADE_TIME,
}
LEVELS = {getattr(DiagnosticStatus, name): name for name in ('OK', 'WARN', 'ERROR', 'STALE')}
DEEP = QoSProfile(depth=10_000)  # what the driver hears is to be all that was said
LOWEST_SHARE = {'as usual': (1.0, 1.0), 'dips': (0.7, 0.99), 'halves': (0.5, 0.5)}
"""What a row requires of the feed-forward -> bounds of its smallest share of what the friction would have it be."""
Outputs = list[FrictionEstimate | FeedForward]


class Driver(Node):
    """Stands for drivers and controller: publishes inputs, keeps what comes out."""

    def __init__(self, name: str = 'driver', **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self.inputs = {
            topic: self.create_publisher(message_class(type_name), topic, qos.STREAM)
            for topic, type_name in INPUTS.items()
        }
        self.estimates = self.feedforwards = 0
        self.outputs: Outputs = []
        self.levels: list[str] = []
        self.diagnosed = 0
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        for topic, type_name in OUTPUTS.items():
            self.create_subscription(message_class(type_name), topic, self._listen(type_name), DEEP, raw=True)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        self.diagnosed = array.header.stamp.sec * 10**9 + array.header.stamp.nanosec
        self.levels += [LEVELS[status.level] for status in array.status if status.name.endswith(': estimate')]

    def _listen(self, type_name: str) -> Callable[[bytes], None]:
        def hear(data: bytes) -> None:
            self.estimates += type_name == ESTIMATE_TYPE
            self.feedforwards += type_name == FEEDFORWARD_TYPE
            self.outputs.append(DECODERS[type_name](data))

        return hear

    def publish(self, tick: Tick) -> None:
        """Publish a moment."""
        for topic, messages in tick.items():
            for message in messages:
                self.inputs[topic].publish(message if isinstance(message, bytes) else encode(message))


class Stage(Spun):
    """Estimator and driver."""

    def __init__(self, context: Context, estimator: FrictionEstimator, driver: Driver) -> None:
        super().__init__(context, estimator, driver)
        self.estimator, self.driver = estimator, driver
        self.now = START

    def connect(self) -> None:
        """Spin until each hears the other."""
        self.connect_to(self.driver.inputs.values())

    def restart(self) -> None:
        """Let the estimator begin anew, knowing nothing.

        Raises:
            RuntimeError: A transition fails.
        """
        for change in (self.estimator.trigger_deactivate, self.estimator.trigger_activate):
            if change() != TransitionCallbackReturn.SUCCESS:
                raise RuntimeError(f'{change.__name__} fails')
        self.driver.outputs.clear()

    def send(self, tick: Tick) -> None:
        """Send a moment, wait for the answers to its velocities."""
        driver = self.driver
        estimates, feedforwards = driver.estimates, driver.feedforwards
        driver.publish(tick)
        expected = sum(isinstance(message, Velocity) for message in tick['rod_velocity'])
        if expected:
            answered = self.spin_until(lambda: driver.estimates >= estimates + expected)
            if not answered:
                raise RuntimeError(f'{expected} velocities, {driver.estimates - estimates} answers')
            self.spin_until(lambda: driver.feedforwards >= feedforwards + expected, 0.02)
        else:
            self.spin(0.002)

    def run(self, ticks: int, spoil: Callable[[Tick, int], Tick] | None = None, shift: int = 0) -> Outputs:
        """Send so many moments of 1 ms, spoilt; what came out."""
        first = len(self.driver.outputs)
        for number in range(ticks):
            self.now += MS
            tick = good(self.now)
            self.send(spoil(tick, number) if spoil else tick)
        self.now += shift
        self.spin(0.003)  # for what is still on its way
        return self.driver.outputs[first:]

    def level(self) -> str:
        """Level of the diagnostics of the estimate since they were last asked for; STALE if nothing else was said."""
        before = self.driver.get_clock().now().nanoseconds
        self.estimator.publish_diagnostics()
        self.estimator.end_interval()
        if not self.spin_until(lambda: self.driver.diagnosed >= before):
            raise RuntimeError('no diagnostics')
        said = set(self.driver.levels)
        self.driver.levels.clear()
        return next(level for level in ('ERROR', 'WARN', 'OK', 'STALE') if level in said)


@contextmanager
def stage(parameters: Mapping[str, Any] | None = None, *, autostart: bool = True) -> Iterator[Stage]:
    """A graph that nobody else is on."""
    set_up_discovery()
    context = Context()
    rclpy.init(context=context, domain_id=free_domain())
    values = {**SETTINGS, **(parameters or {})}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    estimator = FrictionEstimator(context=context, parameter_overrides=overrides)
    driver = Driver(context=context)
    try:
        if autostart and not estimator.autostart():
            raise RuntimeError('the estimator does not start')
        made = Stage(context, estimator, driver)
        if autostart:
            made.connect()
        yield made
    finally:
        estimator.finish()
        estimator.destroy_node()
        driver.destroy_node()
        rclpy.try_shutdown(context=context)


def complaints_at_any_time(outputs: Outputs) -> list[str]:
    """What must never be: a number that is not finite, or a feed-forward that leaps."""
    settings = FeedForwardSettings()
    wrong = [f'not finite: {output}' for output in outputs if not all(map(math.isfinite, output))]
    forces = [output for output in outputs if isinstance(output, FeedForward)]
    for before, after in pairwise(forces):
        elapsed = min(max((after.stamp - before.stamp) * 1e-9, 0.0), LONGEST_STEP)
        if abs(after.force - before.force) > settings.slew_limit * elapsed + 1e-9:
            wrong.append(f'feed-forward leaps from {before.force:.3f} to {after.force:.3f} N at {after.stamp} ns')
        if abs(after.force) > settings.force_limit:
            wrong.append(f'feed-forward of {after.force} N')
    return wrong


def try_row(place: Stage, row: Row) -> list[str]:
    """Send good samples, the fault, good samples; what was not as required."""
    place.restart()
    before = place.run(BEFORE)
    place.level()
    during = place.run(FAULT, row.spoil, row.shift)
    if row.level == 'STALE':
        place.level()  # silence shows once a whole interval was silent
    level = place.level()
    settling = place.run(5)  # the last sample of the fault may cost the next one, too
    place.level()
    after = place.run(AFTER)  # the feed-forward comes back, which is a WARN, too
    place.level()
    calm = place.run(5)
    end_level = place.level()

    wrong = complaints_at_any_time([*before, *during, *settling, *after, *calm])
    estimates = [output for output in during if isinstance(output, FrictionEstimate)]
    forces = [output for output in during if isinstance(output, FeedForward)]
    seen = Status(0)
    for estimate in estimates:
        seen |= Status(estimate.status)
    wanted = Status(0)
    for name in row.status.split() if row.status != 'any' else []:
        wanted |= Status[name]
    if row.status != 'any' and seen != wanted:
        wrong.append(f'status {seen!r}, not {wanted!r}')
    states = {estimate.state for estimate in estimates}
    if states != set(row.state):
        wrong.append(f'states {states}, not {set(row.state)}')
    if level != row.level:
        wrong.append(f'diagnostics {level}, not {row.level}')
    wrong += _complaints_of_force(row, estimates, forces)
    wrong += _complaints_of_recovery(after, end_level)
    return wrong


def _complaints_of_force(row: Row, estimates: list[FrictionEstimate], forces: list[FeedForward]) -> list[str]:
    scale = FeedForwardSettings().coulomb_scale
    if row.feedforward == 'nothing':
        return [f'{len(forces)} feed-forwards'] if forces else []
    if not forces:
        return ['no feed-forward']
    last = forces[-1]
    if row.feedforward == 'fades':
        faded = last.force == 0.0 and last.limited & Limited.FADE
        return [] if faded else [f'the feed-forward is still {last.force:.3f} N']
    right = {estimate.stamp: scale * estimate.coulomb_friction for estimate in estimates}
    shares = [force.force / right.get(force.stamp, right[estimates[-1].stamp]) for force in forces]
    lowest, highest = LOWEST_SHARE[row.feedforward]
    holds = lowest - 1e-9 <= min(shares) <= highest + 1e-9 and max(shares) <= 1.0 + 1e-9
    back = shares[-1] > 1.0 - 1e-9 or row.feedforward == 'dips'  # the next dip may have begun
    said = f'the feed-forward is {min(shares):.3f} to {max(shares):.3f}, at the end {shares[-1]:.3f}, of what is right'
    return [] if holds and back else [said]


def _complaints_of_recovery(after: Outputs, level: str) -> list[str]:
    wrong = []
    estimates = [output for output in after if isinstance(output, FrictionEstimate)]
    forces = [output for output in after if isinstance(output, FeedForward)]
    bad = [estimate for estimate in estimates if estimate.status]
    if bad:
        wrong.append(f'after it: {Status(bad[0].status)!r}')
    if len(estimates) != AFTER or not forces or forces[-1].limited:
        wrong.append(f'after it: {len(estimates)} estimates of {AFTER}, the last feed-forward is {forces[-1:]}')
    if level != 'OK':
        wrong.append(f'after it: diagnostics {level}')
    return wrong
