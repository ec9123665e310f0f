"""Web server of the view, for a browser on this machine or at the other end of an SSH tunnel.

The standard library alone: curves go out as a stream of server-sent events to each browser, changes come in as POST. It
listens on the loopback interface. Every request needs the token of the URL. Its Host has to be this machine: a page
that rebinds its name is refused. Its Origin, where it has one, has to be this page. Anything else is 403.
"""

import hmac
import json
import re
import socket
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Protocol
from urllib.parse import parse_qs, urlsplit

from seal_friction_ros.core.foundation.documents import parse_json
from seal_friction_ros.offline.monitor.off_latch import Answer
from seal_friction_ros.offline.monitor.page import make_page
from seal_friction_ros.offline.monitor.token_file import new_token

ADDRESS = '127.0.0.1'
HOST = re.compile(r'(127\.0\.0\.1|localhost)(:\d{1,5})?', re.ASCII)
"""Names of this machine; the port may be another one, at the near end of a tunnel."""
FRAME_PERIOD = 0.05  # [s] 20 frames a second
MOST_STREAMS = 5  # browser windows at a time; a browser opens no more than six connections to a server
_MOST_BYTES = 4096  # of a request to change something
_TIMEOUT = 10.0  # [s] a browser that takes nothing for so long is left


class View(Protocol):
    """What the server shows: `LiveView` or `RecordedView`."""

    def describe(self) -> dict[str, Any]:
        """What does not change from frame to frame."""

    def view(self, label: str, since: float, until: float | None = None) -> dict[str, Any]:
        """Rows of an actuator and the situation of all."""

    def change(self, label: str, parameter: str, value: float) -> list[Answer]:
        """Set a parameter."""

    def off(self) -> list[Answer]:
        """Switch every feed-forward off, and keep it so."""

    def lift(self) -> list[Answer]:
        """End OFF."""


class RefusalError(Exception):
    """A request that is not answered."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(text)
        self.status = status


class MonitorServer(ThreadingHTTPServer):
    """Serves one view, in threads of its own.

    Args:
        view: What to show.
        port: Port; 0: any free one.
        token: That every request needs; empty: a new one.

    Raises:
        ValueError: The port is in use.
    """

    daemon_threads = True

    def __init__(self, view: View, port: int = 0, token: str = '') -> None:
        self.shown = view
        self.token = token or new_token()
        self.page, self.policy = make_page()
        self.streams = threading.BoundedSemaphore(MOST_STREAMS)
        self.stopping = threading.Event()
        try:
            super().__init__((ADDRESS, port), _Handler)
        except (OSError, OverflowError) as error:
            raise ValueError(f'port {port}: {error}: choose another one with --port, 0 for any') from None
        self._thread = threading.Thread(target=self.serve_forever, kwargs={'poll_interval': 0.2}, daemon=True)

    @property
    def url(self) -> str:
        """Address of the page, with the token."""
        return f'http://{ADDRESS}:{self.server_port}/?token={self.token}'

    def told(self, *, as_json: bool) -> str:
        """What to print: the address, and how to open it from another machine."""
        if as_json:
            return json.dumps({'url': self.url})
        port = self.server_port
        return f'open {self.url}\n(from another machine after: ssh -L {port}:{ADDRESS}:{port} HOST; Ctrl-C ends)'

    def server_bind(self) -> None:
        """Bind without looking up the name of the machine, which may ask a name server."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # while a page of the last start is open
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = ADDRESS, int(self.server_address[1])

    def start(self) -> None:
        """Serve in the background."""
        self._thread.start()

    def stop(self) -> None:
        """End all streams and close."""
        self.stopping.set()
        self.shutdown()
        self.server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Stay silent: a browser that leaves is no error."""


class _Handler(BaseHTTPRequestHandler):
    server: MonitorServer
    protocol_version = 'HTTP/1.1'
    timeout = _TIMEOUT
    server_version, sys_version = 'seal_friction', ''

    def do_GET(self) -> None:
        self._answer({'/': self._page, '/describe': self._describe, '/view': self._view, '/stream': self._stream})

    def do_POST(self) -> None:
        self._answer({'/change': self._change, '/off': self._off, '/lift': self._lift})

    def _answer(self, routes: dict[str, Callable[[dict[str, str]], None]]) -> None:
        parts = urlsplit(self.path)
        try:
            query = {name: values[-1] for name, values in parse_qs(parts.query).items()}
            self._check(query)
            if parts.path not in routes:
                raise RefusalError(HTTPStatus.NOT_FOUND, 'no such page')
            routes[parts.path](query)
        except RefusalError as refusal:
            self.close_connection = True  # what a refused request still sends is not read
            self._send(str(refusal).encode(), 'text/plain; charset=utf-8', refusal.status)

    def _check(self, query: dict[str, str]) -> None:
        """Refuse a request from another page, under another name, or without the token."""
        hosts = self.headers.get_all('Host', [])
        host = hosts[0] if len(hosts) == 1 else ''
        if not HOST.fullmatch(host):
            raise RefusalError(HTTPStatus.FORBIDDEN, 'Host is not this machine')
        origins = self.headers.get_all('Origin', [])
        if any(origin != f'http://{host}' for origin in origins):
            raise RefusalError(HTTPStatus.FORBIDDEN, 'Origin is another page')
        if self.headers.get('Sec-Fetch-Site', 'none') not in ('none', 'same-origin'):
            raise RefusalError(HTTPStatus.FORBIDDEN, 'the request comes from another page')
        if not hmac.compare_digest(query.get('token', '').encode(), self.server.token.encode()):
            raise RefusalError(HTTPStatus.FORBIDDEN, 'wrong token: open the URL that the command printed')

    # --- what can be asked for ---

    def _page(self, _query: dict[str, str]) -> None:
        self._send(self.server.page, 'text/html; charset=utf-8')

    def _describe(self, _query: dict[str, str]) -> None:
        self._send_json(self.server.shown.describe())

    def _view(self, query: dict[str, str]) -> None:
        since, until = _number(query, 'since', -1.0), query.get('until')
        end = None if until is None else _number(query, 'until', 0.0)
        self._send_json(self.server.shown.view(query.get('actuator', ''), since, end))

    def _stream(self, query: dict[str, str]) -> None:
        """Frames until the browser leaves."""
        if not self.server.streams.acquire(blocking=False):
            raise RefusalError(HTTPStatus.SERVICE_UNAVAILABLE, f'{MOST_STREAMS} windows are open: close one')
        try:
            self.close_connection = True
            self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._start('text/event-stream', None)
            self._send_frames(query.get('actuator', ''), _number(query, 'since', -1.0))
        finally:
            self.server.streams.release()

    def _send_frames(self, label: str, since: float) -> None:
        due, told = time.monotonic(), ''
        while not self.server.stopping.is_set():
            frame = self.server.shown.view(label, since)
            if frame['rows']:
                since = frame['rows'][-1][0]
            diagnostics = json.dumps(frame.pop('diagnostics'))
            if diagnostics != told:
                frame['diagnostics'], told = json.loads(diagnostics), diagnostics
            self.wfile.write(b'data: ' + _json(frame) + b'\n\n')
            due = max(due + FRAME_PERIOD, time.monotonic())
            self.server.stopping.wait(due - time.monotonic())

    def _change(self, _query: dict[str, str]) -> None:
        asked = self._body()
        label, parameter, value = (asked.get(name) for name in ('actuator', 'parameter', 'value'))
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e15
        if not (isinstance(label, str) and isinstance(parameter, str) and is_number):
            raise RefusalError(HTTPStatus.BAD_REQUEST, 'give actuator, parameter and a finite value')
        try:
            answers = self.server.shown.change(label, parameter, float(value or 0.0))
        except ValueError as error:
            raise RefusalError(HTTPStatus.BAD_REQUEST, str(error)) from None
        self._send_json([answer._asdict() for answer in answers])

    def _off(self, _query: dict[str, str]) -> None:
        self._body()
        self._send_json([answer._asdict() for answer in self.server.shown.off()])

    def _lift(self, _query: dict[str, str]) -> None:
        self._body()
        self._send_json([answer._asdict() for answer in self.server.shown.lift()])

    # --- HTTP ---

    def _body(self) -> dict[str, Any]:
        """Document of a request, which has to be small and JSON: other pages cannot send that without asking."""
        length = self.headers.get('Content-Length', '')
        if not length.isdecimal() or int(length) > _MOST_BYTES:
            raise RefusalError(HTTPStatus.BAD_REQUEST, 'no length, or too long')
        if self.headers.get_content_type() != 'application/json':
            raise RefusalError(HTTPStatus.BAD_REQUEST, 'not application/json')
        try:
            document = parse_json(self.rfile.read(int(length)), 'request')
        except ValueError as error:
            raise RefusalError(HTTPStatus.BAD_REQUEST, str(error)) from None
        if not isinstance(document, dict):
            raise RefusalError(HTTPStatus.BAD_REQUEST, 'not a JSON object')
        return document

    def _send_json(self, document: Any) -> None:
        self._send(_json(document), 'application/json')

    def _send(self, data: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        self._start(kind, len(data), status)
        self.wfile.write(data)

    def _start(self, kind: str, length: int | None, status: HTTPStatus = HTTPStatus.OK) -> None:
        self.send_response(status)
        self.send_header('Content-Type', kind)
        if length is None:
            self.send_header('Connection', 'close')
        else:
            self.send_header('Content-Length', str(length))
        self.send_header('Cache-Control', 'no-store')
        self.send_header('X-Content-Type-Options', 'nosniff')
        self.send_header('Referrer-Policy', 'no-referrer')
        self.send_header('X-Frame-Options', 'DENY')
        self.send_header('Content-Security-Policy', self.server.policy)
        self.end_headers()

    def log_message(self, *_: Any) -> None:
        """Log nothing: a request has the token in it."""


def _json(document: Any) -> bytes:
    return json.dumps(document, allow_nan=False, separators=(',', ':')).encode()


def _number(query: dict[str, str], name: str, default: float) -> float:
    """A finite number of a query.

    Raises:
        RefusalError: It is none.
    """
    try:
        value = float(query.get(name, default))
    except ValueError:
        value = float('nan')
    if not abs(value) < 1e15:
        raise RefusalError(HTTPStatus.BAD_REQUEST, f'{name} is not a finite number')
    return value
