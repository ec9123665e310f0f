"""Every thread has the real-time priority, or the error names the remedy."""

import os
import subprocess
import sys

import pytest

from seal_friction_ros.offline.work.computer import realtime_granted

RUN = """
import os, threading, time
from seal_friction_ros.nodes.managed_node import take_realtime_priority
early = threading.Thread(target=time.sleep, args=(5,), daemon=True); early.start()
take_realtime_priority(7)
late = threading.Thread(target=time.sleep, args=(5,), daemon=True); late.start()
threads = [int(name) for name in os.listdir('/proc/self/task')]
print({(os.sched_getscheduler(t), os.sched_getparam(t).sched_priority) for t in threads})
"""
WITHOUT_THE_RIGHT = """
import ctypes, os, resource, sys
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
ctypes.CDLL(None).prctl(24, 23, 0, 0, 0)  # PR_CAPBSET_DROP of CAP_SYS_NICE: the program below is without it
os.execv(sys.executable, [sys.executable, '-c', sys.argv[1]])
"""
REFUSED = """
from seal_friction_ros.nodes.managed_node import take_realtime_priority
from seal_friction_ros.offline.work.computer import realtime_granted
take_realtime_priority(0)
print(realtime_granted(), flush=True)
take_realtime_priority(50)
"""


@pytest.mark.skipif(not realtime_granted(), reason='the system grants this user no real-time priority')
def test_present_and_future_threads_have_the_priority():
    done = subprocess.run([sys.executable, '-c', RUN], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f'{{({os.SCHED_FIFO}, 7)}}'


def test_a_priority_that_the_system_does_not_grant_is_rejected_with_the_remedy():
    done = subprocess.run(
        [sys.executable, '-c', WITHOUT_THE_RIGHT, REFUSED], capture_output=True, text=True, check=False
    )
    assert done.stdout == 'False\n', done.stderr
    error = done.stderr.splitlines()[-1]
    assert error.startswith('ValueError: realtime_priority = 50 is not granted: [Errno 1] Operation not permitted: ')
    assert 'CAP_SYS_NICE' in error
