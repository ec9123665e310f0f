"""Machines simulated apart from the package: the estimate with adaptation beside the seal file as it is.

``python test/system/estimated_machines.py``. The seal files come from the first recording of `identified_machines`; the
second one has other speeds, pressures and loads, and a day on which the friction is 0.8, 1 or 1.25 times as large.
With the load in the force sum, and without a load cell: then a load of the cylinder is taken for what it is not.
Exit code 1 if the friction with ``on`` is off by more than `MOST` times as much as with ``off``.
"""

import itertools
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from harness.campaign import parser_of, tell_tables
from harness.identify_run import Run
from identified_machines import ANNULUS, BAR, BORE, MACHINES, WAYS, Machine, Recording, record, write_log

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.messages.records import Force, Pressure
from seal_friction_ros.files import load_configuration

MOST = 1.1  # RMS with adaptation over that without
DAYS = (0.8, 1.0, 1.25)  # friction of the second recording over that of the first
NOISE = 0.01  # of the largest force sum


class Score(NamedTuple):
    """RMS of the friction while the rod slides over that of the true friction, and what the band holds."""

    off: float  # [-]
    on: float  # [-]
    good: float  # [-] share of status 0 with ``on``
    inside: float  # [-] share of those in the 95 % band


def estimated(log: Recording, seals: EstimatorParameters, mode: str, has_load: bool) -> np.ndarray:
    """Friction force [N], its deviation [N] and the status of each sample, shape (n, 3)."""
    known = EstimatorParameters(seals.settings, seals.seals, AdaptationSettings(mode))
    force = (log.a * BORE - log.b * ANNULUS) * BAR - (log.load if has_load else 0.0)
    force = force + NOISE * np.abs(log.friction).max() * np.random.default_rng(0).normal(size=len(force))
    state, found = init(known), []
    columns = (log.time, log.velocity, log.a * BAR, log.b * BAR, force)
    for time, velocity, a, b, measured in zip(*(column.tolist() for column in columns), strict=True):
        stamp = round(1e9 * (time + 1.0))
        state, one = step(known, state, RodSample(stamp, velocity, Pressure(stamp, a, b), Force(stamp, measured)))
        found.append((one.friction_force, one.coulomb_friction_std, one.status))
    return np.array(found)


def identified(machine: Machine, seed: int, folder: Path) -> EstimatorParameters | None:
    """Seals by the first recording; None: identification refuses it."""
    first = record(machine, machine.supplies, (0.02, 0.08), (0.0, 0.4), seed)
    run = Run(folder, *write_log(first, folder, 'first', seed, machine.noise), *WAYS['one'], '--run-to-run', '0')
    if run.code:
        return None
    selection = SealSelection((str(run.out),), ('mounting',))
    return load_configuration(selection, EstimatorSettings()).parameters().estimator


def score(machine: Machine, seals: EstimatorParameters, day: float, has_load: bool, seed: int) -> Score:
    """Estimate along a second recording."""
    others = 0.5 * (np.array(machine.supplies[1:]) + np.array(machine.supplies[:-1]))
    changed = machine._replace(run_in=0.0, friction=lambda *of: day * machine.friction(*of))
    second = record(changed, others.tolist(), (0.03, 0.06, 0.12), (0.1, 0.5), seed + 1)
    moving = second.velocity != 0.0
    truth = second.friction[moving]
    off, on = (estimated(second, seals, mode, has_load)[moving] for mode in ('off', 'on'))
    size = float(np.sqrt(np.mean(truth**2)))
    wrong = [float(np.sqrt(np.mean((found[:, 0] - truth) ** 2))) / size for found in (off, on)]
    good = on[:, 2] == 0.0
    inside = np.abs(on[:, 0] - truth)[good] <= BAND_95 * on[good, 1]
    return Score(*wrong, float(np.mean(good)), float(np.mean(inside)) if good.any() else 1.0)


def main() -> int:
    """Print the table."""
    parser = parser_of(__doc__)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--only', default='')
    options = parser.parse_args()
    rows, bad = {}, 0
    for machine in (m for m in MACHINES if options.only in m.name):
        with tempfile.TemporaryDirectory() as folder:
            seals = identified(machine, options.seed, Path(folder))
        if seals is None:
            rows[f'{machine.name}: refused'] = {}
        for day, has_load in itertools.product(DAYS if seals else (), (True, False)):
            found = score(machine, seals, day, has_load, options.seed)
            rows[f'{machine.name}, {day:g}' + ('' if has_load else ', no load cell')] = found._asdict()
            bad += found.on > MOST * max(found.off, NOISE)
    tell_tables({'friction, RMS over the true one': rows}, as_json=options.json)
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
