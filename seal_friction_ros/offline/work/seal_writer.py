"""Writer of seal files: each is checked as the node checks it and written atomically."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import parse_yaml
from seal_friction_ros.offline.work.atomic_file import write_whole


def rounded(value: float, digits: int) -> float:
    """A number rounded to so many significant digits."""
    return float(f'{value:.{digits}g}')


def rounded_numbers(value: Any, digits: int = 6) -> Any:
    """Mappings, lists and arrays with each number rounded; None for a number that is not finite."""
    if isinstance(value, Mapping):
        return {key: rounded_numbers(item, digits) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return rounded_numbers(value.tolist(), digits)
    if isinstance(value, list | tuple):
        return [rounded_numbers(item, digits) for item in value]
    if not isinstance(value, float):
        return value
    return rounded(value, digits) if math.isfinite(value) else None


def seal_text(document: Mapping[str, Any]) -> str:
    """YAML of a seal file."""
    text: str = yaml.safe_dump(dict(document), sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)
    return text


def write_seal(document: Mapping[str, Any], out: Path, comment: str = '') -> None:
    """Write a seal file with comment lines at its beginning, and its folder if necessary; replace an existing file.

    ValueError: the document is not a valid seal, or the file cannot be written.
    """
    content = (''.join(f'# {line}\n' for line in comment.splitlines()) + seal_text(document)).encode()
    parse_seal(parse_yaml(content, str(out)))
    with named_errors(f'{out}: cannot write the seal file', OSError):
        write_whole(out, content)
