"""A report page in a headless browser, at the width of a desk and of a phone."""

import atexit
import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from harness.browser import Page, browser, chromium

WIDTHS = (1400, 420)  # [px]
PAPER = 688  # [px] A4 less margins of 14 mm
SMALLEST_TEXT = 11  # [px]
LARGEST = 5 << 20  # [bytes] of a page

CUT = """(() => {
  const cut = [], width = document.documentElement.clientWidth;
  for (const e of document.querySelectorAll('body *')) {
    if (e.closest('.scroll, .u-wrap, script')) continue;
    const box = e.getBoundingClientRect();
    if (!box.width) continue;
    if (box.right > width + 1 || box.left < -1) cut.push(`${e.tagName} ${e.textContent.slice(0, 40)}: beyond the page`);
    const hides = getComputedStyle(e).overflowX !== 'visible';
    if (hides && e.scrollWidth > e.clientWidth + 1) cut.push(`${e.tagName} ${e.textContent.slice(0, 40)}: cut`);
  }
  return cut;
})()"""
LETTERS = """[...document.querySelectorAll('table:not(.u-legend) :is(td, th)')].filter(
  e => e.textContent.trim().length > 8 && e.clientWidth < 40)
  .map(e => e.textContent)"""
SMALL = f"""[...document.querySelectorAll('.plot p, .plot small, .plot th, .plot td')]
  .filter(e => e.textContent && parseFloat(getComputedStyle(e).fontSize) < {SMALLEST_TEXT}).map(e => e.textContent)"""
UNDRAWN = """[...document.querySelectorAll('figure[id]')].filter(f => f.querySelector('.plot')
  ? !f.querySelector('.panel canvas') || f.querySelector('.panel:not(:has(canvas))')
  : !f.querySelector('.picture img').clientWidth).map(f => f.id)"""
NOT_READ_ALOUD = """[
  ...(document.querySelectorAll('main').length === 1 ? [] : ['one main landmark']),
  ...[...document.querySelectorAll('h1, h2, h3, h4')].filter(
    (h, i, all) => +h.tagName[1] > (i ? +all[i - 1].tagName[1] : 0) + 1).map(h => `${h.textContent}: skips a level`),
  ...[...document.querySelectorAll('.scroll:not([tabindex="0"][aria-label])')].map(e => e.outerHTML.slice(0, 80)),
  ...[...document.querySelectorAll('img')].filter(e => !e.alt).map(e => e.closest('figure').id)]"""
WIDE = """[...document.querySelectorAll('main *')].filter(e => e.getBoundingClientRect().right > innerWidth + 1)
  .map(e => e.outerHTML.slice(0, 80))"""
VIOLATIONS = """axe.run(document, {resultTypes: ['violations']}).then(found => found.violations.flatMap(
  one => one.nodes.map(node => `${one.id}: ${node.html.slice(0, 80)}`)))"""
KIND = "document.querySelector('meta[name=generator]').content"
CHECKS = {
    'cut': CUT, 'letter by letter': LETTERS, 'too small': SMALL, 'not drawn': UNDRAWN, 'not read aloud': NOT_READ_ALOUD,
}  # fmt: skip


_claims: list[socket.socket] = []  # kinds of pages that `violations` sees in this process


@cache
def axe() -> str:
    """The script axe-core, which finds what hinders people who cannot see well or use no mouse."""
    (folder,) = find_spec('axe_core_python').submodule_search_locations
    return (Path(folder) / 'axe.min.js').read_text(encoding='utf-8')


def violations(tab: Page) -> list[str]:
    """What axe-core finds on an open page, light and dark."""
    tab.value(axe())
    found = []
    for scheme in ('dark', 'light'):
        tab.call('Emulation.setEmulatedMedia', features=[{'name': 'prefers-color-scheme', 'value': scheme}])
        found += [f'{scheme}: {one}' for one in tab.value(VIOLATIONS)]
    return found


@cache
def shared_page() -> Page | None:
    """A tab that all pages of this process are opened in; None without a browser."""
    if not chromium():
        return None
    stack = ExitStack()
    folder = stack.enter_context(TemporaryDirectory(ignore_cleanup_errors=True))
    page = stack.enter_context(browser(Path(folder)))
    atexit.register(stack.close)
    return page


@contextmanager
def tab(width: int) -> Iterator[Page]:
    """An empty tab of a width [px]; there is a browser."""
    first = shared_page()
    assert first is not None
    page = first.another()
    page.size(width, 900)
    try:
        yield page
    finally:
        page.close()


def opened(path: Path, width: int) -> Page:
    """A page at a width [px]; there is a browser."""
    tab = shared_page()
    assert tab is not None
    tab.size(width, 900)
    tab.requests.clear()
    tab.complaints.clear()
    tab.open(path.resolve().as_uri())
    return tab


def is_first(kind: str) -> bool:
    """Whether this page is the first one of its kind in a run of the tests, whatever the number of its processes.

    The process of the first one claims the kind by an abstract Unix socket.
    """
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        claim.bind(f'\0{kind} in {os.environ.get("PYTEST_XDIST_TESTRUNUID", os.getpid())}')
    except OSError:
        claim.close()
        return False
    _claims.append(claim)
    return True


def check_in_browser(path: Path) -> None:
    """Nothing overflows, is cut, too small or undrawn; no complaint on the console; nothing is loaded.

    The first page of each kind in a run of the tests goes through `violations`, too, which takes some seconds.
    """
    assert path.stat().st_size < LARGEST
    if shared_page() is None:
        return
    for width in WIDTHS:
        tab = opened(path, width)
        found = {'overflow': tab.overflow, 'complaints': tab.complaints}
        found |= {name: tab.value(script) for name, script in CHECKS.items()}
        found['requests'] = [url for url in tab.requests if not url.startswith('data:')][1:]
        if width == WIDTHS[0]:
            found['violations'] = violations(tab) if is_first(tab.value(KIND)) else []
            tab.size(PAPER, 900)
            found['wide on paper'] = wide_on_paper(tab)
        wrong = {name: value for name, value in found.items() if value}
        assert not wrong, f'{path} at {width} px: {wrong}'


def wide_on_paper(tab: Page) -> list[str]:
    """Elements that are cut off where a page is printed on A4."""
    tab.call('Emulation.setEmulatedMedia', media='print')
    try:
        return list(tab.value(WIDE))
    finally:
        tab.call('Emulation.setEmulatedMedia', media='')
