"""Point the CMake targets exported by the ROS 2 wheels at this environment's headers.

The wheels name the Python and numpy headers of the machine that built them
(``/opt/python/cpXY-cpXY/include/pythonX.Y`` and ``.../numpy/_core/include``), so nothing would compile against them.
Run by ``tools/setup.sh`` with the Python of ``.venv``.
"""

import re
import sys
import sysconfig
from pathlib import Path

import numpy

BUILDERS_NUMPY = re.compile(r'/opt/python/cp\d+-cp\d+/lib/python[\d.]+/site-packages/numpy/_core/include')
BUILDERS_PYTHON = re.compile(r'/opt/python/cp\d+-cp\d+/include/python[\d.]+')


def main() -> None:
    """Rewrite both paths in every exported target of the environment this Python belongs to."""
    for target in sorted(Path(sys.prefix).glob('share/*/cmake/*.cmake')):
        text = target.read_text()
        patched = BUILDERS_NUMPY.sub(numpy.get_include(), text)
        patched = BUILDERS_PYTHON.sub(sysconfig.get_path('include'), patched)
        if patched != text:
            target.write_text(patched)


if __name__ == '__main__':
    main()
