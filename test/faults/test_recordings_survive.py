"""Recordings survive what kills the recorder: SIGKILL at any moment, a disk that is full, a disk that stalls."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from benches import ENVIRONMENT, ROOT, bench
from faults import OWN_MOUNTS

from seal_friction_ros.nodes.processes import free_domain, graph_environment, running
from seal_friction_ros.offline.bags.recover import recover
from seal_friction_ros.offline.replay.replay import replay


def test_three_recordings_killed_at_one_kilohertz_are_recovered_and_verify():
    figures = bench('kill_recorder', '--times', '3', '--longest', '2')
    assert figures['bad'] == []
    assert figures['recovered'] == figures['verified byte for byte'] == 3
    assert figures['oldest message lost, before the kill [s]'] < 1.0
    assert figures['messages recovered'] > 3000


def test_a_node_that_is_killed_leaves_a_recording_that_is_recovered_and_verifies(tmp_path: Path):
    domain, log = free_domain(), tmp_path / 'log'
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    player = [sys.executable, '-m', 'seal_friction_ros.nodes.bag_player', str(ROOT / 'bags' / 'pull_test')]
    with (
        running('friction_estimator', domain, recording, log) as node,
        subprocess.Popen([*player, '--rate', '1'], env=graph_environment(domain), stderr=subprocess.DEVNULL) as playing,
    ):
        deadline = time.monotonic() + 30.0
        while not (tmp_path / 'bag').is_dir() or sum(f.stat().st_size for f in (tmp_path / 'bag').iterdir()) < 150_000:
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.05)
        node.send_signal(signal.SIGKILL)
        killed = time.time_ns()
        node.wait()
        playing.kill()
    found = recover(tmp_path / 'bag')
    verdict = replay(Path(found.out))
    assert verdict.identical, verdict.first_difference
    assert verdict.recorded_estimates > 100
    assert (killed - found.last_ns) * 1e-9 < 1.0


RECORD_UNTIL_FULL = """
import json, sys, time
from pathlib import Path
from seal_friction_ros.core.estimation.messages import CONFIGURATION_TYPE, decode_text, encode_text
from seal_friction_ros.offline.bags.recorder import Recorder

recorder = Recorder(Path(sys.argv[1]) / 'bag', split_size=200_000)
number = 0
while not recorder.error:
    recorder.record('/t', CONFIGURATION_TYPE, number, encode_text(str(number)))
    number += 1
    time.sleep(0.00005)
recorder.close()
from seal_friction_ros.offline.bags.bag import bag_topics, read_messages
texts = [decode_text(message.data) for message in read_messages(recorder.path)]
print(json.dumps({
    'error': recorder.error, 'in order': texts == [str(i) for i in range(len(texts))], 'read': len(texts),
    'written': recorder.written, 'dropped': recorder.dropped, 'offered': number,
    'counted': sum(info.message_count for info in bag_topics(recorder.path).values()),
}))
"""


@pytest.mark.parametrize('size', ['100k', '300k', '303k', '712k'])
def test_a_disk_that_is_really_full_leaves_a_valid_bag_and_every_message_is_accounted_for(tmp_path: Path, size: str):
    if subprocess.run([*OWN_MOUNTS, 'true'], check=False, capture_output=True).returncode:
        pytest.skip('needs a user namespace to mount a small disk in')
    mount = f'mount -t tmpfs -o size={size} none "$1" && exec "$2" -c "$3" "$1"'
    command = [*OWN_MOUNTS, 'sh', '-c', mount, 'sh', str(tmp_path), sys.executable, RECORD_UNTIL_FULL]
    result = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert result.stdout, result.stderr
    figures = json.loads(result.stdout)
    assert 'No space left on device' in figures['error']
    assert 'could not be finished' not in figures['error']
    assert figures['in order']
    assert figures['read'] == figures['written'] == figures['counted'] > 0
    assert figures['written'] + figures['dropped'] == figures['offered']
    assert list(tmp_path.iterdir()) == []  # it was on the small disk


def test_a_disk_that_stalls_holds_no_estimate_up_and_nothing_is_lost():
    found = bench('stalled_disk', '--seconds', '3', '--stall', '1.5', '--times', '1')
    quiet, stalled = found['quiet'][0], found['stalled'][0]
    assert stalled['stalls'] == 1
    assert stalled['dropped'] == 0
    assert stalled['written'] == quiet['written'] == 21_001
    assert stalled['largest [ms]'] < 1000.0  # one that waited for the disk would be 1500 ms late
    assert stalled['p50 [ms]'] < 2.0 * quiet['p50 [ms]'] + 0.5
    assert found['p99 ratio'] > 0.0
