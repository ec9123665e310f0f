# %% [markdown]
"""From a bag to a report, as a notebook: open it with jupytext, or run the cells in an editor that knows `# %%`."""

# %% A bag as columns
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from seal_friction_ros import FrictionState, load_seal, read_bag, report

BAG = Path(__file__).parents[1] / 'bags' / 'pull_test'
run = read_bag(BAG)  # run.to_pandas(), run.to_xarray()
print(run)

# %% Measured and estimated friction over time
figure, (above, below) = plt.subplots(2, layout='constrained')
above.plot(run['time'], run['force_sum'], label='force sum, measured')
above.plot(run['time'], run['friction_force'], label='friction, estimated')
above.set(xlabel='time [s]', ylabel='force [N]')
above.legend()

# %% Friction over pressure, beside the seal file
sliding = (run['state'] == FrictionState.SLIDING) & (run['status'] == 0)
pressure, measured = run['pressure_a'][sliding], np.abs(run['force_sum'][sliding])
below.plot(pressure / 1e5, measured, '.', label='measured')
axis = np.linspace(0.0, pressure.max())
below.plot(axis / 1e5, 2 * load_seal('ms28775_114').friction(axis, 0.05), label='seal file, both seals')
below.set(xlabel='pressure [bar]', ylabel='friction [N]')
below.legend()
residual = measured - np.abs(run['friction_force'][sliding])
assert np.sqrt(np.mean(residual**2)) < 3.0  # [N]

# %% The report: one page with figures, numbers and a verdict
with tempfile.TemporaryDirectory() as folder:
    figure.savefig(Path(folder) / 'my_figure.png')
    numbers = report(BAG, Path(folder) / 'report.html')
print(numbers['level'], numbers['verdict'])
assert numbers['level'] == 'good'
