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
from seal_friction_ros.core.foundation.compiled import compiled, for_compiler
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
    """Gains and limits for compiled code."""

    controller: ServoController
    pressure: float  # G [m^3/(s Pa)]
    valve_delay: float  # tau [s]
    force_max: float  # [N] of the supply pressure
    reach: float  # largest reference position [m]
    period: float  # sample time [s]


class Measurement(NamedTuple):
    """Inputs of the controller from the cylinder, units as in `ServoOutputs`."""

    position: float
    velocity: float
    pressure_a: float
    pressure_b: float


class ControllerState(NamedTuple):
    """State of the controller between two samples."""

    reference: float  # [m] last limited reference position
    integral: float  # [N]


class Command(NamedTuple):
    """Outputs of the controller."""

    spool: float  # [-] -1 to 1
    force: float  # [N] force command of the position loop, with feed-forward
    limited: int  # bits of `Limited`


def gains(controller: ServoController, c: Constants, period: float) -> Gains:
    """Gains and limits for a plant and a sample time [s]."""
    valve, cylinder = c.valve, c.cylinder
    return Gains(
        controller=for_compiler(controller),
        pressure=controller.force_bandwidth * cylinder.mid_volume / (2.0 * cylinder.bulk_modulus),
        valve_delay=2.0 * valve.damping_ratio / valve.natural_frequency + 0.5 * period,
        force_max=cylinder.area * (valve.supply_pressure - valve.return_pressure),
        reach=max(cylinder.limit - controller.stop_distance, 0.0),
        period=period,
    )


@compiled
def limit_reference(g: Gains, last: float, reference: Setpoint) -> tuple[Setpoint, int]:
    """Reference within the limits, from the last position ``last`` [m], and bits of `Limited`."""
    position, velocity, acceleration = reference
    if not (math.isfinite(position) and math.isfinite(velocity) and math.isfinite(acceleration)):
        return Setpoint(last, 0.0, 0.0), 1
    speed_max, acceleration_max, limited = g.controller.reference_speed_max, g.controller.reference_acceleration_max, 0
    if abs(position) > g.reach:
        position, velocity, acceleration, limited = math.copysign(g.reach, position), 0.0, 0.0, 2
    elif abs(velocity) > speed_max or abs(acceleration) > acceleration_max:
        velocity = min(max(velocity, -speed_max), speed_max)
        acceleration = min(max(acceleration, -acceleration_max), acceleration_max)
        limited = 4
    way = speed_max * g.period
    if abs(position - last) > way * (1.0 + 1e-9):
        direction = math.copysign(1.0, position - last)
        return Setpoint(last + direction * way, direction * speed_max, 0.0), limited | 4
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
    valve, area, load, k = c.valve, c.cylinder.area, c.load, g.controller
    setpoint, limited = limit_reference(g, state.reference, reference)
    if not math.isfinite(feedforward):
        feedforward, limited = 0.0, limited | 8
    error = setpoint.position - measured.position
    integral = state.integral + k.integral_gain * error * g.period
    inertia, viscous = load.mass * setpoint.acceleration, load.viscous_damping * setpoint.velocity
    known = inertia + viscous + load.spring_stiffness * (setpoint.position - load.spring_position)
    damping = k.velocity_gain * (setpoint.velocity - measured.velocity)
    unlimited = k.position_gain * error + damping + integral + known + feedforward
    force = min(max(unlimited, -g.force_max), g.force_max)
    if force != unlimited:
        limited |= 16

    load_pressure = measured.pressure_a - measured.pressure_b
    alpha = k.velocity_compensation
    speed = alpha * measured.velocity + (1.0 - alpha) * setpoint.velocity + g.valve_delay * setpoint.acceleration
    flow = area * speed + g.pressure * (force / area - load_pressure)
    drop = valve.supply_pressure - valve.return_pressure - math.copysign(load_pressure, flow * load_pressure)
    opening = flow / (valve.orifice_gain * math.sqrt(max(drop, 2.0 * valve.transition_pressure) / 2.0))
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
    valve, cylinder, load, k = c.valve, c.cylinder, c.load, g.controller
    drop = max(valve.supply_pressure - valve.return_pressure, 2.0 * valve.transition_pressure)
    flow_gain = valve.orifice_gain * math.sqrt(drop / 2.0)
    leakage = cylinder.internal_leakage + 0.5 * cylinder.external_leakage + valve.null_leakage
    stiffness = 2.0 * cylinder.bulk_modulus / cylinder.mid_volume
    area, w = cylinder.area, valve.natural_frequency
    plant = np.zeros((6, 6))
    plant[0, 1] = 1.0
    plant[1, :3] = -load.spring_stiffness / load.mass, -load.viscous_damping / load.mass, area / load.mass
    plant[2, 1:4] = -stiffness * area, -stiffness * leakage, stiffness * flow_gain
    plant[3, 4] = w
    plant[4, 3:6] = -w, -2.0 * valve.damping_ratio * w, w
    if held:
        plant[:2] = plant[:, :2] = 0.0
    sampled = expm(plant * g.period)[:5]  # last column: the command, held

    by_force = g.pressure / area / flow_gain
    by_position = -by_force * (k.position_gain + k.integral_gain * g.period)
    by_velocity = -by_force * k.velocity_gain + k.velocity_compensation * area / flow_gain
    feedback = np.array([by_position, by_velocity, -g.pressure / flow_gain, 0.0, 0.0, by_force])
    matrix = np.zeros((6, 6))
    matrix[:5, :5] = sampled[:, :5]
    matrix[:5] += np.outer(sampled[:, 5], feedback)
    matrix[5, 0], matrix[5, 5] = -k.integral_gain * g.period, float(k.integral_gain > 0.0)
    return matrix


def spectral_radius(g: Gains, c: Constants) -> float:
    """Largest eigenvalue magnitude of `transition_matrix`, rod free or held (force loop alone); stable below 1."""
    free = np.linalg.eigvals(transition_matrix(g, c))
    held = np.linalg.eigvals(transition_matrix(g, c, held=True)[2:5, 2:5])
    return float(np.abs(np.concatenate([free, held])).max())
