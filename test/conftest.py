"""Set-up of all tests: reproducible examples, one thread for linear algebra, compiled code on disk."""

import signal

from harness import compiled_code  # noqa: F401  before anything is compiled
from hypothesis import settings

import seal_friction_ros.offline.commands.main  # noqa: F401  sets the number of threads, before any test loads numpy
from seal_friction_ros.nodes.discovery import set_up_discovery

# Property tests draw the same examples every time.
settings.register_profile('reproducible', derandomize=True, deadline=None, database=None)
settings.load_profile('reproducible')
set_up_discovery()
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background inherits an ignored SIGINT
