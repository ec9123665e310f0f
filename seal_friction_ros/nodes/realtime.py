"""Real-time priority, for a node in a control loop on a machine that has other work."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path


def take_realtime_priority(priority: int) -> None:
    """Put every thread of this process, and those it makes from now on, under SCHED_FIFO.

    Args:
        priority: 1 (lowest) to 99; 0 leaves everything as it is.

    Raises:
        ValueError: The system does not grant it.
    """
    if not priority:
        return
    try:
        for thread in Path('/proc/self/task').iterdir():
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, AttributeError) as error:
        raise ValueError(
            f'realtime_priority = {priority} is not granted: {error}: give the user an rtprio limit of as much '
            '(/etc/security/limits.conf) or the process CAP_SYS_NICE, or set it to 0'
        ) from None


def realtime_granted() -> bool:
    """Whether this user may take a real-time priority, tried by a thread that ends at once."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(_try).result()


def _try() -> bool:
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except (OSError, AttributeError):
        return False
    return True
