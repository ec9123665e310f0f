"""A seal of any section: a shape or a drawing with its gland -> case."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.section import SHAPES, Section, section_of_shape
from seal_friction_ros.offline.contact.section_files import SUFFIXES, read_outline

_ROOM = 1.25  # default width of the groove over the length of the section (our choice)


class Gland(NamedTuple):
    """Where a section is mounted [m]; None: see `section_document`."""

    rod: float
    gland: float
    sliding: str = 'rod'
    groove: float | None = None
    clearance: float = 0.0
    height: float | None = None
    inner: float | None = None
    corner_radius: float | None = None  # of the section where it faces the sliding wall; None: as drawn


def section_document(
    drawing: str, gland: Gland, *, name: str = '', rubber: Mapping[str, Any], mirrored: bool = False
) -> dict[str, Any]:
    """Document of a case, see `parse_oring_case`, of a shape or of the outline in a file.

    The height is that of the drawing; a shape needs one. The free ``inner`` diameter is that of a drawing whose radii
    reach into the gap, else the middle of the section lies in the middle of the gap. The groove is 1.25 times as wide
    as the section is long. ValueError: the file is not an outline, or a shape has no height.
    """
    if Path(drawing).suffix.lower() in SUFFIXES:
        outline = read_outline(Path(drawing).expanduser())
        section, part = Section(outline), {'outline': outline.tolist()}
    else:
        if drawing not in SHAPES:
            raise ValueError(f'{drawing!r} is neither a file ({", ".join(SUFFIXES)}) nor one of {", ".join(SHAPES)}')
        section, part = section_of_shape(drawing, {}), {'shape': drawing}
        if gland.height is None:
            raise ValueError(f'{drawing}: give the free height of the section, --height')
    height = section.height if gland.height is None else gland.height
    _check_size(drawing, section, height, gland)
    low = float(section.outline[:, 0].min())
    as_drawn = gland.height is None and 2.0 * low < gland.gland and 2.0 * (low + height) > gland.rod
    middle = 2.0 * low if as_drawn else 0.5 * (gland.rod + gland.gland) - height
    length = section.length * height / section.height
    return {
        'name': name or Path(drawing).stem,
        'source': f'seal_friction section {Path(drawing).name}',
        'geometry': {
            'section_diameter': height,
            'ring_inner_diameter': middle if gland.inner is None else gland.inner,
            'rod_diameter': gland.rod,
            'gland_diameter': gland.gland,
            'sliding_wall': gland.sliding,
        },
        'section': {
            **part,
            **({'mirrored': True} if mirrored else {}),
            **({} if gland.corner_radius is None else {'corner_radius': gland.corner_radius}),
        },
        'groove': {
            'width': _ROOM * length if gland.groove is None else gland.groove,
            'diametral_clearance': gland.clearance,
        },
        'rubber': dict(rubber),
    }


def _check_size(drawing: str, section: Section, height: float, gland: Gland) -> None:
    gap = 0.5 * (gland.gland - gland.rod)
    if gap <= 0.0:
        raise ValueError(f'{drawing}: the rod is not smaller than the gland')
    length = section.length * height / section.height
    if not gap < height < 2.0 * gap:
        raise ValueError(
            f'{drawing}: the section is {1e3 * height:.4g} mm high, the gap between rod and gland {1e3 * gap:.4g} mm: '
            f'a seal is higher than its gap, but not twice as high; is the unit right?'
        )
    if gland.groove is not None and length >= gland.groove:
        raise ValueError(
            f'{drawing}: the section is {1e3 * length:.4g} mm long, its groove {1e3 * gland.groove:.4g} mm'
        )


def case_of(document: Mapping[str, Any], pressures: Sequence[float], lines: int | None) -> Any:
    """Parsed case of a document at ``pressures`` [Pa, gauge]. ValueError: see `parse_oring_case`."""
    numerics = {} if lines is None else {'numerics': {'lines': lines}}
    return parse_oring_case({**document, **numerics, 'pressures': list(pressures)})
