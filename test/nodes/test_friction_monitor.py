"""The live view, from the graph to what a browser shows, and back to the node."""

import http.client
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from harness.browser import Page, browser, chromium
from harness.compensation import LIVE
from harness.live_graph import Probe
from harness.moving_axis import MovingAxis
from harness.moving_machine import FRICTION, LAG, NAMES, machine
from harness.processes import STOP_TIMEOUT, free_domain, graph_environment, node_process
from harness.spin_nodes import SpunNodes, ros_context
from paths import ROOT
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from seal_friction_msgs.msg import RodVelocity

from seal_friction_ros.core.messages.coder import encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.friction_estimator import FrictionEstimator
from seal_friction_ros.nodes.friction_monitor import FrictionMonitor
from seal_friction_ros.nodes.managed_node import message_class
from seal_friction_ros.offline.monitor.actuator_view import COLUMNS
from seal_friction_ros.offline.monitor.off_latch import ANSWER_TIMEOUT
from seal_friction_ros.offline.monitor.recorded_view import RecordedView

WIDTHS = (1400, 420)  # [px]
LISTENER = 'friction_monitor_listener'
WIDE = (1400, pytest.param(420, marks=pytest.mark.long))  # one test opens the narrow page in the short form
SCRIPT = '<script>window.broken = 1</script><img src=x onerror="window.broken = 1">'
NO_BROWSER = pytest.mark.skipif(not chromium(), reason='chromium is not installed: apt-get install chromium')


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

    def wait_for(self, condition) -> Any:
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


@pytest.fixture(scope='module')
def axis(tmp_path_factory) -> Iterator[int]:
    """Domain of a simulated axis with its estimator."""
    domain, log = free_domain(), tmp_path_factory.mktemp('axis') / 'log'
    simulator = ROOT / 'config' / 'servo_simulator.yaml'
    with (
        node_process('servo_simulator', domain, {'rate': 500.0}, log, parameter_file=simulator),
        node_process('friction_estimator', domain, {**LIVE, 'adaptation.mode': 'observe'}, log),
    ):
        end = time.monotonic() + 2 * STOP_TIMEOUT
        while 'simulating' not in log.read_text():
            assert time.monotonic() < end, log.read_text()
            time.sleep(0.1)
        yield domain


@contextmanager
def shown(url: str, folder: Path, width: int) -> Iterator[Page]:
    with browser(folder) as page:
        page.size(width, 900)
        page.open(url)
        yield page


def check_page(page: Page, port: int) -> None:
    """No part is beyond the window, the console is empty, and nothing was asked of another server."""
    assert page.overflow == 0
    assert page.complaints == []
    assert {urlsplit(url).netloc for url in page.requests if not url.startswith('data:')} == {f'127.0.0.1:{port}'}


@NO_BROWSER
@pytest.mark.parametrize('width', WIDTHS)
def test_the_curves_of_a_running_axis_move_and_off_takes_the_force_out(axis: int, width: int, tmp_path: Path):
    with monitor(axis, '--allow-changes') as running, shown(running.url, tmp_path, width) as page:
        running.wait_for(lambda view: view['label'])
        running.ask('/change', {'actuator': '/friction_estimator', 'parameter': 'scale', 'value': 0.9})
        page.wait_for('columns.feedforward && columns.feedforward.some((force) => force > 20)')
        page.wait_for('columns.estimate.some((force) => force > 20) && columns.estimate.some((force) => force < -20)')
        drawn = page.value('document.querySelector("#plot-friction canvas").toDataURL()')
        page.wait_for(f'document.querySelector("#plot-friction canvas").toDataURL() !== {json.dumps(drawn)}')
        check_page(page, running.port)
        while page.value('byId("off-answer").className') != 'yes':  # a busy node may not answer in time: press again
            page.click('#off')
            page.wait_for('["yes", "no"].includes(byId("off-answer").className)')
        text = page.value('byId("off-answer").textContent')
        assert 'OFF: confirmed by /friction_estimator' in text
        assert 'feedforward.scale = 0' in text
        page.wait_for('byId("feedforward").textContent === "0 N"')
        page.wait_for('columns.feedforward.slice(-50).filter((force) => force !== null).every((force) => force === 0)')
        assert page.value('columns.feedforward.slice(-50).filter((force) => force !== null).length') > 10
        assert 'OFF' in page.value('byId("feedforward-more").textContent')
        check_page(page, running.port)


@NO_BROWSER
def test_a_slider_sets_the_parameter_and_shows_the_answer_of_the_node(axis: int, tmp_path: Path):
    with monitor(axis, '--allow-changes') as running, shown(running.url, tmp_path, 1400) as page:
        page.wait_for('document.getElementById("field-scale")')
        for value, word in (('0.4', 'yes'), ('7', 'no')):
            page.value(f'byId("field-scale").value = "{value}"')
            page.value('byId("field-scale").dispatchEvent(new Event("change"))')
            page.wait_for(f'byId("change-answer").className === "{word}"')
        said = page.value('byId("change-answer").textContent')
        assert said.startswith('REJECTED by /friction_estimator')
        for name in ('field', 'slide'):  # what the node refused jumps back
            assert float(page.value(f'byId("{name}-scale").value')) == 0.4
        assert running.wait_for(lambda view: view['now']['settings']['scale'] == 0.4)


@pytest.mark.long
@NO_BROWSER
def test_a_machine_of_three_shows_each_actuator_and_off_takes_out_all_forces(tmp_path: Path):
    domain, recording = free_domain(), {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    scales = {f'{name}.feedforward.scale': 0.9 for name in NAMES}
    with (
        machine(tmp_path, domain, 200.0, **recording, **scales),
        monitor(domain, '--allow-changes') as running,
        shown(running.url, tmp_path, 1400) as page,
    ):
        running.wait_for(lambda view: len(view['actuators']) == len(NAMES) and view['now']['feedforward'])
        for place, name in enumerate(NAMES):
            page.wait_for(f'byId("tabs").children.length === {len(NAMES)}')
            page.click(f'#tabs button:nth-child({place + 1})')
            page.wait_for(f'label === "{name} (/machine_estimator)" && columns.measured.length > 100')
            sliding = page.value(
                'columns.measured.filter('
                '(force, at) => force !== null && columns.low[at] !== null && Math.abs(columns.estimate[at]) > 0)'
            )
            off = sorted(abs(abs(force) - FRICTION) for force in sliding)  # parts of it are taken a moment apart
            assert off[len(off) // 2] < 0.1 * FRICTION
            errors = page.value('columns.error.filter((value) => value !== null)')
            assert 0.0 < median(map(abs, errors)) < 1.5e6 * LAG * 0.0628  # [um] lag times the largest speed
        while page.value('byId("off-answer").className') != 'yes':
            page.click('#off')
            page.wait_for('["yes", "no"].includes(byId("off-answer").className)')
        answer = page.value('byId("off-answer").textContent')
        assert all(f'{name}.feedforward.scale = 0' in answer for name in NAMES)
        assert running.wait_for(lambda view: all(one['feedforward'] == 0.0 for one in view['actuators']))
        check_page(page, running.port)
    recorded = RecordedView(tmp_path / 'bag')
    frame = recorded.view('', -1.0)
    assert [one['label'] for one in frame['actuators']] == [f'{name} (/machine_estimator)' for name in NAMES]
    assert all(one['feedforward'] == 0.0 for one in frame['actuators'])
    for one in frame['actuators']:
        rows = recorded.view(one['label'], -1.0)['rows']
        measured, low = (COLUMNS.index(name) for name in ('measured', 'low'))
        off = sorted(abs(abs(row[measured]) - FRICTION) for row in rows if None not in (row[low], row[measured]))
        assert off[len(off) // 2] < 0.1 * FRICTION


def test_read_only_is_the_default_and_nothing_changes(axis: int):
    with monitor(axis) as running:
        before = running.wait_for(lambda view: view.get('now', {}).get('feedforward') is not None)['now']['settings']
        (answer,) = running.ask('/off', {})
        assert (answer['confirmed'], '--allow-changes' in answer['text']) == (False, True)
        time.sleep(0.3)
        assert running.ask('/view')['now']['settings'] == before


@contextmanager
def in_process(*nodes: tuple[type, dict[str, Any]]) -> Iterator[tuple[FrictionMonitor, SpunNodes, list[Any]]]:
    """Nodes and a monitor that may change them in this process."""
    with ros_context() as context, ExitStack() as stack:
        made = [kind(context=context, **arguments) for kind, arguments in nodes]
        watching = FrictionMonitor(allow_changes=True, context=context)
        for node in (*made, watching):
            stack.callback(node.destroy_node)
        for node in made:
            if hasattr(node, 'autostart'):
                assert node.autostart()
                stack.callback(node.finish)
        yield watching, SpunNodes(context, *made, watching), made


def overrides(**values: Any) -> list[Parameter]:
    return [Parameter(name, value=value) for name, value in {'stamp_age_max': 0.0, **values}.items()]


def test_the_monitor_publishes_nothing_but_what_every_node_does():
    with in_process() as (watching, spun, _):
        spun.spin(0.1)
        for name in ('friction_monitor', 'friction_monitor_listener'):
            published = {topic for topic, _ in watching.get_publisher_names_and_types_by_node(name, '/')}
            assert published <= {'/parameter_events'}


def test_remapped_topics_in_a_namespace_are_found_by_their_types():
    remapped = ['--ros-args', '-r', '__ns:=/left', '-r', 'rod_velocity:=/piston/speed']
    estimator = FrictionEstimator, {'parameter_overrides': overrides(), 'cli_args': remapped}
    with in_process(estimator, (Probe, {'namespace': '/left'})) as (watching, spun, (_, probe)):
        speed = probe.create_publisher(RodVelocity, '/piston/speed', 10)

        def is_shown() -> bool:
            stamp = time.time_ns()
            probe.send_pressure(stamp, 1e6)
            probe.send_force(stamp, 5.0)
            message = RodVelocity(velocity=0.05)
            message.header.frame_id = SCRIPT
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            speed.publish(message)
            spun.spin(0.02)
            now = watching.view.view('', -1.0).get('now')
            return bool(now) and now['ages'].get('velocity') is not None and now['friction'] != 0.0

        assert spun.spin_until(is_shown)
        view = watching.view.view('', -1.0)
        assert view['label'] == '/left/friction_estimator'
        assert view['now']['frame'] == SCRIPT[:80]
        assert set(view['now']['ages']) >= {'velocity', 'pressures', 'force sum'}


def test_a_configuration_is_read_also_if_the_middleware_announces_no_message():
    with in_process((FrictionEstimator, {'parameter_overrides': overrides()})) as (watching, spun, _):
        spun.spin(0.1)
        watching._search()
        end = time.monotonic() + STOP_TIMEOUT
        while not watching.view.view('', -1.0)['label']:  # nothing is spun: no event reaches the monitor
            nodes = watching.view.view('', -1.0)['nodes']
            assert time.monotonic() < end, nodes
            watching._search()
            watching._on_timer()
            time.sleep(0.05)
        assert watching.view.view('', -1.0)['label'] == '/friction_estimator'


def test_a_node_that_does_not_answer_is_not_confirmed():
    with in_process() as (watching, spun, _):
        asked: list[Any] = []
        thread = threading.Thread(target=lambda: asked.extend(watching._change({'/gone': {'feedforward.scale': 0.0}})))
        thread.start()
        assert spun.spin_until(lambda: asked)
        thread.join()
    (answer,) = asked
    assert not answer.confirmed
    assert answer.text == f'NOT CONFIRMED: no answer from /gone within {ANSWER_TIMEOUT:g} s'


@NO_BROWSER
@pytest.mark.parametrize('width', WIDE)
def test_a_script_in_the_name_of_a_frame_does_not_run(width: int, tmp_path: Path):
    domain = free_domain()
    with (
        node_process('friction_estimator', domain, {'stamp_age_max': 0.0}, tmp_path / 'log'),
        monitor(domain) as running,
        ros_context(domain) as context,
        shown(running.url, tmp_path, width) as page,
    ):
        probe = Probe(context=context)
        spun = SpunNodes(context, probe)

        def has_script() -> bool:
            stamp = time.time_ns()
            probe.send_pressure(stamp, 1e6)
            message = RodVelocity(velocity=0.05)
            message.header.frame_id = SCRIPT
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            probe.velocity.publish(message)
            spun.spin(0.02)
            return page.value('byId("source").textContent').endswith(SCRIPT[:80])

        assert spun.spin_until(has_script)
        assert page.value('window.broken') is None
        assert page.value('document.querySelectorAll("img, #source script").length') == 0
        check_page(page, running.port)
        probe.destroy_node()


@NO_BROWSER
@pytest.mark.parametrize('width', WIDE)
def test_a_bag_is_shown_at_any_moment_and_plays(width: int, tmp_path: Path):
    command = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main', 'monitor', 'bags/faults']
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    url = process.stdout.readline().split()[1]
    try:
        with shown(url, tmp_path, width) as page:
            page.wait_for('columns.estimate && columns.estimate.some((force) => force !== null)')
            first = page.value('about.first')
            assert page.value('Number(byId("time").value)') == pytest.approx(first + 5.0, abs=0.1)
            assert page.value('byId("marks").children.length') > 0
            begin = page.value('about.faults[label][0][0]')
            page.click('#marks button')
            page.wait_for(f'columns.time[0] <= {begin} && {begin} <= columns.time.at(-1)')
            page.wait_for('byId("faults").textContent !== "none" || columns.status.some((bits) => bits)')
            page.value('byId("time").value = 1; byId("time").dispatchEvent(new Event("input"))')
            page.wait_for('Math.abs(columns.time.at(-1) - 1) < 0.02')
            page.click('#play')
            page.wait_for('columns.time.at(-1) > 1.5')
            assert page.value('byId("off").hidden')
            check_page(page, urlsplit(url).port)
    finally:
        process.send_signal(2)
        assert process.wait(STOP_TIMEOUT) == 0
        process.stdout.close()


@NO_BROWSER
def test_the_page_says_when_the_monitor_is_gone_and_that_off_was_not_confirmed(axis: int, tmp_path: Path):
    with browser(tmp_path) as page:
        page.size(1400, 900)
        with monitor(axis, '--allow-changes') as running:
            page.open(running.url)
            page.wait_for('columns.time && columns.time.length > 20')
        page.wait_for('byId("mode").textContent === "NO CONNECTION"')
        page.click('#off')
        page.wait_for('byId("off-answer").className === "no"')
        assert page.value('byId("off-answer").textContent').startswith('NOT CONFIRMED')


# --- OFF stays off ---


def press_off(page: Page) -> None:
    """Press OFF until it is confirmed: a busy node may not answer in time."""
    page.click('#off')
    page.wait_for('byId("off-answer").className === "yes"')


def set_scale(domain: int, node: str, parameter: str, value: float) -> None:
    """Somebody else sets a scale."""
    with ros_context(domain) as context:
        probe = Node('somebody', context=context)
        client = AsyncParameterClient(probe, node)
        spun = SpunNodes(context, probe)
        assert spun.spin_until(client.services_are_ready)
        future = client.set_parameters([Parameter(parameter, value=value)])
        assert spun.spin_until(future.done)
        assert future.result().results[0].successful
        probe.destroy_node()


ESTIMATOR = {'feedforward.scale': 0.9, 'seals': ['ms28775_114@a', 'ms28775_114@b']}


@contextmanager
def estimator(domain: int, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    with node_process('friction_estimator', domain, ESTIMATOR, folder / 'log') as process:
        yield process


@NO_BROWSER
@pytest.mark.parametrize('width', WIDE)
def test_off_stays_off_whoever_sets_a_scale_and_whoever_comes_back_with_one_until_it_is_lifted(
    width: int, tmp_path: Path
):
    domain = free_domain()
    with (
        MovingAxis(domain),
        ExitStack() as nodes,
        monitor(domain, '--allow-changes') as running,
        shown(running.url, tmp_path, width) as page,
    ):
        first = nodes.enter_context(estimator(domain, tmp_path))
        page.wait_for('columns.feedforward && columns.feedforward.some((force) => force > 20)')
        press_off(page)
        assert page.value('byId("off-events").children.length') == 0
        page.wait_for('off.lines[0][1].endsWith("feedforward.scale = 0")')

        set_scale(domain, '/friction_estimator', 'feedforward.scale', 0.5)
        page.wait_for(
            'byId("off-events").textContent.includes("somebody set feedforward.scale of /friction_estimator")'
        )
        page.wait_for('byId("off-events").textContent.includes("to 0.5: set to 0 again after ")')
        page.wait_for('byId("off-answer").className === "yes" && now.settings.scale === 0')

        first.kill()
        first.wait()
        page.wait_for('byId("off-answer").className === "gone"')  # nobody confirms any more
        page.wait_for('now.cause === "node"')
        nodes.enter_context(estimator(domain, tmp_path))
        page.wait_for(
            'byId("off-events").textContent.includes("came back with feedforward.scale = 0.9: set to 0 again")'
        )
        page.wait_for('byId("off-answer").className === "yes" && now.settings.scale === 0')
        page.wait_for('now.cause === "" && columns.feedforward.slice(-100).every((force) => !force)')
        check_page(page, running.port)

        page.open(running.url)  # the latch is of the monitor
        page.wait_for('byId("off-answer").className === "yes" && byId("off-events").children.length === 2')
        page.click('#lift')
        page.wait_for('byId("lift").className === "armed"')
        assert running.ask('/view')['off'] is not None  # one click does nothing
        page.click('#lift')
        page.wait_for('byId("off-state").hidden')
        assert running.ask('/view')['now']['settings']['scale'] == 0.0  # and lifting sets nothing
        set_scale(domain, '/friction_estimator', 'feedforward.scale', 0.3)
        page.wait_for(
            'now.settings.scale === 0.3 && columns.feedforward.slice(-50).some((force) => Math.abs(force) > 5)'
        )
        assert running.ask('/view')['off'] is None


@pytest.mark.long
def test_off_of_a_machine_holds_each_actuator_in_every_window(tmp_path: Path):
    domain = free_domain()
    with machine(tmp_path, domain, 200.0), monitor(domain, '--allow-changes') as running:
        running.wait_for(lambda view: len(view['actuators']) == len(NAMES) and view['now']['feedforward'] is not None)
        for name in NAMES:
            set_scale(domain, '/machine_estimator', f'{name}.feedforward.scale', 0.9)
        running.wait_for(lambda view: view['now']['settings']['scale'] == 0.9)
        running.ask('/off', {})
        off = running.wait_for(lambda view: view['off']['kind'] == 'yes')['off']
        assert [line for _, line in off['lines'] if 'feedforward.scale = 0' in line] == [
            line for _, line in off['lines']
        ]
        assert len(off['lines']) == len(NAMES)
        for name in NAMES[1:]:
            set_scale(domain, '/machine_estimator', f'{name}.feedforward.scale', 0.5)
            view = running.wait_for(lambda view, n=name: n in ''.join(view['off']['events']))
            assert (
                f'somebody set {name}.feedforward.scale of {name} (/machine_estimator) to 0.5'
                in view['off']['events'][0]
            )
            running.wait_for(
                lambda view: view['off']['kind'] == 'yes' and 'being set' not in ''.join(view['off']['events'])
            )
        running.wait_for(lambda view: all(not one['feedforward'] for one in view['actuators']))
        (refused,) = running.ask('/change', {'actuator': view['label'], 'parameter': 'scale', 'value': 0.4})
        assert 'lift OFF first' in refused['text']


@NO_BROWSER
def test_two_windows_show_one_off(axis: int, tmp_path: Path):
    with monitor(axis, '--allow-changes') as running, browser(tmp_path) as page:
        running.wait_for(lambda view: view['label'])
        other = page.another()
        for one in (page, other):
            one.size(1400, 900)
            one.open(running.url)
            one.wait_for('now !== null')
        press_off(page)
        other.wait_for('byId("off-answer").className === "yes" && !byId("lift").hidden')
        other.click('#lift')
        other.click('#lift')
        for one in (page, other):
            one.wait_for('byId("off-state").hidden')


@NO_BROWSER
def test_off_without_a_connection_is_not_confirmed_within_3_s_and_a_late_confirmation_replaces_that(
    axis: int, tmp_path: Path
):
    with monitor(axis, '--allow-changes') as running, shown(running.url, tmp_path, 1400) as page:
        page.wait_for('now !== null')
        running.process.send_signal(signal.SIGSTOP)
        page.wait_for('byId("mode").textContent === "NO CONNECTION"')
        page.value(
            'byId("off").addEventListener("click", () => { window.clickedAt = performance.now(); });'
            'new MutationObserver(() => {'
            '  if (byId("off-answer").className === "no") window.toldAt ||= performance.now();'
            '}).observe(byId("off-answer"), {attributes: true, childList: true})'
        )
        page.click('#off')
        page.wait_for('window.clickedAt && window.toldAt')
        assert 0.0 < page.value('window.toldAt - window.clickedAt') < 3000.0  # [ms]
        assert page.value('byId("off-answer").textContent').startswith('NOT CONFIRMED')
        running.process.send_signal(signal.SIGCONT)
        page.wait_for('byId("off-answer").className === "yes"')
        assert 'OFF: confirmed by /friction_estimator' in page.value('byId("off-answer").textContent')
        assert running.ask('/view')['now']['settings']['scale'] == 0.0


@NO_BROWSER
def test_a_confirmed_off_is_not_known_any_more_when_the_monitor_is_gone(axis: int, tmp_path: Path):
    with browser(tmp_path) as page:
        page.size(1400, 900)
        with monitor(axis, '--allow-changes') as running:
            page.open(running.url)
            page.wait_for('now !== null')
            press_off(page)
        page.wait_for('byId("off-answer").className === "no"')
        assert page.value('byId("off-answer").textContent').startswith('NOT KNOWN: no connection')
        assert page.value('byId("lift").hidden')


# --- dead data ---

TILES = '[...document.querySelectorAll(".tile")].map((tile) => tile.classList.contains("old"))'
INK = """
(plot, begin, end, colour) => {
  const {plot: chart} = charts.find((one) => one.plot.root.parentNode.id === plot), {bbox} = chart;
  const [left, right] = [begin, end].map((time) => Math.round(chart.valToPos(time, 'x', true)));
  const copy = document.createElement('canvas'), drawn = chart.ctx.canvas;
  [copy.width, copy.height] = [drawn.width, drawn.height];
  const ctx = copy.getContext('2d', {willReadFrequently: true});
  ctx.drawImage(drawn, 0, 0);
  const data = ctx.getImageData(left, bbox.top, Math.max(right - left, 1), bbox.height).data;
  const isOf = (at) => colour.every((part, place) => Math.abs(data[at + place] - part) < 40);
  let found = 0;
  for (let at = 0; at < data.length; at += 4) found += isOf(at);
  return found;
}
"""
BLUE, VERMILLION = [0, 114, 178], [213, 94, 0]


def ink(page: Page, plot: str, begin: float, end: float, colour: list[int]) -> int:
    """Number of pixels of a colour between two times of a plot."""
    return page.value(f'({INK})("{plot}", {begin}, {end}, {json.dumps(colour)})')


@NO_BROWSER
@pytest.mark.parametrize('width', WIDE)
def test_curves_stop_where_data_stop_and_tiles_say_how_old_they_are(width: int, tmp_path: Path):
    domain = free_domain()
    with (
        MovingAxis(domain) as drivers,
        ExitStack() as nodes,
        monitor(domain) as running,
        shown(running.url, tmp_path, width) as page,
    ):
        process = nodes.enter_context(estimator(domain, tmp_path))
        page.wait_for('columns.estimate && columns.estimate.filter((force) => force !== null).length > 300')
        assert page.value('byId("mode").textContent') == 'LIVE'
        assert not any(page.value(TILES))

        begin = page.value('columns.time.at(-1)')
        drivers.stop()
        page.wait_for(f'columns.time.at(-1) > {begin} + 0.45')
        end = page.value('columns.time.at(-1)')
        drivers.go_on()
        page.wait_for(f'columns.estimate.at(-1) !== null && columns.time.at(-1) > {end} + 0.5')
        last = page.value(f'columns.time.filter((time, at) => columns.estimate[at] !== null && time < {end}).at(-1)')
        for plot, colour in (('plot-friction', BLUE), ('plot-pressure', BLUE)):
            assert ink(page, plot, last - 0.5, last - 0.05, colour) > 0
            assert ink(page, plot, last + 0.05, end - 0.02, colour) == 0  # no straight line

        drivers.stop()
        page.wait_for('now.cause === "inputs" && now.answer_age > 3.0')
        stopped = page.value('columns.time.filter((time, at) => columns.estimate[at] !== null).at(-1)')
        assert ink(page, 'plot-friction', stopped + 0.05, stopped + 2.5, BLUE) == 0
        assert ink(page, 'plot-feedforward', stopped + 1.0, stopped + 2.5, VERMILLION) == 0  # faded before
        assert all(page.value(TILES))
        assert page.value('byId("mode").textContent') == 'NO INPUTS'
        assert page.value('byId("verdict").className') == 'bad'
        reason = page.value('byId("reason").textContent')
        assert 'no velocity, no pressures' in reason
        assert 'the node is there' in reason
        assert 's old' in page.value('document.querySelector("#friction").closest(".tile").textContent')
        assert page.value('byId("faults").textContent') != 'none'
        check_page(page, running.port)

        drivers.go_on()
        page.wait_for('now.cause === "" && byId("mode").textContent === "LIVE"')
        process.kill()
        process.wait()
        page.wait_for('now.cause === "node"')
        assert page.value('byId("mode").textContent') == 'NODE GONE'
        assert 'the node is gone or stopped' in page.value('byId("reason").textContent')
        assert all(page.value(TILES))

        running.process.send_signal(signal.SIGSTOP)
        page.wait_for('byId("mode").textContent === "NO CONNECTION"')
        assert 'the monitor is gone' in page.value('byId("reason").textContent')
        shown_age = 'parseFloat(document.querySelector("#friction").closest(".tile").querySelector("em").textContent)'
        age = page.value(shown_age)
        page.wait_for(f'{shown_age} > {age} + 0.5')
        running.process.send_signal(signal.SIGCONT)


def test_a_node_that_leaves_is_gone_at_once_and_placeholder_seals_are_not_good(tmp_path: Path):
    domain = free_domain()
    with MovingAxis(domain), monitor(domain) as running:
        with node_process('friction_estimator', domain, {}, tmp_path / 'log'):
            view = running.wait_for(lambda view: view['label'] and not view['now']['cause'])
            assert view['now']['verdict'] != 'good'
        running.wait_for(lambda view: 'it has left the graph' in view['now']['reason'])


# --- what a peer may send ---


def test_no_configuration_of_a_peer_ends_the_view_or_off(tmp_path: Path):
    domain = free_domain()
    bombs = (
        '{"a":' * 100_000,
        '[' * 100_000,
        '{"machine":' + '[' * 100_000,
        '{}',
        '{"version": ' + '9' * 10_000 + '}',
        '',
    )
    with (
        MovingAxis(domain),
        estimator(domain, tmp_path),
        monitor(domain, '--allow-changes') as running,
        ros_context(domain) as context,
    ):
        probe = Node('evil', context=context)
        spun = SpunNodes(context, probe)
        publisher = probe.create_publisher(message_class(CONFIGURATION_TYPE), '/evil/configuration', qos.LATCHED)
        running.wait_for(lambda view: '/evil' in view['nodes'] and view['label'])
        for bomb in bombs:
            publisher.publish(encode_text(bomb))
            spun.spin(0.1)
        said = running.wait_for(lambda view: view['nodes']['/evil'])['nodes']['/evil']
        assert said.startswith('configuration: ')
        assert '\n' not in said
        running.wait_for(lambda view: view['now']['feedforward'])
        running.ask('/off', {})
        view = running.wait_for(lambda view: view['now']['settings']['scale'] == 0.0)
        lines = view['off']['lines']
        assert lines[0] == ['no', f'NOT OFF: /evil: {said}']  # what cannot be read is not known to be off
        assert lines[1][0] == 'yes'
        probe.destroy_node()


# --- start again ---


@NO_BROWSER
@pytest.mark.long
def test_a_monitor_starts_again_on_its_port_and_the_open_page_goes_on_with_the_same_token(axis: int, tmp_path: Path):
    token = tmp_path / 'token'
    with browser(tmp_path) as page:
        page.size(1400, 900)
        with monitor(axis, '--token-file', str(token)) as first:
            page.open(first.url)
            page.wait_for('columns.time && columns.time.length > 20')
            port = str(first.port)
        page.wait_for('byId("mode").textContent === "NO CONNECTION"')
        start = page.value('about.start')
        with monitor(axis, '--port', port, '--token-file', str(token)) as second:
            assert second.url == first.url
            page.wait_for(f'byId("mode").textContent === "LIVE" && about.start !== "{start}"')
            page.wait_for(
                'columns.time.length > 20 && columns.time.every((time, at) => !at || time > columns.time[at - 1])'
            )
        page.wait_for('byId("mode").textContent === "NO CONNECTION"')
        with monitor(axis, '--port', port) as third:
            assert third.port == int(port)
            page.wait_for('byId("verdict-word").textContent === "refused"')
            text = page.value('byId("reason").textContent')
            assert text.startswith('this page is of an earlier monitor: open the new address')
            page.click('#off')
            time.sleep(1.0)  # the words stay: nothing writes over them
            assert page.value('byId("reason").textContent') == text


def test_a_token_that_others_can_read_is_one_line_and_exit_code_2(tmp_path: Path):
    token = tmp_path / 'token'
    token.write_text('a' * 40)
    token.chmod(0o644)
    command = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main', 'monitor', '--token-file', str(token)]
    for more in ([], [str(ROOT / 'bags' / 'faults')]):
        ended = subprocess.run(
            [*command, *more], env=graph_environment(free_domain()), capture_output=True, text=True, check=False
        )
        assert ended.returncode == 2
        assert 'others can read or write it' in ended.stderr
        assert ended.stderr.count('\n') == 1


def test_the_estimator_sends_to_one_slow_reader_alone_and_no_driver_has_one_more(axis: int):
    with monitor(axis) as running, ros_context(axis) as context:
        running.wait_for(lambda view: view.get('now', {}).get('feedforward') is not None)
        probe = Probe(context=context)
        spun = SpunNodes(context, probe)

        def heard() -> dict[str, str]:
            topics = [topic for topic, _ in probe.get_topic_names_and_types()]
            every = ((topic, info) for topic in topics for info in probe.get_subscriptions_info_by_topic(topic))
            return {t: info.qos_profile.reliability.name for t, info in every if info.node_name == LISTENER}

        once = {'/friction_estimator/configuration': 'RELIABLE'}  # read once, when the monitor starts
        assert spun.spin_until(lambda: len(heard()) > len(once))
        assert heard() == {'/friction_estimator/monitor': 'BEST_EFFORT', **once}
        probe.destroy_node()
