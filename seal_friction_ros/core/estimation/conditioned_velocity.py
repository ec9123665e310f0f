"""Velocity of a quantised or noisy signal, without reversals that the motion has not.

``state = condition_velocity(state, stamp, velocity, resolution)`` for every sample; ``state.velocity`` is the result.

An encoder at rest makes velocities of one count a sample, to and fro. Their sum, the displacement, stays within a few
counts. So the displacement passes through a play (a backlash) of half-width h, and only displacement that pushes the play
counts as motion: the direction changes after a way back of 2 h, and at rest nothing moves.

The half-width is learnt: a velocity that goes up and at once down again, at a low speed, is a ripple; h is the largest
ripple times the sample period so far, forgotten with `MEMORY`. Reversals after ways of only a few h widen it by half. A
clean signal has no ripple: h is 0 and the velocity comes out unchanged, without delay.

The speed is the way of a push over the time since the last push (the period method of encoders), smoothed over
``10 h / |v|``, at most `LONGEST_SMOOTHING`; a way of more than 2 h counts over its own sample. While nothing pushes, the speed
is at most 2 h over the time since the last push.

Source: play operator, [Visintin1994]_; learning and all numbers are our choice.
"""

from typing import NamedTuple

from seal_friction_ros.core.estimation.records import NEVER
from seal_friction_ros.core.foundation.compiled import compilable

LONGEST_STEP = 0.02  # [s] a longer time between two samples counts as this one
LONGEST_SMOOTHING = 0.02  # [s]
LONGEST_WAIT = 0.2  # [s] a signal that has not pushed for this time is at rest
MEMORY = 60.0  # [s] time constant with which a learnt half-width is forgotten
SLOW_RIPPLE = 4.0  # [-] a ripple counts at speeds up to this multiple of it; a sharp peak of a fast motion is none
SETTLING = 10  # samples after which a ripple of a signal in motion is known; until then nothing may push by it
SHORT_WAY = 8.0  # [-] a reversal after a way of less than this multiple of h widens the play


class ConditionedVelocity(NamedTuple):
    """Result and memory of `condition_velocity`."""

    stamp: int
    """[ns] of the last sample; `NEVER` before the first"""
    velocity: float
    """[m/s] the result"""
    half_width: float
    """[m] h; 0.0 for a clean signal"""
    ripple: float
    """[m/s] of the velocity as it was given, in one sample; 0.0 for a clean signal"""
    smoothing: float
    """[s] time constant with which the velocity was smoothed"""
    is_waiting: bool
    """whether the speed is falling because no push has come: the signal slows down or is at rest"""
    last_velocity: float
    """[m/s] of the last sample, as given"""
    last_change: float
    """[m/s] last change of the given velocity"""
    slack: float
    """[m] place in the play, between -h and h"""
    last_push: int
    """[ns] stamp of the last push"""
    way: float
    """[m] pushed since the last reversal, with its sign"""
    samples: int
    """number of samples, counted up to `SETTLING`"""


NOT_CONDITIONED = ConditionedVelocity(NEVER, 0.0, 0.0, 0.0, 0.0, False, 0.0, 0.0, 0.0, NEVER, 0.0, 0)


@compilable
def condition_velocity(
    state: ConditionedVelocity, stamp: int, velocity: float, resolution: float
) -> ConditionedVelocity:
    """Condition one sample.

    Args:
        state: `NOT_CONDITIONED` or the result before.
        stamp: Of the sample [ns]. A repeated stamp is no new sample: the state stays.
        velocity: Finite [m/s].
        resolution: Smallest ripple to assume [m/s], 0: what is learnt.
    """
    if state.stamp == NEVER:
        return ConditionedVelocity(stamp, velocity, 0.0, 0.0, 0.0, False, velocity, 0.0, 0.0, stamp, 0.0, 1)
    if stamp == state.stamp:
        return state
    step = (stamp - state.stamp) * 1e-9
    if not 0.0 < step <= LONGEST_STEP:  # a gap, or a clock that was set back: samples count from now on
        step = LONGEST_STEP
    change = velocity - state.last_velocity
    samples = state.samples + 1 if state.samples < SETTLING else SETTLING
    half_width = _half_width(state, velocity, change, step)
    if half_width < resolution * step:
        half_width = resolution * step
    if change == 0.0:
        change = state.last_change
    if half_width == 0.0:
        return ConditionedVelocity(stamp, velocity, 0.0, 0.0, 0.0, False, velocity, change, 0.0, stamp, 0.0, samples)
    return _pushed(state, stamp, velocity, change, half_width, step, samples)


@compilable
def _half_width(state: ConditionedVelocity, velocity: float, change: float, step: float) -> float:
    """h [m] after a sample of ``step`` [s]."""
    learnt = state.half_width * (1.0 - step / MEMORY)
    if change * state.last_change < 0.0:
        ripple = _smaller(change, state.last_change)
        speed = _larger(velocity, state.last_velocity)
        if speed <= SLOW_RIPPLE * ripple and ripple * step > learnt:
            return ripple * step
    return learnt


@compilable
def _pushed(
    state: ConditionedVelocity,
    stamp: int,
    velocity: float,
    change: float,
    half_width: float,
    step: float,
    samples: int,
) -> ConditionedVelocity:
    """A sample through a play of ``half_width`` [m]."""
    slack = state.slack + velocity * step
    push = 0.0
    if slack > half_width:
        push, slack = slack - half_width, half_width
    elif slack < -half_width:
        push, slack = slack + half_width, -half_width
    pause = (stamp - state.last_push) * 1e-9
    if pause < step:
        pause = step
    result, way, speed = state.velocity, state.way, abs(state.velocity)
    smoothing = LONGEST_SMOOTHING
    if 10.0 * half_width < speed * LONGEST_SMOOTHING:
        smoothing = 10.0 * half_width / speed
    if push == 0.0:
        fastest = 2.0 * half_width / pause if pause < LONGEST_WAIT else 0.0
        is_waiting = speed > fastest
        if is_waiting:
            result = fastest if result > 0.0 else -fastest
        return ConditionedVelocity(
            stamp, result, half_width, half_width / step, smoothing, is_waiting, velocity, change, slack, state.last_push, way, samples
        )
    if push * way < 0.0:
        if abs(way) < SHORT_WAY * half_width:
            half_width = 1.5 * half_width
        result, way = 0.0, 0.0
    if abs(push) > 2.0 * half_width:
        pause = step
    result += (push / pause - result) * pause / (pause + smoothing)
    return ConditionedVelocity(
        stamp, result, half_width, half_width / step, smoothing, False, velocity, change, slack, stamp, way + push, samples
    )


@compilable
def _smaller(a: float, b: float) -> float:
    """The smaller magnitude."""
    return abs(a) if abs(a) < abs(b) else abs(b)


@compilable
def _larger(a: float, b: float) -> float:
    """The larger magnitude."""
    return abs(a) if abs(a) > abs(b) else abs(b)
