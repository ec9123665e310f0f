"""The campaign of wrong inputs holds, in a short form."""

import pytest
from diagnosis_campaign import FAULTS, campaign, of_log, of_machine
from paths import ROOT

from seal_friction_ros.offline.commands.main import main

LOGS = ROOT.parent / 'shared' / 'data'


def test_on_random_machines_each_wrong_input_is_named_within_30_s_and_none_on_clean_ones():
    for row in campaign(1, None, 1):
        assert row['named'] == (0 if row['fault'] == 'clean' else row['runs']), row
        assert row['something_else_named'] == 0, row
        assert row['longest_s'] <= 30.0, row


def test_a_machine_whose_strokes_have_four_samples_at_even_speed_has_its_wrong_input_named():
    assert of_machine('halved force sum', 10)['named'] <= 30.0
    assert of_machine('clean', 10)['others'] == []


@pytest.mark.skipif(not LOGS.is_dir(), reason='the shared data are not beside the project')
@pytest.mark.long  # the random machines below have each fault, too
def test_on_the_second_run_of_a_ring_each_wrong_input_is_named_within_30_s_and_none_without(tmp_path):
    seal, first = tmp_path / 'seal.yaml', sorted((LOGS / 'delft').glob('O-ring257_[0-9]bar.csv'))
    assert main(['identify', *map(str, first), '--rig', 'delft', '--out', str(seal)]) == 0
    for fault in FAULTS:
        found = of_log('delft', LOGS / 'delft' / 'O-ring257_run2_3bar.csv', seal, fault)
        assert found['others'] == []
        assert (found['named'] is None) if fault == 'clean' else found['named'] <= 30.0
