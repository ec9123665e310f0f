"""What each constant of the filter moves: halved and doubled, on attacks and, with ``--logs FOLDER``, on ram logs.

``python test/system/constants.py [--logs FOLDER]``. For each the three figures that move most, relative to those of the
constant as it is: errors [N] of `compare_estimators`, shares of good samples and, as a difference, of wrong ones among
them in `attacks`. A constant that moves nothing can go, unless a test needs it.
"""

import itertools
import re
import sys
import tempfile
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))

from attacks import ATTACKS, CLEAN, attacked
from compare_estimators import Log, package, seals_and_logs
from harness.campaign import parser_of, tell

from seal_friction_ros.core.estimation import adaptation, friction_filter, moving_mass

MODULES = (friction_filter, moving_mass, adaptation)
LEAST = 0.002  # [-] change that is told
Pairs = Mapping[str, tuple[Path, Log]]


class Constant(NamedTuple):
    """A number at the level of a module."""

    module: str
    name: str
    factor: float


def constants() -> list[Constant]:
    """Every constant twice: halved and doubled."""
    found = []
    for module in MODULES:
        names = re.findall(r'^([A-Z_]+) = [-\d]', Path(str(module.__file__)).read_text(), re.MULTILINE)
        found += [Constant(module.__name__, name, factor) for name in names for factor in (0.5, 2.0)]
    return found


def figures(seconds: float, pairs: Pairs) -> dict[str, float]:
    """Errors on logs, shares of good and of wrong samples of the attacks."""
    found = {f'{name}: {key}': value for name, of in pairs.items() for key, value in package(*of)[0].items()}
    for name in CLEAN | ATTACKS:
        one = attacked(name, 'on', seconds, 0.0)
        found |= {f'{name}: good': one.good, f'{name}: wrong': 1.0 + one.wrong}
    return found


def moved(seconds: float, pairs: Pairs, usual: Mapping[str, float], constant: Constant) -> str:
    """The three figures that a constant moves most."""
    value = getattr(sys.modules[constant.module], constant.name)
    changed = type(value)(max(value * constant.factor, 1)) if isinstance(value, int) else value * constant.factor
    users = [module for module in MODULES if getattr(module, constant.name, None) is value]
    for module in users:
        setattr(module, constant.name, changed)
    try:
        found = figures(seconds, pairs)
    finally:
        for module in users:
            setattr(module, constant.name, value)
    changes = {name: found[name] / before - 1.0 for name, before in usual.items() if before}
    most = sorted(changes, key=lambda name: -abs(changes[name]))[:3]
    return ', '.join(f'{name} {changes[name]:+.1%}' for name in most if abs(changes[name]) > LEAST) or '-'


def main() -> int:
    """Print what each moves."""
    parser = parser_of(__doc__, seconds=(20.0, 'of an attack [s]'), workers=(2, 'processes'))
    parser.add_argument('--logs', type=Path, help='folder with logs of the mbari rig')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as work, ProcessPoolExecutor(arguments.workers) as pool:
        logs = seals_and_logs(arguments.logs, Path(work)) if arguments.logs else {}
        pairs = {other: (logs[one][0], logs[other][1]) for one, other in itertools.permutations(logs, 2)}
        each, usual = constants(), figures(arguments.seconds, pairs)
        found = list(pool.map(partial(moved, arguments.seconds, pairs, usual), each))
    rows = [
        {'constant': half.name, 'halved': found[2 * i], 'doubled': found[2 * i + 1]} for i, half in enumerate(each[::2])
    ]
    tell(rows, as_json=arguments.json, title='what moves most')
    return 0


if __name__ == '__main__':
    sys.exit(main())
