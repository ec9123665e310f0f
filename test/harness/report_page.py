"""A report page as its parts, for tests."""

from html.parser import HTMLParser
from pathlib import Path

from harness.page_in_browser import check_in_browser

LOADED = {'src', 'href', 'srcset', 'data', 'action', 'poster'}  # attributes that fetch something
STUBS = {'svg': b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg"/>', 'png': b'\x89PNG\r\n\x1a\n'}
FOREIGN = {'link', 'iframe', 'object', 'embed', 'base', 'meta'}


class Page(HTMLParser):
    """Texts of a page by the element they are in."""

    def __init__(self, path: Path):
        super().__init__()
        self.is_sortable = False
        self.path, self.links, self.tags, self.figures, self.tables = path, [], [], [], []
        self.texts: dict[str, list[str]] = {}
        self._open: list[list[str]] = []
        self.feed(path.read_text(encoding='utf-8'))

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.tags.append(tag)
        if tag != 'a':  # a link that somebody follows loads nothing
            self.links += [value for name, value in attrs if name in LOADED]
        self.is_sortable |= attributes.get('class') == 'sortable'
        if tag == 'figure':
            self.figures.append(attributes['id'])
        if tag == 'table':
            self.tables.append([])
        if tag == 'tr':
            self.tables[-1].append([])
        if tag not in {'meta', 'img', 'wbr'}:
            self._open.append([f'{tag}.{attributes["class"]}' if 'class' in attributes else tag, ''])

    def handle_data(self, data):
        for element in self._open[-1:] if self._open and self._open[-1][0] == 'script' else self._open:
            element[1] += data

    def handle_endtag(self, tag):
        name, text = self._open.pop()
        assert name.partition('.')[0] == tag, f'{name} is closed by {tag}'
        text = text if tag == 'pre' else ' '.join(text.split())
        self.texts.setdefault(name, []).append(text)
        if tag in {'td', 'th'}:
            self.tables[-1][-1].append(text)

    def table(self, first_head: str) -> list[dict[str, str]]:
        """Rows of the table with this first head, by head."""
        (found,) = (table for table in self.tables if table[0][0] == first_head)
        return [dict(zip(found[0], row, strict=True)) for row in found[1:]]

    @property
    def tiles(self) -> dict[str, str]:
        """Value by name."""
        return dict(zip((name for name in self.texts['span']), self.texts['b'], strict=True))

    @property
    def prose(self) -> str:
        """Everything that is read on the page."""
        return self.texts['body'][0]

    def check(self) -> None:
        """The page stands alone, and each figure lies beside it as PNG and SVG."""
        assert self.tags[:2] == ['html', 'head']
        assert self.links
        assert all(link.startswith('data:image/svg+xml;base64,') for link in self.links)
        assert set(self.tags).isdisjoint(FOREIGN - {'meta'})
        drawn = len(self.texts.get('div.plot', []))
        assert self.tags.count('script') == drawn + bool(drawn) + self.is_sortable
        for style in self.texts['style']:
            assert 'url(' not in style
            assert '@import' not in style
        assert len(set(self.figures)) == len(self.figures) == len(self.texts['figcaption']) == len(self.links)
        assert all(self.texts['figcaption'])
        folder = self.path.parent / f'{self.path.stem}_figures'
        files = {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix != '.gif'}
        assert set(files) == {f'{name}.{kind}' for name in self.figures for kind in ('png', 'svg')}
        for name, data in files.items():
            assert data.startswith(b'\x89PNG' if name.endswith('png') else b'<?xml')
            assert len(data) > 5000 or data in STUBS.values()
        assert not list(self.path.parent.rglob('*.partial'))
        assert self.texts['title'] == self.texts['h1']


def checked_page(path: Path) -> Page:
    """The page at a path, after `Page.check` and, where there is a browser, `check_in_browser`."""
    page = Page(path)
    page.check()
    check_in_browser(path)
    return page
