"""Where faults are tried: the live estimator on a graph of its own, and a driver in the place of the machine."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fault_rows import AFTER, BEFORE, FADE_TIME, FAULT, MS, SLEW_LIMIT, TIMEOUT, Row, Tick, good
from harness.compensation import LIVE, SCALE
from harness.counted_estimator import CountedEstimator
from harness.spin_nodes import SpunNodes, ros_context
from rclpy.context import Context
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from seal_friction_ros.core.estimation.feedforward import LONGEST_STEP, FeedForwardSettings
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.messages.coder import DECODERS, encode
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, INPUTS, OUTPUTS
from seal_friction_ros.core.messages.records import FeedForward, FrictionEstimate, Limited, Status
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.managed_node import message_class
from seal_friction_ros.offline.replay.replay import replay

START = 1_000_000_000_000  # [ns]
SETTINGS = {
    **LIVE,
    'pressure_timeout': TIMEOUT,
    'force_timeout': TIMEOUT,
    'feedforward.estimate_timeout': TIMEOUT,
    'feedforward.reference_timeout': TIMEOUT,
    'feedforward.fade_time': FADE_TIME,
    'feedforward.slew_limit': SLEW_LIMIT,
}
LEVELS = {getattr(DiagnosticStatus, name): name for name in ('OK', 'WARN', 'ERROR', 'STALE')}
DEEP = QoSProfile(depth=10_000)  # the driver must not lose an output
LOWEST_SHARE = {'as usual': (1.0, 1.0), 'dips': (0.7, 0.99)}
"""Required feed-forward -> bounds of its lowest share of the feed-forward without fault."""
Outputs = list[FrictionEstimate | FeedForward]


class Driver(Node):
    """In the place of drivers and controller: publishes inputs, keeps the outputs."""

    def __init__(self, name: str = 'driver', **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self.inputs = {
            topic: self.create_publisher(message_class(type_name), topic, qos.STREAM)
            for topic, type_name in INPUTS.items()
        }
        self.received = self.estimates = 0
        """number of outputs, and of estimates among them, since the start"""
        self.outputs: Outputs = []
        self.levels: list[str] = []
        self.diagnosed = 0
        """stamp of the newest diagnostics [ns]"""
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        for topic, type_name in OUTPUTS.items():
            self.create_subscription(message_class(type_name), topic, self._receiver(type_name), DEEP, raw=True)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        self.diagnosed = array.header.stamp.sec * 10**9 + array.header.stamp.nanosec
        self.levels += [LEVELS[status.level] for status in array.status if status.name.endswith(': estimate')]

    def _receiver(self, type_name: str) -> Callable[[bytes], None]:
        def receive(data: bytes) -> None:
            self.outputs.append(DECODERS[type_name](data))
            self.received += 1
            self.estimates += type_name == ESTIMATE_TYPE

        return receive

    def publish(self, tick: Tick) -> None:
        """Publish the messages of one moment."""
        for topic, messages in tick.items():
            for message in messages:
                self.inputs[topic].publish(message if isinstance(message, bytes) else encode(message))


class Stage(SpunNodes):
    """Estimator and driver in this process. The time of receipt is that of the moment sent, not that of the machine."""

    def __init__(self, context: Context, estimator: CountedEstimator, driver: Driver) -> None:
        super().__init__(context, estimator, driver)
        self.estimator, self.driver = estimator, driver
        self.now = self.received = self._last_receipt = START

    def connect(self) -> None:
        """Connect estimator and driver; if the estimator is active, send samples until one is answered."""
        super().connect()
        if self.estimator.active and not self.spin_until(self._is_answered):
            raise RuntimeError('no sample is answered')
        self.driver.outputs.clear()

    def receipt_time(self) -> int:
        """The moment [ns]; it increases at every call, as the time of the machine does."""
        self._last_receipt = max(self.received, self._last_receipt + 1)
        return self._last_receipt

    def next_moment(self) -> Tick:
        """The good messages of the next moment, which is 1 ms later."""
        self.now += MS
        self.received += MS
        return good(self.now)

    def _is_answered(self) -> bool:
        """Send one moment; whether the estimator takes all of it and answers within some seconds.

        The first messages may come in another order than they were sent, those with best effort may be lost.
        """
        tick = {topic: messages for topic, messages in self.next_moment().items() if topic in self.driver.inputs}
        wanted, estimates, have_arrived = self.estimator.taken + len(tick), self.driver.estimates, self.all_answers()
        self.driver.publish(tick)
        return self.spin_until(
            lambda: self.estimator.taken >= wanted and self.driver.estimates > estimates and have_arrived(), 5.0
        )

    def restart(self) -> None:
        """Deactivate and activate the estimator, which forgets all inputs.

        Raises:
            RuntimeError: A transition fails, or the feed-forward does not end at 0 N.
        """
        have_arrived = self.all_answers()
        for change in (self.estimator.trigger_deactivate, self.estimator.trigger_activate):
            if change() != TransitionCallbackReturn.SUCCESS:
                raise RuntimeError(f'{change.__name__} fails')
        self.spin_until(have_arrived)
        forces = [output.force for output in self.driver.outputs if isinstance(output, FeedForward)]
        if forces and forces[-1]:
            raise RuntimeError(f'deactivated at {forces[-1]} N')
        self.driver.outputs.clear()

    def send(self, tick: Tick) -> None:
        """Send the messages of one moment; wait until the estimator has taken them and its answers are here.

        Without a velocity the watchdog answers, every 10 ms.

        Raises:
            RuntimeError: They are not.
        """
        wanted = self.estimator.taken + sum(map(len, tick.values()))
        has_arrived = self.all_answers()
        self.driver.publish(tick)
        if not self.spin_until(
            lambda: self.estimator.taken >= wanted and not self.estimator.is_tick_due and has_arrived()
        ):
            raise RuntimeError(
                f'{wanted - self.estimator.taken} inputs not taken, '
                f'{self.driver.received} outputs received of {self.estimator.sent}'
            )

    def all_answers(self) -> Callable[[], bool]:
        """Condition: the driver has received every answer that the estimator sends from now on."""
        sent, received = self.estimator.sent, self.driver.received
        return lambda: self.driver.received - received >= self.estimator.sent - sent

    def run(self, ticks: int, spoil: Callable[[Tick, int], Tick] | None = None) -> Outputs:
        """Send ``ticks`` moments 1 ms apart, each changed by ``spoil``.

        Returns:
            The outputs meanwhile.
        """
        first = len(self.driver.outputs)
        for number in range(ticks):
            tick = self.next_moment()
            self.send(spoil(tick, number) if spoil else tick)
        return self.driver.outputs[first:]

    def level(self) -> str:
        """Highest level of the estimate's diagnostics since the last call: ERROR, WARN, OK or STALE.

        Raises:
            RuntimeError: No diagnostics come.
        """
        before = self.driver.get_clock().now().nanoseconds
        self.estimator.publish_diagnostics()
        self.estimator.end_interval()
        if not self.spin_until(lambda: self.driver.diagnosed >= before):
            raise RuntimeError('no diagnostics')
        seen = set(self.driver.levels)
        self.driver.levels.clear()
        return next(level for level in ('ERROR', 'WARN', 'OK', 'STALE') if level in seen)


@contextmanager
def stage(parameters: Mapping[str, Any] | None = None, *, autostart: bool = True) -> Iterator[Stage]:
    """Estimator and driver on a ROS domain of their own."""
    values = {**SETTINGS, **(parameters or {})}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    with ros_context() as context:
        estimator = CountedEstimator(context=context, parameter_overrides=overrides)
        driver = Driver(context=context)
        made = Stage(context, estimator, driver)
        if not values.get('use_sim_time'):
            estimator.clock = made.receipt_time
        try:
            if autostart and not estimator.autostart():
                raise RuntimeError('the estimator does not start')
            if autostart:
                made.connect()
            yield made
        finally:
            estimator.finish()
            estimator.destroy_node()
            driver.destroy_node()


def statuses(outputs: Outputs) -> set[int]:
    """Status of every estimate, without MOTION_UNCERTAIN, which the first ones after a start have."""
    return {output.status & ~Status.MOTION_UNCERTAIN for output in outputs if isinstance(output, FrictionEstimate)}


def unless(holds: object, difference: str) -> list[str]:
    """The difference, unless ``holds``."""
    return [] if holds else [difference]


def verified(bag: Path) -> list[str]:
    """Difference between a bag and its replay."""
    result = replay(bag)
    return unless(result.identical, f'{bag.name}: {result.first_difference or "no estimate in it"}')


def broken_invariants(outputs: Outputs, live_slew_limit: float | None = None) -> list[str]:
    """What holds for all outputs and does not: numbers are finite, the feed-forward keeps its limits and direction.

    Args:
        outputs: While the wanted velocity is that of `good`.
        live_slew_limit: Slew limit [N/s] if the time of receipt is that of the machine. It is not in the outputs, so
            any step may be the longest one, and a force that is late may fall to 0 at once.
    """
    wrong = [f'not finite: {output}' for output in outputs if not all(map(math.isfinite, output))]
    forces = [output for output in outputs if isinstance(output, FeedForward)]
    fade = max((output.force for output in forces), default=0.0) / FADE_TIME
    for before, after in pairwise(forces):
        change = after.force - before.force
        if live_slew_limit is None:
            step = between(MS * 1e-9, (after.stamp - before.stamp) * 1e-9, LONGEST_STEP)
            jumps = abs(change) > (SLEW_LIMIT + fade) * step + 1e-9
        else:
            jumps = change > (live_slew_limit + fade) * LONGEST_STEP + 1e-9
        if jumps:
            wrong.append(f'feed-forward jumps from {before.force:.3f} to {after.force:.3f} N at {after.stamp} ns')
        if not 0.0 <= after.force <= FeedForwardSettings().force_limit:
            wrong.append(f'feed-forward of {after.force} N')
    return wrong


def try_row(place: Stage, row: Row) -> list[str]:
    """Send good samples, the fault, good samples; differences from the requirements."""
    place.restart()
    before = place.run(BEFORE)
    place.level()
    during = place.run(FAULT, row.spoil)
    if row.level == 'STALE':
        place.level()  # an interval is STALE if it has no sample at all
    level = place.level()
    settling = place.run(5)  # the last sample of the fault may affect the next one
    place.level()
    after = place.run(AFTER)  # the feed-forward comes back, which is a WARN
    place.level()
    calm = place.run(5)
    end_level = place.level()

    wrong = broken_invariants([*before, *during, *settling, *after, *calm])
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
    wrong += _wrong_feedforward(row, estimates, forces)
    wrong += _wrong_recovery(row, after, end_level)
    return wrong


def _wrong_feedforward(row: Row, estimates: list[FrictionEstimate], forces: list[FeedForward]) -> list[str]:
    if not forces:
        return ['no feed-forward']
    last = forces[-1]
    if row.feedforward == 'fades':
        faded = last.force == 0.0 and last.limited & Limited.FADE
        return [] if faded else [f'the feed-forward is still {last.force:.3f} N']
    right = {estimate.stamp: SCALE * estimate.coulomb_friction for estimate in estimates}
    shares = [force.force / right.get(force.stamp, right[estimates[-1].stamp]) for force in forces]
    lowest, highest = LOWEST_SHARE[row.feedforward]
    holds = lowest - 1e-9 <= min(shares) <= highest + 1e-9 and max(shares) <= 1.0 + 1e-9
    back = shares[-1] > 1.0 - 1e-9 or row.feedforward == 'dips'  # the next dip may have begun
    found = f'the feed-forward is {min(shares):.3f} to {max(shares):.3f}, at the end {shares[-1]:.3f}, of the right one'
    return [] if holds and back else [found]


def _wrong_recovery(row: Row, after: Outputs, level: str) -> list[str]:
    wrong = []
    lasts = Status.MODEL_DISAGREES if row.status == 'MODEL_DISAGREES' else 0  # until the rod has turned
    estimates = [output for output in after if isinstance(output, FrictionEstimate)]
    forces = [output for output in after if isinstance(output, FeedForward)]
    bad = [estimate for estimate in estimates if estimate.status & ~lasts]
    if bad:
        wrong.append(f'after the fault: {Status(bad[0].status)!r}')
    if len(estimates) != AFTER or not forces or forces[-1].limited:
        wrong.append(f'after the fault: {len(estimates)} estimates of {AFTER}, last feed-forward {forces[-1:]}')
    if level not in (('OK', 'WARN') if lasts else ('OK',)):
        wrong.append(f'after the fault: diagnostics {level}')
    return wrong
