"""The live view on a bad day: OFF stays off, data that stop are not drawn, a peer may send anything."""

import json
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest
from harness.browser import Page, chromium
from harness.monitor_process import SCRIPT, Monitor, check_page, monitor, press_off, shown
from harness.moving_axis import MovingAxis, compensated
from harness.moving_machine import NAMES, machine
from harness.processes import free_domain, node_process
from harness.spin_nodes import SpunNodes, ros_context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from seal_friction_ros.core.messages.coder import encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.managed_node import message_class

WIDE = (1400, pytest.param(420, marks=pytest.mark.long))
NO_BROWSER = pytest.mark.skipif(not chromium(), reason='chromium is not installed: apt-get install chromium')


class Stage(NamedTuple):
    """An actuator whose drivers run and stop, and its view; each test starts its estimator."""

    domain: int
    drivers: MovingAxis
    running: Monitor


@pytest.fixture(scope='module')
def moving_axis() -> Iterator[Stage]:
    domain = free_domain()
    with MovingAxis(domain, frame=SCRIPT.encode()) as drivers, monitor(domain, '--allow-changes') as running:
        yield Stage(domain, drivers, running)


@pytest.fixture
def stage(moving_axis: Stage) -> Iterator[Stage]:
    """The moving axis, without an estimator and OFF before and after."""
    yield moving_axis
    moving_axis.drivers.go_on()
    moving_axis.running.ask('/lift', {})
    moving_axis.running.wait_for(lambda view: view['off'] is None and view['now']['cause'] == 'node')


def test_a_node_that_leaves_is_gone_at_once_and_placeholder_seals_are_not_good(stage: Stage, tmp_path: Path):
    with node_process('friction_estimator', stage.domain, {}, tmp_path / 'log'):
        view = stage.running.wait_for(lambda view: view['label'] and not view['now']['cause'])
        assert view['now']['verdict'] != 'good'
    stage.running.wait_for(lambda view: 'it has left the graph' in view['now']['reason'])


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


@NO_BROWSER
@pytest.mark.parametrize('width', WIDE)
def test_off_stays_off_whoever_sets_a_scale_and_whoever_comes_back_with_one_until_it_is_lifted(
    width: int, stage: Stage, tmp_path: Path
):
    domain, _, running = stage
    with ExitStack() as nodes, shown(running.url, width) as page:
        first = nodes.enter_context(compensated(domain, tmp_path / 'log'))
        page.wait_for('now && !now.cause && columns.feedforward.slice(-50).some((force) => force > 20)')
        press_off(page)
        assert page.value('byId("off-events").children.length') == 0
        page.wait_for('off?.lines[0]?.[1]?.endsWith("feedforward.scale = 0")')

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
        nodes.enter_context(compensated(domain, tmp_path / 'log'))
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
ESTIMATES = 'columns.estimate.slice(-100).filter((force) => force !== null).length'
BLUE, VERMILLION = [0, 114, 178], [213, 94, 0]


def ink(page: Page, plot: str, begin: float, end: float, colour: list[int]) -> int:
    """Number of pixels of a colour between two times of a plot."""
    return page.value(f'({INK})("{plot}", {begin}, {end}, {json.dumps(colour)})')


@NO_BROWSER
@pytest.mark.parametrize('width', WIDE)
def test_curves_stop_where_data_stop_and_tiles_say_how_old_they_are(width: int, stage: Stage, tmp_path: Path):
    domain, drivers, running = stage
    with compensated(domain, tmp_path / 'log') as process, shown(running.url, width) as page:
        page.wait_for(f'now && !now.cause && {ESTIMATES} > 50')  # of 100: on a busy machine some rows have none
        page.wait_for('byId("mode").textContent === "LIVE"')
        assert page.value('byId("source").textContent').endswith(SCRIPT[:80])  # as text
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
        compensated(domain, tmp_path / 'log'),
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
