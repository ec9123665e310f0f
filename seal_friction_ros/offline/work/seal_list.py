"""The seal files of some folders, each with law, range and source."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.foundation.units import BAR, MM
from seal_friction_ros.core.friction.actuator import Seal
from seal_friction_ros.core.friction.identified_motion import ANY_MOTION
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import config_names, config_path, read_yaml

_WIDTH = 80  # characters of a line


class ListedSeal(NamedTuple):
    """One seal file; only ``file`` and ``error`` if it cannot be used."""

    file: str  # name in config/seals, or path
    law: str = ''
    range: str = ''
    source: str = ''
    error: str = ''


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


def _listed(name: str, path: Path) -> ListedSeal:
    try:
        document = read_yaml(path)
        seal = parse_seal(document)
    except ValueError as error:
        return ListedSeal(name, error=str(error))
    law = seal.coulomb_law.NAME + (' with velocity terms' if seal.velocity_terms else '')
    return ListedSeal(name, law, _range(seal), ' '.join(str(document.get('source', '')).split()))


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
    return '\n'.join([f'{seal.file}: {seal.law}, {seal.range}', *(f'    {line}' for line in lines)])
