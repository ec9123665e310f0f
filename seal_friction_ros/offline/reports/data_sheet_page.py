"""Printable page of an empty data sheet."""

from pathlib import Path

from seal_friction_ros.offline.identification.data_sheet import DIMENSIONS, FrictionTestPlan
from seal_friction_ros.offline.reports.page import write_page


def write_data_sheet_page(plan: FrictionTestPlan, out: Path, command: str = 'sheet') -> None:
    """Write the empty sheet as a page to print, made by a ``command``; errors as of `write_page`."""
    write_page(out, 'data_sheet', (), plan=plan, dimensions=DIMENSIONS, command=command)
