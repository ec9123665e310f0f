"""The speed of a friction map on measured O-rings, on logs for which nothing was chosen."""

from dataclasses import replace

import pytest
from paths import ROOT
from system.speed_on_logs import left_out, slid_logs

from seal_friction_ros.core.oring_contact.oring_case import OringNumerics
from seal_friction_ros.offline.contact.lubrication_runs import load_case, run_map

SHARED_DATA = ROOT.parent / 'shared' / 'data'


@pytest.mark.long
@pytest.mark.skipif(not SHARED_DATA.is_dir(), reason='the shared data are not beside the project')
def test_no_speed_axis_beats_none_on_every_log_of_an_o_ring(tmp_path):
    """So the seal file of a ring has none. On eight logs that of the film is worse in 56 of 56 pairs, a power in 11."""
    case = load_case('oring_delft')
    coarse = replace(
        case,
        numerics=replace(case.numerics, cells=64),
        oring=replace(case.oring, numerics=OringNumerics(lines=13)),
        map=replace(case.map, velocities=6, pressures=3),
    )
    paths = sorted((SHARED_DATA / 'delft').glob('O-ring257*bar.csv'))
    found = left_out(slid_logs(paths, run_map(coarse, 1), tmp_path))
    assert (found['film'] > found['none']).all()
    assert (found['power'] > found['none']).any()
    assert found['power'].mean() < found['none'].mean()
