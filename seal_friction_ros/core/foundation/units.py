"""Units that data are read in and plots are labelled with; everything else is SI (REP-103).

One grammar serves every file: a value is a number in SI, or a text with its unit (`in_si`).
"""

import math
import re
from typing import Any

INCH = 0.0254  # [m]
LBF = 4.4482216152605  # [N]
PSI = LBF / INCH**2  # [Pa]
BAR, MPA = 1.0e5, 1.0e6  # [Pa]
MM, UM = 1e-3, 1e-6  # [m]
MS = 1e-3  # [s]
DEGREE = math.pi / 180.0  # [rad]

_SIZES: dict[str, dict[str, float]] = {
    'number': {'1': 1.0},
    'time': {'s': 1.0, 'ms': MS, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0, 'h': 3600.0},
    'length': {'m': 1.0, 'mm': MM, 'cm': 1e-2, 'um': UM, 'in': INCH},
    'velocity': {'m/s': 1.0, 'mm/s': MM, 'in/s': INCH},
    'pressure': {'Pa': 1.0, 'kPa': 1e3, 'MPa': MPA, 'bar': BAR, 'mbar': 100.0, 'psi': PSI},
    'force': {'N': 1.0, 'kN': 1e3, 'lbf': LBF},
    'area': {'m2': 1.0, 'mm2': MM**2, 'cm2': 1e-4, 'in2': INCH**2},
    'angle': {'rad': 1.0, 'deg': DEGREE},
    'mass': {'kg': 1.0, 'g': 1e-3, 't': 1e3},
    'stiffness': {'N/m': 1.0, 'N/mm': 1e3, 'kN/m': 1e3},
    'damping': {'N s/m': 1.0, 'kN s/m': 1e3},
    'acceleration': {'m/s2': 1.0, 'm/s^2': 1.0, 'mm/s2': MM},
    'frequency': {'Hz': 1.0, 'kHz': 1e3},
    'temperature': {'K': 1.0, 'degC': 1.0},
}
UNITS: dict[str, float] = {unit: size for sizes in _SIZES.values() for unit, size in sizes.items()}
"""Name of a unit -> its size in SI."""
QUANTITIES: dict[str, tuple[str, ...]] = {quantity: tuple(sizes) for quantity, sizes in _SIZES.items()}
"""Quantity -> its units, that of SI first."""
QUANTITY_OF: dict[str, str] = {unit: quantity for quantity, units in QUANTITIES.items() for unit in units}
"""Name of a unit -> its quantity."""
ZEROS = {'K': 0.0, 'degC': 273.15}  # Unit of temperature -> its zero [K].
_TEXT = re.compile(r'([-+]?(?:\d+(?:\.\d*)?|\.\d+)(e[-+]?\d+)?) *([a-z][\w/^ ()*]*)?', re.IGNORECASE)


def unit_size(name: str) -> float:
    """Size in SI of the unit called ``name``, for example 6894.757 [Pa] for ``psi``.

    ValueError: there is no such unit.
    """
    try:
        return UNITS[name]
    except KeyError:
        raise ValueError(f'unknown unit {name!r}: use one of {", ".join(UNITS)}') from None


def in_si(value: Any, unit: str, where: str, *, is_difference: bool = False) -> float:
    """Number in SI of an untrusted value: ``0.04``, ``40 mm``, or ``4e-2``, which YAML 1.1 reads as a text.

    A number without unit is in ``unit`` of SI; the unit of a text has to be of the same quantity. ``where`` names the
    value in error messages. Of a difference of temperatures degC and K are the same. ValueError: it is no number, is
    too large for one, or has a unit of another quantity.
    """
    others = QUANTITIES[QUANTITY_OF[unit]] if unit in QUANTITY_OF else (unit,)
    if isinstance(value, str) and (found := number_and_unit(value)) is not None:
        number, name = found[0], found[1] or unit
        if name != unit and name not in others:
            raise ValueError(f'{where}: unit {name!r} is not for a {QUANTITY_OF.get(unit, unit)}: {", ".join(others)}')
        zero = 0.0 if is_difference or not found[1] else ZEROS.get(name, 0.0)
        return zero + number * UNITS.get(name, 1.0)
    if isinstance(value, bool) or not isinstance(value, int | float):
        shown = value if not isinstance(value, str) or value.isprintable() else repr(value)
        hint = f' [{others[0]}] or text such as 1.0 {others[-1]}' if unit not in ('', '1') else ''
        raise ValueError(f'{where} = {shown!r} is not a number{hint}')
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f'{where} is too large for a floating-point number') from None


def number_and_unit(text: str) -> tuple[float, str] | None:
    """Number and unit of a text such as ``40 mm`` or ``4e-2``, whose unit is empty; None for any other text."""
    matched = _TEXT.fullmatch(text.strip())
    if matched is None or not (matched[2] or matched[3]):
        return None
    return float(matched[1]), (matched[3] or '').strip()


def unit_meant(value: float, unit: str, upper: float) -> str:
    """Hint for a number beyond ``upper`` [unit] that fits in another unit, for example 63 m for 63 mm; else empty."""
    units = QUANTITIES[QUANTITY_OF[unit]] if unit in QUANTITY_OF else (unit,)
    found = next((other for other in units if UNITS.get(other, 1.0) < 1.0 and abs(value) * UNITS[other] <= upper), '')
    return f'; if it is in {found}, write {value:g} {found}' if unit == units[0] and found else ''


_SPELLED = {unit.lower(): unit for unit in UNITS if len(unit) > 1} | {
    'psig': 'psi', 'psia': 'psi', 'barg': 'bar', 'bara': 'bar', 'lbs': 'lbf', 'lb': 'lbf', 'sec': 's', 'seconds': 's',
    'msec': 'ms', 'inch': 'in', '°c': 'degC', 'c': 'degC', 'µs': 'us', 'µm': 'um', 'm/s²': 'm/s2', 'mm/s²': 'mm/s2',
}  # fmt: skip


def unit_named(heading: str) -> str:
    """Unit in the heading of a column: ``P (bar)``, ``Spd[in/s]``, ``x_mm``, ``velocity_mm_per_s``; empty without."""
    words = re.split(r'[\s\[({_]+', heading.replace('_per_', '/').strip().rstrip(')]}'))
    found = (word if word in UNITS else _SPELLED.get(word.lower(), '') for word in words[:0:-1] if word != '1')
    return next(filter(None, found), '')
