"""The live view, from the graph to what a browser shows, and back to the node."""

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
from urllib.parse import urlsplit

import pytest
from harness.browser import chromium
from harness.example_bags import read_whole
from harness.live_graph import Probe
from harness.monitor_process import SCRIPT, Monitor, check_page, monitor, press_off, shown
from harness.moving_axis import MovingAxis, compensated
from harness.moving_machine import FRICTION, LAG, NAMES, machine
from harness.page_in_browser import tab
from harness.processes import STOP_TIMEOUT, free_domain, graph_environment
from harness.spin_nodes import SpunNodes, ros_context
from paths import ROOT
from rclpy.parameter import Parameter
from seal_friction_msgs.msg import RodVelocity

from seal_friction_ros.nodes.friction_estimator import FrictionEstimator
from seal_friction_ros.nodes.friction_monitor import FrictionMonitor
from seal_friction_ros.offline.monitor.actuator_view import COLUMNS
from seal_friction_ros.offline.monitor.off_latch import ANSWER_TIMEOUT
from seal_friction_ros.offline.monitor.recorded_view import RecordedView

WIDTHS = (1400, 420)  # [px]
LISTENER = 'friction_monitor_listener'
WIDE = (1400, pytest.param(420, marks=pytest.mark.long))  # one test opens the narrow page in the short form
NO_BROWSER = pytest.mark.skipif(not chromium(), reason='chromium is not installed: apt-get install chromium')


@pytest.fixture(scope='module')
def axis(tmp_path_factory) -> Iterator[int]:
    """Domain of a moving axis with its estimator."""
    domain = free_domain()
    with MovingAxis(domain), compensated(domain, tmp_path_factory.mktemp('axis') / 'log'):
        yield domain


@pytest.fixture(scope='module')
def axis_monitor(axis: int) -> Iterator[Monitor]:
    """The view of the axis, which may change it."""
    with monitor(axis, '--allow-changes') as running:
        yield running


@pytest.fixture
def changing(axis_monitor: Monitor) -> Iterator[Monitor]:
    """The view of the axis, without OFF before and after."""
    axis_monitor.wait_for(lambda view: view.get('now', {}).get('feedforward') is not None)
    yield axis_monitor
    axis_monitor.ask('/lift', {})
    axis_monitor.wait_for(lambda view: view['off'] is None)


@NO_BROWSER
@pytest.mark.parametrize('width', WIDTHS)
def test_the_curves_of_a_running_axis_move_and_off_takes_the_force_out(changing: Monitor, width: int):
    with shown(changing.url, width) as page:
        changing.ask('/change', {'actuator': '/friction_estimator', 'parameter': 'scale', 'value': 0.9})
        page.wait_for('columns.feedforward && columns.feedforward.some((force) => force > 20)')
        page.wait_for('columns.estimate.some((force) => force > 20) && columns.estimate.some((force) => force < -20)')
        drawn = page.value('document.querySelector("#plot-friction canvas").toDataURL()')
        page.wait_for(f'document.querySelector("#plot-friction canvas").toDataURL() !== {json.dumps(drawn)}')
        check_page(page, changing.port)
        while page.value('byId("off-answer").className') != 'yes':  # a busy node may not answer in time: press again
            page.click('#off')
            page.wait_for('["yes", "no"].includes(byId("off-answer").className)')
        text = page.value('byId("off-answer").textContent')
        assert 'OFF: confirmed by /friction_estimator' in text
        assert 'feedforward.scale = 0' in text
        page.wait_for('byId("feedforward").textContent === "0 N"')
        page.wait_for(
            '((forces) => forces.length > 25 && forces.every((force) => force === 0))'
            '(columns.feedforward.slice(-50).filter((force) => force !== null))'
        )
        assert 'OFF' in page.value('byId("feedforward-more").textContent')
        check_page(page, changing.port)


@NO_BROWSER
def test_a_slider_sets_the_parameter_and_shows_the_answer_of_the_node(changing: Monitor):
    with shown(changing.url, 1400) as page:
        page.wait_for('!document.getElementById("settings").hidden')
        for value, word in (('0.4', 'yes'), ('7', 'no')):
            # at once: a view that comes between them would show the value of the node again
            page.value(f'byId("field-scale").value = "{value}"; byId("field-scale").dispatchEvent(new Event("change"))')
            page.wait_for(f'byId("change-answer").className === "{word}"')
            page.value('window.confirm = (text) => { window.asked = text; return text.startsWith("Scale 7"); }')
        said = page.value('byId("change-answer").textContent')
        assert said.startswith('REJECTED by /friction_estimator')
        for name in ('field', 'slide'):  # what the node refused jumps back
            assert float(page.value(f'byId("{name}-scale").value')) == 0.4
        page.value('byId("field-scale").value = "1.2"; byId("field-scale").dispatchEvent(new Event("change"))')
        assert page.value('window.asked').startswith('Scale 1.2')  # and was told no
        assert float(page.value('byId("field-scale").value')) == 0.4
        assert changing.wait_for(lambda view: view['now']['settings']['scale'] == 0.4)


@pytest.mark.long
@NO_BROWSER
def test_a_machine_of_three_shows_each_actuator_and_off_takes_out_all_forces(tmp_path: Path):
    domain, recording = free_domain(), {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    scales = {f'{name}.feedforward.scale': 0.9 for name in NAMES}
    with (
        machine(tmp_path, domain, 400.0, **recording, **scales),  # parts a sample apart: 2.7 N
        monitor(domain, '--allow-changes') as running,
        shown(running.url, 1400) as page,
    ):
        running.wait_for(lambda view: len(view['actuators']) == len(NAMES) and view['now']['feedforward'])
        for place, name in enumerate(NAMES):
            page.wait_for(f'byId("tabs").children.length === {len(NAMES)}')
            while page.value('label') != f'{name} (/machine_estimator)':  # a frame may replace the tabs in a click
                page.click(f'#tabs button:nth-child({place + 1})')
                page.wait_for('label')  # the first frame of the new stream; another click would close it
            page.wait_for('columns.measured.length > 100')
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
    recorded = read_whole(RecordedView(tmp_path / 'bag'))
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
        end = time.monotonic() + STOP_TIMEOUT
        while not watching.view.view('', -1.0)['label']:  # nothing is spun: no event reaches the monitor
            assert time.monotonic() < end, watching.view.view('', -1.0)['nodes']
            for timer in watching.timers:
                timer.callback()
            time.sleep(0.05)
        assert watching.view.view('', -1.0)['label'] == '/friction_estimator'


def test_a_node_that_does_not_answer_is_not_confirmed():
    with in_process((FrictionEstimator, {'parameter_overrides': overrides()})) as (watching, spun, (estimator,)):
        assert spun.spin_until(lambda: watching.view.view('', -1.0)['label'])
        estimator.executor.remove_node(estimator)  # it is there, and calls nothing
        asked: list[Any] = []
        change = lambda: asked.extend(watching.view.change('/friction_estimator', 'scale', 0.0))  # noqa: E731
        thread = threading.Thread(target=change)
        thread.start()
        assert spun.spin_until(lambda: asked)
        thread.join()
    (answer,) = asked
    assert not answer.confirmed
    assert answer.text == f'NOT CONFIRMED: no answer from /friction_estimator within {ANSWER_TIMEOUT:g} s'


@NO_BROWSER
@pytest.mark.parametrize('width', WIDE)
def test_a_bag_is_shown_at_any_moment_and_plays(width: int):
    command = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main', 'monitor', 'bags/faults']
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    url = process.stdout.readline().split()[1]
    try:
        with shown(url, width) as page:
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
            page.value('byId("speed").value = 10')
            page.click('#play')
            page.wait_for('columns.time.at(-1) > 3.5')
            page.click('#play')
            page.wait_for('about.loaded === about.duration')
            page.value('byId("time").value = 1; byId("time").dispatchEvent(new Event("input"))')
            for begin in page.value('about.faults[label].map(([begin]) => begin)')[:2]:
                page.click('#next-fault')
                page.wait_for(f'Math.abs(columns.time.at(-1) - {begin} - 2.5) < 0.06')
            drawn = {name: page.value(f'byId("{name}").getBBox().width') for name in ('friction-curve', 'reversals')}
            assert drawn['friction-curve'] > 900.0 > drawn['reversals'] > 0.0
            assert page.value('byId("off").hidden')
            check_page(page, urlsplit(url).port)
    finally:
        process.send_signal(2)
        assert process.wait(STOP_TIMEOUT) == 0
        process.stdout.close()


@NO_BROWSER
def test_two_windows_show_one_off(changing: Monitor):
    with shown(changing.url, 1400) as page, shown(changing.url, 1400) as other:
        for one in (page, other):
            one.wait_for('now !== null')
        press_off(page)
        other.wait_for('byId("off-answer").className === "yes" && !byId("lift").hidden')
        other.click('#lift')
        other.click('#lift')
        for one in (page, other):
            one.wait_for('byId("off-state").hidden')


@NO_BROWSER
def test_off_without_a_connection_is_not_confirmed_within_3_s_and_a_late_confirmation_replaces_that(changing: Monitor):
    with shown(changing.url, 1400) as page:
        page.wait_for('now !== null')
        changing.process.send_signal(signal.SIGSTOP)
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
        changing.process.send_signal(signal.SIGCONT)
        page.wait_for('byId("off-answer").className === "yes"')
        assert 'OFF: confirmed by /friction_estimator' in page.value('byId("off-answer").textContent')
        assert changing.ask('/view')['now']['settings']['scale'] == 0.0


@NO_BROWSER
def test_without_the_monitor_a_confirmed_off_is_not_known_any_more_and_another_one_is_not_confirmed(axis: int):
    with tab(1400) as page:
        with monitor(axis, '--allow-changes') as running:
            page.open(running.url)
            page.wait_for('columns.time && columns.time.length > 20')
            press_off(page)
        page.wait_for('byId("off-answer").className === "no"')
        assert page.value('byId("off-answer").textContent').startswith('NOT KNOWN: no connection')
        assert page.value('byId("mode").textContent') == 'NO CONNECTION'
        assert page.value('byId("lift").hidden')
        page.click('#off')
        page.wait_for('byId("off-answer").textContent.startsWith("NOT CONFIRMED")')
        assert page.value('byId("off-answer").className') == 'no'


@NO_BROWSER
@pytest.mark.long
def test_a_monitor_starts_again_on_its_port_and_the_open_page_goes_on_with_the_same_token(axis: int, tmp_path: Path):
    token = tmp_path / 'token'
    with tab(1400) as page:
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


@pytest.mark.usefixtures('changing')
def test_the_estimator_sends_to_one_slow_reader_alone_and_no_driver_has_one_more(axis: int):
    with ros_context(axis) as context:
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
