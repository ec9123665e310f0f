r"""Estimate and reference velocity -> the force that cancels the seal friction before the controller has to.

``state = init(settings)``, then ``state, feedforward = step(settings, state, stamp, estimate, motion)``.

.. math::
    F = \tanh(v / w)\,[s_C f_c + s_S (f_b - f_c)\, e^{-|v / v_S|^\delta} + s_V f_v] + s_V \sigma v

with v the reference velocity, seen ``lead_time`` ahead, and f_v what the seals add at it by the velocity terms of their
seal files (viscous, Stribeck, direction). It comes from the reference and not from the rod, so it closes
no loop: too large a force makes an error, but no limit cycle. Scales below 1 leave some friction to the controller,
which a wrong model needs. tanh is smooth through zero here, where it shapes a command; the friction itself
is never smoothed.

Source: [Armstrong1994]_ (feed-forward from the desired velocity) and eq. (5) (Stribeck); fade, slew and
clamp are our choice.
"""

import math
from dataclasses import dataclass
from enum import IntFlag
from typing import NamedTuple

from seal_friction_ros.core.estimation.records import NEVER, NO_ESTIMATE, FrictionEstimate, Status
from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.friction.states import UNKNOWN

FASTEST = 100.0  # [m/s] no rod is faster
LONGEST_STEP = 0.02  # [s] after a longer gap, or a stamp that leaps, fade and slew go on as if this time had passed


class Limited(IntFlag):
    """What limited the force; 0 means nothing. The meanings are written in FrictionFeedForward.msg."""

    SLEW = 1
    CLAMP = 2
    FADE = 4


_SLEW, _CLAMP, _FADE = int(Limited.SLEW), int(Limited.CLAMP), int(Limited.FADE)

UNUSABLE = int(
    Status.PRESSURE_MISSING
    | Status.PRESSURE_STALE
    | Status.PRESSURE_NOT_FINITE
    | Status.PRESSURE_OUT_OF_RANGE
    | Status.PRESSURE_LEAP
    | Status.INPUT_REFUSED
)
"""Status bits that take the Coulomb friction its ground. A bad force or velocity does not, see `usable`."""


@dataclass(frozen=True)
class FeedForwardSettings:
    """Settings of the feed-forward, one field per ROS parameter.

    Raises:
        ValueError: A setting is out of bounds.
    """

    coulomb_scale: float = parameter(
        0.9, unit='1', lower=0.0, upper=2.0, description='s_C, share of the Coulomb friction that is compensated.'
    )
    stribeck_scale: float = parameter(
        0.0, unit='1', lower=0.0, upper=2.0, description='s_S, share of what breakaway has above Coulomb friction.'
    )
    stribeck_velocity: float = parameter(
        0.005, unit='m/s', lower=1e-6, upper=10.0, description='v_S, speed over which breakaway falls to Coulomb.'
    )
    stribeck_exponent: float = parameter(2.0, unit='1', lower=0.1, upper=10.0, description='delta.')
    viscous_scale: float = parameter(
        0.9, unit='1', lower=0.0, upper=2.0, description='s_V, share of the viscous friction that is compensated.'
    )
    viscous_friction: float = parameter(
        0.0, unit='N s/m', lower=0.0, upper=1e7, description='sigma, viscous friction of all seals; 0: they have none.'
    )
    smoothing_velocity: float = parameter(
        0.001, unit='m/s', lower=1e-6, upper=1.0, description='w, speed at which 76 % of the Coulomb term is there.'
    )
    lead_time: float = parameter(
        0.003,
        unit='s',
        lower=0.0,
        upper=0.5,
        description='How far ahead the velocity is seen; the delay of the force loop.',
    )
    use_measured_velocity: bool = parameter(
        False, unit='', description='From the rod instead of the reference; closes a loop, so it can limit-cycle.'
    )
    slew_limit: float = parameter(5e4, unit='N/s', lower=1e-3, upper=1e9, description='Largest rate of the force.')
    force_limit: float = parameter(150.0, unit='N', lower=0.0, upper=1e6, description='Largest force.')
    estimate_timeout: float = parameter(
        0.1, unit='s', lower=1e-4, upper=60.0, description='An estimate older than this is not used.'
    )
    reference_timeout: float = parameter(
        0.1, unit='s', lower=1e-4, upper=60.0, description='A reference older than this is not used.'
    )
    fade_time: float = parameter(
        0.2,
        unit='s',
        lower=1e-4,
        upper=60.0,
        description='Time to fade out without a usable estimate or reference, and back in.',
    )

    def __post_init__(self) -> None:
        check(self)


class Motion(NamedTuple):
    """The motion that is asked for, and the one that is."""

    reference_velocity: float  # [m/s]
    reference_acceleration: float = 0.0  # [m/s^2] for ``lead_time``; 0 if it is not known
    measured_velocity: float = 0.0  # [m/s]
    reference_age: float = 0.0  # [s] how long ago the reference was for
    velocity_friction: float = 0.0  # [N] f_v, at `wanted_velocity`


class FeedForwardState(NamedTuple):
    """What one step leaves for the next."""

    stamp: int  # [ns] of the last step; `NEVER` before the first
    force: float  # [N]
    fade: float  # [-] 0: faded out, 1: not faded
    estimate: FrictionEstimate  # last usable estimate; `NO_ESTIMATE` before the first
    velocity: float  # [m/s] last usable velocity


class FeedForward(NamedTuple):
    """Compensation at one moment. Every number is finite, whatever came in."""

    stamp: int  # [ns]
    force: float  # [N] positive on extension
    scale: float  # [-] share of the estimated Coulomb friction that is compensated
    limited: int  # bits of `Limited`


def init(settings: FeedForwardSettings) -> FeedForwardState:
    """Before the first estimate: faded out."""
    del settings
    return FeedForwardState(NEVER, 0.0, 0.0, NO_ESTIMATE, 0.0)


@compilable
def usable(settings: FeedForwardSettings, estimate: FrictionEstimate) -> bool:
    """Whether the Coulomb friction of an estimate stands on a good pressure.

    The state of the rod counts only with ``use_measured_velocity``; else the direction comes from the reference.
    """
    if estimate.status & UNUSABLE:
        return False
    return not settings.use_measured_velocity or estimate.state != UNKNOWN


@compilable
def compensation(
    settings: FeedForwardSettings, estimate: FrictionEstimate, velocity: float, velocity_friction: float = 0.0
) -> float:
    """Force [N] for a velocity [m/s] and f_v [N], before fade and limits: the equation at the head of this file."""
    stribeck = math.exp(-(abs(velocity / settings.stribeck_velocity) ** settings.stribeck_exponent))
    stiction = estimate.breakaway_force - estimate.coulomb_friction
    coulomb = settings.coulomb_scale * estimate.coulomb_friction + settings.stribeck_scale * stiction * stribeck
    coulomb += settings.viscous_scale * velocity_friction
    viscous = settings.viscous_scale * settings.viscous_friction * velocity
    return math.tanh(velocity / settings.smoothing_velocity) * coulomb + viscous


@compilable
def step(
    settings: FeedForwardSettings,
    state: FeedForwardState,
    stamp: int,
    estimate: FrictionEstimate,
    motion: Motion,
) -> tuple[FeedForwardState, FeedForward]:
    """Feed-forward at one moment.

    Without a usable estimate and a usable velocity the last usable ones are faded out over ``fade_time``; with them the
    force fades in again. Fade, then clamp, then slew: so the rate is bounded whatever happens.

    Args:
        settings: Settings.
        state: From `init` or the step before.
        stamp: Now [ns].
        estimate: Newest estimate; `NO_ESTIMATE` while there is none.
        motion: Reference and measured motion. A velocity that is not finite is not usable.
    """
    elapsed = 0.0 if state.stamp == NEVER else _between(0.0, (stamp - state.stamp) * 1e-9, LONGEST_STEP)
    good, valid = state.estimate, False
    if estimate.stamp != NEVER and usable(settings, estimate):
        good = estimate
        valid = abs(stamp - estimate.stamp) * 1e-9 <= settings.estimate_timeout
    velocity = wanted_velocity(settings, motion)
    if math.isnan(velocity):
        velocity, valid = state.velocity, False
    change = elapsed / settings.fade_time
    first = valid and state.estimate.stamp == NEVER and state.stamp == NEVER
    fade = 1.0 if first else _between(0.0, state.fade + (change if valid else -change), 1.0)

    limited = _FADE if fade < 1.0 or not valid else 0
    wanted = 0.0 if good.stamp == NEVER else fade * compensation(settings, good, velocity, motion.velocity_friction)
    clamped = _between(-settings.force_limit, wanted, settings.force_limit)
    if clamped != wanted:
        limited |= _CLAMP
    most = settings.slew_limit * elapsed
    force = _between(state.force - most, clamped, state.force + most)
    if force != clamped:
        limited |= _SLEW
    feedforward = FeedForward(stamp, force, settings.coulomb_scale * fade, limited)
    return FeedForwardState(stamp, force, fade, good, velocity), feedforward


@compilable
def wanted_velocity(settings: FeedForwardSettings, motion: Motion) -> float:
    """Velocity v [m/s] of the equation; NaN if it is not usable."""
    if settings.use_measured_velocity:
        velocity = motion.measured_velocity
    elif abs(motion.reference_age) > settings.reference_timeout:
        return math.nan
    else:
        velocity = motion.reference_velocity + settings.lead_time * motion.reference_acceleration
    return _between(-FASTEST, velocity, FASTEST) if math.isfinite(velocity) else math.nan


@compilable
def _between(lowest: float, value: float, highest: float) -> float:
    if value < lowest:
        return lowest
    return highest if value > highest else value
