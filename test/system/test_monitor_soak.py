"""A short look at the live view of three actuators: frames come, and nothing is left behind."""

import pytest
from harness.commands import run_json


@pytest.mark.long  # `test_soak.py` has that of the estimator
def test_a_short_soak_of_the_live_view_leaves_nothing_behind():
    found = run_json('test/system/monitor_soak.py', '--minutes', '0.03', '--look', '0.3')
    assert found['rows [1/s]'] > 0.0
    assert found['frames [1/s]'] > 0.0
    assert max(value for name, value in found.items() if name.endswith(' more')) <= 0
