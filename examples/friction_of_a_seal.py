"""Friction of a catalogue seal at a pressure and a speed, over a map of both, and beside its readings."""

import csv
from pathlib import Path

import numpy as np

from seal_friction_ros import load_seal

ROOT = Path(__file__).parents[1]
PSI, LBF = 6894.757, 4.448222  # [Pa], [N]

seal = load_seal('ms28775_114')  # an O-ring on a rod of 5/8 in; `seal_friction seals` lists all
one = seal.friction(35e5, 0.05)
print(f'{one:.1f} N at 35 bar and 50 mm/s, one reading in three is off by more than {seal.friction_std(35e5):.1f} N')
print(f'{seal.breakaway(35e5):.1f} N to leave rest')
assert round(float(one), 1) == 21.4

pressures, velocities = np.linspace(0.0, 69e5, 24)[:, None], np.linspace(-0.2, 0.2, 41)
friction = seal.friction(pressures, velocities)  # [N] shape (24, 41), with the sign of the velocity
assert np.array_equal(friction, -friction[:, ::-1])  # this seal knows no difference between the directions

with (ROOT / 'data' / 'thesis' / 'friction_tests.csv').open() as file:
    rows = [row for row in csv.DictReader(file) if row['kind'] == 'dynamic']
measured = np.array([float(row['friction_lbf']) for row in rows]) * LBF  # of two seals
at = np.array([float(row['pressure_psig']) for row in rows]) * PSI
error = measured / (2 * seal.friction(at, 0.05)) - 1.0
inside = np.abs(measured - 2 * seal.friction(at, 0.05)) < 1.96 * 2 * seal.friction_std(at)
print(f'{len(rows)} readings: RMS error {np.sqrt(np.mean(error**2)):.1%}, {inside.mean():.0%} inside the 95 % band')
assert np.sqrt(np.mean(error**2)) < 0.1
