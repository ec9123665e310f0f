"""What comes late makes no force: a node that was held up, simulated time that stands still, a clock that differs."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from harness.compensation import LIVE
from harness.live_graph import DEFAULTS, Graph, graph, stamped
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from seal_friction_msgs.msg import FrictionEstimate, FrictionFeedForward, ServoReference

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.layouts import FEEDFORWARD_TYPE, VELOCITY_TYPE
from seal_friction_ros.offline.bags.bag import read_messages
from seal_friction_ros.offline.replay.replay import replay

MS = 1_000_000  # [ns]
SPEED = 0.05  # [m/s]
PUSH = 10.0  # [N] less than the force in time
WAITING = 60  # moments that wait while the node is held up; fewer than a subscription keeps
DEEP = QoSProfile(depth=1000)  # what is sent is not lost before the node takes it
NO_SLEW = {'feedforward.slew_limit': 1e9}
"""The force turns with the wanted velocity at once."""


class Rod:
    """Publishes what a moving rod and its controller publish, and hears the feed-forward."""

    def __init__(self, g: Graph, *, is_simulated: bool) -> None:
        self.g, self.stamp, self.is_simulated = g, time.time_ns(), is_simulated
        self.reference = g.probe.create_publisher(ServoReference, 'servo_reference', DEEP)
        self.clock = g.probe.create_publisher(Clock, '/clock', 10) if is_simulated else None
        self.forces: list[float] = []
        self.answered: list[int] = []  # stamps [ns] of the forces
        g.probe.create_subscription(FrictionFeedForward, 'friction_feedforward', self._hear, 1000)
        g.connect()

    def _hear(self, message: FrictionFeedForward) -> None:
        self.forces.append(message.force)
        self.answered.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)

    def forces_since(self, stamp: int) -> list[float]:
        """Forces [N] that answer what was stamped then [ns] or later."""
        return [force for force, answered in zip(self.forces, self.answered, strict=True) if answered >= stamp]

    def want(self, speed: float) -> None:
        """Publish the reference of the next moment; simulated time stays as it is."""
        self.stamp = self.stamp + MS if self.is_simulated else time.time_ns()
        self.reference.publish(stamped(ServoReference(velocity=speed), self.stamp))

    def follow(self, speed: float) -> None:
        """Publish what the sensors of the rod say at this moment."""
        self.g.probe.send(self.stamp, speed, pressure=3e6, force=60.0)

    def move(self, speed: float, *, with_clock: bool = True) -> float:
        """Send one moment, the reference first; the newest force [N] once all answers to it are here."""
        taken, unheard = self.g.estimator.taken, self._unheard()
        is_shown = self.clock is not None and with_clock
        if is_shown:
            now = Clock()
            now.clock.sec, now.clock.nanosec = divmod(self.stamp + MS, 10**9)
            self.clock.publish(now)
        self.want(speed)
        assert self.g.spin_until(lambda: self.g.estimator.taken >= taken + 1 + is_shown)
        self.follow(speed)
        assert self.g.spin_until(lambda: self.g.estimator.taken >= taken + 4 + is_shown and self._unheard() <= unheard)
        return self.forces[-1] if self.forces else 0.0

    def _unheard(self) -> int:
        """Answers that are on their way, and those that were sent before the rod was there."""
        return self.g.estimator.sent - len(self.forces) - len(self.g.probe.estimates)


@contextmanager
def moving_rod(**parameters: Any) -> Iterator[Rod]:
    """A rod whose feed-forward is there."""
    with graph({**DEFAULTS, **LIVE, **parameters}, qos=DEEP) as g:
        rod = Rod(g, is_simulated='use_sim_time' in parameters)
        assert g.spin_until(lambda: rod.move(SPEED) > PUSH)
        yield rod


def test_what_waited_while_the_node_was_held_up_makes_no_force_and_replays_to_the_byte(tmp_path: Path):
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    waited = set()
    with moving_rod(**recording) as rod:
        for _ in range(WAITING):
            rod.want(-SPEED)
            rod.follow(-SPEED)
            waited.add(rod.stamp)
            time.sleep(1e-3)
        time.sleep(0.25)  # the executor takes nothing meanwhile
        assert rod.g.spin_until(lambda: rod.forces_since(min(waited)))
        assert rod.forces_since(min(waited))[0] == 0.0
        assert rod.g.spin_until(lambda: rod.move(-SPEED) < -PUSH)
        rod.g.estimator.finish()
    is_late, recorded, longest = False, set(), round(FeedForwardSettings().lateness_max * 1e9)
    for message in read_messages(tmp_path / 'bag'):
        if message.type_name == VELOCITY_TYPE:
            is_late = message.log_time - message.publish_time > longest
            stamp = decode(VELOCITY_TYPE, message.data).stamp
            assert is_late or stamp not in waited
            recorded.add(stamp)
        elif message.type_name == FEEDFORWARD_TYPE and is_late:
            assert decode(FEEDFORWARD_TYPE, message.data).force == 0.0
    assert recorded & waited  # not all on a busy machine: drivers send best effort
    result = replay(tmp_path / 'bag')
    assert result.identical, result.first_difference


@pytest.mark.parametrize('speed', [SPEED, -SPEED])
def test_simulated_time_that_stands_still_takes_the_force_away_and_is_named(speed: float):
    """Estimates go on. A push of 36 N stayed for as long as one looked, also against a reversed reference."""
    with moving_rod(use_sim_time=True, **NO_SLEW) as rod:
        g, found = rod.g, [1.0]
        while found[-1]:
            found.append(rod.move(speed, with_clock=False))
            assert found[-1] * speed >= 0.0
            assert len(found) < 10_000
        assert g.spin_until(
            lambda: (
                rod.move(speed, with_clock=False) == 0.0
                and 'simulated time stands still' in g.probe.values('estimate').get('message', '')
            )
        )
        assert g.probe.values('estimate')['level'] == '2'
        assert g.probe.estimates[-1].status & FrictionEstimate.LATE_INPUT
        assert g.spin_until(lambda: abs(rod.move(speed)) > PUSH)


def test_before_simulated_time_comes_there_is_no_force():
    with graph({**DEFAULTS, **LIVE, 'use_sim_time': True}) as g:
        rod = Rod(g, is_simulated=True)
        found = {rod.move(SPEED, with_clock=False) for _ in range(300)}
        assert found == {0.0}
        assert g.spin_until(lambda: rod.move(SPEED) > PUSH)


@pytest.mark.parametrize(('ahead', 'named'), [(1, '1.0'), (-1_900_000_000, '-1900000000.')])
def test_a_publisher_whose_clock_differs_makes_no_force_and_is_named(ahead: int, named: str, tmp_path: Path):
    """By a second, and by the 60 years of a board that knows no time of day."""
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    with moving_rod(**recording) as rod:
        g, take = rod.g, rod.g.estimator.on_input
        shift = {'cylinder_pressure': ahead * 10**9}
        g.estimator.on_input = lambda name, data, late: take(name, data, late - shift.get(name, 0))
        assert g.spin_until(lambda: rod.move(SPEED) == 0.0)
        words = f'the clock of the publisher of cylinder_pressure differs by {named}'
        assert g.spin_until(lambda: rod.move(SPEED) == 0.0 and words in g.probe.values('estimate').get('message', ''))
        g.estimator.on_input = take
        assert g.spin_until(lambda: rod.move(SPEED) > PUSH)
        g.estimator.finish()
        assert g.estimator.diagnostics()['recorder'].level == DiagnosticStatus.OK
    result = replay(tmp_path / 'bag')
    assert result.identical, result.first_difference
