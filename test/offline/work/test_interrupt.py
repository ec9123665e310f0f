"""Ctrl-C ends a command with exit code 130 and without a word, whatever runs just then."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from paths import ROOT

TIMEOUT = 120.0  # [s] ends a test that hangs
WHILE_A_RECORD_IS_MADE = """
from typing import NamedTuple
from seal_friction_ros.core.foundation.compiled import compiled
class Inner(NamedTuple):
    value: float
class Outer(NamedTuple):
    inner: Inner
    value: float
@compiled
def make(value):
    return Outer(Inner(value), value)
make(1.0)
sys.setprofile(interrupt)
make(2.0)
"""
WHILE_A_TYPE_IS_ASKED_FOR = """
from seal_friction_ros.core.foundation.compiled import compiled, keep
@compiled
def read(kept):
    return kept.value
kept = keep(1.0)
read(kept)
sys.setprofile(interrupt)
read(kept)
"""
WHERE_AN_EXCEPTION_IS_LOST = """
class Finalized:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
Finalized()
"""
PROGRAM = """
import signal, sys, time
from seal_friction_ros.offline.work.interrupt import take_interrupts
take_interrupts()
def interrupt(frame, event, _):
    if event == 'call' and frame.f_globals.get('__name__') == {module!r}:
        sys.setprofile(None)
        signal.raise_signal(signal.SIGINT)
try:
    {body}
    time.sleep(600.0)
except KeyboardInterrupt:
    sys.exit(130)
"""


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT, check=False)


@pytest.mark.parametrize(
    ('body', 'module'),
    [
        pytest.param(WHILE_A_RECORD_IS_MADE, 'namedtuple_Inner', id='constructor'),
        pytest.param(WHILE_A_RECORD_IS_MADE, 'numba.core.serialize', id='class'),
        pytest.param(WHILE_A_TYPE_IS_ASKED_FOR, 'numba.experimental.structref', id='type'),
        pytest.param(WHERE_AN_EXCEPTION_IS_LOST, '', id='finalizer'),
    ],
)
def test_an_interrupt_where_an_exception_breaks_or_is_lost_comes_a_moment_later(body: str, module: str, tmp_path: Path):
    program = tmp_path / 'program.py'
    program.write_text(PROGRAM.format(module=module, body=body.replace('\n', '\n    ')))
    ended = run(str(program))
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, '', '')


def takes(pid: int, number: signal.Signals) -> bool:
    """Whether a process has a handler of its own for a signal."""
    (caught,) = (line for line in Path(f'/proc/{pid}/status').read_text().splitlines() if line.startswith('SigCgt'))
    return bool(int(caught.split()[1], 16) >> (number - 1) & 1)


@pytest.mark.parametrize('delay', [0.0, 0.1, 0.3, 1.0])  # [s] modules load, the command begins
def test_sigint_ends_a_command_that_starts_with_130(delay: float, tmp_path: Path):
    code = 'from seal_friction_ros.offline.commands.entry_point import seal_friction; seal_friction()'
    command = [sys.executable, '-c', code, 'tune', '--out', str(tmp_path / 'x.yaml')]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not takes(process.pid, signal.SIGALRM):  # the last handler that a command installs
        assert process.poll() is None
        time.sleep(0.001)
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    told, errors = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, told, errors) == (130, '', '')
    assert not any(tmp_path.iterdir())


def test_a_command_in_the_background_of_a_shell_goes_on_ignoring_sigint():
    code = (
        'import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); '
        'from seal_friction_ros.offline.work.interrupt import take_interrupts; take_interrupts(); '
        'signal.raise_signal(signal.SIGINT); print("goes on")'
    )
    ended = run('-c', code)
    assert (ended.returncode, ended.stdout) == (0, 'goes on\n')
