r"""Position loop over a load-pressure (force) loop, with a friction feed-forward.

.. math::
    F &= K_p (x_r - x) + K_d (v_r - v) + K_i \textstyle\int (x_r - x) + m a_r + b v_r + k (x_r - x_k) + F_{ff} \\
    Q &= A (\alpha v + (1 - \alpha) v_r + \tau a_r) + G (F / A - (p_a - p_b)), \qquad G = \omega_F V_t / (4 \beta) \\
    u &= Q / (K \sqrt{(p_s - p_r - \mathrm{sgn}(Q) p_L) / 2})

Inner loop: at standstill the load pressure follows F / A with the bandwidth omega_F. alpha compensates the natural
velocity feedback of a force-controlled cylinder; the remaining share acts on the velocity error as damping,
(1 - alpha) A^2 / G. tau = 2 zeta / omega + T / 2 is the delay of spool and sampling. The last line inverts the orifice.

Source: [Merritt1967]_ chapter 6 for the orifice and V_t / (4 beta), [Alleyne1999]_ for force loop and velocity
feedback; their arrangement here is our choice.
"""

import math
from dataclasses import dataclass
from enum import IntFlag
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.servo.motions import Setpoint
from seal_friction_ros.core.servo.plant import Constants


class Limited(IntFlag):
    """Fault or limit of a reference, a feed-forward or a command; 0: none."""

    REFERENCE_NOT_FINITE = 1
    """the last good position is held"""
    REFERENCE_OUT_OF_STROKE = 2
    """clamped short of the stops"""
    REFERENCE_TOO_FAST = 4
    """position follows at the largest speed; velocity or acceleration clamped"""
    FEEDFORWARD_NOT_FINITE = 8
    """counts as 0 N"""
    FORCE = 16
    """force command clamped to the force of the supply pressure"""
    SPOOL = 32
    """spool command clamped to full opening"""


@dataclass(frozen=True)
class ServoController(CheckedParameters):
    """Gains and limits of the controller."""

    position_gain: float = parameter(1e5, unit='N/m', lower=0.0, upper=1e12, description='K_p.')
    velocity_gain: float = parameter(300.0, unit='N s/m', lower=0.0, upper=1e9, description='K_d.')
    integral_gain: float = parameter(
        0.0, unit='N/(m s)', lower=0.0, upper=1e12, description='K_i; with stiction an integrator hunts.'
    )
    force_bandwidth: float = parameter(
        500.0, unit='rad/s', lower=1.0, upper=1e5, description='Bandwidth of the load-pressure loop at standstill.'
    )
    velocity_compensation: float = parameter(
        0.8, unit='1', lower=0.0, upper=1.0, description='alpha, share of the rod flow in the valve command.'
    )
    reference_speed_max: float = parameter(
        0.2, unit='m/s', lower=1e-6, upper=10.0, description='A faster reference is followed at this speed.'
    )
    reference_acceleration_max: float = parameter(
        50.0, unit='m/s2', lower=1e-3, upper=1e4, description='A larger acceleration of the reference is clamped.'
    )
    stop_distance: float = parameter(
        1e-3, unit='m', lower=0.0, upper=1.0, description='Smallest distance of the reference from the end stops.'
    )


class Gains(NamedTuple):
    """Gains and limits for compiled code, units as in `ServoController`."""

    position: float
    velocity: float
    integral: float
    pressure: float
    """G [m^3/(s Pa)]"""
    compensation: float
    valve_delay: float
    """tau [s]"""
    force_max: float
    speed_max: float
    acceleration_max: float
    reach: float
    """largest reference position [m]"""
    period: float
    """sample time [s]"""


class Measurement(NamedTuple):
    """Inputs of the controller from the cylinder, units as in `ServoOutputs`."""

    position: float
    velocity: float
    pressure_a: float
    pressure_b: float


class ControllerState(NamedTuple):
    """State of the controller between two samples."""

    reference: float
    """[m] last limited reference position"""
    integral: float
    """[N]"""


class Command(NamedTuple):
    """Outputs of the controller."""

    spool: float
    """[-] -1 to 1"""
    force: float
    """[N] force command of the position loop, with feed-forward"""
    limited: int
    """bits of `Limited`"""


def gains(controller: ServoController, c: Constants, period: float) -> Gains:
    """Gains and limits for a plant and a sample time [s]."""
    return Gains(
        position=controller.position_gain,
        velocity=controller.velocity_gain,
        integral=controller.integral_gain,
        pressure=controller.force_bandwidth * c.mid_volume / (2.0 * c.bulk_modulus),
        compensation=controller.velocity_compensation,
        valve_delay=2.0 * c.spool_damping / c.spool_frequency + 0.5 * period,
        force_max=c.area * (c.supply - c.ret),
        speed_max=controller.reference_speed_max,
        acceleration_max=controller.reference_acceleration_max,
        reach=max(c.limit - controller.stop_distance, 0.0),
        period=period,
    )


@compiled
def limit_reference(g: Gains, last: float, reference: Setpoint) -> tuple[Setpoint, int]:
    """Reference within the limits, from the last position ``last`` [m], and bits of `Limited`."""
    if not (
        math.isfinite(reference.position)
        and math.isfinite(reference.velocity)
        and math.isfinite(reference.acceleration)
    ):
        return Setpoint(last, 0.0, 0.0), 1
    if abs(reference.position) > g.reach:
        position, velocity, acceleration, limited = math.copysign(g.reach, reference.position), 0.0, 0.0, 2
    else:
        position, limited = reference.position, 0
        velocity = min(max(reference.velocity, -g.speed_max), g.speed_max)
        acceleration = min(max(reference.acceleration, -g.acceleration_max), g.acceleration_max)
        if velocity != reference.velocity or acceleration != reference.acceleration:
            limited = 4
    way = g.speed_max * g.period
    if abs(position - last) > way * (1.0 + 1e-9):
        direction = math.copysign(1.0, position - last)
        return Setpoint(last + direction * way, direction * g.speed_max, 0.0), limited | 4
    return Setpoint(position, velocity, acceleration), limited


@compiled
def control(
    g: Gains, c: Constants, state: ControllerState, measured: Measurement, reference: Setpoint, feedforward: float
) -> tuple[ControllerState, Command]:
    """One sample of the controller.

    Args:
        g: Gains.
        c: Model of valve, cylinder and load.
        state: State after the previous sample.
        measured: Position, velocity and pressures, all finite.
        reference: Setpoint; any number, also not finite.
        feedforward: Friction feed-forward [N], positive on extension; any number, also not finite.

    Returns:
        The next state and the spool command.
    """
    setpoint, limited = limit_reference(g, state.reference, reference)
    if not math.isfinite(feedforward):
        feedforward, limited = 0.0, limited | 8
    error = setpoint.position - measured.position
    integral = state.integral + g.integral * error * g.period
    load = (
        c.mass * setpoint.acceleration
        + c.damping * setpoint.velocity
        + c.stiffness * (setpoint.position - c.spring_position)
    )
    unlimited = (
        g.position * error + g.velocity * (setpoint.velocity - measured.velocity) + integral + load + feedforward
    )
    force = min(max(unlimited, -g.force_max), g.force_max)
    if force != unlimited:
        limited |= 16

    load_pressure = measured.pressure_a - measured.pressure_b
    speed = g.compensation * measured.velocity + (1.0 - g.compensation) * setpoint.velocity
    speed += g.valve_delay * setpoint.acceleration
    flow = c.area * speed + g.pressure * (force / c.area - load_pressure)
    drop = c.supply - c.ret - math.copysign(load_pressure, flow * load_pressure)
    drop = max(drop, 2.0 * c.transition)
    opening = flow / (c.orifice_gain * math.sqrt(drop / 2.0))
    spool = min(max(opening, -1.0), 1.0)
    if spool != opening:
        limited |= 32
    if force != unlimited or spool != opening:
        integral = state.integral
    return ControllerState(setpoint.position, integral), Command(spool, force, limited)


def transition_matrix(g: Gains, c: Constants, held: bool = False) -> FloatArray:
    r"""State transition matrix of the linearised servo over one sample, in mid-stroke, at null, without friction.

    State: x, v, p_L, s, s'/omega, integral. The plant between two samples is exact (matrix exponential). With ``held``
    the rod does not move.

    .. math:: \dot p_L = \frac{4 \beta}{V_t} (K_q s - A v - K_{c} p_L), \quad K_q = K \sqrt{(p_s - p_r)/2}

    Source: [Merritt1967]_ chapter 6, linearised.
    """
    flow_gain = c.orifice_gain * math.sqrt(max(c.supply - c.ret, 2.0 * c.transition) / 2.0)
    leakage = c.internal_leakage + 0.5 * c.external_leakage + c.null_leakage
    stiffness = 2.0 * c.bulk_modulus / c.mid_volume
    w = c.spool_frequency
    plant = np.zeros((6, 6))
    plant[0, 1] = 1.0
    plant[1, :3] = -c.stiffness / c.mass, -c.damping / c.mass, c.area / c.mass
    plant[2, 1:4] = -stiffness * c.area, -stiffness * leakage, stiffness * flow_gain
    plant[3, 4] = w
    plant[4, 3:6] = -w, -2.0 * c.spool_damping * w, w
    if held:
        plant[:2] = plant[:, :2] = 0.0
    sampled = expm(plant * g.period)[:5]  # last column: the command, held

    feedback = np.zeros(6)
    by_force = g.pressure / c.area / flow_gain
    feedback[0] = -by_force * (g.position + g.integral * g.period)
    feedback[1] = -by_force * g.velocity + g.compensation * c.area / flow_gain
    feedback[2] = -g.pressure / flow_gain
    feedback[5] = by_force
    matrix = np.zeros((6, 6))
    matrix[:5, :5] = sampled[:, :5]
    matrix[:5] += np.outer(sampled[:, 5], feedback)
    matrix[5, 0], matrix[5, 5] = -g.integral * g.period, 1.0 if g.integral > 0.0 else 0.0
    return matrix


def spectral_radius(g: Gains, c: Constants) -> float:
    """Largest eigenvalue magnitude of `transition_matrix`, rod free or held (force loop alone); stable below 1."""
    free = np.linalg.eigvals(transition_matrix(g, c))
    held = np.linalg.eigvals(transition_matrix(g, c, held=True)[2:5, 2:5])
    return float(np.abs(np.concatenate([free, held])).max())
