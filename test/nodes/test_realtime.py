"""Every thread has the real-time priority, or the error names the remedy."""

import os
import subprocess
import sys

import pytest

from seal_friction_ros.nodes.managed_node import take_realtime_priority
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


@pytest.mark.skipif(not realtime_granted(), reason='the system grants this user no real-time priority')
def test_present_and_future_threads_have_the_priority():
    done = subprocess.run([sys.executable, '-c', RUN], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f'{{({os.SCHED_FIFO}, 7)}}'


def test_a_priority_that_the_system_does_not_grant_is_rejected_with_the_remedy(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, 'Operation not permitted')

    monkeypatch.setattr(os, 'sched_setscheduler', refuse)
    with pytest.raises(ValueError, match=r'realtime_priority = 50 is not granted: .*CAP_SYS_NICE'):
        take_realtime_priority(50)
    take_realtime_priority(0)
    monkeypatch.setattr(sys, 'executable', '/bin/false')  # as a process that is refused
    assert not realtime_granted()
