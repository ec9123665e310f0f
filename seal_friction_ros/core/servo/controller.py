r"""Position loop over a load-pressure (force) loop, with a friction feed-forward.

.. math::
    F &= K_p (x_r - x) + K_d (v_r - v) + K_i \textstyle\int (x_r - x) + m a_r + b v_r + k (x_r - x_k) + F_{ff} \\
    p_L &= p_a - \alpha_A p_b, \quad \alpha_A = A_b / A_a, \quad v_c = \alpha v + (1 - \alpha) v_r + \tau a_r

Inner loop: at standstill the load pressure p_L follows F / A_a with the bandwidth omega_F; the valve opening is that of
`oil_opening` or `air_opening`. alpha compensates the natural velocity feedback of a force-controlled cylinder; the
remaining share acts on the velocity error as damping. tau = 2 zeta / omega + T / 2 is the delay of spool and sampling.

Source: [Merritt1967]_ chapter 6 for the orifice and V_t / (4 beta), [Alleyne1999]_ for force loop and velocity
feedback, [Jelali2003]_ chapter 4 for the load pressure of two areas; their arrangement here is our choice.
"""

import math
from dataclasses import dataclass
from enum import IntFlag
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import chosen_by_type, compilable, for_compiler
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.servo.cylinder import AMBIENT, Cylinder
from seal_friction_ros.core.servo.hydraulics import ServoValve
from seal_friction_ros.core.servo.motions import Setpoint
from seal_friction_ros.core.servo.plant import Constants
from seal_friction_ros.core.servo.pneumatics import (
    ADIABATIC_INDEX,
    REFERENCE_PRESSURE,
    PneumaticValve,
    air_pressures_at_rest,
    flow_function,
)


class Limited(IntFlag):
    """Fault or limit of a reference, a feed-forward or a command; 0: none."""

    REFERENCE_NOT_FINITE = 1  # the last good position is held
    REFERENCE_OUT_OF_STROKE = 2  # clamped short of the stops
    REFERENCE_TOO_FAST = 4  # position follows at the largest speed; velocity or acceleration clamped
    FEEDFORWARD_NOT_FINITE = 8  # counts as 0 N
    FORCE = 16  # force command clamped to the force of the supply pressure
    SPOOL = 32  # spool command clamped to full opening


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
    valve_delay: float  # tau [s]
    extending_force_max: float  # [N] of the supply pressure
    retracting_force_max: float  # [N] likewise, a magnitude
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
    drop = valve.supply_pressure - valve.return_pressure
    return Gains(
        controller=for_compiler(controller),
        valve_delay=2.0 * valve.damping_ratio / valve.natural_frequency + 0.5 * period,
        extending_force_max=cylinder.area_b * drop + cylinder.rod_area * valve.supply_pressure,
        retracting_force_max=cylinder.area_b * drop - cylinder.rod_area * valve.return_pressure,
        reach=max(cylinder.limit - controller.stop_distance, 0.0),
        period=period,
    )


@compilable
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


@compilable
def oil_opening(
    valve: ServoValve, cylinder: Cylinder, bandwidth: float, measured: Measurement, force: float, speed: float
) -> float:
    r"""Opening of the valve for a force command with oil [-], not limited.

    .. math::
        Q &= A_a v_c + G (F / A_a - p_L), \qquad G = \omega_F / [\beta (1 / V_a + \alpha_A^2 / V_b)] \\
        s &= Q / (K \sqrt{\Delta p / (1 + \alpha_A^3)}), \qquad
            \Delta p = p_s - \alpha_A p_r - p_L \;(Q > 0), \quad \alpha_A p_s - p_r + p_L \;(Q < 0)

    Q is the flow into chamber a; alpha_A Q leaves chamber b. V_a and V_b are those in mid-stroke. The last line inverts
    both orifices at even speed.

    ``bandwidth`` is omega_F [rad/s], ``force`` the command F [N], ``speed`` v_c [m/s].
    """
    ratio = cylinder.area_ratio
    both = 1.0 + ratio * ratio * (cylinder.mid_volume_a / cylinder.mid_volume_b)
    gain = bandwidth * cylinder.mid_volume_a / (both * cylinder.bulk_modulus)
    load_pressure = measured.pressure_a - ratio * measured.pressure_b
    flow = cylinder.area_a * speed + gain * (force / cylinder.area_a - load_pressure)
    if flow > 0.0:
        drop = valve.supply_pressure - ratio * valve.return_pressure - load_pressure
    else:
        drop = ratio * valve.supply_pressure - valve.return_pressure + load_pressure
    share = 1.0 + ratio * ratio * ratio
    return flow / (valve.orifice_gain * math.sqrt(max(drop, 2.0 * valve.transition_pressure) / share))


class LoadPressureGains(NamedTuple):
    """Linear model of the load pressure: dp_L/dt = opening s - motion v - leakage p_L."""

    opening: float  # [Pa/s]
    motion: float  # [Pa/m]
    leakage: float  # [1/s]


@compilable
def air_gains(
    valve: PneumaticValve, cylinder: Cylinder, pressures: tuple[float, float], position: float, extends: bool
) -> LoadPressureGains:
    r"""Gains of the load pressure with air, adiabatic, without leakage.

    .. math::
        \dot p_L &= \gamma \Big[ \frac{p_0 C f_a}{V_a} + \alpha_A \frac{p_0 C f_b}{V_b} \Big] s
            - \gamma \Big[ \frac{p_a A_a}{V_a} + \alpha_A \frac{p_b A_b}{V_b} \Big] v, \qquad
        f = p_1 \psi(p_2 / p_1) / p_0

    with absolute pressures, supply to chamber a and chamber b to exhaust while the rod ``extends``, and the other way
    round. A tenth of the supply pressure is the least f p_0, so that a chamber that is full, or fuller than its source
    (psi < 0), does not ask for an infinite opening (our choice). The pressures of both chambers are in [Pa, gauge], the
    position is in [m].

    Source: linearising feedback as in [Richer2000]_.
    """
    a, b, supply = pressures[0] + AMBIENT, pressures[1] + AMBIENT, valve.supply_pressure + AMBIENT
    least, ratio = 0.1 * supply, cylinder.area_ratio
    volume_a = cylinder.mid_volume_a + cylinder.area_a * position
    volume_b = cylinder.mid_volume_b - cylinder.area_b * position
    if extends:
        flow_a, flow_b = supply * flow_function(valve, a / supply), b * flow_function(valve, AMBIENT / b)
    else:
        flow_a, flow_b = a * flow_function(valve, AMBIENT / a), supply * flow_function(valve, b / supply)
    by_opening = max(flow_a, least) / volume_a + ratio * max(flow_b, least) / volume_b
    by_motion = a * cylinder.area_a / volume_a + ratio * b * cylinder.area_b / volume_b
    conductance = ADIABATIC_INDEX * REFERENCE_PRESSURE * valve.sonic_conductance
    return LoadPressureGains(conductance * by_opening, ADIABATIC_INDEX * by_motion, 0.0)


@compilable
def air_opening(
    valve: PneumaticValve, cylinder: Cylinder, bandwidth: float, measured: Measurement, force: float, speed: float
) -> float:
    """Opening of the valve for a force command with air [-], not limited; arguments as of `oil_opening`.

    With the gains of `air_gains`: s = [omega_F (F / A_a - p_L) + motion v_c] / opening.
    """
    pressures = measured.pressure_a, measured.pressure_b
    load_pressure = pressures[0] - cylinder.area_ratio * pressures[1]
    motion = air_gains(valve, cylinder, pressures, measured.position, True).motion
    wanted = bandwidth * (force / cylinder.area_a - load_pressure) + motion * speed
    return wanted / air_gains(valve, cylinder, pressures, measured.position, wanted > 0.0).opening


valve_opening = chosen_by_type({ServoValve: oil_opening, PneumaticValve: air_opening})
"""Opening of the valve for a force command [-], not limited."""


@compilable
def control(
    g: Gains, c: Constants, state: ControllerState, measured: Measurement, reference: Setpoint, feedforward: float
) -> tuple[ControllerState, Command]:
    """One sample of the controller with the model of valve, cylinder and load ``c``; the next state and the command.

    ``measured`` is finite; the reference and the ``feedforward`` [N], positive on extension, may be any number.
    """
    load, k = c.load, g.controller
    setpoint, limited = limit_reference(g, state.reference, reference)
    if not math.isfinite(feedforward):
        feedforward, limited = 0.0, limited | 8
    error = setpoint.position - measured.position
    integral = state.integral + k.integral_gain * error * g.period
    inertia, viscous = load.mass * setpoint.acceleration, load.viscous_damping * setpoint.velocity
    model_force = inertia + viscous + load.spring_stiffness * (setpoint.position - load.spring_position)
    damping = k.velocity_gain * (setpoint.velocity - measured.velocity)
    unlimited = k.position_gain * error + damping + integral + model_force + feedforward
    force = min(max(unlimited, -g.retracting_force_max), g.extending_force_max)
    if force != unlimited:
        limited |= 16

    alpha = k.velocity_compensation
    speed = alpha * measured.velocity + (1.0 - alpha) * setpoint.velocity + g.valve_delay * setpoint.acceleration
    opening = valve_opening(c.valve, c.cylinder, k.force_bandwidth, measured, force, speed)
    spool = min(max(opening, -1.0), 1.0)
    if spool != opening:
        limited |= 32
    if force != unlimited or spool != opening:
        integral = state.integral
    return ControllerState(setpoint.position, integral), Command(spool, force, limited)


def oil_gains(valve: ServoValve, cylinder: Cylinder) -> LoadPressureGains:
    r"""Gains of the load pressure with oil, at null, in mid-stroke, without load.

    .. math:: \dot p_L = \beta (1 / V_a + \alpha_A^2 / V_b) (K_q s - A_a v - K_c p_L)

    K_q is the flow gain of one land at the pressure drop of even speed. Leakage of a single-rod cylinder is taken as
    that of a balanced one (our choice: it only damps).

    Source: [Merritt1967]_ chapter 6, linearised.
    """
    ratio = cylinder.area_ratio
    stiffness = cylinder.bulk_modulus * (1.0 / cylinder.mid_volume_a + ratio**2 / cylinder.mid_volume_b)
    drop = max(valve.supply_pressure - ratio * valve.return_pressure, 2.0 * valve.transition_pressure)
    flow_gain = valve.orifice_gain * math.sqrt(drop / (1.0 + ratio**3))
    leakage = cylinder.internal_leakage + 0.5 * cylinder.external_leakage + valve.null_leakage
    return LoadPressureGains(stiffness * flow_gain, stiffness * cylinder.area_a, stiffness * leakage)


def air_gains_at_null(valve: PneumaticValve, cylinder: Cylinder) -> LoadPressureGains:
    """Gains of the load pressure with air, at null, in mid-stroke, without load."""
    return air_gains(valve, cylinder, air_pressures_at_rest(valve, cylinder), 0.0, True)


load_pressure_gains = chosen_by_type({ServoValve: oil_gains, PneumaticValve: air_gains_at_null})
"""Gains of the load pressure, at null, in mid-stroke, without load."""


def transition_matrix(g: Gains, c: Constants, held: bool = False) -> FloatArray:
    r"""State transition matrix of the linearised servo over one sample, in mid-stroke, at null, without friction.

    State: x, v, p_L, s, s'/omega, integral. The plant between two samples is exact (matrix exponential). With ``held``
    the rod does not move. p_L follows `load_pressure_gains`.
    """
    valve, load, k, pressure = c.valve, c.load, g.controller, load_pressure_gains(c.valve, c.cylinder)
    area, w = c.cylinder.area_a, valve.natural_frequency
    plant = np.zeros((6, 6))
    plant[0, 1] = 1.0
    plant[1, :3] = -load.spring_stiffness / load.mass, -load.viscous_damping / load.mass, area / load.mass
    plant[2, 1:4] = -pressure.motion, -pressure.leakage, pressure.opening
    plant[3, 4] = w
    plant[4, 3:6] = -w, -2.0 * valve.damping_ratio * w, w
    if held:
        plant[:2] = plant[:, :2] = 0.0
    sampled = expm(plant * g.period)[:5]  # last column: the command, held

    by_load_pressure = k.force_bandwidth / pressure.opening
    by_force = by_load_pressure / area
    by_position = -by_force * (k.position_gain + k.integral_gain * g.period)
    by_velocity = -by_force * k.velocity_gain + k.velocity_compensation * pressure.motion / pressure.opening
    feedback = np.array([by_position, by_velocity, -by_load_pressure, 0.0, 0.0, by_force])
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
