"""Set-up of all tests: reproducible examples, one thread for linear algebra, compiled code on disk."""

import gc
import signal

import pytest
from harness import compiled_code  # noqa: F401  before anything is compiled
from hypothesis import settings
from paths import ROOT

import seal_friction_ros.offline.commands.main  # noqa: F401  sets the number of threads, before any test loads numpy
from seal_friction_ros.nodes.discovery import set_up_discovery

TESTS = ROOT / 'test'

# Property tests draw the same examples every time.
settings.register_profile('reproducible', derandomize=True, deadline=None, database=None)
settings.load_profile('reproducible')
set_up_discovery()
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background inherits an ignored SIGINT


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that wait for processes run first, beside those that compute: the last files are short."""
    items.sort(key=lambda item: item.path.relative_to(TESTS).parts[0] in ('core', 'offline'))


def pytest_collection_finish() -> None:
    """Modules and collected tests stay until the end: to look through them again takes 0.3 s at each collection."""
    gc.collect()
    gc.freeze()
