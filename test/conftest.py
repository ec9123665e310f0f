"""Property tests draw the same examples every time, so a run is reproducible; linear algebra has one thread."""

from hypothesis import settings

import seal_friction_ros.offline.commands.main  # noqa: F401  sets the number of threads, before any test loads numpy
from seal_friction_ros.nodes.discovery import set_up_discovery

settings.register_profile('reproducible', derandomize=True, deadline=None, database=None)
settings.load_profile('reproducible')
set_up_discovery()
