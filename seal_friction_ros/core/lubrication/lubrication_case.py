"""Input of a run: parsed document of a case file (YAML mapping) -> `LubricationCase`.

Example; docs/ehl.md describes every field::

    name: inner_seal
    source: where the numbers are from
    seal: {interference: 36.0e-6}
    motion: {distance: 1.8e-3}
    control_edge: {position: 0.3e-3}     # optional, like film_supply and viscoelasticity
    oring: ms28775_114_blind             # in the place of the profile of the seal: a case of config/oring
    unknown: {seal.solid_shear_stress: {factor: 2.0}}   # for the uncertainty of a friction map
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import (
    CheckedParameters,
    check_names,
    from_mapping,
    meanings,
    name_and_source,
    parameter,
)
from seal_friction_ros.core.foundation.unknowns import Unknown, parse_unknowns
from seal_friction_ros.core.lubrication.grease import Grease
from seal_friction_ros.core.lubrication.groove import GrooveSpring
from seal_friction_ros.core.lubrication.kinematics import ConstantAcceleration
from seal_friction_ros.core.lubrication.topography import Topography
from seal_friction_ros.core.lubrication.wall import ControlEdge, FilmSupply
from seal_friction_ros.core.oring_contact.oring_case import OringCase
from seal_friction_ros.core.oring_contact.oring_case_file import FRICTION_COEFFICIENT, OringCaseFile, varied_ring

BODIES = ('half_plane', 'bonded_layer', 'finite_elements')
HOLDS = ('bottom', 'bottom_and_flanks', 'sliding_bottom')


@dataclass(frozen=True)
class SealBody(CheckedParameters):
    """Shape and material of the seal. Shape: our choice (the paper's is confidential); material: Table 1.

    Raises:
        ValueError: A value is out of bounds, or the material has no stiffness.
    """

    sealing_diameter: float = parameter(
        6e-3, unit='m', lower=1e-4, upper=10.0, description='Of the seat (paper: 6 mm).'
    )
    crown_radius_left: float = parameter(
        1e-3, unit='m', lower=1e-5, upper=1.0, description='Radius of the profile left of its crown.'
    )
    crown_radius_right: float = parameter(
        1e-3, unit='m', lower=1e-5, upper=1.0, description='Radius of the profile right of its crown.'
    )
    interference: float = parameter(
        36e-6, unit='m', lower=0.0, upper=1e-2, description='How far the undeformed crown overlaps the wall.'
    )
    section_height: float = parameter(
        1e-3, unit='m', lower=1e-5, upper=0.1, description='Depth at which the seal is held.'
    )
    body: str = parameter(
        'half_plane',
        unit='',
        description='half_plane: the kernel of a half-plane, zero at the section height. bonded_layer: an '
        'incompressible layer of that height, bonded to a rigid base. finite_elements: a crowned section of it.',
    )
    section_width: float = parameter(
        1.5e-3, unit='m', lower=1e-5, upper=1.0, description='Between the flanks of the section; for finite_elements.'
    )
    section_hold: str = parameter(
        'bottom',
        unit='',
        description='What the groove holds; for finite_elements. bottom: it sticks, the flanks are free. '
        'bottom_and_flanks: the flanks do not move along the axis either. sliding_bottom: the bottom slides freely.',
    )
    mooney_c10: float = parameter(0.0, unit='Pa', lower=0.0, upper=1e9, description='C_10.')
    mooney_c01: float = parameter(1.785e6, unit='Pa', lower=0.0, upper=1e9, description='C_01.')
    solid_shear_stress: float = parameter(
        1.5e6, unit='Pa', lower=0.0, upper=1e9, description='tau_c on the real area of contact.'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.body not in BODIES:
            raise ValueError(f'SealBody.body = {self.body!r} is not one of {", ".join(BODIES)}')
        if self.section_hold not in HOLDS:
            raise ValueError(f'SealBody.section_hold = {self.section_hold!r} is not one of {", ".join(HOLDS)}')
        if self.body == 'finite_elements':
            self._check_section()
        if self.modulus <= 0.0:
            raise ValueError('SealBody.mooney_c10 and mooney_c01 are both 0 Pa: give the seal a stiffness')

    @property
    def modulus(self) -> float:
        """Plane-strain modulus at small strain E* = E / (1 - 1/4) with E = 6 (C_10 + C_01) [Pa]."""
        return 8.0 * (self.mooney_c10 + self.mooney_c01)

    def fall(self, place: FloatArray) -> FloatArray:
        """Depth of the profile below its crown [m] at a ``place`` from it [m]: a parabola on each side."""
        radius = np.where(place < 0.0, self.crown_radius_left, self.crown_radius_right)
        return np.asarray(place**2 / (2.0 * radius))

    def _check_section(self) -> None:
        if self.section_height >= 0.5 * self.sealing_diameter:
            raise ValueError(
                f'SealBody.section_height = {self.section_height} m reaches the axis: sealing_diameter = '
                f'{self.sealing_diameter} m'
            )
        lowest = self.section_height - float(self.fall(np.array([-0.5, 0.5]) * self.section_width).max())
        if lowest < 0.2 * self.section_height:
            raise ValueError(
                f'SealBody.section_width = {self.section_width} m leaves {lowest:.3g} m of section_height = '
                f'{self.section_height} m at the flanks: make it narrower, or the crown radii larger'
            )


@dataclass(frozen=True)
class AirPressure(CheckedParameters):
    """Air pressure on both sides of the seal, above the cavitation pressure of the film (ambient)."""

    pressure_left: float = parameter(0.0, unit='Pa', lower=0.0, upper=1e8, description='Gauge.')
    pressure_right: float = parameter(0.0, unit='Pa', lower=0.0, upper=1e8, description='Gauge.')
    pressure_interference: float = parameter(
        6e-11,
        unit='m/Pa',
        lower=0.0,
        upper=1e-6,
        description='Interference that a pressure difference adds through the groove (our choice: 36 um at 6 bar).',
    )

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
class LubricationNumerics(CheckedParameters):
    """Grid and time step."""

    cells: int = parameter(226, unit='1', lower=32, upper=4000, description='Cells of the film (paper: 226 nodes).')
    film_width: float = parameter(0.6e-3, unit='m', lower=1e-5, upper=0.1, description='Length of the film region.')
    time_step: float = parameter(5e-4, unit='s', lower=1e-7, upper=0.1, description='Before any halving.')
    steps_at_once: int = parameter(
        1, unit='1', lower=1, upper=16,
        description='So many time steps in one, while no loaded part of the seal is on the rounding of a control edge.',
    )  # fmt: skip
    section_elements: int = parameter(
        48, unit='1', lower=8, upper=256, description='Finite elements along the film, if seal.body is finite_elements.'
    )


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


@dataclass(frozen=True)
class MapGrid(CheckedParameters):
    """Velocities and pressures of the friction map.

    Raises:
        ValueError: A value is out of bounds, or a range has no extent.
    """

    velocity_min: float = parameter(1e-4, unit='m/s', lower=1e-7, upper=10.0, description='Lowest speed.')
    velocity_max: float = parameter(0.1, unit='m/s', lower=1e-6, upper=100.0, description='Highest speed.')
    velocities: int = parameter(20, unit='1', lower=2, upper=200, description='Speeds, in equal ratios.')
    pressure_max: float = parameter(6e5, unit='Pa', lower=1.0, upper=1e8, description='Highest pressure; lowest is 0.')
    pressures: int = parameter(6, unit='1', lower=2, upper=100, description='Pressures, in equal steps.')

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.velocity_max <= self.velocity_min:
            raise ValueError(
                f'MapGrid.velocity_max = {self.velocity_max} m/s is not above velocity_min = {self.velocity_min} m/s'
            )


_WITHOUT_AIR = {
    'film_supply': 'air that enters a starved film is not modelled',
    'control_edge': 'air in the open gap is choked and its force on the seal is not known (docs/ehl.md)',
}


@dataclass(frozen=True, kw_only=True)
class LubricationCase:
    """One seal, its wall, lubricant and motion.

    Raises:
        ValueError: Two parts contradict each other.
    """

    name: str
    source: str = ''
    seal: SealBody = field(default_factory=SealBody)
    topography: Topography = field(default_factory=Topography)
    grease: Grease = field(default_factory=Grease)
    groove: GrooveSpring = field(default_factory=GrooveSpring)
    air: AirPressure = field(default_factory=AirPressure)
    motion: ConstantAcceleration = field(default_factory=ConstantAcceleration)
    numerics: LubricationNumerics = field(default_factory=LubricationNumerics)
    study: ShearStressStudy = field(default_factory=ShearStressStudy)
    map: MapGrid = field(default_factory=MapGrid)
    control_edge: ControlEdge | None = None
    film_supply: FilmSupply | None = None
    viscoelasticity: Viscoelasticity | None = None
    oring: OringCase | None = None
    """finite-element ring in the place of the profile of ``seal``; it has a friction map only"""
    unknown: tuple[Unknown, ...] = ()
    """numbers that are not known exactly, those of the ring with ``oring.`` before their names"""

    def __post_init__(self) -> None:
        if self.oring is None and self.seal.section_height < self.numerics.film_width:
            raise ValueError(
                f'case {self.name}: seal.section_height = {self.seal.section_height} m is less than '
                f'numerics.film_width = {self.numerics.film_width} m: the half-plane needs more depth than width'
            )
        if self.seal.body == 'finite_elements' and self.seal.section_width <= self.numerics.film_width:
            raise ValueError(
                f'case {self.name}: seal.section_width = {self.seal.section_width} m is not above '
                f'numerics.film_width = {self.numerics.film_width} m'
            )
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

    @property
    def interference(self) -> float:
        """Interference, including the part that the pressure difference adds [m]."""
        return self.seal.interference + self.air.pressure_interference * self.air.difference

    @property
    def seated_groove(self) -> GrooveSpring:
        """Groove spring in use: a pressure difference holds the seal on one flank (paper, section 7.4)."""
        return dataclasses.replace(self.groove, half_clearance=0.0) if self.air.difference > 0.0 else self.groove


_OPTIONAL: dict[str, type] = {
    'control_edge': ControlEdge,
    'film_supply': FilmSupply,
    'viscoelasticity': Viscoelasticity,
}
_PARTS: dict[str, Any] = {
    part.name: part.default_factory
    for part in dataclasses.fields(LubricationCase)
    if part.default_factory is not dataclasses.MISSING
} | _OPTIONAL


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


def _no_oring(name: str) -> OringCaseFile:
    raise ValueError(f'oring = {name!r}: there are no O-ring cases here')


def parse_lubrication_case(
    document: Any, load_oring: Callable[[str], OringCaseFile] = _no_oring
) -> LubricationCase | Spool:
    """Parse the document of a case file: a spool if it has ``seals``, else a case.

    Args:
        document: Mapping of a YAML file.
        load_oring: Gives the O-ring case file of a name or path.

    Raises:
        ValueError: A value is invalid; the message names case, field, value and bound.
    """
    name, source = name_and_source(document, 'case')
    known = ('name', 'source', *(('seals', 'motion') if 'seals' in document else ('oring', 'unknown', *_PARTS)))
    check_names(document, sorted(known), f'case {name}')
    if 'seals' in document:
        return _parse_spool(document, name, source)
    parts: dict[str, Any] = {
        key: from_mapping(record, document[key] if document[key] is not None else {}, f'case {name}: {key}')
        for key, record in _PARTS.items()
        if key in document
    }
    unknown: tuple[Unknown, ...] = ()
    if 'oring' in document:
        file = _oring(document, f'case {name}', load_oring)
        parts['oring'] = file.case
        unknown = tuple(
            dataclasses.replace(one, name=f'{_OF_RING}{one.name}')
            for one in file.unknown
            if one.name != FRICTION_COEFFICIENT
        )
    case = LubricationCase(name=name, source=source, **parts)
    if 'unknown' in document:
        unknown = _unknown(document, case) + unknown
    return dataclasses.replace(case, unknown=unknown)


def _oring(document: Mapping[str, Any], where: str, load_oring: Callable[[str], OringCaseFile]) -> OringCaseFile:
    """The ring of a case, which takes nothing of a profile, an air pressure or a motion over a control edge."""
    if not isinstance(document['oring'], str):
        raise ValueError(f'{where}: oring = {document["oring"]!r} is not the name or path of an O-ring case')
    unused = [part for part in ('groove', 'air', *_OPTIONAL) if part in document]
    unused += [f'seal.{key}' for key in document.get('seal') or () if key != 'solid_shear_stress']
    if unused:
        raise ValueError(f'{where}: {", ".join(unused)} has no meaning for an O-ring: leave it out')
    return load_oring(document['oring'])


def _parse_spool(document: Mapping[str, Any], name: str, source: str) -> Spool:
    seals = document['seals']
    if not isinstance(seals, list):
        raise ValueError(f'spool {name}: seals = {seals!r} is not a list')
    members = tuple(from_mapping(SpoolSeal, seal, f'spool {name}: seals[{i}]') for i, seal in enumerate(seals))
    motion = from_mapping(ConstantAcceleration, document.get('motion', {}), f'spool {name}: motion')
    return Spool(name, source, motion, members)


# -- what is not known ------------------------------------------------------------------------------------------------

_OF_RING = 'oring.'
_OF_RINGS_FILM = ('seal.solid_shear_stress', 'topography.', 'grease.')
_MAY_BE_UNKNOWN = ('seal', 'topography', 'grease', 'groove', 'air')


def varied_case(case: LubricationCase, values: Mapping[str, float]) -> LubricationCase:
    """A case with other ``values`` of its unknowns, by their names, and nothing unknown.

    A surface with another ``rms_height`` or ``roll_off_length`` is the same one, stretched: its slope goes with height
    over length. The ``rms_slope`` among the values is that before the stretch (our choice).

    Raises:
        ValueError: There is no such case.
    """
    parts: dict[str, dict[str, float]] = {}
    for name, value in values.items():
        part, _, field_name = name.partition('.')
        parts.setdefault(part, {})[field_name] = value
    if 'topography' in parts:
        was, surface = case.topography, parts['topography']
        higher = surface.get('rms_height', was.rms_height) / was.rms_height
        longer = surface.get('roll_off_length', was.roll_off_length) / was.roll_off_length
        surface['rms_slope'] = surface.get('rms_slope', was.rms_slope) * higher / longer
    ring = parts.pop('oring', None)
    oring = varied_ring(case.oring, ring) if case.oring and ring else case.oring
    changed = {part: dataclasses.replace(getattr(case, part), **fields) for part, fields in parts.items()}
    return dataclasses.replace(case, **changed, oring=oring, unknown=())


def _unknown(document: Mapping[str, Any], case: LubricationCase) -> tuple[Unknown, ...]:
    """Unknowns of a case file; the case is possible at both ends of each."""
    records = {part: getattr(case, part) for part in _MAY_BE_UNKNOWN}
    known = {f'{part}.{name}': getattr(record, name) for part, record in records.items() for name in meanings(record)}
    known = {name: value for name, value in known.items() if isinstance(value, float)}
    if case.oring is not None:
        known = {name: value for name, value in known.items() if name.startswith(_OF_RINGS_FILM)}
    return parse_unknowns(document['unknown'], known, partial(varied_case, case), f'case {case.name}: unknown')
