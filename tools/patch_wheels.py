"""Point the CMake targets exported by the ROS 2 wheels at this environment's headers and libraries.

The wheels name the Python and numpy headers of the computer that built them
(``/opt/python/cpXY-cpXY/include/pythonX.Y`` and ``.../numpy/_core/include``), so nothing would compile against them.
They also name libraries of that computer, libtinyxml2 and lttng-ust, which C++ programs could not link. The shared
libraries of the wheels bring both along, so they are left out where this computer does not have them. Run by
``tools/setup.sh`` with the Python of ``.venv``.
"""

import ctypes.util
import re
import sys
import sysconfig
from pathlib import Path

import numpy

BUILDERS_NUMPY = re.compile(r'/opt/python/cp\d+-cp\d+/lib/python[\d.]+/site-packages/numpy/_core/include')
BUILDERS_PYTHON = re.compile(r'/opt/python/cp\d+-cp\d+/include/python[\d.]+')
TINYXML = re.compile(r'/usr/lib64/libtinyxml2\.so;')
LTTNG = re.compile(r'\blttng-ust;')


def without_missing_libraries(text: str) -> str:
    """Text of a target without the libraries that this computer does not have."""
    if not Path('/usr/lib64/libtinyxml2.so').exists():
        text = TINYXML.sub('', text)
    return text if ctypes.util.find_library('lttng-ust') else LTTNG.sub('', text)


def main() -> None:
    """Rewrite every exported target of the environment this Python belongs to."""
    for target in sorted(Path(sys.prefix).glob('share/*/cmake/*.cmake')):
        text = target.read_text()
        patched = BUILDERS_NUMPY.sub(numpy.get_include(), text)
        patched = BUILDERS_PYTHON.sub(sysconfig.get_path('include'), patched)
        patched = without_missing_libraries(patched)
        if patched != text:
            target.write_text(patched)


if __name__ == '__main__':
    main()
