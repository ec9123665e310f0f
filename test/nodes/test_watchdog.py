"""The watchdog of a node: after messages while they come, by the executor when they stop, never after its end."""

import gc
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
import rclpy
from harness.processes import free_domain
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

from seal_friction_ros.nodes.executor import spin
from seal_friction_ros.nodes.watchdog import Watchdog

MILLISECOND = 1_000_000  # [ns]
LONG = 3_600 * 1000 * MILLISECOND  # [ns] longer than any test
PATIENCE = 20.0  # [s] for what has to come at some time


@pytest.fixture(autouse=True)
def _nodes_are_collected():
    yield
    gc.collect()  # nodes hold reference cycles: collected in a process that is forked later, they would end it


class Looks:
    """Counts the calls of a watchdog, and the threads they come from."""

    def __init__(self, period: int) -> None:
        self.period = period
        self.times: list[int] = []
        self.threads: set[int] = set()
        self._changed = threading.Condition()

    def look(self, now: int) -> int:
        with self._changed:
            self.times.append(now)
            self.threads.add(threading.get_ident())
            self._changed.notify_all()
        return self.period

    def wait_for(self, count: int) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: len(self.times) >= count, PATIENCE)


def spin_single_threaded(made: Node, stopped: Future, context: Context) -> None:
    """As `spin` on a ROS without an events executor."""
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(made)
    executor.spin_until_future_complete(stopped)


@contextmanager
def node(*, spins: bool = True, spin: Callable[..., None] = spin) -> Iterator[tuple[Node, int]]:
    """A node, and the thread in which its executor spins."""
    context = Context()
    rclpy.init(context=context, domain_id=free_domain())
    made = Node('guarded', context=context)
    stopped = Future()
    thread = threading.Thread(target=spin, args=(made, stopped, context))
    if spins:
        thread.start()
    yield made, thread.ident or 0
    stopped.set_result(None)
    if spins:
        thread.join()
    made.destroy_node()
    rclpy.try_shutdown(context=context)


@pytest.mark.parametrize('spin', [spin, spin_single_threaded])
def test_without_messages_the_executor_looks_again_and_again(spin):
    looks = Looks(period=MILLISECOND)
    with node(spin=spin) as (made, executor):
        watchdog = Watchdog(made, looks.look)
        watchdog.start()
        assert looks.wait_for(20)
        watchdog.stop()
        assert looks.threads == {executor}
    assert min(b - a for a, b in zip(looks.times, looks.times[1:], strict=False)) >= looks.period


def test_messages_look_when_it_is_time_and_not_before():
    looks = Looks(period=LONG)
    with node(spins=False) as (made, _):
        watchdog = Watchdog(made, looks.look)
        watchdog.start()
        begin = time.perf_counter_ns() + 100 * MILLISECOND  # after the first period
        assert watchdog.call_if_due(begin)
        assert not watchdog.call_if_due(begin + LONG - 1)
        assert watchdog.call_if_due(begin + LONG)
        watchdog.stop()
    assert looks.times == [begin, begin + LONG]


def test_while_messages_look_the_executor_need_not():
    looks = Looks(period=20 * MILLISECOND)
    with node() as (made, _):
        watchdog = Watchdog(made, looks.look)
        watchdog.start()
        assert looks.wait_for(1)
        ahead = time.perf_counter_ns() + LONG  # as if the last message had looked just then
        assert watchdog.call_if_due(ahead)
        looks.threads.clear()
        time.sleep(0.2)  # ten periods
        assert looks.threads == set()
        watchdog.stop()


def test_a_shorter_period_holds_at_once():
    looks = Looks(period=1000 * MILLISECOND)
    with node() as (made, _):
        watchdog = Watchdog(made, looks.look)
        watchdog.start()
        assert looks.wait_for(1)
        looks.period = MILLISECOND
        assert looks.wait_for(3)
        watchdog.stop()
    first, second, third = looks.times[:3]
    assert second - first >= 1000 * MILLISECOND
    assert third - second < 800 * MILLISECOND  # not after another long period


def test_after_its_end_nothing_looks():
    looks = Looks(period=MILLISECOND)
    with node() as (made, _):
        watchdog = Watchdog(made, looks.look)
        watchdog.start()
        assert looks.wait_for(1)
        watchdog.stop()
        count = len(looks.times)
        assert not watchdog.call_if_due(looks.times[-1] + LONG)
        time.sleep(0.05)  # fifty periods
        assert len(looks.times) == count


def test_a_look_that_fails_is_not_hidden():
    def fail(_now: int) -> int:
        failed.set()
        raise ArithmeticError('the look failed')

    failed = threading.Event()
    with node() as (made, _):
        watchdog = Watchdog(made, fail)
        watchdog.start()
        watchdog.check()
        assert failed.wait(PATIENCE)
        failed.clear()
        assert failed.wait(PATIENCE)  # it goes on, and the failure of the call before is known now
        with pytest.raises(ArithmeticError, match='the look failed'):
            watchdog.check()
        watchdog.stop()
