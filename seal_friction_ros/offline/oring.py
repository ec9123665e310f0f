"""The finite-element O-ring from files to files: a case file in; numbers, a seal file and a report out."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import linear_regression
from typing import NamedTuple

from seal_friction_ros.core.oring_contact.case import check_pressures
from seal_friction_ros.core.oring_contact.case_file import CaseFile, Friction, parse_case
from seal_friction_ros.core.oring_contact.results import Contact, ContactResult, contact_results
from seal_friction_ros.core.seal import projected_area
from seal_friction_ros.core.seal_file import parse_seal
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.progress import progress


@dataclass(frozen=True)
class Profile:
    """Contact stress along a wall, at the nodes in contact."""

    position_m: tuple[float, ...]
    """along rod and gland, positive downstream from the middle of the free ring; for the wall the radius"""
    stress_Pa: tuple[float, ...]  # noqa: N815  (unit symbols keep their case)


@dataclass(frozen=True)
class OringSummary:
    """Numbers of a case, one of each for every pressure."""

    case: str
    sliding_wall: str
    pressure_Pa: tuple[float, ...]  # noqa: N815
    normal_force_N: tuple[float, ...]  # noqa: N815
    """contact stress on the wall the ring slides on, over its area"""
    axial_force_N: tuple[float, ...]  # noqa: N815
    """of the gland on the ring, along the axis"""
    peak_contact_stress_Pa: tuple[float, ...]  # noqa: N815
    contact_width_m: tuple[float, ...]
    area_deformation_gain: float | None
    """slope of normal over axial force, least squares; None with one pressure"""
    radial_force_N: float | None  # noqa: N815
    """what that line has at no axial force; None with one pressure"""
    friction_N: tuple[float, ...] | None  # noqa: N815
    """sliding friction of one seal, if the case has a friction coefficient"""
    rod_profile: tuple[Profile, ...]
    gland_profile: tuple[Profile, ...]
    wall_profile: tuple[Profile, ...]
    """downstream wall; empty without pressure"""


class Computed(NamedTuple):
    """A case and what came of it."""

    file: CaseFile
    results: tuple[ContactResult, ...]
    summary: OringSummary


def sliding_contact(file: CaseFile, result: ContactResult) -> Contact:
    """Contact on the wall the ring slides on."""
    return result.rod if file.case.geometry.sliding_wall == 'rod' else result.gland


def compute_case(path: Path, pressures: Sequence[float] = (), *, for_seal_file: bool = False) -> Computed:
    """Compute a case file, with a progress bar.

    Args:
        path: The case file.
        pressures: Instead of those in the file [Pa, gauge], increasing.
        for_seal_file: Refuse, before computing, what `write_seal_file` could not make a seal of.

    Raises:
        ValueError: The file makes no sense or is not enough for a seal file, or the ring does not fit, does not seal or
            finds no equilibrium.
    """
    try:
        file = parse_case(read_yaml(path))
        wanted = tuple(pressures) or file.pressures
        check_pressures(file.case, wanted)
        if for_seal_file:
            _friction_of_seal(file, wanted)
        results = []
        with progress(f'{file.case.name}: pressures', len(wanted)) as advance:
            for result in contact_results(file.case, wanted):
                results.append(result)
                advance(1)
    except ValueError as error:
        raise ValueError(str(error) if str(path) in str(error) else f'{path}: {error}') from None
    return Computed(file, tuple(results), _summary(file, results))


def _summary(file: CaseFile, results: Sequence[ContactResult]) -> OringSummary:
    contacts = [sliding_contact(file, result) for result in results]
    normal = tuple(contact.force for contact in contacts)
    axial = tuple(result.axial_force for result in results)
    gain, radial = linear_regression(axial, normal) if len(results) > 1 else (None, None)
    law = file.friction.law if file.friction else None
    return OringSummary(
        case=file.case.name,
        sliding_wall=file.case.geometry.sliding_wall,
        pressure_Pa=tuple(result.pressure for result in results),
        normal_force_N=normal,
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


def _profile(contact: Contact) -> Profile:
    return Profile(tuple(contact.position.tolist()), tuple(contact.stress.tolist()))


def check_new(out: Path) -> None:
    """Check that a file can be made, before the work for it begins.

    Raises:
        ValueError: It is there already, or there is no folder for it.
    """
    if out.exists():
        raise ValueError(f'{out} exists already: not overwriting it')
    if not out.parent.is_dir():
        raise ValueError(f'{out}: there is no folder {out.parent}')


def _friction_of_seal(file: CaseFile, pressures: Sequence[float]) -> Friction:
    if file.friction is None:
        raise ValueError(f'case {file.case.name}: a seal file needs its section friction, with a friction_coefficient')
    if len(pressures) < 2:
        raise ValueError(f'case {file.case.name}: a seal file needs two pressures at least')
    return file.friction


def write_seal_file(computed: Computed, out: Path) -> None:
    """Write a seal file whose normal force is a table of the computed pressures.

    Raises:
        ValueError: The case has no friction coefficient or one pressure only, the law makes no sense as a seal, or the
            file is there already or cannot be written.
    """
    file, summary = computed.file, computed.summary
    geometry, friction = file.case.geometry, _friction_of_seal(file, summary.pressure_Pa)
    area = projected_area(geometry)
    gain, radial = linear_regression([p * area for p in summary.pressure_Pa], summary.normal_force_N)
    source = f'{file.source} Normal force: finite elements, {file.case.numerics.lines} lines.'
    lines = [
        '# Made by `seal_friction oring`, which computes the normal force from geometry and rubber; see docs/oring.md.',
        f'# As a line over axial force: area_deformation_gain: {gain:.6g} [1], radial_force: {radial:.6g} [N].',
        f'name: {_quoted(file.case.name)}',
        f'source: {_quoted(" ".join(source.split()))}',
        'geometry:',
        f'  section_diameter: {_number(geometry.section_diameter)} # [m]',
        f'  ring_inner_diameter: {_number(geometry.ring_inner_diameter)} # [m]',
        f'  rod_diameter: {_number(geometry.rod_diameter)} # [m]',
        f'  gland_diameter: {_number(geometry.gland_diameter)} # [m]',
        f'  sliding_wall: {geometry.sliding_wall}',
        f'  elastic_modulus: {_number(geometry.elastic_modulus)} # [Pa]',
        'coulomb_law: physics_based',
        'normal_force:',
        '  law: monotone_table',
        f'  pressures: {_numbers(summary.pressure_Pa)} # [Pa]',
        f'  normal_forces: {_numbers(summary.normal_force_N)} # [N]',
        'friction_coefficient:',
        *(f'  {key}: {_value(value)}' for key, value in friction.friction_coefficient.items()),
        f'stiction: {_number(friction.stiction)} # [N]',
        'uncertainty:',
        f'  relative_std: {_number(friction.uncertainty.relative_std)} # [1]',
        f'  absolute_std: {_number(friction.uncertainty.absolute_std)} # [N]',
        f'identified_pressure: {_numbers((summary.pressure_Pa[0], summary.pressure_Pa[-1]))} # [Pa]',
    ]
    check_new(out)
    try:
        with out.open('x', encoding='utf-8') as target:
            target.write('\n'.join(lines) + '\n')
    except OSError as error:
        raise ValueError(f'{out}: cannot write the seal file: {error.strerror}') from None
    try:
        parse_seal(read_yaml(out))
    except ValueError:
        out.unlink()
        raise


def _value(value: object) -> str:
    if isinstance(value, list | tuple):
        return _numbers(value)
    return _number(value) if isinstance(value, int | float) else str(value)


def _numbers(values: Sequence[float]) -> str:
    return f'[{", ".join(_number(value) for value in values)}]'


def _number(value: float) -> str:
    """Number as YAML 1.1 reads it: with a point, and an exponent with a sign if any."""
    text = f'{value:.8g}'
    mantissa, e, exponent = text.partition('e')
    return (mantissa if '.' in mantissa else f'{mantissa}.0') + e + exponent


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"
