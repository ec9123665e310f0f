"""A process in which packages cannot be imported: ``python without.py MODULE,... -- PROGRAM [ARGUMENT]...``.

PROGRAM is a module to run, or an entry point ``module:function``.
"""

import importlib.abc
import runpy
import sys
from collections.abc import Sequence
from importlib import import_module


class Blocker(importlib.abc.MetaPathFinder):
    """Finds none of some packages, as if they were not installed."""

    def __init__(self, packages: Sequence[str]) -> None:
        self._packages = set(packages)

    def find_spec(self, fullname: str, path: object, target: object = None) -> None:
        del path, target
        if fullname.partition('.')[0] in self._packages:
            raise ModuleNotFoundError(f'No module named {fullname!r}', name=fullname)


if __name__ == '__main__':
    blocked, _, program, *arguments = sys.argv[1:]
    sys.meta_path.insert(0, Blocker(blocked.split(',')))
    sys.argv = [program, *arguments]
    module, _, function = program.partition(':')
    if function:
        sys.exit(getattr(import_module(module), function)())
    runpy.run_module(module, run_name='__main__')
