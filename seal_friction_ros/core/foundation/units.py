"""Units that data are read in and plots are labelled with; everything else is SI (REP-103)."""

import math

INCH = 0.0254  # [m]
LBF = 4.4482216152605  # [N]
PSI = LBF / INCH**2  # [Pa]
BAR, MPA = 1.0e5, 1.0e6  # [Pa]
MM, UM = 1e-3, 1e-6  # [m]
MS = 1e-3  # [s]
DEGREE = math.pi / 180.0  # [rad]

UNITS: dict[str, float] = (
    {'1': 1.0, 's': 1.0, 'ms': MS, 'us': 1e-6, 'ns': 1e-9}
    | {'m': 1.0, 'mm': MM, 'um': UM, 'in': INCH}
    | {'m/s': 1.0, 'mm/s': MM, 'in/s': INCH}
    | {'Pa': 1.0, 'kPa': 1e3, 'MPa': MPA, 'bar': BAR, 'psi': PSI}
    | {'N': 1.0, 'kN': 1e3, 'lbf': LBF}
    | {'m2': 1.0, 'mm2': MM**2, 'in2': INCH**2}
    | {'rad': 1.0, 'deg': DEGREE, 'kg': 1.0, 'N/m': 1.0, 'm/s2': 1.0, 'Hz': 1.0}
    | {'K': 1.0, 'degC': 1.0}
)
"""Name of a unit -> its size in SI."""
ZEROS = {'K': 0.0, 'degC': 273.15}
"""Unit of temperature -> its zero [K]."""

QUANTITIES: dict[str, tuple[str, ...]] = {
    'number': ('1',),
    'time': ('s', 'ms', 'us', 'ns'),
    'length': ('m', 'mm', 'um', 'in'),
    'velocity': ('m/s', 'mm/s', 'in/s'),
    'pressure': ('Pa', 'kPa', 'MPa', 'bar', 'psi'),
    'force': ('N', 'kN', 'lbf'),
    'area': ('m2', 'mm2', 'in2'),
    'angle': ('rad', 'deg'),
    'mass': ('kg',),
    'stiffness': ('N/m',),
    'acceleration': ('m/s2',),
    'frequency': ('Hz',),
    'temperature': ('K', 'degC'),
}
"""Quantity -> its units."""


def unit_size(name: str) -> float:
    """Size in SI of the unit called ``name``, for example 6894.757 [Pa] for ``psi``.

    Raises:
        ValueError: There is no such unit.
    """
    try:
        return UNITS[name]
    except KeyError:
        raise ValueError(f'unknown unit {name!r}: use one of {", ".join(UNITS)}') from None
