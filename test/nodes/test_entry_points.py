"""SIGINT ends a node without a traceback at any moment of its start."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from harness.processes import STOP_TIMEOUT, free_domain, graph_environment


def has_default_action(pid: int, number: signal.Signals) -> bool:
    """Whether a process lets the system handle a signal, which the interpreter itself does not with SIGINT."""
    (caught,) = (line for line in Path(f'/proc/{pid}/status').read_text().splitlines() if line.startswith('SigCgt'))
    return not int(caught.split()[1], 16) >> (number - 1) & 1


@pytest.mark.parametrize('node', ['friction_estimator', 'servo_simulator', 'friction_monitor'])
@pytest.mark.parametrize('delay', [0.0, 0.2, 0.5, 1.0, pytest.param(2.0, marks=pytest.mark.long)])  # [s]
def test_sigint_ends_a_node_that_starts_without_a_traceback(node: str, delay: float):
    code = f'from seal_friction_ros.nodes.entry_points import {node}; print(flush=True); {node}()'
    process = subprocess.Popen(
        [sys.executable, '-c', code],
        env=graph_environment(free_domain()),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    process.stdout.readline()  # the interpreter has started
    while process.poll() is None and not has_default_action(process.pid, signal.SIGINT):
        time.sleep(0.001)
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=STOP_TIMEOUT)
    assert process.returncode in (0, -signal.SIGINT), errors
    assert 'Traceback' not in errors
