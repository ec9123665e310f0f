"""Runs of ``identify`` that several tests read."""

from collections.abc import Callable
from functools import cache

import pytest
from harness.identify_run import Run


@pytest.fixture(scope='session')
def run_of(tmp_path_factory) -> Callable[..., Run]:
    """The run with these arguments, made once: for sources that no test changes, and tests that change no result."""
    return cache(lambda *arguments: Run(tmp_path_factory.mktemp('identify'), *arguments))
