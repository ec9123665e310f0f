"""The node of the live view as a process, and a reader in the place of a browser."""

import http.client
import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

from harness.processes import graph_environment


class Reader:
    """Takes the frames of a page in a thread of its own.

    Args:
        url: Of the page.
    """

    def __init__(self, url: str) -> None:
        self.frames, self.rows = 0, 0
        self._parts = urlsplit(url)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        connection = http.client.HTTPConnection(self._parts.netloc, timeout=60.0)
        connection.request('GET', f'/stream?{self._parts.query}')
        answer = connection.getresponse()
        while text := answer.readline():
            if text.startswith(b'data: '):
                self.frames += 1
                self.rows += len(json.loads(text.removeprefix(b'data: '))['rows'])


@contextmanager
def monitor(domain: int) -> Iterator[tuple[int, str]]:
    """Process number and URL of a running monitor, which may change parameters."""
    command = [sys.executable, '-m', 'seal_friction_ros.nodes.friction_monitor', '--allow-changes', '--json']
    process = subprocess.Popen(command, env=graph_environment(domain), stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.pid, json.loads(process.stdout.readline())['url']
    finally:
        process.send_signal(2)
        process.wait()
