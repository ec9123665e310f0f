"""Finite-element O-ring: case file -> numbers and seal file."""

import dataclasses
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import linear_regression
from typing import Any, NamedTuple

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.friction.actuator import Uncertainty
from seal_friction_ros.core.friction.geometry import stretch_force
from seal_friction_ros.core.friction.laws.contact_shear import ShearLaw
from seal_friction_ros.core.friction.laws.law import FrictionLaw
from seal_friction_ros.core.friction.seal_file import law_document, parse_seal
from seal_friction_ros.core.oring_contact.oring_case import OringCase, check_pressures
from seal_friction_ros.core.oring_contact.oring_case_file import OringCaseFile, parse_oring_case
from seal_friction_ros.core.oring_contact.results import OringResult, WallContact, oring_results
from seal_friction_ros.core.oring_contact.ring_friction import (
    PRIOR,
    PRIOR_LAW,
    FittedShear,
    Reading,
    fit_shear_law,
    friction_after,
    friction_law,
    friction_of_contact,
)
from seal_friction_ros.core.oring_contact.sealing_film import SealFilm, seal_film
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.contact.mesh_levels import MeshLevels, mesh_levels
from seal_friction_ros.offline.contact.section_files import with_files
from seal_friction_ros.offline.contact.uncertainty import Uncertainty as Spread
from seal_friction_ros.offline.contact.uncertainty import check_unknown
from seal_friction_ros.offline.work.progress import progress
from seal_friction_ros.offline.work.seal_writer import rounded, rounded_numbers

_UNPRESSURISED = 1e5  # [Pa] up to which a seal counts as without pressure (our choice)
DIGITS = 8  # of a computed number in a seal file
ON_OTHER_MESHES = (
    'normal_force_N', 'wall_force_N', 'peak_contact_stress_Pa', 'contact_width_m', 'area_deformation_gain',
    'friction_N', 'shear_stress_Pa', 'knee_stress_Pa', 'film_out_m', 'film_back_m',
)  # fmt: skip
"""Numbers of an `OringSummary` that are compared with other meshes; leakage and radial force are differences."""


Profile = dict[str, list[float]]
"""Contact stress along a wall, at the nodes in contact: ``stress_Pa`` at ``position_m``, which is along rod and gland
from the middle of the free ring, positive downstream; for the wall the radius."""


@dataclass(frozen=True)
class OringSummary:
    """Numbers of a case, one per pressure."""

    case: str
    sliding_wall: str
    pressure_Pa: tuple[float, ...]
    normal_force_N: tuple[float, ...]  # integral of the contact stress over the sliding wall
    wall_force_N: tuple[float, ...]  # integral of all stress of that wall where it is above the pressure of the fluid
    stretch_force_N: float  # of the ring stretched over its inner wall, by the hoop equation of the thesis
    axial_force_N: tuple[float, ...]  # axial force of the gland on the ring
    peak_contact_stress_Pa: tuple[float, ...]
    contact_width_m: tuple[float, ...]
    area_deformation_gain: float | None  # slope of normal over axial force by least squares; None with one pressure
    radial_force_N: float | None  # value of that line at zero axial force; None with one pressure
    friction_N: tuple[float, ...] | None  # sliding friction of one seal, if the case has a law for it
    shear_stress_Pa: float | None  # of the shear law; None without one
    knee_stress_Pa: float | None
    friction_relative_std: float | None
    reading_deviations: tuple[float, ...]  # friction of the law over each reading, less one
    film_out_m: tuple[float | None, ...]  # film of a smooth seal, see `SealFilm`; empty without a fluid
    film_back_m: tuple[float | None, ...]
    leakage_m3_per_m: tuple[float | None, ...]
    rod_profile: tuple[Profile, ...]
    gland_profile: tuple[Profile, ...]
    wall_profile: tuple[Profile, ...]  # downstream wall; empty without pressure


class Task(NamedTuple):
    """What to compute of a case."""

    pressures: Sequence[float] = ()  # [Pa, gauge] increasing; empty: those in the file
    readings: Sequence[Reading] = ()  # friction of one seal, to which the shear law is fitted
    law_from: Path | None = None  # seal file of another ring, for its shear law instead of the friction of the case
    for_seal_file: bool = False
    """refuse a case without what `seal_document` needs, before computing; one without friction has `PRIOR`"""
    for_samples: bool = False  # refuse a case in which nothing is unknown, before computing
    fluid: tuple[float, float] | None = None  # viscosity [Pa s] and speed [m/s], for the film
    meshes: bool = False  # compute the case on a coarser and a finer mesh, too


class Computed(NamedTuple):
    """A case and its results."""

    file: OringCaseFile  # its friction is the one in use: of the case, of another seal, or of readings
    results: tuple[OringResult, ...]
    summary: OringSummary
    task: Task
    mesh: MeshLevels | None = None  # None: computed on one mesh only

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        return asdict(self.summary) | ({} if self.mesh is None else {'mesh': self.mesh.numbers()})

    @property
    def friction_law(self) -> FrictionLaw | None:
        """Friction over pressure; None without friction, or with one pressure above 0."""
        if self.file.friction is None or (len(self.results) < 2 and self.results[0].pressure > 0.0):
            return None
        contacts = [sliding_contact(self.file.case, result) for result in self.results]
        law, pressures = self.file.friction.law, self.summary.pressure_Pa
        return friction_law(law, self.file.case.geometry, pressures, contacts)


def sliding_contact(case: OringCase, result: OringResult) -> WallContact:
    """Contact on the sliding wall."""
    return result.rod if case.geometry.sliding_wall == 'rod' else result.gland


def read_oring_case(path: Path) -> OringCaseFile:
    """Case in a file; its section and rubber may be in files beside it, see `with_files`.

    ValueError: the file cannot be read or a value is invalid; one line that names the file.
    """
    document = read_yaml(path)
    with named_errors(path):
        return parse_oring_case(with_files(document, path.parent))


def compute_case(path: Path, task: Task | None = None) -> Computed:
    """Compute a case file, with a progress bar; see `read_oring_case`.

    ValueError: the file is invalid or insufficient for a seal file, or the ring does not fit, does not seal or has no
    equilibrium.
    """
    return compute_file(read_oring_case(path), path, task)


def compute_file(file: OringCaseFile, path: Path, task: Task | None = None) -> Computed:
    """Compute a parsed case, see `compute_case`; ``path`` names it in messages."""
    task = task or Task()
    if task.meshes:
        return _on_three_meshes(file, path, task)
    readings = task.readings
    with named_errors(path):
        wanted = tuple(task.pressures) or file.pressures
        check_pressures(file.case, wanted)
        if task.fluid is not None and min(task.fluid) <= 0.0:
            raise ValueError(f'case {file.case.name}: a film needs a viscosity and a speed above 0, not {task.fluid}')
        without_pressure = wanted == (0.0,) and file.case.section is not None
        if (readings or (task.for_seal_file and not without_pressure)) and len(wanted) < 2:
            raise ValueError(f'case {file.case.name}: a law over pressure needs two pressures at least')
        if task.law_from is not None:
            file = dataclasses.replace(file, friction=friction_after(parse_seal(read_yaml(task.law_from))))
        elif file.friction is None and (task.for_seal_file or readings):
            file = dataclasses.replace(file, friction=PRIOR)
        if task.for_samples:
            check_unknown(file.case.name, file.unknown)
        results = []
        with progress(f'{file.case.name}: pressures', len(wanted)) as advance:
            for result in oring_results(file.case, wanted):
                results.append(result)
                advance(1)
        fitted = _fitted(file, results, readings) if readings else None
    if fitted is not None:
        known = file.friction or PRIOR
        friction = dataclasses.replace(known, law=fitted.law, uncertainty=Uncertainty(fitted.relative_std))
        file = dataclasses.replace(file, friction=friction)
    deviations = () if fitted is None else tuple(fitted.deviations.tolist())
    films = films_of(file.case, results, task.fluid)
    return Computed(file, tuple(results), _summary(file, results, deviations, films), task)


def _on_three_meshes(file: OringCaseFile, path: Path, task: Task) -> Computed:
    """The case with the change of its numbers on other meshes, on each of which readings are fitted anew."""

    def on_mesh(lines: int) -> Computed:
        numerics = dataclasses.replace(file.case.numerics, lines=lines)
        case = dataclasses.replace(file.case, numerics=numerics)
        return compute_file(dataclasses.replace(file, case=case), path, task._replace(meshes=False))

    def numbers(computed: Computed) -> dict[str, Any]:
        return {name: getattr(computed.summary, name) for name in ON_OTHER_MESHES}

    lines = file.case.numerics.lines
    found = on_mesh(lines)
    levels = mesh_levels(lines, found.summary.pressure_Pa, numbers(found), lambda count: numbers(on_mesh(count)))
    return found._replace(task=task, mesh=levels)


def _fitted(file: OringCaseFile, results: Sequence[OringResult], readings: Sequence[Reading]) -> FittedShear:
    """The shear law of the readings; its prior is that of the case, or that of the thesis."""
    known = file.friction.law if file.friction else None
    prior = known if isinstance(known, ShearLaw) else PRIOR_LAW
    contacts = [sliding_contact(file.case, result) for result in results]
    return fit_shear_law(prior, [result.pressure for result in results], contacts, readings)


def films_of(
    case: OringCase, results: Sequence[OringResult], fluid: tuple[float, float] | None
) -> tuple[SealFilm | None, ...]:
    """Film under the seal at each pressure, by viscosity [Pa s] and speed [m/s]; empty without a ``fluid``.

    A cap lies on the sliding wall, so its modulus counts.
    """
    if fluid is None:
        return ()
    face = case.cap or case.rubber
    elasticity = 4.0 / 3.0 * face.modulus, case.numerics.transition * case.rubber.modulus
    return tuple(seal_film(sliding_contact(case, one), one.pressure, elasticity, fluid) for one in results)


def _summary(
    file: OringCaseFile,
    results: Sequence[OringResult],
    deviations: tuple[float, ...],
    films: Sequence[SealFilm | None],
) -> OringSummary:
    geometry, contacts = file.case.geometry, [sliding_contact(file.case, result) for result in results]
    normal = tuple(contact.force for contact in contacts)
    axial = tuple(result.axial_force for result in results)
    gain, radial = linear_regression(axial, normal) if len(results) > 1 else (None, None)
    friction = file.friction
    shear = friction.law if friction and isinstance(friction.law, ShearLaw) else None
    return OringSummary(
        case=file.case.name,
        sliding_wall=geometry.sliding_wall,
        pressure_Pa=tuple(result.pressure for result in results),
        normal_force_N=normal,
        wall_force_N=tuple(contact.wall_force for contact in contacts),
        stretch_force_N=stretch_force(dataclasses.replace(geometry, elastic_modulus=file.case.rubber.modulus)),
        axial_force_N=axial,
        peak_contact_stress_Pa=tuple(contact.peak_stress for contact in contacts),
        contact_width_m=tuple(contact.width for contact in contacts),
        area_deformation_gain=gain,
        radial_force_N=radial,
        friction_N=tuple(friction_of_contact(friction.law, contact) for contact in contacts) if friction else None,
        shear_stress_Pa=shear.shear_stress if shear else None,
        knee_stress_Pa=shear.knee_stress if shear else None,
        friction_relative_std=friction.uncertainty.relative_std if friction else None,
        reading_deviations=deviations,
        film_out_m=tuple(film and film.out for film in films),
        film_back_m=tuple(film and film.back for film in films),
        leakage_m3_per_m=tuple(film and film.leakage for film in films),
        rod_profile=tuple(_profile(result.rod) for result in results),
        gland_profile=tuple(_profile(result.gland) for result in results),
        wall_profile=tuple(_profile(result.wall) for result in results),
    )


def _profile(contact: WallContact) -> Profile:
    return {'position_m': contact.position.tolist(), 'stress_Pa': contact.stress.tolist()}


def seal_document(computed: Computed, spread: Spread | None = None) -> dict[str, Any]:
    """Seal file whose law is a table over the computed pressures, of a case that was computed ``for_seal_file``.

    The ``spread`` of the friction is that of samples; None: the uncertainty of its law. ValueError: the case was not
    computed for it, or the friction falls with pressure.
    """
    file, law, friction = computed.file, computed.friction_law, computed.file.friction
    if law is None or friction is None:
        raise ValueError(f'case {file.case.name}: a seal file needs a friction law and two pressures at least')
    found = friction.uncertainty.relative_std if spread is None else spread.relative_std
    pressures = [rounded(value, DIGITS) for value in computed.summary.pressure_Pa]
    readings = f' Shear law: {len(computed.task.readings)} readings of this ring.' if computed.task.readings else ''
    mesh = f' {computed.mesh.text}' if computed.mesh else ''
    source = f'{file.source} Contact: finite elements, {file.case.numerics.lines} lines.{mesh}{readings}'
    speeds = [reading.speed for reading in computed.task.readings]
    return {
        'name': file.case.name,
        'source': ' '.join(source.split()),
        'geometry': asdict(file.case.geometry),
        **rounded_numbers(law_document(law), DIGITS),
        'stiction': friction.stiction,
        **({'stiction_ratio': rounded(friction.stiction_ratio, 3)} if friction.stiction_ratio else {}),
        'uncertainty': asdict(friction.uncertainty) | {'relative_std': rounded(found, 3)},
        'identified_pressure': [pressures[0], pressures[-1] or _UNPRESSURISED],
        **({'identified_speed': [min(speeds), max(speeds)]} if speeds else {}),
    }


def seal_comment(computed: Computed) -> str:
    """Comment at the beginning of that seal file."""
    summary = computed.summary
    text = (
        'Made by `seal_friction oring`, which computes the contact from geometry and rubber, see docs/oring.md.\n'
        f'Normal force [N]: {", ".join(f"{force:.5g}" for force in summary.normal_force_N)}.'
    )
    if summary.area_deformation_gain is None:
        return text
    return (
        f'{text}\nAs a line over axial force: area_deformation_gain: {summary.area_deformation_gain:.6g} [1], '
        f'radial_force: {summary.radial_force_N:.6g} [N].'
    )
