r"""Estimate and wanted velocity -> the force that cancels the seal friction before the controller has to.

From `FADED_OUT` on, ``state, feedforward = step(settings, state, stamp, received, friction, velocity)``.

.. math::
    F = s\,\max(f, 0) \tanh(v / w)

with v the wanted velocity, `wanted_velocity`, and f the friction of the seals at it: Coulomb friction, and what the
law or the velocity terms of the seal file add to it. One gain s scales everything, so F is 0 N for s = 0, and F v >=
0 for every law, gain and velocity: the force never acts against the wanted motion.

With ``presliding`` and seals whose files tell their elasticity, the friction is that of the seals after the wanted
displacement, `presliding.element_forces`, with f for the sliding friction:

.. math::
    F = s\,\max(F_f\,\mathrm{sgn}(v), 0) \tanh(v / w), \qquad F_f = \sum_i f_i, \quad \Delta x = v_l\,\Delta t

where v_l is the velocity ``lead_time`` ahead and v the present one. Just after a reversal the sheared seal still pushes
the rod, now in the direction of motion. To cancel this push, the force would have to act against the wanted motion: it
is 0 N instead until the seal resists, which leaves the push to the controller. Only ``presliding_against_motion`` lets
it act against the motion there:

.. math::
    F = s\,F_f\,|\tanh(v / w)|

The velocity comes from the reference and not from the rod, so the feed-forward closes no loop: too large a force makes
an error, but no limit cycle. A gain below 1 leaves some friction to the controller, which a wrong model needs. tanh is
smooth through zero here, where it shapes a command; the friction itself is never smoothed.

Time is the time of receipt: stamps that freeze, alternate or jump neither hold the force nor speed it up. The slew
limit holds for the force before it is faded, so the fade takes its time whatever the slew limit is.

Source: [Armstrong1994]_ (feed-forward from the desired velocity); fade, slew and clamp are our choice.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.friction.presliding import (
    NO_ELEMENTS,
    Elements,
    PreslidingNumbers,
    element_forces,
)
from seal_friction_ros.core.friction.states import UNKNOWN
from seal_friction_ros.core.messages.records import NEVER, FeedForward, FrictionEstimate, Limited, Status

FASTEST = 100.0  # [m/s] no rod is faster
LONGEST_STEP = 0.02  # [s] after a longer gap the force changes, and fades in, as if this time had passed


_SLEW, _CLAMP, _FADE = int(Limited.SLEW), int(Limited.CLAMP), int(Limited.FADE)
_STAMP_AGE = int(Status.STAMP_AGE)

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
        ValueError: A setting is out of bounds, or the force may act against a measured motion, which may oscillate.
    """

    scale: float = parameter(
        0.0, unit='1', lower=0.0, upper=2.0, description='s, share of the friction that is compensated; 0: no force.'
    )
    smoothing_velocity: float = parameter(
        0.001, unit='m/s', lower=1e-6, upper=1.0, description='w, speed at which 76 % of the force is there.'
    )
    lead_time: float = parameter(
        0.003,
        unit='s',
        lower=0.0,
        upper=0.5,
        description='How far ahead the velocity is seen; the delay of the force loop.',
    )
    presliding: bool = parameter(
        False,
        unit='',
        description='At a reversal the force follows the elasticity of the seals, where their seal files have it.',
    )
    presliding_against_motion: bool = parameter(
        False,
        unit='',
        description='With presliding: just after a reversal the force may act against the wanted motion, to cancel '
        'the push of the sheared seals.',
    )
    use_measured_velocity: bool = parameter(
        False,
        unit='',
        description='Velocity of the rod instead of that of the reference; closes a loop, so it can limit-cycle.',
    )
    slew_limit: float = parameter(5e4, unit='N/s', lower=1e-3, upper=1e9, description='Largest rate of the force.')
    force_limit: float = parameter(150.0, unit='N', lower=0.0, upper=1e6, description='Largest force.')
    estimate_timeout: float = parameter(
        0.03,
        unit='s',
        lower=1e-3,
        upper=1.0,
        description='Longest time since an input of the estimator was received; then the force fades out.',
    )
    reference_timeout: float = parameter(
        0.03, unit='s', lower=1e-3, upper=1.0, description='Longest time since the reference was received; likewise.'
    )
    lateness_max: float = parameter(
        0.03,
        unit='s',
        lower=0.0,
        upper=10.0,
        description='Longest time from the sending of an input to its use. A later input makes no force, nor one whose '
        'stamp is further from its receipt than stamp_age_max. 0: not checked.',
    )
    fade_time: float = parameter(
        0.2, unit='s', lower=1e-3, upper=1.0, description='Time in which the force fades out, and back in.'
    )

    def __post_init__(self) -> None:
        check(self)
        if self.presliding_against_motion and self.use_measured_velocity:
            raise ValueError(
                'FeedForwardSettings.presliding_against_motion = true with use_measured_velocity = true: the force '
                'would take the stiffness of the seals out of a closed loop, which may oscillate: switch one off'
            )


class FeedForwardState(NamedTuple):
    """What one step leaves for the next."""

    received: int  # [ns] time of the last step; `NEVER` before the first
    force: float  # [N] before the fade
    fade: float  # [-] 0: faded out, 1: not faded
    friction: float  # [N] f of the last usable estimate; negative before the first
    velocity: float  # [m/s] last usable wanted velocity
    elements: Elements = NO_ELEMENTS  # [N] forces of the sheared seals after the wanted displacement
    led_velocity: float = 0.0  # [m/s] last usable wanted velocity ``lead_time`` ahead, beyond a reversal too


FADED_OUT = FeedForwardState(NEVER, 0.0, 0.0, -1.0, 0.0, NO_ELEMENTS, 0.0)
"""State before the first estimate."""
FADED_IN = FADED_OUT._replace(fade=1.0)
"""State in a simulation that shall not begin with a fade."""


@compilable
def usable(settings: FeedForwardSettings, estimate: FrictionEstimate) -> bool:
    """Whether the Coulomb friction of an estimate stands on a good pressure.

    The state of the rod counts only with ``use_measured_velocity``; else the direction comes from the reference.
    """
    if estimate.status & UNUSABLE or (settings.lateness_max > 0.0 and estimate.status & _STAMP_AGE):
        return False
    return not settings.use_measured_velocity or estimate.state != UNKNOWN


@compilable
def led_velocity(settings: FeedForwardSettings, velocity: float, acceleration: float) -> float:
    """Velocity [m/s] ``lead_time`` ahead of the given one, beyond a reversal too; NaN if that is NaN or infinite."""
    if not math.isfinite(velocity):
        return math.nan
    led = velocity + settings.lead_time * acceleration
    if not math.isfinite(led):
        led = velocity
    return between(-FASTEST, led, FASTEST)


@compilable
def wanted_velocity(settings: FeedForwardSettings, velocity: float, acceleration: float) -> float:
    """Velocity v [m/s] of the equation, ``lead_time`` ahead of the given one; NaN if that is NaN or infinite.

    The lead takes the force away before a reversal, but the force changes its sign only with the reference: a force
    ahead of it would act against the wanted motion.
    """
    led = led_velocity(settings, velocity, acceleration)
    return 0.0 if led * velocity < 0.0 else led


@compilable
def compensation(settings: FeedForwardSettings, friction: float, velocity: float) -> float:
    """Force [N] for a friction f [N] and a velocity [m/s], before fade and limits: the equation at the top."""
    if not friction > 0.0:
        return 0.0
    return settings.scale * friction * math.tanh(velocity / settings.smoothing_velocity)


@compilable
def elastic_compensation(settings: FeedForwardSettings, friction_force: float, velocity: float) -> float:
    """Force [N] for a friction force F_f [N] of sheared seals and the present wanted velocity [m/s]."""
    if not (friction_force * velocity > 0.0 or settings.presliding_against_motion):
        return 0.0
    return settings.scale * friction_force * abs(math.tanh(velocity / settings.smoothing_velocity))


@compilable
def _sheared(
    settings: FeedForwardSettings,
    elasticity: PreslidingNumbers | None,
    elements: Elements,
    displacement: float,
    friction: float,
) -> tuple[Elements, float]:
    """Seals after a wanted displacement [m], and their friction force [N]; NaN for rigid ones."""
    if elasticity is None:
        return elements, math.nan
    if not settings.presliding or friction < 0.0:
        return elements, math.nan
    return element_forces(elasticity, elements, displacement, friction)


@compilable
def step(
    settings: FeedForwardSettings,
    state: FeedForwardState,
    stamp: int,
    received: int,
    friction: float,
    velocity: float,
) -> tuple[FeedForwardState, FeedForward]:
    """`elastic_step` with rigid seals."""
    return elastic_step(settings, None, state, stamp, received, friction, velocity, velocity, velocity)


def newest_force(state: FeedForwardState) -> float:
    """Force of the newest feed-forward [N]."""
    return state.fade * state.force + 0.0


@compilable
def elastic_step(
    settings: FeedForwardSettings,
    elasticity: PreslidingNumbers | None,
    state: FeedForwardState,
    stamp: int,
    received: int,
    friction: float,
    velocity: float,
    present: float,
    led: float,
) -> tuple[FeedForwardState, FeedForward]:
    """Feed-forward at one moment.

    Without a usable friction and velocity the last usable ones are faded out over ``fade_time``; with them the force
    fades in. Clamp, then slew, then fade.

    Args:
        settings: Settings.
        elasticity: Of the seals; None: rigid, which makes no difference between ``presliding`` on and off.
        state: From `init` or the step before.
        stamp: For the header of the answer [ns].
        received: Now [ns], on the clock of receipt.
        friction: f at ``velocity`` [N]; negative: none is usable.
        velocity: From `wanted_velocity`; NaN: not usable.
        present: Wanted velocity without lead [m/s].
        led: From `led_velocity` [m/s].
    """
    elapsed = 0.0 if state.received == NEVER or received < state.received else (received - state.received) * 1e-9
    valid = friction >= 0.0 and not math.isnan(velocity)
    if not friction >= 0.0:
        friction = state.friction
    if math.isnan(velocity):
        velocity, present, led = state.velocity, state.velocity, state.led_velocity
    short = elapsed if elapsed < LONGEST_STEP else LONGEST_STEP
    change = short / settings.fade_time if valid else -elapsed / settings.fade_time
    fade = between(0.0, state.fade + change, 1.0)

    limited = _FADE if fade < 1.0 or not valid else 0
    wanted = compensation(settings, friction, velocity)
    way = 0.5 * (state.led_velocity + led) * short
    elements, friction_force = _sheared(settings, elasticity, state.elements, way, friction)
    if not math.isnan(friction_force):
        wanted = elastic_compensation(settings, friction_force, present)
    clamped = between(-settings.force_limit, wanted, settings.force_limit)
    if clamped != wanted:
        limited |= _CLAMP
    most = settings.slew_limit * short
    force = between(state.force - most, clamped, state.force + most)
    if force != clamped:
        limited |= _SLEW
    if settings.scale == 0.0:
        force = 0.0
    feedforward = FeedForward(stamp=stamp, force=fade * force + 0.0, scale=settings.scale * fade, limited=limited)
    state = FeedForwardState(
        received=received, force=force, fade=fade, friction=friction, velocity=velocity, elements=elements,
        led_velocity=led,
    )  # fmt: skip
    return state, feedforward
