"""Real-time priority for a node in a control loop on a shared machine."""

import os
from pathlib import Path


def take_realtime_priority(priority: int) -> None:
    """Schedule every present and future thread of this process with SCHED_FIFO, 1 (lowest) to 99; 0 changes nothing.

    ValueError: the system does not grant the priority.
    """
    if not priority:
        return
    try:
        for thread in Path('/proc/self/task').iterdir():
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, AttributeError) as error:
        hint = f'give the user an rtprio limit of {priority} (/etc/security/limits.conf) or the process CAP_SYS_NICE'
        reason = f'realtime_priority = {priority} is not granted: {error}'
        raise ValueError(f'{reason}: {hint}, or set realtime_priority to 0') from None
