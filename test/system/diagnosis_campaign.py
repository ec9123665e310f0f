"""Wrong inputs of simulated machines and of logs of others: is each named, and nothing on the clean ones?

``python test/system/diagnosis_campaign.py --seeds 25 --logs FOLDER``. The machines have speeds of 4 to 200 mm/s,
strokes of 20 to 200 mm and up to 5 s, two pressures of 3 to 65 bar, noise of 1 to 15 % of the friction, 1 to 30 kg that
nobody knows, 100 to 1000 samples a second. The logs are those of `LOGS`; the seal is identified from the first of each.
Prints a table: how many are named, and the longest motion [s] until then. Exit code 1 if one is missed or a clean one
is said to have a wrong input.
"""

import math
import sys
import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, run_command, tell
from harness.simulated_day import Day, samples
from paths import ROOT

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, step
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.estimation.seal_health import SealHealth, findings, followed
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import mount_seals, mounting_of, parse_seal
from seal_friction_ros.core.messages.records import Force, Pressure
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.bags.import_log import read_samples
from seal_friction_ros.offline.bags.rig_file import read_rig

SEAL = parse_seal(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml'))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
SECOND = 1_000_000_000  # [ns]
SECONDS = 30.0  # of a simulated machine
LOGS = {
    'mbari': (('FrictionIDMovesWithBiasCurr.exp',), ('2022.01.28T16.46.31_new.exp',)),
    'delft': (('O-ring257_[0-9]bar.csv',), ('O-ring257_run2_*.csv',)),
}
"""Rig -> logs the seal is identified from, and further ones of it."""


def _in_unit(pascals: float, sample: RodSample) -> RodSample:
    _, a, b = sample.pressure
    return sample._replace(pressure=Pressure(sample.stamp, a / pascals, b / pascals))


def _force(change: Callable[[float], float], sample: RodSample) -> RodSample:
    return sample._replace(force=Force(sample.stamp, change(sample.force.force)))


FAULTS: dict[str, tuple[Callable[[RodSample], RodSample], str]] = {
    'clean': (lambda sample: sample, ''),
    'sign of the velocity': (lambda sample: sample._replace(velocity=-sample.velocity), 'sign of the velocity'),
    'sign of the force sum': (partial(_force, lambda force: -force), 'sign of the velocity'),
    'psi as Pa': (partial(_in_unit, 6894.757), 'looks like psi'),
    'bar as Pa': (partial(_in_unit, 1e5), 'looks like bar'),
    'frozen force sum': (partial(_force, lambda _: 12.0), 'frozen'),
    'halved force sum': (partial(_force, lambda force: 0.5 * force), 'halved'),
}
WORDS = tuple(word for _, word in FAULTS.values() if word)


def told(seals: tuple[MountedSeal, ...], given: Iterable[RodSample], fault: str) -> dict[str, Any]:
    """Motion [s] until the fault is named, None if it is not, and which wrong inputs were named besides."""
    change, word = FAULTS[fault]
    parameters = EstimatorParameters(EstimatorSettings(), seals, AdaptationSettings('observe'))
    state, health, moved, last, due = estimator.init(parameters), SealHealth(), 0.0, 0, 0
    named, others = None, set()
    for right in given:
        before = state
        state, estimate = step(parameters, state, change(right))
        health = followed(health, before, state)
        if abs(right.velocity) > 2e-3:
            moved += min((right.stamp - last) * 1e-9, 0.1)
        last = right.stamp
        if right.stamp < due:
            continue
        due = right.stamp + SECOND
        said = '; '.join(findings(parameters, health, estimate.status))
        if word and word in said and named is None:
            named = moved
        others |= {other for other in WORDS if other != word and other in said}
    return {'fault': fault, 'named': named, 'others': sorted(others)}


def of_machine(fault: str, seed: int) -> dict[str, Any]:
    """A random machine with this fault."""
    rng = np.random.default_rng(seed)
    speed = float(10.0 ** rng.uniform(math.log10(0.004), math.log10(0.2)))
    stroke = min(float(rng.choice([0.02, 0.05, 0.2])), 4.5 * speed)
    pressure = (float(rng.uniform(0.3e6, 6.5e6)), float(rng.uniform(0.3e6, 6.5e6)))
    day = Day(
        actuator_friction(SEALS, *pressure).coulomb_friction,
        speed=speed,
        stroke_time=stroke / speed / 0.9,
        pressure=pressure,
        noise=float(rng.uniform(0.01, 0.15)),
        mass=float(rng.uniform(1.0, 30.0)),
        dip=float(rng.uniform(0.0, 0.15)),
        period=float(rng.choice([0.01, 0.002, 0.001])),
    )
    return {'of': 'simulated', **told(SEALS, samples(day, SECONDS, seed), fault)}


def of_log(rig: str, log: Path, seal: Path, fault: str) -> dict[str, Any]:
    """A log with this fault, by the seal file of its rig."""
    document = read_yaml(seal)
    chambers = mounting_of(document).chambers
    seals = mount_seals((document,) * len(chambers), tuple(chambers))
    columns = read_samples(log, read_rig(config_path('rigs', rig))).samples
    rows = zip(*(column.tolist() for column in columns), strict=True)
    given = (RodSample(t, v, Pressure(t, a, b), Force(t, force)) for t, a, b, force, v in rows)
    return {'of': rig, 'log': log.name, **told(seals, given, fault)}


def calls_of_logs(folder: Path, out: Path) -> list[Callable[[], dict[str, Any]]]:
    """Every log with every fault; the seal files go to ``out``."""
    calls = []
    for rig, (learnt, further) in LOGS.items():
        first, more = (
            [log for name in names for log in sorted((folder / rig).glob(name))] for names in (learnt, further)
        )
        seal = out / f'{rig}.yaml'
        with redirect_stdout(StringIO()):
            run_command('identify', *first, '--rig', rig, '--out', seal)
        calls += [partial(of_log, rig, log, seal, fault) for log in first + more for fault in FAULTS]
    return calls


def campaign(seeds: int, logs: Path | None, workers: int) -> list[dict[str, Any]]:
    """A row for each kind of machine and fault."""
    calls = [partial(of_machine, fault, seed) for fault in FAULTS for seed in range(seeds)]
    with tempfile.TemporaryDirectory() as out, ProcessPoolExecutor(workers) as pool:
        calls += calls_of_logs(logs, Path(out)) if logs else []
        found = [future.result() for future in [pool.submit(call) for call in calls]]
    rows = []
    for key in dict.fromkeys((one['of'], one['fault']) for one in found):
        of_key = [one for one in found if (one['of'], one['fault']) == key]
        named = [one['named'] for one in of_key if one['named'] is not None]
        rows.append(
            {
                'of': key[0],
                'fault': key[1],
                'runs': len(of_key),
                'named': len(named),
                'longest_s': max(named, default=0.0),
                'something_else_named': sum(bool(one['others']) for one in of_key),
            }
        )
    return rows


def main() -> int:
    """Run and judge."""
    parser = parser_of(__doc__, seeds=(5, 'machines of each fault'), workers=(2, 'processes'))
    parser.add_argument('--logs', type=Path, help='folder with the logs, in a folder for each rig')
    arguments = parser.parse_args()
    rows = campaign(arguments.seeds, arguments.logs, arguments.workers)
    tell(rows, as_json=arguments.json)
    missed = [row for row in rows if row['fault'] != 'clean' and row['named'] < row['runs']]
    wrong = [row for row in rows if row['fault'] == 'clean' and row['something_else_named']]
    return 1 if missed or wrong else 0


if __name__ == '__main__':
    sys.exit(main())
