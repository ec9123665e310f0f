"""Case file of an O-ring: parsed document (YAML mapping) -> `OringCaseFile`.

Example; docs/oring.md describes every field::

    name: ms28775_114
    source: origin of the numbers
    geometry: {section_diameter: 2.62e-3, ring_inner_diameter: 15.54e-3, rod_diameter: ..., gland_diameter: ...}
    section: {shape: x_ring}            # optional: round without it; or outline: [[r, z], ...] [m]
    groove: {width: 3.6e-3, diametral_clearance: 0.1e-3}
    rubber: {hardness: 70.0}            # or elastic_modulus [Pa], or ogden_moduli; see `Rubber`
    pressures: [0.0, 3.4e+6, 6.9e+6]    # [Pa, gauge]
    friction:                           # optional: without it --reading or a prior
      contact_shear: {shear_stress: 0.1e6, knee_stress: 0.26e6}   # or friction_coefficient, as in a seal file
      stiction_ratio: 0.13
      uncertainty: {relative_std: 0.2}
    measured: {seals: 2, pressures: [...], frictions: [...], source: ...}   # optional: for comparison
    unknown: {rubber.hardness: {tolerance: 5.0}}    # optional: for the uncertainty of what is computed
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.parameters import (
    CheckedParameters,
    check_names,
    from_mapping,
    meanings,
    name_and_source,
    parameter,
)
from seal_friction_ros.core.foundation.units import in_si
from seal_friction_ros.core.foundation.unknowns import Unknown, parse_unknowns
from seal_friction_ros.core.friction.actuator import Uncertainty
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.laws.contact_shear import ShearLaw
from seal_friction_ros.core.friction.laws.friction_coefficient import FrictionCoefficientLaw
from seal_friction_ros.core.friction.seal_file import check_no_exponent, parse_part
from seal_friction_ros.core.oring_contact.material import Rubber, elastic_modulus_of_hardness, modulus_of_ogden
from seal_friction_ros.core.oring_contact.oring_case import Groove, OringCase, OringNumerics, check_pressures
from seal_friction_ros.core.oring_contact.ring_friction import RingLaw, SealFriction
from seal_friction_ros.core.oring_contact.section import Section, checked_outline, mirrored, rounded, section_of_shape

SECTION_TRANSITION = 0.01
"""`OringNumerics.transition` of other sections than round ones: the stress of a lip is low, so it has to be sharp."""
ROUNDED_TRANSITION = 0.005  # the same with a corner radius: the edge of a lip is lighter still (our choice)
SHAPE_CORNER = 0.02  # radius of the corners of a shape over its height, unless given (our choice)
SMALLEST_CORNER, LARGEST_CORNER = 0.005, 0.04
"""corner radius over the height: below it the mesh is too large, above it `section_mesh` does not see an arc"""
PTFE_MODULUS = 500.0e6  # [Pa] of PTFE at room temperature, 400 to 600 MPa (our choice)

_OF_ANY = ('mirrored', 'corner_radius')  # keys of a section of any shape
_KEYS = (
    'name', 'source', 'geometry', 'section', 'groove', 'rubber', 'cap', 'wall_friction', 'numerics', 'pressures',
    'friction', 'measured', 'unknown',
)  # fmt: skip


@dataclass(frozen=True)
class MeasuredFriction(CheckedParameters):
    """Measured friction, for comparison with the computed one.

    ValueError: a value is out of bounds, or the numbers of frictions and pressures differ.
    """

    seals: int = parameter(unit='', lower=1, upper=100, description='Number of seals in the measured friction.')
    pressures: tuple[float, ...] = parameter(
        unit='Pa', lower=0.0, upper=1e9, description='Gauge pressures, one per reading.'
    )
    frictions: tuple[float, ...] = parameter(
        unit='N', lower=0.0, upper=1e9, description='Sliding friction at each pressure.'
    )
    source: str = ''

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.frictions) != len(self.pressures) or not self.pressures:
            raise ValueError(
                f'MeasuredFriction: {len(self.frictions)} frictions at {len(self.pressures)} pressures: '
                'give one friction per pressure'
            )


@dataclass(frozen=True)
class OringCaseFile:
    """Content of a case file."""

    case: OringCase
    pressures: tuple[float, ...]  # [Pa, gauge], increasing
    source: str
    friction: SealFriction | None
    measured: MeasuredFriction | None
    unknown: tuple[Unknown, ...] = ()


@dataclass(frozen=True)
class _Pressures:
    pressures: tuple[float, ...]


def parse_oring_case(document: Any) -> OringCaseFile:
    """Parse the document of a case file.

    ValueError: a value is invalid; the message names case, field, value and bound.
    """
    name, source = name_and_source(document, 'case')
    where = f'case {name}'
    check_names(document, _KEYS, where)
    rubber = _rubber(document.get('rubber'), f'{where}: rubber')
    geometry = from_mapping(
        SealGeometry, document.get('geometry'), f'{where}: geometry', elastic_modulus=rubber.modulus
    )
    section, standard = None, {}
    if 'section' in document:
        section, transition = _section(document['section'], geometry, f'{where}: section')
        standard = {'transition': transition}
    case = from_mapping(
        OringCase,
        {'wall_friction': document['wall_friction']} if 'wall_friction' in document else {},
        where,
        name=name,
        geometry=geometry,
        groove=from_mapping(Groove, document.get('groove'), f'{where}: groove'),
        rubber=rubber,
        section=section,
        cap=_cap(document.get('cap'), section, f'{where}: cap'),
        numerics=from_mapping(OringNumerics, standard | document.get('numerics', {}), f'{where}: numerics'),
    )
    pressures = from_mapping(_Pressures, {'pressures': document.get('pressures')}, where).pressures
    check_pressures(case, pressures)
    if section is not None and document['section'].get('shape') == 'wiper' and pressures != (0.0,):
        raise ValueError(f'{where}: a wiper holds no pressure: give a pressure of 0 alone')
    friction = _friction(document, where)
    unknown = _unknown(document, case, friction is not None, where)
    measured = document.get('measured')
    if measured is not None:
        measured = from_mapping(MeasuredFriction, measured, f'{where}: measured')
    return OringCaseFile(case, pressures, source, friction, measured, unknown)


def _section(values: Any, geometry: SealGeometry, where: str) -> tuple[Section, float]:
    """Section of a shape with its proportions, or of an outline, which a piston has mirrored; and its transition.

    Corners of a shape that face the sliding wall are round; those of an outline are as drawn without a radius.
    """
    if not isinstance(values, Mapping) or ('shape' in values) == ('outline' in values):
        raise ValueError(f'{where}: give one of shape and outline; got {values!r}')
    others = {key: value for key, value in values.items() if key not in ('shape', 'outline', *_OF_ANY)}
    with named_errors(where):
        if 'shape' in values:
            section = section_of_shape(values['shape'], others)
        else:
            check_names(others, (), where)
            section = Section(checked_outline(np.array(values['outline'], dtype=float), 'outline'))
    section = mirrored(section) if values.get('mirrored') else section
    radius = SHAPE_CORNER if 'shape' in values else 0.0
    if 'corner_radius' in values:
        radius = in_si(values['corner_radius'], 'm', f'{where}: corner_radius') / geometry.section_diameter
    if radius == 0.0:
        return section, SECTION_TRANSITION
    if not SMALLEST_CORNER <= radius <= LARGEST_CORNER:
        raise ValueError(
            f'{where}: corner_radius is {radius:.3g} of the height of the section: 0, or {SMALLEST_CORNER} to '
            f'{LARGEST_CORNER}, can be computed'
        )
    found = rounded(section, radius * section.height, outside=geometry.sliding_wall == 'bore')
    return found, SECTION_TRANSITION if len(found.outline) == len(section.outline) else ROUNDED_TRANSITION


def _cap(values: Any, section: Section | None, where: str) -> Rubber | None:
    """Material of the cap; by default PTFE."""
    if section is None or section.cap is None:
        if values is not None:
            raise ValueError(f'{where}: the section has no cap')
        return None
    modulus = from_mapping(_Cap, {} if values is None else values, where).elastic_modulus
    with named_errors(where):
        return Rubber(elastic_modulus=modulus, bulk_modulus=20.0 * modulus)  # the smallest: nearly incompressible


def _rubber(values: Any, where: str) -> Rubber:
    """Rubber from either its modulus or its hardness."""
    given = {'hardness', 'elastic_modulus'} & set(values) if isinstance(values, Mapping) else set()
    if not isinstance(values, Mapping) or len(given) != 1 - ('ogden_moduli' in values and not given):
        raise ValueError(f'{where}: give one of hardness [Shore A] and elastic_modulus [Pa]; got {values!r}')
    others = {key: value for key, value in values.items() if key != 'hardness'}
    if 'hardness' in values:
        hardness = from_mapping(_Hardness, {'hardness': values['hardness']}, where).hardness
        with named_errors(where):
            others['elastic_modulus'] = elastic_modulus_of_hardness(hardness)
    elif not given:
        found = from_mapping(Rubber, {**others, 'elastic_modulus': 1e6}, where)
        others['elastic_modulus'] = modulus_of_ogden(found.ogden_moduli, found.ogden_exponents)
    return from_mapping(Rubber, others, where)


@dataclass(frozen=True)
class _Cap:
    elastic_modulus: float = PTFE_MODULUS


@dataclass(frozen=True)
class _Hardness:
    hardness: float


@dataclass(frozen=True)
class _Stiction(CheckedParameters):
    stiction: float = parameter(
        0.0, unit='N', lower=0.0, upper=1e6, description='Breakaway friction above Coulomb friction.'
    )
    stiction_ratio: float = parameter(
        0.0, unit='1', lower=0.0, upper=10.0, description='The same, as a share of the Coulomb friction.'
    )


def _friction(document: Mapping[str, Any], where: str) -> SealFriction | None:
    values = document.get('friction')
    if values is None:
        return None
    where = f'{where}: friction'
    allowed = ('contact_shear', 'friction_coefficient', 'stiction', 'stiction_ratio', 'uncertainty')
    if not isinstance(values, Mapping) or not set(values) <= set(allowed):
        raise ValueError(f'{where} = {values!r} is not a mapping of {", ".join(allowed)}')
    if ('contact_shear' in values) == ('friction_coefficient' in values):
        raise ValueError(f'{where}: give one of contact_shear and friction_coefficient; got {", ".join(values)}')
    law: RingLaw
    if 'contact_shear' in values:
        key = f'{where}: contact_shear'
        check_no_exponent(values['contact_shear'], key, 'give shear_stress and knee_stress')
        law = from_mapping(ShearLaw, values['contact_shear'], key)
    else:
        law = parse_part(FrictionCoefficientLaw, values, where)
    stiction = from_mapping(_Stiction, {k: v for k, v in values.items() if k.startswith('stiction')}, where)
    uncertainty = from_mapping(Uncertainty, values.get('uncertainty'), f'{where}: uncertainty')
    return SealFriction(law, uncertainty, stiction.stiction, stiction.stiction_ratio)


# -- what is not known ------------------------------------------------------------------------------------------------

FRICTION_COEFFICIENT, HARDNESS = 'friction_coefficient', 'rubber.hardness'


def varied_ring(case: OringCase, values: Mapping[str, float]) -> OringCase:
    """A case with other ``values`` of its unknowns, by their names; a hardness [Shore A] gives the modulus.

    ValueError: there is no such ring.
    """
    parts: dict[str, dict[str, float]] = {}
    others: dict[str, Any] = {}
    for name, value in values.items():
        part, _, field = name.rpartition('.')
        if name == HARDNESS:
            parts.setdefault(part, {})['elastic_modulus'] = elastic_modulus_of_hardness(value)
        elif part:
            parts.setdefault(part, {})[field] = value
        elif name != FRICTION_COEFFICIENT:  # a factor on what is computed with the case
            others[name] = value
    changed = {part: replace(getattr(case, part), **fields) for part, fields in parts.items()}
    if 'rubber' in changed:
        changed['geometry'] = replace(changed.get('geometry', case.geometry), elastic_modulus=changed['rubber'].modulus)
    return replace(case, **changed, **others)


def _unknown(document: Mapping[str, Any], case: OringCase, has_friction: bool, where: str) -> tuple[Unknown, ...]:
    """Unknowns of a case file; the case is possible at both ends of each."""
    if 'unknown' not in document:
        return ()
    known = {'wall_friction': case.wall_friction} | ({FRICTION_COEFFICIENT: 1.0} if has_friction else {})
    for part in ('geometry', 'groove', 'rubber'):
        record = getattr(case, part)
        known |= {f'{part}.{name}': getattr(record, name) for name in meanings(record)}
    known = {name: value for name, value in known.items() if isinstance(value, float)}
    del known['geometry.elastic_modulus']
    if 'hardness' in document['rubber']:
        del known['rubber.elastic_modulus']
        known[HARDNESS] = float(document['rubber']['hardness'])
    return parse_unknowns(document['unknown'], known, partial(varied_ring, case), f'{where}: unknown')
