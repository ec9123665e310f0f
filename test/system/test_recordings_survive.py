"""Recordings survive SIGKILL at any moment, a disk that is full and a disk that stalls."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from harness.commands import ENVIRONMENT, run_json
from process_faults import OWN_MOUNTS


def test_three_recordings_killed_at_one_kilohertz_are_recovered_and_verify():
    figures = run_json('test/system/kill_recorder.py', '--times', '3', '--longest', '1.5', '--parallel', '3')
    assert figures['bad'] == []
    assert figures['recovered'] == figures['verified byte for byte'] == 3
    assert figures['messages recovered'] > 1000


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


def test_a_disk_that_stalls_loses_no_message():
    found = run_json('test/system/stalled_disk.py', '--seconds', '0.6', '--stall', '0.3', '--times', '1')
    quiet, stalled = found['quiet'][0], found['stalled'][0]
    assert stalled['stalls'] == 1
    assert stalled['dropped'] == 0
    assert stalled['written'] == quiet['written'] == 4_201
    assert found['p99 ratio'] > 0.0
