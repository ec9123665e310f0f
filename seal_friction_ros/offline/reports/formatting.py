"""Numbers and quantities as text, the same on pages and in figures."""

import math
from datetime import UTC, datetime

from seal_friction_ros.core.foundation.units import BAR, MM, PSI, UM

FIRST_DATE = 365.0 * 86_400.0  # [s] a stamp before 1971 is no date (our choice)
MINUS, DASH = '\N{MINUS SIGN}', '\N{EN DASH}'


def number(value: float | None, digits: int = 2, *, unit: float = 1.0, signed: bool = False) -> str:
    """Value in multiples of ``unit`` with so many decimals; a dash for None and for a value that is not finite."""
    if value is None or not math.isfinite(value):
        return DASH
    rounded = round(value / unit, digits) + 0.0  # no minus zero
    return f'{rounded:{"+" if signed and rounded else ""}.{digits}f}'.replace('-', MINUS)


def thousands(count: int) -> str:
    """Count with its digits in groups of three."""
    return f'{count:,}'.replace(',', '\N{THIN SPACE}')


def date_text(time: float) -> str:
    """Date and time of a stamp [s], UTC."""
    try:
        return f'{datetime.fromtimestamp(time, UTC):%Y-%m-%d %H:%M}'
    except (ValueError, OverflowError, OSError):
        return 'not told'


def signed_percent(share: float) -> str:
    """Share in percent with its sign, for example ``+12.5 %``; ``0 %`` for less than 0.05 %."""
    percent = round(100.0 * share, 1)
    return f'{percent:+g} %'.replace('-', MINUS) if percent else '0 %'


def relative_change(before: float, after: float) -> str:
    """Change from ``before`` in percent, without decimals; ``0 %`` where ``before`` is 0."""
    return f'{number(100.0 * (after / before - 1.0) if before > 0.0 else 0.0, 0, signed=True)} %'


def force_unit(largest: float) -> tuple[str, float]:
    """Unit to label forces up to ``largest`` [N] with, and its size [N]."""
    return ('kN', 1e3) if largest >= 2e3 else ('N', 1.0)


def length_unit(largest: float) -> tuple[str, float]:
    """Unit to label lengths up to ``largest`` [m] with, and its size [m]."""
    return ('mm', MM) if largest >= MM else ('µm', UM)


def speed_unit(largest: float) -> tuple[str, float]:
    """Unit to label speeds up to ``largest`` [m/s] with, and its size [m/s]."""
    return ('m/s', 1.0) if largest >= 1.0 else ('mm/s', MM)


def length_text(value: float) -> str:
    """Length [m] in mm or µm."""
    return f'{value / UM:.3g} µm' if abs(value) < 0.9995 * MM else f'{value / MM:.3g} mm'


def pressure_text(pressure: float) -> str:
    """Pressure [Pa] in bar and psi."""
    return f'{pressure / BAR:.3g} bar ({pressure / PSI:.0f} psi)'


def pressure_range(low: float, high: float) -> str:
    """Range of pressures [Pa] in bar."""
    return f'{low / BAR:.3g} to {high / BAR:.3g} bar'
