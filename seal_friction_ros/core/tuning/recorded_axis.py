r"""How well a feed-forward would have matched the friction that a real axis showed.

.. math:: F_S - m a - F_0 = s f_c\,\mathrm{sgn}(v)

The left side is the friction: force sum less what accelerates the mass, less a constant offset of the force sum. While
the rod slides, s, m and F_0 follow by least squares from force sum, acceleration and the Coulomb friction f_c of the
estimator. s is the scale that a feed-forward needs, wrong model and all.

The smoothing is the widest with which the law, along the rod's own motion, is nearly as good as with the best; the
slew limit the lowest with which the force that the recorded reference asks for is nearly the same. Along the reference
the smoothing would be far too wide, since a rod without compensation reverses late. How late the force of an axis comes
after its command cannot be seen in a recording of it. All of it is our choice.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from seal_friction_ros.core.estimation import feedforward
from seal_friction_ros.core.estimation.feedforward import UNUSABLE, FeedForwardSettings, Motion
from seal_friction_ros.core.estimation.records import FrictionEstimate
from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.tuning.settings import MatchSettings
from seal_friction_ros.core.tuning.simulated_axis import bounded, nearest_preferred, preferred

ACCELERATION_WINDOW = 11  # samples of velocity to whose parabola an acceleration belongs
MOST_UNEVEN = 0.5  # of the median period; a sample further off the beat has no acceleration
FEWEST_SLIDING = 100  # samples, to fit anything to
BOTH_DIRECTIONS = 0.1  # of the sliding samples at least in each direction, or the offset is not told from the friction
NEAR_REVERSAL = 0.1  # of the time between two reversals of the reference, before and after each
NEARLY = 0.05  # of the friction: an RMS difference as large is nearly none
TOLD = 0.05  # a relative standard deviation above it is no knowledge
SHARPEST_SMOOTHING = 1e-5  # [m/s]


class Recording(NamedTuple):
    """What an axis did, one entry per velocity sample."""

    estimates: Sequence[FrictionEstimate]
    motions: Sequence[Motion]
    """reference and measured motion"""
    force_sum: FloatArray
    """[N], shape (n,)"""

    @property
    def time(self) -> FloatArray:
        """Since the first sample [s], shape (n,)."""
        first = self.estimates[0].stamp
        return np.array([(estimate.stamp - first) * 1e-9 for estimate in self.estimates])

    @property
    def velocity(self) -> FloatArray:
        """Of the rod [m/s], shape (n,)."""
        return np.array([motion.measured_velocity for motion in self.motions])

    @property
    def reference_velocity(self) -> FloatArray:
        """[m/s], shape (n,)."""
        return np.array([motion.reference_velocity for motion in self.motions])

    @property
    def coulomb_friction(self) -> FloatArray:
        """[N], shape (n,)."""
        return np.array([estimate.coulomb_friction for estimate in self.estimates])


class Law(NamedTuple):
    """What the axis says about its friction."""

    scale: float
    """[-] s"""
    scale_std: float
    """[-]"""
    mass: float
    """[kg] m"""
    mass_is_fitted: bool
    offset: float
    """[N] F_0; 0 where only one direction was driven"""
    friction: FloatArray
    """[N] force sum less mass times acceleration less offset; NaN where it is not known"""
    sliding: BoolArray
    """samples that the law was fitted to"""


class Residual(NamedTuple):
    """RMS [N] of the friction that a feed-forward leaves to the controller while the rod slides.

    At rest friction is whatever the rod is pushed with, so there is nothing to match.
    """

    sliding: float
    """all of the time"""
    reversal: float
    """near a reversal of the reference; 0 where the rod never slides there"""


class MatchCase(NamedTuple):
    """What is left with a model or a delay that is wrong."""

    friction_error: float
    """[-] share that the model gives too much"""
    delay_error: float
    """[-] share of the delay that comes on top"""
    residual: Residual


class Match(NamedTuple):
    """What a recording says about the feed-forward."""

    feedforward: FeedForwardSettings
    told: dict[str, bool]
    """parameter -> whether it follows from the recording; else it is what it was"""
    law: Law
    reversal: BoolArray
    """samples near a reversal of the reference"""
    without: Residual
    cases: tuple[MatchCase, ...]
    """nine, by friction error, then by delay error"""
    force: FloatArray
    """[N] of the feed-forward when it acts, nothing wrong"""

    @property
    def nominal(self) -> Residual:
        """What is left with nothing wrong."""
        return next(case.residual for case in self.cases if not (case.friction_error or case.delay_error))

    @property
    def better_in_every_case(self) -> bool:
        """Whether the feed-forward leaves less friction than there is, whatever is wrong, while the rod slides."""
        return all(case.residual.sliding < self.without.sliding for case in self.cases)


def acceleration(time: FloatArray, velocity: FloatArray) -> FloatArray:
    """Slope of the parabola through `ACCELERATION_WINDOW` samples [m/s^2]; NaN where they are not evenly in time.

    Args:
        time: [s], shape (n,).
        velocity: [m/s], shape (n,).
    """
    half = ACCELERATION_WINDOW // 2
    slope = np.full(len(time), math.nan)
    if len(time) <= 2 * half:
        return slope
    steps = np.diff(time)
    period = float(np.median(steps))
    if period <= 0.0:
        return slope
    # What is not finite spreads through the whole window, as it must.
    slope[half:-half] = savgol_filter(velocity, ACCELERATION_WINDOW, 2, deriv=1, delta=period)[half:-half]
    for place in np.flatnonzero(~(np.abs(steps - period) <= MOST_UNEVEN * period)):
        slope[max(place + 1 - half, 0) : place + 1 + half] = math.nan
    return slope


def fit_law(recording: Recording, mass: float | None = None) -> Law:
    """Scale, mass and offset by least squares over the samples that slide.

    Args:
        recording: What the axis did.
        mass: [kg] if it is known; else it is fitted.

    Raises:
        ValueError: It slides too little, or with too little variety to tell the terms apart.
    """
    velocity = recording.velocity
    slope = acceleration(recording.time, velocity)
    coulomb = recording.coulomb_friction
    state = np.array([estimate.state for estimate in recording.estimates])
    usable = np.array([not estimate.status & UNUSABLE for estimate in recording.estimates])
    sliding = (state == FrictionState.SLIDING) & usable & np.isfinite(slope) & np.isfinite(recording.force_sum)
    count = int(np.count_nonzero(sliding))
    if count < FEWEST_SLIDING:
        raise ValueError(
            f'the rod slides in {count} usable samples, and {FEWEST_SLIDING} are needed to see its friction: '
            'record it while it moves to and fro'
        )
    forward = np.count_nonzero(velocity[sliding] > 0.0) / count
    both = BOTH_DIRECTIONS <= forward <= 1.0 - BOTH_DIRECTIONS
    columns = [coulomb * np.sign(velocity), slope, np.ones(len(velocity))]
    used = [0] + ([1] if mass is None else []) + ([2] if both else [])
    matrix = np.column_stack([columns[i][sliding] for i in used])
    known = recording.force_sum[sliding] - (slope[sliding] * mass if mass is not None else 0.0)
    size = np.linalg.norm(matrix, axis=0)
    if not size.all() or np.linalg.matrix_rank(matrix / size, tol=1e-6) < len(used):
        raise ValueError('friction, acceleration and offset cannot be told apart in it: record several speeds')
    found, *_ = np.linalg.lstsq(matrix, known, rcond=None)
    left = known - matrix @ found
    variance = float(left @ left) / (count - len(used)) * np.linalg.inv(matrix.T @ matrix)[0, 0]
    values = dict(zip(used, (float(value) for value in found), strict=True))
    moved = values[1] if mass is None else mass
    offset = values.get(2, 0.0)
    friction = recording.force_sum - moved * slope - offset
    return Law(values[0], math.sqrt(variance), moved, mass is None, offset, friction, sliding)


def near_reversals(time: FloatArray, reference_velocity: FloatArray) -> BoolArray:
    """Samples near a reversal of the reference, see `NEAR_REVERSAL`.

    Args:
        time: [s], shape (n,).
        reference_velocity: [m/s], shape (n,).

    Raises:
        ValueError: The reference reverses less than twice.
    """
    moving = np.flatnonzero(np.nan_to_num(reference_velocity))
    turned = np.flatnonzero(np.diff(np.sign(reference_velocity[moving])))
    moments = 0.5 * (time[moving[turned]] + time[moving[turned + 1]])
    if len(moments) < 2:
        raise ValueError(f'the reference reverses {len(moments)} times: record a motion to and fro')
    reach = NEAR_REVERSAL * float(np.median(np.diff(moments)))
    after = np.clip(np.searchsorted(moments, time), 1, len(moments) - 1)
    distance = np.minimum(np.abs(time - moments[after - 1]), np.abs(time - moments[after]))
    return np.asarray(distance <= reach)


def feedforward_force(settings: FeedForwardSettings, recording: Recording, friction_error: float = 0.0) -> FloatArray:
    """Force that the feed-forward would have commanded [N], shape (n,), with a model wrong by a share of it."""
    state, factor = feedforward.init(settings), 1.0 + friction_error
    forces = []
    for estimate, motion in zip(recording.estimates, recording.motions, strict=True):
        wrong = estimate._replace(
            coulomb_friction=factor * estimate.coulomb_friction, breakaway_force=factor * estimate.breakaway_force
        )
        state, out = feedforward.step(settings, state, estimate.stamp, wrong, motion)
        forces.append(out.force)
    return np.array(forces)


def delayed(time: FloatArray, force: FloatArray, delay: float) -> FloatArray:
    """What acts ``delay`` [s] after it was commanded; nothing before the first command. Shapes (n,)."""
    return np.interp(time - delay, time, force, left=0.0)


def residual(law: Law, reversal: BoolArray, force: FloatArray) -> Residual:
    """Friction that ``force`` [N], shape (n,), leaves."""
    left = law.friction - force
    return Residual(_rms(left[law.sliding]), _rms(left[law.sliding & reversal]))


def match(recording: Recording, settings: FeedForwardSettings, known: MatchSettings) -> Match:
    """Parameters of the feed-forward from what an axis did.

    Args:
        recording: What it did.
        settings: Settings of the feed-forward until now: what the recording does not tell stays as it is.
        known: What else is known, and how wrong model and delay may be.

    Raises:
        ValueError: The recording has not what is needed; one line that says what to record.
    """
    time = recording.time
    reversal = near_reversals(time, recording.reference_velocity)
    law = fit_law(recording, known.mass or None)
    told = {
        'coulomb_scale': law.scale > 0.0 and law.scale_std <= TOLD * law.scale,
        'lead_time': known.whole_delay > 0.0,
    }
    if told['coulomb_scale']:
        settings = replace(settings, coulomb_scale=bounded('coulomb_scale', round(law.scale, 2)))
    if told['lead_time']:
        settings = replace(settings, lead_time=known.whole_delay)
    smoothing = _smoothing(recording, law)
    slew = None
    if smoothing is not None:
        settings = replace(settings, smoothing_velocity=bounded('smoothing_velocity', smoothing))
        slew = _slew(recording, settings)
    if slew is not None:
        settings = replace(settings, slew_limit=bounded('slew_limit', slew))
    told |= {'smoothing_velocity': smoothing is not None, 'slew_limit': slew is not None}

    cases = []
    late = settings.lead_time
    for friction in dict.fromkeys((-known.friction_error, 0.0, known.friction_error)):
        force = feedforward_force(settings, recording, friction)
        for lateness in dict.fromkeys((-known.delay_error, 0.0, known.delay_error)):
            left = residual(law, reversal, delayed(time, force, (1.0 + lateness) * late))
            cases.append(MatchCase(friction, lateness, left))
    acting = delayed(time, feedforward_force(settings, recording), late)
    without = residual(law, reversal, np.zeros(len(time)))
    return Match(settings, told, law, reversal, without, tuple(cases), acting)


def _smoothing(recording: Recording, law: Law) -> float | None:
    """Widest smoothing that is nearly as good as the best [m/s]; None if any is: the rod was never slow."""
    velocity = recording.velocity[law.sliding]
    friction = law.friction[law.sliding]
    coulomb = law.scale * recording.coulomb_friction[law.sliding]
    fastest = max(float(np.abs(velocity).max()), SHARPEST_SMOOTHING)
    widths = [preferred(i) for i in range(nearest_preferred(SHARPEST_SMOOTHING), nearest_preferred(fastest) + 1)]
    left = [_rms(friction - coulomb * np.tanh(velocity / width)) for width in widths]
    most = math.hypot(min(left), NEARLY * _rms(friction))
    widest = max(width for width, value in zip(widths, left, strict=True) if value <= most)
    return widest if widest < widths[-1] else None


def _slew(recording: Recording, settings: FeedForwardSettings) -> float | None:
    """Lowest slew limit with which the force along the reference is nearly the same [N/s]; None if there is none."""
    highest = bounded('slew_limit', math.inf)
    free = feedforward_force(replace(settings, slew_limit=highest), recording)
    steps = np.diff(recording.time)
    rates = np.abs(np.diff(free))[steps > 0.0] / steps[steps > 0.0]
    if not rates.size or not rates.max() > 0.0:
        return None
    index = nearest_preferred(float(rates.max())) + 1
    while True:
        limited = replace(settings, slew_limit=bounded('slew_limit', preferred(index - 1)))
        if _rms(feedforward_force(limited, recording) - free) > NEARLY * _rms(free):
            return preferred(index)
        index -= 1


def _rms(values: FloatArray) -> float:
    return math.sqrt(float(np.mean(values**2))) if len(values) else 0.0
