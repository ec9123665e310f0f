"""Pressure -> Coulomb friction: of one seal, and of an actuator with any number of seals."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from seal_friction_ros.core.foundation.monotone_table import MonotoneTable
from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.friction_coefficient import FrictionCoefficientLaw
from seal_friction_ros.core.friction.friction_map import FrictionMap
from seal_friction_ros.core.friction.geometry import SealGeometry, contact_length, projected_area
from seal_friction_ros.core.friction.normal_force import NormalForceLaw


class CoulombLaw(Protocol):
    """A law of the Coulomb friction of one seal."""

    def coulomb_friction(self, pressure: float) -> float:
        """Magnitude of the sliding friction [N] at ``pressure`` [Pa, gauge, >= 0]."""
        ...


@dataclass(frozen=True)
class PhysicsBased:
    """Coulomb friction from geometry, normal force and coefficient of friction: f_c = mu(F_n) F_n.

    Source: thesis, chapter 7.
    """

    geometry: SealGeometry
    normal_force_law: NormalForceLaw
    friction_coefficient_law: FrictionCoefficientLaw
    projected_area: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, 'projected_area', projected_area(self.geometry))

    def coulomb_friction(self, pressure: float) -> float:
        """Magnitude of the sliding friction [N] at ``pressure`` [Pa, gauge, >= 0]."""
        normal_force = self.normal_force_law.normal_force(pressure, self.projected_area)
        return self.friction_coefficient_law.coefficient_of_friction(normal_force) * normal_force


@dataclass(frozen=True)
class ConstantCoulomb:
    """Coulomb friction that does not depend on pressure: what is mostly assumed today.

    Source: thesis, chapter 1 ("the friction force is usually approximated as a constant value").

    Raises:
        ValueError: A parameter is out of bounds.
    """

    coulomb_friction_at_any_pressure: float = parameter(
        unit='N', lower=0.0, upper=1e6, description='Sliding friction of the seal.'
    )

    def __post_init__(self) -> None:
        check(self)

    def coulomb_friction(self, pressure: float) -> float:
        """Magnitude of the sliding friction [N], whatever the pressure [Pa, gauge, >= 0]."""
        del pressure
        return self.coulomb_friction_at_any_pressure


@dataclass(frozen=True)
class PressurePowerLaw:
    """Coulomb friction that rises as a power of the pressure: f_c = f_0 + k (P / 1 bar)^m. It needs no geometry.

    With m = 2/3 this is an elastic contact [Schallamach1958]_ whose normal force is proportional to the pressure.

    Raises:
        ValueError: A parameter is out of bounds.
    """

    friction_at_no_pressure: float = parameter(unit='N', lower=0.0, upper=1e6, description='f_0.')
    friction_at_one_bar: float = parameter(
        unit='N', lower=0.0, upper=1e6, description='k, what a pressure of 1 bar adds.'
    )
    pressure_exponent: float = parameter(unit='1', lower=0.05, upper=2.0, description='m.')

    def __post_init__(self) -> None:
        check(self)

    def coulomb_friction(self, pressure: float) -> float:
        """Magnitude of the sliding friction [N] at ``pressure`` [Pa, gauge, >= 0]."""
        risen = math.pow(pressure / BAR, self.pressure_exponent)
        return self.friction_at_no_pressure + self.friction_at_one_bar * risen


@dataclass(frozen=True)
class PriorArtChart:
    """Coulomb friction read from charts: F = f_c L_r + f_h(P) A_r.

    Source: thesis, chapter 2 (Tables 1 to 3); monotone interpolation between the chart readings is our choice.

    Raises:
        ValueError: A chart value is out of bounds, or friction falls with pressure.
    """

    geometry: SealGeometry
    squeeze_friction: float = parameter(
        unit='N/m', lower=0.0, upper=1e6, description='f_c, friction per contact length.'
    )
    pressures: tuple[float, ...] = parameter(
        unit='Pa', lower=0.0, upper=1e9, description='Gauge pressures of the chart, increasing.'
    )
    pressure_frictions: tuple[float, ...] = parameter(
        unit='Pa', lower=0.0, upper=1e9, description='f_h, friction per projected area.'
    )
    table: MonotoneTable = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check(self)
        if list(self.pressure_frictions) != sorted(self.pressure_frictions):
            raise ValueError(
                f'PriorArtChart.pressure_frictions = {list(self.pressure_frictions)} Pa falls with pressure'
            )
        table = MonotoneTable(self.pressures, self.pressure_frictions, 'PriorArtChart')
        object.__setattr__(self, 'table', table)

    def coulomb_friction(self, pressure: float) -> float:
        """Magnitude of the sliding friction [N] at ``pressure`` [Pa, gauge, >= 0]; constant above the chart."""
        squeeze_part = self.squeeze_friction * contact_length(self.geometry)
        return squeeze_part + self.table(pressure) * projected_area(self.geometry)


@dataclass(frozen=True)
class Uncertainty:
    """How far a new reading of the Coulomb friction of one seal may be off: std^2 = (relative f_c)^2 + absolute^2.

    Raises:
        ValueError: A value is out of bounds.
    """

    relative_std: float = parameter(
        unit='1', lower=0.0, upper=10.0, description='Part that is a share of the friction.'
    )
    absolute_std: float = parameter(0.0, unit='N', lower=0.0, upper=1e6, description='Part that does not scale.')

    def __post_init__(self) -> None:
        check(self)

    def std(self, friction: float) -> float:
        """Standard deviation [N] at a Coulomb friction of ``friction`` [N]."""
        return math.sqrt((self.relative_std * friction) ** 2 + self.absolute_std**2)


@dataclass(frozen=True)
class VelocityTerms:
    r"""What the friction of a sliding seal has besides its Coulomb friction.

    .. math:: F = [f_c + \sigma |v| + f_S\,e^{-|v|/v_S}]\,(1 + a\,\mathrm{sgn}(v))

    Source: [Armstrong1994]_ eq. (5) with an exponent of 1, which is our choice, as is one asymmetry of it all.

    Raises:
        ValueError: A value is out of bounds.
    """

    viscous_friction: float = parameter(0.0, unit='N s/m', lower=0.0, upper=1e7, description='sigma, viscous friction.')
    stribeck_friction: float = parameter(
        0.0, unit='N', lower=0.0, upper=1e6, description='f_S, what the slowest motion has above Coulomb friction.'
    )
    stribeck_velocity: float = parameter(
        0.01, unit='m/s', lower=1e-6, upper=10.0, description='v_S, speed over which that falls to 37 %.'
    )
    asymmetry: float = parameter(
        0.0, unit='1', lower=-0.9, upper=0.9, description='a, share by which extension has more and retraction less.'
    )

    def __post_init__(self) -> None:
        check(self)

    def added(self, coulomb_friction: float, pressure: float, velocity: float) -> float:
        """Magnitude [N] on top of ``coulomb_friction`` [N] at ``velocity`` [m/s], at any pressure; may be negative."""
        del pressure
        if velocity == 0.0:
            return 0.0
        speed = abs(velocity)
        sliding = coulomb_friction + self.viscous_friction * speed
        if self.stribeck_friction > 0.0:
            sliding += self.stribeck_friction * math.exp(-speed / self.stribeck_velocity)
        return sliding * (1.0 + self.asymmetry if velocity > 0.0 else 1.0 - self.asymmetry) - coulomb_friction


@dataclass(frozen=True, kw_only=True)
class Seal:
    """One seal: its Coulomb law, what comes on top at breakaway, how sure we are, and where that holds.

    Breakaway force is (1 + ``stiction_ratio``) f_c + ``stiction``.

    Raises:
        ValueError: A value is out of bounds, friction falls with pressure inside the identified range, or both the law
            and the terms say what the velocity does.
    """

    name: str
    coulomb_law: CoulombLaw
    uncertainty: Uncertainty
    stiction: float = parameter(
        0.0, unit='N', lower=0.0, upper=1e6, description='Breakaway force above Coulomb friction.'
    )
    stiction_ratio: float = parameter(
        0.0, unit='1', lower=0.0, upper=10.0, description='The same, as a share of the Coulomb friction.'
    )
    velocity_terms: VelocityTerms | None = None
    pressure_min: float = parameter(0.0, unit='Pa', lower=0.0, upper=1e9, description='Lowest pressure identified.')
    pressure_max: float = parameter(unit='Pa', lower=1.0, upper=1e9, description='Highest pressure identified.')
    velocity_law: VelocityTerms | FrictionMap | None = field(init=False, repr=False, compare=False)
    """what the velocity adds to the Coulomb friction; None if nothing"""

    def __post_init__(self) -> None:
        check(self)
        mapped = self.coulomb_law if isinstance(self.coulomb_law, FrictionMap) else None
        if mapped and self.velocity_terms:
            raise ValueError(f'Seal {self.name}: its friction_map has the velocity in it: leave out velocity_terms')
        object.__setattr__(self, 'velocity_law', mapped or self.velocity_terms)
        if self.pressure_max <= self.pressure_min:
            raise ValueError(
                f'Seal.pressure_max = {self.pressure_max} Pa is not above pressure_min = {self.pressure_min} Pa'
            )
        self._check_monotone()

    def _check_monotone(self) -> None:
        # 200 intervals over twice the identified range: a table of points can hide a fall between two of them.
        pressures = [self.pressure_max * i / 100.0 for i in range(201)]
        frictions = [self.coulomb_law.coulomb_friction(p) for p in pressures]
        for p, low, high in zip(pressures[1:], frictions, frictions[1:], strict=False):
            if not (math.isfinite(high) and high >= low * (1.0 - 1e-12)):
                raise ValueError(
                    f'Seal {self.name}: Coulomb friction falls from {low:.6g} N to {high:.6g} N at {p:.6g} Pa'
                )


def coulomb_friction(seal: Seal, pressure: float) -> float:
    """Magnitude of the sliding friction of one seal [N] at ``pressure`` [Pa, gauge].

    A chamber below ambient pressure presses the seal no less than no pressure does, so negative gauge pressure counts
    as zero (our choice).
    """
    return seal.coulomb_law.coulomb_friction(max(pressure, 0.0))


@dataclass(frozen=True)
class MountedSeal:
    """A seal and the chamber whose pressure it sees.

    Raises:
        ValueError: The chamber is neither ``a`` nor ``b``.
    """

    seal: Seal
    chamber: str

    def __post_init__(self) -> None:
        if self.chamber not in ('a', 'b'):
            raise ValueError(f'chamber = {self.chamber!r} of seal {self.seal.name} is neither a nor b')


class ActuatorFriction(NamedTuple):
    """Friction of all seals of an actuator together."""

    coulomb_friction: float
    """[N]"""
    coulomb_friction_std: float
    """[N]"""
    stiction: float
    """[N]"""
    in_identified_range: bool
    velocity_friction: float
    """[N] what sliding at the velocity adds to the magnitude; 0 at rest"""


def actuator_friction(
    seals: tuple[MountedSeal, ...], pressure_a: float, pressure_b: float, velocity: float = 0.0
) -> ActuatorFriction:
    """Sum over the seals of an actuator.

    Standard deviations add up linearly, since the seals of an actuator are of one kind, age and temperature and are
    wrong together (our choice; independent seals would be surer than this). A seal is inside its identified range up
    to 1 % of the range beyond its ends, so that sensor noise at zero pressure does not count as extrapolation (our
    choice).

    Args:
        seals: Seals and their chambers.
        pressure_a: Pressure of chamber a [Pa, gauge].
        pressure_b: Pressure of chamber b [Pa, gauge].
        velocity: Rod velocity [m/s], positive on extension. The standard deviation is that of a reading at it.
    """
    total = std = stiction = added = 0.0
    inside = True
    for mounted in seals:
        seal = mounted.seal
        pressure = pressure_a if mounted.chamber == 'a' else pressure_b
        friction = coulomb_friction(seal, pressure)
        total += friction
        stiction += seal.stiction + seal.stiction_ratio * friction
        if seal.velocity_law is not None:
            more = seal.velocity_law.added(friction, pressure, velocity)
            added += more
            friction += more
        std += seal.uncertainty.std(friction)
        margin = 0.01 * (seal.pressure_max - seal.pressure_min)
        inside = inside and seal.pressure_min - margin <= pressure <= seal.pressure_max + margin
    return ActuatorFriction(total, std, stiction, inside, added)
