"""Parquet table of a fleet: a row per bag and pressure level."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.replay.bag_summary import LEVEL_COLUMNS, BagSummary
from seal_friction_ros.offline.reports.fleet_report import FleetBag
from seal_friction_ros.offline.work.atomic_file import write_whole
from seal_friction_ros.packages import needed

_TEXTS, _COUNTS = ('replay', 'difference', 'next', 'health'), ('messages', 'reversals')


def write_fleet_table(bags: Sequence[FleetBag], out: Path) -> None:
    """Write the table; SI units, null where a bag does not tell. A bag without a pressure level has one row.

    Args:
        bags: The bags.
        out: Parquet file; an existing one is replaced.

    Raises:
        MissingPackageError: pyarrow is not installed.
        ValueError: The file cannot be written.
    """
    arrow, parquet = needed('pyarrow'), needed('pyarrow.parquet')
    of_bag = [name for name in BagSummary._fields if name not in ('levels', 'level', 'why')]
    types = {name: arrow.string() if name in _TEXTS else arrow.float64() for name in of_bag}
    types |= dict.fromkeys(_COUNTS, arrow.int64())
    columns: dict[str, list[Any]] = {name: [] for name in ('bag', 'level', 'why', *of_bag, *_level_names())}
    for bag in bags:
        for level in _levels(bag.summary):
            values = [getattr(bag.summary, name, None) for name in of_bag]
            row = (str(bag.path), bag.level, bag.why, *values, *level)
            for column, value in zip(columns.values(), row, strict=True):
                column.append(_storable(value))
    fields = [arrow.field(name, types.get(name, _type_of(arrow, name))) for name in columns]
    buffer = BytesIO()
    parquet.write_table(arrow.table(columns, schema=arrow.schema(fields)), buffer, compression='zstd')
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_whole(out, buffer.getvalue())
    except OSError as error:
        raise ValueError(f'{out}: cannot write the table: {error.strerror}') from None


def _level_names() -> tuple[str, ...]:
    return tuple(f'level_{name}' for name in LEVEL_COLUMNS)


def _levels(summary: BagSummary | None) -> list[Any]:
    found = summary.levels.tolist() if summary is not None else []
    return found or [[None] * len(LEVEL_COLUMNS)]


def _type_of(arrow: Any, name: str) -> Any:
    return arrow.float64() if name in _level_names() else arrow.string()


def _storable(value: Any) -> Any:
    """A value as the table holds it: no NaN, and text without what UTF-8 cannot hold."""
    if isinstance(value, str):
        return value.encode(errors='replace').decode()
    return None if value != value else value  # noqa: PLR0124  NaN
