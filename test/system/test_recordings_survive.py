"""Recordings survive SIGKILL at any moment, a disk that is full and a disk that stalls."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

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
from typing import Any
from seal_friction_ros.core.messages.coder import decode_text, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
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


RECORD_AGAIN = """
import json, shutil, sys, time
from pathlib import Path
from typing import Any
from seal_friction_ros.core.messages.coder import decode_text, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
from seal_friction_ros.offline.bags import recorder as module
from seal_friction_ros.offline.bags.bag import read_messages

def wait_until(condition):
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)

module.RESUME_PERIOD = 0.01
disk, floor = Path(sys.argv[1]), int(sys.argv[2])
ballast = disk / 'ballast'
ballast.write_bytes(bytes(4_000_000))
recorder = module.Recorder(disk / 'bag', split_size=1_000_000, free_space=floor)
number = 0

def record():
    global number
    recorder.record('/t', CONFIGURATION_TYPE, number, encode_text(str(number) + ' ' * 1000))
    number += 1
    time.sleep(0.00005)

while not recorder.error:
    record()
free, accounted = shutil.disk_usage(disk).free, recorder.written + recorder.dropped
first = {'error': recorder.error, 'free': free, 'accounted': accounted}
offered = number
time.sleep(0.05)
is_early = recorder.is_next_due
ballast.unlink()
wait_until(lambda: recorder.is_next_due)
following, begun = recorder.begin_next(), number
for _ in range(500):
    record()
recorder.close()
texts = [[decode_text(m.data).strip() for m in read_messages(bag)] for bag in (disk / 'bag', following)]
print(json.dumps({
    **first, 'offered': offered, 'early': is_early, 'read': len(texts[0]), 'final error': recorder.error,
    'first in order': texts[0] == [str(i) for i in range(len(texts[0]))],
    'second complete': texts[1] == [str(i) for i in range(begun, number)],
}))
"""


def on_a_small_disk(folder: Path, size: str, script: str, *arguments: str) -> dict[str, Any]:
    """What a script prints as JSON; it gets the folder, with a disk of that size in it, and ``arguments``."""
    if subprocess.run([*OWN_MOUNTS, 'true'], check=False, capture_output=True).returncode:
        pytest.skip('needs a user namespace to mount a small disk in')
    mount = f'mount -t tmpfs -o size={size} none "$1" && exec "$0" -c "$2" "$1" "${{@:3}}"'
    command = [*OWN_MOUNTS, 'bash', '-c', mount, sys.executable, str(folder), script, *arguments]
    result = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert result.stdout, result.stderr
    assert list(folder.iterdir()) == []  # it was on the small disk
    return json.loads(result.stdout)


@pytest.mark.parametrize('floor', [0, 2_000_000])
def test_recording_stops_before_or_when_a_real_disk_is_full_and_continues_once_there_is_room(
    tmp_path: Path, floor: int
):
    found = on_a_small_disk(tmp_path, '8m', RECORD_AGAIN, str(floor))
    assert ('record_free_space' if floor else 'No space left on device') in found['error']
    assert 'could not be finished' not in found['error']
    assert floor <= found['free'] < floor + 700_000
    assert found['first in order']
    assert found['read'] > 1000
    assert found['accounted'] == found['offered']
    assert not found['early']
    assert found['second complete']
    assert found['final error'] == ''


@pytest.mark.parametrize('size', ['100k', '300k', '303k', '712k'])
def test_a_disk_that_is_really_full_leaves_a_valid_bag_and_every_message_is_accounted_for(tmp_path: Path, size: str):
    figures = on_a_small_disk(tmp_path, size, RECORD_UNTIL_FULL)
    assert 'No space left on device' in figures['error']
    assert 'could not be finished' not in figures['error']
    assert figures['in order']
    assert figures['read'] == figures['written'] == figures['counted'] > 0
    assert figures['written'] + figures['dropped'] == figures['offered']


def test_a_disk_that_stalls_loses_no_message():
    found = run_json('test/system/stalled_disk.py', '--seconds', '0.6', '--stall', '0.3', '--times', '1')
    quiet, stalled = found['quiet'][0], found['stalled'][0]
    assert stalled['stalls'] == 1
    assert stalled['dropped'] == 0
    assert stalled['written'] == quiet['written'] == 7 * 600
    assert found['p99 ratio'] > 0.0
