"""Entry points of the nodes. A node loads for two seconds: SIGINT ends it until then, without a traceback.

Before, the interpreter itself starts for some 50 ms, in which SIGINT ends it with a traceback of its own.
"""

import signal
import sys
from functools import partial

from seal_friction_ros.compiled_code import keep_compiled_code
from seal_friction_ros.packages import MissingPackageError, needed


def _run(module: str) -> int:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        return int(needed(f'seal_friction_ros.nodes.{module}').main())
    except MissingPackageError as error:
        print(f'{module}: {error}', file=sys.stderr)
        return 2


friction_estimator = partial(_run, 'friction_estimator')
machine_estimator = partial(_run, 'machine_estimator')
friction_monitor = partial(_run, 'friction_monitor')
bag_player = partial(_run, 'bag_player')


def servo_simulator() -> int:
    """Run the simulator, whose compiled code is kept."""
    keep_compiled_code()
    return _run('servo_simulator')
