"""Tune the feed-forward on a simulated servo: how much friction to compensate, and what the tracking gains."""

import tempfile
from pathlib import Path

from seal_friction_ros import Estimator, TuningSettings, tune

# A short motion without model errors, for seconds. Without settings: a slower one, with errors up to 30 %, for minutes.
task = TuningSettings(amplitude=5e-4, frequency=25.0, hold_time=0.05, friction_error=0.0, delay_error=0.0)
with tempfile.TemporaryDirectory() as folder:
    out = Path(folder) / 'feedforward.yaml'
    tuned = tune(settings=task, seals='ms28775_114', out=out)
    # The node takes the same file: --params-file feedforward.yaml
    estimator = Estimator('ms28775_114', out)

before, after = tuned.numbers['tracking_rms_without'], tuned.numbers['tracking_rms_with']  # [m]
print(f'tracking error {before * 1e3:.3f} mm without, {after * 1e3:.3f} mm with, scale {tuned.found.feedforward.scale}')
assert after < 0.75 * before
assert tuned.found.better_in_every_case
assert estimator.configuration.feedforward == tuned.found.feedforward

# On a recording of my axis, with reference and force sum: tune('my_bag', settings=RecordedAxisSettings(mass=12.0))
