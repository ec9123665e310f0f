"""The server of the view answers its own page alone, and tells nobody else anything."""

import http.client
import json
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any
from urllib.parse import urlsplit

import pytest
from harness.browser import chromium
from harness.page_in_browser import tab, violations

from seal_friction_ros.core.messages.records import NO_ESTIMATE, Velocity
from seal_friction_ros.offline.monitor.actuator_view import COLUMNS
from seal_friction_ros.offline.monitor.live_view import Answer, LiveView
from seal_friction_ros.offline.monitor.node_view import NodeView
from seal_friction_ros.offline.monitor.page import make_page
from seal_friction_ros.offline.monitor.server import MOST_STREAMS, MonitorServer

SCRIPT = '<script>window.broken = 1</script>'
SCALE = {'actuator': '/one', 'parameter': 'scale'}
REFUSED = (400, 403)  # a Host that is no name of a machine at all is refused before it is compared: 400
TIMEOUT = 30.0  # [s] ends a test that hangs


def view_of(nodes=('/estimator',), change=None) -> LiveView:
    view = LiveView(0, change)
    for name in nodes:
        node = NodeView(name, lambda _: {})
        node.without_configuration()
        node._hold('', Velocity(1, 0.0, SCRIPT.encode()), 1)
        node._hold('', NO_ESTIMATE._replace(stamp=1), 1)
        node.diagnostics['estimate'] = {'level': 0, 'message': SCRIPT, 'values': {}}
        view.add(node)
    view.sample(10_000_000)
    return view


@contextmanager
def served(view=None) -> Iterator[MonitorServer]:
    server = MonitorServer(view or view_of())
    server.start()
    try:
        yield server
    finally:
        server.stop()


def ask(server: MonitorServer, path: str, token: str | None = None, body: Any = None, **headers: str):
    """Status, body and headers of the answer to one request."""
    connection = http.client.HTTPConnection('127.0.0.1', server.server_port, timeout=TIMEOUT)
    given = {name.replace('_', '-'): value for name, value in headers.items()}
    data = None if body is None else json.dumps(body)
    if body is not None:
        given.setdefault('Content-Type', 'application/json')
    mark = '&' if '?' in path else '?'
    wanted = f'{path}{mark}token={server.token if token is None else token}'
    connection.request('GET' if body is None else 'POST', wanted, data, given)
    answer = connection.getresponse()
    is_stream = answer.headers.get('Content-Type') == 'text/event-stream'  # without an end
    found = answer.status, '' if is_stream else answer.read().decode(), answer.headers
    connection.close()
    return found


EVERYTHING = [
    ('/', None), ('/describe', None), ('/view', None), ('/stream', None), ('/off', {}), ('/lift', {}), ('/change', {}),
]  # fmt: skip


@pytest.mark.parametrize(('path', 'body'), EVERYTHING)
@pytest.mark.parametrize('token', ['', 'x', '%C3%A9'])
def test_without_the_token_everything_is_403(path: str, body: Any, token: str):
    with served() as server:
        assert ask(server, path, token=token, body=body)[0] == 403
        almost = server.token[:-1] + ('A' if server.token[-1] != 'A' else 'B')
        assert ask(server, path, token=almost, body=body)[0] == 403


@pytest.mark.parametrize(('path', 'body'), EVERYTHING)
@pytest.mark.parametrize(
    'headers',
    [
        {'Origin': 'http://evil.example'},
        {'Origin': 'null'},
        {'Origin': 'http://127.0.0.1:1'},
        {'Origin': 'https://127.0.0.1'},
        {'Host': 'evil.example'},
        {'Host': ''},
        {'Host': 'evil@127.0.0.1'},
        {'Host': 'evil:x@localhost:80'},
        {'Host': '127.0.0.1:80:80'},
        {'Host': '127.0.0.1:'},
        {'Host': '127.0.0.1:1234567'},
        {'Host': '127.0.0.1/x'},
        {'Host': '127.0.0.1.evil.example'},
        {'Host': 'localhost x'},
        {'Sec_Fetch_Site': 'cross-site'},
        {'Sec_Fetch_Site': 'same-site'},
    ],
    ids=str,
)
def test_another_page_is_refused_even_with_the_token(path: str, body: Any, headers: dict[str, str]):
    switched: list[Any] = []
    with served(view_of(change=lambda wanted: switched.append(wanted) or [])) as server:
        try:
            status = ask(server, path, body=body, **headers)[0]
        except ConnectionError:  # closed before it took the body: what is no request at all gets no answer
            status = REFUSED[0]
        assert status in (REFUSED if 'Host' in headers else (403,))
    assert not switched


def test_its_own_page_is_answered_also_through_a_tunnel_with_another_port():
    with served() as server:
        for host in (f'127.0.0.1:{server.server_port}', 'localhost:9000', '127.0.0.1:9000'):
            assert ask(server, '/', Host=host)[0] == 200
            status, text, _ = ask(server, '/view', Host=host, Origin=f'http://{host}')
            assert status == 200
            assert json.loads(text)['label'] == '/estimator'


def test_two_hosts_are_none():
    with served() as server:
        connection = http.client.HTTPConnection('127.0.0.1', server.server_port, timeout=TIMEOUT)
        connection.putrequest('GET', f'/view?token={server.token}', skip_host=True)
        for host in ('127.0.0.1', 'evil.example'):
            connection.putheader('Host', host)
        connection.endheaders()
        assert connection.getresponse().status in REFUSED
        connection.close()


def test_it_listens_on_the_loopback_interface_alone():
    with served() as server:
        assert server.socket.getsockname()[0] == '127.0.0.1'
        assert urlsplit(server.url).hostname == '127.0.0.1'
        assert len(server.token) >= 32


def test_two_servers_have_two_tokens():
    with served() as one, served() as other:
        assert one.token != other.token
        assert ask(one, '/', token=other.token)[0] == 403


def test_no_value_of_the_machine_is_in_the_page():
    with served() as server:
        _, text, headers = ask(server, '/')
        assert SCRIPT not in text
        assert server.token not in text
        assert '/estimator' not in text
        _, text, headers = ask(server, '/view')
        assert json.loads(text)['now']['frame'] == SCRIPT
        assert headers['Content-Type'] == 'application/json'
        assert headers['X-Content-Type-Options'] == 'nosniff'


def test_the_policy_lets_nothing_run_but_the_scripts_of_the_page():
    page, policy = make_page()
    rules = dict(rule.strip().split(' ', 1) for rule in policy.split(';'))
    assert rules['default-src'] == "'none'"
    assert rules['connect-src'] == "'self'"
    assert len(rules['script-src'].split()) == page.count(b'<script>') == 2
    assert 'unsafe' not in policy
    assert b'{{' not in page.replace(b'${{', b'')
    outside = re.findall(rb'(?:src|href)="([^"]*)"', page)
    assert outside == [b'data:,']  # the icon
    assert b'innerHTML' not in page.rpartition(b'<script>')[2]


def test_a_stream_has_the_rows_since_and_then_each_new_one():
    view = view_of()
    with served(view) as server:
        connection = http.client.HTTPConnection('127.0.0.1', server.server_port, timeout=TIMEOUT)
        connection.request('GET', f'/stream?token={server.token}')
        answer = connection.getresponse()
        assert answer.headers['Content-Type'] == 'text/event-stream'

        def frame() -> dict[str, Any]:
            text = answer.readline()
            answer.readline()
            return json.loads(text.removeprefix(b'data: '))

        first = frame()
        assert [one[0] for one in first['rows']] == [0.01]
        assert len(first['rows'][0]) == len(COLUMNS)
        assert first['diagnostics'][0]['message'] == SCRIPT
        view.sample(20_000_000)
        seen = []
        while not seen:
            found = frame()
            assert 'diagnostics' not in found  # only when they change
            seen = found['rows']
        assert [one[0] for one in seen] == [0.02]
        connection.close()


def test_no_more_windows_than_a_browser_can_serve():
    with served() as server:
        connections = [http.client.HTTPConnection('127.0.0.1', server.server_port) for _ in range(MOST_STREAMS)]
        for connection in connections:
            connection.request('GET', f'/stream?token={server.token}')
            assert connection.getresponse().status == 200
        assert ask(server, '/stream')[0] == 503
        for connection in connections:
            connection.close()


@pytest.mark.parametrize(
    ('body', 'headers'),
    [
        ({}, {}),
        ([], {}),
        ({'actuator': '/estimator', 'parameter': 'scale', 'value': 'x'}, {}),
        ({'actuator': '/estimator', 'parameter': 'scale', 'value': True}, {}),
        ({'actuator': '/estimator', 'parameter': 'scale', 'value': float('nan')}, {}),
        ({'actuator': '/estimator', 'parameter': 'scale', 'value': float('inf')}, {}),
        ({'actuator': '/estimator', 'parameter': 'seals', 'value': 1.0}, {}),
        ({'actuator': '/other', 'parameter': 'scale', 'value': 1.0}, {}),
        ({'actuator': '/estimator', 'parameter': 'scale', 'value': 1.0}, {'Content-Type': 'text/plain'}),
    ],
)
def test_a_change_that_is_none_is_refused(body: Any, headers: dict[str, str]):
    asked: list[Any] = []
    with served(view_of(change=lambda wanted: asked.append(wanted) or [])) as server:
        assert ask(server, '/change', body=body, **{n.replace('-', '_'): v for n, v in headers.items()})[0] == 400
    assert not asked


def test_a_change_that_is_too_large_is_not_taken():
    asked: list[Any] = []
    with served(view_of(change=lambda wanted: asked.append(wanted) or [])) as server, suppress(ConnectionError):
        # It is closed before it took the body: the answer may be lost with it.
        assert ask(server, '/change', body={'actuator': 'x' * 5000, 'parameter': 'scale', 'value': 1.0})[0] == 400
    assert not asked


@pytest.mark.skipif(not chromium(), reason='no Chromium: apt-get install chromium')
def test_the_live_view_is_for_people_without_a_mouse_too_with_off_and_without_a_connection():
    switched = view_of(('/one', '/other'), lambda wanted: [Answer(node == '/one', f'OFF: {node}') for node in wanted])
    with tab(1400) as page:
        with served(switched) as server:
            page.open(server.url)
            page.wait_for('now && tabs.children.length')
            page.value('pressOff()')
            page.wait_for('byId("off-answer").className === "no"')
            assert violations(page) == []
        page.wait_for('isLost()')
        assert violations(page) == []


def test_a_view_that_only_reads_changes_nothing_and_says_so():
    with served() as server:
        assert json.loads(ask(server, '/describe')[1])['can_change'] is False
        status, text, _ = ask(server, '/off', body={})
        (answer,) = json.loads(text)
        assert (status, answer['confirmed']) == (200, False)
        assert '--allow-changes' in answer['text']


def test_off_asks_every_node_at_once_for_scale_0_and_shows_each_answer():
    asked: list[Any] = []

    def change(wanted):
        asked.append(wanted)
        return [Answer(node == '/one', f'{node} said') for node in wanted]

    with served(view_of(('/one', '/two'), change)) as server:
        answers = json.loads(ask(server, '/off', body={})[1])
    assert asked == [{'/one': {'feedforward.scale': 0.0}, '/two': {'feedforward.scale': 0.0}}]
    assert [answer['confirmed'] for answer in answers] == [False, True]  # failures first
    assert answers[0]['text'] == '/two said'
    assert answers[1]['text'].startswith('OFF: confirmed by /one at ')


def test_lift_is_a_request_of_its_own_and_sets_nothing():
    asked: list[Any] = []

    def change(wanted):
        asked.append(wanted)
        return [Answer(True, f'{node} said') for node in wanted]

    with served(view_of(('/one',), change)) as server:
        for _ in range(2):
            assert ask(server, '/off', body={})[0] == 200
            assert json.loads(ask(server, '/view')[1])['off']['presses']
            (refused,) = json.loads(ask(server, '/change', body={**SCALE, 'value': 0.4})[1])
            assert refused == {'confirmed': False, 'text': 'REJECTED: /one is OFF: lift OFF first'}
            ((lifted),) = json.loads(ask(server, '/lift', body={})[1])
            assert lifted['confirmed']
            assert json.loads(ask(server, '/view')[1])['off'] is None
        assert ask(server, '/lift')[0] == 404  # no GET
        assert json.loads(ask(server, '/change', body={**SCALE, 'value': 0.4})[1])[0]['confirmed']
    assert asked == [*[{'/one': {'feedforward.scale': 0.0}}] * 2, {'/one': {'feedforward.scale': 0.4}}]


def test_a_view_that_only_reads_latches_nothing():
    with served() as server:
        assert not json.loads(ask(server, '/off', body={})[1])[0]['confirmed']
        assert json.loads(ask(server, '/view')[1])['off'] is None
        assert not json.loads(ask(server, '/lift', body={})[1])[0]['confirmed']


def test_off_without_an_estimator_is_not_confirmed():
    with served(LiveView(0, lambda _: [])) as server:
        (answer,) = json.loads(ask(server, '/off', body={})[1])
    assert answer == {'confirmed': False, 'text': 'NOT OFF: no estimator is known; one that comes is set to 0'}


def test_an_off_that_is_lost_decides_the_verdict_until_it_is_lifted():
    view = view_of(change=lambda _: [Answer(False, 'NOT OFF: /estimator says no')])
    view.off()
    lost = view.view('', -1.0)['now']
    view.lift()
    lifted = view.view('', -1.0)['now']
    assert (lost['verdict'], lost['reason']) == ('bad', 'NOT OFF: /estimator says no')
    assert 'NOT OFF' not in lifted['reason']


def test_a_change_reaches_the_parameter_of_the_actuator():
    asked: list[Any] = []
    with served(view_of(change=lambda wanted: asked.append(wanted) or [Answer(True, 'yes')])) as server:
        body = {'actuator': '/estimator', 'parameter': 'lead_time', 'value': 0.002}
        assert ask(server, '/change', body=body, Origin=f'http://127.0.0.1:{server.server_port}')[0] == 200
    assert asked == [{'/estimator': {'feedforward.lead_time': 0.002}}]


def test_a_port_is_free_again_at_once_while_a_page_is_open():
    """The page keeps its end of the connection: without SO_REUSEADDR the port is taken for a minute."""
    with served() as server:
        port = server.server_port
        page = socket.create_connection(('127.0.0.1', port), timeout=TIMEOUT)
        page.sendall(f'GET /stream?token={server.token} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n'.encode())
        assert page.recv(15) == b'HTTP/1.1 200 OK'
    again = MonitorServer(view_of(), port)
    assert again.server_port == port
    again.stop()
    page.close()


def test_a_port_in_use_is_one_line():
    with served() as server, pytest.raises(ValueError, match='choose another one with --port'):
        MonitorServer(view_of(), server.server_port)


def test_many_readers_and_a_writer_do_not_disturb_each_other():
    view = view_of()
    with served(view) as server:
        found: list[int] = []

        def read() -> None:
            found.extend(ask(server, '/view')[0] for _ in range(20))

        readers = [threading.Thread(target=read) for _ in range(4)]
        for reader in readers:
            reader.start()
        for number in range(2000):
            view.sample(20_000_000 + number * 10_000_000)
        for reader in readers:
            reader.join()
    assert found == [200] * 80
