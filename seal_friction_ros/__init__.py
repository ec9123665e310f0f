"""Live, recorded and replayable estimate of hydraulic seal friction for ROS 2.

The names below are the Python interface, see `seal_friction_ros.api`. They load when they are first used: the import
of the package itself loads nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from seal_friction_ros.api import *

__all__ = [
    'Columns', 'Estimator', 'FrictionState', 'MissingPackageError', 'RecordedAxisSettings', 'Seal', 'Status',
    'TuningSettings', 'compare', 'identify', 'load_seal', 'read_bag', 'replay', 'report', 'tune',
]  # fmt: skip


if not TYPE_CHECKING:  # a type checker knows the names, and that there are no others

    def __getattr__(name: str) -> Any:
        if name not in __all__:
            raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
        return getattr(import_module('seal_friction_ros.api'), name)

    def __dir__() -> list[str]:
        return [*globals(), *__all__]
