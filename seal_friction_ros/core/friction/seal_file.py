"""The document of a seal file (a mapping, as YAML or JSON give it) -> `Seal`. Laws are chosen by name.

A seal file looks like this; every law and every field is in docs/seal_files.md::

    name: ms28775_114
    source: where the numbers are from
    geometry: {section_diameter: 2.69e-3, ...}
    coulomb_law: physics_based          # or pressure_power_law, constant_coulomb, prior_art_chart, friction_map
    normal_force: {law: area_deformation_gain, area_deformation_gain: 0.39, radial_force: 9.3}
    friction_coefficient: {law: power_law, coefficient: 2.1, exponent: 0.56}
    stiction: 2.5
    uncertainty: {relative_std: 0.08, absolute_std: 0.3}
    identified_pressure: [0.0, 6.9e+6]

``velocity_terms`` and ``stiction_ratio`` may be left out, as may ``identification``, which holds what
``seal_friction identify`` says of its data and is passed over here.
"""

import math
from collections.abc import Mapping
from typing import Any

from seal_friction_ros.core.foundation.parameters import check_names, from_mapping, name_and_source
from seal_friction_ros.core.friction.actuator import (
    ConstantCoulomb,
    CoulombLaw,
    MountedSeal,
    PhysicsBased,
    PressurePowerLaw,
    PriorArtChart,
    Seal,
    Uncertainty,
    VelocityTerms,
)
from seal_friction_ros.core.friction.friction_coefficient import CoefficientTable, FrictionCoefficientLaw, PowerLaw
from seal_friction_ros.core.friction.friction_map import FrictionMap
from seal_friction_ros.core.friction.geometry import SealGeometry
from seal_friction_ros.core.friction.normal_force import AreaDeformationGain, NormalForceTable

NORMAL_FORCE_LAWS: dict[str, type] = {'area_deformation_gain': AreaDeformationGain, 'monotone_table': NormalForceTable}
FRICTION_COEFFICIENT_LAWS: dict[str, type] = {'power_law': PowerLaw, 'monotone_table': CoefficientTable}
COULOMB_LAWS = ('physics_based', 'prior_art_chart', 'pressure_power_law', 'constant_coulomb', 'friction_map')

_COMMON = {
    'name', 'source', 'geometry', 'coulomb_law', 'stiction', 'stiction_ratio', 'velocity_terms', 'uncertainty',
    'identified_pressure', 'identification',
}  # fmt: skip
_PARTS = {
    'physics_based': {'normal_force', 'friction_coefficient'},
    'pressure_power_law': {'pressure_power_law'},
    'constant_coulomb': {'constant_coulomb'},
    'prior_art_chart': {'chart'},
    'friction_map': {'friction_map'},
}
_WITHOUT_GEOMETRY = {
    'pressure_power_law': PressurePowerLaw, 'constant_coulomb': ConstantCoulomb, 'friction_map': FrictionMap,
}  # fmt: skip


def parse_seal(document: Any) -> Seal:
    """Make a seal from the document of a seal file.

    Raises:
        ValueError: The document makes no sense; the message names the seal, the field, its value and its bound.
    """
    name, _ = name_and_source(document, 'seal')
    where = f'seal {name}'
    law_name = _choice(document, 'coulomb_law', COULOMB_LAWS, where)
    check_names(document, sorted(_COMMON | _PARTS[law_name]), f'{where}: {law_name}')
    law = _coulomb_law(document, law_name, where)
    terms = None
    if 'velocity_terms' in document:
        terms = from_mapping(VelocityTerms, document['velocity_terms'], f'{where}: velocity_terms')
    about = document.get('identification', {})
    if not isinstance(about, Mapping) or not _can_be_recorded(about):
        raise ValueError(f'{where}: identification is not a mapping of texts, finite numbers, and lists of them')
    uncertainty = from_mapping(Uncertainty, document.get('uncertainty'), f'{where}: uncertainty')
    pressure_min, pressure_max = _range(document, where)
    numbers = {'pressure_min': pressure_min, 'pressure_max': pressure_max}
    numbers |= {key: document[key] for key in ('stiction', 'stiction_ratio') if key in document}
    made = {'name': name, 'coulomb_law': law, 'uncertainty': uncertainty, 'velocity_terms': terms}
    return from_mapping(Seal, numbers, where, **made)


def _coulomb_law(document: Mapping[str, Any], law_name: str, where: str) -> CoulombLaw:
    if law_name in _WITHOUT_GEOMETRY:
        if 'geometry' in document:  # the law has no use for it, but a wrong one is still wrong
            from_mapping(SealGeometry, document['geometry'], f'{where}: geometry')
        law: CoulombLaw = from_mapping(_WITHOUT_GEOMETRY[law_name], document.get(law_name), f'{where}: {law_name}')
        return law
    geometry = from_mapping(SealGeometry, document.get('geometry'), f'{where}: geometry')
    if law_name == 'physics_based':
        return PhysicsBased(
            geometry,
            _law(document, 'normal_force', NORMAL_FORCE_LAWS, where),
            parse_friction_coefficient(document, where),
        )
    return from_mapping(PriorArtChart, document.get('chart'), f'{where}: chart', geometry=geometry)


def parse_friction_coefficient(document: Mapping[str, Any], where: str) -> FrictionCoefficientLaw:
    """Law under ``friction_coefficient`` of a document; ``where`` says what the document is, for the error message.

    Raises:
        ValueError: There is none, or it makes no sense.
    """
    law: FrictionCoefficientLaw = _law(document, 'friction_coefficient', FRICTION_COEFFICIENT_LAWS, where)
    return law


def mount_seals(documents: tuple[Any, ...], chambers: tuple[str, ...]) -> tuple[MountedSeal, ...]:
    """Seals of an actuator from their documents and the chamber (``a`` or ``b``) of each.

    Raises:
        ValueError: There are not as many chambers as seals, or a document or chamber makes no sense.
    """
    if len(documents) != len(chambers):
        raise ValueError(
            f'seals has {len(documents)} entries but seal_chambers has {len(chambers)}: give one chamber a seal'
        )
    return tuple(MountedSeal(parse_seal(d), chamber) for d, chamber in zip(documents, chambers, strict=True))


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


def _law(document: Mapping[str, Any], key: str, laws: dict[str, type], where: str) -> Any:
    part = document.get(key)
    if not isinstance(part, Mapping):
        raise ValueError(f'{where}: {key} = {part!r} is not a mapping of names to values')
    name = _choice(part, 'law', laws, f'{where}: {key}')
    return from_mapping(laws[name], {k: v for k, v in part.items() if k != 'law'}, f'{where}: {key}')


def _range(document: Mapping[str, Any], where: str) -> tuple[Any, Any]:
    value = document.get('identified_pressure')
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise ValueError(f'{where}: identified_pressure = {value!r} is not a list of two pressures [Pa]')
    return value[0], value[1]
