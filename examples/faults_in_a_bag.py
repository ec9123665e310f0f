"""What bad inputs do: pressures that stop, jump or are no numbers set bits of the status, and no answer is ever NaN."""

from pathlib import Path

import numpy as np

from seal_friction_ros import Status, read_bag

run = read_bag(Path(__file__).parents[1] / 'bags' / 'faults')  # sine motion with one fault after another

for bit in Status:
    rows = np.flatnonzero(run['status'] & bit)
    if len(rows):
        print(f'{bit.name:25} {len(rows):4} estimates, the first at {run["time"][rows[0]]:.2f} s')

broken = (run['status'] & (Status.PRESSURE_NOT_FINITE | Status.PRESSURE_OUT_OF_RANGE)) != 0
assert broken.sum() == 4
assert not np.isfinite(run['pressure_a'][broken]).all()
assert np.isfinite(run['friction_force']).all()
# A fault widens the band or stops the estimate; the force that a controller adds fades out.
assert np.isfinite(run['feedforward_force'][np.isfinite(run['reference'])]).mean() > 0.9
