"""One seal, the seals of an actuator, and their friction together."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import Bound, compilable, evaluate, unrolled
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.friction.force_sum_correction import ForceSumCorrection
from seal_friction_ros.core.friction.identified_motion import ANY_MOTION, IdentifiedMotion
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.law import FrictionLaw
from seal_friction_ros.core.friction.laws.velocity_terms import (
    NO_VELOCITY_TERMS,
    VelocityTermNumbers,
    VelocityTerms,
    with_velocity_terms,
)
from seal_friction_ros.core.friction.mounting import CHAMBERS, CHAMBERS_TEXT, pressed_out, pressure_at_seal
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.pressure_asymmetry import PressureAsymmetry
from seal_friction_ros.core.friction.temperature import (
    TemperatureScale,
    one_temperature_scale,
    scale_at,
    std_of_unknown,
)
from seal_friction_ros.core.friction.term_covariance import TermCovariance


@dataclass(frozen=True)
class Uncertainty(CheckedParameters):
    """How far a new reading of the Coulomb friction of one seal may be off: std^2 = (relative f_c)^2 + absolute^2."""

    relative_std: float = parameter(
        unit='1', lower=0.0, upper=10.0, description='Part that is a share of the friction.'
    )
    absolute_std: float = parameter(0.0, unit='N', lower=0.0, upper=1e6, description='Part that does not scale.')

    def std(self, friction: float) -> float:
        """Standard deviation [N] at a Coulomb friction of ``friction`` [N]."""
        return math.sqrt((self.relative_std * friction) ** 2 + self.absolute_std**2)


@dataclass(frozen=True, kw_only=True)
class Seal(CheckedParameters):
    """One seal: its friction law, its breakaway force, its uncertainty, and the range in which it was identified.

    Breakaway force is (1 + ``stiction_ratio``) f_c + ``stiction``. ValueError: a value is out of bounds, friction falls
    with pressure inside the identified range, or the law and the velocity terms both depend on the speed.
    """

    name: str
    coulomb_law: FrictionLaw
    uncertainty: Uncertainty
    stiction: float = parameter(
        0.0, unit='N', lower=0.0, upper=1e6, description='Breakaway force above Coulomb friction.'
    )
    stiction_ratio: float = parameter(
        0.0, unit='1', lower=0.0, upper=10.0, description='The same, as a share of the Coulomb friction.'
    )
    friction_scale: float = parameter(
        1.0,
        unit='1',
        lower=0.01,
        upper=100.0,
        description='Factor on all friction, as `seal_friction adapt` writes it.',
    )
    velocity_terms: VelocityTerms | None = None
    pressure_asymmetry: PressureAsymmetry | None = None  # None: the same both ways, or not known
    pressure_min: float = parameter(0.0, unit='Pa', lower=0.0, upper=1e9, description='Lowest pressure identified.')
    pressure_max: float = parameter(unit='Pa', lower=1.0, upper=1e9, description='Highest pressure identified.')
    identified_motion: IdentifiedMotion = ANY_MOTION
    presliding: Presliding | None = None  # None: rigid, or not known
    force_sum_correction: ForceSumCorrection | None = None  # of the machine that the seal was measured in
    temperature: TemperatureScale | None = None  # None: the friction is not known to depend on it
    covariance: TermCovariance | None = None  # of the parameters of law and velocity terms; None: not known

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.coulomb_law.depends_on_speed and self.velocity_terms:
            raise ValueError(
                f'Seal {self.name}: its {self.coulomb_law.NAME} has the velocity in it: leave out velocity_terms'
            )
        self.check_order('pressure_max', 'pressure_min')
        self._check_monotone()

    @property
    def depends_on_velocity(self) -> bool:
        """Whether its sliding friction differs from its Coulomb friction."""
        terms = self.velocity_terms is not None or self.pressure_asymmetry is not None
        return self.coulomb_law.depends_on_speed or terms

    def friction(self, pressure: ArrayLike, velocity: ArrayLike) -> float | FloatArray:
        """Friction force of the sliding seal [N], with the sign of the velocity; at rest 0: see `breakaway`.

        Args:
            pressure: [Pa, gauge] at the seal, one number or an array; both broadcast. NaN gives NaN.
            velocity: [m/s] positive on extension, for a seal of chamber a.
        """
        return self._over(lambda f, v: math.copysign(f.coulomb_friction + f.velocity_friction, v) if v else 0.0,
                          pressure, velocity)  # fmt: skip

    def friction_std(self, pressure: ArrayLike, velocity: ArrayLike = 0.0) -> float | FloatArray:
        """Standard deviation of `friction` [N], for a new reading; at rest of the Coulomb friction."""
        return self._over(lambda friction, _: friction.coulomb_friction_std, pressure, velocity)

    def breakaway(self, pressure: ArrayLike) -> float | FloatArray:
        """Largest friction at rest [N], a magnitude; arguments as of `friction`."""
        return self._over(lambda friction, _: friction.coulomb_friction + friction.stiction, pressure, 0.0)

    def _over(
        self, number: Callable[['ActuatorFriction', float], float], pressure: ArrayLike, velocity: ArrayLike
    ) -> float | FloatArray:
        """A number of the friction at each pressure and velocity."""
        mounted = (MountedSeal(self, 'a'),)

        def at(one: float, speed: float) -> float:
            """At one of them."""
            known = math.isfinite(one) and math.isfinite(speed)
            return number(actuator_friction(mounted, one, 0.0, speed), speed) if known else math.nan

        each = np.frompyfunc(at, 2, 1)(np.asarray(pressure, float), np.asarray(velocity, float))
        return np.asarray(each, float) if np.ndim(each) else float(each)

    def _check_monotone(self) -> None:
        # 200 intervals over twice the identified range: a table of points can hide a fall between two of them.
        pressures = [self.pressure_max * i / 100.0 for i in range(201)]
        frictions = [self.coulomb_law.coulomb_friction(p) for p in pressures]
        for p, low, high in zip(pressures[1:], frictions, frictions[1:], strict=False):
            if not (math.isfinite(high) and high >= low * (1.0 - 1e-12)):
                raise ValueError(
                    f'Seal {self.name}: Coulomb friction falls from {low:.6g} N to {high:.6g} N at {p:.6g} Pa'
                )


class SealNumbers(NamedTuple):
    """A mounted seal as numbers."""

    law: Bound
    coulomb_speed: float  # [m/s] at which the Coulomb friction is taken
    law_depends_on_speed: bool
    velocity_terms: VelocityTermNumbers = NO_VELOCITY_TERMS
    depends_on_velocity: bool = False  # whether the sliding friction differs from the Coulomb friction
    chamber: int = 0  # index in `CHAMBERS`
    scale: float = 1.0  # [-] factor on all friction of the seal
    stiction: float = 0.0  # [N]
    stiction_ratio: float = 0.0
    relative_std: float = 0.0
    absolute_variance: float = 0.0  # [N^2]
    square: float = 2.0
    """the exponent of a square: a constant one the compiler turns into a product, which rounds differently from ``pow``
    in 1 of 1000 cases"""
    pressure_low: float = -math.inf  # [Pa] ends of the identified range with its margin
    pressure_high: float = math.inf  # [Pa]
    asymmetry: float = 0.0  # [-] of `PressureAsymmetry`
    full_pressure: float = 1.0  # [Pa] likewise


def numbers_of_law(law: FrictionLaw, terms: VelocityTerms | None = None) -> SealNumbers:
    """A seal with this sliding friction and nothing else."""
    return SealNumbers(
        law=law.bound,
        coulomb_speed=law.coulomb_speed,
        law_depends_on_speed=law.depends_on_speed,
        velocity_terms=terms.numbers if terms else NO_VELOCITY_TERMS,
        depends_on_velocity=law.depends_on_speed or terms is not None,
    )


NO_SEALS = (numbers_of_law(ConstantCoulomb(0.0)),)
"""Without friction, for compiled code, which cannot loop over nothing."""


@dataclass(frozen=True)
class MountedSeal:
    """A seal and the chamber whose pressure it sees, one of `CHAMBERS`; ValueError: the chamber is not one of them."""

    seal: Seal
    chamber: str
    friction_scale: float = 1.0  # [-] factor on all friction of the seal, breakaway included
    numbers: SealNumbers = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.chamber not in CHAMBERS:
            raise ValueError(f'chamber = {self.chamber!r} of seal {self.seal.name} is not {CHAMBERS_TEXT}')
        seal = self.seal
        margin = 0.01 * (seal.pressure_max - seal.pressure_min)
        numbers = numbers_of_law(seal.coulomb_law, seal.velocity_terms)._replace(
            chamber=CHAMBERS.index(self.chamber),
            scale=self.friction_scale * seal.friction_scale,
            stiction=seal.stiction,
            stiction_ratio=seal.stiction_ratio,
            relative_std=seal.uncertainty.relative_std,
            absolute_variance=seal.uncertainty.absolute_std**2,
            pressure_low=seal.pressure_min - margin,
            pressure_high=seal.pressure_max + margin,
        )
        if seal.pressure_asymmetry is not None:
            asymmetry, full = seal.pressure_asymmetry.asymmetry, seal.pressure_asymmetry.full_pressure
            numbers = numbers._replace(depends_on_velocity=True, asymmetry=asymmetry, full_pressure=full)
        object.__setattr__(self, 'numbers', numbers)  # frozen: the only way to keep what was built from the fields


class ActuatorFriction(NamedTuple):
    """Friction of all seals of an actuator together."""

    coulomb_friction: float  # [N]
    coulomb_friction_std: float  # [N]
    stiction: float  # [N]
    in_identified_range: bool
    velocity_friction: float  # [N] what sliding at the velocity adds to the magnitude; 0 at rest
    breakaway_asymmetry: float = 0.0  # [N] by which breakaway on extension is larger than its mean of both directions


@compilable
def sliding_friction(
    seal: SealNumbers, coulomb_friction: float, pressure: float, speed: float, direction: int
) -> float:
    """Magnitude of the friction of one sliding seal [N], its scale left out, from that of its law at ``pressure`` [N].

    Pressure in [Pa, gauge, >= 0], speed in [m/s, >= 0]; the direction is 1 on extension, -1 on retraction.
    """
    if seal.law_depends_on_speed:
        return evaluate(seal.law, pressure, speed)
    viscous, stribeck, stribeck_velocity, asymmetry, ratio, uneven = seal.velocity_terms
    return with_velocity_terms(
        coulomb_friction, speed, direction, viscous, stribeck, stribeck_velocity, asymmetry, ratio, uneven
    )


@compilable
def share_of_extension(seal: SealNumbers, pressure_a: float, pressure_b: float, pressing: float) -> float:
    """Share by which the friction of a seal is larger on extension than the mean of both directions [-].

    ``pressing`` [Pa, >= 0] is the pressure of the seal; else as of `friction_of_seals`.
    """
    loaded = pressing / seal.full_pressure if pressing < seal.full_pressure else 1.0
    return -pressed_out(seal.chamber, pressure_a, pressure_b) * seal.asymmetry * loaded


@compilable
def friction_of_seal(
    seal: SealNumbers, pressure_a: float, pressure_b: float, velocity: float
) -> tuple[float, float, float, bool, float, float]:
    """The numbers of `ActuatorFriction` for one seal; arguments as for `friction_of_seals`."""
    # One unpacking takes a quarter of the time of an attribute each.
    (
        law, coulomb_speed, _, _, depends, chamber, scale, stiction, ratio, relative_std, variance, square, low, high,
        asymmetry, _,
    ) = seal  # fmt: skip
    pressure = pressure_at_seal(chamber, pressure_a, pressure_b)
    pressing = 0.0 if pressure < 0.0 else pressure
    by_law = evaluate(law, pressing, coulomb_speed)
    coulomb = by_law * scale
    added = share = 0.0
    if depends:
        if asymmetry != 0.0:
            share = share_of_extension(seal, pressure_a, pressure_b, pressing)
        if velocity != 0.0:
            direction = 1 if velocity > 0.0 else -1
            sliding = sliding_friction(seal, by_law, pressing, abs(velocity), direction) * scale
            added = sliding * (1.0 + direction * share) - coulomb
    more = stiction * scale + ratio * coulomb
    std = math.sqrt(math.pow(relative_std * (coulomb + added), square) + variance)
    return coulomb, std, more, low <= pressure <= high, added, share * (coulomb + more)


@compilable
def friction_of_seals(
    seals: tuple[SealNumbers, ...], pressure_a: float, pressure_b: float, velocity: float
) -> ActuatorFriction:
    """Sum over the seals of an actuator at both pressures [Pa, gauge] and a velocity [m/s], positive on extension.

    Standard deviations, of a reading at that velocity, add up linearly, since the seals of an actuator are of one kind,
    age and temperature and are wrong together (our choice; independent seals would be surer than this). A seal is
    inside its identified range up to 1 % of the range beyond its ends, so that sensor noise at zero pressure does not
    count as extrapolation (our choice). A chamber below ambient pressure presses the seal no less than no pressure
    does, so a negative gauge pressure counts as zero (our choice).
    """
    coulomb = 0.0
    std = 0.0
    stiction = 0.0
    inside = True
    added = 0.0
    asymmetry = 0.0
    for seal in unrolled(seals):  # a longer body the compiler does not unroll
        one, its_std, its_stiction, is_inside, more, uneven = friction_of_seal(seal, pressure_a, pressure_b, velocity)
        coulomb += one
        std += its_std
        stiction += its_stiction
        inside = inside and is_inside
        added += more
        asymmetry += uneven
    return ActuatorFriction(coulomb, std, stiction, inside, added, asymmetry)


@compilable
def breakaway_in(friction: ActuatorFriction, direction: int, with_stiction: bool) -> float:
    """Force at which a rod leaves rest in a ``direction`` of -1 or 1 [N], or without stiction; 0: mean of both."""
    mean = friction.coulomb_friction + friction.stiction
    force = mean if with_stiction else friction.coulomb_friction
    if friction.breakaway_asymmetry != 0.0:
        force *= 1.0 + direction * friction.breakaway_asymmetry / mean
    return force


@compilable
def sliding_friction_of_seals(
    seals: tuple[SealNumbers, ...], pressure_a: float, pressure_b: float, speed: float, direction: int
) -> float:
    """Magnitude of the friction of all seals [N] sliding at ``speed`` [m/s, >= 0] in ``direction`` (-1 or 1).

    It differs from `friction_of_seals` at a speed of 0: this is the limit of slow sliding, not rest.
    """
    total = 0.0
    for seal in unrolled(seals):
        pressure = pressure_at_seal(seal.chamber, pressure_a, pressure_b)
        pressing = 0.0 if pressure < 0.0 else pressure
        friction = evaluate(seal.law, pressing, seal.coulomb_speed)
        if seal.depends_on_velocity:
            friction = sliding_friction(seal, friction, pressing, speed, direction)
            if seal.asymmetry != 0.0:
                friction *= 1.0 + direction * share_of_extension(seal, pressure_a, pressure_b, pressing)
        total += friction * seal.scale
    return total


@compilable
def at_temperature(friction: ActuatorFriction, law: TemperatureScale, temperature: float) -> ActuatorFriction:
    r"""Friction at a finite ``temperature`` [K] from that at the reference.

    Every force has the scale. The error of k is added to the standard deviation: :math:`\sigma^2 = (s \sigma_0)^2 + (s
    f \sigma_k (T - T_0))^2`.
    """
    coulomb, std, stiction, in_identified_range, velocity_friction, asymmetry = friction
    scale = scale_at(law, temperature)
    unsure = (coulomb + velocity_friction) * law.coefficient_std * (temperature - law.reference)
    std = scale * math.sqrt(std * std + unsure * unsure)
    return ActuatorFriction(
        scale * coulomb, std, scale * stiction, in_identified_range, scale * velocity_friction, scale * asymmetry
    )


@compilable
def at_unknown_temperature(friction: ActuatorFriction, law: TemperatureScale) -> ActuatorFriction:
    """The same friction, with the spread of the scale over the identified temperatures in its standard deviation."""
    coulomb, std, stiction, in_identified_range, velocity_friction, asymmetry = friction
    unsure = (coulomb + velocity_friction) * std_of_unknown(law)
    std = math.sqrt(std * std + unsure * unsure)
    return ActuatorFriction(coulomb, std, stiction, in_identified_range, velocity_friction, asymmetry)


def numbers_of_seals(seals: tuple[MountedSeal, ...]) -> tuple[SealNumbers, ...]:
    """The seals of an actuator as numbers."""
    return tuple(mounted.numbers for mounted in seals)


def actuator_friction(
    seals: tuple[MountedSeal, ...], pressure_a: float, pressure_b: float, velocity: float = 0.0
) -> ActuatorFriction:
    """`friction_of_seals` for seals that are not numbers yet, at a temperature that is not known; same arguments."""
    friction = friction_of_seals(numbers_of_seals(seals), pressure_a, pressure_b, velocity)
    law = one_temperature_scale(mounted.seal.temperature for mounted in seals)
    return friction if law is None else at_unknown_temperature(friction, law)
