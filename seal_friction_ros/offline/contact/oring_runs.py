"""Finite-element O-ring: case file -> numbers and seal file."""

import dataclasses
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import linear_regression
from typing import Any, NamedTuple

from seal_friction_ros.core.friction.geometry import stretch_force
from seal_friction_ros.core.oring_contact.oring_case import OringCase, check_pressures
from seal_friction_ros.core.oring_contact.oring_case_file import OringCaseFile, SealFriction, parse_oring_case
from seal_friction_ros.core.oring_contact.results import OringResult, WallContact, oring_results
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.contact.uncertainty import Uncertainty, check_unknown
from seal_friction_ros.offline.work.progress import progress
from seal_friction_ros.offline.work.seal_writer import rounded

DIGITS = 8  # of a computed number in a seal file


@dataclass(frozen=True)
class Profile:
    """Contact stress along a wall, at the nodes in contact, shape (n,)."""

    position_m: tuple[float, ...]
    """along rod and gland from the middle of the free ring, positive downstream; for the wall the radius"""
    stress_Pa: tuple[float, ...]


@dataclass(frozen=True)
class OringSummary:
    """Numbers of a case, one per pressure."""

    case: str
    sliding_wall: str
    pressure_Pa: tuple[float, ...]
    normal_force_N: tuple[float, ...]
    """integral of the contact stress over the sliding wall"""
    wall_force_N: tuple[float, ...]
    """integral of all stress of that wall where it is above the pressure of the fluid"""
    stretch_force_N: float  # of the ring stretched over its inner wall, by the hoop equation of the thesis
    axial_force_N: tuple[float, ...]
    """axial force of the gland on the ring"""
    peak_contact_stress_Pa: tuple[float, ...]
    contact_width_m: tuple[float, ...]
    area_deformation_gain: float | None  # slope of normal over axial force by least squares; None with one pressure
    radial_force_N: float | None
    """value of that line at zero axial force; None with one pressure"""
    friction_N: tuple[float, ...] | None
    """sliding friction of one seal, if the case has a friction coefficient"""
    rod_profile: tuple[Profile, ...]
    gland_profile: tuple[Profile, ...]
    wall_profile: tuple[Profile, ...]  # downstream wall; empty without pressure


class Computed(NamedTuple):
    """A case and its results."""

    file: OringCaseFile
    results: tuple[OringResult, ...]
    summary: OringSummary


def sliding_contact(case: OringCase, result: OringResult) -> WallContact:
    """Contact on the sliding wall."""
    return result.rod if case.geometry.sliding_wall == 'rod' else result.gland


def compute_case(
    path: Path, pressures: Sequence[float] = (), *, for_seal_file: bool = False, for_samples: bool = False
) -> Computed:
    """Compute a case file, with a progress bar.

    Args:
        path: The case file.
        pressures: Increasing pressures instead of those in the file [Pa, gauge].
        for_seal_file: Refuse a case without what `seal_document` needs, before computing.
        for_samples: Refuse a case in which nothing is unknown, before computing.

    Raises:
        ValueError: The file is invalid or insufficient for a seal file, or the ring does not fit, does not seal or has
            no equilibrium.
    """
    document = read_yaml(path)
    try:
        file = parse_oring_case(document)
        wanted = tuple(pressures) or file.pressures
        check_pressures(file.case, wanted)
        if for_seal_file:
            _friction_of_seal(file, wanted)
        if for_samples:
            check_unknown(file.case.name, file.unknown)
        results = []
        with progress(f'{file.case.name}: pressures', len(wanted)) as advance:
            for result in oring_results(file.case, wanted):
                results.append(result)
                advance(1)
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None
    return Computed(file, tuple(results), _summary(file, results))


def _summary(file: OringCaseFile, results: Sequence[OringResult]) -> OringSummary:
    geometry, contacts = file.case.geometry, [sliding_contact(file.case, result) for result in results]
    normal = tuple(contact.force for contact in contacts)
    axial = tuple(result.axial_force for result in results)
    gain, radial = linear_regression(axial, normal) if len(results) > 1 else (None, None)
    law = file.friction.law if file.friction else None
    return OringSummary(
        case=file.case.name,
        sliding_wall=geometry.sliding_wall,
        pressure_Pa=tuple(result.pressure for result in results),
        normal_force_N=normal,
        wall_force_N=tuple(contact.wall_force for contact in contacts),
        stretch_force_N=stretch_force(dataclasses.replace(geometry, elastic_modulus=file.case.rubber.elastic_modulus)),
        axial_force_N=axial,
        peak_contact_stress_Pa=tuple(contact.peak_stress for contact in contacts),
        contact_width_m=tuple(contact.width for contact in contacts),
        area_deformation_gain=gain,
        radial_force_N=radial,
        friction_N=tuple(law.coefficient_of_friction(force) * force for force in normal) if law else None,
        rod_profile=tuple(_profile(result.rod) for result in results),
        gland_profile=tuple(_profile(result.gland) for result in results),
        wall_profile=tuple(_profile(result.wall) for result in results),
    )


def _profile(contact: WallContact) -> Profile:
    return Profile(tuple(contact.position.tolist()), tuple(contact.stress.tolist()))


def _friction_of_seal(file: OringCaseFile, pressures: Sequence[float]) -> SealFriction:
    if file.friction is None:
        raise ValueError(f'case {file.case.name}: a seal file needs the section friction with a friction_coefficient')
    if len(pressures) < 2:
        raise ValueError(f'case {file.case.name}: a seal file needs two pressures at least')
    return file.friction


def seal_document(computed: Computed, uncertainty: Uncertainty | None = None) -> dict[str, Any]:
    """Seal file whose normal force is a table of the computed pressures.

    Args:
        computed: The case and its results.
        uncertainty: Of the friction, from samples; None: that of the case file.

    Raises:
        ValueError: The case has no friction coefficient or one pressure only.
    """
    file, summary = computed.file, computed.summary
    friction = _friction_of_seal(file, summary.pressure_Pa)
    pressures = [rounded(value, DIGITS) for value in summary.pressure_Pa]
    sampled = {} if uncertainty is None else {'relative_std': rounded(uncertainty.relative_std, 3)}
    source = f'{file.source} Normal force: finite elements, {file.case.numerics.lines} lines.'
    return {
        'name': file.case.name,
        'source': ' '.join(source.split()),
        'geometry': asdict(file.case.geometry),
        'coulomb_law': 'physics_based',
        'normal_force': {
            'law': 'monotone_table',
            'pressures': pressures,
            'normal_forces': [rounded(value, DIGITS) for value in summary.normal_force_N],
        },
        'friction_coefficient': dict(friction.friction_coefficient),
        'stiction': friction.stiction,
        'uncertainty': asdict(friction.uncertainty) | sampled,
        'identified_pressure': [pressures[0], pressures[-1]],
    }


def seal_comment(computed: Computed) -> str:
    """Comment at the beginning of that seal file."""
    summary = computed.summary
    return (
        'Made by `seal_friction oring`, which computes the normal force from geometry and rubber, see docs/oring.md.\n'
        f'As a line over axial force: area_deformation_gain: {summary.area_deformation_gain:.6g} [1], '
        f'radial_force: {summary.radial_force_N:.6g} [N].'
    )
