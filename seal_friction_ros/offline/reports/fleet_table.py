"""Parquet table of a fleet: a row per bag and pressure level."""

from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.offline.replay.bag_summary import LEVEL_COLUMNS, BagSummary
from seal_friction_ros.offline.reports.fleet_report import FleetBag
from seal_friction_ros.offline.work.atomic_file import write_whole
from seal_friction_ros.packages import needed

_TEXTS, _COUNTS = ('replay', 'difference', 'next', 'health'), ('messages', 'reversals')
_OF_BAG = [name for name in BagSummary._fields if name not in ('levels', 'level', 'why')]
_OF_LEVEL = [f'level_{name}' for name in LEVEL_COLUMNS]


def write_fleet_table(bags: Sequence[FleetBag], out: Path) -> None:
    """Write the table; SI units, null where a bag does not tell. A bag without a pressure level has one row.

    An existing file is replaced. MissingPackageError: pyarrow is not installed; ValueError: the file cannot be written.
    """
    arrow, parquet = needed('pyarrow'), needed('pyarrow.parquet')
    kinds = dict.fromkeys(('bag', 'level', 'why', *_TEXTS), arrow.string()) | dict.fromkeys(_COUNTS, arrow.int64())
    names = ('bag', 'level', 'why', *_OF_BAG, *_OF_LEVEL)
    schema = arrow.schema([(name, kinds.get(name, arrow.float64())) for name in names])
    buffer = BytesIO()
    table = arrow.Table.from_pylist([row for bag in bags for row in _rows(bag)], schema)
    parquet.write_table(table, buffer, compression='zstd')
    with named_errors(f'{out}: cannot write the table', OSError):
        write_whole(out, buffer.getvalue())


def _rows(bag: FleetBag) -> Iterator[dict[str, Any]]:
    of_bag: dict[str, Any] = {'bag': str(bag.path), 'level': bag.level, 'why': bag.why}
    of_bag |= {name: getattr(bag.summary, name, None) for name in _OF_BAG}
    levels = bag.summary.levels.tolist() if bag.summary is not None else []
    for level in levels or [()]:
        row = of_bag | dict(zip(_OF_LEVEL, level, strict=False))
        yield {name: _storable(value) for name, value in row.items()}


def _storable(value: Any) -> Any:
    """A value as the table holds it: no NaN, and text without what UTF-8 cannot hold."""
    if isinstance(value, str):
        return value.encode(errors='replace').decode()
    return None if value != value else value  # noqa: PLR0124  NaN
