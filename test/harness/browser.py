"""A headless Chromium that a test steers by the DevTools protocol over pipes; no other package is needed."""

import base64
import contextlib
import itertools
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_numbers = itertools.count(1)  # of the calls, whatever tab they are for
NAMES = ('chromium', 'chromium-browser', 'google-chrome')
TIMEOUT = 60.0  # [s] ends a test that hangs; no test measures time by it


def chromium() -> str:
    """Path of the browser; empty if it is not installed (Debian: apt-get install chromium)."""
    return next((path for name in NAMES if (path := shutil.which(name))), '')


class Page:
    """One tab.

    Args:
        send: File descriptor to write to.
        receive: File descriptor to read from.
        read: What was read and not taken; all tabs of a browser share it.
    """

    def __init__(self, send: int, receive: int, read: bytearray | None = None) -> None:
        self._send, self._receive = send, receive
        self._read = bytearray() if read is None else read
        self._session = ''
        self.requests: list[str] = []
        """URL of everything that the page asked for"""
        self.complaints: list[str] = []
        """what stands on the console as warning or error, and exceptions"""
        target = self.call('Target.createTarget', url='about:blank')['targetId']
        self._session = self.call('Target.attachToTarget', targetId=target, flatten=True)['sessionId']
        for domain in ('Page', 'Runtime', 'Network', 'Log'):
            self.call(f'{domain}.enable')

    def another(self) -> 'Page':
        """Another tab of the same browser."""
        return Page(self._send, self._receive, self._read)

    def close(self) -> None:
        """Close the tab."""
        self.call('Page.close')

    def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol; its result.

        Raises:
            RuntimeError: The browser refuses, or does not answer.
        """
        number = next(_numbers)
        message: dict[str, Any] = {'id': number, 'method': method, 'params': parameters}
        if self._session:
            message['sessionId'] = self._session
        os.write(self._send, json.dumps(message).encode() + b'\0')
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            answer = self._next(0.2)
            if answer.get('id') == number:
                if 'error' in answer:
                    raise RuntimeError(f'{method}: {answer["error"]}')
                return answer['result']
        raise RuntimeError(f'{method}: no answer')

    def _next(self, wait: float) -> dict[str, Any]:
        """Next message of the browser; empty if none comes within ``wait`` [s]."""
        while b'\0' not in self._read:
            if not select.select([self._receive], [], [], wait)[0]:
                return {}
            self._read += os.read(self._receive, 1 << 16)
        text, _, rest = self._read.partition(b'\0')
        self._read[:] = rest
        message: dict[str, Any] = json.loads(text)
        if message.get('sessionId') == self._session:  # else it is of another tab
            self._note(message.get('method', ''), message.get('params', {}))
        return message

    def _note(self, method: str, given: dict[str, Any]) -> None:
        if method == 'Network.requestWillBeSent':
            self.requests.append(given['request']['url'])
        elif method == 'Runtime.exceptionThrown':
            self.complaints.append(str(given['exceptionDetails'].get('exception', {}).get('description', given)))
        elif method == 'Log.entryAdded' and given['entry']['level'] in ('warning', 'error'):
            self.complaints.append(given['entry']['text'])
        elif method == 'Runtime.consoleAPICalled' and given['type'] in ('warning', 'error'):
            self.complaints.append(str(given['args']))

    def size(self, width: int, height: int) -> None:
        """Set the size of the window [px]."""
        self.call(
            'Emulation.setDeviceMetricsOverride', width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )

    def open(self, url: str) -> None:
        """Go to an address."""
        self.call('Page.navigate', url=url)
        self.wait_for('document.readyState === "complete"')

    def value(self, expression: str) -> Any:
        """Value of an expression of JavaScript, awaited if it is a promise.

        Raises:
            RuntimeError: It throws.
        """
        found = self.call('Runtime.evaluate', expression=expression, returnByValue=True, awaitPromise=True)
        if 'exceptionDetails' in found:
            raise RuntimeError(f'{expression}: {found["exceptionDetails"]}')
        return found['result'].get('value')

    def wait_for(self, expression: str) -> None:
        """Wait until an expression is true.

        Raises:
            AssertionError: It does not become true.
        """
        end = time.monotonic() + TIMEOUT
        while not self.value(f'Boolean({expression})'):
            assert time.monotonic() < end, f'{expression}; page: {self.value("document.body.innerText")}'
            time.sleep(0.05)

    def click(self, selector: str) -> None:
        """Click in the middle of an element, as a mouse does."""
        place = self.value(
            f'(() => {{const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();'
            'return [b.x + b.width / 2, b.y + b.height / 2]})()'
        )
        for kind in ('mousePressed', 'mouseReleased'):
            self.call('Input.dispatchMouseEvent', type=kind, x=place[0], y=place[1], button='left', clickCount=1)

    def screenshot(self, path: Path, *, whole: bool = False) -> Path:
        """Picture of the window, or of the whole page."""
        data = self.call('Page.captureScreenshot', format='png', captureBeyondViewport=whole)['data']
        path.write_bytes(base64.b64decode(data))
        return path

    @property
    def overflow(self) -> int:
        """By how much the page is wider than the window [px]."""
        return int(self.value('document.documentElement.scrollWidth - document.documentElement.clientWidth'))


@contextmanager
def browser(folder: Path) -> Iterator[Page]:
    """A browser with an empty profile in ``folder`` while the block runs."""
    child_reads, send = os.pipe()
    receive, child_writes = os.pipe()
    options = [
        '--headless=new', '--remote-debugging-pipe', '--no-sandbox', '--disable-gpu', '--no-first-run',
        '--disable-background-networking', '--disable-component-update', '--disable-dev-shm-usage',
        f'--user-data-dir={folder / "profile"}',
    ]  # fmt: skip
    shell = f'exec "$@" 3<&{child_reads} 4>&{child_writes}'
    process = subprocess.Popen(
        ['bash', '-c', shell, 'bash', chromium(), *options, 'about:blank'],
        pass_fds=(child_reads, child_writes),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(child_reads)
    os.close(child_writes)
    try:
        yield Page(send, receive)
    finally:
        os.close(send)  # ends the browser
        os.close(receive)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(10.0)
        process.kill()
        process.wait()
