"""Packages that a machine may lack: a command or node that needs one ends with one line that says how to install it.

Core and the computation of the live node need numpy and PyYAML alone, bags mcap, the others only some commands.
"""

from importlib import import_module
from typing import Any

OPTIONAL = {
    'mcap': '',
    'rosbags': '',
    'scipy': 'python3-scipy',
    'numba': 'python3-numba',
    'matplotlib': 'python3-matplotlib',
    'jinja2': 'python3-jinja2',
    'zstandard': 'python3-zstandard',
    'lz4': 'python3-lz4',
    'tornado': 'python3-tornado',
    'rich': 'python3-rich',
    'argcomplete': 'python3-argcomplete',
    'distributed': '',
    'fsspec': '',
    'pyarrow': '',
    'ezdxf': '',
    'pandas': 'python3-pandas',
    'xarray': 'python3-xarray',
}
"""Module, which is also its name on PyPI -> package of Debian and Ubuntu; empty: there is none that we tested."""


class MissingPackageError(ValueError):
    """A package is not installed; one line that says which, and how to install it."""


def needed(module: str) -> Any:
    """Import a module of an optional package.

    MissingPackageError: It is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise as_missing(error) from None


def as_missing(error: ModuleNotFoundError) -> Exception:
    """`MissingPackageError` for an import of an optional package that failed; any other error as it is."""
    package = (error.name or '').partition('.')[0]
    if package not in OPTIONAL:
        return error
    return MissingPackageError(f'{package} is {how_to_install(package)}')


def how_to_install(package: str) -> str:
    """That an optional package is not installed, and how to install it."""
    system = f'apt-get install {OPTIONAL[package]}, or ' if OPTIONAL[package] else ''
    return f'not installed: {system}pip install {package}'
