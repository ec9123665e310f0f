"""Comparison of two bags: first, largest and RMS difference."""

import json
from pathlib import Path

from paths import ROOT

from seal_friction_ros.offline.commands.main import main

PULL_TEST = str(ROOT / 'bags' / 'pull_test')


def test_compare_says_first_largest_and_rms_difference(tmp_path: Path, capsys):
    seal, other = ROOT / 'config' / 'seals' / 'ms28775_114_table.yaml', str(tmp_path / 'other')
    assert main(['replay', PULL_TEST, '--seal', str(seal), '--out', other]) == 0
    capsys.readouterr()
    assert main(['compare', PULL_TEST, other, '--json']) == 1
    found = json.loads(capsys.readouterr().out)
    coulomb = found['fields']['coulomb_friction']
    assert not found['agree']
    assert found['first_difference'].startswith('message 1 at')
    assert 0.0 < coulomb['rms'] <= coulomb['largest'] < 1.0
    assert coulomb['outside'] == found['messages_a'] == 900
    assert found['fields']['stamp']['largest'] == 0.0
