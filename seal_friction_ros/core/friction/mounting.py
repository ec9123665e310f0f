"""Where the seals of an actuator sit: the pressure that each of them sees."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter

CHAMBERS = ('a', 'b', 'difference', 'ambient')
"""What a seal can see: the pressure of chamber a or b (rod seal), the difference of the two without its sign (piston
seal), or 0 Pa (wiper)."""
CHAMBERS_TEXT = 'a, b, difference or ambient'
_A, _B, _DIFFERENCE = (CHAMBERS.index(name) for name in ('a', 'b', 'difference'))


@dataclass(frozen=True)
class Mounting(CheckedParameters):
    """How a seal file says that its seals are mounted.

    ValueError: there is no chamber, or one that is not in `CHAMBERS`.
    """

    chambers: tuple[str, ...] = parameter(
        unit='', description=f'Chamber that each seal of this kind sees, one entry a seal: {CHAMBERS_TEXT}.'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.chambers:
            raise ValueError('Mounting.chambers is empty: give one chamber a seal')
        check_chambers('Mounting.chambers', self.chambers)


def check_chambers(where: str, chambers: Sequence[str]) -> None:
    """Check that every chamber is one of `CHAMBERS`; ``where`` names them in the error message.

    ValueError: one is not; the message names it.
    """
    wrong = [chamber for chamber in chambers if chamber not in CHAMBERS]
    if wrong:
        raise ValueError(f'{where} = {list(chambers)}: {wrong[0]!r} is not {CHAMBERS_TEXT}')


@compilable
def pressure_at_seal(chamber: int, pressure_a: Any, pressure_b: Any) -> Any:
    """Pressure that a seal sees, its chamber an index in `CHAMBERS`; pressures in [Pa, gauge], numbers or arrays.

    A piston seal sees |p_a - p_b|: it seals both ways alike (our choice).
    """
    if chamber == _A:
        return pressure_a
    if chamber == _B:
        return pressure_b
    if chamber == _DIFFERENCE:
        return abs(pressure_a - pressure_b)
    return 0.0


@compilable
def pressed_out(chamber: int, pressure_a: float, pressure_b: float) -> float:
    """1 where the pressure of a seal drives the rod out, -1 where it drives it in, 0 where there is none.

    A seal moves towards its pressure where the rod moves against it: its piston, or out of its rod chamber the rod.
    Arguments as of `pressure_at_seal`.
    """
    if chamber == _A:
        return 1.0
    if chamber == _B:
        return -1.0
    if chamber != _DIFFERENCE or pressure_a == pressure_b:
        return 0.0
    return 1.0 if pressure_a > pressure_b else -1.0


def pressures_at_seals(chambers: Sequence[str], pressure_a: FloatArray, pressure_b: FloatArray) -> FloatArray:
    """Pressure that each seal sees [Pa, gauge], shape (n, number of seals), from those of both chambers, shape (n,)."""
    seen = (pressure_at_seal(CHAMBERS.index(chamber), pressure_a, pressure_b) for chamber in chambers)
    return np.column_stack([np.broadcast_to(pressure, pressure_a.shape) for pressure in seen])
