"""Oil in valve and chambers: flows, pressures, energy.

Source: valve [Merritt1967]_ chapter 5, cylinder chapter 6; with two areas [Jelali2003]_ chapter 4. Our choices, none of
them in the sources:

- A chamber that is emptied faster than it is filled holds a cavity at vapour pressure (see `plant.chamber_pressures`).
- Below ``transition_pressure`` an orifice is laminar (see `signed_root`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.foundation.units import PSI
from seal_friction_ros.core.servo.cylinder import Cylinder


@dataclass(frozen=True)
class ServoValve(CheckedParameters):
    """Four-way servo valve with critical lap, and its supply pressure, which is not below the return pressure."""

    supply_pressure: float = parameter(1000.0 * PSI, unit='Pa', lower=0.0, upper=1e8, description='Supply, gauge.')
    return_pressure: float = parameter(1e5, unit='Pa', lower=0.0, upper=1e8, description='Return, gauge.')
    rated_flow: float = parameter(2.5e-5, unit='m3/s', lower=1e-8, upper=0.1, description='Fully open, at rated drop.')
    rated_pressure_drop: float = parameter(
        1000.0 * PSI, unit='Pa', lower=1e4, upper=1e8, description='Pressure drop over both lands for the rated flow.'
    )
    natural_frequency: float = parameter(1257.0, unit='rad/s', lower=1.0, upper=1e5, description='Spool, undamped.')
    damping_ratio: float = parameter(0.8, unit='1', lower=0.05, upper=10.0, description='Damping ratio of the spool.')
    null_leakage: float = parameter(
        6e-14, unit='m3/(s Pa)', lower=0.0, upper=1e-9, description='Laminar leakage of each of the four lands.'
    )
    transition_pressure: float = parameter(
        3e5, unit='Pa', lower=1e3, upper=1e7, description='Pressure drop below which an orifice is laminar.'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_order('supply_pressure', 'return_pressure', may_be_equal=True)

    @property
    def orifice_gain(self) -> float:
        """K of one fully open land, Q = K sqrt(dp) [m^3/(s Pa^0.5)]: each land takes half of the rated drop."""
        return self.rated_flow / math.sqrt(self.rated_pressure_drop / 2.0)


@compilable
def signed_root(drop: float, transition: float) -> float:
    r"""Root of a pressure drop with its sign, laminar (finite slope) near zero.

    .. math:: \sqrt{|\Delta p|}\,\mathrm{sgn}(\Delta p) \text{ for } |\Delta p| \ge p_t, \quad
        \sqrt{p_t}\, r (5 - r^2) / 4,\; r = \Delta p / p_t \text{ below}

    Source: two flow regimes as in [Ellman1999]_; the cubic, which meets value and slope of the root, is our choice.
    """
    if drop >= transition:
        return math.sqrt(drop)
    if drop <= -transition:
        return -math.sqrt(-drop)
    r = drop / transition
    return math.sqrt(transition) * r * (5.0 - r * r) / 4.0


@compilable
def port_flow(valve: ServoValve, opening: float, outside: float, pressure: float) -> float:
    """Flow into a chamber through one land [m^3/s]: sharp-edged orifice and null leakage.

    Source: [Merritt1967]_ chapter 5.
    """
    drop = outside - pressure
    return valve.orifice_gain * opening * signed_root(drop, valve.transition_pressure) + valve.null_leakage * drop


class ChamberRates(NamedTuple):
    """Time derivatives of the state of both chambers, and their power."""

    pressure_a: float  # [Pa/s] of the charge of chamber a
    pressure_b: float  # [Pa/s]
    temperature_a: float  # [K/s]; 0 of oil
    temperature_b: float  # [K/s]
    power_in: float  # [W] from supply, return and walls
    dissipated: float  # [W] in the lands and by leakage


@compilable
def oil_rates(
    valve: ServoValve, cylinder: Cylinder, enthalpies: tuple[float, float], y: Sequence[float]
) -> ChamberRates:
    r"""Rates of both chambers filled with oil, at the numbers ``y`` of a plant state.

    .. math::
        \dot p_a &= \beta / V_a\, (Q_a - C_i (p_a - p_b) - C_e p_a - A_a v), \quad V_a = V_{a,0} + A_a x \\
        \dot p_b &= \beta / V_b\, (Q_b + C_i (p_a - p_b) - C_e p_b + A_b v), \quad V_b = V_{b,0} - A_b x

    With constant bulk modulus a volume V of oil stores the energy V (H - p), with H(p) = beta (exp(p / beta) - 1) the
    enthalpy per volume at p, and a flow Q carries the power H Q. A flow through a land brings the enthalpy of the other
    side; the difference to the enthalpy of the chamber is dissipated in the land.

    Source: [Merritt1967]_ chapters 5 and 6, [Jelali2003]_ chapter 4; the energy is our derivation.
    """
    position, velocity, charge_a, charge_b, spool = y[0], y[1], y[2], y[3], y[4]
    beta, vapour = cylinder.bulk_modulus, cylinder.vapour
    a, b = max(charge_a, vapour), max(charge_b, vapour)
    to_a, to_b = max(spool, 0.0), max(-spool, 0.0)
    supply, ret = valve.supply_pressure, valve.return_pressure
    supply_a, return_a = port_flow(valve, to_a, supply, a), port_flow(valve, to_b, ret, a)
    supply_b, return_b = port_flow(valve, to_b, supply, b), port_flow(valve, to_a, ret, b)
    past_piston = cylinder.internal_leakage * (a - b)
    flow_a = supply_a + return_a - past_piston - cylinder.external_leakage * a
    flow_b = supply_b + return_b + past_piston - cylinder.external_leakage * b

    oil_a = cylinder.mid_volume_a + cylinder.area_a * position
    oil_b = cylinder.mid_volume_b - cylinder.area_b * position
    charge_flow_a = flow_a if charge_a >= vapour else flow_a * math.exp((vapour - charge_a) / beta)
    charge_flow_b = flow_b if charge_b >= vapour else flow_b * math.exp((vapour - charge_b) / beta)

    density_a, density_b = math.exp(a / beta), math.exp(b / beta)
    of_supply, of_return = enthalpies
    power_in = density_a * (supply_a * of_supply + return_a * of_return)
    power_in = power_in + density_b * (supply_b * of_supply + return_b * of_return)
    into_chambers = beta * ((density_a - 1.0) * flow_a + (density_b - 1.0) * flow_b)
    rate_a = beta / oil_a * (charge_flow_a - cylinder.area_a * velocity)
    rate_b = beta / oil_b * (charge_flow_b + cylinder.area_b * velocity)
    return ChamberRates(rate_a, rate_b, 0.0, 0.0, power_in, power_in - into_chambers)


@compilable
def oil_energy(_valve: ServoValve, cylinder: Cylinder, charge: float, volume: float) -> float:
    r"""Energy in one chamber [J]: V_oil (H(p) - p) - p V_cavity."""
    beta, pressure = cylinder.bulk_modulus, max(charge, cylinder.vapour)
    oil = volume * math.exp((charge - pressure) / beta)
    return oil * (beta * math.expm1(pressure / beta) - pressure) - pressure * (volume - oil)


def oil_pressures_at_rest(valve: ServoValve, cylinder: Cylinder) -> tuple[float, float]:
    r"""Pressures of a resting rod without load, valve closed [Pa, gauge].

    .. math:: p_b = \frac{(1 + \alpha)(p_s + p_r)}{2 (1 + \alpha^2)}, \quad p_a = \alpha p_b, \quad \alpha = A_b / A_a

    There the null leakage of the four lands moves as much volume into chamber a as leaves chamber b per area, and the
    pressures have no force (our derivation). A balanced cylinder has half the sum of supply and return in both.
    """
    ratio = cylinder.area_ratio
    b = (1.0 + ratio) * (valve.supply_pressure + valve.return_pressure) / (2.0 * (1.0 + ratio**2))
    return ratio * b, b


def oil_chamber_rate(valve: ServoValve, cylinder: Cylinder) -> float:
    """Largest rate of a chamber [1/s]: slope of a laminar orifice, 5/4 K / sqrt(p_t), and leakages, at its stop."""
    slope = 1.25 * valve.orifice_gain / math.sqrt(valve.transition_pressure)
    leakage = 2.0 * valve.null_leakage + 2.0 * cylinder.internal_leakage + cylinder.external_leakage
    return cylinder.bulk_modulus / cylinder.dead_volume * (slope + leakage)
