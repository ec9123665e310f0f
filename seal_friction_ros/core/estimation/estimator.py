"""The estimator, the same online and offline.

``state = init(parameters)``, then ``state, estimate = step(parameters, state, sample)`` at every velocity sample. The
state is one mutable record of small immutable ones: each stage takes and returns its own.

Time is the stamp of the samples: the same samples give the same estimates, live or replayed.
"""

import dataclasses
import math
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.adaptation import (
    LARGEST_INERTIA,
    NOT_ADAPTED,
    AdaptationSettings,
    AdaptationState,
    Slide,
    adapt,
    friction_at_rest,
    friction_of_sliding,
    is_due,
)
from seal_friction_ros.core.estimation.conditioned_velocity import (
    NOT_CONDITIONED,
    SETTLING,
    ConditionedVelocity,
    condition_velocity,
)
from seal_friction_ros.core.estimation.hidden_motion import NO_HIDDEN_MOTION, Apparent, HiddenMotion, with_sample
from seal_friction_ros.core.estimation.records import RodSample, SealTemperature
from seal_friction_ros.core.estimation.sheared_seals import (
    NOT_FOLLOWED,
    FollowedElasticity,
    FollowedShear,
    Moment,
    ShearedFriction,
    followed_elasticity,
    shear_on,
    slide_on,
)
from seal_friction_ros.core.estimation.swings import LONGEST_SWING, NO_SWING, Swing, swing_on
from seal_friction_ros.core.foundation.compiled import compilable, replace
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.friction.actuator import (
    ActuatorFriction,
    MountedSeal,
    SealNumbers,
    at_temperature,
    at_unknown_temperature,
    breakaway_in,
    friction_of_seals,
    numbers_of_seals,
)
from seal_friction_ros.core.friction.force_sum_correction import (
    NO_CORRECTION,
    ForceSumCorrection,
    corrected_force_sum,
    one_correction,
)
from seal_friction_ros.core.friction.identified_motion import ANY_MOTION, MotionLimits, motion_limits
from seal_friction_ros.core.friction.presliding import PreslidingNumbers, presliding_numbers
from seal_friction_ros.core.friction.states import (
    BREAKAWAY,
    SLIDING,
    UNKNOWN,
    StateFriction,
    is_at_rest,
    sign,
    state_friction,
)
from seal_friction_ros.core.friction.temperature import (
    NO_SCALE,
    TemperatureScale,
    is_identified_at,
    one_temperature_scale,
)
from seal_friction_ros.core.messages.records import (
    BITS,
    EXTRAPOLATED,
    NEVER,
    NO_FORCE,
    NO_PRESSURE,
    Force,
    FrictionEstimate,
    Pressure,
)


@dataclass(frozen=True)
class EstimatorSettings:
    """Settings of the estimator, one field per ROS parameter.

    Raises:
        ValueError: A setting is out of bounds, or two contradict each other.
    """

    stick_velocity: float = parameter(
        1e-3,
        unit='m/s',
        lower=0.0,
        upper=1.0,
        description='A sliding rod is at rest at this speed and below; up to 5 times it, the rod may be at rest (zero '
        'error of the sensor).',
    )
    slip_velocity: float = parameter(
        2e-3, unit='m/s', lower=0.0, upper=1.0, description='A rod at rest slides above this speed.'
    )
    velocity_resolution: float = parameter(
        0.0,
        unit='m/s',
        lower=0.0,
        upper=1.0,
        description='Smallest ripple of the measured velocity at rest: encoder count times sample rate; 0: learnt.',
    )
    use_stiction: bool = parameter(
        True, unit='', description='Breakaway force above Coulomb friction by the stiction of the seals.'
    )
    use_presliding: bool = parameter(
        True,
        unit='',
        description='After a reversal the friction follows the elasticity of the seals where their seal files have it.',
    )
    pressure_timeout: float = parameter(
        0.1, unit='s', lower=1e-3, upper=1.0, description='Largest time between the stamps of velocity and pressure.'
    )
    force_timeout: float = parameter(
        0.1, unit='s', lower=1e-3, upper=1.0, description='Largest time between the stamps of velocity and force sum.'
    )
    temperature_timeout: float = parameter(
        10.0,
        unit='s',
        lower=1e-3,
        upper=3600.0,
        description='Largest time between the stamps of velocity and temperature; only with `temperature` in a seal '
        'file.',
    )
    stamp_age_max: float = parameter(
        1.0,
        unit='s',
        lower=0.0,
        upper=3600.0,
        description='Largest time between the stamp of a velocity and its receipt, either way; 0: not checked.',
    )
    pressure_min: float = parameter(
        -1.2e5, unit='Pa', lower=-1.2e5, upper=0.0, description='A pressure below this is a sensor fault.'
    )
    pressure_max: float = parameter(
        4.5e7, unit='Pa', lower=1e4, upper=1e9, description='A pressure above this is a sensor fault.'
    )
    velocity_max: float = parameter(
        10.0, unit='m/s', lower=1e-3, upper=100.0, description='A speed above this is a sensor fault.'
    )
    force_max: float = parameter(
        1e6, unit='N', lower=1.0, upper=1e9, description='A force sum of a magnitude above this is a sensor fault.'
    )

    pressure_rate_max: float = parameter(
        1e10,
        unit='Pa/s',
        lower=1.0,
        upper=1e15,
        description='A pressure that changes faster is rejected until the next one confirms it.',
    )
    force_rate_max: float = parameter(
        1e8,
        unit='N/s',
        lower=1e-3,
        upper=1e15,
        description='A force sum that changes faster is rejected until the next one confirms it.',
    )
    acceleration_max: float = parameter(
        1e3,
        unit='m/s^2',
        lower=1e-3,
        upper=1e9,
        description='A velocity that changes faster is rejected until the next one confirms it.',
    )

    def __post_init__(self) -> None:
        check(self)
        if self.slip_velocity < self.stick_velocity:
            raise ValueError(
                f'EstimatorSettings.slip_velocity = {self.slip_velocity} m/s is below '
                f'stick_velocity = {self.stick_velocity} m/s'
            )


DEFAULT_ADAPTATION = AdaptationSettings()


@dataclass(frozen=True)
class EstimatorParameters:
    """Settings of the estimator and the seals of the actuator.

    Raises:
        ValueError: There is no seal, or two seals have different corrections of the force sum or temperature parts.
    """

    settings: EstimatorSettings
    seals: tuple[MountedSeal, ...]
    adaptation: AdaptationSettings = DEFAULT_ADAPTATION
    adapts: bool = field(init=False, repr=False, compare=False)
    """whether scale and offset are learnt"""
    uses_scale: bool = field(init=False, repr=False, compare=False)
    """whether the friction has the scale"""
    seal_numbers: tuple[SealNumbers, ...] = field(init=False, repr=False, compare=False)
    depends_on_velocity: bool = field(init=False, repr=False, compare=False)
    """whether the sliding friction of a seal does"""
    corrects_force_sum: bool = field(init=False, repr=False, compare=False)
    """whether a seal file has a ``force_sum_correction``; without one the force sum keeps its bytes, as -0.0 does"""
    force_sum_correction: ForceSumCorrection = field(init=False, repr=False, compare=False)
    limits_motion: bool = field(init=False, repr=False, compare=False)
    """whether a seal file tells in which motion the seal was identified"""
    motion_limits: MotionLimits = field(init=False, repr=False, compare=False)
    has_temperature_scale: bool = field(init=False, repr=False, compare=False)
    """whether the seal files have a ``temperature`` part"""
    temperature_scale: TemperatureScale = field(init=False, repr=False, compare=False)
    elasticity: PreslidingNumbers | None = field(init=False, repr=False, compare=False)
    """of all seals together; None (rigid) if a seal file does not tell: then compiled code has no elements"""

    followed_elasticity: FollowedElasticity | None = field(init=False, repr=False, compare=False)
    """that the friction follows; None: rigid"""

    def __post_init__(self) -> None:
        if not self.seals:
            raise ValueError('EstimatorParameters.seals is empty: name at least one seal')
        seals = [mounted.seal for mounted in self.seals]
        correction = one_correction(seal.force_sum_correction for seal in seals)
        temperature_scale = one_temperature_scale(seal.temperature for seal in seals)
        motions = [seal.identified_motion for seal in seals]
        elastic = [seal.presliding for seal in seals if seal.presliding]
        elasticity = presliding_numbers(elastic) if len(elastic) == len(seals) else None
        followed = None
        if elasticity is not None and self.settings.use_presliding:
            softened = math.fsum(seal.stiffness * seal.relative_std for seal in elastic)
            unlike = _unlike_yield(self.seals, self.settings.pressure_max)
            followed = followed_elasticity(elasticity, softened / elasticity.stiffness, unlike)
        derived = {
            'seal_numbers': numbers_of_seals(self.seals),
            'depends_on_velocity': any(seal.depends_on_velocity for seal in seals),
            'corrects_force_sum': correction is not None,
            'force_sum_correction': correction or NO_CORRECTION,
            'limits_motion': any(motion != ANY_MOTION for motion in motions),
            'motion_limits': motion_limits(motions),
            'elasticity': elasticity,
            'followed_elasticity': followed,
            'adapts': self.adaptation.mode != 'off',
            'uses_scale': self.adaptation.mode == 'on',
            'has_temperature_scale': temperature_scale is not None,
            'temperature_scale': temperature_scale or NO_SCALE,
        }
        for name, value in derived.items():
            object.__setattr__(self, name, value)


def _unlike_yield(seals: tuple[MountedSeal, ...], pressure_max: float) -> float:
    """Way until one of some elastic seals slides over that until all together do, at worst [-]; 1 in one chamber.

    At worst it is at its highest identified pressure, at most ``pressure_max`` [Pa], and the others have none.
    """

    def alone(mounted: MountedSeal, pressure: float) -> float:
        """Friction of one seal [N] that sees this pressure."""
        return friction_of_seals(
            (dataclasses.replace(mounted, chamber='a').numbers,), pressure, 0.0, 0.0
        ).coulomb_friction

    if len({mounted.chamber for mounted in seals}) < 2:
        return 1.0
    stiffnesses = [mounted.seal.presliding.stiffness if mounted.seal.presliding else math.inf for mounted in seals]
    without = [alone(mounted, 0.0) for mounted in seals]
    unlike = 1.0
    for mounted, stiffness, least in zip(seals, stiffnesses, without, strict=True):
        most = max(least, alone(mounted, min(mounted.seal.pressure_max, pressure_max)))
        together = (math.fsum(without) - least + most) / math.fsum(stiffnesses)
        if together > 0.0:
            unlike = max(unlike, most / stiffness / together)
    return unlike


class Speed(NamedTuple):
    """One rod velocity."""

    stamp: int  # [ns]
    velocity: float  # [m/s]


NO_SPEED = Speed(NEVER, 0.0)


@dataclass(slots=True)
class EstimatorState:
    """What one step leaves for the next."""

    stamp: int = NEVER  # [ns] of the last velocity sample; `NEVER` before the first
    at_rest: bool = False
    pressure: Pressure = NO_PRESSURE  # last usable pressure
    force: Force = NO_FORCE  # last usable force sum
    velocity: Speed = NO_SPEED  # last usable velocity
    leapt_pressure: Pressure = NO_PRESSURE  # newest pressure, if it jumped away from the last usable one
    leapt_force: Force = NO_FORCE  # likewise
    leapt_velocity: Speed = NO_SPEED  # likewise
    motion: ConditionedVelocity = NOT_CONDITIONED  # of the usable velocities
    adaptation: AdaptationState = NOT_ADAPTED
    shear: FollowedShear = NOT_FOLLOWED
    swing: Swing = NO_SWING
    hidden: HiddenMotion = NO_HIDDEN_MOTION

    def copy(self) -> 'EstimatorState':
        """The same state, which does not change with this one."""
        return EstimatorState(*_VALUES(self))


_VALUES = attrgetter(*(one.name for one in fields(EstimatorState)))


class Observation(NamedTuple):
    """One sample after the checks, before any friction is computed."""

    stamp: int  # [ns]
    velocity: float  # [m/s] at which the seals slide, conditioned; 0.0 at rest and where it is not known
    force_sum: float  # [N] corrected; 0.0 if it contains a load, which hides it
    status: int  # bits of `Status`
    input_age: float  # [s] as in `FrictionEstimate`


def init(parameters: EstimatorParameters) -> EstimatorState:
    """State before the first sample: no inputs, the rod counts as moving."""
    del parameters
    return EstimatorState()


_EXTRAPOLATED = int(EXTRAPOLATED)
NO_VELOCITY = BITS.VELOCITY_NOT_FINITE | BITS.VELOCITY_OUT_OF_RANGE | BITS.VELOCITY_LEAP
"""Status bits of a velocity that is not used."""
_NO_AGE = BITS.PRESSURE_MISSING | BITS.FORCE_MISSING
_NO_STATE = NO_VELOCITY | BITS.INPUT_REFUSED | BITS.PRESSURE_MISSING
_NO_FORCE_SUM = BITS.FORCE_MISSING | BITS.FORCE_STALE | BITS.FORCE_CONTAINS_LOAD
_NO_READING = _NO_STATE | _NO_FORCE_SUM
_NO_FRICTION = ActuatorFriction(0.0, 0.0, 0.0, True, 0.0, 0.0)
_UNKNOWN = StateFriction(UNKNOWN, 0, 0.0)

ZERO_MAX = 5.0  # [-] our choice: zero of a velocity sensor over stick_velocity; a slower rod may be at rest
CREEP = 0.1  # [-] our choice: a rod that moves against its force sum slides from this share of stick_velocity on
SETTLING_TIME = 0.01  # [s] our choice: in this time the way of a sliding rod exceeds the ripple of its signal clearly
SHEARED = 5e-4  # [m] our choice: way from a turn after which every seal slides
SHORTEST_INTERVAL = 1e-3  # [s] our choice: over less, noise exceeds any rate, and some drivers stamp no finer


def step(
    parameters: EstimatorParameters, state: EstimatorState, sample: RodSample
) -> tuple[EstimatorState, FrictionEstimate]:
    """Estimate the friction of the seals at one rod-velocity sample, then learn from it: `estimate_at`, `learn_from`.

    Args:
        parameters: Settings and seals.
        state: From `init` or the step before; it stays as it is.
        sample: Velocity sample with the newest pressure and force sum.

    Returns:
        The next state and the estimate, every number of which is finite.
    """
    state = state.copy()
    estimate, seen, friction = estimate_at(parameters, state, sample)
    state.adaptation = learn_from(parameters, state.adaptation, estimate, seen, friction)
    return state, estimate


@compilable
def estimate_at(
    parameters: Any, state: EstimatorState, sample: RodSample
) -> tuple[FrictionEstimate, Observation, ActuatorFriction]:
    """Estimate the friction of the seals at one rod-velocity sample by what was learnt before.

    A pressure or force sum that is not finite, out of range, or jumps is never used: the last usable one stays in use
    until it is stale, and the status says so. The state is UNKNOWN and the friction force 0 N with such a velocity,
    with refused inputs, without any usable pressure so far, and at rest with a force sum that is missing, stale or
    contains a load. A stale pressure leaves state and friction as they are, with the status bit set.

    A sample jumps if it is further from the last usable one than the largest rate allows over the time between them,
    at least `SHORTEST_INTERVAL`. The next sample is usable if it agrees with either of the two: a spike and a real step
    each cost one sample.

    Args:
        parameters: Settings and seals.
        state: From `init` or the step before; it becomes the next state, but for what `learn_from` learns.
        sample: Velocity sample with the newest pressure and force sum.

    Returns:
        The estimate, every number of which is finite, and what else `learn_from` takes.

    Source: thesis, chapter 7 (Figures 20 and 21); what is done with unusable inputs is our choice.
    """
    elapsed = (sample.stamp - state.stamp) * 1e-9
    seen, friction = assess_inputs(parameters, state, sample), _NO_FRICTION
    velocity, pressure = seen.velocity, state.pressure
    if pressure.stamp != NEVER:
        friction = friction_of_seals(parameters.seal_numbers, pressure.chamber_a, pressure.chamber_b, velocity)
    if parameters.has_temperature_scale:
        seen, friction = _at_seal_temperature(parameters, seen, friction, sample.temperature)
    if parameters.adapts:
        way, is_rigid = state.swing.way, parameters.followed_elasticity is None  # else their shear is followed
        has_turned = is_rigid and (velocity * way <= 0.0 or abs(way) < SHEARED)
        adapted, estimate = _estimate_with_learnt(parameters, state.adaptation, seen, friction, has_turned)
    else:
        std = friction.coulomb_friction_std
        adapted, estimate = friction, estimate_of(parameters, seen, friction, std, 1.0, 0.0, 0.0, 0.0)
    state.shear, estimate = _with_sheared_seals(
        parameters, parameters.followed_elasticity, state, seen, adapted, estimate
    )
    if not estimate.status & _NO_READING:
        hidden, swing, measured = state.hidden, state.swing, state.velocity.velocity
        if measured * velocity <= 0.0 or hidden.speed > 0.0 or hidden.doubt > 0.0:
            moment = Apparent(elapsed, measured, velocity, seen.force_sum, friction.coulomb_friction)
            state.hidden = with_sample(hidden, moment, parameters.settings.slip_velocity)
            if hidden.doubt > 0.0 and state.hidden.doubt == 0.0:  # what passed for ripple was a motion, which is over
                state.motion = replace(state.motion, half_width=0.0, last_ripple=0.0, samples=0)
        is_short = abs(swing.way) <= LONGEST_SWING or (velocity > 0.0) != (swing.way > 0.0)
        if velocity != 0.0 and (is_short or swing.doubted > 0.0):
            state.swing = swing_on(swing, elapsed, velocity, seen.force_sum, estimate.friction_force)
        if state.hidden.doubt > 0.0 or (velocity != 0.0 and state.swing.doubted > 0.0):
            estimate = replace(estimate, status=estimate.status | BITS.MOTION_UNCERTAIN)
    return estimate, seen, friction


@compilable
def learn_from(
    parameters: Any, known: AdaptationState, estimate: FrictionEstimate, seen: Observation, friction: ActuatorFriction
) -> AdaptationState:
    """What is learnt after a sample: if adaptation is on and the sample is due.

    Args:
        parameters: Settings and seals.
        known: What was learnt before.
        estimate: Of this sample, from `estimate_at`, like the other arguments.
        seen: The sample after the checks.
        friction: By the seal files.
    """
    if not parameters.adapts or not is_due(known, seen.stamp):
        return known
    status = estimate.status & ~BITS.MODEL_DISAGREES
    law, slow = friction.coulomb_friction + friction.velocity_friction, ZERO_MAX * parameters.settings.stick_velocity
    is_pressed, is_usable = estimate.state == BREAKAWAY, not status & ~_EXTRAPOLATED
    slide = Slide(
        seen.stamp, seen.velocity, seen.force_sum, law, friction.coulomb_friction_std, is_pressed, is_usable,
        status == 0, slow,
    )  # fmt: skip
    return adapt(parameters.adaptation, known, slide)


@compilable
def temperature_in_use(law: TemperatureScale, temperature: SealTemperature) -> float:
    """Temperature [K] that the friction is taken at: the newest one however old, before the first the reference."""
    return law.reference if temperature.stamp == NEVER else temperature.kelvin


@compilable
def _at_seal_temperature(
    parameters: Any, seen: Observation, friction: ActuatorFriction, temperature: SealTemperature
) -> tuple[Observation, ActuatorFriction]:
    """Friction at the temperature of the seals, and status bits if that is old or outside the identified ones.

    An old temperature stays in use, since a seal warms up in minutes and a step back to the reference would be a step
    of the force (our choice); the standard deviation then holds any of the identified temperatures.
    """
    law = parameters.temperature_scale
    kelvin = temperature_in_use(law, temperature)
    fault = 0
    age = abs(seen.stamp - temperature.stamp) * 1e-9
    if temperature.stamp == NEVER or age > parameters.settings.temperature_timeout:
        fault |= BITS.TEMPERATURE_MISSING
    if not is_identified_at(law, kelvin):
        fault |= BITS.OUTSIDE_IDENTIFIED_TEMPERATURE
    friction = at_temperature(friction, law, kelvin)
    if fault:
        friction = at_unknown_temperature(friction, law)
    return replace(seen, status=seen.status | fault), friction


@compilable
def _estimate_with_learnt(
    parameters: Any, known: AdaptationState, seen: Observation, friction: ActuatorFriction, has_turned: bool
) -> tuple[ActuatorFriction, FrictionEstimate]:
    """Friction and estimate by what was learnt before this sample.

    Just after a rod ``has_turned``, its seals may shear still, or its velocity be early: where the force sum does not
    show the friction, the band holds both directions.
    """
    settings, uses, outlook = parameters.adaptation, parameters.uses_scale, known.outlook
    stamp, velocity, force_sum, seen_status, input_age = seen
    status, left = seen_status | outlook.status, 0.0
    if velocity == 0.0:
        adapted, std, contradicts = friction_at_rest(settings, known, friction, stamp, force_sum, uses)
        if uses and outlook.is_proven:
            force_sum -= outlook.offset
    else:
        adapted, found, contradicts = friction_of_sliding(settings, known, friction, velocity, uses)
        std = adapted.coulomb_friction_std
        if not status & _NO_READING:
            left = force_sum - outlook.taken_off
            contradicts = contradicts or abs(left - found) > outlook.most
            sliding = adapted.coulomb_friction + adapted.velocity_friction
            left -= sliding if velocity > 0.0 else -sliding
            if has_turned and abs(left) > BAND_95 * std:
                wider = (sliding + (sliding if sliding > abs(found) else abs(found))) / BAND_95
                std = wider if wider > std else std
                adapted = replace(adapted, coulomb_friction_std=std)
    if contradicts:
        status |= BITS.MODEL_DISAGREES
    if status != seen_status or force_sum != seen.force_sum:
        seen = Observation(stamp, velocity, force_sum, status, input_age)
    scale_std = outlook.scale_std
    if scale_std < 0.0:
        law = friction.coulomb_friction + friction.velocity_friction
        scale_std = friction.coulomb_friction_std / law if law > 0.0 else 0.0
    return adapted, estimate_of(parameters, seen, adapted, std, outlook.scale, scale_std, outlook.unsteady_offset, left)


@compilable
def _with_sheared_seals(
    parameters: Any,
    elasticity: FollowedElasticity | None,
    state: EstimatorState,
    seen: Observation,
    friction: ActuatorFriction,
    estimate: FrictionEstimate,
) -> tuple[FollowedShear, FrictionEstimate]:
    """Estimate with the friction of seals that shear, while the rod moves and just after; at rest as with rigid seals.

    Without a usable velocity or pressure the seals are not followed: over a short gap the way counts.

    Args:
        parameters: With the moving mass.
        elasticity: Of the seals; None: rigid.
        state: With the shear of the sample before.
        seen: The sample.
        friction: Of seals that slide.
        estimate: With rigid seals.
    """
    if elasticity is None:
        return state.shear, estimate
    if estimate.status & _NO_STATE:
        return state.shear, estimate
    shear, measured, moves, slides_on = state.shear, state.velocity.velocity, sign(seen.velocity), False
    if moves != 0:
        slides_on, shear = slide_on(
            elasticity, shear, seen.stamp, measured, moves, NEVER, friction.coulomb_friction, friction.velocity_friction
        )
    if slides_on:
        sheared = ShearedFriction(is_followed=True, force=shear.fully_sheared, std=0.0, slides=True)
    else:
        moment = _moment_of_seals(parameters.adaptation, state.adaptation, measured, seen, friction, estimate)
        shear, sheared = shear_on(elasticity, shear, moment)
    is_as_rigid = slides_on and sheared.force == estimate.friction_force
    if is_as_rigid or not sheared.is_followed or estimate.state == UNKNOWN:
        return shear, estimate
    return shear, _with_shear(estimate, sheared, seen.velocity)


@compilable
def _moment_of_seals(
    settings: AdaptationSettings,
    known: AdaptationState,
    measured: float,
    seen: Observation,
    friction: ActuatorFriction,
    estimate: FrictionEstimate,
) -> Moment:
    """A sample as seals that shear take it, less what is known not to be friction."""
    inertia, coulomb = settings.moving_mass * known.motion.acceleration, friction.coulomb_friction
    is_small = abs(inertia) <= LARGEST_INERTIA * coulomb
    return Moment(
        stamp=seen.stamp, velocity=measured, direction=sign(seen.velocity),
        force_sum=seen.force_sum - estimate.adaptation_offset - inertia,
        knows_force_sum=not estimate.status & _NO_FORCE_SUM,
        knows_inertia=settings.moving_mass > 0.0 and is_small and known.stamp != NEVER, coulomb_friction=coulomb,
        velocity_friction=friction.velocity_friction, stiction=estimate.breakaway_force - coulomb,
    )  # fmt: skip


@compilable
def _with_shear(estimate: FrictionEstimate, sheared: ShearedFriction, velocity: float) -> FrictionEstimate:
    """Estimate with the friction of sheared seals; 0.0 as residual: there is none of this sample."""
    coulomb_std, std, left = estimate.coulomb_friction_std, estimate.friction_force_std, estimate.residual
    status, direction = estimate.status, estimate.direction
    if left != 0.0:
        left += estimate.friction_force - sheared.force
    if velocity == 0.0:
        direction = sign(sheared.force)
    if velocity == 0.0 or not sheared.slides:
        status |= BITS.PRESLIDING
    return replace(
        estimate, coulomb_friction_std=math.sqrt(coulomb_std * coulomb_std + sheared.std * sheared.std),
        friction_force_std=math.sqrt(std * std + sheared.std * sheared.std), friction_force=sheared.force,
        direction=direction, status=status, residual=left,
    )  # fmt: skip


@compilable
def assess_inputs(parameters: Any, state: EstimatorState, sample: RodSample) -> Observation:
    """First half of a step: choose the inputs in use, flag their faults, decide whether the rod moves.

    The force sum is checked as measured, since its limits are those of a sensor, then corrected with the
    pressure in use.
    """
    settings = parameters.settings
    stamp, last_stamp = sample.stamp, state.stamp
    status = BITS.INPUT_REFUSED if sample.refused else 0
    if last_stamp != NEVER and stamp <= last_stamp:
        status |= BITS.STAMP_NOT_INCREASING
    if abs(sample.stamp_age) > settings.stamp_age_max > 0.0:
        status |= BITS.STAMP_AGE
    if sample.is_late:
        status |= BITS.LATE_INPUT
    state.stamp = stamp
    state.pressure, state.leapt_pressure, fault = _usable_pressure(
        settings, sample.pressure, state.pressure, state.leapt_pressure
    )
    status |= fault
    state.force, state.leapt_force, fault = _usable_force(settings, sample.force, state.force, state.leapt_force)
    status |= fault
    pressure_age = 0.0 if state.pressure.stamp == NEVER else (stamp - state.pressure.stamp) * 1e-9
    force_age = 0.0 if state.force.stamp == NEVER else (stamp - state.force.stamp) * 1e-9
    if abs(pressure_age) > settings.pressure_timeout:
        status |= BITS.PRESSURE_STALE
    if abs(force_age) > settings.force_timeout:
        status |= BITS.FORCE_STALE
    input_age = pressure_age if pressure_age >= force_age else force_age
    if status & _NO_AGE:
        input_age = -1.0
    force_sum = _force_sum_on_rod(parameters, state.force, state.pressure)

    newest, velocity = Speed(stamp, sample.velocity), 0.0
    state.velocity, state.leapt_velocity, fault = _usable_velocity(
        settings, newest, state.velocity, state.leapt_velocity
    )
    status |= fault
    if not fault:
        motion = condition_velocity(state.motion, stamp, sample.velocity, settings.velocity_resolution)
        at_rest = is_at_rest(motion.velocity, state.at_rest, settings.stick_velocity, settings.slip_velocity)
        state.motion, state.at_rest = motion, at_rest
        # Friction never drives: a rod in the band of rest that moves against the force sum slides; a load hides that.
        drives = motion.velocity * force_sum < 0.0 and not parameters.force_sum_correction.contains_load
        slides = not at_rest or (drives and abs(motion.velocity) > CREEP * settings.stick_velocity)
        if slides:
            velocity = motion.velocity
            if at_rest or _is_uncertain(settings, motion):
                status |= BITS.MOTION_UNCERTAIN
    return Observation(stamp, velocity, force_sum, status, input_age)


@compilable
def _force_sum_on_rod(parameters: Any, force: Force, pressure: Pressure) -> float:
    """Measured force sum, corrected [N]."""
    if not parameters.corrects_force_sum or force.stamp == NEVER:
        return force.force
    correction = parameters.force_sum_correction
    found: float = corrected_force_sum(correction, force.force, pressure.chamber_a, pressure.chamber_b)
    return found


@compilable
def _unidentified_motion(limits: MotionLimits, velocity: float) -> int:
    """Status bits of sliding at ``velocity`` [m/s] that no seal file covers."""
    status, speed = 0, abs(velocity)
    if speed > limits.fastest:
        status |= BITS.FASTER_THAN_IDENTIFIED
    if 0.0 < speed < limits.slowest:
        status |= BITS.SLOWER_THAN_IDENTIFIED
    if (velocity > 0.0 and not limits.extends) or (velocity < 0.0 and not limits.retracts):
        status |= BITS.DIRECTION_NOT_IDENTIFIED
    return status


@compilable
def _is_uncertain(settings: EstimatorSettings, motion: ConditionedVelocity) -> bool:
    """Whether the velocity of a rod that seems to slide does not tell if it is at rest."""
    velocity, half_width = motion.velocity, motion.half_width
    if motion.samples < SETTLING:
        return True
    if half_width == 0.0:  # the first step of a motion may be a ripple that is not learnt yet
        return velocity * (motion.last_velocity - motion.last_change) <= 0.0
    return motion.is_waiting or abs(velocity) <= settings.slip_velocity + half_width / SETTLING_TIME


@compilable
def estimate_of(
    parameters: Any,
    seen: Observation,
    friction: ActuatorFriction,
    std: float,
    scale: float,
    scale_std: float,
    offset: float,
    residual: float,
) -> FrictionEstimate:
    """Second half of a step: friction that acts on the rod, from the friction of all seals at the pressure in use.

    ``std`` [N] is that of the friction that acts; ``scale``, ``scale_std``, ``offset`` and ``residual`` [N] are what
    adaptation adds to the estimate.
    """
    stamp, velocity, force_sum, status, input_age = seen
    ahead, coulomb = sign(velocity if velocity != 0.0 else force_sum), friction.coulomb_friction
    breakaway = breakaway_in(friction, ahead, parameters.settings.use_stiction)
    if not friction.in_identified_range:
        status |= BITS.OUTSIDE_IDENTIFIED_RANGE
    if parameters.limits_motion:
        status |= _unidentified_motion(parameters.motion_limits, velocity)
    slides, sliding = velocity != 0.0, coulomb + friction.velocity_friction
    if not slides and parameters.force_sum_correction.contains_load:
        status |= BITS.FORCE_CONTAINS_LOAD
    state, direction, force = _UNKNOWN
    if not status & _NO_STATE:
        if slides:  # `state_friction`, without its record
            state, direction, force = SLIDING, ahead, sliding * ahead
        elif not status & _NO_FORCE_SUM:
            state, direction, force = state_friction(velocity, force_sum, True, sliding, breakaway)
    std = std if state != UNKNOWN else -1.0
    return FrictionEstimate(  # by position, as every record of each sample: that takes less time than names
        stamp, coulomb, friction.coulomb_friction_std, breakaway, force, state, direction, status, input_age, scale,
        scale_std, offset, residual, std,
    )  # fmt: skip


@compilable
def _largest_change(elapsed: int, largest_rate: float) -> float:
    """Change that ``largest_rate`` [unit of the change / s] allows over ``elapsed`` [ns]."""
    seconds = abs(elapsed) * 1e-9
    return largest_rate * (seconds if seconds > SHORTEST_INTERVAL else SHORTEST_INTERVAL)


@compilable
def _pressure_leaps(settings: EstimatorSettings, newer: Pressure, older: Pressure) -> bool:
    most = _largest_change(newer.stamp - older.stamp, settings.pressure_rate_max)
    return abs(newer.chamber_a - older.chamber_a) > most or abs(newer.chamber_b - older.chamber_b) > most


@compilable
def _usable_pressure(
    settings: EstimatorSettings, newest: Pressure, used: Pressure, leapt: Pressure
) -> tuple[Pressure, Pressure, int]:
    """Pressure to use, the pressure that jumped, and status bits."""
    stamp, a, b = newest
    missing = BITS.PRESSURE_MISSING if used.stamp == NEVER else 0
    if stamp == NEVER:
        return used, leapt, missing
    lowest, highest = settings.pressure_min, settings.pressure_max
    if not (lowest <= a <= highest and lowest <= b <= highest):
        finite = math.isfinite(a) and math.isfinite(b)
        return used, leapt, missing | (BITS.PRESSURE_OUT_OF_RANGE if finite else BITS.PRESSURE_NOT_FINITE)
    if missing or not _pressure_leaps(settings, newest, used):
        return newest, NO_PRESSURE, 0
    confirms = leapt.stamp not in (NEVER, stamp)
    if confirms and not _pressure_leaps(settings, newest, leapt):
        return newest, NO_PRESSURE, 0
    return used, newest, BITS.PRESSURE_LEAP


@compilable
def _usable_force(settings: EstimatorSettings, newest: Force, used: Force, leapt: Force) -> tuple[Force, Force, int]:
    """Force sum to use, the force sum that jumped, and status bits."""
    stamp, force = newest
    used_stamp, used_force = used
    missing = BITS.FORCE_MISSING if used_stamp == NEVER else 0
    if stamp == NEVER:
        return used, leapt, missing
    if not abs(force) <= settings.force_max:
        return used, leapt, missing | (BITS.FORCE_OUT_OF_RANGE if math.isfinite(force) else BITS.FORCE_NOT_FINITE)
    fastest = settings.force_rate_max
    if missing or abs(force - used_force) <= _largest_change(stamp - used_stamp, fastest):
        return newest, NO_FORCE, 0
    confirms = leapt.stamp not in (NEVER, stamp)
    if confirms and abs(force - leapt.force) <= _largest_change(stamp - leapt.stamp, fastest):
        return newest, NO_FORCE, 0
    return used, newest, BITS.FORCE_LEAP


@compilable
def _usable_velocity(settings: EstimatorSettings, newest: Speed, used: Speed, leapt: Speed) -> tuple[Speed, Speed, int]:
    """Velocity to use, the velocity that jumped, and status bits."""
    stamp, velocity = newest
    used_stamp, used_velocity = used
    if not abs(velocity) <= settings.velocity_max:
        return used, leapt, BITS.VELOCITY_OUT_OF_RANGE if math.isfinite(velocity) else BITS.VELOCITY_NOT_FINITE
    fastest = settings.acceleration_max
    if used_stamp == NEVER or abs(velocity - used_velocity) <= _largest_change(stamp - used_stamp, fastest):
        return newest, NO_SPEED, 0
    confirms = leapt.stamp not in (NEVER, stamp)
    if confirms and abs(velocity - leapt.velocity) <= _largest_change(stamp - leapt.stamp, fastest):
        return newest, NO_SPEED, 0
    return used, newest, BITS.VELOCITY_LEAP
