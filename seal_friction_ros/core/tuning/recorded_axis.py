r"""Feed-forward that matches the friction of a recorded axis.

.. math:: F_S - m a - F_0 = s f_c\,\mathrm{sgn}(v)

The left side is the friction: force sum less inertia, less a constant offset of the force sum. While the rod slides,
least squares give s, m and F_0 from force sum, acceleration and the Coulomb friction f_c of the estimator. s is the
scale of the feed-forward; it includes the error of the model.

The smoothing is the widest with which the law, along the motion of the rod, is nearly as good as with the best
smoothing. The slew limit is the lowest with which the force along the recorded reference is nearly the same. Along the
reference the smoothing would be much too wide, since a rod without compensation reverses late. A recording does not
show the delay from command to force. The force limit is `FORCE_MARGIN` times the largest friction: that of the law, or
of the sliding samples but for the largest `NOISE_SHARE`, whichever is larger. All of it is our choice.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation import feedforward
from seal_friction_ros.core.estimation.feedforward import FADED_IN, UNUSABLE, FeedForwardSettings, wanted_velocity
from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.identification.admission import AT_REST, BAD_INPUT, NOT_FINITE, Account, account
from seal_friction_ros.core.messages.records import NO_ESTIMATE, Status
from seal_friction_ros.core.tuning.settings import RecordedAxisSettings, RobustnessCase, TunedFeedForward
from seal_friction_ros.core.tuning.simulated_axis import bounded, force_limit, nearest_preferred, preferred

ACCELERATION_WINDOW = 11  # samples of the parabola whose slope is the acceleration
MOST_UNEVEN = 0.5  # of the median period: a sample with a larger deviation has no acceleration
SLOW = 0.1  # [-] of the largest speed; above, a doubt about the motion is one about the friction, which the fit finds
FEWEST_SLIDING = 100  # samples of a fit
BOTH_DIRECTIONS = 0.1  # smallest share of the sliding samples in each direction, to separate offset and friction
NEAR_REVERSAL = 0.1  # of the time between two reversals of the reference, before and after each
NEARLY = 0.05  # of the friction: a smaller RMS difference counts as none
IDENTIFIED = 0.05  # largest relative standard deviation of an identified parameter
SHARPEST_SMOOTHING = 1e-5  # [m/s]
SLOW_SHARE = 0.01  # of the sliding samples: so many must be slower than an identified smoothing
NOISE_SHARE = 0.01  # of the sliding samples: larger frictions count as noise


class Recording(NamedTuple):
    """Recorded motion of an axis: arrays of shape (n,), one entry per velocity sample."""

    stamps: IntArray  # [ns]
    state: IntArray  # of the estimate, as the next two
    status: IntArray
    coulomb_friction: FloatArray  # [N]
    velocity: FloatArray  # [m/s] of the rod
    force_sum: FloatArray  # [N]
    reference_velocity: FloatArray  # [m/s] conditioned, as in `pipeline`
    reference_acceleration: FloatArray  # [m/s^2]
    reference_age: FloatArray  # [s]
    dropped: Mapping[str, int] = {}  # reason -> number of samples that are not in it

    @property
    def time(self) -> FloatArray:
        """Time since the first sample [s], shape (n,)."""
        return np.asarray((self.stamps - self.stamps[0]) * 1e-9)


class RecordedLaw(NamedTuple):
    """Friction law of a recorded axis."""

    scale: float  # [-] s
    scale_std: float  # [-]
    mass: float  # [kg] m
    mass_is_fitted: bool
    offset: float  # [N] F_0; 0 where the rod moves in one direction only
    friction: FloatArray  # [N] force sum less inertia less offset; NaN where it is unknown
    sliding: BoolArray  # samples of the fit
    samples: Account  # of the recording


class Residual(NamedTuple):
    """RMS friction [N] that remains for the controller while the rod slides; at rest friction is the applied force."""

    sliding: float  # all sliding samples
    reversal: float  # sliding samples near a reversal of the reference; 0 where there are none

    def better_than(self, other: 'Residual') -> bool:
        """Whether less friction remains while the rod slides."""
        return self.sliding < other.sliding


@dataclass(frozen=True)
class RecordedTuning(TunedFeedForward[Residual]):
    """Feed-forward of a recorded axis."""

    identified: dict[str, bool]  # parameter -> whether the recording identifies it; otherwise it is unchanged
    law: RecordedLaw
    reversal: BoolArray  # samples near a reversal of the reference
    force: FloatArray  # [N] of the feed-forward after its delay, in the nominal case


def acceleration(time: FloatArray, velocity: FloatArray) -> FloatArray:
    """Slope of the parabola through `ACCELERATION_WINDOW` samples [m/s^2]; NaN where they are uneven in time.

    Time [s] and velocity [m/s] have the shape (n,), as the slope.
    """
    from scipy.signal import savgol_filter  # noqa: PLC0415  half a second, for bags only

    half = ACCELERATION_WINDOW // 2
    slope = np.full(len(time), math.nan)
    if len(time) <= 2 * half:
        return slope
    steps = np.diff(time)
    period = float(np.median(steps))
    if period <= 0.0:
        return slope
    # A value that is not finite makes its whole window not finite.
    slope[half:-half] = savgol_filter(velocity, ACCELERATION_WINDOW, 2, deriv=1, delta=period)[half:-half]
    rounding = 1e-9 * np.abs(velocity[np.isfinite(velocity)]).max(initial=0.0) / period
    slope[np.abs(slope) < rounding] = 0.0  # a steady velocity has none on any computer
    for place in np.flatnonzero(~(np.abs(steps - period) <= MOST_UNEVEN * period)):
        slope[max(place + 1 - half, 0) : place + 1 + half] = math.nan
    return slope


def fit_law(recording: Recording, mass: float | None = None) -> RecordedLaw:
    """Scale, mass (unless it is known [kg]) and offset by least squares over the sliding samples.

    ValueError: the rod slides too little, or with too little variety to separate the terms.
    """
    velocity, state, status = recording.velocity, recording.state, recording.status
    slope = acceleration(recording.time, velocity)
    speed = np.abs(velocity)
    slow = speed < SLOW * np.max(speed[np.isfinite(speed)], initial=0.0)
    reasons = {
        NOT_FINITE: ~np.isfinite(velocity) | ~np.isfinite(recording.force_sum),
        BAD_INPUT: status & UNUSABLE != 0,
        AT_REST: state != FrictionState.SLIDING,
        'rest or motion': slow & (status & int(Status.MOTION_UNCERTAIN) != 0),
        'uneven in time': ~np.isfinite(slope),
    }
    sliding = ~np.logical_or.reduce(list(reasons.values()))
    count = int(np.count_nonzero(sliding))
    if count < FEWEST_SLIDING:
        few = f'the rod slides in {count} usable samples, the friction needs {FEWEST_SLIDING}'
        raise ValueError(f'{few}: record a motion to and fro')
    forward = np.count_nonzero(velocity[sliding] > 0.0) / count
    both = BOTH_DIRECTIONS <= forward <= 1.0 - BOTH_DIRECTIONS
    columns = [recording.coulomb_friction * np.sign(velocity), slope, np.ones(len(velocity))]
    used = [0] + ([1] if mass is None else []) + ([2] if both else [])
    matrix = np.column_stack([columns[i][sliding] for i in used])
    without_inertia = recording.force_sum[sliding] - (slope[sliding] * mass if mass is not None else 0.0)
    size = np.linalg.norm(matrix, axis=0)
    if not size.all() or np.linalg.matrix_rank(matrix / size, tol=1e-6) < len(used):
        raise ValueError('friction, acceleration and offset cannot be separated: record several speeds')
    found, *_ = np.linalg.lstsq(matrix, without_inertia, rcond=None)
    left = without_inertia - matrix @ found
    variance = float(left @ left) / (count - len(used)) * np.linalg.inv(matrix.T @ matrix)[0, 0]
    values = dict(zip(used, (float(value) for value in found), strict=True))
    moved = values[1] if mass is None else mass
    offset = values.get(2, 0.0)
    friction = recording.force_sum - moved * slope - offset
    samples = account('', reasons, recording.dropped)
    return RecordedLaw(values[0], math.sqrt(variance), moved, mass is None, offset, friction, sliding, samples)


def near_reversals(time: FloatArray, reference_velocity: FloatArray) -> BoolArray:
    """Samples near a reversal of the reference, see `NEAR_REVERSAL`, by time [s] and velocity [m/s]; all of shape (n,).

    ValueError: the reference reverses less than twice.
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
    """Feed-forward force along a recording [N], shape (n,), with a relative error of the friction model."""
    grounds = list(zip(recording.status.tolist(), recording.state.tolist(), strict=True))
    estimates = {one: NO_ESTIMATE._replace(status=one[0], state=one[1]) for one in set(grounds)}
    is_usable = {one: feedforward.usable(settings, estimate) for one, estimate in estimates.items()}
    columns = recording.stamps, recording.coulomb_friction, recording.velocity
    references = recording.reference_velocity, recording.reference_acceleration, recording.reference_age
    state, forces = FADED_IN, []
    samples = zip(grounds, *(column.tolist() for column in (*columns, *references)), strict=True)
    for ground, stamp, coulomb, measured, *motion, age in samples:
        friction = (1.0 + friction_error) * coulomb if is_usable[ground] else -1.0
        velocity = measured
        if not settings.use_measured_velocity:
            velocity = math.nan if abs(age) > settings.reference_timeout else wanted_velocity(settings, *motion)
        state, out = feedforward.step(settings, state, stamp, stamp, friction, velocity)
        forces.append(out.force)
    return np.array(forces)


def delayed(time: FloatArray, force: FloatArray, delay: float) -> FloatArray:
    """Force that acts ``delay`` [s] after its command; 0 before the first command. Shapes (n,)."""
    return np.interp(time - delay, time, force, left=0.0)


def residual(law: RecordedLaw, reversal: BoolArray, force: FloatArray) -> Residual:
    """Friction that remains with a feed-forward of ``force`` [N], shape (n,)."""
    left = law.friction - force
    return Residual(_rms(left[law.sliding]), _rms(left[law.sliding & reversal]))


def tune_recorded_axis(
    recording: Recording, settings: FeedForwardSettings, axis: RecordedAxisSettings
) -> RecordedTuning:
    """Parameters of the feed-forward from a recording, and what is known of its axis, with errors of model and delay.

    Of the ``settings``, those that the recording does not identify are unchanged. ValueError: the recording lacks
    something; the message says what to record.
    """
    time = recording.time
    reversal = near_reversals(time, recording.reference_velocity)
    law = fit_law(recording, axis.mass or None)
    largest = largest_friction(recording, law)
    identified: dict[str, float | None] = {
        'force_limit': force_limit(largest),
        'scale': round(law.scale, 2) if law.scale > 0.0 and law.scale_std <= IDENTIFIED * law.scale else None,
        'lead_time': axis.whole_delay or None,
        'smoothing_velocity': _smoothing(recording, law),
    }
    settings = _with_values(settings, identified)
    identified['slew_limit'] = None if identified['smoothing_velocity'] is None else _slew(recording, settings)
    settings = _with_values(settings, identified)

    cases, late = [], settings.lead_time
    for friction in dict.fromkeys((-axis.friction_error, 0.0, axis.friction_error)):
        force = feedforward_force(settings, recording, friction)
        for lateness in dict.fromkeys((-axis.delay_error, 0.0, axis.delay_error)):
            left = residual(law, reversal, delayed(time, force, (1.0 + lateness) * late))
            cases.append(RobustnessCase(friction, lateness, left))
    acting = delayed(time, feedforward_force(settings, recording), late)
    without = residual(law, reversal, np.zeros(len(time)))
    is_identified = {name: value is not None for name, value in identified.items()}
    return RecordedTuning(settings, without, tuple(cases), largest, is_identified, law, reversal, acting)


def largest_friction(recording: Recording, law: RecordedLaw) -> float:
    """Largest friction of a recorded axis [N], see `NOISE_SHARE`."""
    measured = float(np.quantile(np.abs(law.friction[law.sliding]), 1.0 - NOISE_SHARE))
    return max(measured, law.scale * float(recording.coulomb_friction[law.sliding].max()))


def _with_values(settings: FeedForwardSettings, values: dict[str, float | None]) -> FeedForwardSettings:
    """Settings with the identified values, clamped to their bounds."""
    known: dict[str, Any] = {name: bounded(name, value) for name, value in values.items() if value is not None}
    return replace(settings, **known)


def _smoothing(recording: Recording, law: RecordedLaw) -> float | None:
    """Widest smoothing that is nearly as good as the best [m/s]; None if the rod was never as slow as that."""
    velocity = recording.velocity[law.sliding]
    friction = law.friction[law.sliding]
    coulomb = law.scale * recording.coulomb_friction[law.sliding]
    fastest = max(float(np.abs(velocity).max()), SHARPEST_SMOOTHING)
    widths = [preferred(i) for i in range(nearest_preferred(SHARPEST_SMOOTHING), nearest_preferred(fastest) + 1)]
    left = [_rms(friction - coulomb * np.tanh(velocity / width)) for width in widths]
    most = math.hypot(min(left), NEARLY * _rms(friction))
    widest = max(width for width, value in zip(widths, left, strict=True) if value <= most)
    slow = float(np.quantile(np.abs(velocity), SLOW_SHARE))
    return widest if slow < widest < widths[-1] else None


def _slew(recording: Recording, settings: FeedForwardSettings) -> float | None:
    """Lowest slew limit with nearly the same force along the reference [N/s]; None if the force never changes."""
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
