"""Commands of `seal_friction_studies`: a package of the same distribution, which this one knows by name only."""

from importlib import import_module
from typing import Any

STUDIES = 'seal_friction_studies'


def of_studies(module: str) -> tuple[Any, ...]:
    """A module of the studies by its name below their package; none where they are not installed."""
    try:
        return (import_module(f'{STUDIES}.{module}'),)
    except ModuleNotFoundError as error:
        if error.name == STUDIES:
            return ()
        raise
