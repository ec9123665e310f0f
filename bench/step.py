"""What one sample costs, stage by stage: ``make bench``, or ``python bench/step.py [--batches 15] [--json]``.

Medians over batches, in one run; the ratio to a bare function call is what can be compared between machines. The stages
of the live path are marked; one sample without a feed-forward costs the sum of those, and what the executor adds.
"""

import argparse
import json
import sys
import tempfile
import time
import timeit
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path
from statistics import median
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from seal_friction_msgs.msg import RodVelocity

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import show
from harness.compensation import compensating
from harness.processes import free_domain

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, step
from seal_friction_ros.core.estimation.estimator import init as init_estimator
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, init, init_running, receive
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.messages.coder import decode, encode
from seal_friction_ros.core.messages.layouts import PRESSURE_TYPE, VELOCITY_TYPE
from seal_friction_ros.core.messages.records import Force, Output, Pressure, ServoReference, Velocity
from seal_friction_ros.nodes.discovery import set_up_discovery
from seal_friction_ros.offline.bags.recorder import Recorder

CALLS = 2000
ADAPTATION = AdaptationSettings('on')


def sliding(parameters: EstimatorParameters) -> Callable[[], object]:
    """One step of a rod that slides to and fro at 1 kHz, a reversal a second; the next call is the next step."""
    state, numbers = init_estimator(parameters), count()

    def one() -> None:
        """The next step."""
        nonlocal state
        number = next(numbers)
        stamp, side = (number + 1) * 1_000_000, 1.0 if number // 1000 % 2 == 0 else -1.0
        sample = RodSample(stamp, side * 0.01, Pressure(stamp, 3e6, 1e6), Force(stamp, side * 20.0))
        state, _ = step(parameters, state, sample)

    return one


def samples(receive_one: Callable[..., Any], parameters: PipelineParameters, state: Any) -> Callable[[], object]:
    """Pressure, force and velocity of one moment of a rod that slides to and fro; the next call is the next moment."""
    numbers = count(1)

    def one() -> None:
        """The next moment."""
        number = next(numbers)
        stamp, side = number * 1_000_000, 1.0 if number // 1000 % 2 == 0 else -1.0
        for message in (Pressure(stamp, 3e6, 1e6), Force(stamp, side * 20.0), Velocity(stamp, side * 0.1, b'rod')):
            receive_one(parameters, state, message, stamp, drop)

    return one


def drop(_record: Output, _frame_id: bytes) -> None:
    """Emit to nobody."""


def stages() -> dict[str, Callable[[], object]]:
    """Each stage of the live path but the middleware's, as a function without arguments."""
    parameters = compensating().parameters()
    measured = compensating(use_measured_velocity=True).parameters()
    pressure, force, velocity = Pressure(1, 3e6, 1e6), Force(1, 20.0), Velocity(1, 0.1, b'rod')

    sample = RodSample(1, 0.1, pressure, force)
    alone = replace(init(parameters), pressure=pressure, force=force)
    guided = replace(init_running(parameters), pressure=pressure, force=force)
    receive(parameters, guided, ServoReference(1, 0.0, 0.1, 0.0), 1, drop)
    records: list[tuple[Output, bytes]] = []
    receive(parameters, guided, velocity, 1, lambda record, frame: records.append((record, frame)))
    estimate, feedforward = records
    seals = [replace(m, seal=replace(m.seal, presliding=Presliding(stiffness=1e5))) for m in parameters.estimator.seals]
    elastic = EstimatorParameters(parameters.estimator.settings, tuple(seals), AdaptationSettings('off'))
    velocity_bytes, pressure_bytes = encode(velocity), encode(pressure, b'rod')
    return {
        'bare call': lambda: None,
        'decode pressure': lambda: decode(PRESSURE_TYPE, pressure_bytes),
        'decode velocity': lambda: decode(VELOCITY_TYPE, velocity_bytes),
        'receive pressure': lambda: receive(parameters, alone, pressure, 1, drop),
        'estimator step': lambda: step(parameters.estimator, alone.estimator, sample),
        'estimator step, sliding': sliding(replace(parameters.estimator, adaptation=AdaptationSettings('off'))),
        'estimator step, sliding, with adaptation': sliding(replace(parameters.estimator, adaptation=ADAPTATION)),
        'estimator step, sliding, on elastic seals': sliding(elastic),
        'receive velocity': lambda: receive(parameters, alone, velocity, 1, drop),
        'receive velocity, with feed-forward': lambda: receive(parameters, guided, velocity, 1, drop),
        'receive three messages, with feed-forward': samples(receive, measured, init(measured)),
        'encode estimate': lambda: encode(*estimate),
        'encode estimate and feed-forward': lambda: [encode(*estimate), encode(*feedforward)],
    }


@contextmanager
def middleware() -> Iterator[dict[str, Callable[[], object]]]:
    """Stages of the middleware and the recorder, and what rclpy has beside ours, as functions that do one message."""
    set_up_discovery()
    context = Context()
    rclpy.init(context=context, domain_id=free_domain())
    node = Node('bench', context=context)
    deep = QoSProfile(depth=4 * CALLS)
    publisher = node.create_publisher(RodVelocity, 'rod_velocity', deep)
    subscription = node.create_subscription(RodVelocity, 'rod_velocity', lambda _: None, deep, raw=True)
    velocity_bytes = encode(Velocity(1, 0.1, b'rod'))
    message = deserialize_message(velocity_bytes, RodVelocity)
    stamps = count()
    with tempfile.TemporaryDirectory() as folder:
        recorder = Recorder(Path(folder) / 'bag', queue_length=10**7)
        try:
            while not publisher.get_subscription_count():
                time.sleep(0.01)
            yield {
                'publish': lambda: publisher.publish(velocity_bytes),
                'take': lambda: subscription.handle.take_message(RodVelocity, True),
                'record': lambda: recorder.record('/rod_velocity', VELOCITY_TYPE, next(stamps), velocity_bytes),
                'rclpy: deserialise': lambda: deserialize_message(velocity_bytes, RodVelocity),
                'rclpy: serialise': lambda: serialize_message(message),
            }
        finally:
            recorder.close()
            node.destroy_node()
            rclpy.try_shutdown(context=context)


LIVE = ('take', 'decode velocity', 'receive velocity', 'encode estimate', 'publish', 'record')


def main() -> int:
    """Time every stage and print a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', maxsplit=1)[0])
    parser.add_argument('--json', action='store_true')
    parser.add_argument('--batches', type=int, default=15)
    arguments = parser.parse_args()
    batches: dict[str, list[float]] = {}
    with middleware() as ours:
        for _ in range(arguments.batches):  # in turn, so that a slow moment of the machine hits all of them
            for name, stage in {**stages(), **ours}.items():
                batches.setdefault(name, []).append(timeit.timeit(stage, number=CALLS) / CALLS * 1e6)
    figures = {name: median(times) for name, times in batches.items()}
    if arguments.json:
        print(json.dumps({f'{name} [us]': duration for name, duration in figures.items()}))
        return 0
    bare = figures['bare call']
    rows = {
        name + ' *' * (name in LIVE): {'time [us]': f'{duration:.2f}', 'bare calls': f'{duration / bare:.0f}'}
        for name, duration in figures.items()
    }
    rows['* one sample'] = {'time [us]': f'{sum(figures[name] for name in LIVE):.2f}'}
    show(rows, f'One sample, median of {arguments.batches} batches of {CALLS}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
