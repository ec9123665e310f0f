"""Entry point of ``seal_friction``: Ctrl-C ends it with 130 and without a traceback also while its modules load.

Before, the interpreter itself starts for some 50 ms, in which SIGINT ends it with a traceback of its own.
"""

import sys

from seal_friction_ros.offline.work.interrupt import take_interrupts


def seal_friction() -> None:
    """Run the command."""
    take_interrupts()
    try:
        from seal_friction_ros.offline.commands.main import run_and_exit

        run_and_exit()
    except KeyboardInterrupt:
        sys.exit(130)
