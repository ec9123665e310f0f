r"""How far the friction law is off on this machine today: a scale on the friction, an offset of the force sum.

While the rod slides evenly, the force sum less inertia is a reading y of the friction:

.. math:: y = \Sigma F - m a = s\,f\,d + b + e

with f the friction of the law at the pressure and speed in use, d = +-1 the direction, s the scale of the friction and
b the offset of the force sum: load, area or sensor zero that nobody took off. Within one direction s and b cannot be
told apart. Over a reversal they can: friction changes its sign, the offset does not. So each has a time scale of its
own:

- **Offset**, at every usable sample: the mean of y - s f d over the last half second (`WINDOW`). It starts anew at a
  reversal and after a load step, so it holds nothing older than that.
- **Scale**, once a reversal, from the means of the two strokes before it. They cover nearly the same way, and the slope
  c of y over the travel x, common to both, takes off the rest, so that a load over position cancels:

.. math:: z = d_2 \frac{\bar y_2 - \bar y_1 - c (\bar x_2 - \bar x_1)}{\bar f_1 + \bar f_2}

  s follows the median m of the last six z. A load step within a stroke spoils two z, an offset that drifts makes them
  alternate; the median of an even number of values passes on neither. The standard deviation of s is that of the median
  of independent z, from their mean absolute deviation, and the distance that s still has to go. At each reversal s goes
  half of the way to a median that is clearly elsewhere, and less where the distance is mostly noise, of which the
  median has the standard deviation sigma_m by the differences of one z to the next, so that a drift is no noise:

.. math:: s \leftarrow s + \frac{(m - s)^2}{(m - s)^2 + 4 \sigma_m^2}\,\frac{m - s}{2}

- Force sum, friction of the law and velocity go through **the same two lags**, of which the acceleration is taken: so
  inertia and friction are compared at one and the same time, also while the rod accelerates.
- **Noise**, the standard deviation of the residual: it grows with each residual outside its 95 % band and shrinks with
  each one inside, so that the band holds 95 % in the long run, whatever the distribution.

Nothing is learnt at rest, with a bad input, or while the rod accelerates; the scale never outside the identified range
or from one direction alone. s changes by at most `LARGEST_CHANGE` a reversal, and not at all while the median is out of
its bounds: what the force sum shows then is not this friction.

Source: estimates with forgetting, [Ljung1999]_ chapter 11; friction as the half difference of the two directions, as
the thesis evaluates Tables A-1 to A-3; width of a band from its misses, [Gibbs2021]_. The two time scales, the median
and all numbers are our choice.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from seal_friction_ros.core.estimation.records import NEVER
from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.friction.actuator import ActuatorFriction

MODES = ('off', 'observe', 'on')

WINDOW = 0.5  # [s] time constant of the offset
LONGEST_MEMORY = 10.0  # [s] time constant of the means of one direction that two directions are compared by
LEAST_SHARE = 0.2  # [-] duration of the shorter of two directions that are compared over that of the longer
FEWEST_SAMPLES = 4  # in each of them
LONGEST_PAUSE = 60.0  # [s] between two directions that are compared
WIDTH_TIME = 1.0  # [s] of even sliding outside the band that make it e times as wide
OUTSIDE = 0.05  # [-] share of the residuals that the band leaves outside
ONE_SIDED_95 = 1.644854  # [-] 95 % of a normal distribution are below it
OUTLIER = 4.0  # [-] residual over its standard deviation above which a sample is a spike, or a load step
STEP_SAMPLES = 2  # outliers in a row that are a load step
LAG = 0.005  # [s] time constant of each of the two lags of all signals, with which the acceleration is taken
SETTLED = 0.95  # [-] of the friction, which its lagging value must have reached after a reversal
LARGEST_INERTIA = 0.5  # [-] of the friction, in a reading with a known mass: the mass may be wrong
LONGEST_STEP = 0.1  # [s] after a longer gap the acceleration starts anew
LEARNING_INTERVAL = 4_000_000  # [ns] least time between two samples that are learnt from: what it costs at 1 kHz
LEAST_STD = 0.01  # [-] of the friction, below which no standard deviation is believed
FEWEST_REVERSALS = 3  # before which no scale is believed
FORGETTING_TIME = 3600.0  # [s] without a reversal in which the scale becomes as uncertain as the seal file
LARGEST_CHANGE = 0.1  # [-] of the scale in one reversal
GAIN = 0.5  # [-] share of the way to the median that the scale goes in one reversal, without noise
NOISE_WEIGHT = 4.0  # [-] of the variance of the median against the square of that way
STD_OF_MEAN_DIFFERENCE = 0.8862  # [-] standard deviation over mean absolute difference of two such values in a row
STD_OF_MEAN_DEVIATION = 1.2533  # [-] standard deviation over mean absolute deviation of a normal distribution


@dataclass(frozen=True)
class AdaptationSettings:
    """Settings of the adaptation, one field per ROS parameter.

    Raises:
        ValueError: A setting is out of bounds, or the mode is unknown.
    """

    COMPILED: ClassVar = ('moving_mass', 'acceleration_max', 'scale_min', 'scale_max')

    mode: str = parameter(
        'observe',
        unit='',
        description='off: the seal file as it is. observe: scale and offset are learnt and published, nothing else '
        'changes but the standard deviation and the status. on: estimate and feed-forward use the scale.',
    )
    moving_mass: float = parameter(
        0.0, unit='kg', lower=0.0, upper=1e6, description='m; 0: unknown, then learnt at even speed only.'
    )
    acceleration_max: float = parameter(
        0.05,
        unit='m/s^2',
        lower=1e-6,
        upper=1e3,
        description='Largest acceleration that counts as even speed; with a moving mass its inertia counts instead.',
    )
    scale_min: float = parameter(0.3, unit='1', lower=0.01, upper=1.0, description='Lowest scale.')
    scale_max: float = parameter(3.0, unit='1', lower=1.0, upper=100.0, description='Highest scale.')

    def __post_init__(self) -> None:
        check(self)
        if self.mode not in MODES:
            raise ValueError(f'AdaptationSettings.mode = {self.mode!r} is not one of {", ".join(MODES)}')


class Level(NamedTuple):
    """Means over the last half second of even sliding in one direction."""

    direction: int  # -1 or 1; 0: none
    stamp: int  # [ns] of the newest sample in it
    reading: float  # [N] y
    friction: float  # [N] f of the law, >= 0
    pressure_a: float  # [Pa, gauge]
    pressure_b: float  # [Pa, gauge]
    travel: float  # [m] place of the rod, from any zero
    travel_variance: float  # [m^2]
    covariance: float  # [N m] of reading and travel
    duration: float  # [s] of even sliding
    samples: int


class Ratios(NamedTuple):
    """z of the last six reversals, the newest first."""

    first: float
    second: float
    third: float
    fourth: float
    fifth: float
    sixth: float


class Learnt(NamedTuple):
    """What is learnt."""

    direction: int  # -1 or 1, of the last sample that was learnt from; 0: none
    offset: float  # [N] b
    samples: int  # in the mean of the offset
    outliers: int  # in a row
    noise: float  # [N] standard deviation of the residual; negative: not known yet
    level: Level  # of the present direction
    before: Level  # of the direction before
    scale: float  # [-] s
    scale_std: float  # [-] negative: nothing is learnt yet
    median: float  # [-] of the last z; it has no bounds
    ratios: Ratios
    reversals: int  # number of z so far


class Lagging(NamedTuple):
    """Signals after one lag, or after two: what has the same lags can be compared."""

    velocity: float  # [m/s]
    force_sum: float  # [N]
    friction: float  # [N] f d of the law; 0.0 at rest
    travel: float  # [m] integrated velocity


class AdaptationState(NamedTuple):
    """What one sample leaves for the next."""

    stamp: int  # [ns] of the last sample that was taken; `NEVER` before the first
    once: Lagging
    twice: Lagging
    acceleration: float  # [m/s^2] of the velocity after two lags
    travel: float  # [m] integrated velocity, without a lag
    learnt: Learnt
    learnt_stamp: int  # [ns] of the last sample that was learnt from


NO_LEVEL = Level(0, NEVER, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)
NOTHING_LEARNT = Learnt(0, 0.0, 0, 0, -1.0, NO_LEVEL, NO_LEVEL, 1.0, -1.0, 1.0, Ratios(1.0, 1.0, 1.0, 1.0, 1.0, 1.0), 0)
NO_SIGNALS = Lagging(0.0, 0.0, 0.0, 0.0)
NOT_ADAPTED = AdaptationState(NEVER, NO_SIGNALS, NO_SIGNALS, 0.0, 0.0, NOTHING_LEARNT, NEVER)
"""State before the first sample."""


class Slide(NamedTuple):
    """One sample of the rod."""

    stamp: int  # [ns]
    velocity: float  # [m/s] at which the seals slide, conditioned; 0.0 at rest
    force_sum: float  # [N]
    friction: float  # [N] of the law at this pressure and speed, >= 0, before any scale
    friction_std: float  # [N] of a new reading, by the seal file
    pressure_a: float  # [Pa, gauge]
    pressure_b: float  # [Pa, gauge]
    is_usable: bool  # whether every input is good
    is_identified: bool  # whether the law was identified at this pressure and speed


class Reading(NamedTuple):
    """One reading of the friction, after two lags."""

    direction: int  # -1 or 1
    force: float  # [N] y
    friction: float  # [N] f of the law
    travel: float  # [m]
    missed: float  # [N] residual of the sample itself, without lags but for the inertia


@compilable
def is_due(state: AdaptationState, stamp: int) -> bool:
    """Whether the sample of this stamp is to be learnt from: the last one is old enough, or the clock went back."""
    return not 0 <= stamp - state.stamp < LEARNING_INTERVAL


@compilable
def residual(
    settings: AdaptationSettings, state: AdaptationState, velocity: float, force_sum: float, friction: float
) -> float:
    """What a reading [N] is more than was learnt before: y - s f d - b; 0.0 at rest.

    Args:
        settings: With the moving mass.
        state: Before this sample is learnt from, its acceleration that of the last sample taken.
        velocity: [m/s] 0.0 at rest.
        force_sum: [N]
        friction: Of the law [N], >= 0.
    """
    if velocity == 0.0:
        return 0.0
    learnt = state.learnt
    reading = force_sum - settings.moving_mass * state.acceleration - learnt.offset
    return reading - learnt.scale * friction if velocity > 0.0 else reading + learnt.scale * friction


@compilable
def adapt(settings: AdaptationSettings, state: AdaptationState, slide: Slide) -> AdaptationState:
    """Learn from one sample.

    Args:
        settings: Settings; the mode does not matter here.
        state: `NOT_ADAPTED` or the state before.
        slide: The sample.

    Returns:
        The next state.
    """
    stamp, velocity, force_sum, friction, _, _, _, learns, _ = slide
    last, once, twice, _, travel, learnt, learnt_stamp = state
    direction = (1 if velocity > 0.0 else -1) if velocity != 0.0 else 0
    elapsed = (stamp - last) * 1e-9 if last != NEVER else 0.0
    if not 0.0 < elapsed <= LONGEST_STEP:  # nobody knows how far the rod went meanwhile
        once = Lagging(velocity, force_sum, friction * direction, travel)
        return AdaptationState(stamp, once, once, 0.0, travel, _interrupted(learnt), learnt_stamp)
    share = elapsed / (elapsed + LAG)
    newest = (velocity - once.velocity) / (elapsed + LAG)
    acceleration = (once.velocity + share * (velocity - once.velocity) - twice.velocity) / (elapsed + LAG)
    inertia = settings.moving_mass * acceleration
    missed = force_sum - inertia - learnt.scale * friction * direction - learnt.offset
    learns = learns and direction != 0 and _is_even(settings, acceleration, newest, learnt.scale * friction)
    if learns and _is_spike(learnt, direction, missed):
        force_sum += between(-OUTLIER * learnt.noise, missed, OUTLIER * learnt.noise) - missed
    travel += velocity * elapsed
    once = _lagging(once, Lagging(velocity, force_sum, friction * direction, travel), share)
    twice = _lagging(twice, once, share)
    if learns and twice.friction * direction >= SETTLED * friction > 0.0:
        since = (stamp - learnt_stamp) * 1e-9 if learnt_stamp != NEVER else LONGEST_STEP
        reading = Reading(direction, twice.force_sum - inertia, twice.friction * direction, twice.travel, missed)
        learnt = _learn(settings, learnt, slide, between(0.0, since, LONGEST_STEP), reading)
        learnt_stamp = stamp
    return AdaptationState(stamp, once, twice, acceleration, travel, learnt, learnt_stamp)


@compilable
def _lagging(before: Lagging, newest: Lagging, share: float) -> Lagging:
    """Signals after one more lag."""
    velocity, force_sum, friction, travel = before
    return Lagging(
        velocity + share * (newest.velocity - velocity),
        force_sum + share * (newest.force_sum - force_sum),
        friction + share * (newest.friction - friction),
        travel + share * (newest.travel - travel),
    )


@compilable
def _interrupted(learnt: Learnt) -> Learnt:
    """What is learnt, without the strokes that are not yet compared."""
    direction, offset, samples, outliers, noise, _, _, scale, std, median, ratios, reversals = learnt
    return Learnt(
        direction, offset, samples, outliers, noise, NO_LEVEL, NO_LEVEL, scale, std, median, ratios, reversals
    )


@compilable
def _is_spike(learnt: Learnt, direction: int, missed: float) -> bool:
    """Whether a residual ``missed`` [N] is too large for the noise, and the first of its kind."""
    if learnt.noise < 0.0 or direction != learnt.direction or learnt.outliers + 1 >= STEP_SAMPLES:
        return False
    return abs(missed) > OUTLIER * learnt.noise


@compilable
def _learn(settings: AdaptationSettings, learnt: Learnt, slide: Slide, elapsed: float, newest: Reading) -> Learnt:
    """What is learnt after one more reading, ``elapsed`` [s] after the one before."""
    last_direction, offset, samples, outliers, noise, level, before, scale, std, median, ratios, reversals = learnt
    direction, reading, friction, _, missed = newest
    if noise < 0.0:
        noise = slide.friction_std
    if direction != last_direction:
        if _can_be_compared(before, level):
            ratio = _ratio(before, level)
            old_scale = scale
            scale, std, median, ratios = _learnt_scale(settings, scale, std, ratios, reversals, ratio)
            offset += (old_scale - scale) * friction * direction
            reversals += 1
        before, level, samples, outliers = level, NO_LEVEL, 0, 0
    elif abs(missed) > OUTLIER * noise:
        outliers += 1
        if outliers >= STEP_SAMPLES:
            samples, outliers = 0, 0
    else:
        outliers = 0
    samples += 1
    outside = 1.0 if abs(missed) > BAND_95 * noise else 0.0
    noise *= 1.0 + elapsed / WIDTH_TIME * (outside - OUTSIDE)
    if slide.is_identified:
        level = _averaged(level, slide, elapsed, newest)
    offset += _share(elapsed, WINDOW, samples) * (reading - scale * friction * direction - offset)
    return Learnt(direction, offset, samples, outliers, noise, level, before, scale, std, median, ratios, reversals)


@compilable
def with_scale(friction: ActuatorFriction, learnt: Learnt, stamp: int, uses_scale: bool) -> ActuatorFriction:
    r"""Friction by what is learnt, with the standard deviation of the next reading.

    With ``uses_scale`` it is :math:`\sigma = \max(\sigma_e, \sigma_s f, 0.01 f)` with :math:`\sigma_e` the noise: a
    force that stands still has no residual, and nobody knows a friction to less than 1 % (our choice). Without, the
    friction misses :math:`m = |s - 1| f`, and the band that holds 95 % of a normal distribution about m is
    :math:`(m + 1.64 \sigma) / 1.96` where that is wider. While nothing is learnt, the deviation is that of the seal
    file; over an hour without a reversal its variance comes back, since friction in one direction may change unseen.

    Args:
        friction: By the seal file.
        learnt: Before this sample.
        stamp: Of this sample [ns].
        uses_scale: Whether the estimate has the scale.
    """
    scale_std = learnt.scale_std
    if scale_std < 0.0:
        return friction
    coulomb, file_std, stiction, in_identified_range, velocity_friction = friction
    sliding, reversal = coulomb + velocity_friction, learnt.before.stamp
    least = (scale_std if scale_std > LEAST_STD else LEAST_STD) * sliding
    std = learnt.noise if learnt.noise > least else least
    forgotten = between(0.0, (stamp - reversal) * 1e-9 / FORGETTING_TIME, 1.0) if reversal != NEVER else 1.0
    std = math.sqrt(std * std + forgotten * file_std * file_std)
    if not uses_scale:
        missed = (abs(learnt.scale - 1.0) * sliding + ONE_SIDED_95 * std) / BAND_95
        return ActuatorFriction(coulomb, max(std, missed), stiction, in_identified_range, velocity_friction)
    scale = learnt.scale
    return ActuatorFriction(scale * coulomb, std, scale * stiction, in_identified_range, scale * velocity_friction)


@compilable
def disagrees(
    settings: AdaptationSettings, learnt: Learnt, friction: ActuatorFriction, uses_scale: bool, is_at_rest: bool
) -> bool:
    """Whether what is learnt contradicts the law beyond twice the deviation that its seal file states.

    The same if the ratio is out of bounds, and at rest if the force sum has an offset of more than half the breakaway
    force, since the state at rest stands on the force sum (our choice).

    Args:
        settings: With the bounds.
        learnt: Before this sample.
        friction: By the seal file.
        uses_scale: Whether the estimate has the scale.
        is_at_rest: Whether the rod rests.
    """
    if learnt.scale_std < 0.0:
        return False
    if not settings.scale_min <= learnt.median <= settings.scale_max:
        return True
    used = learnt.scale if uses_scale else 1.0
    if is_at_rest and abs(learnt.offset) > 0.5 * used * (friction.coulomb_friction + friction.stiction):
        return True
    return abs(learnt.median - used) * friction.coulomb_friction > 2.0 * friction.coulomb_friction_std


@compilable
def _is_even(settings: AdaptationSettings, acceleration: float, newest: float, friction: float) -> bool:
    """Whether the speed is even: little inertia against the friction [N], or little acceleration if no mass is known.

    Args:
        settings: With the limits.
        acceleration: [m/s^2] after two lags, which takes the inertia off.
        newest: [m/s^2] after one: noisier, but it shows a change earlier.
        friction: Scaled [N].
    """
    largest = abs(acceleration) if abs(acceleration) > abs(newest) else abs(newest)
    if settings.moving_mass > 0.0:
        return settings.moving_mass * largest <= LARGEST_INERTIA * friction
    return largest <= settings.acceleration_max


@compilable
def _averaged(level: Level, slide: Slide, elapsed: float, newest: Reading) -> Level:
    """Level after one more reading."""
    _, _, mean_reading, friction, pressure_a, pressure_b, place, variance, covariance, duration, samples = level
    direction, reading, newest_friction, travel, _ = newest
    samples += 1
    share = _share(elapsed, LONGEST_MEMORY, samples)
    further, higher = travel - place, reading - mean_reading
    return Level(
        direction,
        slide.stamp,
        mean_reading + share * higher,
        friction + share * (newest_friction - friction),
        pressure_a + share * (slide.pressure_a - pressure_a),
        pressure_b + share * (slide.pressure_b - pressure_b),
        place + share * further,
        (1.0 - share) * (variance + share * further * further),
        (1.0 - share) * (covariance + share * further * higher),
        duration + elapsed,
        samples,
    )


@compilable
def _can_be_compared(before: Level, after: Level) -> bool:
    """Whether two levels are of opposite directions, close in time and long enough."""
    if before.direction * after.direction >= 0:
        return False
    if (after.stamp - before.stamp) * 1e-9 - after.duration > LONGEST_PAUSE:
        return False
    if before.samples < FEWEST_SAMPLES or after.samples < FEWEST_SAMPLES:
        return False
    return between(LEAST_SHARE, before.duration / after.duration, 1.0 / LEAST_SHARE) == before.duration / after.duration


@compilable
def _ratio(before: Level, level: Level) -> float:
    """Ratio z of the equation at the top."""
    variance = before.travel_variance + level.travel_variance
    slope = (before.covariance + level.covariance) / variance if variance > 0.0 else 0.0
    change = level.reading - before.reading - slope * (level.travel - before.travel)
    return level.direction * change / (level.friction + before.friction)


@compilable
def _share(elapsed: float, memory: float, samples: int) -> float:
    """Weight of a new sample in a mean: a plain one at first, later forgetting with time constant ``memory`` [s]."""
    share = elapsed / (elapsed + memory)
    return share if share * samples >= 1.0 else 1.0 / samples


@compilable
def _learnt_scale(
    settings: AdaptationSettings, scale: float, std: float, ratios: Ratios, reversals: int, ratio: float
) -> tuple[float, float, float, Ratios]:
    """Scale, its standard deviation, median and ratios after one more ratio, with ``reversals`` before it."""
    ratios = Ratios(ratio, ratios.first, ratios.second, ratios.third, ratios.fourth, ratios.fifth)
    known = reversals + 1 if reversals + 1 < len(ratios) else len(ratios)
    median = _median(ratios, known)
    if known < FEWEST_REVERSALS:
        return scale, std, median, ratios
    deviation, difference = 0.0, 0.0
    for i in range(known):
        deviation += abs(ratios[i] - median)
        if i > 0:
            difference += abs(ratios[i] - ratios[i - 1])
    deviation *= STD_OF_MEAN_DEVIATION / known
    difference *= STD_OF_MEAN_DIFFERENCE / (known - 1)
    of_median = 0.5 * math.pi / known  # the variance of a median is pi / 2 times that of a mean
    if settings.scale_min <= median <= settings.scale_max:
        most, distance = LARGEST_CHANGE * scale, median - scale
        evident = distance * distance
        share = evident / (evident + NOISE_WEIGHT * of_median * difference * difference) if evident > 0.0 else 0.0
        scale += between(-most, GAIN * share * distance, most)
    std = math.sqrt(of_median * deviation * deviation + (median - scale) * (median - scale))
    return scale, std, median, ratios


@compilable
def _median(ratios: Ratios, known: int) -> float:
    """Median of the first ``known`` ratios, by rank: no value needs to move."""
    low, high = ratios[0], ratios[0]
    for i in range(known):
        below = 0
        for k in range(known):
            if ratios[k] < ratios[i] or (ratios[k] == ratios[i] and k < i):
                below += 1
        if below == (known - 1) // 2:
            low = ratios[i]
        if below == known // 2:
            high = ratios[i]
    return 0.5 * (low + high)
