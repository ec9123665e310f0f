"""Entry points of the nodes. A node loads for two seconds: SIGINT ends it until then, without a traceback.

Before, the interpreter itself starts for some 50 ms, in which SIGINT ends it with a traceback of its own.
"""

import signal
from importlib import import_module


def _run(module: str) -> int:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return int(import_module(f'seal_friction_ros.nodes.{module}').main())


def friction_estimator() -> int:
    """Run the estimator."""
    return _run('friction_estimator')


def servo_simulator() -> int:
    """Run the simulator."""
    return _run('servo_simulator')


def bag_player() -> int:
    """Run the player."""
    return _run('bag_player')
