"""What the estimator counts while it runs, and how it says it on ``/diagnostics``."""

import time
from collections import Counter, deque
from statistics import median

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from seal_friction_ros.core.estimation.feedforward import FeedForward, Limited
from seal_friction_ros.core.estimation.messages import INPUTS
from seal_friction_ros.core.estimation.records import FrictionEstimate, Status

_SETTLED = 0.9  # [s] a shorter interval without an estimate says nothing, if there was one before it
_LATEST = 1_000_000_000  # [ns] a sample that comes later than this is not late: its clock was set


class Gaps:
    """Samples of one input that are missing, as the gaps between its stamps tell.

    The middleware says nothing of samples that it throws away when the node is too slow. The period is the median of
    the last steps, so what looks like a gap counts as one: a clock that leaps ahead, stamps that jitter by a third of
    the period and more, the first eight steps at a lower rate. A stamp a little back is one that was counted as
    missing and came late; one far back is a clock that was set, and all begins anew. Our choice.
    """

    def __init__(self) -> None:
        self.missing = 0
        self._stamp = 0
        self._period = 0.0
        self._steps: deque[int] = deque(maxlen=15)

    def on_stamp(self, stamp: int) -> None:
        """Take the stamp [ns] of the next sample."""
        step = stamp - self._stamp if self._stamp else 0
        if -_LATEST <= step < 0:
            self.missing = max(self.missing - 1, 0)
            return
        self._stamp = stamp
        if step <= 0:
            self._steps.clear()
            return
        if self._steps and not 0.7 * self._period < step < 1.5 * self._period:  # seldom: the median takes time
            self._period = median(self._steps)
            if step > 1.5 * self._period:
                self.missing += round(step / self._period) - 1
        self._steps.append(step)


class LiveStatistics:
    """Counts since activation, and rates, ages and latencies since the last report."""

    def __init__(self) -> None:
        self._received: Counter[str] = Counter()
        self._malformed: Counter[str] = Counter()
        self._gaps = {name: Gaps() for name in INPUTS}
        self._by_status: Counter[int] = Counter()
        self._feedforwards_by_limit: Counter[int] = Counter()
        self._feedforward_force = 0.0
        self._input_age = -1.0
        self._latencies: list[int] = []
        self.start_interval()

    def start_interval(self) -> None:
        """Count anew what is told of the time since the last report."""
        self._estimated_before = bool(self._latencies)
        self._started = time.monotonic()
        self._received_before = self._received.copy()
        self._malformed_before = self._malformed.copy()
        self._recent_status = self._recent_limit = 0
        self._latencies = []

    def on_input(self, name: str, stamp: int) -> None:
        """Count one message of an input, of ``stamp`` [ns]."""
        self._received[name] += 1
        self._gaps[name].on_stamp(stamp)

    def on_malformed(self, name: str) -> None:
        """Count one message of an input whose bytes make no sense."""
        self._malformed[name] += 1

    def on_estimate(self, estimate: FrictionEstimate, latency: int) -> None:
        """Count one estimate, ``latency`` [ns] after its velocity sample was taken."""
        self._by_status[estimate.status] += 1
        self._recent_status |= estimate.status
        self._latencies.append(latency)
        self._input_age = estimate.input_age

    def on_feedforward(self, feedforward: FeedForward) -> None:
        """Count one feed-forward."""
        self._feedforwards_by_limit[feedforward.limited] += 1
        self._recent_limit |= feedforward.limited
        self._feedforward_force = feedforward.force

    @property
    def silent_inputs(self) -> list[str]:
        """Inputs of which nothing has come in this interval."""
        return [name for name in INPUTS if self._received[name] == self._received_before[name]]

    def report(self, active: bool, publishers: dict[str, int]) -> DiagnosticStatus:
        """State of the estimate in this interval, which began a second ago at most.

        Args:
            active: Whether the node estimates.
            publishers: Publishers connected to each input.
        """
        seconds = max(time.monotonic() - self._started, 1e-3)
        values: dict[str, str] = {}
        for name in INPUTS:
            recent = self._received[name] - self._received_before[name]
            values[f'{name} publishers'] = str(publishers[name])
            values[f'{name} rate [Hz]'] = f'{recent / seconds:.1f}'
            values[f'{name} received'] = str(self._received[name])
            values[f'{name} malformed'] = str(self._malformed[name])
            values[f'{name} missing'] = str(self._gaps[name].missing)
        values['estimate rate [Hz]'] = f'{len(self._latencies) / seconds:.1f}'
        values['estimates'] = str(self._by_status.total())
        values['estimates all good'] = str(self._by_status[0])
        for bit in Status:
            values[f'estimates {bit.name}'] = str(sum(n for status, n in self._by_status.items() if status & bit))
        values['feed-forwards'] = str(self._feedforwards_by_limit.total())
        for limit in Limited:
            count = sum(n for limited, n in self._feedforwards_by_limit.items() if limited & limit)
            values[f'feed-forwards {limit.name}'] = str(count)
        values['feed-forward [N]'] = f'{self._feedforward_force:.3f}'
        values['input age [s]'] = f'{self._input_age:.4f}'
        values |= latency_values(self._latencies)
        status = DiagnosticStatus(level=DiagnosticStatus.OK, message='estimating')
        if not active:
            status.message = 'inactive'
        elif not self._latencies and (seconds > _SETTLED or not self._estimated_before):
            status.level, status.message = DiagnosticStatus.STALE, 'no rod_velocity comes in'
        elif self._recent_status:
            status.level, status.message = DiagnosticStatus.WARN, str(Status(self._recent_status).name)
        elif self._malformed != self._malformed_before:
            names = ', '.join(sorted((self._malformed - self._malformed_before).keys()))
            status.level, status.message = DiagnosticStatus.WARN, f'bytes that are no message come on {names}'
        elif self._recent_limit & Limited.FADE:
            status.level, status.message = DiagnosticStatus.WARN, 'the feed-forward fades: no usable reference'
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        return status


def latency_values(latencies: list[int], what: str = 'latency') -> dict[str, str]:
    """Median and 99th percentile [us] of latencies [ns], by the names they have in diagnostics."""
    if not latencies:
        return {f'{what} p50 [us]': 'none', f'{what} p99 [us]': 'none'}
    ordered = sorted(latencies)
    return {
        f'{what} p{percent} [us]': f'{ordered[min(len(ordered) * percent // 100, len(ordered) - 1)] / 1e3:.1f}'
        for percent in (50, 99)
    }
