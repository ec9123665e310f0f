"""Which seal file fits my machine: the same recording through the estimator with several, by what each leaves over."""

from pathlib import Path

import numpy as np

from seal_friction_ros import FrictionState, read_bag

BAG = Path(__file__).parents[1] / 'bags' / 'pull_test'

left = {}
for name in ('ms28775_114', 'ms28775_114_prior_art', 'ms28775_114_fem', 'delft_o_ring'):
    run = read_bag(BAG, seals=[f'{name}@a', f'{name}@b'])  # the estimates are made anew
    sliding = run['state'] == FrictionState.SLIDING
    error = np.abs(run['force_sum'][sliding]) - np.abs(run['friction_force'][sliding])  # steady strokes: no inertia
    left[name] = float(np.sqrt(np.mean(error**2)))
    print(f'{name:22} leaves {left[name]:5.2f} N, machine over file {run["adaptation_scale"][-1]:.2f}')

assert min(left, key=left.get) == 'ms28775_114'  # fitted to these readings; the others were not
assert left['ms28775_114'] < 3.0
assert left['delft_o_ring'] > 2 * left['ms28775_114']  # another ring in another size
