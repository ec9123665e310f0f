"""The estimator in a loop in C: export it, run the C example on a recording, and verify its log to the last bit."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from seal_friction_ros import Estimator
from seal_friction_ros.core.estimation.configuration import parse_snapshot

SEALS = ['ms28775_114@a', 'ms28775_114@b']
BAG = Path(__file__).parents[1] / 'bags' / 'pull_test'

with tempfile.TemporaryDirectory() as name:
    folder = Path(name) / 'friction_c'
    # Libraries, header, examples, and the inputs of the bag as example.csv; `make` there does it again.
    export = [sys.executable, '-m', 'seal_friction_ros', 'export', 'c', *SEALS, '--bag', str(BAG), '--out', str(folder)]
    subprocess.run(export, check=True, capture_output=True)
    run = subprocess.run(['./example_c', 'example.csv'], cwd=folder, check=True, capture_output=True, text=True)
    exported = parse_snapshot((folder / 'configuration.json').read_text()).configuration
    inputs = np.genfromtxt(folder / 'example.csv', delimiter=',', names=True)

log = np.genfromtxt(run.stdout.splitlines(), delimiter=',', names=True)  # what the loop in C wrote
columns = {name: inputs[name] for name in inputs.dtype.names if name != 'stamp'}
replayed = Estimator(configuration=exported).over({'time': inputs['stamp'] * 1e-9, **columns})
same = [name for name in log.dtype.names if name in replayed and np.array_equal(log[name], replayed[name])]
print(f'{len(log)} samples of a loop in C; the same to the last bit in Python: {", ".join(same)}')
assert len(log) > 300
assert same == ['friction_force', 'coulomb_friction', 'coulomb_friction_std', 'state', 'status']
