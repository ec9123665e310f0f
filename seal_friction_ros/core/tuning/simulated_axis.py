r"""Search for the best feed-forward of a simulated axis, robust against errors of friction model and delay.

.. math:: J = \tfrac14 \Big( \frac{e_n + \max_c e_c}{e_0} + \frac{t_n + \max_c t_c}{t_0} \Big)

with the RMS error e and the dwell t of the nominal case (n), of each case c, and of the axis without feed-forward (0):
half the weight for the nominal case, half for the worst case. The cases are all combinations of a friction model and a
delay that are too small, right and too large. J = 1 is no better than without feed-forward, 0 is perfect. Settings with
too much overshoot in any case, or with reversals while the reference rests, are rejected.

Search: first with the sharpest force that the sample time allows, a grid over scale and lead time, then a compass
search from its best point (one of both up or down, then half the stride). Next the widest smoothing and then the lowest
slew limit with a J that is nearly as good, to spare valve and machine. Last, scale and lead time once more. Values are
preferred numbers. The force limit is `FORCE_MARGIN` times the largest friction on the axis, found before the search
without feed-forward and with all of the friction compensated. Nothing is random, so a problem has one answer. All of it
is our choice.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import within_bounds
from seal_friction_ros.core.servo import closed_loop
from seal_friction_ros.core.servo.closed_loop import (
    EVALUATED_PERIODS,
    Axis,
    AxisRun,
    EvaluationMotions,
    Performance,
    without_feedforward,
)
from seal_friction_ros.core.servo.elastic_plant import ELASTICITIES, MOST_GROUPS, seals_of_plant
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.tracking import error_area, reversal_rms, tracking_rms
from seal_friction_ros.core.tuning.settings import FORCE_MARGIN, RobustnessCase, TunedFeedForward, TuningSettings

MOST_CANDIDATES = 100  # settings after which the search ends, to bound its time
SCALE_STEP = 0.01  # [-] step of scale
LEAD_STEPS = 20  # steps of lead_time over the whole delay
PREFERRED = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)  # ISO 3, series R10
GRID_SCALES = (0.0, 0.3, 0.6, 0.9, 1.2)  # [-]
GRID_LEADS = (0.0, 1.0, 2.0)  # of the whole delay
STRIDES = (8, 4, 2, 1)  # steps of the compass search
NEARLY_AS_GOOD = 1.05  # ratio of two J
SEARCH_HOLD = 0.2  # [s] of rest after each motion during the search; the result is evaluated with `hold_time`


@dataclass(frozen=True)
class Tuning(TunedFeedForward[Performance]):
    """Result of the search."""

    merit: float  # [-] J
    candidates: int  # number of evaluated settings


class SearchPoint(NamedTuple):
    """Settings of the search as numbers of steps."""

    scale: int
    lead: int
    smoothing: int
    slew: int


def preferred(index: int) -> float:
    """Preferred number: 1, 1.25, 1.6, ... for 0, 1, 2, ..., ten in a decade."""
    decade, place = divmod(index, len(PREFERRED))
    return float(f'{PREFERRED[place]}e{decade}')


def nearest_preferred(value: float) -> int:
    """Index of the preferred number nearest to a positive value."""
    return round(len(PREFERRED) * math.log10(value))


@dataclass(frozen=True)
class TuningProblem:
    """A simulated axis, its task, and the errors of its sensors; ValueError if the servo cannot follow its task."""

    axis: Axis
    settings: TuningSettings
    noise: FloatArray | None = None  # as of `run_closed_loop`

    def __post_init__(self) -> None:
        gains, s = self.axis.servo.gains, self.settings
        rate = 2.0 * math.pi * s.frequency
        speed = rate * s.amplitude
        for name, value, most, unit in (
            ('way', s.amplitude, gains.reach, 'm'),
            ('speed', speed, gains.controller.reference_speed_max, 'm/s'),
            ('acceleration', rate * speed, gains.controller.reference_acceleration_max, 'm/s2'),
        ):
            if value > most:
                task = f'amplitude = {s.amplitude} m at frequency = {s.frequency} Hz'
                limit = f'the limit of the servo, {most:.4g} {unit}'
                raise ValueError(f'{task}: {name} {value:.4g} {unit} is more than {limit}')

    @property
    def whole_delay(self) -> float:
        r"""Time from a velocity sample to the force of its feed-forward on the rod [s].

        .. math:: T = T_d + 1 / \omega_F + \tau

        with the delay T_d to the controller, and the delays of force loop, spool and sampling (see `controller`).
        """
        gains = self.axis.servo.gains
        return self.settings.delay + 1.0 / gains.controller.force_bandwidth + gains.valve_delay

    @property
    def lead_step(self) -> float:
        """Step of the lead time [s]."""
        return preferred(nearest_preferred(self.whole_delay / LEAD_STEPS))

    def motions(self, hold_time: float) -> EvaluationMotions:
        """Evaluation motions, with a rest [s] after each."""
        return EvaluationMotions(Sine(self.settings.amplitude, self.settings.frequency), hold_time)

    def feedforward(self, point: SearchPoint) -> FeedForwardSettings:
        """Settings at a point of the search; the settings outside the search are unchanged."""
        return replace(
            self.axis.pipeline.feedforward,
            scale=bounded('scale', round(point.scale * SCALE_STEP, 10)),
            lead_time=bounded('lead_time', round(point.lead * self.lead_step, 10)),
            smoothing_velocity=bounded('smoothing_velocity', preferred(point.smoothing)),
            slew_limit=bounded('slew_limit', preferred(point.slew)),
        )

    def case(
        self, feedforward: FeedForwardSettings, friction_error: float, delay_error: float, hold_time: float
    ) -> RobustnessCase[Performance]:
        """Performance with errors of model and delay [-], with rests of ``hold_time`` [s].

        The delay error is relative to `whole_delay`. It changes the delay to the controller, which cannot be below 0.
        """
        runs = self.runs(feedforward, friction_error, delay_error, hold_time)
        performance = closed_loop.performance_of(self.axis.servo.control_period, self.motions(hold_time), runs)
        return RobustnessCase(friction_error, delay_error, performance)

    def runs(
        self,
        feedforward: FeedForwardSettings,
        friction_error: float = 0.0,
        delay_error: float = 0.0,
        hold_time: float = SEARCH_HOLD,
    ) -> tuple[AxisRun, AxisRun, AxisRun]:
        """Sine, move and step of `case`."""
        delay = self.settings.delay + delay_error * self.whole_delay
        wrong = closed_loop.with_wrong_friction(self.axis.pipeline._replace(feedforward=feedforward), friction_error)
        return self.motions(hold_time).runs(self.axis._replace(pipeline=wrong), max(delay, 0.0), self.noise)

    def without(self) -> Performance:
        """Performance without feed-forward."""
        none = without_feedforward(self.axis.pipeline.feedforward)
        return self.case(none, 0.0, 0.0, self.settings.hold_time).outcome

    def errors(self) -> tuple[tuple[float, float], ...]:
        """Friction and delay error of each case: first none, then those that most often give the worst case."""
        f, d = self.settings.friction_error, self.settings.delay_error
        both = [(0.0, 0.0), (-f, d), (f, d), (-f, -d), (f, -d), (-f, 0.0), (f, 0.0), (0.0, d), (0.0, -d)]
        return tuple(dict.fromkeys(both))


def bounded(name: str, value: float) -> float:
    """Value of a setting of the feed-forward, clamped to its bounds."""
    return float(within_bounds(FeedForwardSettings, name, value))


def force_limit(friction: float) -> float:
    """Force limit [N] for the largest friction found [N]: `FORCE_MARGIN` times as large, rounded up to two digits."""
    wanted = max(FORCE_MARGIN * friction, 1e-3)
    digit = 10.0 ** (math.floor(math.log10(wanted)) - 1)
    return bounded('force_limit', float(f'{digit * math.ceil(wanted / digit - 1e-9):.3g}'))


def _largest_friction(problem: TuningProblem) -> float:
    """Largest friction [N] over the evaluation motions, breakaway included."""
    settings = problem.axis.pipeline.feedforward
    whole = replace(settings, scale=1.0, force_limit=bounded('force_limit', math.inf))
    runs = (*problem.runs(without_feedforward(settings)), *problem.runs(whole))
    return max(float(abs(run.friction_force).max()) for run in runs)


def merit(problem: TuningProblem, without: Performance, cases: Sequence[RobustnessCase[Performance]]) -> float:
    """J of the cases, one of them nominal; infinite where one is rejected. More cases can only increase J.

    Where the axis does not dwell without feed-forward, the dwell is relative to one sample time.
    """
    settings, outcomes = problem.settings, [case.outcome for case in cases]
    overshoot = max(2.0 * settings.amplitude * settings.overshoot_limit, without.overshoot)
    if any(o.overshoot > overshoot or o.limit_cycle_reversals > without.limit_cycle_reversals for o in outcomes):
        return math.inf
    (nominal,) = (case.outcome for case in cases if case.is_nominal)
    error = nominal.tracking_rms + max(o.tracking_rms for o in outcomes)
    dwell = nominal.dwell + max(o.dwell for o in outcomes)
    return 0.25 * (error / without.tracking_rms + dwell / max(without.dwell, problem.axis.servo.control_period))


def tune(problem: TuningProblem, advance: Callable[[int], None] = lambda _: None) -> Tuning:
    """Search for the feed-forward; calls ``advance(1)`` for every candidate, at most `MOST_CANDIDATES` times."""
    without, friction = problem.without(), _largest_friction(problem)
    pipeline = problem.axis.pipeline
    limited = replace(pipeline.feedforward, force_limit=force_limit(friction))
    problem = replace(problem, axis=problem.axis._replace(pipeline=pipeline._replace(feedforward=limited)))
    found: dict[SearchPoint, float] = {}

    def merit_at(point: SearchPoint) -> float:
        """J of a point, or a lower bound of J once the point cannot be the best."""
        if point not in found:
            if len(found) >= MOST_CANDIDATES:
                return math.inf
            best, value, cases = min(found.values(), default=math.inf), math.inf, []
            for errors in problem.errors():
                cases.append(problem.case(problem.feedforward(point), *errors, SEARCH_HOLD))
                value = merit(problem, without, cases)
                if value > NEARLY_AS_GOOD * best:
                    break
            found[point] = value
            advance(1)
        return found[point]

    point = _compass(min(_grid(problem), key=merit_at), merit_at, STRIDES)
    point = _gentlest(point, merit_at)
    feedforward = problem.feedforward(_compass(point, merit_at, STRIDES[-1:]))
    cases = [problem.case(feedforward, *errors, problem.settings.hold_time) for errors in sorted(problem.errors())]
    return Tuning(feedforward, without, tuple(cases), friction, merit(problem, without, cases), len(found))


def _grid(problem: TuningProblem) -> list[SearchPoint]:
    """Points over scale and lead time, with the sharpest force that the sample time allows.

    The force switches within half of the speed change of the sine per sample, at a rate of twice its limit per sample.
    """
    settings, period = problem.settings, problem.axis.servo.control_period
    speed_change = (2.0 * math.pi * settings.frequency) ** 2 * settings.amplitude * period
    jump = 2.0 * problem.axis.pipeline.feedforward.force_limit / period
    smoothing, slew = nearest_preferred(0.5 * speed_change), nearest_preferred(max(jump, 1.0))
    whole = problem.whole_delay / problem.lead_step
    return [
        SearchPoint(round(scale / SCALE_STEP), round(lead * whole), smoothing, slew)
        for scale in GRID_SCALES
        for lead in (GRID_LEADS if scale else (0.0,))
    ]


def _compass(point: SearchPoint, merit_at: Callable[[SearchPoint], float], strides: Sequence[int]) -> SearchPoint:
    """Move to the best neighbour in scale or lead time while it is better, then shorten the stride."""
    for stride in strides:
        while True:
            neighbours = [
                point._replace(**{name: value})
                for name in ('scale', 'lead')
                for value in (getattr(point, name) - stride, getattr(point, name) + stride)
                if value >= 0
            ]
            better = min(neighbours, key=merit_at)
            if merit_at(better) >= merit_at(point):
                break
            point = better
    return point


def _gentlest(point: SearchPoint, merit_at: Callable[[SearchPoint], float]) -> SearchPoint:
    """Widest smoothing, then lowest slew limit, with a J that is nearly as good."""
    most = NEARLY_AS_GOOD * merit_at(point)
    if most == math.inf:  # every point is rejected
        return point
    for name, sign in (('smoothing', 1), ('slew', -1)):
        for stride in STRIDES:
            while merit_at(gentler := point._replace(**{name: getattr(point, name) + sign * stride})) <= most:
                point = gentler
    return point


class ReversalQuality(NamedTuple):
    """Tracking over the evaluated part of the sine."""

    tracking_rms: float  # [m]
    reversal_rms: float  # [m] near the reversals
    error_area: float  # [m s] per reversal


class PlantOutcome(NamedTuple):
    """One plant without and with the feed-forward."""

    plant: str  # of `ELASTICITIES`
    without: ReversalQuality
    tuned: ReversalQuality


def on_plants(problem: TuningProblem, feedforward: FeedForwardSettings) -> tuple[PlantOutcome, ...]:
    """The settings on each of `ELASTICITIES`; empty for three seals, or if a seal file has no presliding.

    The search has one plant, on which its result grades itself. This is what the result is worth on a plant of another
    structure, by measures that hold for elastic seals too.
    """
    servo = problem.axis.servo
    if not 0 < len(servo.seals) <= MOST_GROUPS or not all(mounted.seal.presliding for mounted in servo.seals):
        return ()
    outcomes = []
    for plant in ELASTICITIES:
        elastic = seals_of_plant(plant, servo.seals, servo.load.mass)
        other = replace(problem, axis=problem.axis._replace(servo=replace(servo, elastic=elastic)))
        found = (_quality(other, settings) for settings in (without_feedforward(feedforward), feedforward))
        outcomes.append(PlantOutcome(plant, *found))
    return tuple(outcomes)


def _quality(problem: TuningProblem, settings: FeedForwardSettings) -> ReversalQuality:
    motions = problem.motions(SEARCH_HOLD)
    part = motions.evaluated_part(problem.runs(settings)[0])
    pair = part.reference, part.position
    area = error_area(*pair, problem.axis.servo.control_period, 2 * EVALUATED_PERIODS)
    return ReversalQuality(tracking_rms(*pair), reversal_rms(*pair), area)
