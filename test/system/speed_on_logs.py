"""The speed of a friction map on measured O-rings: ``python test/system/speed_on_logs.py FOLDER``.

FOLDER has the logs of the Delft rig. One factor on the map is chosen on one log, and the live estimate with the map is
compared with the force sum of every other log: with the speeds that the film gives, with the friction at the reference
speed at every speed, and with that times a power of the speed (a shear law of the rubber), whose exponent is chosen on
the one log, too. A speed axis may be in a seal file only if it beats none on every log left out.
"""

import argparse
import sys
import tempfile
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import run_command

from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.contact.lubrication_runs import MapRuns, load_case, run_map, seal_document
from seal_friction_ros.offline.work.seal_writer import write_seal

SLOWEST = 1.5e-3  # [m/s] compared from here: below, the position tells no velocity
RIGID = '/**: {ros__parameters: {stamp_age_max: 0.0, use_presliding: false}}\n'
EXPONENTS = (-0.5, 1.5)  # of the speed


class Slid(NamedTuple):
    """Steady sliding of a log."""

    velocity: np.ndarray  # [m/s]
    force: np.ndarray  # [N] force sum of the log
    friction: dict[str, np.ndarray]  # [N] signed, live, by the kind of map


def seal_files(computed: MapRuns, folder: Path) -> dict[str, Path]:
    """Seal file of a map without speeds, as it is written for a ring, and with those of the film."""
    free = computed.table._replace(real_contact=0.0 * computed.table.real_contact)
    files = {'film': computed._replace(table=free), 'none': computed}
    for name, runs in files.items():
        document = seal_document(runs, name) | {'mounting': {'chambers': ['a']}}
        write_seal(document, folder / f'{name}.yaml', 'Seal file.')
    return {name: folder / f'{name}.yaml' for name in files}


def slid(log: Path, seals: dict[str, Path], folder: Path) -> Slid:
    """Live friction of a log with each seal file; ``folder`` is for its bags."""
    bag, parameters = folder / log.stem, folder / f'{log.stem}.yaml'
    parameters.write_text(RIGID)
    run_command('import', 'log', log, '--rig', 'delft', '--out', bag)
    runs = {}
    for name, seal in seals.items():
        out = folder / f'{log.stem}_{name}'
        run_command('replay', bag, '--seal', seal, '--params', parameters, '--out', out)
        runs[name] = read_run(out)
    run = runs['none']
    used = (run.state == FrictionState.SLIDING) & (np.abs(run.velocity) > SLOWEST)
    return Slid(run.velocity[used], run.force_sum[used], {name: one.friction_force[used] for name, one in runs.items()})


def rms(log: Slid, kind: str, factor: float, exponent: float = 0.0, speed: float = 1e-2) -> float:
    """RMS [N] of the force sum less the friction and the mean of the rest, which is the offset of the log."""
    left = log.force - factor * log.friction[kind] * (np.abs(log.velocity) / speed) ** exponent
    return float(left.std())


def factor_of(log: Slid, kind: str, exponent: float = 0.0, speed: float = 1e-2) -> float:
    """The factor on a map that suits a log best: least squares."""
    friction = log.friction[kind] * (np.abs(log.velocity) / speed) ** exponent
    friction, force = friction - friction.mean(), log.force - log.force.mean()
    return float(friction @ force / (friction @ friction))


def exponent_of(log: Slid) -> float:
    """The power of the speed that suits a log best."""
    return float(
        minimize_scalar(lambda m: rms(log, 'none', factor_of(log, 'none', m), m), bounds=EXPONENTS, method='bounded').x
    )


def left_out(logs: dict[str, Slid]) -> dict[str, np.ndarray]:
    """RMS [N] of every log with what was chosen on every other, by the kind of map."""
    found: dict[str, list[float]] = {'film': [], 'none': [], 'power': []}
    for one, other in permutations(logs.values(), 2):
        for kind in ('film', 'none'):
            found[kind].append(rms(other, kind, factor_of(one, kind)))
        exponent = exponent_of(one)
        found['power'].append(rms(other, 'none', factor_of(one, 'none', exponent), exponent))
    return {kind: np.array(values) for kind, values in found.items()}


def slid_logs(paths: list[Path], computed: MapRuns, folder: Path) -> dict[str, Slid]:
    """Each log with both maps."""
    seals = seal_files(computed, folder)
    return {path.stem: slid(path, seals, folder) for path in paths}


def main() -> int:
    """Print a line for each kind of map."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('folder', type=Path, help='with the logs of the Delft rig')
    parser.add_argument('--work', type=Path, help='keeps the finished parts of the map')
    options = parser.parse_args()
    computed = run_map(load_case('oring_delft'), 1, options.work)
    with tempfile.TemporaryDirectory() as work:
        logs = slid_logs(sorted(options.folder.glob('O-ring257*bar.csv')), computed, Path(work))
        for name, log in logs.items():
            print(f'{name}: exponent {exponent_of(log):.2f}, factor {factor_of(log, "none"):.2f}')
        found = left_out(logs)
    for kind, values in found.items():
        worse = int((values > found['none']).sum())
        print(f'{kind}: RMS {values.mean():.2f} N in the mean, {values.max():.2f} at worst; worse than none on {worse} '
              f'of {len(values)} left out')  # fmt: skip
    return 0


if __name__ == '__main__':
    sys.exit(main())
