"""The node of the live view as a process, a reader in the place of a browser, and its page in one."""

import http.client
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import parse_qs, urlsplit

from paths import ROOT

from harness.browser import Page
from harness.page_in_browser import tab
from harness.processes import STOP_TIMEOUT, graph_environment

SCRIPT = '<script>window.broken = 1</script><img src=x onerror="window.broken = 1">'
"""name of a frame that a page must not run"""


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


class Monitor:
    """The command, running.

    Args:
        url: That it printed.
        process: The process.
    """

    def __init__(self, url: str, process: subprocess.Popen[str]) -> None:
        self.url, self.process = url, process
        parts = urlsplit(url)
        self.port = parts.port
        self.token = parse_qs(parts.query)['token'][0]

    def ask(self, path: str, body: Any = None) -> Any:
        """Answer to a request of the page."""
        connection = http.client.HTTPConnection('127.0.0.1', self.port, timeout=STOP_TIMEOUT)
        headers = {'Content-Type': 'application/json'} if body is not None else {}
        method, data = ('GET', None) if body is None else ('POST', json.dumps(body))
        connection.request(method, f'{path}?token={self.token}', data, headers)
        found = json.loads(connection.getresponse().read())
        connection.close()
        return found

    def wait_for(self, condition: Callable[[Any], object]) -> Any:
        """First view that fulfils a condition."""
        end = time.monotonic() + STOP_TIMEOUT
        while not condition(view := self.ask('/view')):
            assert time.monotonic() < end, view
            time.sleep(0.1)
        return view


@contextmanager
def monitor(domain: int, *options: str) -> Iterator[Monitor]:
    """The command on a domain; SIGINT has to end it with exit code 0."""
    command = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main', 'monitor', *options]
    process = subprocess.Popen(command, env=graph_environment(domain), stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        yield Monitor(process.stdout.readline().split()[1], process)
    finally:
        process.send_signal(signal.SIGCONT)  # a process that a test has stopped does not react to SIGINT
        process.send_signal(2)
        assert process.wait(STOP_TIMEOUT) == 0
        process.stdout.close()


@contextmanager
def shown(url: str, width: int) -> Iterator[Page]:
    with tab(width) as page:
        page.open(url)
        yield page


def check_page(page: Page, port: int) -> None:
    """No part is beyond the window, no text runs, the console is empty, and nothing was asked of another server."""
    assert page.overflow == 0
    assert page.value('window.broken') is None
    assert page.value('document.querySelectorAll("img, #source script").length') == 0
    assert page.complaints == []
    assert {urlsplit(url).netloc for url in page.requests if not url.startswith('data:')} == {f'127.0.0.1:{port}'}


def press_off(page: Page) -> None:
    """Press OFF until it is confirmed: a busy node may not answer in time."""
    page.click('#off')
    page.wait_for('byId("off-answer").className === "yes"')
