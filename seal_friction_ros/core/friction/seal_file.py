"""The document of a seal file (a mapping, as YAML or JSON give it) <-> `Seal`. Laws are chosen by name.

A seal file looks like this; every law and every field is in docs/seal_files.md::

    name: ms28775_114
    source: where the numbers are from
    geometry: {section_diameter: 2.69e-3, ...}
    coulomb_law: physics_based          # or another of `FRICTION_LAWS`, with its parameters under the name of the law
    normal_force: {law: area_deformation_gain, area_deformation_gain: 0.39, radial_force: 9.3}
    friction_coefficient: {law: power_law, coefficient: 2.1, exponent: 0.56}
    stiction: 2.5
    uncertainty: {relative_std: 0.08, absolute_std: 0.3}
    identified_pressure: [0.0, 6.9e+6]

Optional are ``velocity_terms``, ``pressure_asymmetry``, ``presliding``, ``stiction_ratio``, ``friction_scale``,
``identified_speed``, ``identified_directions``, ``mounting``, ``force_sum_correction``, ``temperature``,
``covariance``, and ``identification``: what ``seal_friction identify`` reports about its data. This module ignores the
latter.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from seal_friction_ros.core.foundation.parameters import (
    check_names,
    from_mapping,
    meanings,
    name_and_source,
    printable,
)
from seal_friction_ros.core.friction.actuator import MountedSeal, Seal, Uncertainty
from seal_friction_ros.core.friction.force_sum_correction import ForceSumCorrection
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.identified_motion import IdentifiedMotion
from seal_friction_ros.core.friction.laws import FRICTION_LAWS
from seal_friction_ros.core.friction.laws.contact_shear import ContactShear
from seal_friction_ros.core.friction.laws.friction_coefficient import FRICTION_COEFFICIENT_LAWS, FrictionCoefficientLaw
from seal_friction_ros.core.friction.laws.law import FrictionLaw, Law
from seal_friction_ros.core.friction.laws.normal_force import NORMAL_FORCE_LAWS, NormalForceLaw
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.mounting import Mounting
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.pressure_asymmetry import PressureAsymmetry
from seal_friction_ros.core.friction.temperature import TemperatureScale
from seal_friction_ros.core.friction.term_covariance import TermCovariance

_COMMON = {
    'name', 'source', 'geometry', 'coulomb_law', 'stiction', 'stiction_ratio', 'velocity_terms', 'uncertainty',
    'identified_pressure', 'identified_speed', 'identified_directions', 'identification', 'mounting',
    'force_sum_correction', 'friction_scale', 'presliding', 'temperature', 'pressure_asymmetry',
    'covariance',
}  # fmt: skip
_PARTS: dict[type, str] = {
    SealGeometry: 'geometry',
    NormalForceLaw: 'normal_force',
    FrictionCoefficientLaw: 'friction_coefficient',
}
"""Type of a field of a law -> key of the seal file that holds it."""
_LAWS_OF_PART: dict[type, Mapping[str, type[Law]]] = {
    NormalForceLaw: NORMAL_FORCE_LAWS,
    FrictionCoefficientLaw: FRICTION_COEFFICIENT_LAWS,
}


_OPTIONAL: dict[str, type] = {
    'velocity_terms': VelocityTerms,
    'pressure_asymmetry': PressureAsymmetry,
    'presliding': Presliding,
    'force_sum_correction': ForceSumCorrection,
    'temperature': TemperatureScale,
    'covariance': TermCovariance,
}
"""Part of a seal that a file may have -> its record"""


def parse_seal(document: Any) -> Seal:
    """Make a seal from the document of a seal file.

    ValueError: the document is not valid; the message names the seal, the field, its value and its bound.
    """
    name, _ = name_and_source(document, 'seal')
    where = f'seal {name}'
    laws = {law.NAME: law for law in FRICTION_LAWS}
    law_type = laws[_choice(document, 'coulomb_law', laws, where)]
    check_names(document, sorted(_COMMON | keys_of_law(law_type)), f'{where}: {law_type.NAME}')
    law = _friction_law(law_type, document, where)
    optional = {
        key: from_mapping(record, document[key], f'{where}: {key}') if key in document else None
        for key, record in _OPTIONAL.items()
    }
    _check_terms(optional['covariance'], law_type, where)
    about = document.get('identification', {})
    if not isinstance(about, Mapping) or not _can_be_recorded(about):
        raise ValueError(f'{where}: identification is not a mapping of texts, finite numbers, and lists of them')
    uncertainty = from_mapping(Uncertainty, document.get('uncertainty'), f'{where}: uncertainty')
    pressures = _ends(document, 'identified_pressure', 'pressures [Pa]', where)
    mounting_of(document)
    numbers = {'pressure_min': pressures[0], 'pressure_max': pressures[1]}
    numbers |= {key: document[key] for key in ('stiction', 'stiction_ratio', 'friction_scale') if key in document}
    motion: dict[str, Any] = {}
    if 'identified_speed' in document:
        motion['slowest'], motion['fastest'] = _ends(document, 'identified_speed', 'speeds [m/s]', where)
    if 'identified_directions' in document:
        motion['directions'] = document['identified_directions']
    made = {
        'name': name,
        'coulomb_law': law,
        'uncertainty': uncertainty,
        'identified_motion': from_mapping(IdentifiedMotion, motion, f'{where}: identified'),
        **optional,
    }
    return from_mapping(Seal, numbers, where, **made)


def _check_terms(covariance: TermCovariance | None, law_type: type[FrictionLaw], where: str) -> None:
    of_part = law_type.FITTED_PART[1] if law_type.FITTED_PART else law_type
    known = {**meanings(law_type), **meanings(of_part), **meanings(VelocityTerms)}
    wrong = [term for term in (covariance.terms if covariance else ()) if term not in known]
    if wrong:
        raise ValueError(f'{where}: covariance: {wrong[0]} is no parameter of {law_type.NAME}: {", ".join(known)}')


def _ends(document: Mapping[str, Any], key: str, what: str, where: str) -> Any:
    """The two ends of an identified range."""
    ends = document.get(key)
    if not isinstance(ends, list | tuple) or len(ends) != 2:
        raise ValueError(f'{where}: {key} = {ends!r} is not a list of two {what}')
    return ends


def mounting_of(document: Any) -> Mounting | None:
    """How the seals of a seal file are mounted; None if its document does not tell.

    ValueError: the mounting is not valid; the message names the seal and the chamber.
    """
    if not isinstance(document, Mapping) or 'mounting' not in document:
        return None
    return from_mapping(Mounting, document['mounting'], f'seal {printable(document.get("name"))}: mounting')


def law_document(law: FrictionLaw) -> dict[str, Any]:
    """The part of a seal file that describes a friction law: what `parse_seal` makes the law from."""
    document: dict[str, Any] = {'coulomb_law': law.NAME}
    for field in _fields(type(law)):
        if field.type in _PARTS:
            document[_PARTS[field.type]] = _part_document(getattr(law, field.name))
    if meanings(law):
        document[law.PART or law.NAME] = _parameters(law)
    return document


def mount_seals(documents: tuple[Any, ...], chambers: tuple[str, ...]) -> tuple[MountedSeal, ...]:
    """Seals of an actuator from their documents and the chamber of each, one of `CHAMBERS`.

    ValueError: there are not as many chambers as seals, or a document or chamber is not valid.
    """
    if len(documents) != len(chambers):
        raise ValueError(
            f'seals has {len(documents)} entries but seal_chambers has {len(chambers)}: give one chamber a seal'
        )
    return tuple(MountedSeal(parse_seal(d), chamber) for d, chamber in zip(documents, chambers, strict=True))


def _fields(law_type: type[FrictionLaw]) -> list[dataclasses.Field[Any]]:
    return [field for field in dataclasses.fields(law_type) if field.init]


def keys_of_law(law_type: type[FrictionLaw]) -> set[str]:
    """Keys of a seal file that a law takes: its parts, and the one with its parameters."""
    keys = {_PARTS[field.type] for field in _fields(law_type) if field.type in _PARTS}
    return keys | ({law_type.PART or law_type.NAME} if meanings(law_type) else set())


def _friction_law(law_type: type[FrictionLaw], document: Mapping[str, Any], where: str) -> FrictionLaw:
    parts = {f.name: parse_part(f.type, document, where) for f in _fields(law_type) if f.type in _PARTS}
    if 'geometry' in document and 'geometry' not in parts:  # the law does not use it, but a wrong one is still wrong
        parse_part(SealGeometry, document, where)
    if not meanings(law_type):
        return law_type(**parts)
    key = law_type.PART or law_type.NAME
    if law_type is ContactShear:
        check_no_exponent(
            document.get(key), f'{where}: {key}', 'compute the seal again with seal_friction oring or section'
        )
    return from_mapping(law_type, document.get(key), f'{where}: {key}', **parts)


def check_no_exponent(values: Any, where: str, what_to_do: str) -> None:
    """Check that the values of a `contact_shear` are not those of an older law, whose stress was a power."""
    if isinstance(values, Mapping) and 'exponent' in values:
        raise ValueError(f'{where}: exponent is of an older law: {what_to_do}')


def parse_part(part_type: Any, document: Mapping[str, Any], where: str) -> Any:
    """Geometry, or the law that ``law`` names, from its key of a document, which ``where`` names in error messages.

    ``part_type`` is `SealGeometry`, `NormalForceLaw` or `FrictionCoefficientLaw`. ValueError: the part is missing or
    not valid.
    """
    key = _PARTS[part_type]
    part, where = document.get(key), f'{where}: {key}'
    if part_type not in _LAWS_OF_PART:
        return from_mapping(part_type, part, where)
    if not isinstance(part, Mapping):
        raise ValueError(f'{where} = {part!r} is not a mapping of names to values')
    laws = _LAWS_OF_PART[part_type]
    law_type = laws[_choice(part, 'law', laws, where)]
    return from_mapping(law_type, {k: v for k, v in part.items() if k != 'law'}, where)


def _part_document(part: Any) -> dict[str, Any]:
    """Inverse of `parse_part`."""
    names = {law: name for laws in _LAWS_OF_PART.values() for name, law in laws.items()}
    chosen = {'law': names[type(part)]} if type(part) in names else {}
    return chosen | _parameters(part)


def _parameters(record: Any) -> dict[str, Any]:
    values = {name: getattr(record, name) for name in meanings(record)}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def _can_be_recorded(value: Any) -> bool:
    """Whether a value can be kept in a bag: what JSON can hold."""
    if isinstance(value, Mapping):
        return all(isinstance(key, str) and _can_be_recorded(item) for key, item in value.items())
    if isinstance(value, list | tuple):
        return all(map(_can_be_recorded, value))
    return value is None or isinstance(value, str | int) or (isinstance(value, float) and math.isfinite(value))


def _choice(document: Mapping[str, Any], key: str, choices: Any, where: str) -> str:
    value = document.get(key)
    if value not in tuple(choices):
        raise ValueError(f'{where}: {key} = {value!r} is not one of {", ".join(choices)}')
    return str(value)
