"""Calls in worker processes: order, errors, crashes, interruption, progress."""

import os
import re
import signal
import subprocess
import sys
import time
from functools import partial

import pytest
from paths import ROOT

from seal_friction_ros.offline.work import executor
from seal_friction_ros.offline.work.executor import results_of, run_all, try_all
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.progress import progress


def square(number: int) -> int:
    time.sleep(0.02 * (number % 3))  # done in another order than begun
    return number**2


def fail(error: Exception) -> None:
    raise error


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize('workers', [1, 2, 7, 20])
def test_results_are_in_the_order_given_whatever_the_number_of_workers(workers):
    calls = [partial(square, number) for number in range(7)]
    assert run_all('squares', calls, workers) == [number**2 for number in range(7)]
    assert try_all('squares', calls, workers) == [Outcome(number**2) for number in range(7)]


def test_no_call_needs_no_process():
    assert run_all('nothing', [], 2) == []


@pytest.mark.parametrize('workers', [1, 2, 4])
def test_a_call_that_fails_or_dies_costs_its_own_result_only(workers, capfd):
    missing = partial(fail, FileNotFoundError(2, 'No such file or directory', 'a.yaml'))
    bug = partial(fail, KeyError('bug'))
    calls = [partial(square, 1), partial(fail, ValueError('no')), missing, die, bug, partial(square, 2)]
    outcomes = try_all('some', calls, workers)
    assert [outcome.result for outcome in outcomes] == [1, None, None, None, None, 4]
    assert [outcome.error for outcome in outcomes[1:3]] == ['no', 'a.yaml: No such file or directory']
    assert all('ended before it was done' in outcome.error for outcome in outcomes[3:5])
    assert "KeyError: 'bug'" in capfd.readouterr().err  # a bug is seen


@pytest.mark.parametrize('workers', [1, 2, 4])
def test_of_calls_for_one_result_the_first_error_counts_and_no_further_call_begins(workers, tmp_path):
    def mark(number: int) -> int:
        (tmp_path / f'{number}').touch()
        if number in (2, 3):
            time.sleep(0.1 if number == 2 else 0.0)
            raise ValueError(f'call {number}')
        return number

    done: list[int] = []
    calls = [partial(mark, number) for number in range(30)]
    outcomes = try_all('marks', calls, workers, lambda number, _: done.append(number), stop_at_error=True)
    with pytest.raises(ValueError, match='call 2'):
        results_of('marks', outcomes)
    assert {0, 1} <= set(done)
    assert len(list(tmp_path.iterdir())) <= 3 + 2 * workers


def test_progress_of_the_workers_adds_up_to_the_number_of_calls(monkeypatch):
    def slow(steps: int) -> int:
        with progress('ignored', steps) as advance:
            for _ in range(steps):
                advance(1)
        return steps

    shares: list[float] = []

    class Bar:
        def __enter__(self):
            return shares.append

        def __exit__(self, *_):
            return None

    monkeypatch.setattr(executor, 'progress', lambda *_: Bar())
    assert run_all('slow', [partial(slow, 1000), partial(slow, 7), partial(slow, 0)], 2) == [1000, 7, 0]
    assert sum(shares) == pytest.approx(3.0)
    assert len(shares) > 50  # the long call reports while it runs


PROGRAM = r"""
import os, sys, time
from seal_friction_ros.offline.work.executor import run_all
def sleep():
    os.write(1, b'%d\n' % os.getpid())
    time.sleep(600.0)
try:
    run_all('sleep', [sleep] * 4, 2)
except KeyboardInterrupt:
    sys.exit(130)
"""


@pytest.mark.parametrize('to_all', [True, False])
def test_an_interrupt_ends_all_processes_without_a_word(to_all):
    """As Ctrl+C in a terminal does (the whole process group), and as ``kill -INT`` of the command does."""
    process = subprocess.Popen(
        [sys.executable, '-c', PROGRAM], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    workers = [int(process.stdout.readline()) for _ in range(2)]
    (os.killpg if to_all else os.kill)(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert errors == ''
    assert not any(is_running(worker) for worker in workers)


def test_workers_end_after_a_parent_that_was_killed():
    busy = PROGRAM.replace('time.sleep(600.0)', """
    from seal_friction_ros.offline.work.progress import progress
    with progress('', 1000) as advance:
        for _ in range(1000):
            time.sleep(0.1)
            advance(1)""")  # fmt: skip
    process = subprocess.Popen([sys.executable, '-c', busy], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    workers = [int(process.stdout.readline()) for _ in range(2)]
    process.kill()
    process.wait()
    process.stdout.close()
    deadline = time.monotonic() + 60.0  # the work takes longer
    while any(is_running(worker) for worker in workers):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def is_running(process: int) -> bool:
    try:
        with open(f'/proc/{process}/stat') as file:  # noqa: PTH123  a file of the kernel
            return re.sub(r'.*\)', '', file.read()).split()[0] != 'Z'
    except OSError:
        return False
