"""Compiled code shared by all processes of the tests; to be imported before numba.

numba keeps it in a folder whose name is a hash of the sources, so every change compiles anew.
"""

import hashlib
import importlib.metadata
import os
import shutil

from paths import ROOT


def cache_folder() -> str:
    """Folder for the compiled code of the present sources; removes those of other sources.

    The sources are those of core, which compiled code calls, and the modules elsewhere that compile functions.
    """
    digest = hashlib.sha256(importlib.metadata.version('numba').encode())
    for path in sorted((ROOT / 'seal_friction_ros').rglob('*.py')):
        source = path.read_bytes()
        if 'core' in path.relative_to(ROOT).parts or b'foundation.compiled import' in source:
            digest.update(source)
    folder = ROOT / 'build' / 'numba' / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    for other in folder.parent.iterdir():
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    return str(folder)


if 'NUMBA_CACHE_DIR' not in os.environ:  # else the process that started this one has set it
    os.environ['NUMBA_CACHE_DIR'] = cache_folder()
