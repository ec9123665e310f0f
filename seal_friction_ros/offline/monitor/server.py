"""Web server of the view, for a browser on this machine or at the other end of an SSH tunnel.

Curves go out as a stream of server-sent events to each browser, changes come in as POST. It listens on the loopback
interface. Every request needs the token of the URL. Its Host has to be this machine: a page that rebinds its name is
refused. Its Origin, where it has one, has to be this page. Anything else is 403.
"""

import asyncio
import hmac
import json
import logging
import re
import socket
import threading
from collections.abc import Awaitable, Callable, Iterable
from contextlib import suppress
from http import HTTPStatus
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.iostream import StreamClosedError
from tornado.web import Application, HTTPError, RequestHandler

from seal_friction_ros.core.foundation.documents import parse_json
from seal_friction_ros.offline.monitor.live_view import LiveView
from seal_friction_ros.offline.monitor.off_latch import Answer
from seal_friction_ros.offline.monitor.page import make_page
from seal_friction_ros.offline.monitor.recorded_view import RecordedView
from seal_friction_ros.offline.monitor.token_file import new_token

ADDRESS = '127.0.0.1'
HOST = re.compile(r'(127\.0\.0\.1|localhost)(:\d{1,5})?', re.ASCII)
"""Names of this machine; the port may be another one, at the near end of a tunnel."""
FRAME_PERIOD = 0.05  # [s] 20 frames a second
MOST_STREAMS = 5  # browser windows at a time; a browser opens no more than six connections to a server
_MOST_BYTES = 4096  # of a request to change something
_TIMEOUT = 10.0  # [s] a browser that takes or sends nothing for so long is left


class RefusalError(HTTPError):
    """A request that is not answered."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(status)
        self.text = text


class MonitorServer:
    """Serves one view, at any free port if ``port`` is 0; every request needs the ``token``, a new one if it is empty.

    ``work`` is done step by step while nothing is asked for. ValueError: the port is in use.
    """

    def __init__(
        self, view: LiveView | RecordedView, port: int = 0, token: str = '', work: Iterable[None] = ()
    ) -> None:
        self.shown, self._work = view, work
        self.token = token or new_token()
        self.page, self.policy = make_page()
        self.streams = 0
        try:
            self.socket = socket.create_server((ADDRESS, port))  # with SO_REUSEADDR
        except (OSError, OverflowError) as error:
            raise ValueError(f'port {port}: {error}: choose another one with --port, 0 for any') from None
        self.socket.setblocking(False)
        self.server_port = int(self.socket.getsockname()[1])
        self._stopping = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._is_ready = threading.Event()
        self._thread = threading.Thread(target=self.serve, daemon=True)

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

    def serve(self) -> None:
        """Serve until `stop`, or until SIGINT in the main thread."""
        logging.getLogger('tornado').setLevel(logging.CRITICAL + 1)  # a request has the token in it
        with suppress(KeyboardInterrupt):
            asyncio.run(self._serve())

    async def _serve(self) -> None:
        application = Application([('.*', _Handler, {'server': self})])
        times = {'idle_connection_timeout': _TIMEOUT, 'body_timeout': _TIMEOUT}
        server = HTTPServer(application, max_body_size=_MOST_BYTES, **times)
        server.add_sockets([self.socket])
        self._loop = asyncio.get_running_loop()
        self._is_ready.set()
        working = asyncio.create_task(self._do_work())
        try:
            await self._stopping.wait()
        finally:
            working.cancel()
            server.stop()
            await server.close_all_connections()

    async def _do_work(self) -> None:
        for _ in self._work:
            await asyncio.sleep(0)

    def start(self) -> None:
        """Serve in the background."""
        self._thread.start()
        self._is_ready.wait()

    def stop(self) -> None:
        """End all streams and close."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._stopping.set)
            self._thread.join()
        self.socket.close()


class _Handler(RequestHandler):
    """Answers one request, after `prepare` has let it in."""

    def initialize(self, server: MonitorServer) -> None:
        """Take the server, as tornado hands it to each request."""
        self.server = server
        self.set_header('Content-Security-Policy', server.policy)

    def set_default_headers(self) -> None:
        """What every answer has: nothing is kept, framed, guessed or told to other pages."""
        self.set_header('Server', 'seal_friction')
        self.set_header('Cache-Control', 'no-store')
        self.set_header('X-Content-Type-Options', 'nosniff')
        self.set_header('Referrer-Policy', 'no-referrer')
        self.set_header('X-Frame-Options', 'DENY')

    def compute_etag(self) -> None:
        """Nothing is kept by the browser."""

    def prepare(self) -> None:
        """Refuse a request from another page, under another name, or without the token."""
        headers = self.request.headers
        hosts, origins = headers.get_list('Host'), headers.get_list('Origin')
        if len(hosts) != 1 or not HOST.fullmatch(hosts[0]):
            raise RefusalError(HTTPStatus.FORBIDDEN, 'Host is not this machine')
        if any(origin != f'http://{hosts[0]}' for origin in origins):
            raise RefusalError(HTTPStatus.FORBIDDEN, 'Origin is another page')
        if headers.get('Sec-Fetch-Site', 'none') not in ('none', 'same-origin'):
            raise RefusalError(HTTPStatus.FORBIDDEN, 'the request comes from another page')
        if not hmac.compare_digest(self.get_query_argument('token', '').encode(), self.server.token.encode()):
            raise RefusalError(HTTPStatus.FORBIDDEN, 'wrong token: open the URL that the command printed')

    async def get(self) -> None:
        """A page, a document, or the stream."""
        await self._answer({'/': self._page, '/describe': self._describe, '/view': self._view, '/stream': self._stream})

    async def post(self) -> None:
        """A change."""
        shown = self.server.shown
        if isinstance(shown, RecordedView):
            raise RefusalError(HTTPStatus.BAD_REQUEST, 'this is a recording: nothing is changed')
        acts = {'/off': lambda: self._act(shown.off), '/lift': lambda: self._act(shown.lift)}
        await self._answer({'/change': lambda: self._change(shown), **acts})

    async def _answer(self, routes: dict[str, Callable[[], Awaitable[None]]]) -> None:
        if self.request.path not in routes:
            raise RefusalError(HTTPStatus.NOT_FOUND, 'no such page')
        await routes[self.request.path]()

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """Say why a request is refused."""
        self.set_header('Content-Type', 'text/plain; charset=utf-8')
        self.set_header('Connection', 'close')
        self.finish(getattr(kwargs['exc_info'][1], 'text', HTTPStatus(status_code).phrase))

    # --- what can be asked for ---

    async def _page(self) -> None:
        self.finish(self.server.page)

    async def _describe(self) -> None:
        self._send(self.server.shown.describe())

    async def _view(self) -> None:
        until = None if self.get_query_argument('until', None) is None else self._number('until', 0.0)
        self._send(self.server.shown.view(self.get_query_argument('actuator', ''), self._number('since', -1.0), until))

    async def _stream(self) -> None:
        """Frames until the browser leaves."""
        if self.server.streams >= MOST_STREAMS:
            raise RefusalError(HTTPStatus.SERVICE_UNAVAILABLE, f'{MOST_STREAMS} windows are open: close one')
        self.server.streams += 1
        self.set_header('Content-Type', 'text/event-stream')
        try:
            await self._send_frames(self.get_query_argument('actuator', ''), self._number('since', -1.0))
        except (StreamClosedError, TimeoutError):
            self.detach().close()
        finally:
            self.server.streams -= 1

    async def _send_frames(self, label: str, since: float) -> None:
        loop, told = asyncio.get_running_loop(), ''
        due = loop.time()
        while True:
            frame = self.server.shown.view(label, since)
            if frame['rows']:
                since = frame['rows'][-1][0]
            diagnostics = json.dumps(frame.pop('diagnostics'))
            if diagnostics != told:
                frame['diagnostics'], told = json.loads(diagnostics), diagnostics
            self.write(b'data: ' + _json(frame) + b'\n\n')
            await asyncio.wait_for(self.flush(), _TIMEOUT)
            due = max(due + FRAME_PERIOD, loop.time() - FRAME_PERIOD)  # up to one frame is made up for
            await asyncio.sleep(due - loop.time())

    async def _change(self, shown: LiveView) -> None:
        asked = self._body()
        label, parameter, value = (asked.get(name) for name in ('actuator', 'parameter', 'value'))
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e15
        if not (isinstance(label, str) and isinstance(parameter, str) and is_number):
            raise RefusalError(HTTPStatus.BAD_REQUEST, 'give actuator, parameter and a finite value')
        try:
            await self._act(lambda: shown.change(label, parameter, float(value or 0.0)))
        except ValueError as error:
            raise RefusalError(HTTPStatus.BAD_REQUEST, str(error)) from None

    async def _act(self, act: Callable[[], list[Answer]]) -> None:
        """Send the answers of nodes, which are waited for in a thread of its own."""
        self._body()
        self._send([answer._asdict() for answer in await asyncio.to_thread(act)])

    # --- documents ---

    def _body(self) -> dict[str, Any]:
        """Document of a request, which has to be JSON: other pages cannot send that without asking."""
        if self.request.headers.get('Content-Type', '').partition(';')[0].strip() != 'application/json':
            raise RefusalError(HTTPStatus.BAD_REQUEST, 'not application/json')
        try:
            document = parse_json(self.request.body, 'request')
        except ValueError as error:
            raise RefusalError(HTTPStatus.BAD_REQUEST, str(error)) from None
        if not isinstance(document, dict):
            raise RefusalError(HTTPStatus.BAD_REQUEST, 'not a JSON object')
        return document

    def _send(self, document: Any) -> None:
        self.set_header('Content-Type', 'application/json')
        self.finish(_json(document))

    def _number(self, name: str, default: float) -> float:
        """A finite number of the query; RefusalError if it is none."""
        with suppress(ValueError):
            value = float(self.get_query_argument(name, str(default)))
            if abs(value) < 1e15:
                return value
        raise RefusalError(HTTPStatus.BAD_REQUEST, f'{name} is not a finite number')


def _json(document: Any) -> bytes:
    return json.dumps(document, allow_nan=False, separators=(',', ':')).encode()
