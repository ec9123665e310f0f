"""Reports in tests: figures are drawn, but rendered only in tests that are marked ``renders``."""

from typing import Any, BinaryIO

import pytest

from harness.report_page import STUBS


def draw_nothing(_figure: object) -> None:
    """In the place of `Figure.draw_without_rendering`."""


def save_stub(_figure: object, file: BinaryIO, **options: Any) -> None:
    """In the place of `Figure.savefig`: an empty figure."""
    file.write(STUBS[options['format']])


@pytest.fixture(autouse=True)
def unrendered(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch):
    """To render a figure takes half a second."""
    if request.node.get_closest_marker('renders'):
        return
    from matplotlib.figure import Figure  # noqa: PLC0415  loaded only where it is needed

    monkeypatch.setattr(Figure, 'draw_without_rendering', draw_nothing)
    monkeypatch.setattr(Figure, 'savefig', save_stub)
