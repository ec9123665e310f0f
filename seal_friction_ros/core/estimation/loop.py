"""One step of a control loop that has all samples at one moment: `pipeline.receive` for each of them.

`api.Estimator.step` takes it, and `seal_friction export` translates it, with `friction_on_rod`, which has no state.
"""

import math
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.estimator import EstimatorParameters
from seal_friction_ros.core.estimation.pipeline import ZERO_CELSIUS, receive
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.friction.actuator import at_temperature, breakaway_in, friction_of_seals
from seal_friction_ros.core.friction.states import UNKNOWN, StateFriction, sign, state_friction
from seal_friction_ros.core.friction.temperature import COLDEST, HOTTEST
from seal_friction_ros.core.messages.records import Force, Pressure, ServoReference, Temperature, Velocity


class LoopSample(NamedTuple):
    """What a loop knows at one moment. NaN: no new sample of this input (of both pressures, for ``pressure_a``)."""

    stamp: int  # [ns] of the clock of the loop, which never goes back
    velocity: float  # [m/s] of the rod, positive on extension
    pressure_a: float  # [Pa, gauge]
    pressure_b: float  # [Pa, gauge]
    force_sum: float = math.nan  # [N] every axial force on the moving mass except seal friction
    reference_velocity: float = math.nan  # [m/s] wanted
    reference_acceleration: float = math.nan  # [m/s^2] wanted
    temperature: float = math.nan  # [degC] of the seals


def receive_sample(parameters: Any, state: Any, sample: LoopSample, emit: Any) -> None:
    """Take one sample: the inputs that are new, then the velocity, which makes the answers; see `pipeline.receive`."""
    stamp = sample.stamp
    if not math.isnan(sample.pressure_a):
        receive(parameters, state, Pressure(stamp, sample.pressure_a, sample.pressure_b), stamp, emit)
    if not math.isnan(sample.force_sum):
        receive(parameters, state, Force(stamp, sample.force_sum), stamp, emit)
    if not math.isnan(sample.temperature):
        receive(parameters, state, Temperature(stamp, sample.temperature), stamp, emit)
    if not math.isnan(sample.reference_velocity):
        wanted = ServoReference(stamp, 0.0, sample.reference_velocity, sample.reference_acceleration)
        receive(parameters, state, wanted, stamp, emit)
    receive(parameters, state, Velocity(stamp, sample.velocity), stamp, emit)


class RodLoad(NamedTuple):
    """What a simulated plant knows of its rod at one moment."""

    velocity: float  # [m/s] positive on extension
    pressure_a: float  # [Pa, gauge]
    pressure_b: float  # [Pa, gauge]
    force_sum: float = 0.0  # [N] every axial force on the moving mass except seal friction; counts at rest only
    temperature: float = math.nan  # [degC] of the seals; NaN, or not 150 to 600 K: that of the seal file


def friction_on_rod(parameters: EstimatorParameters, load: RodLoad) -> StateFriction:
    """Friction of the seals on a rod by the seal files, without adaptation and elasticity: `states.state_friction`.

    The rod rests at a speed of ``stick_velocity`` and below; a plant that never rests may set that to 0. Velocity and
    pressures count up to ``velocity_max``, ``pressure_min`` and ``pressure_max``; a temperature outside 150 to 600 K is
    that of the seal file. No status tells of these limits. The state is UNKNOWN and the force 0 N where another number
    is not finite.
    """
    if not math.isfinite(load.velocity + load.pressure_a + load.pressure_b + load.force_sum):
        return StateFriction(UNKNOWN, 0, 0.0)
    settings = parameters.settings
    at_rest = abs(load.velocity) <= settings.stick_velocity
    velocity = 0.0 if at_rest else between(-settings.velocity_max, load.velocity, settings.velocity_max)
    pressure_a = between(settings.pressure_min, load.pressure_a, settings.pressure_max)
    pressure_b = between(settings.pressure_min, load.pressure_b, settings.pressure_max)
    friction = friction_of_seals(parameters.seal_numbers, pressure_a, pressure_b, velocity)
    if parameters.has_temperature_scale:
        kelvin = load.temperature + ZERO_CELSIUS
        if not COLDEST <= kelvin <= HOTTEST:
            kelvin = parameters.temperature_scale.reference
        friction = at_temperature(friction, parameters.temperature_scale, kelvin)
    ahead = sign(load.force_sum if at_rest else velocity)
    breakaway = breakaway_in(friction, ahead, with_stiction=settings.use_stiction)
    sliding = friction.coulomb_friction + friction.velocity_friction
    return state_friction(velocity, load.force_sum, at_rest, sliding, breakaway)
