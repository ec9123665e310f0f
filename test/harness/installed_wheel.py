"""An environment of Python without ROS, in which the wheel of this package and what it requires are installed.

The requirements are links to those of the tests: the environment holds what the wheel asks for and needs no network.
"""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from paths import ROOT

FORMATS = "import sys, setuptools.build_meta as build; print(getattr(build, 'build_' + sys.argv[1])(sys.argv[2]))"


def build(kind: str, source: Path, out: Path) -> Path:
    """Source distribution or wheel (``sdist``, ``wheel``) of a tree."""
    out.mkdir(exist_ok=True)
    command = [sys.executable, '-c', FORMATS, kind, str(out)]
    run = subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return out / run.stdout.split()[-1]


def unpacked_sdist(folder: Path) -> Path:
    """The tree of the source distribution, built from a copy of this one."""
    tree = folder / 'tree'
    shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns('.*', 'build', '*.egg-info', '__pycache__', 'figures'))
    subprocess.run(['tar', '-xf', build('sdist', tree, folder / 'dist'), '-C', folder], check=True)
    (found,) = (path for path in folder.iterdir() if path.name.startswith('seal_friction_ros-'))
    return found


def install(wheel: Path, environment: Path, extras: tuple[str, ...] = ()) -> Path:
    """Python of a new environment with a wheel, its requirements and those of its ``extras``."""
    subprocess.run([sys.executable, '-m', 'venv', '--without-pip', environment], check=True)
    python = environment / 'bin' / 'python'
    pip = [sys.executable, '-m', 'pip', '--python', python, '--disable-pip-version-check', '--quiet', 'install']
    subprocess.run([*pip, '--no-index', '--no-deps', '--no-warn-script-location', wheel], check=True)
    (packages,) = environment.glob('lib/python*/site-packages')
    (own,) = packages.glob('seal_friction_ros-*.dist-info')
    for needed in required(Distribution.at(own), extras, {}).values():
        for path in top_level(needed):
            (packages / path.name).symlink_to(path)
    return python


def required(of: Distribution, extras: tuple[str, ...], known: dict[str, Distribution]) -> dict[str, Distribution]:
    """Everything that a distribution requires, directly or not, by name."""
    for requirement in map(Requirement, of.requires or ()):
        marker = requirement.marker
        wanted = marker is None or any(marker.evaluate({'extra': extra}) for extra in ('', *extras))
        name = canonicalize_name(requirement.name)
        if wanted and name not in known:
            found = known[name] = distribution(name)
            assert requirement.specifier.contains(found.version), f'{requirement}: {found.version} is installed'
            required(found, tuple(requirement.extras), known)
    return known


def top_level(of: Distribution) -> Iterator[Path]:
    """Files and folders of a distribution in the folder of all packages."""
    names = {file.parts[0] for file in of.files or () if file.parts[0] not in ('..', '__pycache__')}
    yield from (Path(str(of.locate_file(name))) for name in sorted(names))
