"""A short soak: no leak, and lost samples are reported."""

import pytest
from harness.commands import run_json


@pytest.mark.long
def test_a_short_soak_leaves_nothing_behind_and_loses_nothing_unreported():
    found = run_json('test/system/soak.py', '--minutes', '0.03', '--look', '0.3')
    assert found['received'] > 500
    assert found['lost'] == found['reported missing']
    assert {value for name, value in found.items() if name.endswith(' more')} == {0}
