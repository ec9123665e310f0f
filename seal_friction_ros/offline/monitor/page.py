"""The page of the view as one file: HTML, style and script in it, and a policy that lets nothing else run or load."""

import base64
import hashlib
import re
from pathlib import Path

FOLDER = Path(__file__).parent / 'page'
_PARTS = ('uPlot.min.css', 'monitor.css', 'uPlot.iife.min.js', 'monitor.js')
"""Files whose text stands in the page, each in the place of its name in braces: ``{{monitor.js}}``."""


def make_page() -> tuple[bytes, str]:
    """The page, and its Content-Security-Policy: only the scripts and styles in it, connections to its server alone.

    No value of a machine is in the page: all of them come as JSON, and the script writes them as text.
    """
    text = (FOLDER / 'monitor.html').read_text()
    for name in _PARTS:
        text = text.replace(f'{{{{{name}}}}}', (FOLDER / name).read_text())
    scripts, styles = (_hashes(text, tag) for tag in ('script', 'style'))
    policy = (
        f"default-src 'none'; script-src {scripts}; style-src {styles}; connect-src 'self'; img-src data:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return text.encode(), policy


def _hashes(text: str, tag: str) -> str:
    """Sources of a policy: the hash of the content of each element."""
    contents = re.findall(rf'<{tag}>(.*?)</{tag}>', text, re.DOTALL)
    return ' '.join(f"'sha256-{base64.b64encode(hashlib.sha256(c.encode()).digest()).decode()}'" for c in contents)
