"""Documents of others, as JSON: whatever the text is, it gives plain values or one line that says what is wrong."""

import json
from typing import Any

DEEPEST = 40  # Levels of a document: our choice; those of this package have less than 12, and Python ends at some 1000.


class NotJsonError(ValueError):
    """A text is no document at all."""


def parse_json(text: str | bytes, where: str) -> Any:
    """Document of a text that may come from anybody; ``where`` names it in the error message.

    NotJsonError: the text is not JSON; ValueError: it is more than `DEEPEST` levels deep.
    """
    try:
        document = json.loads(text)
    except RecursionError:
        raise _too_deep(where) from None
    except ValueError as error:
        raise NotJsonError(f'{where}: not JSON: {error}') from None
    level = [document]
    for _ in range(DEEPEST):
        level = [value for one in level for value in _values(one)]
    if any(isinstance(one, dict | list) for one in level):
        raise _too_deep(where)
    return document


def _values(document: Any) -> Any:
    if isinstance(document, dict):
        return document.values()
    return document if isinstance(document, list) else ()


def _too_deep(where: str) -> ValueError:
    return ValueError(f'{where}: more than {DEEPEST} levels deep')
