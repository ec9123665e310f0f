"""What large pages cost in a browser: ``python bench/pages.py [--seconds 3600] [--bags 200] [--times 5] [--json]``.

The report of one cylinder at 1 kHz and the page of a fleet are opened in headless Chromium, several times; the least
counts. ``open`` is from the navigation to the first frame after the page has loaded and all figures in sight are drawn;
``zoom`` is a key that zooms all panels of a figure, to the frame after it. The machine has to be idle.
"""

import sys
import tempfile
from pathlib import Path

from scale import make_bag, timed_fleet

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))
from harness.campaign import parser_of, run_command, tell
from harness.page_in_browser import opened

RIGS = 10
NEXT_FRAME = 'new Promise(done => requestAnimationFrame(() => setTimeout(() => done(performance.now()))))'
ZOOM = f"""(async () => {{
  const figure = document.querySelector('figure[id] .plot');
  if (!figure) return 0;
  figure.scrollIntoView(); await {NEXT_FRAME};
  const begin = performance.now();
  figure.dispatchEvent(new KeyboardEvent('keydown', {{key: '+'}}));
  return await {NEXT_FRAME} - begin;
}})()"""


def timed(page: Path, times: int) -> dict[str, float]:
    """Size, and the least time to open and to zoom."""
    opening, zooming = [], []
    for _ in range(times):
        tab = opened(page, 1400)
        opening.append(tab.value(NEXT_FRAME))  # since the navigation
        zooming.append(tab.value(ZOOM))
    return {'size [MB]': page.stat().st_size / 1e6, 'open [s]': min(opening) / 1e3, 'zoom [ms]': min(zooming)}


def fleet_page(bag: Path, count: int, folder: Path) -> Path:
    """Page of a fleet of hard links to one bag."""
    for number in range(count):
        target = folder / f'rig{number % RIGS}' / f'bag{number}'
        target.mkdir(parents=True)
        for file in bag.iterdir():
            (target / file.name).hardlink_to(file)
    timed_fleet(folder, [])
    return Path(f'{folder}.html')


def main() -> int:
    """Print the figures."""
    parser = parser_of(
        __doc__, seconds=(3600.0, 'of the report [s]'), bags=(200, 'in the fleet'), times=(5, 'each page is opened')
    )
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        report = folder / 'report.html'
        run_command('report', make_bag(folder / 'long', arguments.seconds), '--out', report)
        fleet = fleet_page(make_bag(folder / 'small', 2.0), arguments.bags, folder / 'fleet')
        pages = {f'report of {arguments.seconds:g} s at 1 kHz': report, f'fleet of {arguments.bags} bags': fleet}
        rows = [{'page': name, **timed(page, arguments.times)} for name, page in pages.items()]
    tell(rows, as_json=arguments.json, title='large pages')
    return 0


if __name__ == '__main__':
    sys.exit(main())
