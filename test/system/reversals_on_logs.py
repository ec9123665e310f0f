"""The estimate after the reversals of measured seals, with rigid and with elastic seals.

``python test/system/reversals_on_logs.py FOLDER`` with the logs of the Delft rig in FOLDER. Law and elasticity are
identified on some logs and used on others, by the commands a user has; adaptation is on, so what the log shows up to a
sample counts, too. The moving mass of the rig, not in its data, is assumed (``--mass``). The friction force over the
first 0.5 mm after each reversal is compared with the force sum less the offset of the log: half the sum of the mean
residuals of the two directions, beyond 2 mm.
"""

import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, run_command, tell

from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, VELOCITY_TYPE
from seal_friction_ros.offline.bags.bag import read_messages

MASS = 1.0  # [kg] assumed
NEAR, FAR = 0.5e-3, 2e-3  # [m] of travel after a reversal
PARAMETERS = (
    "/**: {{ros__parameters: {{adaptation.mode: 'on', adaptation.moving_mass: {}, stamp_age_max: 0.0, "
    'use_presliding: {}}}}}\n'
)


class Errors(NamedTuple):
    """Friction near the reversals of some logs."""

    rms: float  # [N]
    samples: int
    good: int  # of them with status 0
    in_band: int  # of these in their 95 % band


def logs(folder: Path, names: str) -> list[Path]:
    """Logs of a seal, in order."""
    return sorted(folder.glob(names))


def seal_pairs(folder: Path) -> dict[str, tuple[list[Path], list[Path]]]:
    """Seal -> logs to identify it on, and others to use it on."""
    first, second = logs(folder, 'O-ring257_[0-9]bar.csv'), logs(folder, 'O-ring257_run2_*.csv')
    pairs = {'O-ring, run 1 on run 2': (first, second), 'O-ring, run 2 on run 1': (second, first)}
    for name, files in (('Stadium seal', 'Stadium_lc_*.csv'), ('X-ring', 'X-ring257_*.csv')):
        each = logs(folder, files)
        pairs[name] = (each[::2], each[1::2])
    return pairs


def errors(work: Path, learnt_on: list[Path], used_on: list[Path], mass: float = MASS) -> tuple[Errors, Errors]:
    """With rigid and with elastic seals; ``work`` is a new folder."""
    work.mkdir()
    seal = work / 'seal.yaml'
    run_command('identify', *learnt_on, '--rig', 'delft', '--presliding', '--out', seal)
    bags = [work / log.stem for log in used_on]
    for log, bag in zip(used_on, bags, strict=True):
        run_command('import', 'log', log, '--rig', 'delft', '--out', bag)
    found = []
    for name in ('false', 'true'):
        parameters = work / f'{name}.yaml'
        parameters.write_text(PARAMETERS.format(mass, name))
        parts = []
        for bag in bags:
            out = work / f'{bag.name}_{name}'
            run_command('replay', bag, '--seal', seal, '--params', parameters, '--out', out)
            parts.append(_near_reversals(out))
        error, good, in_band = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        rms = float(np.sqrt(np.mean(error**2)))
        found.append(Errors(rms, len(error), int(good.sum()), int((good & in_band).sum())))
    return found[0], found[1]


def _near_reversals(bag: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Error of the friction force near the reversals [N], whether the status is 0, and whether the band holds it."""
    messages = list(read_messages(bag))
    estimates = np.array([decode(ESTIMATE_TYPE, m.data)[:14] for m in messages if m.type_name == ESTIMATE_TYPE], float)
    velocities = [decode(VELOCITY_TYPE, m.data)[:2] for m in messages if m.type_name == VELOCITY_TYPE]
    stamp, velocity = np.array(velocities, float).T
    way = np.abs(velocity) * np.diff(stamp, prepend=stamp[0]) * 1e-9
    std, state, direction, status, offset, residual = estimates[:, [13, 5, 6, 7, 11, 12]].T
    travel, last, since = np.zeros(len(way)), 0.0, 0.0
    slides = state == FrictionState.SLIDING
    for i in np.flatnonzero(slides):
        since = way[i] if direction[i] != last else since + way[i]
        travel[i], last = since, direction[i]
    error = residual + offset  # the force sum less inertia and friction
    far = slides & (travel > FAR)
    error -= 0.5 * (error[far & (direction > 0.0)].mean() + error[far & (direction < 0.0)].mean())
    near = slides & (travel < NEAR)
    return error[near], status[near] == 0, np.abs(error[near]) <= BAND_95 * std[near]


def main() -> int:
    """Print a row for each seal."""
    parser = parser_of(__doc__, mass=(MASS, 'of what moves [kg]; 0: unknown'))
    parser.add_argument('folder', type=Path, help='with the logs of the Delft rig')
    options, rows = parser.parse_args(), {}
    with tempfile.TemporaryDirectory() as work:
        for number, (name, (learnt_on, used_on)) in enumerate(seal_pairs(options.folder).items()):
            found = errors(Path(work) / str(number), learnt_on, used_on, options.mass)
            rows[name] = {words: each._asdict() for words, each in zip(('rigid', 'elastic'), found, strict=True)}
    tell(rows, as_json=options.json)
    return 0


if __name__ == '__main__':
    sys.exit(main())
