r"""The feed-forward that does best on a plant of which friction and delay are known only so well.

.. math:: J = \tfrac14 \Big( \frac{e_n + \max_c e_c}{e_0} + \frac{t_n + \max_c t_c}{t_0} \Big)

with the RMS error e and the dwell t of the case in which all is as known (n), of each case c, and of the axis without
feed-forward (0): half for what is likely, half for the worst. The cases are all combinations of a model of the friction
and a delay that are too small, right and too large. J = 1 is no better than without, 0 perfect. Settings with which any
case overshoots by more than is allowed, or reverses while the reference rests, are out, whatever their J.

The search: with a force that switches as sharply as one sample lets it, a grid over scale and lead time, and from its
best place a compass search (one of them up or down, then by half as much); then the widest smoothing and after it the
lowest slew limit with which J is nearly as good, since a gentle force spares valve and machine; then scale and lead
time once more. Values are preferred numbers. Nothing is random, so the same problem has the same answer. All of it is
our choice.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.servo.closed_loop import (
    Axis,
    Performance,
    Run,
    TestMotions,
    judge,
    whole_delay,
    with_wrong_friction,
    without_feedforward,
)
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.tuning.settings import TuningSettings

MOST_CANDIDATES = 100
"""The search ends after as many, so that its time is bounded."""

SCALE_STEP = 0.01  # [-] raster of coulomb_scale
LEAD_STEPS = 20  # raster of lead_time: so many steps to the whole delay
PREFERRED = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)  # ISO 3, series R10
GRID_SCALES = (0.0, 0.3, 0.6, 0.9, 1.2)  # [-]
GRID_LEADS = (0.0, 1.0, 2.0)  # of the whole delay
STRIDES = (8, 4, 2, 1)  # steps of the raster that the compass search takes
AS_GOOD = 1.05  # J that is nearly as good
SEARCH_HOLD = 0.2  # [s] of rest that is watched while searching; what is found is watched for `hold_time`


class Case(NamedTuple):
    """The axis with a model that is wrong in a certain way."""

    friction_error: float
    """[-] share that the model gives too much"""
    delay_error: float
    """[-] share of the whole delay that comes on top"""
    performance: Performance


class Tuning(NamedTuple):
    """What the search found."""

    feedforward: FeedForwardSettings
    merit: float
    """[-] J"""
    without: Performance
    cases: tuple[Case, ...]
    """nine, by friction error, then by delay error"""
    candidates: int
    """how many settings were looked at"""

    @property
    def nominal(self) -> Performance:
        """The axis with a model that is right."""
        return next(case.performance for case in self.cases if not (case.friction_error or case.delay_error))

    @property
    def better_in_every_case(self) -> bool:
        """Whether error and dwell are below those without feed-forward, and nothing reverses more, in every case."""
        return all(
            case.performance.tracking_rms < self.without.tracking_rms
            and case.performance.dwell <= self.without.dwell
            and case.performance.limit_cycle_reversals <= self.without.limit_cycle_reversals
            for case in self.cases
        )


class Raster(NamedTuple):
    """Settings of the search as whole numbers of steps."""

    scale: int
    lead: int
    smoothing: int
    slew: int


def preferred(index: int) -> float:
    """Preferred number: 1, 1.25, 1.6, ... for 0, 1, 2, ..., ten to a decade."""
    decade, place = divmod(index, len(PREFERRED))
    return float(f'{PREFERRED[place]}e{decade}')


def nearest_preferred(value: float) -> int:
    """Index of the preferred number nearest to a positive value."""
    return round(len(PREFERRED) * math.log10(value))


@dataclass(frozen=True)
class Problem:
    """A plant, what it shall do, and what its sensors read too much.

    Raises:
        ValueError: The servo cannot follow the reference.
    """

    axis: Axis
    settings: TuningSettings
    noise: FloatArray | None = None
    """as of `closed_loop`"""

    def __post_init__(self) -> None:
        gains, s = self.axis.servo.gains, self.settings
        speed = 2.0 * math.pi * s.frequency * s.amplitude
        acceleration = 2.0 * math.pi * s.frequency * speed
        for name, value, most, unit in (
            ('way', s.amplitude, gains.reach, 'm'),
            ('speed', speed, gains.speed_max, 'm/s'),
            ('acceleration', acceleration, gains.acceleration_max, 'm/s2'),
        ):
            if value > most:
                raise ValueError(
                    f'amplitude = {s.amplitude} m at frequency = {s.frequency} Hz: {name} {value:.4g} {unit} is more '
                    f'than the {most:.4g} {unit} that the servo follows'
                )

    def motions(self, hold_time: float) -> TestMotions:
        """The motions that the axis is judged by, with a rest [s] after each."""
        return TestMotions(Sine(self.settings.amplitude, self.settings.frequency), hold_time)

    @property
    def lead_step(self) -> float:
        """Raster of the lead time [s]."""
        return preferred(nearest_preferred(whole_delay(self.axis.servo, self.settings.delay) / LEAD_STEPS))

    def feedforward(self, place: Raster) -> FeedForwardSettings:
        """Settings at a place of the raster, those that are not searched as they were."""
        return replace(
            self.axis.pipeline.feedforward,
            coulomb_scale=bounded('coulomb_scale', round(place.scale * SCALE_STEP, 10)),
            lead_time=bounded('lead_time', round(place.lead * self.lead_step, 10)),
            smoothing_velocity=bounded('smoothing_velocity', preferred(place.smoothing)),
            slew_limit=bounded('slew_limit', preferred(place.slew)),
        )

    def case(
        self, feedforward: FeedForwardSettings, friction_error: float, delay_error: float, hold_time: float
    ) -> Case:
        """The axis with a feed-forward whose model is wrong, watched at rest for ``hold_time`` [s].

        The delay error is one of `whole_delay`, all of it on the way to the controller, which cannot become shorter
        than nothing.
        """
        motions = self.motions(hold_time)
        runs = self.runs(feedforward, friction_error, delay_error, hold_time)
        return Case(friction_error, delay_error, judge(self.axis.servo.control_period, motions, *runs))

    def runs(
        self,
        feedforward: FeedForwardSettings,
        friction_error: float = 0.0,
        delay_error: float = 0.0,
        hold_time: float = SEARCH_HOLD,
    ) -> tuple[Run, Run, Run]:
        """Sine, move and step of `case`."""
        plant, parameters = self.axis
        delay = self.settings.delay + delay_error * whole_delay(plant, self.settings.delay)
        wrong = with_wrong_friction(parameters._replace(feedforward=feedforward), friction_error)
        return self.motions(hold_time).runs(Axis(plant, wrong), max(delay, 0.0), self.noise)

    def without(self) -> Performance:
        """The axis without feed-forward."""
        none = without_feedforward(self.axis.pipeline.feedforward)
        return self.case(none, 0.0, 0.0, self.settings.hold_time).performance

    def errors(self) -> tuple[tuple[float, float], ...]:
        """Friction and delay error of each case: none first, then the ones that most often decide."""
        f, d = self.settings.friction_error, self.settings.delay_error
        both = [(0.0, 0.0), (-f, d), (f, d), (-f, -d), (f, -d), (-f, 0.0), (f, 0.0), (0.0, d), (0.0, -d)]
        return tuple(dict.fromkeys(both))


def bounded(name: str, value: float) -> float:
    """A value of a setting of the feed-forward, within its bounds."""
    meaning = meanings(FeedForwardSettings)[name]
    lower, upper = meaning.lower, meaning.upper
    return min(max(value, lower if lower is not None else value), upper if upper is not None else value)


def merit(problem: Problem, without: Performance, cases: list[Case]) -> float:
    """J of the cases, infinite where one of them is out; with more cases it only becomes larger.

    One of them is the one without errors. Where the axis does not dwell without feed-forward, one sample of dwell
    counts as much as all of it does elsewhere.
    """
    settings = problem.settings
    overshoot = max(2.0 * settings.amplitude * settings.overshoot_limit, without.overshoot)
    for case in cases:
        if case.performance.overshoot > overshoot:
            return math.inf
        if case.performance.limit_cycle_reversals > without.limit_cycle_reversals:
            return math.inf
    (nominal,) = (case.performance for case in cases if not (case.friction_error or case.delay_error))
    error = nominal.tracking_rms + max(case.performance.tracking_rms for case in cases)
    dwell = nominal.dwell + max(case.performance.dwell for case in cases)
    return 0.25 * (error / without.tracking_rms + dwell / max(without.dwell, problem.axis.servo.control_period))


def _nothing(steps: int) -> None:
    del steps


def tune(problem: Problem, advance: Callable[[int], None] = _nothing) -> Tuning:
    """Search for the feed-forward.

    Args:
        problem: Plant and task.
        advance: Called with 1 for every candidate, `MOST_CANDIDATES` times at most.
    """
    without = problem.without()
    found: dict[Raster, float] = {}

    def worth(place: Raster) -> float:
        """J of a place; of one that cannot win any more, what was seen of it until then."""
        if place not in found:
            if len(found) >= MOST_CANDIDATES:
                return math.inf
            best, value, cases = min(found.values(), default=math.inf), math.inf, []
            for errors in problem.errors():
                cases.append(problem.case(problem.feedforward(place), *errors, SEARCH_HOLD))
                value = merit(problem, without, cases)
                if value > AS_GOOD * best:
                    break
            found[place] = value
            advance(1)
        return found[place]

    place = _compass(min(_grid(problem), key=worth), worth, STRIDES)
    place = _gentlest(place, worth)
    feedforward = problem.feedforward(_compass(place, worth, STRIDES[-1:]))
    cases = [problem.case(feedforward, *errors, problem.settings.hold_time) for errors in sorted(problem.errors())]
    return Tuning(feedforward, merit(problem, without, cases), without, tuple(cases), len(found))


def _grid(problem: Problem) -> list[Raster]:
    """Places all over scale and lead time, with the sharpest force that samples can carry.

    It switches within half of the speed that the sine gains from sample to sample, and by twice the force limit.
    """
    settings, period = problem.settings, problem.axis.servo.control_period
    gained = (2.0 * math.pi * settings.frequency) ** 2 * settings.amplitude * period
    jump = 2.0 * problem.axis.pipeline.feedforward.force_limit / period
    smoothing, slew = nearest_preferred(0.5 * gained), nearest_preferred(max(jump, 1.0))
    whole = whole_delay(problem.axis.servo, settings.delay) / problem.lead_step
    return [
        Raster(round(scale / SCALE_STEP), round(lead * whole), smoothing, slew)
        for scale in GRID_SCALES
        for lead in (GRID_LEADS if scale else (0.0,))
    ]


def _compass(place: Raster, worth: Callable[[Raster], float], strides: Sequence[int]) -> Raster:
    """Go to the better neighbour in scale or lead time for as long as there is one, then shorten the stride."""
    for stride in strides:
        while True:
            neighbours = [
                place._replace(**{name: value})
                for name in ('scale', 'lead')
                for value in (getattr(place, name) - stride, getattr(place, name) + stride)
                if value >= 0
            ]
            better = min(neighbours, key=worth)
            if worth(better) >= worth(place):
                break
            place = better
    return place


def _gentlest(place: Raster, worth: Callable[[Raster], float]) -> Raster:
    """Widest smoothing, then lowest slew limit, that is nearly as good."""
    most = AS_GOOD * worth(place)
    for name, way in (('smoothing', 1), ('slew', -1)):
        for stride in STRIDES:
            while worth(gentler := place._replace(**{name: getattr(place, name) + way * stride})) <= most:
                place = gentler
    return place
