"""Real logs predicted blind: ``identify`` on some logs, its friction and band on others, beside least squares.

``python test/system/blind_logs.py FOLDER`` with the shared data in FOLDER. Least squares fits five terms to the same
samples, [sign v, v, sign v P, v P, 1] with the mean pressure P at the seals. An offset of each other log is free. Seals
of the Delft rig: each pressure by the others (an outlier is none), and two runs of one ring.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from harness.campaign import parser_of, tell
from harness.identify_run import FRICTION_ID, OTHER, Run

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.identification.fitting import offsets_of
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.files import load_configuration
from seal_friction_ros.offline.identification.pipeline import fitted_readings
from seal_friction_ros.offline.identification.sources import SourceOptions, read_sources

RINGS = {'O-ring257': (1, 3, 5, 7), 'X-ring257': (1, 3, 5, 7), 'NAPN': (1, 3, 5, 7), 'Stadium_lc': (1, 2, 3, 4, 5)}


def slow_and_fast(log: Path, folder: Path, limit: float) -> tuple[Path, Path]:
    """The rows of an MR damper log slower and faster than ``limit`` [mm/s], as logs of their own."""
    head, *rows = log.read_text().splitlines()
    speed = np.array([abs(float(row.split(',')[2])) for row in rows])
    found = []
    for name, chosen in (('slow', speed <= limit), ('fast', speed > limit)):
        found.append(folder / f'{name}_{log.name}')
        found[-1].write_text('\n'.join([head, *(row for row, each in zip(rows, chosen, strict=True) if each)]))
    return found[0], found[1]


def read(paths: Sequence[Path], rig: str) -> FrictionReadings:
    """Readings of logs."""
    return read_sources(paths, SourceOptions(rig=rig, chambers=('a',))).prepare().readings


def least_squares(first: FrictionReadings, other: FrictionReadings) -> np.ndarray:
    """Friction of the other readings [N] by five terms fitted to the first."""

    def terms(r: FrictionReadings) -> np.ndarray:
        difference = np.abs(r.chamber_pressures[:, 0] - r.chamber_pressures[:, 1]) * 1e-5
        return np.c_[r.at.direction, r.at.velocity, r.at.direction * difference, r.at.velocity * difference]

    columns = np.c_[terms(first), np.ones(first.count)]
    return other.at.direction * (terms(other) @ np.linalg.lstsq(columns, first.force, rcond=None)[0][:4])


def predicted(name: str, first: Sequence[Path], others: Sequence[Path], rig: str, folder: Path, *more: str) -> dict:
    """Row of the table: ``others`` predicted by what ``first`` show."""
    run = Run(folder, *map(str, first), '--rig', rig, *more)
    if run.code:
        return {'log': name, 'law': run.errors.strip()[:90]}
    configuration = load_configuration(SealSelection((str(run.out),), ('mounting',)), EstimatorSettings())
    mounted: tuple[MountedSeal, ...] = configuration.parameters().estimator.seals
    readings = read(others, rig)
    friction, std = fitted_readings(mounted, readings.chamber_pressures, readings.at.velocity)
    squares = least_squares(read(first, rig), readings)
    off, off_squares = (readings.magnitudes(offsets_of(readings, each)) - each for each in (friction, squares))
    return {
        'log': name,
        'law': run.figures['law'],
        'identify [N]': float(np.sqrt(np.mean(off**2))),
        'least squares [N]': float(np.sqrt(np.mean(off_squares**2))),
        'in band [%]': 100.0 * float(np.mean(np.abs(off) <= BAND_95 * std)),
        'half width [%]': 100.0 * BAND_95 * float(std.mean() / friction.mean()),
    }


def left_out(ring: str, bars: Sequence[int], folder: Path, delft: Path) -> dict:
    """Row of the table: each pressure of a ring by the law fitted to the others."""
    run = Run(folder, *(str(delft / f'{ring}_{bar}bar.csv') for bar in bars), '--rig', 'delft')
    names, used = ('measured_N', 'left_out_N', 'left_out_nested_N', 'std_N'), ~np.array(run.figures['is_outlier'])
    f = {name: np.array(run.figures[name])[used] for name in names}
    off = np.abs(f['left_out_N'] - f['measured_N'])
    return {
        'log': f'{ring}, a pressure left out',
        'law': run.figures['law'] + ', without an outlier' * (not used.all()),
        'worst [%]': 100.0 * float(np.max(off / f['measured_N'])),
        'chosen anew [%]': 100.0 * float(np.nanmax(np.abs(f['left_out_nested_N'] / f['measured_N'] - 1.0))),
        'in band [%]': 100.0 * float(np.mean(off <= BAND_95 * f['std_N'])),
        'half width [%]': 100.0 * BAND_95 * float(np.mean(f['std_N'] / f['measured_N'])),
    }


def main() -> int:
    """Print the table."""
    parser = parser_of(__doc__)
    parser.add_argument('folder', type=Path, help='of the shared data')
    parser.add_argument('--only', default='', help='rows with this in their name')
    options, rows = parser.parse_args(), []
    mbari, delft, damper = (options.folder / name for name in ('mbari', 'delft', 'mr_damper'))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        split = [slow_and_fast(log, folder, 25.0) for log in sorted(damper.glob('*.csv'))]
        rings = {run: [delft / f'O-ring257{run}_{bar}bar.csv' for bar in RINGS['O-ring257']] for run in ('', '_run2')}
        slow, fast = ([pair[side] for pair in split] for side in (0, 1))
        mr = str(damper / 'mr.yaml')
        cases = {
            'FrictionID -> 2022': (lambda n: predicted(n, [mbari / FRICTION_ID], [mbari / OTHER], 'mbari', folder)),
            '2022 -> FrictionID': (lambda n: predicted(n, [mbari / OTHER], [mbari / FRICTION_ID], 'mbari', folder)),
            'O-ring -> another day': (lambda n: predicted(n, rings[''], rings['_run2'], 'delft', folder)),
            'another day -> O-ring': (lambda n: predicted(n, rings['_run2'], rings[''], 'delft', folder)),
            'MR damper, slow -> fast': (lambda n: predicted(n, slow, fast, mr, folder, '--seal-chambers', 'a')),
            'MR damper, fast -> slow': (lambda n: predicted(n, fast, slow, mr, folder, '--seal-chambers', 'a')),
            **{f'{ring}': (lambda n: left_out(n, RINGS[n], folder, delft)) for ring in RINGS},
        }
        rows = [make(case) for case, make in cases.items() if options.only in case]
    tell(rows, as_json=options.json)
    return 0


if __name__ == '__main__':
    sys.exit(main())
