"""What a result depends on beside its inputs: the source of this distribution, and the libraries it computes with."""

import hashlib
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from seal_friction_ros.files import package_version

_PACKAGE = Path(__file__).parents[2]
_SOURCES = (_PACKAGE / 'core', _PACKAGE / 'offline', _PACKAGE.with_name('seal_friction_studies'))
_LIBRARIES = ('numpy', 'scipy', 'numba')


@cache
def versions() -> Mapping[str, str]:
    """Version by name; that of this package has a digest of its source, an absent library has the version ``none``."""
    digest = hashlib.sha256()
    for source in sorted(one for folder in _SOURCES for one in folder.rglob('*.py')):
        digest.update(f'{source.relative_to(_PACKAGE.parent)} '.encode() + source.read_bytes())
    own = f'{package_version()} (source {digest.hexdigest()[:12]})'
    major, minor, _ = platform.python_version_tuple()
    libraries = {name: version_of(name, 'none') for name in _LIBRARIES}
    return {'seal_friction_ros': own, 'Python': f'{major}.{minor}', **libraries}


def version_of(package: str, absent: str) -> str:
    """Version of an installed distribution, or ``absent``."""
    try:
        return version(package)
    except PackageNotFoundError:
        return absent
