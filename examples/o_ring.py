"""An O-ring from its drawing: finite elements press the ring into its groove, a shear law gives the friction."""

import tempfile
from pathlib import Path

import numpy as np
import yaml

from seal_friction_ros import load_seal

CASES = Path(__file__).parents[1] / 'config' / 'oring'

# Diameters, groove and hardness as drawn; the shear law of the case is fitted to the readings printed below.
case = yaml.safe_load((CASES / 'ms28775_114_blind.yaml').read_text())
case['pressures'], case['numerics'] = [0.0, 34.5e5, 69e5], {'lines': 9}  # coarse, for seconds
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / 'my_ring.yaml'
    path.write_text(yaml.safe_dump(case))
    ring = load_seal(path)  # solves the contact at each pressure

measured_at, measured = np.array(case['measured']['pressures']), np.array(case['measured']['frictions']) / 2
computed = ring.friction(measured_at, 0.05)
for pressure, friction, reading in zip(measured_at, computed, measured, strict=True):
    print(f'{pressure / 1e5:4.1f} bar: {friction:.1f} N computed, {reading:.1f} N measured')
assert np.abs(computed / measured - 1.0)[1:].max() < 0.15
assert (np.diff(computed) > 0.0).all()
