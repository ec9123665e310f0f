"""The benches of the live node run, and what they count is counted; how fast it is, they say and no test."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def bench(name: str, *arguments: str) -> dict:
    command = [sys.executable, str(ROOT / 'bench' / f'{name}.py'), *arguments, '--json']
    environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert result.stdout, result.stderr
    return json.loads(result.stdout)


def test_every_round_trip_is_answered_by_every_node_asked():
    found = bench('live', '--seconds', '0.6', '--rates', '200')
    assert len(found['figures']) == 4
    for figures in found['figures'].values():
        assert figures['200']['missed'] == 0
        assert 0.0 < figures['200']['p50 [us]'] <= figures['200']['p99 [us]']
    assert len(found['ratios']) == 3
    woken = found['figures']['estimator']['200']['event thread woken per sample']
    assert woken < 3.0  # what config/fastdds.xml is for; without it four to eight times


def test_the_start_is_timed():
    found = bench('start', '--times', '1')
    assert 0.0 < found['bare interpreter [s]'] < found['estimator, to the first estimate [s]']


def test_a_short_soak_leaves_nothing_behind_and_loses_nothing_unreported():
    found = bench('soak', '--minutes', '0.15')
    assert found['received'] > 1000
    assert found['lost'] <= found['reported missing']
    assert {value for name, value in found.items() if name.endswith(' more')} == {0}
