r"""Case of a study: a `LubricationCase` with a motion of its own, walls, air and creep; or a spool of several seals.

Example::

    name: inner_seal
    source: where the numbers are from
    seal: {interference: 36.0e-6}
    motion: {distance: 1.8e-3}
    control_edge: {position: 0.3e-3}     # optional, like film_supply and viscoelasticity
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from seal_friction_ros.core.foundation.parameters import (
    CheckedParameters,
    check_names,
    from_mapping,
    name_and_source,
    parameter,
)
from seal_friction_ros.core.lubrication.elasticity import ElasticBody
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase, PressureSqueeze, no_oring, parse_case
from seal_friction_ros.core.lubrication.seal_section import BODIES, LubricationNumerics, SealBody
from seal_friction_ros.core.oring_contact.oring_case_file import OringCaseFile
from seal_friction_studies.core.bonded_layer import bonded_layer
from seal_friction_studies.core.groove import GrooveSpring
from seal_friction_studies.core.kinematics import ConstantAcceleration
from seal_friction_studies.core.wall import ControlEdge, FilmSupply


@dataclass(frozen=True)
class StudySeal(SealBody):
    """Seal whose body may also be a layer bonded to a rigid base."""

    body: str = parameter(
        'half_plane',
        unit='',
        choices=(*BODIES, 'bonded_layer'),
        description='half_plane: held at the section height. bonded_layer: incompressible, that high, on a rigid base. '
        'finite_elements: a crowned section.',
    )


@dataclass(frozen=True)
class AirPressure(PressureSqueeze):
    """Air pressure on both sides of the seal, above the cavitation pressure of the film (ambient)."""

    pressure_left: float = parameter(0.0, unit='Pa', lower=0.0, upper=1e8, description='Gauge.')
    pressure_right: float = parameter(0.0, unit='Pa', lower=0.0, upper=1e8, description='Gauge.')

    @property
    def difference(self) -> float:
        """Magnitude of the pressure difference [Pa]."""
        return abs(self.pressure_left - self.pressure_right)


@dataclass(frozen=True)
class Viscoelasticity(CheckedParameters):
    r"""Seal that is stiffer when loaded fast; the Mooney-Rivlin stiffness is the relaxed one.

    A generalised Kelvin solid: the compliance is at once :math:`1 / (1 + s)` of the relaxed one, and the rest creeps in
    equal shares with the times :math:`\tau, 10 \tau, 100 \tau, \dots`. With ``decades`` 0 it is the standard linear
    solid.

    Source: spool-valve paper, section 7.4, for the effect; model and numbers are our choice.
    """

    stiffening: float = parameter(
        1.0, unit='1', lower=0.0, upper=100.0, description='Instantaneous over relaxed modulus, less 1.'
    )
    relaxation_time: float = parameter(
        0.3, unit='s', lower=1e-6, upper=1e6, description='Shortest time constant of creep under constant pressure.'
    )
    decades: int = parameter(0, unit='1', lower=0, upper=8, description='Decades of time that the creep spans.')

    @property
    def creep(self) -> tuple[tuple[float, float], ...]:
        """Share of the relaxed compliance and time constant [s] of each part that creeps."""
        share = self.stiffening / (1.0 + self.stiffening) / (self.decades + 1)
        return tuple((share, self.relaxation_time * 10.0**k) for k in range(self.decades + 1))


@dataclass(frozen=True)
class StudyNumerics(LubricationNumerics):
    """Grid and time step."""

    time_step: float = parameter(5e-4, unit='s', lower=1e-7, upper=0.1, description='Before any halving.')
    steps_at_once: int = parameter(
        1, unit='1', lower=1, upper=16,
        description='Time steps in one, while no loaded part of the seal is on the rounding of a control edge.',
    )  # fmt: skip


@dataclass(frozen=True)
class ShearStressStudy(CheckedParameters):
    """Study of section 7.2: the case with other solid shear stresses.

    Raises:
        ValueError: A value is out of bounds, or there is none.
    """

    solid_shear_stresses: tuple[float, ...] = parameter(
        (0.5e6, 0.75e6, 1.0e6, 1.25e6, 1.5e6, 1.75e6, 2.0e6, 2.25e6, 2.5e6),
        unit='Pa',
        lower=1e3,
        upper=1e9,
        description='tau_c of each run.',
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.solid_shear_stresses:
            raise ValueError('ShearStressStudy.solid_shear_stresses is empty')


_WITHOUT_AIR = {
    'film_supply': 'air that enters a starved film is not modelled',
    'control_edge': 'air in the open gap is choked and its force on the seal is not known (docs/ehl.md)',
}


@dataclass(frozen=True, kw_only=True)
class StudyCase(LubricationCase):
    """One seal, its wall, lubricant and motion.

    Raises:
        ValueError: Two parts contradict each other.
    """

    OPTIONAL: ClassVar = {
        'control_edge': ControlEdge,
        'film_supply': FilmSupply,
        'viscoelasticity': Viscoelasticity,
    }

    seal: StudySeal = field(default_factory=StudySeal)
    groove: GrooveSpring = field(default_factory=GrooveSpring)
    air: AirPressure = field(default_factory=AirPressure)
    motion: ConstantAcceleration = field(default_factory=ConstantAcceleration)
    numerics: StudyNumerics = field(default_factory=StudyNumerics)
    study: ShearStressStudy = field(default_factory=ShearStressStudy)
    control_edge: ControlEdge | None = None
    film_supply: FilmSupply | None = None
    viscoelasticity: Viscoelasticity | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        held_flanks = self.seal.body == 'finite_elements' and self.seal.section_hold == 'bottom_and_flanks'
        if held_flanks and self.groove.half_clearance > 0.0:
            raise ValueError(
                f'case {self.name}: groove.half_clearance = {self.groove.half_clearance} m leaves the flanks free, but '
                f'seal.section_hold is {self.seal.section_hold}'
            )
        if self.air.pressure_left or self.air.pressure_right:
            for part, reason in _WITHOUT_AIR.items():
                if getattr(self, part):
                    raise ValueError(
                        f'case {self.name}: {part} needs both sides at ambient pressure, since {reason}: leave out '
                        f'air, or {part}'
                    )

    def elastic_body(self) -> ElasticBody:
        """Body under the film; errors as of `seal_body`."""
        if self.seal.body != 'bonded_layer':
            return super().elastic_body()
        numerics = self.numerics
        return bonded_layer(
            numerics.cells, numerics.film_width / numerics.cells, self.seal.modulus, self.seal.section_height
        )

    @property
    def interference(self) -> float:
        """Interference, including the part that the pressure difference adds [m]."""
        return self.seal.interference + self.air.pressure_interference * self.air.difference

    @property
    def seated_groove(self) -> GrooveSpring:
        """Groove spring in use: a pressure difference holds the seal on one flank (paper, section 7.4)."""
        return dataclasses.replace(self.groove, half_clearance=0.0) if self.air.difference > 0.0 else self.groove


@dataclass(frozen=True)
class SpoolSeal(CheckedParameters):
    """One seal of a spool with several."""

    case: str  # name of its case
    mirrored: bool = False  # mounted in the opposite direction: its case moves in the opposite direction
    shift: float = parameter(
        0.0, unit='m', lower=-1.0, upper=1.0, description='Where the spool stands when the case is at 0.'
    )


@dataclass(frozen=True)
class Spool:
    """Several seals on one spool; the friction of the spool is their sum.

    Raises:
        ValueError: There is no seal.
    """

    name: str
    source: str
    motion: ConstantAcceleration
    members: tuple[SpoolSeal, ...]

    def __post_init__(self) -> None:
        if not self.members:
            raise ValueError(f'spool {self.name}: seals is empty')


def parse_study_case(document: Any, load_oring: Callable[[str], OringCaseFile] = no_oring) -> StudyCase | Spool:
    """Parse the document of a case file: a spool if it has ``seals``, else a case; as `parse_case`."""
    if not isinstance(document, Mapping) or 'seals' not in document:
        return parse_case(StudyCase, document, load_oring)
    name, source = name_and_source(document, 'case')
    check_names(document, ('motion', 'name', 'seals', 'source'), f'case {name}')
    seals = document['seals']
    if not isinstance(seals, list):
        raise ValueError(f'spool {name}: seals = {seals!r} is not a list')
    members = tuple(from_mapping(SpoolSeal, seal, f'spool {name}: seals[{i}]') for i, seal in enumerate(seals))
    motion = from_mapping(ConstantAcceleration, document.get('motion', {}), f'spool {name}: motion')
    return Spool(name, source, motion, members)
