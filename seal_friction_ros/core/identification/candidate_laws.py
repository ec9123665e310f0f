"""Candidate laws of an identification: friction laws with and without velocity terms, ordered from simple to complex.

Fit and live node evaluate the same function of the law. Parameters are those of one seal; friction is the sum over all
seals of the rig.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.compiled import compiled, for_compiler
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.friction.actuator import SealNumbers, numbers_of_law, sliding_friction_of_seals
from seal_friction_ros.core.friction.geometry import SealGeometry, projected_area
from seal_friction_ros.core.friction.laws import FRICTION_LAWS
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.law import FrictionLaw, TypicalReading
from seal_friction_ros.core.friction.laws.normal_force import NormalForceLaw
from seal_friction_ros.core.friction.laws.pressure_power_law import ELASTIC_EXPONENT, PressurePowerLaw
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms

COMPILED_FROM = 100  # pressures from which compiled code is faster: compiling a law takes about 1 s


class OperatingConditions(NamedTuple):
    """Operating conditions of n readings with k seals."""

    pressure: FloatArray  # [Pa, gauge, >= 0] of each seal, shape (n, k)
    velocity: FloatArray  # [m/s] shape (n,); NaN if not measured
    direction: FloatArray  # -1.0 or 1.0, shape (n,)

    def taken(self, index: IntArray) -> 'OperatingConditions':
        """The readings in ``index``."""
        return OperatingConditions(*(column[index] for column in self))


class SealKind(NamedTuple):
    """Equal seals of one kind in a cylinder."""

    name: str  # empty if it is the only kind
    chambers: tuple[str, ...]  # of each seal of the kind, of `CHAMBERS`


def columns_of(kinds: Sequence[SealKind], number: int) -> slice:
    """Seals of a kind, as columns of the pressures, where all kinds stand in order."""
    first = sum(len(each.chambers) for each in kinds[:number])
    return slice(first, first + len(kinds[number].chambers))


ParameterValues = Mapping[str, float]


class FittedParameter(NamedTuple):
    """A parameter with its bounds in the fit."""

    name: str
    unit: str
    lower: float
    upper: float
    start: Callable[[TypicalReading], float]  # first guess
    symbol: str


def fitted_parameters(record_type: type) -> tuple[FittedParameter, ...]:
    """Parameters of a law, or of the velocity terms, that have a first guess."""
    fitted = [(name, m, m.start) for name, m in meanings(record_type).items() if m.start is not None]
    bounds = [m.fit_bounds or (float(m.lower or 0.0), float(m.upper or 0.0)) for _, m, _ in fitted]
    rows = zip(fitted, bounds, strict=True)
    return tuple(FittedParameter(name, m.unit, *both, start, m.symbol) for (name, m, start), both in rows)


@dataclass(frozen=True, eq=False)
class CandidateLaw:
    """A friction law of the registry, with or without velocity terms."""

    name: str
    formula: str
    law_type: type[FrictionLaw]
    parameters: tuple[FittedParameter, ...]
    fixed: ParameterValues = field(default_factory=dict)  # parameters that are not fitted
    parts: Mapping[str, Any] = field(default_factory=dict)
    """known fields of the law: geometry and normal force; empty if it needs neither"""
    has_prior: bool = False  # whether all its terms are fitted at once, with a prior on each (`friction_model`)
    kinds: tuple[SealKind, ...] = ()
    """kinds of seals, each with a rise over its pressure; what no pressure divides is that of all seals; empty: one"""

    @property
    def depends_on_pressure(self) -> bool:
        """Whether its Coulomb friction depends on pressure."""
        return self.law_type is not ConstantCoulomb

    @property
    def depends_on_speed(self) -> bool:
        """Whether the law itself depends on speed; it then has no velocity terms."""
        return 'reference_speed' in meanings(self.law_type)

    @property
    def velocity_terms(self) -> tuple[str, ...]:
        """Fitted parameters that belong to the velocity terms."""
        fitted = {parameter.name for parameter in self.parameters}
        return tuple(name for name in meanings(VelocityTerms) if name in fitted)

    def named(self, vector: Sequence[float] | FloatArray) -> dict[str, float]:
        """Parameters by name, including the fixed ones, from the fitted values in the order of ``parameters``."""
        return {**{p.name: float(x) for p, x in zip(self.parameters, vector, strict=True)}, **self.fixed}

    def of_one_seal(self, values: ParameterValues) -> tuple[ParameterValues, ...]:
        """Parameters of one seal of each kind: what no pressure divides, by the share of the kind."""
        if not self.kinds:
            return (values,)
        found = []
        for kind in self.kinds:
            share = values[f'{kind.name}.share'] / len(kind.chambers)
            of_kind = {name: values[f'{kind.name}.{name}'] for name in OF_A_KIND}
            found.append(
                {name: value * (share if name in DIVIDED else 1.0) for name, value in values.items()} | of_kind
            )
        return tuple(found)

    def friction_law(self, values: ParameterValues) -> FrictionLaw:
        """The friction law of one seal, without velocity terms; parameters of other laws are ignored.

        ValueError: a value is out of bounds.
        """
        part_name, part_type = self.law_type.FITTED_PART or ('', self.law_type)
        given = {**values, **self.fixed}
        chosen = {f.name: given[f.name] for f in fields(part_type) if f.init and f.name in given}
        fitted: Any = part_type(**chosen, **({} if part_name else self.parts))
        return self.law_type(**self.parts, **{part_name: fitted}) if part_name else fitted

    def terms(self, values: ParameterValues) -> VelocityTerms | None:
        """The velocity terms of one seal; None if the law has none."""
        return VelocityTerms(**{name: values[name] for name in self.velocity_terms}) if self.velocity_terms else None

    def first_guess(self, at: OperatingConditions, friction: float) -> dict[str, float]:
        """Value of each parameter to begin a fit with; ``friction`` is the mean of one seal [N]."""
        normal_force = float(normal_forces(at.pressure, **self.parts).mean()) if self.parts else math.nan
        speed = float(np.nanmax(np.abs(at.velocity), initial=0.0))
        typical = TypicalReading(friction, float(at.pressure.max()), speed, normal_force)
        return {parameter.name: parameter.start(typical) for parameter in self.parameters}

    def friction(self, at: OperatingConditions, values: ParameterValues) -> FloatArray:
        """Magnitude of the sliding friction of all seals [N], shape (n,)."""
        return np.asarray(self.frictions(at, values).sum(axis=1))

    def coulomb_friction(self, at: OperatingConditions, values: ParameterValues) -> FloatArray:
        """Magnitude of the Coulomb friction of all seals [N], shape (n,)."""
        return np.asarray(self.frictions(at, values, with_speed=False).sum(axis=1))

    def frictions(self, at: OperatingConditions, values: ParameterValues, *, with_speed: bool = True) -> FloatArray:
        """Magnitude of the friction of all seals of each kind [N], shape (n, kinds)."""
        columns = []
        for number, of_one in enumerate(self.of_one_seal(values)):
            seen = at._replace(pressure=at.pressure[:, columns_of(self.kinds, number)]) if self.kinds else at
            numbers = numbers_of_law(self.friction_law(of_one), self.terms(of_one) if with_speed else None)
            columns.append(friction_of_seals(numbers, seen))
        return np.column_stack(columns)


def friction_of_seals(seal: SealNumbers, at: OperatingConditions) -> FloatArray:
    """Magnitude of the sliding friction [N] of k equal seals, shape (n,). An unknown speed counts as 0."""
    if at.pressure.size >= COMPILED_FROM:
        return np.asarray(_compiled_sum()(for_compiler((seal,)), at.pressure, at.velocity, at.direction))
    return _sum_over_seals((seal,), at.pressure, at.velocity, at.direction)


def _sum_over_seals(seal: Any, pressure: FloatArray, velocity: FloatArray, direction: FloatArray) -> FloatArray:
    """Compilable part of `friction_of_seals`; ``seal`` as compiled code takes it, ``pressure`` of shape (n, k)."""
    total = np.zeros(len(velocity))
    for i in range(pressure.shape[0]):
        speed = 0.0 if math.isnan(velocity[i]) else abs(velocity[i])
        for k in range(pressure.shape[1]):
            p = pressure[i, k]
            total[i] += sliding_friction_of_seals(seal, p, p, speed, int(direction[i]))
    return total


_compiled_sum = cache(lambda: compiled(_sum_over_seals))


def normal_forces(pressure: FloatArray, geometry: SealGeometry, normal_force_law: NormalForceLaw) -> FloatArray:
    """Normal force of each seal [N], shape (n, k), at ``pressure`` [Pa, gauge], shape (n, k)."""
    area = projected_area(geometry)
    distinct, back = np.unique(pressure, return_inverse=True)
    forces = np.array([normal_force_law.normal_force(float(p), area) for p in distinct])
    return np.asarray(forces[back].reshape(pressure.shape))


EXPONENTS = {'2_3': ELASTIC_EXPONENT, '1': 1.0, '3_2': 1.5, '2': 2.0}
"""Suffix of the name -> fixed pressure exponent: O-rings are near 2/3, lip seals near 1 to 3/2 (our choice)."""
DIVIDED = ('friction_at_no_pressure', 'viscous_friction', 'stribeck_friction')
OF_A_KIND = ('friction_at_one_bar', 'pressure_exponent')
"""Parameters that no pressure divides between kinds of seals, and those that each kind has"""
_WITH_SPEEDS = (  # suffix of the name, text of the formula, names of the velocity terms
    ('viscous', 'viscous', ('viscous_friction',)),
    ('stribeck', 'viscous + Stribeck', ('viscous_friction', 'stribeck_friction', 'stribeck_velocity')),
    ('asymmetric', 'viscous + asymmetry', ('viscous_friction', 'asymmetry')),
)
_WITHOUT_SPEEDS = (('asymmetric', 'asymmetry', ('asymmetry',)),)


class Variation(NamedTuple):
    """What the readings vary, which decides what they can identify."""

    pressures: int = 3  # distinct ones, up to 3: with fewer, the rise over pressure is a prior; 0: friction made them
    speeds: bool = True  # the speed varies at one pressure and direction: velocity terms
    asymmetry: bool = True  # sources hold several pressures: asymmetry, which else is an offset
    exponent: bool = True  # there are enough pressures for a free pressure exponent


def candidate_laws(
    variation: Variation, geometry: SealGeometry | None = None, normal_force_law: NormalForceLaw | None = None
) -> tuple[CandidateLaw, ...]:
    """Laws without velocity terms that the data can identify, from simple to complex, and the constant one with them.

    The pressure power law comes with each of `EXPONENTS`, and with a free one where the data determine it. Laws that
    need geometry and normal force of the ring are left out without them.
    """
    parts = {'geometry': geometry, 'normal_force_law': normal_force_law} if geometry and normal_force_law else {}
    bases = [_base(law_type, parts, variation.speeds) for law_type in FRICTION_LAWS]
    constant, *laws = [base for base in bases if base is not None]
    if variation.pressures == 0:
        return (constant, *with_velocity_terms(constant, variation))
    if variation.pressures < 3:
        return (_with_prior(next(law for law in laws if law.law_type is PressurePowerLaw), variation.pressures),)
    found = [constant, *(with_velocity_terms(constant, variation) if variation.speeds else ())]
    for law in laws:
        if law.law_type is PressurePowerLaw:
            found += [_with_exponent(law, *item) for item in EXPONENTS.items()]
        if law.law_type is not PressurePowerLaw or variation.exponent:
            found.append(law)
    return tuple(found)


def with_velocity_terms(base: CandidateLaw, variation: Variation) -> tuple[CandidateLaw, ...]:
    """The law with each group of velocity terms that the data can identify; none if the law itself depends on speed."""
    if base.depends_on_speed:
        return ()
    prefix = 'coulomb' if base.law_type is ConstantCoulomb else base.name
    return tuple(
        replace(
            base,
            name=f'{prefix}_{suffix}',
            formula=f'{base.formula} + {terms}',
            parameters=(*base.parameters, *(p for p in fitted_parameters(VelocityTerms) if p.name in names)),
        )
        for suffix, terms, names in (_WITH_SPEEDS if variation.speeds else _WITHOUT_SPEEDS)
        if variation.asymmetry or 'asymmetry' not in names
    )


def law_of_all_terms(variation: Variation, kinds: tuple[SealKind, ...] = ()) -> CandidateLaw:
    """The pressure power law, or constant friction, with every velocity term that the data can tell and a prior.

    Of several ``kinds`` each has its own rise and exponent; friction at no pressure and over speed are that of all.
    """
    law_type = PressurePowerLaw if variation.pressures else ConstantCoulomb
    told = {'asymmetry'} if variation.asymmetry else set()
    if variation.speeds:
        told |= {'viscous_friction', 'stribeck_friction', 'stribeck_velocity', 'stribeck_ratio'}
        told |= {'viscous_asymmetry'} if variation.asymmetry else set()
    terms = tuple(p for p in fitted_parameters(VelocityTerms) if p.name in told)
    parts = {'viscous_friction': 'viscous', 'stribeck_friction': 'Stribeck', 'asymmetry': 'asymmetry'}
    formula = ' + '.join([law_type.FORMULA, *(parts[p.name] for p in terms if p.name in parts)])
    base = fitted_parameters(law_type)
    of_kinds = [p._replace(name=f'{kind.name}.{p.name}') for kind in kinds for p in base if p.name in OF_A_KIND]
    first = [p for p in base if not kinds or p.name not in OF_A_KIND]
    parameters = (*first, *of_kinds, *terms)
    return CandidateLaw('all_terms', f'{formula}, each with a prior', law_type, parameters, has_prior=True, kinds=kinds)


def _with_exponent(law: CandidateLaw, suffix: str, exponent: float) -> CandidateLaw:
    parameters = tuple(p for p in law.parameters if p.name != 'pressure_exponent')
    power = {'1': '', '2': '^2'}.get(suffix, f'^({suffix.replace("_", "/")})')
    name, formula = f'{law.name}_{suffix}', law.formula.replace('^m', power)
    return replace(law, name=name, formula=formula, parameters=parameters, fixed={'pressure_exponent': exponent})


def _with_prior(law: CandidateLaw, pressures: int) -> CandidateLaw:
    """The pressure power law with the exponent of an elastic contact; at one pressure without f_0, too.

    Friction proportional to P^(2/3) is the law of an elastic contact that only pressure loads [Schallamach1958]_. Away
    from the pressures that were measured it is a guess.
    """
    fixed = {'pressure_exponent': ELASTIC_EXPONENT} | ({} if pressures == 2 else {'friction_at_no_pressure': 0.0})
    parameters = tuple(p for p in law.parameters if p.name not in fixed)
    formula = law.formula.replace('^m', '^(2/3)') + ', rise over pressure from a prior'
    return replace(law, name=f'{law.name}_2_3', formula=formula, parameters=parameters, fixed=fixed)


def _base(law_type: type[FrictionLaw], parts: Mapping[str, Any], with_speeds: bool) -> CandidateLaw | None:
    """A law without velocity terms; None if it has no fitted parameter or needs something unknown."""
    part_name, part_type = law_type.FITTED_PART or ('', law_type)
    parameters = fitted_parameters(part_type)
    needed = [f.name for f in fields(law_type) if f.init and f.name != part_name and f.name not in meanings(law_type)]
    if not parameters or not set(needed) <= set(parts):
        return None
    law = CandidateLaw(law_type.NAME, law_type.FORMULA, law_type, parameters, {}, {n: parts[n] for n in needed})
    return law if with_speeds or not law.depends_on_speed else None
