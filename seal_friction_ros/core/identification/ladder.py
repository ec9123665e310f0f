"""The ladder of friction laws that identification climbs, from the simplest to the physics.

Each rung is a law of the registry (`FRICTION_LAWS`), with or without velocity terms. Fits and the live node evaluate
the same function of the law. Parameters are those of one seal, friction is that of all seals of the rig.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.compiled import for_compiler
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.friction.actuator import (
    SealNumbers,
    numbers_of_law,
    sliding_friction_of_seals,
)
from seal_friction_ros.core.friction.geometry import SealGeometry, projected_area
from seal_friction_ros.core.friction.laws import FRICTION_LAWS
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.law import FrictionLaw, TypicalReading
from seal_friction_ros.core.friction.laws.normal_force import NormalForceLaw
from seal_friction_ros.core.friction.laws.physics_based import PhysicsBased
from seal_friction_ros.core.friction.laws.pressure_power_law import ELASTIC_EXPONENT, PressurePowerLaw
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms

COMPILED_FROM = 100  # pressures from which on a fit is faster compiled: a law compiles in about a second


class Conditions(NamedTuple):
    """Conditions of each reading; n readings, k seals."""

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

    def typical(self, friction: float) -> TypicalReading:
        """Sizes that occur in the readings, with their mean ``friction`` of one seal [N]."""
        return TypicalReading(
            friction,
            float(self.pressure.max()),
            float(np.nanmax(np.abs(self.velocity), initial=0.0)),
            math.nan if self.normal_force is None else float(self.normal_force.mean()),
        )


Values = Mapping[str, float]


class FittedParameter(NamedTuple):
    """A parameter that is fitted."""

    name: str
    unit: str
    lower: float
    upper: float
    start: Callable[[TypicalReading], float]
    """first guess"""
    symbol: str


def fitted_parameters(record_type: type) -> tuple[FittedParameter, ...]:
    """Parameters of a law, or of the velocity terms, that have a first guess."""
    return tuple(
        FittedParameter(
            name, m.unit, *(m.fit_bounds or (float(m.lower or 0.0), float(m.upper or 0.0))), m.start, m.symbol
        )
        for name, m in meanings(record_type).items()
        if m.start is not None
    )


@dataclass(frozen=True, eq=False)
class Rung:
    """One law of the ladder: a friction law, and the velocity terms on top of it."""

    name: str
    words: str
    law_type: type[FrictionLaw]
    parameters: tuple[FittedParameter, ...]
    fixed: Values = field(default_factory=dict)
    """parameters that are not fitted"""
    parts: Mapping[str, Any] = field(default_factory=dict)
    """fields of the law that are known beforehand: geometry, normal force"""

    @property
    def coulomb_law(self) -> str:
        """Name of the law in a seal file."""
        return self.law_type.NAME

    @property
    def needs_geometry(self) -> bool:
        """Whether it needs the normal force."""
        return bool(self.parts)

    @property
    def depends_on_pressure(self) -> bool:
        """Whether its Coulomb friction does."""
        return self.law_type is not ConstantCoulomb

    @property
    def velocity_terms(self) -> tuple[str, ...]:
        """Parameters of the velocity terms among those that are fitted."""
        fitted = {parameter.name for parameter in self.parameters}
        return tuple(name for name in meanings(VelocityTerms) if name in fitted)

    def law(self, values: Values) -> FrictionLaw:
        """The friction law of one seal.

        Args:
            values: Parameters by name; others are passed over.

        Raises:
            ValueError: A value is out of bounds.
        """
        part_name, part_type = self.law_type.FITTED_PART or ('', self.law_type)
        fitted: Any = part_type(**self._chosen(part_type, values), **({} if part_name else self.parts))
        return self.law_type(**self.parts, **{part_name: fitted}) if part_name else fitted

    def terms(self, values: Values) -> VelocityTerms | None:
        """The velocity terms of one seal; None if the rung has none."""
        return VelocityTerms(**{name: values[name] for name in self.velocity_terms}) if self.velocity_terms else None

    def friction(self, at: Conditions, values: Values) -> FloatArray:
        """Magnitude of the sliding friction of all seals [N], shape (n,)."""
        return frictions(self._seal(values, self.terms(values)), at)

    def coulomb_friction(self, at: Conditions, values: Values) -> FloatArray:
        """Magnitude of the Coulomb friction of all seals [N], shape (n,)."""
        return frictions(self._seal(values, None), at)

    def _chosen(self, record_type: type, values: Values) -> dict[str, float]:
        known = {**values, **self.fixed}
        return {f.name: known[f.name] for f in fields(record_type) if f.init and f.name in known}

    def _seal(self, values: Values, terms: VelocityTerms | None) -> SealNumbers:
        return numbers_of_law(self.law(values), terms)


def frictions(seal: SealNumbers, at: Conditions) -> FloatArray:
    """Magnitude of the friction [N] of k seals of one kind that slide, shape (n,). Without a speed it counts as 0."""
    speed, direction = np.nan_to_num(np.abs(at.velocity)), at.direction.astype(np.int64)
    if at.pressure.size >= COMPILED_FROM:
        from seal_friction_ros.core.identification.compiled_friction import sum_over_seals  # noqa: PLC0415

        return np.asarray(sum_over_seals(for_compiler((seal,)), at.pressure, speed, direction))
    rows = zip(at.pressure.tolist(), speed.tolist(), direction.tolist(), strict=True)
    return np.array([sum(sliding_friction_of_seals((seal,), p, p, v, d) for p in each) for each, v, d in rows])


# -- the ladder -------------------------------------------------------------------------------------------------------


def ladder(
    *,
    geometry: SealGeometry | None = None,
    normal_force_law: NormalForceLaw | None = None,
    with_speeds: bool,
    with_exponent: bool,
) -> tuple[Rung, ...]:
    """Laws from the lowest to the highest: constant, then pressure, then physics, each with what the data allow.

    Args:
        geometry: Of the ring, where it is known; else there is no law that needs it.
        normal_force_law: Likewise.
        with_speeds: Whether the readings differ in speed, so that terms of the velocity can be told.
        with_exponent: Whether there are pressures enough to tell the exponent of the pressure, else it is 2/3.
    """
    parts = {'geometry': geometry, 'normal_force_law': normal_force_law} if geometry and normal_force_law else {}
    bases = [_base(law_type, parts, with_speeds, with_exponent) for law_type in FRICTION_LAWS]
    known = [base for base in bases if base is not None]
    constant, laws = known[0], known[1:]
    highest = next(base for base in laws if base.law_type is (PhysicsBased if parts else PressurePowerLaw))
    on_constant = _velocity_rungs(constant, 'coulomb') if with_speeds else []
    on_highest = (
        _velocity_rungs(highest, highest.name) if with_speeds else [_with_terms(highest, highest.name, ('asymmetry',))]
    )
    return (constant, *on_constant, *laws, *on_highest)


def _base(law_type: type[FrictionLaw], parts: Mapping[str, Any], with_speeds: bool, with_exponent: bool) -> Rung | None:
    """Rung of a law without velocity terms; None if nothing of it is fitted, or what it needs is not known."""
    part_name, part_type = law_type.FITTED_PART or ('', law_type)
    parameters = fitted_parameters(part_type)
    needed = [f.name for f in fields(law_type) if f.init and f.name != part_name and f.name not in meanings(law_type)]
    depends_on_speed = 'reference_speed' in meanings(law_type)
    if not parameters or not set(needed) <= set(parts) or (depends_on_speed and not with_speeds):
        return None
    fixed = {}
    if law_type is PressurePowerLaw and not with_exponent:
        fixed = {'pressure_exponent': ELASTIC_EXPONENT}
        parameters = tuple(p for p in parameters if p.name not in fixed)
    held = {name: parts[name] for name in needed}
    return Rung(law_type.NAME, law_type.FORMULA, law_type, parameters, fixed, held)


def _velocity_rungs(base: Rung, name: str) -> list[Rung]:
    """Viscous friction on top of a law, then Stribeck friction or an asymmetry on top of that."""
    viscous = _with_terms(base, name, ('viscous',))
    return [viscous, _with_terms(viscous, name, ('stribeck',)), _with_terms(viscous, name, ('asymmetry',))]


_TERMS = {
    'viscous': ('viscous', '_viscous', ('viscous_friction',)),
    'stribeck': ('Stribeck', '_stribeck', ('stribeck_friction', 'stribeck_velocity')),
    'asymmetry': ('asymmetry', '_asymmetric', ('asymmetry',)),
}


def _with_terms(base: Rung, name: str, terms: Sequence[str]) -> Rung:
    for term in terms:
        words, suffix, names = _TERMS[term]
        base = replace(
            base,
            name=f'{name}{suffix}',
            words=f'{base.words} + {words}',
            parameters=(*base.parameters, *(p for p in fitted_parameters(VelocityTerms) if p.name in names)),
        )
    return base


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
