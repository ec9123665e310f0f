"""Real logs that the law was not fitted to: no worse than least squares, inside the band."""

import pytest
from blind_logs import RINGS, left_out, predicted, slow_and_fast
from harness.identify_run import FRICTION_ID, OTHER, data


@pytest.mark.parametrize(('known', 'new'), [(FRICTION_ID, OTHER), (OTHER, FRICTION_ID)])
def test_a_ram_log_by_the_other_is_no_worse_than_least_squares(known, new, tmp_path):
    row = predicted('ram', [data(f'mbari/{known}')], [data(f'mbari/{new}')], 'mbari', tmp_path)
    assert row['identify [N]'] < row['least squares [N]']


def test_faster_motion_of_a_damper_is_no_worse_than_by_least_squares_and_in_the_band(tmp_path):
    logs = sorted(data('mr_damper').glob('*.csv'))
    slow, fast = zip(*(slow_and_fast(log, tmp_path, 25.0) for log in logs), strict=True)
    rig = str(data('mr_damper/mr.yaml'))
    row = predicted('damper', slow, fast, rig, tmp_path, '--seal-chambers', 'a')
    assert row['identify [N]'] < row['least squares [N]']
    assert row['in band [%]'] >= 90.0


@pytest.mark.parametrize('ring', RINGS)
def test_a_pressure_left_out_is_within_15_percent_and_in_the_band(ring, tmp_path):
    row = left_out(ring, RINGS[ring], tmp_path, data('delft'))
    assert row['worst [%]'] < 15.0
    assert row['in band [%]'] == 100.0
