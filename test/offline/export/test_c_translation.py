"""C from small functions computes what Python computes, to the bit; what it would compute otherwise is refused."""

import ctypes
import math
import struct
import subprocess
from bisect import bisect_right
from typing import NamedTuple

import numpy as np
import pytest

from seal_friction_ros.core.foundation.compiled import replace
from seal_friction_ros.offline.export.c_library import TEMPLATES
from seal_friction_ros.offline.export.c_translation import Translation
from seal_friction_ros.offline.export.c_types import Runtime, Types, UntranslatableError

KNOTS = (-1.0, 0.0, 2.5, 1e6)


class Pair(NamedTuple):
    """Two numbers."""

    first: float
    second: float


def smallest(a: float, b: float) -> float:
    return min(a, b)


def largest(a: float, b: float) -> float:
    return max(a, b)


def square(a: float, _b: float) -> float:
    return math.pow(a, 2.0) if abs(a) < 1e100 else a


def swapped(a: float, b: float) -> float:
    a, b = b, a
    return a - 2.0 * b


def three(a: float, b: float) -> float:
    first, second, third = a, b, 0.5
    first, second, third = second, third, first
    return first + 3.0 * second - third


def ordered(a: float, b: float) -> float:
    low, high = (a, b) if a < b else (b, a)
    return low - high / 3.0


def between(a: float, b: float) -> float:
    return 1.0 if 0.0 <= a < b or (a > b and not b >= 0.0) else -1.0


def below(a: float, b: float) -> float:
    count = 0
    for each in KNOTS:
        if a < each:
            break
        count += 1
    return float(count) if b in (0.0, 3e6) else float(-count)


def place(a: float, b: float) -> float:
    return KNOTS[bisect_right(KNOTS, 0.0 if a > b else -1.0) - 1]


def later(a: float, b: float) -> float:
    pair = replace(Pair(a, 1.0), second=b)
    first, second = pair
    return second - first + pair.first


def whole(a: float, b: float) -> float:
    number = int(a) if abs(a) < 1e18 else 7
    number += 3 if b > 0.0 else -3
    return float(abs(number) - (number & 5) + max(number, 2) * 2)


LAWS = (smallest, largest, square, swapped, three, ordered, between, below, place, later, whole)


@pytest.fixture(scope='module')
def library(tmp_path_factory) -> ctypes.CDLL:
    """The functions in C, behind the beginning of the template of the library."""
    folder, translation = tmp_path_factory.mktemp('laws'), Translation(types := Types('test'))
    names = [translation.function(law, [Runtime('', float), Runtime('', float)])[0] for law in LAWS]
    template = (TEMPLATES / 'library.c').read_text()
    beginning = template[template.index('#include <float.h>') : template.index('${types}')]
    ways_in = [f'double {law.__name__}_(double a, double b) {{ return {name}(a, b); }}'
               for law, name in zip(LAWS, names, strict=True)]  # fmt: skip
    includes = '#include <stdbool.h>\n#include <stdint.h>\n'
    (folder / 'laws.c').write_text('\n'.join([includes, beginning, *types.declarations, translation.text, *ways_in]))
    build = [
        'cc',
        '-std=c11',
        '-O2',
        '-Wall',
        '-Wextra',
        '-Werror',
        '-fPIC',
        '-shared',
        'laws.c',
        '-o',
        'laws.so',
        '-lm',
    ]
    subprocess.run(build, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / 'laws.so'))


@pytest.mark.parametrize('law', LAWS)
def test_a_function_in_c_gives_the_bits_of_python(law, library: ctypes.CDLL):
    in_c = getattr(library, f'{law.__name__}_')
    in_c.restype, in_c.argtypes = ctypes.c_double, [ctypes.c_double] * 2
    special = (0.0, -0.0, 1.0, -1.0, 2.5, 3e6, math.inf, -math.inf, math.nan, 5e-324, -1e300)
    random = np.random.default_rng(1).uniform(-3e6, 3e6, (8000, 2)).tolist()
    for a, b in [*((a, b) for a in special for b in special), *random]:
        found, expected = in_c(a, b), law(a, b)
        assert math.isnan(found) == math.isnan(expected), (a, b)
        assert math.isnan(found) or struct.pack('d', found) == struct.pack('d', expected), (a, b)


def number_or(a: float, b: float) -> float:
    return a or b


def one_or_other(a: float, b: float) -> float:
    limit: tuple[()] | None = None
    if a > b:
        limit = ()
    return a if limit is None else b


def loop_with_else(a: float, b: float) -> float:
    for each in (1.0, 2.0):
        if a > each:
            break
    else:
        return b
    return a


def remainder(a: float, b: float) -> float:
    return a % b


def waits(a: float, b: float) -> float:
    while a > b:
        b += 1.0
    return b


@pytest.mark.parametrize('law', [number_or, one_or_other, loop_with_else, remainder, waits])
def test_python_that_c_would_compute_otherwise_is_refused_by_name(law):
    with pytest.raises(UntranslatableError, match=f'test_c_translation.{law.__name__}'):
        Translation(Types('rod')).function(law, [Runtime('', float), Runtime('', float)])
