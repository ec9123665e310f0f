"""Machines simulated apart from the package: ``identify`` beside least squares, scored on a second recording.

``python test/system/identified_machines.py``. Rod seals on chamber b and a piston seal on the difference; the first
recording has four supply pressures and two speeds, the second other speeds, pressures and loads. Least squares fits
[sign v, v, sign v p_b^e, sign v |p_a - p_b|^e] to the same samples. Exit code 1 if the friction of ``identify`` is off
by more than `MOST` times as much, its band holds less than 90 %, or is wider than three times the error.
"""

import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from harness.campaign import parser_of, tell
from harness.identify_run import Run

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.files import load_configuration

BAR = 1e5  # [Pa]
STEP = 0.01  # [s]
BAND_95 = 1.959964
MOST = 1.2  # RMS of identify over that of least squares
EXPONENTS = (0.5, 2.0 / 3.0, 0.8, 1.0, 1.25, 1.5)
BORE, ANNULUS = 1.2566e-3, 8.765e-4  # [m^2] 40/22 mm
RIG = """name: machine
source: simulated
frame_id: rod
header: row
start: 1.0
time: {column_name: t, unit: s}
chamber_a: {terms: [{column_name: pa, unit: bar}]}
chamber_b: {terms: [{column_name: pb, unit: bar}]}
force_sum:
  terms:
    - {column_name: pa, unit: bar, gain: 1256.6, gain_unit: mm2}
    - {column_name: pb, unit: bar, gain: -876.5, gain_unit: mm2}
    - {column_name: load, unit: N, gain: -1.0}
velocity: {terms: [{column_name: x, unit: mm}], savitzky_golay: {window: 0.2, order: 2, largest_gap: 0.05}}
load: none
"""


class Machine(NamedTuple):
    """A cylinder whose friction is known."""

    name: str
    friction: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
    """magnitude [N] over speed [m/s], pressure of chamber b and difference [bar], direction"""
    supplies: tuple[float, ...] = (40.0, 70.0, 110.0, 160.0)  # [bar]
    run_in: float = 0.0  # share of the friction that is lost over the first recording
    noise: float = 1.0  # of the sensors, over the usual one


def _two(rod: Callable, piston: Callable) -> Callable:
    return lambda v, b, d, _: rod(b) + piston(d) + 0.0 * v


def _lip_seals(v: np.ndarray, b: np.ndarray, d: np.ndarray, _: np.ndarray) -> np.ndarray:
    return 3.0 + 0.6 * b**1.3 + 1.1 * d**1.3 + 10.0 * v


def _log_speed(v: np.ndarray, b: np.ndarray, d: np.ndarray, _: np.ndarray) -> np.ndarray:
    return (100.0 + 0.8 * b + 1.4 * d) * (1.0 - 0.12 * np.log(np.maximum(v, 1e-3) / 0.02))


PNEUMATIC = (2.0, 4.0, 6.0, 8.0)  # [bar]
MACHINES = (
    Machine('constant', _two(lambda b: 120.0 + 0 * b, lambda d: 180.0 + 0 * d)),
    Machine('linear', _two(lambda b: 40.0 + 1.1 * b, lambda d: 60.0 + 2.2 * d)),
    Machine('two thirds', _two(lambda b: 30.0 + 5.0 * b ** (2 / 3), lambda d: 50.0 + 9.0 * d ** (2 / 3))),
    Machine('viscous', lambda v, b, d, _: 90.0 + 0.8 * b + 1.5 * d + 2000.0 * v),
    Machine('stribeck', lambda v, b, d, _: (80.0 + 0.9 * b + 1.8 * d) * (1 + 0.5 * np.exp(-v / 0.02)) + 900.0 * v),
    Machine('asymmetric', lambda v, b, d, s: (90.0 + 1.0 * b + 1.6 * d) * (1.0 + 0.15 * s) + 600.0 * v),
    Machine('run-in', lambda v, b, d, _: 90.0 + 1.0 * b + 1.6 * d + 600.0 * v, run_in=0.15),
    Machine('shear-thinning', lambda v, b, d, _: 100.0 + 0.7 * b + 1.2 * d + 500.0 * v**0.5),
    Machine('log of the speed', _log_speed),
    Machine('noisy', lambda v, b, d, _: 90.0 + 0.8 * b + 1.5 * d + 2000.0 * v, noise=4.0),
    Machine('pneumatic lip seals', _lip_seals, PNEUMATIC),
    Machine('pneumatic asymmetric', lambda v, b, d, s: (6 + 1.8 * b + 3 * d) * (1 + 0.12 * s) + 30 * v, PNEUMATIC),
    Machine('pneumatic linear', _two(lambda b: 4.0 + 1.5 * b, lambda d: 6.0 + 3.0 * d), PNEUMATIC),
    Machine(
        'pneumatic stribeck', lambda v, b, d, _: (8.0 + 1.2 * b + 2 * d) * (1 + 0.4 * np.exp(-v / 0.03)), PNEUMATIC
    ),
)


class Recording(NamedTuple):
    """Samples of a recording; arrays of shape (n,)."""

    time: np.ndarray  # [s]
    position: np.ndarray  # [m]
    velocity: np.ndarray  # [m/s]
    a: np.ndarray  # [bar]
    b: np.ndarray  # [bar]
    load: np.ndarray  # [N]
    friction: np.ndarray  # [N] signed


def record(machine: Machine, supplies: Sequence[float], speeds: Sequence[float], loads: Sequence[float], seed: int):
    """Strokes out and back at each supply pressure, load (share of the pressure force) and speed."""
    rng = np.random.default_rng(seed)
    rows = []
    for supply in supplies:
        for share in loads:
            for speed in speeds:
                for side in (1.0, -1.0):
                    back = supply * rng.uniform(0.05, 0.35)
                    rows += [(side * speed, supply, share, back)] * int(0.12 / speed / STEP)
                    rows += [(0.0, supply, share, back)] * 20
    velocity, supply, share, back = np.array(rows).T
    side, load = np.sign(velocity), share * supply * BAR * ANNULUS
    a, b, friction = back.copy(), back.copy(), np.zeros(len(back))
    worn = 1.0 + machine.run_in * (0.5 - np.linspace(0.0, 1.0, len(back)))
    for _ in range(30):  # the driven chamber pays load and friction, on which that depends
        friction = worn * side * machine.friction(np.abs(velocity), b, np.abs(a - b), side)
        a = np.where(side >= 0.0, (friction + load + back * BAR * ANNULUS) / BORE / BAR, back + supply * 0.5)
        b = np.where(side >= 0.0, back, (a * BAR * BORE - friction - load) / ANNULUS / BAR)
        a, b = np.maximum(a, 0.0), np.maximum(b, 0.0)
    load = (a * BORE - b * ANNULUS) * BAR - friction  # what a valve at its limit leaves
    position = 0.1 + np.cumsum(velocity) * STEP
    return Recording(np.arange(len(a)) * STEP, position, velocity, a, b, load, friction)


def write_log(log: Recording, folder: Path, name: str, seed: int, noise: float = 1.0) -> list[str]:
    """Log with the noise of its sensors, and rig file: arguments of ``identify``."""
    rng = np.random.default_rng(seed)
    span = float(np.max(log.a))
    noisy = [p + 5e-4 * noise * span * rng.normal(size=len(p)) for p in (log.a, log.b)]
    load = log.load + 2e-3 * noise * float(np.abs(log.load).max()) * rng.normal(size=len(log.load))
    position = np.round(1e3 * log.position / 5e-3) * 5e-3
    path, rig = folder / f'{name}.csv', folder / 'rig.yaml'
    columns = np.column_stack((log.time, position, *noisy, load))
    np.savetxt(path, columns, fmt='%.6g', delimiter=',', header='t,x,pa,pb,load', comments='')
    rig.write_text(RIG)
    return [str(path), '--rig', str(rig)]


def least_squares(log: Recording, path: Path) -> Callable[[Recording], np.ndarray]:
    """Friction of a recording [N] by least squares of four terms and an offset, fitted to the log as it was written."""
    _, _, a, b, load = np.loadtxt(path, delimiter=',', skiprows=1).T
    moving = log.velocity != 0.0
    force = (a * BORE - b * ANNULUS) * BAR - load

    def terms(v: np.ndarray, a: np.ndarray, b: np.ndarray, e: float) -> np.ndarray:
        side, difference = np.sign(v), np.abs(a - b)
        return np.column_stack((side, v, side * np.maximum(b, 0.0) ** e, side * difference**e))

    fits = []
    for e in EXPONENTS:
        x = np.column_stack((terms(log.velocity, a, b, e)[moving], np.ones(int(moving.sum()))))
        values = np.linalg.lstsq(x, force[moving], rcond=None)[0]
        fits.append((float(np.sum((force[moving] - x @ values) ** 2)), e, values[:4]))
    _, e, values = min(fits, key=lambda fit: fit[0])
    return lambda other: terms(other.velocity, other.a, other.b, e) @ values


class Score(NamedTuple):
    """How well the friction of a second recording is predicted."""

    machine: str
    kinds: int
    squares: float  # [-] RMS of least squares over the RMS of the friction
    identify: float  # [-] that of identify; NaN if it was refused
    inside: float  # [-] share of the samples in the 95 % band
    half_width: float  # [-] mean half width of the band over the RMS of identify
    text: str


def score(machine: Machine, kinds: Sequence[str], seed: int, folder: Path) -> Score:
    """Identify with one recording, predict another."""
    first = record(machine, machine.supplies, (0.02, 0.08), (0.0, 0.4), seed)
    others = 0.5 * (np.array(machine.supplies[1:]) + np.array(machine.supplies[:-1]))
    second = record(machine._replace(run_in=0.0), others.tolist(), (0.03, 0.06, 0.12), (0.1, 0.5), seed + 1)
    if machine.run_in:
        worn = 1.0 - 0.5 * machine.run_in
        second = second._replace(friction=second.friction * worn)
    arguments = write_log(first, folder, 'first', seed, machine.noise)
    moving = second.velocity != 0.0
    truth = second.friction[moving]
    size = float(np.sqrt(np.mean(truth**2)))
    squares = least_squares(first, folder / 'first.csv')(second)[moving]
    run = Run(folder, *arguments, *kinds, '--run-to-run', '0')
    if run.code:
        off = float(np.sqrt(np.mean((squares - truth) ** 2))) / size
        return Score(machine.name, len(kinds) // 2, off, np.nan, np.nan, np.nan, run.errors.strip())
    files = tuple(run.figures.get('seal_files', {}).values()) or (str(run.out),)
    selection = SealSelection(files, ('mounting',))
    seals = load_configuration(selection, EstimatorSettings()).parameters().estimator.seals
    rows = np.column_stack((second.a * BAR, second.b * BAR, second.velocity))[moving]
    cells = np.unique(np.round(rows, (3)), axis=0, return_inverse=True)
    found = [actuator_friction(seals, *row) for row in cells[0].tolist()]
    friction = np.sign(rows[:, 2]) * np.array([f.coulomb_friction + f.velocity_friction for f in found])[cells[1]]
    std = np.array([f.coulomb_friction_std for f in found])[cells[1]]
    error = np.abs(friction - truth)
    rms = float(np.sqrt(np.mean(error**2)))
    inside, half = float(np.mean(error <= BAND_95 * std)), BAND_95 * float(np.mean(std))
    squared = float(np.sqrt(np.mean((squares - truth) ** 2)))
    return Score(machine.name, len(kinds) // 2, squared / size, rms / size, inside, half / rms, run.figures['law'])


WAYS = {
    'one': ('--seal-chambers', 'b,difference'),
    'several': ('--seal-kind', 'rod=b', '--seal-kind', 'piston=difference', '--largest-kind-error', '9'),
}


def main() -> int:
    """Print the table."""
    parser = parser_of(__doc__, seed=(1, 'of the simulation'))
    parser.add_argument('--only', default='', help='machines with this in their name')
    parser.add_argument('--way', choices=WAYS, action='append', help='one kind of seals, or several; default: both')
    options, rows, bad = parser.parse_args(), [], 0
    for machine in (m for m in MACHINES if options.only in m.name):
        row: dict[str, float | str] = {'machine': machine.name}
        for way in options.way or WAYS:
            with tempfile.TemporaryDirectory() as folder:
                s = score(machine, WAYS[way], options.seed, Path(folder))
            bad += not (s.identify / s.squares <= MOST and s.inside >= 0.9 and s.half_width <= 3.0)
            row |= {'least squares': 100.0 * s.squares, f'{way}: identify': 100.0 * s.identify}
            row |= {f'{way}: in band': 100.0 * s.inside, f'{way}: half width': s.half_width, f'{way}: law': s.text[:60]}
        rows.append(row)
    tell(rows, as_json=options.json)
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
