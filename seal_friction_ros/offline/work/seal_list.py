"""The seal files of some folders, each with law, range and source; those of the catalogue that fit a cylinder."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.foundation.units import BAR, MM, in_si
from seal_friction_ros.core.friction.actuator import Seal
from seal_friction_ros.core.friction.identified_motion import ANY_MOTION
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import config_names, config_path, read_yaml

_WIDTH = 80  # characters of a line
_NEAR = 0.1  # difference of diameters over the wanted one, within which a seal is listed (our choice)


class ListedSeal(NamedTuple):
    """One seal file; only ``file`` and ``error`` if it cannot be used."""

    file: str  # name in config/seals, or path
    law: str = ''
    range: str = ''
    source: str = ''
    error: str = ''
    kind: str = ''  # rod or piston; empty: the file has no geometry
    diameter: float = 0.0  # [m] of the sliding wall
    relative_std: float = 0.0  # [-]


def listed_seals(folders: Sequence[Path] = ()) -> list[ListedSeal]:
    """Every seal file of some folders, or of ``config/seals``, sorted by name. ValueError if a folder has none."""
    if not folders:
        return [_listed(name, config_path('seals', name)) for name in config_names('seals')]
    found = []
    for folder in folders:
        paths = sorted(path for path in folder.glob('*.y*ml') if path.suffix in ('.yaml', '.yml'))
        if not paths:
            raise ValueError(f'{folder}: no folder with seal files (*.yaml)')
        found += [_listed(str(path), path) for path in paths]
    return found


def fitting_seals(folders: Sequence[Path], kind: str, diameter: float) -> list[ListedSeal]:
    """Usable seals of a ``kind``, rod or piston, whose diameter is within a tenth of ``diameter`` [m], nearest first.

    Without ``folders`` they are those of ``config/seals`` and its catalogue. ValueError: none is.
    """
    shipped = config_path('seals', 'placeholder').parent
    found = listed_seals(folders) if folders else listed_seals() + listed_seals([shipped / 'catalogue'])
    of_kind = [seal for seal in found if seal.kind == kind]
    near = sorted(of_kind, key=lambda seal: abs(seal.diameter - diameter))
    near = [seal for seal in near if abs(seal.diameter - diameter) <= _NEAR * diameter]
    if not near:
        raise ValueError(
            f'no seal file for a {kind} of {diameter / MM:.4g} mm: compute one, see seal_friction section --help'
        )
    return near


def _listed(name: str, path: Path) -> ListedSeal:
    try:
        document = read_yaml(path)
        seal = parse_seal(document)
    except ValueError as error:
        return ListedSeal(name, error=str(error))
    law = seal.coulomb_law.NAME + (' with velocity terms' if seal.velocity_terms else '')
    geometry = document.get('geometry', {})
    on_rod = geometry.get('sliding_wall', 'rod') == 'rod'
    return ListedSeal(
        name,
        law,
        _range(seal),
        ' '.join(str(document.get('source', '')).split()),
        kind=('rod' if on_rod else 'piston') if geometry else '',
        diameter=in_si(geometry['rod_diameter' if on_rod else 'gland_diameter'], 'm', name) if geometry else 0.0,
        relative_std=seal.uncertainty.relative_std,
    )


def _range(seal: Seal) -> str:
    """Pressures, and speeds where they are known, at which the law was identified."""
    text = f'{seal.pressure_min / BAR:.3g} to {seal.pressure_max / BAR:.3g} bar'
    motion = seal.identified_motion
    if motion == ANY_MOTION:
        return text
    return f'{text}, {motion.slowest / MM:.3g} to {motion.fastest / MM:.3g} mm/s'


def seal_text(seal: ListedSeal, *, full: bool) -> str:
    """A seal for a terminal: name, law and range, and below the source, its beginning unless ``full``."""
    if seal.error:
        return f'{seal.file}: unusable: {seal.error}'
    source = seal.source or 'no source is given'
    lines = textwrap.wrap(source, _WIDTH - 4)
    if not full and len(lines) > 1:
        lines = [textwrap.shorten(source, _WIDTH - 4, placeholder=' ...')]
    size = f', {seal.kind} {seal.diameter / MM:.4g} mm' if seal.kind else ''
    return '\n'.join([f'{seal.file}: {seal.law}, {seal.range}{size}', *(f'    {line}' for line in lines)])
