"""A cylinder with rod seals on chamber a and a piston seal on the difference, simulated apart from the package.

Own friction, own motion; position in encoder counts, noise on pressures and force. A log is a table of text with its
rig file; the velocity comes from the position.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

BAR = 1e5
STEP = 0.01  # [s]
COUNT = 1e-5  # [m]
RIG = """name: two_kinds
source: simulated
frame_id: rod
header: row
start: 1.0
time: {column: 0, unit: s}
chamber_a: {terms: [{column: 2, unit: bar}]}
chamber_b: {terms: [{column: 3, unit: bar}]}
force_sum: {terms: [{column: 4, unit: N}]}
velocity: {terms: [{column: 1, unit: mm}], savitzky_golay: {window: 0.2, order: 2, largest_gap: 0.05}}
load: none
"""


def rod_friction(pressure):
    """Friction of the rod seals [N], pressure of chamber a in Pa."""
    return 22.0 + 0.95 * (pressure / BAR) ** 0.8


def piston_friction(difference):
    """Friction of the piston seal [N]."""
    return 38.0 + 1.7 * (abs(difference) / BAR) ** 0.9


def held(pairs: Sequence[tuple[float, float]], rng: np.random.Generator):
    """Two strokes out and back at 20 and 50 mm/s with each pair of pressures [bar], rests between: v, p_a, p_b."""
    rows = []
    for a, b in pairs:
        for speed in (0.02, 0.05):
            for side in (1.0, -1.0):
                count = int((0.1 + 0.02 * rng.random()) / speed / STEP)
                rows += [(side * speed, a, b)] * count + [(0.0, a, b)] * 30
    velocity, a, b = np.array(rows).T
    return velocity, a * BAR, b * BAR


def swept(seconds: float):
    """Slow sines of speed and of both pressures, with periods that have no common measure: v, p_a, p_b."""
    time = np.arange(0.0, seconds, STEP)
    velocity = 0.04 * np.sin(2 * np.pi * time / 7.3) + 0.015 * np.sin(2 * np.pi * time / 2.9)
    return velocity, (55 + 50 * np.sin(time / 5.1)) * BAR, (50 + 45 * np.sin(time / 3.7 + 1.0)) * BAR


def write_log(
    folder: Path,
    motion: tuple[np.ndarray, np.ndarray, np.ndarray],
    noise: float = 0.02,
    seed: int = 1,
    kinds: Callable = lambda a, b: rod_friction(a) + piston_friction(a - b),
) -> tuple[str, str, str]:
    """Log and rig file: arguments of ``identify``. The noise of the force is a share of the mean friction."""
    rng = np.random.default_rng(seed)
    velocity, a, b = motion
    friction = kinds(a, b) + 150.0 * np.abs(velocity)
    force = np.sign(velocity) * friction + 3.0 + noise * friction.mean() * rng.normal(size=len(a))
    position = np.round((0.2 + np.cumsum(velocity) * STEP) / COUNT) * COUNT
    seen = [p / BAR * (1.0 + 0.003 * rng.normal(size=len(p))) for p in (a, b)]
    columns = np.column_stack((np.arange(len(a)) * STEP, 1e3 * position, *seen, force))
    log, rig = folder / 'cylinder.csv', folder / 'rig.yaml'
    header = 'time_s,position_mm,pa_bar,pb_bar,force_N'
    np.savetxt(log, columns, delimiter=',', header=header, comments='', fmt='%.5f')
    rig.write_text(RIG)
    return str(log), '--rig', str(rig)
