"""Commands in the pages of the docs: the blocks of a page in their order, and their run on a graph of its own."""

import re
import shlex
import signal
import subprocess
import time
from pathlib import Path
from typing import NamedTuple

from harness.processes import free_domain, graph_environment

TIMEOUT = 300.0  # [s] ends a command that hangs
PACE = 0.5  # [-] simulated over real time: a busy machine loses no messages


class Block(NamedTuple):
    """A block of a page."""

    language: str
    kind: str  # the word after the language
    text: str


def blocks_of(page: Path) -> list[Block]:
    """Every block with a language, in order."""
    return [Block(*found) for found in re.findall(r'^```(\w+) ?(\w*)\n(.*?)^```', page.read_text(), re.M | re.S)]


class Terminals:
    """Two terminals beside each other: one where the machine runs, one for nodes and commands.

    Machine and nodes follow the clock of the simulation.

    Args:
        folder: Where the commands run.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._environment = folder, graph_environment(free_domain())
        self._machine: subprocess.Popen[bytes] | None = None
        self._pace = PACE
        self.said: list[str] = []
        """what each command printed"""

    def start_machine(self, command: str, pace: float = PACE) -> None:
        """Start the machine in place of the present one, and wait until it moves."""
        self.stop_machine()
        self._pace = pace
        self._machine, log = self._started(f'{command} {_ros_arguments(publish_clock=True, time_factor=pace)}')
        self._wait_for('simulating', log, self._machine)

    def stop_machine(self) -> None:
        """Stop the machine, if it runs."""
        if self._machine is not None:
            _stop(self._machine)
        self._machine = None

    def run_node(self, command: str, seconds: float) -> None:
        """Run a node for some simulated seconds after it has begun to estimate, then end it by SIGINT."""
        node, log = self._started(f'{command} {_ros_arguments(use_sim_time=True)}')
        try:
            self._wait_for('estimating', log, node)
            time.sleep(seconds / self._pace)
        finally:
            _stop(node)
        assert node.returncode == 0, log.read_text()

    def run(self, command: str) -> None:
        """Run a command to its end; exit code 1 means that it found something."""
        result = subprocess.run(
            ['bash', '-c', command], cwd=self._folder, env=self._environment, capture_output=True, text=True,
            timeout=TIMEOUT, check=False,
        )  # fmt: skip
        assert result.returncode in ((0, 1) if ' tune ' in command else (0,)), f'{command}: {result.stderr}'
        self.said.append(result.stdout)

    def _started(self, command: str) -> tuple[subprocess.Popen[bytes], Path]:
        log = self._folder / 'build' / f'{len(list(self._folder.glob("build/*.log")))}.log'
        with log.open('wb') as output:
            words = shlex.split(command)
            process = subprocess.Popen(
                words, cwd=self._folder, env=self._environment, stdout=output, stderr=subprocess.STDOUT
            )
        return process, log

    @staticmethod
    def _wait_for(word: str, log: Path, process: subprocess.Popen[bytes]) -> None:
        end = time.monotonic() + TIMEOUT
        while word not in log.read_text():
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < end, log.read_text()
            time.sleep(0.1)


def _ros_arguments(**values: object) -> str:
    """Parameters at the end of a command with ``--ros-args``."""
    return ' '.join(f'-p {name}:={str(value).lower()}' for name, value in values.items())


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGINT)
    process.wait(TIMEOUT)
