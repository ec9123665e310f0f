"""Velocity of a quantised or noisy signal, without reversals that the motion has not.

``state = condition_velocity(state, stamp, velocity, resolution)`` for every sample; ``state.velocity`` is the result.

An encoder at rest makes velocities of one count a sample, to and fro. Their sum, the displacement, stays within a few
counts. So the displacement passes through a play (a backlash) of half-width h, and only displacement that pushes the
play counts as motion: the direction changes after a way back of 2 h, and at rest nothing moves.

The half-width is learnt: a velocity that goes up and at once down again, at a low speed, is a ripple; h is the
largest ripple so far that came twice, times the sample period, forgotten with `MEMORY`. Reversals after ways of only
a few h widen it by half, up to a few ripples: beyond that they are a rod that swings. A clean signal has no ripple: h
is 0 and the velocity comes out unchanged, without delay.

The speed is the way of a push over the time since the last push (the period method of encoders), smoothed over 10 h /
|v|, at most `LONGEST_SMOOTHING`; a way of more than 2 h counts over its own sample. While nothing pushes, the speed
is at most 2 h over the time since the last push.

Source: play operator, [Visintin1994]_; learning and all numbers are our choice.
"""

from typing import NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.messages.records import NEVER

LONGEST_STEP = 0.02  # [s] a longer time between two samples counts as this one
LONGEST_SMOOTHING = 0.02  # [s]
LONGEST_WAIT = 0.2  # [s] a signal that has not pushed for this time, or takes it for h, is at rest
MEMORY = 60.0  # [s] time constant with which a learnt half-width is forgotten
SLOW_RIPPLE = 4.0  # [-] a ripple counts at speeds up to this multiple of it; a sharp peak of a fast motion is none
SETTLING = 100  # samples, or [ms] if that is sooner, after which the ripple of a signal is known
WIDEST = 4.0  # [-] half-width over the last ripple from which on reversals widen it no more: they are a motion
SHORT_WAY = 8.0  # [-] a reversal after a way of less than this multiple of h widens the play


class ConditionedVelocity(NamedTuple):
    """Result and memory of `condition_velocity`."""

    stamp: int  # [ns] of the last sample; `NEVER` before the first
    velocity: float  # [m/s] the result
    half_width: float  # [m] h; 0.0 for a clean signal
    ripple: float  # [m/s] of the velocity as it was given, in one sample; 0.0 for a clean signal
    smoothing: float  # [s] time constant with which the velocity was smoothed
    is_waiting: bool  # whether no push has come for the speed: the signal slows down or is at rest
    last_velocity: float  # [m/s] of the last sample, as given
    last_change: float  # [m/s] last change of the given velocity
    last_ripple: float  # [m] last half-width that a ripple asked for
    slack: float  # [m] place in the play, between -h and h
    last_push: int  # [ns] stamp of the last push
    way: float  # [m] pushed since the last reversal, with its sign
    samples: int  # number of samples, or of [ms] if larger, counted up to `SETTLING`


NOT_CONDITIONED = ConditionedVelocity(NEVER, 0.0, 0.0, 0.0, 0.0, False, 0.0, 0.0, 0.0, 0.0, NEVER, 0.0, 0)


@compilable
def condition_velocity(
    state: ConditionedVelocity, stamp: int, velocity: float, resolution: float
) -> ConditionedVelocity:
    """Condition one sample.

    Args:
        state: `NOT_CONDITIONED` or the result before.
        stamp: Of the sample [ns]. With a ripple, a repeated stamp is no new sample.
        velocity: Finite [m/s].
        resolution: Smallest ripple to assume [m/s], 0: what is learnt.
    """
    last_stamp, last, samples = state.stamp, state.velocity, state.samples
    if last_stamp == NEVER:
        return _clean(stamp, velocity, 0.0, 0.0, max(samples, 1))
    if stamp == last_stamp:
        return (
            state if state.half_width > 0.0 else _clean(stamp, velocity, state.last_change, state.last_ripple, samples)
        )
    step = (stamp - last_stamp) * 1e-9
    if not 0.0 < step <= LONGEST_STEP:  # a gap, or a clock that was set back: samples count from now on
        step = LONGEST_STEP
    if samples < SETTLING:
        samples = min(samples + max(int(step * 1e3 + 0.5), 1), SETTLING)
    last_velocity, last_change = state.last_velocity, state.last_change
    change = velocity - last_velocity
    forgotten = 1.0 - step / MEMORY
    half_width, ripple = forgotten * state.half_width, forgotten * state.last_ripple
    if change * last_change < 0.0 and _larger(velocity, last_velocity) <= SLOW_RIPPLE * _smaller(change, last_change):
        asked = step * _smaller(change, last_change)
        half_width = max(half_width, _smaller(asked, ripple))
        ripple = asked
    if resolution > 0.0:
        half_width = max(half_width, resolution * step)
    if half_width == 0.0:
        return _clean(stamp, velocity, change, ripple, samples)
    slack = state.slack + velocity * step
    push = slack - between(-half_width, slack, half_width)
    smoothing = LONGEST_SMOOTHING
    if 10.0 * half_width < abs(last) * LONGEST_SMOOTHING:
        smoothing = 10.0 * half_width / abs(last)
    turns = push * state.way < 0.0
    if turns and abs(state.way) < SHORT_WAY * half_width and half_width < WIDEST * max(ripple, resolution * step):
        half_width = 1.5 * half_width
    result = _speed(state, stamp, push, half_width, smoothing, step)
    is_waiting = push == 0.0 and (result != last or state.half_width == 0.0)
    last_push, way = stamp if push != 0.0 else state.last_push, push if turns else state.way + push
    return ConditionedVelocity(
        stamp, result, half_width, half_width / step, smoothing, is_waiting, velocity, change, ripple, slack - push,
        last_push, way, samples,
    )  # fmt: skip


@compilable
def confirmed_velocity(state: ConditionedVelocity) -> float:
    """The velocity [m/s] to act on: 0.0 until two samples agree on a direction, as the ripple may not be known yet."""
    if state.samples < SETTLING:
        return 0.0
    is_new = state.half_width == 0.0 and state.velocity * (state.last_velocity - state.last_change) <= 0.0
    return 0.0 if is_new else state.velocity


@compilable
def _speed(
    state: ConditionedVelocity, stamp: int, push: float, half_width: float, smoothing: float, step: float
) -> float:
    """Velocity [m/s] after a push [m], which is 0.0 within the play."""
    last = state.velocity
    pause = max((stamp - state.last_push) * 1e-9, step)
    if push == 0.0:
        fastest = 2.0 * half_width / pause if pause < LONGEST_WAIT else 0.0
        if abs(last) <= fastest:
            return last
        return fastest if last > 0.0 else -fastest
    before = 0.0 if push * state.way < 0.0 else last
    if abs(push) > 2.0 * half_width:
        pause = step
    speed = before + (push / pause - before) * pause / (pause + smoothing)
    return speed if abs(speed) > half_width / LONGEST_WAIT else 0.0


@compilable
def _clean(stamp: int, velocity: float, change: float, ripple: float, samples: int) -> ConditionedVelocity:
    """A sample of a signal without ripple: the velocity as it is."""
    half_width = given_ripple = smoothing = slack = way = 0.0
    return ConditionedVelocity(
        stamp,
        velocity,
        half_width,
        given_ripple,
        smoothing,
        False,
        velocity,
        change,
        ripple,
        slack,
        stamp,
        way,
        samples,
    )


@compilable
def _smaller(a: float, b: float) -> float:
    """The smaller magnitude."""
    return abs(a) if abs(a) < abs(b) else abs(b)


@compilable
def _larger(a: float, b: float) -> float:
    """The larger magnitude."""
    return abs(a) if abs(a) > abs(b) else abs(b)
