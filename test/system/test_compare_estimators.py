"""No simpler estimator that is tuned on one log of a ram is better on the other."""

import pytest
from compare_estimators import COLUMNS, compared
from paths import ROOT

LOGS = ROOT.parent / 'shared' / 'data' / 'mbari'


@pytest.mark.long
@pytest.mark.skipif(not LOGS.is_dir(), reason='the shared data are not beside the project')
def test_on_ram_logs_recursive_least_squares_is_better_in_no_column(tmp_path):
    for rows in compared(LOGS, tmp_path).values():
        ours, rival = rows['this package'], rows['recursive least squares']
        assert all(ours[column] <= rival[column] for column in COLUMNS)
        assert ours['1 step'] <= 65.0  # [N]
        assert ours['friction'] <= 146.0  # [N]
        assert ours['good'] >= 0.9
        assert 0.9 <= ours['in_band'] <= 0.997
