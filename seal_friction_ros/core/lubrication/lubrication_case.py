"""Input of a friction map: parsed document of a case file (YAML mapping) -> `LubricationCase`.

Example; docs/ehl.md describes every field::

    name: oring_from_drawing
    source: where the numbers are from
    oring: ms28775_114_blind             # a case of config/oring, in the place of the profile of the seal
    seal: {solid_shear_stress: 1.5e+6}
    motion: {speed: 10.0e-3}
    unknown: {seal.solid_shear_stress: {factor: 2.0}}   # for the uncertainty of the map
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar, TypeVar

from seal_friction_ros.core.foundation.parameters import (
    CheckedParameters,
    check_names,
    from_mapping,
    meanings,
    name_and_source,
    parameter,
)
from seal_friction_ros.core.foundation.unknowns import Unknown, parse_unknowns
from seal_friction_ros.core.lubrication.elasticity import ElasticBody
from seal_friction_ros.core.lubrication.grease import Grease
from seal_friction_ros.core.lubrication.seal_section import LubricationNumerics, SealBody, seal_body
from seal_friction_ros.core.lubrication.topography import Topography
from seal_friction_ros.core.oring_contact.oring_case import OringCase
from seal_friction_ros.core.oring_contact.oring_case_file import FRICTION_COEFFICIENT, OringCaseFile, varied_ring

Case = TypeVar('Case', bound='LubricationCase')


@dataclass(frozen=True)
class SealHold(CheckedParameters):
    """How seal and groove give way along the axis."""

    stiffness: float = parameter(
        2.2e4,
        unit='N/m',
        lower=10.0,
        upper=1e9,
        description='k, about G A / t: shear modulus, contact area and height of the seal.',
    )


@dataclass(frozen=True)
class PressureSqueeze(CheckedParameters):
    """How a pressure difference presses the seal on its wall."""

    pressure_interference: float = parameter(
        6e-11,
        unit='m/Pa',
        lower=0.0,
        upper=1e-6,
        description='Interference that a pressure difference adds through the groove (our choice: 36 um at 6 bar).',
    )


@dataclass(frozen=True)
class ReferenceMotion(CheckedParameters):
    """Speed at which the friction of a map counts as Coulomb friction."""

    speed: float = parameter(34e-3, unit='m/s', lower=1e-6, upper=10.0, description='Speed between the ends, v_max.')


@dataclass(frozen=True)
class MapGrid(CheckedParameters):
    """Velocities and pressures of the friction map; ValueError: a value is out of bounds, or a range has no extent."""

    velocity_min: float = parameter(1e-4, unit='m/s', lower=1e-7, upper=10.0, description='Lowest speed.')
    velocity_max: float = parameter(0.1, unit='m/s', lower=1e-6, upper=100.0, description='Highest speed.')
    velocities: int = parameter(20, unit='1', lower=2, upper=200, description='Speeds, in equal ratios.')
    pressure_max: float = parameter(6e5, unit='Pa', lower=1.0, upper=1e8, description='Highest pressure; lowest is 0.')
    pressures: int = parameter(6, unit='1', lower=2, upper=100, description='Pressures, in equal steps.')

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_order('velocity_max', 'velocity_min')


@dataclass(frozen=True, kw_only=True)
class LubricationCase:
    """One seal, its wall and lubricant; ValueError: two parts contradict each other."""

    OPTIONAL: ClassVar[Mapping[str, type]] = {}  # parts that act only if a case file names them

    name: str
    source: str = ''
    seal: SealBody = field(default_factory=SealBody)
    topography: Topography = field(default_factory=Topography)
    grease: Grease = field(default_factory=Grease)
    groove: SealHold = field(default_factory=SealHold)
    air: PressureSqueeze = field(default_factory=PressureSqueeze)
    motion: ReferenceMotion = field(default_factory=ReferenceMotion)
    numerics: LubricationNumerics = field(default_factory=LubricationNumerics)
    map: MapGrid = field(default_factory=MapGrid)
    oring: OringCase | None = None  # finite-element ring in the place of the profile of ``seal``
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

    def elastic_body(self) -> ElasticBody:
        """Body under the film; errors as of `seal_body`."""
        return seal_body(self.seal, self.numerics)

    @classmethod
    def parts(cls) -> dict[str, Any]:
        """Record of each part that a case file may have."""
        always = {one.name: one.default_factory for one in dataclasses.fields(cls)}
        return {name: made for name, made in always.items() if made is not dataclasses.MISSING} | dict(cls.OPTIONAL)


def no_oring(name: str) -> OringCaseFile:
    """Loader of O-ring cases where there are none; ValueError: always."""
    raise ValueError(f'oring = {name!r}: there are no O-ring cases here')


def parse_lubrication_case(document: Any, load_oring: Callable[[str], OringCaseFile] = no_oring) -> LubricationCase:
    """Parse the document of a case file; as `parse_case`."""
    return parse_case(LubricationCase, document, load_oring)


def parse_case(kind: type[Case], document: Any, load_oring: Callable[[str], OringCaseFile]) -> Case:
    """Parse the document of the file of a ``kind`` of case, `LubricationCase` or a class below it.

    ``load_oring`` gives the O-ring case file of a name or path. ValueError: a value is invalid; the message names case,
    field, value and bound.
    """
    name, source = name_and_source(document, 'case')
    known = kind.parts()
    check_names(document, sorted(('name', 'source', 'oring', 'unknown', *known)), f'case {name}')
    parts: dict[str, Any] = {
        key: from_mapping(record, document[key] if document[key] is not None else {}, f'case {name}: {key}')
        for key, record in known.items()
        if key in document
    }
    unknown: tuple[Unknown, ...] = ()
    if 'oring' in document:
        file = _oring(document, kind, f'case {name}', load_oring)
        parts['oring'] = file.case
        unknown = tuple(
            dataclasses.replace(one, name=f'{_OF_RING}{one.name}')
            for one in file.unknown
            if one.name != FRICTION_COEFFICIENT
        )
    case = kind(name=name, source=source, **parts)
    if 'unknown' in document:
        unknown = _unknown(document, case) + unknown
    return dataclasses.replace(case, unknown=unknown)


def _oring(
    document: Mapping[str, Any], kind: type[LubricationCase], where: str, load_oring: Callable[[str], OringCaseFile]
) -> OringCaseFile:
    """The ring of a case, which takes nothing of a profile or of its walls."""
    if not isinstance(document['oring'], str):
        raise ValueError(f'{where}: oring = {document["oring"]!r} is not the name or path of an O-ring case')
    unused = [part for part in ('groove', 'air', *kind.OPTIONAL) if part in document]
    unused += [f'seal.{key}' for key in document.get('seal') or () if key != 'solid_shear_stress']
    if unused:
        raise ValueError(f'{where}: {", ".join(unused)} has no meaning for an O-ring: leave it out')
    file = load_oring(document['oring'])
    if file.case.section is not None:
        raise ValueError(f'{where}: the film is computed for round rings: {file.case.name} has another section')
    return file


# -- what is not known ------------------------------------------------------------------------------------------------

_OF_RING = 'oring.'
_OF_RINGS_FILM = ('seal.solid_shear_stress', 'topography.', 'grease.')
_MAY_BE_UNKNOWN = ('seal', 'topography', 'grease', 'groove', 'air')


def varied_case(case: Case, values: Mapping[str, float]) -> Case:
    """A case with other ``values`` of its unknowns, by their names, and nothing unknown.

    A surface with another ``rms_height`` or ``roll_off_length`` is the same one, stretched: its slope goes with height
    over length. The ``rms_slope`` among the values is that before the stretch (our choice). ValueError: there is no
    such case.
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
