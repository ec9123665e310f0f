"""Replay and compare in CI: a recording comes out again to the byte, a new seal file may change only so much."""

import sys
import tempfile
from pathlib import Path

from seal_friction_ros import compare, replay

BAG = Path(__file__).parents[1] / 'bags' / 'pull_test'

# 1. Nothing that changed in software or configuration changes an answer.
same = replay(BAG)
print(same.summary(verified=True))
assert same.identical
assert same.recorded_estimates == 900

# 2. What a new seal file changes: replay with it into a new bag, then compare. CI fails beyond the tolerance.
with tempfile.TemporaryDirectory() as folder:
    replay(BAG, seals='ms28775_114_table', out=Path(folder) / 'new')
    change = compare(BAG, Path(folder) / 'new', tolerances={'friction_force': 5.0, 'state': None})  # [N]
print(change.summary())
largest = change.fields['friction_force'].largest
assert 0.0 < largest < 5.0

# The same in a shell, with exit code 1 for a difference:
#   seal_friction replay bags/pull_test --verify
#   seal_friction replay bags/pull_test --seal my_seal.yaml --out new
#   seal_friction compare bags/pull_test new --fields friction_force=5 state
sys.exit(0 if change.agree else 1)
