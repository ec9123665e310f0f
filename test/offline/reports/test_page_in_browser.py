"""Figures of a page in a browser: zoom, linked axes, values under the pointer, entries that hide, and no script."""

import time
from pathlib import Path

import pytest
from harness.browser import TIMEOUT, chromium
from harness.page_in_browser import opened
from paths import ROOT

from seal_friction_ros.offline.reports.bag_report import write_report

pytestmark = pytest.mark.skipif(not chromium(), reason='no Chromium: apt-get install chromium')
TICKS = """[...document.querySelectorAll('#%s .panel')].map(
  p => [...p.querySelectorAll('text')].map(t => t.textContent).join(' '))"""


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


def test_axes_of_the_same_quantity_zoom_together_and_come_back(path: Path):
    tab = opened(path, 1400)
    before = {name: tab.value(TICKS % name) for name in ('live_estimate', 'inputs')}
    drag(tab, '#inputs .panel svg', 0.4, 0.6)
    zoomed = {name: tab.value(TICKS % name) for name in before}
    assert zoomed['inputs'] != before['inputs']
    assert zoomed['live_estimate'][1] != before['live_estimate'][1]  # strip below the whole bag
    assert zoomed['live_estimate'][2:] == before['live_estimate'][2:]  # the shaded part has a range of its own
    tab.click('#inputs .plot-buttons button:last-child')
    assert {name: tab.value(TICKS % name) for name in before} == before
    assert tab.complaints == []


def test_the_pointer_reads_the_value_of_each_line(path: Path):
    tab = opened(path, 1400)
    x, y, width, height = tab.value(
        "(() => {const e = document.querySelectorAll('#inputs .panel svg')[0]; e.scrollIntoView({block: 'center'});"
        'const b = e.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]})()'
    )
    tab.call('Input.dispatchMouseEvent', type='mouseMoved', x=x + 0.97 * width, y=y + height / 2)
    said = tab.value("document.querySelector('#inputs .tip').innerText")
    assert '13.79 chambers a and b' in said  # the highest pressure of the bag, 200 psi
    assert tab.value("document.querySelectorAll('#inputs .cursor[visibility=visible]').length") == 3


def test_an_entry_of_the_legend_hides_its_curve(path: Path):
    tab = opened(path, 1400)
    count = "document.querySelectorAll('#live_estimate g[clip-path] path').length"
    before = tab.value(count)
    tab.click('#live_estimate .legend button:nth-child(2)')
    assert tab.value(count) < before
    assert tab.value("document.querySelector('#live_estimate .legend button:nth-child(2)').ariaPressed") == 'false'


def pictures(tab) -> int:
    """Pictures of the page so far, by the tree of the browser, since no script runs."""
    try:
        root = tab.call('DOM.getDocument')['root']['nodeId']
        return len(tab.call('DOM.querySelectorAll', nodeId=root, selector='figure noscript img')['nodeIds'])
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
