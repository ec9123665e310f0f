"""The one estimator, online and offline.

``state = init(parameters)``, then ``state, estimate = step(parameters, state, sample)`` at every velocity sample.

Nothing here knows of ROS, files or a clock: time is the stamp of the samples, so the same samples give the same
estimates, live or replayed.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from seal_friction_ros.core.coulomb import MountedSeal, actuator_friction
from seal_friction_ros.core.friction_state import is_at_rest, state_friction
from seal_friction_ros.core.records import Force, FrictionEstimate, FrictionState, Pressure, RodSample, Status
from seal_friction_ros.core.validated import check, parameter


@dataclass(frozen=True)
class EstimatorSettings:
    """Settings of the estimator, one field per ROS parameter.

    Raises:
        ValueError: A setting is out of bounds, or two contradict each other.
    """

    stick_velocity: float = parameter(
        1e-3, unit='m/s', lower=0.0, upper=1.0, description='A sliding rod is at rest at this speed and below.'
    )
    slip_velocity: float = parameter(
        2e-3, unit='m/s', lower=0.0, upper=1.0, description='A rod at rest slides above this speed.'
    )
    use_stiction: bool = parameter(
        True, unit='', description='Breakaway force above Coulomb friction by the stiction of the seals.'
    )
    pressure_timeout: float = parameter(
        0.1, unit='s', lower=1e-4, upper=60.0, description='Largest distance in time between velocity and pressure.'
    )
    force_timeout: float = parameter(
        0.1, unit='s', lower=1e-4, upper=60.0, description='Largest distance in time between velocity and force sum.'
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

    def __post_init__(self) -> None:
        check(self)
        if self.slip_velocity < self.stick_velocity:
            raise ValueError(
                f'EstimatorSettings.slip_velocity = {self.slip_velocity} m/s is below '
                f'stick_velocity = {self.stick_velocity} m/s'
            )


@dataclass(frozen=True)
class EstimatorParameters:
    """All that the estimator knows beforehand: its settings and the seals of the actuator.

    Raises:
        ValueError: There is no seal.
    """

    settings: EstimatorSettings
    seals: tuple[MountedSeal, ...]

    def __post_init__(self) -> None:
        if not self.seals:
            raise ValueError('EstimatorParameters.seals is empty: name at least one seal')


class EstimatorState(NamedTuple):
    """What one step leaves for the next."""

    stamp: int | None
    """[ns] of the last velocity sample; None before the first"""
    at_rest: bool
    pressure: Pressure | None
    """last usable pressure"""
    force: Force | None
    """last usable force sum"""


def init(parameters: EstimatorParameters) -> EstimatorState:
    """State before the first sample: nothing is known, the rod counts as moving."""
    del parameters
    return EstimatorState(None, False, None, None)


# Status bits as plain integers: IntFlag arithmetic costs a microsecond each time.
_PRESSURE_MISSING = int(Status.PRESSURE_MISSING)
_FORCE_MISSING = int(Status.FORCE_MISSING)
_PRESSURE_STALE = int(Status.PRESSURE_STALE)
_FORCE_STALE = int(Status.FORCE_STALE)
_PRESSURE_NOT_FINITE = int(Status.PRESSURE_NOT_FINITE)
_FORCE_NOT_FINITE = int(Status.FORCE_NOT_FINITE)
_VELOCITY_NOT_FINITE = int(Status.VELOCITY_NOT_FINITE)
_PRESSURE_OUT_OF_RANGE = int(Status.PRESSURE_OUT_OF_RANGE)
_FORCE_OUT_OF_RANGE = int(Status.FORCE_OUT_OF_RANGE)
_VELOCITY_OUT_OF_RANGE = int(Status.VELOCITY_OUT_OF_RANGE)
_OUTSIDE_IDENTIFIED_RANGE = int(Status.OUTSIDE_IDENTIFIED_RANGE)
_STAMP_NOT_INCREASING = int(Status.STAMP_NOT_INCREASING)


def step(
    parameters: EstimatorParameters, state: EstimatorState, sample: RodSample
) -> tuple[EstimatorState, FrictionEstimate]:
    """Estimate the friction of the seals at one rod-velocity sample.

    A pressure or force sum that is not finite or out of range is never used: the last usable one is, for as long as
    it is not stale, and the status says so. A velocity like that, or no usable pressure ever, makes the state UNKNOWN
    with a friction force of 0 N; so does, at rest, a force sum that is missing or stale. A stale pressure leaves the
    state and the last known friction, flagged.

    Args:
        parameters: Settings and seals.
        state: From `init` or the step before.
        sample: Velocity sample with the newest pressure and force sum.

    Returns:
        The next state and the estimate, every number of which is finite.

    Source: thesis, chapter 7 (Figures 20 and 21); what is done with unusable inputs is our choice.
    """
    settings = parameters.settings
    status = 0
    if state.stamp is not None and sample.stamp <= state.stamp:
        status |= _STAMP_NOT_INCREASING

    pressure, fault = _usable_pressure(settings, sample.pressure, state.pressure)
    status |= fault
    force, fault = _usable_force(settings, sample.force, state.force)
    status |= fault
    pressure_age = 0.0 if pressure is None else (sample.stamp - pressure.stamp) * 1e-9
    force_age = 0.0 if force is None else (sample.stamp - force.stamp) * 1e-9
    if abs(pressure_age) > settings.pressure_timeout:
        status |= _PRESSURE_STALE
    if abs(force_age) > settings.force_timeout:
        status |= _FORCE_STALE
    input_age = -1.0 if pressure is None or force is None else max(pressure_age, force_age)

    fault = _velocity_fault(settings, sample.velocity)
    status |= fault
    at_rest = state.at_rest
    if not fault:
        at_rest = is_at_rest(sample.velocity, state.at_rest, settings.stick_velocity, settings.slip_velocity)

    coulomb = std = breakaway = sliding = 0.0
    if pressure is not None:
        velocity = 0.0 if fault or at_rest else sample.velocity
        friction = actuator_friction(parameters.seals, pressure.chamber_a, pressure.chamber_b, velocity)
        coulomb, std = friction.coulomb_friction, friction.coulomb_friction_std
        sliding = coulomb + friction.velocity_friction
        breakaway = coulomb + friction.stiction if settings.use_stiction else coulomb
        if not friction.in_identified_range:
            status |= _OUTSIDE_IDENTIFIED_RANGE

    force_known = force is not None and not status & _FORCE_STALE
    if fault or pressure is None or (at_rest and not force_known):
        acting = (FrictionState.UNKNOWN, 0, 0.0)
    else:
        force_sum = force.force if force is not None else 0.0
        acting = state_friction(sample.velocity, force_sum, at_rest, sliding, breakaway)

    estimate = FrictionEstimate(
        sample.stamp, coulomb, std, breakaway, acting[2], acting[0], acting[1], status, input_age
    )
    return EstimatorState(sample.stamp, at_rest, pressure, force), estimate


def _usable_pressure(
    settings: EstimatorSettings, newest: Pressure | None, last: Pressure | None
) -> tuple[Pressure | None, int]:
    if newest is None:
        return last, _PRESSURE_MISSING if last is None else 0
    a, b = newest.chamber_a, newest.chamber_b
    if settings.pressure_min <= a <= settings.pressure_max and settings.pressure_min <= b <= settings.pressure_max:
        return newest, 0
    fault = _PRESSURE_OUT_OF_RANGE if math.isfinite(a) and math.isfinite(b) else _PRESSURE_NOT_FINITE
    return last, fault | (_PRESSURE_MISSING if last is None else 0)


def _usable_force(settings: EstimatorSettings, newest: Force | None, last: Force | None) -> tuple[Force | None, int]:
    if newest is None:
        return last, _FORCE_MISSING if last is None else 0
    if abs(newest.force) <= settings.force_max:
        return newest, 0
    fault = _FORCE_OUT_OF_RANGE if math.isfinite(newest.force) else _FORCE_NOT_FINITE
    return last, fault | (_FORCE_MISSING if last is None else 0)


def _velocity_fault(settings: EstimatorSettings, velocity: float) -> int:
    if abs(velocity) <= settings.velocity_max:
        return 0
    return _VELOCITY_OUT_OF_RANGE if math.isfinite(velocity) else _VELOCITY_NOT_FINITE
