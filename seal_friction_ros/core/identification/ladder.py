"""The ladder of friction laws that identification climbs, from what the field does today to what the physics says.

Each law is a function of the conditions of a reading and of its parameters, for all readings at once; the parameters
are of one seal, the friction is that of all seals of the rig. `core/coulomb.py` has the same laws for one sample at a
time; a test holds the two together.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.geometry import SealGeometry, projected_area, squeeze
from seal_friction_ros.core.friction.normal_force import NormalForceLaw

ELASTIC_EXPONENT = 2.0 / 3.0  # of the normal force: friction of an elastic contact [Schallamach1958]_


class Conditions(NamedTuple):
    """Under what each reading was taken; n readings, k seals."""

    pressure: FloatArray
    """[Pa, gauge, >= 0] that each seal sees, shape (n, k)"""
    normal_force: FloatArray | None
    """[N] of each seal, shape (n, k); None where the geometry is not known"""
    velocity: FloatArray
    """[m/s] shape (n,); NaN where it was not measured"""
    direction: FloatArray
    """-1.0 or 1.0, shape (n,)"""

    def taken(self, index: IntArray) -> 'Conditions':
        """The readings that ``index`` names."""
        normal_force = None if self.normal_force is None else self.normal_force[index]
        return Conditions(self.pressure[index], normal_force, self.velocity[index], self.direction[index])


Values = Mapping[str, float]
Law = Callable[[Conditions, Values], FloatArray]


class Parameter(NamedTuple):
    """A parameter to be fitted."""

    name: str
    unit: str
    lower: float
    upper: float
    start: Callable[[float, Conditions], float]
    """first guess, from the mean friction of one seal [N] and the conditions"""
    symbol: str


# -- the laws ---------------------------------------------------------------------------------------------------------


def constant_coulomb(at: Conditions, value: Values) -> FloatArray:
    """f_c = f_0: friction that does not depend on pressure [N], shape (n,).

    Source: thesis, chapter 1, as what is mostly assumed.
    """
    return np.full(len(at.direction), value['coulomb_friction'] * at.pressure.shape[1])


def pressure_power_law(at: Conditions, value: Values) -> FloatArray:
    """f_c = f_0 + k (P / 1 bar)^m, summed over the seals [N], shape (n,). Our choice; m = 2/3 is an elastic contact."""
    risen = (at.pressure / BAR) ** value['pressure_exponent']
    friction = value['friction_at_no_pressure'] + value['friction_at_one_bar'] * risen
    return np.asarray(friction.sum(axis=1))


def physics_based(at: Conditions, value: Values) -> FloatArray:
    """f_c = mu(F_n) F_n with mu = c (F_n / 1 N)^-n, summed over the seals [N], shape (n,).

    The normal force F_n = G P A_r + F_rad is computed, not fitted: friction alone does not tell it from mu.

    Source: thesis, chapter 7.
    """
    friction = value['coefficient'] * _known_normal_force(at) ** (1.0 - value['exponent'])
    return np.asarray(friction.sum(axis=1))


def _known_normal_force(at: Conditions) -> FloatArray:
    if at.normal_force is None:
        raise ValueError('Conditions.normal_force is not given: this law needs the geometry of the seals')
    return at.normal_force


def viscous(at: Conditions, value: Values) -> FloatArray:
    """Viscous friction sigma |v| per seal, summed over the seals [N], shape (n,)."""
    return np.asarray(at.pressure.shape[1] * value['viscous_friction'] * np.abs(at.velocity))


def stribeck(at: Conditions, value: Values) -> FloatArray:
    """f_S exp(-|v| / v_S) per seal, summed over the seals [N], shape (n,).

    Source: [Armstrong1994]_ eq. (5); an exponent of 1 is our choice.
    """
    faded = np.exp(-np.abs(at.velocity) / value['stribeck_velocity'])
    return np.asarray(at.pressure.shape[1] * value['stribeck_friction'] * faded)


def asymmetry(at: Conditions, value: Values) -> FloatArray:
    """1 + a sgn(v): factor on it all, shape (n,). One factor for every term is our choice."""
    return 1.0 + value['asymmetry'] * at.direction


# -- the ladder -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rung:
    """One law of the ladder: a Coulomb law, what the velocity adds, and whether the directions differ."""

    name: str
    words: str
    coulomb_law: str
    """the law's name in a seal file"""
    coulomb: Law
    parameters: tuple[Parameter, ...]
    fixed: Values = field(default_factory=dict)
    """parameters that are not fitted"""
    velocity_terms: tuple[Law, ...] = ()
    is_asymmetric: bool = False

    @property
    def needs_geometry(self) -> bool:
        """Whether it needs the normal force."""
        return self.coulomb is physics_based

    @property
    def depends_on_pressure(self) -> bool:
        """Whether its Coulomb friction does."""
        return self.coulomb is not constant_coulomb

    def friction(self, at: Conditions, value: Values) -> FloatArray:
        """Magnitude of the friction of all seals [N], shape (n,)."""
        total = self.coulomb(at, value)
        for term in self.velocity_terms:
            total = total + term(at, value)
        return total * asymmetry(at, value) if self.is_asymmetric else total


def _highest(at: Conditions) -> float:
    return max(float(at.pressure.max()) / BAR, 1e-6)


def _fastest(at: Conditions) -> float:
    return max(float(np.nanmax(np.abs(at.velocity), initial=0.0)), 1e-6)


def _mean_normal_force(at: Conditions) -> float:
    return float(_known_normal_force(at).mean())


_CONSTANT = (Parameter('coulomb_friction', 'N', 0.0, 1e6, lambda mean, _: mean, 'f_0'),)
_POWER = (
    Parameter('friction_at_no_pressure', 'N', 0.0, 1e6, lambda mean, _: 0.5 * mean, 'f_0'),
    Parameter(
        'friction_at_one_bar', 'N', 0.0, 1e6, lambda mean, at: 0.7 * mean / _highest(at) ** ELASTIC_EXPONENT, 'k'
    ),
    Parameter('pressure_exponent', '1', 0.05, 2.0, lambda *_: ELASTIC_EXPONENT, 'm'),
)
_PHYSICS = (
    Parameter('coefficient', '1', 1e-6, 100.0, lambda mean, at: mean / _mean_normal_force(at) ** 0.6, 'c'),
    Parameter('exponent', '1', 0.0, 0.99, lambda *_: 0.4, 'n'),
)
_VISCOUS = (Parameter('viscous_friction', 'N s/m', 0.0, 1e7, lambda mean, at: 0.2 * mean / _fastest(at), 'sigma'),)
_STRIBECK = (
    Parameter('stribeck_friction', 'N', 0.0, 1e6, lambda mean, _: 0.2 * mean, 'f_S'),
    Parameter('stribeck_velocity', 'm/s', 1e-4, 1.0, lambda _, at: min(0.1 * _fastest(at), 1.0), 'v_S'),
)
_ASYMMETRY = (Parameter('asymmetry', '1', -0.9, 0.9, lambda *_: 0.0, 'a'),)


def ladder(*, with_geometry: bool, with_speeds: bool, with_exponent: bool) -> tuple[Rung, ...]:
    """Every rung that the data could carry, from the lowest.

    What the velocity adds is tried on the constant Coulomb friction first, so that pressure is not given the credit for
    it, and then on the highest law of the pressure.

    Args:
        with_geometry: The normal force is known, so the physics-based law and what stands on it is there too.
        with_speeds: Speeds were measured and are not all the same, so terms of the velocity are there too.
        with_exponent: There are enough pressures to tell an exponent from; else the power law has the exponent 2/3 of
            an elastic contact.
    """
    power = _POWER if with_exponent else _POWER[:2]
    fixed = {} if with_exponent else {'pressure_exponent': ELASTIC_EXPONENT}
    constant = Rung('constant_coulomb', 'constant', 'constant_coulomb', constant_coulomb, _CONSTANT)
    by_pressure = Rung(
        'pressure_power_law', 'power of the pressure', 'pressure_power_law', pressure_power_law, power, fixed
    )
    by_physics = Rung('physics_based', 'mu(F_n) F_n', 'physics_based', physics_based, _PHYSICS)
    highest = by_physics if with_geometry else by_pressure
    on_constant = _velocity_rungs(constant, 'coulomb') if with_speeds else []
    laws = [by_pressure, by_physics] if with_geometry else [by_pressure]
    on_highest = _velocity_rungs(highest, highest.name) if with_speeds else [_asymmetric(highest, highest.name)]
    return (constant, *on_constant, *laws, *on_highest)


def _velocity_rungs(base: Rung, name: str) -> list[Rung]:
    """Viscous friction on top of a law, then Stribeck friction or an asymmetry on top of that."""
    with_viscous = replace(
        base,
        name=f'{name}_viscous',
        words=f'{base.words} + viscous',
        parameters=(*base.parameters, *_VISCOUS),
        velocity_terms=(viscous,),
    )
    with_stribeck = replace(
        with_viscous,
        name=f'{name}_stribeck',
        words=f'{with_viscous.words} + Stribeck',
        parameters=(*with_viscous.parameters, *_STRIBECK),
        velocity_terms=(viscous, stribeck),
    )
    return [with_viscous, with_stribeck, _asymmetric(with_viscous, name)]


def _asymmetric(base: Rung, name: str) -> Rung:
    return replace(
        base,
        name=f'{name}_asymmetric',
        words=f'{base.words} + asymmetry',
        parameters=(*base.parameters, *_ASYMMETRY),
        is_asymmetric=True,
    )


def values_of(rung: Rung, vector: Sequence[float] | FloatArray) -> dict[str, float]:
    """Parameters by name, the fixed ones too, from the values of the fitted ones in the order of the rung."""
    return {**{p.name: float(x) for p, x in zip(rung.parameters, vector, strict=True)}, **rung.fixed}


# -- the normal force -------------------------------------------------------------------------------------------------


def normal_forces(pressure: FloatArray, geometry: SealGeometry, law: NormalForceLaw) -> FloatArray:
    """Normal force of each seal [N], shape (n, k), at pressures [Pa, gauge] of that shape."""
    area = projected_area(geometry)
    distinct, back = np.unique(pressure, return_inverse=True)
    forces = np.array([law.normal_force(float(p), area) for p in distinct])
    result: FloatArray = forces[back].reshape(pressure.shape)
    return result


def squeeze_force(geometry: SealGeometry) -> float:
    """Normal force of a squeezed ring without pressure, summed over the circumference [N].

    F = pi D d E (1.25 C^1.5 + 50 C^6), with D the mean diameter of the gap and C the squeeze.

    Source: [Lindley1967]_, for a ring between two parallel walls. Against the finite elements of the thesis (18.2 N at
    7.5 % squeeze) it gives 22 N.
    """
    mean_diameter = (geometry.rod_diameter + geometry.gland_diameter) / 2.0
    share = squeeze(geometry)
    line_load = geometry.section_diameter * geometry.elastic_modulus * (1.25 * share**1.5 + 50.0 * share**6)
    return float(np.pi * mean_diameter * line_load)
