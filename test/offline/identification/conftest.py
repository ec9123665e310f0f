"""Identifications that several files of tests look at."""

import pytest
from harness.identify_run import FRICTION_ID, Run, data


@pytest.fixture(scope='session')
def friction_id(tmp_path_factory) -> Run:
    return Run(tmp_path_factory.mktemp('friction_id'), str(data(f'mbari/{FRICTION_ID}')))
