r"""Air in valve and chambers: ISO 6358 flow, pressure and temperature of the chambers, energy.

Source: valve [ISO6358]_, chambers [Beater2007]_ chapters 4 and 6. Air is an ideal gas; each chamber exchanges heat with
its walls. Without heat the change of state is adiabatic (polytropic with n = 1.4), with much heat isothermal (n = 1).
Our choices: above ``laminar_ratio`` the flow is linear in the pressures (see `iso6358_flow`); the seals of the piston
leak nothing; the walls keep the temperature of the supply; air that flows back from ambient has this temperature, too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.servo.cylinder import AMBIENT, Cylinder
from seal_friction_ros.core.servo.hydraulics import ChamberRates

GAS_CONSTANT = 288.0  # [J/(kg K)] R of air, ISO 6358
ADIABATIC_INDEX = 1.4  # [-] gamma of air
REFERENCE_PRESSURE = 1e5  # [Pa, absolute] of the standard reference atmosphere, ISO 8778
REFERENCE_TEMPERATURE = 293.15  # [K]
REFERENCE_DENSITY = 1.185  # [kg/m^3]
ENTHALPY = GAS_CONSTANT * ADIABATIC_INDEX / (ADIABATIC_INDEX - 1.0)  # [J/(kg K)] c_p


@dataclass(frozen=True)
class PneumaticValve(CheckedParameters):
    """Five-port proportional directional valve, its supply, and the air; it exhausts to ambient."""

    supply_pressure: float = parameter(6e5, unit='Pa', lower=0.0, upper=4e6, description='Supply, gauge.')
    sonic_conductance: float = parameter(
        2.8e-8, unit='m3/(s Pa)', lower=1e-11, upper=1e-5, description='C of one land, fully open.'
    )
    critical_pressure_ratio: float = parameter(
        0.3, unit='1', lower=0.05, upper=0.6, description='b: below this ratio of absolute pressures flow is choked.'
    )
    laminar_ratio: float = parameter(
        0.99, unit='1', lower=0.9, upper=0.9999, description='Above this pressure ratio flow is linear.'
    )
    null_conductance: float = parameter(
        3e-11, unit='m3/(s Pa)', lower=0.0, upper=1e-6, description='C of the leakage of each of the four lands.'
    )
    natural_frequency: float = parameter(600.0, unit='rad/s', lower=1.0, upper=1e5, description='Spool, undamped.')
    damping_ratio: float = parameter(0.8, unit='1', lower=0.05, upper=10.0, description='Damping ratio of the spool.')
    temperature: float = parameter(293.15, unit='K', lower=200.0, upper=400.0, description='Supply, walls, ambient.')
    heat_conductance: float = parameter(
        1.0, unit='W/K', lower=0.0, upper=1e5, description='Between the air of each chamber and its walls.'
    )

    @property
    def return_pressure(self) -> float:
        """Pressure of the exhaust [Pa, gauge]: ambient."""
        return 0.0


@compilable
def flow_function(valve: PneumaticValve, ratio: float) -> float:
    r"""Flow over choked flow [-] at a ratio r of downstream to upstream pressure (absolute).

    .. math::
        \psi = 1 \;(r \le b), \quad \sqrt{1 - \Big(\frac{r - b}{1 - b}\Big)^2} \;(b < r \le r_l), \quad
        \psi(r_l) \frac{1 - r}{1 - r_l} \;(r > r_l)

    Source: [ISO6358]_ part 1; the linear part above r_l avoids an infinite slope at r = 1, which is our choice.
    """
    b, linear_from = valve.critical_pressure_ratio, valve.laminar_ratio
    if ratio <= b:
        return 1.0
    share = (min(ratio, linear_from) - b) / (1.0 - b)
    full = math.sqrt(1.0 - share * share)
    return full if ratio <= linear_from else full * (1.0 - ratio) / (1.0 - linear_from)


@compilable
def iso6358_flow(
    valve: PneumaticValve,
    conductance: float,
    pressure_1: float,
    temperature_1: float,
    pressure_2: float,
    temperature_2: float,
) -> float:
    r"""Mass flow from side 1 to side 2 [kg/s], negative from side 2 to side 1.

    .. math:: \dot m = C p_1 \rho_0 \sqrt{T_0 / T_1}\, \psi(p_2 / p_1) \quad (p_1 \ge p_2)

    The conductance C is in [m^3/(s Pa)], the pressures, > 0, in [Pa, absolute], the temperatures in [K].

    Source: [ISO6358]_ part 1, with rho_0 and T_0 of ISO 8778.
    """
    if pressure_1 >= pressure_2:
        root = math.sqrt(REFERENCE_TEMPERATURE / temperature_1)
        return conductance * pressure_1 * REFERENCE_DENSITY * root * flow_function(valve, pressure_2 / pressure_1)
    root = math.sqrt(REFERENCE_TEMPERATURE / temperature_2)
    return -conductance * pressure_2 * REFERENCE_DENSITY * root * flow_function(valve, pressure_1 / pressure_2)


@compilable
def chamber_rates(
    valve: PneumaticValve,
    supply_opening: float,
    exhaust_opening: float,
    pressure: float,
    temperature: float,
    volume: float,
    growth: float,
) -> tuple[float, float, float]:
    r"""Rates of one chamber of air: pressure [Pa/s], temperature [K/s], power of air and heat into it [W].

    .. math::
        P &= c_p \textstyle\sum T_{up} \dot m + k (T_w - T), \qquad \dot m = \textstyle\sum \dot m_i \\
        \dot p &= [(\gamma - 1) P - \gamma p \dot V] / V \\
        \dot T &= T\, (\dot p / p + \dot V / V - R T \dot m / (p V))

    with the sum over the lands to supply and exhaust, whose openings [-] are 0 to 1, and T_up the temperature where the
    air comes from. Pressure in [Pa, gauge], temperature in [K], volume in [m^3], its ``growth`` in [m^3/s].

    Source: energy and mass of an ideal gas, [Beater2007]_ chapter 4.
    """
    absolute, outside = pressure + AMBIENT, valve.temperature
    conductance_in = valve.sonic_conductance * supply_opening + valve.null_conductance
    conductance_out = valve.sonic_conductance * exhaust_opening + valve.null_conductance
    from_supply = iso6358_flow(valve, conductance_in, valve.supply_pressure + AMBIENT, outside, absolute, temperature)
    from_exhaust = iso6358_flow(valve, conductance_out, AMBIENT, outside, absolute, temperature)
    power = valve.heat_conductance * (outside - temperature)
    power += ENTHALPY * from_supply * (outside if from_supply > 0.0 else temperature)
    power += ENTHALPY * from_exhaust * (outside if from_exhaust > 0.0 else temperature)
    mass_flow = from_supply + from_exhaust
    rate = ((ADIABATIC_INDEX - 1.0) * power - ADIABATIC_INDEX * absolute * growth) / volume
    exchange = GAS_CONSTANT * temperature * mass_flow / (absolute * volume)
    return rate, temperature * (rate / absolute + growth / volume - exchange), power


@compilable
def air_rates(
    valve: PneumaticValve, cylinder: Cylinder, _enthalpies: tuple[float, float], y: Sequence[float]
) -> ChamberRates:
    """Rates of both chambers filled with air, see `chamber_rates`. A throttle keeps the enthalpy."""
    position, velocity, spool = y[0], y[1], y[4]
    to_a, to_b = max(spool, 0.0), max(-spool, 0.0)
    volume_a = cylinder.mid_volume_a + cylinder.area_a * position
    volume_b = cylinder.mid_volume_b - cylinder.area_b * position
    rate_a, warming_a, power_a = chamber_rates(valve, to_a, to_b, y[2], y[8], volume_a, cylinder.area_a * velocity)
    rate_b, warming_b, power_b = chamber_rates(valve, to_b, to_a, y[3], y[9], volume_b, -cylinder.area_b * velocity)
    return ChamberRates(rate_a, rate_b, warming_a, warming_b, power_a + power_b, 0.0)


@compilable
def air_energy(_valve: PneumaticValve, _cylinder: Cylinder, pressure: float, volume: float) -> float:
    r"""Energy of the air in a chamber, and of the ambient air that the chamber displaces [J].

    .. math:: E = p V / (\gamma - 1) + p_0 V

    with the absolute pressure p and ambient pressure p_0, against which the piston works.
    """
    return ((pressure + AMBIENT) / (ADIABATIC_INDEX - 1.0) + AMBIENT) * volume


def air_pressures_at_rest(valve: PneumaticValve, cylinder: Cylinder) -> tuple[float, float]:
    r"""Pressures of a resting rod without load, valve closed [Pa, gauge]: chamber b at the balance of its leakage.

    There as much air leaks in from the supply as out to the exhaust. Chamber a has A_b / A_a of the gauge pressure of
    chamber b, so the pressures have no force.
    """
    low, high = 0.0, valve.supply_pressure
    for _ in range(60):
        middle = 0.5 * (low + high)
        flows = [
            iso6358_flow(valve, 1.0, p + AMBIENT, valve.temperature, q + AMBIENT, valve.temperature)
            for p, q in ((valve.supply_pressure, middle), (middle, 0.0))
        ]
        low, high = (middle, high) if flows[0] > flows[1] else (low, middle)
    return cylinder.area_ratio * low, low


def air_chamber_rate(valve: PneumaticValve, cylinder: Cylinder) -> float:
    """Largest rate of a chamber [1/s], at its stop: slope of one open land near equal pressures, and heat.

    The heat is that of the least air, at ambient pressure. Choked leakage has a smaller slope, 1, than any land near
    equal pressures: 4 and more within the bounds of the parameters.
    """
    ratio = valve.laminar_ratio
    slope = flow_function(valve, ratio) / (1.0 - ratio)
    flow = (valve.sonic_conductance + 2.0 * valve.null_conductance) * REFERENCE_PRESSURE * slope
    heat = valve.heat_conductance * (ADIABATIC_INDEX - 1.0) * valve.temperature / AMBIENT
    return (ADIABATIC_INDEX * flow + ADIABATIC_INDEX * heat) / cylinder.dead_volume
