"""Counts, rates, ages and latencies of the running estimator, as a status of ``/diagnostics``."""

import time
from collections import Counter, deque
from collections.abc import Collection, Iterable, Sequence
from functools import reduce
from operator import or_

from diagnostic_msgs.msg import DiagnosticStatus

from seal_friction_ros.core.estimation import seal_health
from seal_friction_ros.core.estimation.adaptation import AdaptationState
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorState
from seal_friction_ros.core.estimation.pipeline import Turn
from seal_friction_ros.core.estimation.seal_health import SealHealth, Starts, findings, health_values
from seal_friction_ros.core.estimation.swings import NO_SWING, Swing
from seal_friction_ros.core.messages import records
from seal_friction_ros.core.messages.layouts import CLOCK_TOPIC, INPUTS
from seal_friction_ros.core.messages.records import FeedForward, FrictionEstimate, Limited, Status
from seal_friction_ros.nodes.graph_watch import GraphFindings
from seal_friction_ros.nodes.managed_node import status_of

_SHORTEST_SILENCE = 0.9  # [s] in a shorter interval, no estimate means no fault if the interval before had one
_LARGEST_NEAR_REST = 0.25  # [-] of the estimates, for each status bit of `_NEAR_REST_MESSAGES`; each reversal has some
_NEAR_REST_MESSAGES = {
    Status.MOTION_UNCERTAIN: 'of rod_velocity near rest or too noisy to tell rest from motion',
    Status.SLOWER_THAN_IDENTIFIED: 'of rod_velocity slower than the seals were identified',
}
_LARGEST_SHARE = {Limited.CLAMP: 0.01, Limited.SLEW: 0.2, Limited.FADE: 0.0}
"""[-] of the feed-forwards; each reversal slews"""
_LIMIT_MESSAGES = {
    Limited.CLAMP: 'cut by force_limit',
    Limited.SLEW: 'held back by slew_limit',
    Limited.FADE: 'faded: an input or the reference is not usable',
}
# Whole numbers: with flags a report takes twice as long.
_ESTIMATES = {f'estimates {bit.name}': int(bit) for bit in Status}
_FEEDFORWARDS = {f'feed-forwards {bit.name}': int(bit) for bit in Limited}
_FEEDFORWARD_SHARES = {f'feed-forward {bit.name} share': int(bit) for bit in Limited}
_MOST_REVERSALS = 50  # [1/s] of the force; faster motion is not compensated, so this is chatter
_LARGEST_DELAY = 1_000_000_000  # [ns] a stamp further back than this means that its clock was set
_LARGEST_LATENESS = 50_000_000  # [ns] of an input: controllers are to refuse what is older (docs/interfaces.md)
_LARGEST_QUEUE = 10_000_000_000  # [ns] nothing waits so long: the clocks differ
_STANDS_STILL = 'simulated time stands still: nothing new on /clock'


class MissingSamples:
    """Missing samples of one input, from the gaps between its stamps (our choice).

    The middleware does not report samples that it discards when the node is too slow. The period is the lower quartile
    of the last 15 steps. Every step longer than 1.5 periods counts as a gap: also a jump of the clock, stamp jitter of
    a third of the period and more, and the first twelve steps at a lower rate. A stamp slightly back is a late sample,
    which counted as missing before. A stamp far back means that the clock was set: the period is learnt anew.
    """

    def __init__(self) -> None:
        self.count = 0
        self._count_before = 0  # before the period was learnt
        self._stamp = 0
        self._period = 0.0
        self._shortest = self._longest = 0.0  # between them a step is of the period; both 0.0 until that is learnt
        self._steps: deque[int] = deque(maxlen=15)

    def on_stamps(self, stamps: Iterable[int]) -> None:
        """Add the stamps [ns] of the next samples."""
        for stamp in stamps:
            step = stamp - self._stamp if self._stamp else 0
            if self._shortest < step < self._longest:  # as nearly all
                self._stamp = stamp
                self._steps.append(step)
            else:
                self._on_irregular(stamp, step)

    def _on_irregular(self, stamp: int, step: int) -> None:
        if -_LARGEST_DELAY <= step < 0:
            self.count = max(self.count - 1, 0)
            self._count_before -= 1
            return
        self._stamp = stamp
        self._shortest = self._longest = 0.0
        if step <= 0:
            self._steps.clear()
            self._count_before = self.count
            return
        is_learnt = len(self._steps) == self._steps.maxlen
        self._steps.append(step)
        self._period = sorted(self._steps)[len(self._steps) // 4]  # seldom: sorting is slow
        if is_learnt:
            self.count += self._missing(step)
        else:
            self.count = max(self._count_before + sum(map(self._missing, self._steps)), 0)
        if len(self._steps) == self._steps.maxlen:
            self._shortest, self._longest = 0.7 * self._period, 1.5 * self._period

    def _missing(self, step: int) -> int:
        return round(step / self._period) - 1 if step > 1.5 * self._period else 0


class EstimatorDiagnostics:
    """Counts since activation, and rates, ages and latencies of the present interval, by names of inputs."""

    def __init__(self, inputs: Collection[str] = INPUTS) -> None:
        self._inputs = inputs
        self._received: Counter[str] = Counter()
        self._malformed: Counter[str] = Counter()
        self._missing = {name: MissingSamples() for name in inputs}
        self._by_status: Counter[int] = Counter()
        self._feedforwards_by_limit: Counter[int] = Counter()
        self._feedforward_force = self._feedforward_sign = 0.0
        self._estimate = records.NO_ESTIMATE
        self._latencies: list[int] = []
        self._health, self._starts = SealHealth(), Starts()
        self._clock = records.NEVER  # [ns] newest simulated time
        self._newest: dict[type, FrictionEstimate | FeedForward] = {}
        self._status = self._limited = 0  # bits of all answers since the newest were taken
        self.start_interval()

    def start_interval(self) -> None:
        """Start a new interval."""
        self._estimated_before = bool(self._latencies)
        self._started = time.monotonic()
        self._received_before = self._received.copy()
        self._malformed_before = self._malformed.copy()
        self._status_before = self._by_status.copy()
        self._limits_before = self._feedforwards_by_limit.copy()
        self._reversals, self._travel = 0, 0.0
        self._latencies = []
        self._lateness: dict[str, int] = {}  # [ns] the largest of each input in this interval
        self._clock_moved = False

    def on_inputs(self, name: str, messages: Sequence[tuple[int | None, int]]) -> None:
        """Count messages of an input, at least one: stamp and lateness [ns] of each; negative if the clocks differ.

        A stamp of None: the stamps do not tell what is missing, or there are none.
        """
        self._received[name] += len(messages)
        stamps = [stamp for stamp, _ in messages if stamp is not None]
        self._missing[name].on_stamps(stamps)
        self._lateness[name] = max(self._lateness.get(name, 0), *(late for _, late in messages), key=abs)
        if name == CLOCK_TOPIC and stamps[-1:] not in ([], [self._clock]):
            self._clock, self._clock_moved = stamps[-1], True

    def on_malformed(self, name: str) -> None:
        """Count one message of an input that cannot be decoded."""
        self._malformed[name] += 1

    def on_estimates(self, estimates: Sequence[tuple[FrictionEstimate, int]]) -> None:
        """Count estimates, at least one, each with the time [ns] after its velocity was taken."""
        self._by_status.update(status := [estimate.status for estimate, _ in estimates])
        self._latencies += [latency for _, latency in estimates]
        for estimate, _ in estimates:
            if estimate.adaptation_scale_std != 0.0:  # without adaptation there is no residual
                self._starts = seal_health.with_sample(self._starts, estimate)
        self._estimate = self._newest[FrictionEstimate] = estimates[-1][0]
        self._status = reduce(or_, status, self._status)

    def on_turn(self, turn: Turn) -> None:
        """Follow what was learnt from a stroke."""
        self._health = seal_health.followed(self._health, *turn)

    def on_reset(self) -> None:
        """Forget the reversals: the adaptation has."""
        self._health = SealHealth()

    def health(self, parameters: EstimatorParameters, adaptation: AdaptationState) -> DiagnosticStatus:
        """Indicators of the seals, WARN with what a person should know."""
        said = findings(parameters, self._health, self._estimate.status)
        values = health_values(parameters, adaptation, self._health, self._starts)
        level = DiagnosticStatus.WARN if said else DiagnosticStatus.OK
        return status_of(level, '; '.join(said) or 'no finding', values)

    def on_feedforwards(self, feedforwards: Sequence[tuple[FeedForward, int]]) -> None:
        """Count feed-forwards, at least one, as `on_estimates`."""
        self._feedforwards_by_limit.update(limited := [one.limited for one, _ in feedforwards])
        for feedforward, _ in feedforwards:
            force = feedforward.force
            self._travel += abs(force - self._feedforward_force)
            if force * self._feedforward_sign < 0.0:
                self._reversals += 1
            if force:
                self._feedforward_sign = force
            self._feedforward_force = force
        self._newest[FeedForward] = feedforwards[-1][0]
        self._limited = reduce(or_, limited, self._limited)

    def take_newest(self) -> list[records.Output]:
        """The newest answers since the last call, for who looks on: each with the bits of all answers since then."""
        bits = {FrictionEstimate: {'status': self._status}, FeedForward: {'limited': self._limited}}
        found = [answer._replace(**bits[kind]) for kind, answer in self._newest.items()]
        self._newest.clear()
        self._status = self._limited = 0
        return found

    @property
    def received(self) -> dict[str, int]:
        """Messages of each input since activation, well-formed or not."""
        return {name: self._received[name] + self._malformed[name] for name in self._inputs}

    @property
    def silent_inputs(self) -> list[str]:
        """Inputs without a message in this interval."""
        return [name for name in self._inputs if self._received[name] == self._received_before[name]]

    def report(
        self,
        active: bool,
        refused: bool,
        graph: GraphFindings,
        parameters: EstimatorParameters | None = None,
        known: EstimatorState | None = None,
    ) -> DiagnosticStatus:
        """Status of the estimate in this interval; ``refused``: the node rejects its inputs.

        ``parameters`` are those of the estimator, if it adapts; ``known`` is its state, None: it does not estimate.
        """
        swing = NO_SWING if known is None else known.swing
        seconds = max(time.monotonic() - self._started, 1e-3)
        level, message = self._level(seconds, parameters, swing) if active else (DiagnosticStatus.OK, 'inactive')
        if active and CLOCK_TOPIC in self._inputs and not self._clock_moved and seconds > _SHORTEST_SILENCE:
            level, message = DiagnosticStatus.ERROR, f'{_STANDS_STILL}; {message}'
        if refused:
            level = DiagnosticStatus.ERROR
        elif (graph.duplicates or graph.unheard) and level == DiagnosticStatus.OK:
            level = DiagnosticStatus.WARN
        values = self._input_values(seconds, graph) | self._output_values(seconds)
        if known is not None and parameters is not None:
            values |= health_values(parameters, known.adaptation, self._health, self._starts)
        values['swing without force [um]'] = f'{swing.doubted * 1e6:.1f}'
        values |= {f'{name} best effort only, from': node for name, node in graph.best_effort.items()}
        return status_of(level, '; '.join([*graph.duplicates, *graph.unheard, message]), values)

    def _level(self, seconds: float, parameters: EstimatorParameters | None, swing: Swing) -> tuple[bytes, str]:
        """Level and message of an active estimator ``seconds`` [s] after the start of the interval."""
        if not self._latencies and (seconds > _SHORTEST_SILENCE or not self._estimated_before):
            return DiagnosticStatus.STALE, 'no rod_velocity received'
        estimates = self._by_status - self._status_before
        status = reduce(or_, estimates, 0)
        status &= ~(sum(_NEAR_REST_MESSAGES) | Status.PRESLIDING)  # seals shear in every reversal
        said = [] if parameters is None else findings(parameters, self._health, status)
        said += self._late()
        if status:
            bits = {bit: _share(estimates, bit) for bit in Status if status & bit}
            texts = [f'{bit.name}' if share > 0.995 else f'{bit.name} {share:.0%}' for bit, share in bits.items()]
            said.insert(0, ', '.join(texts))
        if self._malformed != self._malformed_before:
            names = ', '.join(sorted((self._malformed - self._malformed_before).keys()))
            said.append(f'malformed messages on {names}')
        said += self._feedforward_findings(seconds)
        near_rest = {message: _share(estimates, bit) for bit, message in _NEAR_REST_MESSAGES.items()}
        said += [f'{share:.0%} {message}' for message, share in near_rest.items() if share > _LARGEST_NEAR_REST]
        if swing.doubted > 0.0 and _share(estimates, Status.MOTION_UNCERTAIN) > _LARGEST_NEAR_REST:
            way = f'rod_velocity swings by {swing.doubted * 1e6:.0f} um'
            said.append(f'{way}, the force sum does not show it: hum, or a wrong force sum')
        return (DiagnosticStatus.WARN, '; '.join(said)) if said else (DiagnosticStatus.OK, 'estimating')

    def _late(self) -> list[str]:
        """Which inputs come late."""
        said = []
        for name, lateness in self._lateness.items():
            if not -_LARGEST_LATENESS < lateness < _LARGEST_QUEUE:
                clock = f'the clock of the publisher of {name}'
                said.append(f'{clock} differs by {-lateness * 1e-9:.3f} s: no feed-forward')
            elif lateness > _LARGEST_LATENESS:
                late = f'{name} comes up to {lateness * 1e-6:.0f} ms late'
                said.append(f'{late}: this node is too slow, its machine too busy, or the clock of the publisher wrong')
        return said

    def _feedforward_findings(self, seconds: float) -> list[str]:
        """What limits the feed-forward more than a motion does by itself."""
        recent = self._feedforwards_by_limit - self._limits_before
        beyond = {bit: share for bit, most in _LARGEST_SHARE.items() if (share := _share(recent, bit)) > most}
        said = [f'feed-forward {share:.0%} {_LIMIT_MESSAGES[bit]}' for bit, share in beyond.items()]
        if self._reversals > _MOST_REVERSALS * seconds:
            said.append(f'feed-forward reverses {self._reversals / seconds:.0f} times a second')
        return said

    def _input_values(self, seconds: float, graph: GraphFindings) -> dict[str, str]:
        values: dict[str, str] = {}
        for name in self._inputs:
            recent = self._received[name] - self._received_before[name]
            values[f'{name} publishers'] = str(graph.publisher_counts[name])
            values[f'{name} rate [Hz]'] = f'{recent / seconds:.1f}'
            values[f'{name} received'] = str(self._received[name])
            values[f'{name} malformed'] = str(self._malformed[name])
            values[f'{name} missing'] = str(self._missing[name].count)
            values[f'{name} late [ms]'] = f'{self._lateness.get(name, 0) * 1e-6:.1f}'
        return values

    def _output_values(self, seconds: float) -> dict[str, str]:
        recent = self._feedforwards_by_limit - self._limits_before
        return {
            'estimate rate [Hz]': f'{len(self._latencies) / seconds:.1f}',
            'estimates': str(self._by_status.total()),
            'estimates all good': str(self._by_status[0]),
            **{key: str(_count(self._by_status, bit)) for key, bit in _ESTIMATES.items()},
            'feed-forwards': str(self._feedforwards_by_limit.total()),
            **{key: str(_count(self._feedforwards_by_limit, bit)) for key, bit in _FEEDFORWARDS.items()},
            **{key: f'{_share(recent, bit):.3f}' for key, bit in _FEEDFORWARD_SHARES.items()},
            'feed-forward reversals [1/s]': f'{self._reversals / seconds:.1f}',
            'feed-forward travel [N/s]': f'{self._travel / seconds:.0f}',
            'feed-forward [N]': f'{self._feedforward_force:.3f}',
            'input age [s]': f'{self._estimate.input_age:.4f}',
            **latency_values(self._latencies),
        }


def _count(by_bits: Counter[int], bit: int) -> int:
    """Number of messages with a bit set."""
    return sum(number for bits, number in by_bits.items() if bits & bit)


def _share(by_bits: Counter[int], bit: int) -> float:
    """Share of messages with a bit set."""
    return _count(by_bits, bit) / max(by_bits.total(), 1)


def latency_values(latencies: list[int], what: str = 'latency') -> dict[str, str]:
    """Median and 99th percentile [us] of latencies [ns], by their diagnostics keys."""
    ordered, values = sorted(latencies), {}
    for percent in (50, 99):
        place = min(len(ordered) * percent // 100, len(ordered) - 1)
        values[f'{what} p{percent} [us]'] = f'{ordered[place] / 1e3:.1f}' if ordered else 'none'
    return values
