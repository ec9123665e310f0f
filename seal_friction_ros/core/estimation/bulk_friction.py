"""Friction of an actuator at many moments at once: the laws of `core/coulomb.py` on arrays, with the same bits.

Sums, products, quotients and square roots are rounded the same way everywhere, so numpy computes those. Powers and
exponentials are not, so they are computed one by one by the C library, which Python asks, too. A law that is not known
here is asked one pressure at a time. The tests hold the two together.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.actuator import (
    ConstantCoulomb,
    CoulombLaw,
    MountedSeal,
    PhysicsBased,
    PressurePowerLaw,
    PriorArtChart,
    Seal,
    Uncertainty,
    VelocityTerms,
)
from seal_friction_ros.core.friction.friction_coefficient import CoefficientTable, FrictionCoefficientLaw, PowerLaw
from seal_friction_ros.core.friction.friction_map import FrictionMap
from seal_friction_ros.core.friction.geometry import contact_length, projected_area
from seal_friction_ros.core.friction.normal_force import AreaDeformationGain, NormalForceLaw, NormalForceTable


class ActuatorFrictions(NamedTuple):
    """`ActuatorFriction` at n moments; each of shape (n,)."""

    coulomb_friction: FloatArray
    """[N]"""
    coulomb_friction_std: FloatArray
    """[N]"""
    stiction: FloatArray
    """[N]"""
    in_identified_range: BoolArray
    velocity_friction: FloatArray
    """[N]"""


def actuator_frictions(
    seals: tuple[MountedSeal, ...], pressure_a: FloatArray, pressure_b: FloatArray, velocity: FloatArray
) -> ActuatorFrictions:
    """What `actuator_friction` gives for each moment, to the bit.

    Args:
        seals: Seals and their chambers.
        pressure_a: Pressure of chamber a [Pa, gauge], finite, shape (n,).
        pressure_b: Pressure of chamber b [Pa, gauge], finite, shape (n,).
        velocity: Rod velocity [m/s], finite, shape (n,).
    """
    total, std, stiction, added = np.zeros((4, len(velocity)))
    inside = np.ones(len(velocity), dtype=np.bool_)
    for mounted in seals:
        seal = mounted.seal
        pressure = pressure_a if mounted.chamber == 'a' else pressure_b
        friction = coulomb_frictions(seal, pressure)
        total += friction
        stiction += seal.stiction + seal.stiction_ratio * friction
        if seal.velocity_law is not None:
            more = _added(seal.velocity_law, friction, pressure, velocity)
            added += more
            friction = friction + more
        std += _std(seal.uncertainty, friction)
        margin = 0.01 * (seal.pressure_max - seal.pressure_min)
        inside &= (seal.pressure_min - margin <= pressure) & (pressure <= seal.pressure_max + margin)
    return ActuatorFrictions(total, std, stiction, inside, added)


def coulomb_frictions(seal: Seal, pressure: FloatArray) -> FloatArray:
    """Magnitude of the sliding friction of one seal [N] at each pressure [Pa, gauge], shape (n,)."""
    law = seal.coulomb_law
    return _LAWS.get(type(law), _one_by_one)(law, _at_least_zero(pressure))


def _added(
    law: VelocityTerms | FrictionMap, coulomb_friction: FloatArray, pressure: FloatArray, velocity: FloatArray
) -> FloatArray:
    if isinstance(law, VelocityTerms):
        return _added_by_terms(law, coulomb_friction, velocity)
    each = zip(coulomb_friction.tolist(), pressure.tolist(), velocity.tolist(), strict=True)
    return np.array([law.added(*values) for values in each])


def _added_by_terms(terms: VelocityTerms, coulomb_friction: FloatArray, velocity: FloatArray) -> FloatArray:
    speed = np.abs(velocity)
    sliding = coulomb_friction + terms.viscous_friction * speed
    if terms.stribeck_friction > 0.0:
        sliding = sliding + terms.stribeck_friction * _exponential(-speed / terms.stribeck_velocity)
    factor = np.where(velocity > 0.0, 1.0 + terms.asymmetry, 1.0 - terms.asymmetry)
    return np.where(velocity == 0.0, 0.0, sliding * factor - coulomb_friction)


def _std(uncertainty: Uncertainty, friction: FloatArray) -> FloatArray:
    return np.sqrt(_power(uncertainty.relative_std * friction, 2.0) + uncertainty.absolute_std**2)


def _at_least_zero(values: FloatArray) -> FloatArray:
    """``max(value, 0.0)`` as Python has it, for the sign of a zero."""
    return np.where(values < 0.0, 0.0, values)


@compiled
def _power(base: FloatArray, exponent: float) -> FloatArray:
    result = np.empty_like(base)
    for i in range(len(base)):
        result[i] = math.pow(base[i], exponent)
    return result


@compiled
def _exponential(exponent: FloatArray) -> FloatArray:
    result = np.empty_like(exponent)
    for i in range(len(exponent)):
        result[i] = math.exp(exponent[i])
    return result


# -- laws, each on an array of pressures >= 0 [Pa, gauge] or of normal forces > 0 [N] ---------------------------------


def _one_by_one(law: CoulombLaw, pressure: FloatArray) -> FloatArray:
    return np.array([law.coulomb_friction(value) for value in pressure.tolist()])


def _physics_based(law: PhysicsBased, pressure: FloatArray) -> FloatArray:
    normal_law, coefficient_law = law.normal_force_law, law.friction_coefficient_law
    if type(normal_law) not in _NORMAL_FORCES or type(coefficient_law) not in _COEFFICIENTS:
        return _one_by_one(law, pressure)
    normal_force = _NORMAL_FORCES[type(normal_law)](normal_law, pressure, law.projected_area)
    return _COEFFICIENTS[type(coefficient_law)](coefficient_law, normal_force) * normal_force


def _constant(law: ConstantCoulomb, pressure: FloatArray) -> FloatArray:
    return np.full_like(pressure, law.coulomb_friction_at_any_pressure)


def _pressure_power_law(law: PressurePowerLaw, pressure: FloatArray) -> FloatArray:
    risen = _power(pressure / BAR, law.pressure_exponent)
    return law.friction_at_no_pressure + law.friction_at_one_bar * risen


def _prior_art_chart(law: PriorArtChart, pressure: FloatArray) -> FloatArray:
    squeeze_part = law.squeeze_friction * contact_length(law.geometry)
    return squeeze_part + law.table.at_each(pressure) * projected_area(law.geometry)


def _normal_force_line(law: AreaDeformationGain, pressure: FloatArray, area: float) -> FloatArray:
    return law.area_deformation_gain * (pressure * area) + law.radial_force


def _normal_force_table(law: NormalForceTable, pressure: FloatArray, area: float) -> FloatArray:
    del area
    beyond = _at_least_zero(pressure - law.pressures[-1])
    return law.table.at_each(pressure) + law.table.end_slope * beyond


def _coefficient_power_law(law: PowerLaw, normal_force: FloatArray) -> FloatArray:
    return law.coefficient * _power(normal_force, -law.exponent)


def _coefficient_table(law: CoefficientTable, normal_force: FloatArray) -> FloatArray:
    return law.table.at_each(normal_force)


_LAWS: dict[type, Callable[[Any, FloatArray], FloatArray]] = {
    PhysicsBased: _physics_based,
    ConstantCoulomb: _constant,
    PressurePowerLaw: _pressure_power_law,
    PriorArtChart: _prior_art_chart,
}
_NORMAL_FORCES: dict[type[NormalForceLaw], Callable[[Any, FloatArray, float], FloatArray]] = {
    AreaDeformationGain: _normal_force_line,
    NormalForceTable: _normal_force_table,
}
_COEFFICIENTS: dict[type[FrictionCoefficientLaw], Callable[[Any, FloatArray], FloatArray]] = {
    PowerLaw: _coefficient_power_law,
    CoefficientTable: _coefficient_table,
}
