"""Figures of a page in a browser: zoom in time alone, linked axes, values under the pointer, entries that hide."""

import time
from pathlib import Path

import pytest
from harness.browser import TIMEOUT, chromium
from harness.page_in_browser import PAPER, opened
from paths import ROOT

from seal_friction_ros.offline.reports.bag_report import write_report

pytestmark = pytest.mark.skipif(not chromium(), reason='no Chromium: apt-get install chromium')
PRESSURE = '#inputs .panel:first-child .u-over'


@pytest.fixture(scope='module')
def path(tmp_path_factory) -> Path:
    return write_report(ROOT / 'bags' / 'pull_test', tmp_path_factory.mktemp('page') / 'page.html').page


def drag(tab, selector: str, left: float, right: float) -> None:
    """Drag over a figure from one share of its width to another."""
    x, y, width, height = tab.value(
        f"(() => {{const e = document.querySelector('{selector}'); e.scrollIntoView({{block: 'center'}});"
        'const b = e.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]})()'
    )
    for kind, share in (
        ('mousePressed', left),
        ('mouseMoved', (left + right) / 2),
        ('mouseMoved', right),
        ('mouseReleased', right),
    ):
        tab.call(
            'Input.dispatchMouseEvent', type=kind, x=x + share * width, y=y + height / 2, button='left', clickCount=1
        )


def ticks(tab, figure: str) -> list[list[float]]:
    """Range of the x axis and of the y axis of each panel of a figure, after panels out of sight have followed."""
    shown = f'figures.{figure}.map(({{scales}}) => [scales.x.min, scales.x.max, scales.y.min, scales.y.max])'
    return tab.value(f'new Promise((done) => setTimeout(() => done({shown})))')


def test_a_drag_zooms_time_alone_of_all_panels_over_the_same_time_and_a_double_click_shows_everything(path: Path):
    tab = opened(path, 1400)
    before = {name: ticks(tab, name) for name in ('live_estimate', 'inputs', 'friction_over_pressure')}
    drag(tab, PRESSURE, 0.4, 0.6)
    zoomed = {name: ticks(tab, name) for name in before}
    first, last = before['inputs'][0][:2]
    for panel, was in zip(zoomed['inputs'], before['inputs'], strict=True):
        assert panel[0] == pytest.approx(first + 0.4 * (last - first), abs=0.01 * (last - first))
        assert panel[1] == pytest.approx(first + 0.6 * (last - first), abs=0.01 * (last - first))
        assert panel[2:] == was[2:]
    assert zoomed['live_estimate'][:2] != before['live_estimate'][:2]  # the whole bag, and the strip below it
    assert zoomed['live_estimate'][2:] == before['live_estimate'][2:]  # the shaded part has a range of its own
    assert zoomed['friction_over_pressure'] == before['friction_over_pressure']
    tab.value(f"document.querySelector('{PRESSURE}').dispatchEvent(new MouseEvent('dblclick'))")
    assert {name: ticks(tab, name) for name in before} == before
    assert tab.complaints == []


@pytest.mark.parametrize('key', ['+', 'wheel'])
def test_a_key_and_the_wheel_with_ctrl_zoom_too_and_the_wheel_alone_scrolls(path: Path, key: str):
    tab = opened(path, 1400)
    before = ticks(tab, 'inputs')
    wheel = f"document.querySelector('{PRESSURE}').dispatchEvent(new WheelEvent('wheel', {{deltaY: -1, ctrlKey: %s}}))"
    tab.value(wheel % 'false')
    assert ticks(tab, 'inputs') == before
    pressed = "document.querySelector('#inputs .plot').dispatchEvent(new KeyboardEvent('keydown', {key: '+'}))"
    tab.value(pressed if key == '+' else wheel % 'true')
    assert all(now[1] - now[0] < was[1] - was[0] for now, was in zip(ticks(tab, 'inputs'), before, strict=True))


def test_the_pointer_reads_the_value_of_each_line(path: Path):
    tab = opened(path, 1400)
    x, y, width, height = tab.value(
        f"(() => {{const e = document.querySelector('{PRESSURE}'); e.scrollIntoView({{block: 'center'}});"
        'const b = e.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]})()'
    )
    tab.call('Input.dispatchMouseEvent', type='mouseMoved', x=x + 0.97 * width, y=y + height / 2)
    said = tab.value("[...document.querySelectorAll('#inputs .panel:first-child :is(th, td)')].map(e => e.innerText)")
    assert said[-2:] == ['chambers a and b', '13.79']  # the highest pressure of the bag, 200 psi
    assert tab.value('figures.inputs.map(chart => chart.cursor.left >= 0)') == [True] * 3


def test_an_entry_of_the_legend_of_a_panel_hides_its_curve_by_mouse_and_by_key(path: Path):
    tab = opened(path, 1400)
    shown = 'figures.live_estimate.map(chart => chart.series.filter(one => one.show).length)'
    before = tab.value(shown)
    entry = "[...document.querySelectorAll('#live_estimate .panel:first-child th')].at(-1)"
    tab.value(f'{entry}.click()')
    assert tab.value(shown) == [before[0] - 1, *before[1:]]
    tab.value(f"{entry}.dispatchEvent(new KeyboardEvent('keydown', {{key: 'Enter'}}))")
    assert tab.value(shown) == before


def pictures(tab) -> int:
    """Pictures of the page so far, by the tree of the browser, since no script runs."""
    try:
        root = tab.call('DOM.getDocument')['root']['nodeId']
        return len(tab.call('DOM.querySelectorAll', nodeId=root, selector='figure:not(.drawn) img')['nodeIds'])
    except RuntimeError:  # the page before has gone meanwhile
        return 0


def test_without_scripts_the_page_shows_pictures(path: Path):
    tab = opened(path, 1400)
    tab.call('Emulation.setScriptExecutionDisabled', value=True)
    try:
        tab.call('Page.navigate', url=path.resolve().as_uri())
        figures, end = path.read_text().count('<figure id='), time.monotonic() + TIMEOUT
        while pictures(tab) < figures:
            assert time.monotonic() < end
    finally:
        tab.call('Emulation.setScriptExecutionDisabled', value=False)


def test_printed_on_paper_every_figure_is_its_picture(path: Path):
    tab = opened(path, PAPER)
    tab.call('Emulation.setEmulatedMedia', media='print')
    try:
        assert tab.value("[...document.querySelectorAll('.picture img')].every(e => e.clientWidth > 600)")
        assert tab.value("[...document.querySelectorAll('.plot')].every(e => !e.clientWidth)")
    finally:
        tab.call('Emulation.setEmulatedMedia', media='')


def test_in_dark_mode_the_curves_are_drawn_for_it(path: Path):
    tab = opened(path, 1400)
    ink = 'figures.inputs[0].axes[0].stroke()'
    light = tab.value(ink)
    tab.call('Emulation.setEmulatedMedia', features=[{'name': 'prefers-color-scheme', 'value': 'dark'}])
    try:
        tab.wait_for(f'{ink} !== "{light}"')
        assert tab.value('getComputedStyle(document.body).backgroundColor') == 'rgb(26, 26, 26)'
    finally:
        tab.call('Emulation.setEmulatedMedia', features=[])
