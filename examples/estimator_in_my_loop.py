"""The estimator in my own control loop, without ROS: a sample in, friction and feed-forward out."""

from pathlib import Path

import numpy as np

from seal_friction_ros import Estimator, FrictionState, read_bag

ROOT = Path(__file__).parents[1]
recorded = read_bag(ROOT / 'bags' / 'pull_test')  # in place of my sensors

estimator = Estimator(['ms28775_114@a', 'ms28775_114@b'], ROOT / 'config' / 'friction_estimator.yaml')
sensors = [recorded[name].tolist() for name in ('time', 'velocity', 'pressure_a', 'pressure_b', 'force_sum')]
friction, good = [], 0
for time, velocity, pressure_a, pressure_b, force_sum in zip(*sensors, strict=True):
    estimate = estimator.step(time, velocity, pressure_a, pressure_b, force_sum, reference_velocity=velocity)
    friction.append(estimate.friction_force)
    if estimate.status == 0 and estimate.state == FrictionState.SLIDING:
        good += 1
    compensation = estimator.feedforward.force  # [N] add it to my command; 0 until feedforward.scale is set
print(f'{len(friction)} samples, {good} of them sliding with status 0; at last {compensation:.1f} N')
assert good > 300

# The live node gave the same numbers for the same samples.
assert np.array_equal(friction, recorded['friction_force'])
# All samples at once, from a dict, a DataFrame or the columns of a bag:
assert np.array_equal(Estimator(configuration=recorded.configuration).over(recorded)['friction_force'], friction)
