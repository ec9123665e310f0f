"""Faults of graph and disk, tried on an estimator in this process; see ``faults.py``.

Each function is one try: it takes random numbers and an empty folder and returns the differences from the requirements.
"""

import os
import random
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fault_rows import AFTER, BEFORE, SLEW_LIMIT, UNKNOWN, Tick
from fault_stage import Outputs, Stage, broken_invariants, stage, statuses, unless, verified
from harness.blocked_disk import BlockedDisk
from harness.spin_nodes import ros_context
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from seal_friction_msgs.msg import CylinderPressure, FrictionEstimate, RodVelocity
from std_msgs.msg import Float64

from seal_friction_ros.core.messages import records
from seal_friction_ros.core.messages.records import FeedForward, Status
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.friction_estimator import FrictionEstimator
from seal_friction_ros.offline.bags import mcap_writer


def unrecovered(
    place: Stage, spoil: Callable[[Tick, int], Tick] | None = None, live_slew_limit: float | None = None
) -> list[str]:
    """Send good samples; differences from normal operation, and broken invariants since the start."""
    place.run(BEFORE, spoil)
    outputs = place.run(AFTER, spoil)
    forces = [output for output in outputs if isinstance(output, FeedForward)]
    wrong = unless(statuses(outputs) == {0}, f'after the fault: statuses {statuses(outputs)}')
    wrong += unless(forces and not forces[-1].limited, f'after the fault: feed-forward {forces[-1:]}')
    return wrong + broken_invariants(place.driver.outputs, live_slew_limit)


def recording_to(folder: Path) -> dict[str, Any]:
    """Parameters that record to ``bag`` in a folder."""
    return {'record': True, 'record_directory': str(folder), 'record_name': 'bag'}


def message(place: Stage) -> str:
    """Message of the current diagnostics of the estimate."""
    return str(place.estimator.diagnostics()['estimate'].message)


def unless_alone(place: Stage) -> list[str]:
    """Wait until no topic has several publishers: one that was destroyed may be heard of for some time."""
    alone = place.spin_until(lambda: 'several publishers' not in message(place))
    return unless(alone, f'named although it is gone: {message(place)}')


def best_effort_publisher(place: Stage) -> str | None:
    """Node whose velocity is taken with best effort, according to the diagnostics."""
    values = {value.key: value.value for value in place.estimator.diagnostics()['estimate'].values}
    return values.get('rod_velocity best effort only, from')


# --- graph ---


def topic_comes_late(chance: random.Random, folder: Path) -> list[str]:
    """The pressure has no publisher at first."""
    del chance, folder
    with stage() as place:
        place.restart()
        place.driver.destroy_publisher(place.driver.inputs.pop('cylinder_pressure'))
        early = place.run(30, lambda tick, _: {name: tick[name] for name in tick if name != 'cylinder_pressure'})
        place.driver.inputs['cylinder_pressure'] = place.driver.create_publisher(
            CylinderPressure, 'cylinder_pressure', QoSProfile(depth=100)
        )
        place.connect()
        wrong = unless(statuses(early) == {Status.PRESSURE_MISSING}, f'before: {statuses(early)}')
        estimates = [o for o in early if isinstance(o, records.FrictionEstimate)]
        wrong += unless({e.state for e in estimates} == set(UNKNOWN), 'before: a state without pressure')
        forces = {o.force for o in early if isinstance(o, FeedForward)}
        wrong += unless(forces == {0.0}, f'before: feed-forward {forces}')
        return wrong + unrecovered(place)


@contextmanager
def intruder(place: Stage, name: str = 'intruder') -> Iterator[Node]:
    """A node with a context of its own, which the middleware treats like a node of another process."""
    with ros_context(place.context.get_domain_id()) as context:
        node = Node(name, context=context)
        try:
            yield node
        finally:
            node.destroy_node()


def second_publisher(chance: random.Random, folder: Path, *, refuse: bool = True) -> list[str]:
    """Another node publishes an input."""
    del folder
    topic, kind = chance.choice([('rod_velocity', RodVelocity), ('cylinder_pressure', CylinderPressure)])
    expected = f'/{topic} has several publishers: /driver, /intruder'
    with stage({'refuse_second_publisher': refuse}) as place:
        wrong = []
        place.run(60)
        with intruder(place) as other:
            other.create_publisher(kind, topic, 10)
            wrong += unless(place.spin_until(lambda: expected in message(place)), f'not named: {message(place)}')
            for _ in range(2):
                place.level()
                during = place.run(60)
                level = place.level()
                forces = [output for output in during if isinstance(output, FeedForward)]
                if refuse:
                    wrong += unless(statuses(during) == {Status.INPUT_REFUSED}, f'{statuses(during)} while refused')
                    wrong += unless(forces[-1].force == 0.0, f'still {forces[-1].force} N')
                    wrong += unless(level == 'ERROR', level)
                else:
                    wrong += unless(statuses(during) == {0}, f'{statuses(during)}') + unless(level == 'WARN', level)
                wrong += broken_invariants(place.driver.outputs)
                place.restart()  # inputs are refused after a restart, too
        return wrong + unless_alone(place) + unrecovered(place)


def second_publisher_allowed(chance: random.Random, folder: Path) -> list[str]:
    """Another node publishes an input, without ``refuse_second_publisher``."""
    return second_publisher(chance, folder, refuse=False)


def incompatible_quality(chance: random.Random, folder: Path) -> list[str]:
    """A publisher with best effort, a subscriber that wants transient local, a publisher of another type."""
    del chance, folder
    with stage(autostart=False) as place:
        place.driver.destroy_publisher(place.driver.inputs['rod_velocity'])
        place.driver.inputs['rod_velocity'] = place.driver.create_publisher(
            RodVelocity, 'rod_velocity', qos_profile_sensor_data
        )
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        if not place.estimator.autostart():
            return ['does not start']
        with intruder(place, 'logger') as other, intruder(place, 'odd_driver') as odd:
            other.create_subscription(FrictionEstimate, 'friction_estimate', lambda _: None, latched)
            odd.create_publisher(Float64, 'rod_position', 10)
            place.driver.destroy_publisher(place.driver.inputs.pop('rod_position'))
            wrong = []
            for text in (
                '/logger wants incompatible quality of service (volatile where transient local is wanted)',
                '/odd_driver publishes std_msgs/msg/Float64, not seal_friction_msgs/msg/RodPosition',
            ):
                found = place.spin_until(lambda text=text: text in message(place))
                wrong += unless(found, f'missing: {text}; instead: {message(place)}')
            found = best_effort_publisher(place)
            wrong += unless(found == '/driver', f'best effort taken from {found}')
        place.connect()
        wrong += unless_alone(place) + unrecovered(place)
        for quality, wanted in ((qos.STREAM, None), (qos_profile_sensor_data, '/driver')):
            place.driver.destroy_publisher(place.driver.inputs['rod_velocity'])
            place.driver.inputs['rod_velocity'] = place.driver.create_publisher(RodVelocity, 'rod_velocity', quality)
            found = place.spin_until(lambda wanted=wanted: best_effort_publisher(place) == wanted)
            wrong += unless(found, f'best effort from {best_effort_publisher(place)}, not {wanted}')
            place.connect()
            wrong += unless_alone(place) + unrecovered(place)
        return wrong


def second_estimator(chance: random.Random, folder: Path) -> list[str]:
    """Another estimator with the same name."""
    del chance, folder
    with stage() as place:
        expected = '/friction_estimate has several publishers: /friction_estimator, /friction_estimator'
        with ros_context(place.context.get_domain_id()) as context:
            twin = FrictionEstimator(context=context)
            try:
                wrong = unless(twin.autostart(), 'the second one does not start')
                wrong += unless(place.spin_until(lambda: expected in message(place)), f'not named: {message(place)}')
                during = place.run(60)
            finally:
                twin.finish()
                twin.destroy_node()
        wrong += unless(statuses(during) == {Status.INPUT_REFUSED}, f'{statuses(during)}')
        return wrong + unless_alone(place) + unrecovered(place)


def parameters_change(chance: random.Random, folder: Path) -> list[str]:
    """Parameters change every few samples, some to invalid values."""
    with stage(recording_to(folder)) as place:
        outputs = place.run(60)
        wrong = []
        for _ in range(25):
            name, value, is_valid = chance.choice(
                [
                    ('feedforward.scale', chance.uniform(0.0, 1.5), True),
                    ('feedforward.smoothing_velocity', chance.uniform(1e-4, 0.5), True),
                    ('feedforward.force_limit', chance.uniform(0.0, 60.0), True),
                    ('feedforward.lead_time', chance.uniform(0.0, 0.1), True),
                    ('slip_velocity', chance.uniform(2e-3, 0.2), True),
                    ('use_stiction', chance.random() < 0.5, True),
                    ('feedforward.scale', float('nan'), False),
                    ('stick_velocity', 5.0, False),
                    ('seals', ['nothing'], False),
                    ('pressure_timeout', 'long', False),
                ]
            )
            (result,) = place.estimator.set_parameters([Parameter(name, value=value)])
            wrong += unless(result.successful == is_valid, f'{name} = {value}: {result}')
            outputs += place.run(chance.randrange(1, 8))
        wrong += broken_invariants(outputs) + unless(statuses(outputs) == {0}, f'{statuses(outputs)}')
        place.estimator.finish()
    return wrong + verified(folder / 'bag')


LEGAL = {
    ('unconfigured', Transition.TRANSITION_CONFIGURE): 'inactive',
    ('inactive', Transition.TRANSITION_CLEANUP): 'unconfigured',
    ('inactive', Transition.TRANSITION_ACTIVATE): 'active',
    ('active', Transition.TRANSITION_DEACTIVATE): 'inactive',
}
"""State and transition -> next state."""


def lifecycle_in_any_order(chance: random.Random, folder: Path) -> list[str]:
    """Transitions by service, legal or not, repeated, while inputs come."""
    del folder
    with stage() as place:
        client = place.driver.create_client(ChangeState, 'friction_estimator/change_state')
        place.spin_until(client.service_is_ready)
        state, wrong = 'active', []

        def change(number: int) -> bool:
            """Request a transition while inputs come; whether it succeeds."""
            have_arrived = place.all_answers()
            for _ in range(chance.randrange(4)):
                place.driver.publish(place.next_moment())
            future = client.call_async(ChangeState.Request(transition=Transition(id=number)))
            return place.spin_until(lambda: future.done() and have_arrived()) and future.result().success

        for _ in range(20):
            number = chance.choice([number for _, number in LEGAL])
            succeeded = change(number)
            wrong += broken_invariants(place.driver.outputs)
            wrong += unless(succeeded == ((state, number) in LEGAL), f'transition {number} while {state}: {succeeded}')
            if succeeded:
                place.driver.outputs.clear()  # the invariants hold from activation to deactivation
                place.connect()
            state = LEGAL.get((state, number), state)
        for at, number in (
            ('unconfigured', Transition.TRANSITION_CONFIGURE),
            ('inactive', Transition.TRANSITION_ACTIVATE),
        ):
            if state == at:
                wrong += unless(change(number), f'transition {number} at the end')
                state = LEGAL[at, number]
                place.connect()
        return wrong + unrecovered(place)


@contextmanager
def simulated_time(folder: Path) -> Iterator[tuple[Stage, Callable[[Tick, int], Tick]]]:
    """An estimator with ``use_sim_time``, and a function that moves ``/clock`` to the moment of a tick."""
    slow = {'feedforward.lateness_max': 10.0, 'feedforward.estimate_timeout': 0.2, 'feedforward.reference_timeout': 0.2}
    with stage(recording_to(folder) | slow | {'use_sim_time': True}) as place:  # on the clock of a busy machine
        clock = place.driver.create_publisher(Clock, '/clock', 10)
        place.connect()

        def move(tick: Tick, _: int) -> Tick:
            """Publish the clock."""
            taken, now = place.estimator.taken, Clock()
            now.clock.sec, now.clock.nanosec = divmod(place.now, 10**9)
            clock.publish(now)
            place.spin_until(lambda: place.estimator.taken > taken)
            return tick

        yield place, move


def simulated_time_is_reset(chance: random.Random, folder: Path) -> list[str]:
    """``/clock`` jumps back to 0 and goes on from there."""
    del chance
    with simulated_time(folder) as (place, move):
        place.run(60, move)
        place.now = 0
        after = place.run(60, move)
        marked = [o.status & ~Status.MOTION_UNCERTAIN for o in after if isinstance(o, records.FrictionEstimate)]
        wrong = unless(marked == [Status.STAMP_NOT_INCREASING] + [0] * 59, f'{marked[:5]}')
        wrong += unrecovered(place, move, SLEW_LIMIT)
        place.estimator.finish()
    return wrong + verified(folder / 'bag')


def simulated_time_stands_still(chance: random.Random, folder: Path) -> list[str]:
    """``/clock`` stops, while all inputs go on with its last time; later it goes on."""
    del chance
    with simulated_time(folder) as (place, move):

        def is_pushing() -> bool:
            """Whether there is a force, after one more moment."""
            return newest_force(place.run(1, move)) > 1.0

        def is_off() -> bool:
            """Likewise whether there is none; the clock stands still."""
            return newest_force(place.run(1)) == 0.0

        wrong = unless(place.spin_until(is_pushing), 'no force to begin with')
        wrong += unless(place.spin_until(is_off), 'the force stays')
        marked = statuses(place.run(5))
        wrong += unless(marked == {Status.LATE_INPUT}, f'{marked} while it stands still')
        named = place.spin_until(lambda: 'simulated time stands still' in message(place))
        wrong += unless(named and place.estimator.diagnostics()['estimate'].level == b'\x02', message(place))
        wrong += unless(place.spin_until(is_pushing), 'no force although the clock goes on')
        place.estimator.finish()
    return wrong + verified(folder / 'bag')


def newest_force(outputs: Outputs) -> float:
    """Force of the last feed-forward [N]."""
    return next(output.force for output in reversed(outputs) if isinstance(output, FeedForward))


def fifty_more_topics(chance: random.Random, folder: Path) -> list[str]:
    """Fifty publishers of another node, all of them busy."""
    del chance, folder
    with stage() as place, intruder(place, 'crowd') as other:
        publishers = [other.create_publisher(Float64, f'other_{number}', 10) for number in range(50)]
        place.spin_until(lambda: len(place.driver.get_topic_names_and_types()) > 50)

        def busy(tick: Tick, number: int) -> Tick:
            for publisher in publishers[number % 5 :: 5]:
                publisher.publish(Float64())
            return tick

        outputs = place.run(200, busy)
        answered = sum(isinstance(output, records.FrictionEstimate) for output in outputs)
        wrong = unless(answered == 200, f'{answered} of 200') + unless(statuses(outputs) == {0}, f'{statuses(outputs)}')
        return wrong + unrecovered(place)


# --- disk ---


def disk_stalls(chance: random.Random, folder: Path) -> list[str]:
    """The disk takes no write for 200 samples: an estimate that waited for it would never come."""
    disk = BlockedDisk()
    with stage(recording_to(folder)) as place:
        outputs = place.run(chance.randrange(1, 200))
        mcap_writer.os = disk
        try:
            wrong = unless(place.spin_until(lambda: place.run(10) and disk.is_blocking), 'nothing is written')
            outputs += place.run(200)
        finally:
            mcap_writer.os = os
            disk.release()
        outputs += place.run(100)
        wrong += unless(statuses(outputs) == {0}, f'{statuses(outputs)}')
        wrong += broken_invariants(place.driver.outputs)
        place.estimator.finish()
    return wrong + verified(folder / 'bag')


def directory_removed(chance: random.Random, folder: Path) -> list[str]:
    """The folder of the bag is removed while it is written."""
    with stage(recording_to(folder)) as place:
        place.run(chance.randrange(20, 60))
        shutil.rmtree(folder / 'bag')
        report = place.estimator.diagnostics
        place.spin_until(lambda: place.run(10) and report()['recorder'].level == b'\x02')
        text = report()['recorder'].message
        return unless('recording stopped' in text, f'recorder: {text}') + unrecovered(place)
