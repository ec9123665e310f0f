"""Why the force sum may show another friction than the law: what the last strokes tell, in words.

Each reason is told from the data, in this order: a force sum that does not follow the motion, a wrong sign, a pressure
in another unit, an area of the force sum that is off, another seal. All thresholds are our choice.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from statistics import fmean, median, pstdev
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.adaptation import Stroke, can_be_compared, ratio_of
from seal_friction_ros.core.foundation.units import UNITS
from seal_friction_ros.core.friction.actuator import SealNumbers, friction_of_seals
from seal_friction_ros.core.friction.mounting import pressure_at_seal

FROZEN = 0.05  # [-] a share of the friction below this is none
PRESSURE_UNITS = {name: UNITS[name] for name in ('psi', 'bar', 'kPa', 'MPa')}  # [Pa]
IMPLAUSIBLE = 0.01  # [-] of the highest identified pressure, below which a unit may be wrong
EXPLAINED = 1.3  # [-] a unit explains the friction up to this factor: one day differs as much from another
BEYOND = 1.5  # [-] of the highest identified pressure, up to which one below the lowest may be in another unit
HALF = 0.06  # [-] how near to the friction or twice of it counts as such; to a half, if the seal file states less
HALVED = 0.7  # [-] a ratio above it is nearer to 1 than to a half
FEWEST_REVERSALS = 3  # that tell a fault
LAST = 12  # reversals that tell the ratio; older ones tell an area
FEWEST_STROKES = 6  # for a line of the offset over the pressure
STRAIGHT = 0.95  # [-] least correlation of that line


class Reversal(NamedTuple):
    """What the two strokes about a reversal show."""

    stamp: int  # [ns]
    ratio: float  # [-] friction over that of the law
    friction: float  # [N] of the law
    offset: float  # [N] mean of both directions
    pressure_a: float  # [Pa, gauge] mean of the later stroke
    pressure_b: float  # [Pa, gauge]


def reversal_between(before: Stroke, after: Stroke, pressure_a: float, pressure_b: float) -> Reversal | None:
    """The reversal between two strokes, the later one at these pressures [Pa]; None if they do not show friction."""
    if not can_be_compared(before, after) or before.friction + after.friction <= 0.0:
        return None
    ratio = ratio_of(before, after)
    offset = after.reading - after.direction * ratio * after.friction
    return Reversal(after.stamp, ratio, after.friction, offset, pressure_a, pressure_b)


def likely_reason(seals: tuple[SealNumbers, ...], reversals: Sequence[Reversal]) -> str:
    """The likely reason why the friction of the last reversals is not that of the law, as a clause; '' if it is.

    Args:
        seals: Of the estimator.
        reversals: The last ones, in order of time.
    """
    if not reversals:
        return ''
    fault = input_fault(seals, reversals) or _area_error(reversals)
    if fault:
        return fault
    newest = reversals[-1]
    ratio = median(reversal.ratio for reversal in reversals[-LAST:])
    if abs(ratio - 1.0) < HALF:
        return ''
    law = friction_of_seals(seals, newest.pressure_a, newest.pressure_b, 0.0)
    stated = max(2.0 * law.coulomb_friction_std / law.coulomb_friction, HALF) if law.coulomb_friction > 0.0 else HALF
    shown = f'the force sum shows {ratio:.2f} times the friction of the seal file'
    if (abs(2.0 * ratio - 1.0) < stated and ratio < HALVED) or abs(0.5 * ratio - 1.0) < HALF:
        return f'{shown}: is an area in it halved or doubled? Else it is another seal, or it has changed'
    return f'{shown}: another seal, or it has changed'


def input_fault(seals: tuple[SealNumbers, ...], reversals: Sequence[Reversal]) -> str:
    """Clause on an input that no seal explains: frozen, of the wrong sign or unit; '' if there is none.

    It holds outside the identified pressures, too, where the law itself says little.
    """
    recent = reversals[-LAST:]
    if len(recent) < FEWEST_REVERSALS:
        return ''
    ratio = median(reversal.ratio for reversal in recent)
    if abs(ratio) < FROZEN:
        return 'the force sum does not follow the motion: is its sensor frozen or not connected?'
    if ratio < 0.0:
        return 'the friction drives: the sign of the velocity or of the force sum is wrong'
    unit = _unit(seals, recent)
    return f'the pressure looks like {unit}, not Pa' if unit else ''


def _unit(seals: tuple[SealNumbers, ...], reversals: Sequence[Reversal]) -> str:
    """Unit in which the pressures explain the friction, if they are too small to be Pa.

    Below the identified pressures the unit that takes them inside is enough, if it does not contradict the friction.
    """
    highest = min(seal.pressure_high for seal in seals)
    lowest = max(seal.pressure_low for seal in seals)
    if not math.isfinite(highest):
        return ''
    pairs = [(reversal.pressure_a, reversal.pressure_b) for reversal in reversals]
    largest = max(abs(pressure_at_seal(seal.chamber, *pair)) for seal in seals for pair in pairs)
    if largest > IMPLAUSIBLE * highest or largest == 0.0:
        return ''

    def laws(factor: float) -> list[float]:
        """Friction by the law with pressures times ``factor``: mean of the strokes before and after each reversal."""
        each = [friction_of_seals(seals, a * factor, b * factor, 0.0).coulomb_friction for a, b in pairs]
        return [0.5 * (before + after) for before, after in pairwise(each)]

    as_given = laws(1.0)

    def miss(factor: float) -> float:
        """Misfit of that law with the friction shown: its scatter, and its mean beyond `EXPLAINED`.

        What speed adds to the law is taken from the law at the pressures as given.
        """
        ratios = [
            reversal.ratio * reversal.friction / max(law + reversal.friction - given, 1e-9)
            for reversal, law, given in zip(reversals[1:], laws(factor), as_given, strict=True)
        ]
        if min(ratios) <= 0.0:
            return math.inf
        logs = [math.log(ratio) for ratio in ratios]
        return math.hypot(pstdev(logs), max(abs(fmean(logs)) - math.log(EXPLAINED), 0.0))

    most = highest if largest >= lowest else BEYOND * highest
    inside = [name for name, factor in PRESSURE_UNITS.items() if lowest <= largest * factor <= most]
    misses = {name: miss(PRESSURE_UNITS[name]) for name in inside}
    best = min(misses, key=lambda name: misses[name], default='')
    if not best:
        return ''
    if largest < lowest:
        return best if misses[best] < math.log(2.0) else ''
    return best if misses[best] < 0.5 * miss(1.0) else ''


def _area_error(reversals: Sequence[Reversal]) -> str:
    """Clause on an area, if the offset of the force sum is a line over a pressure."""
    if len(reversals) < FEWEST_STROKES:
        return ''
    offsets = np.array([reversal.offset for reversal in reversals])
    friction = median(abs(reversal.ratio) * reversal.friction for reversal in reversals)
    if np.ptp(offsets) < friction:
        return ''
    pressures = np.array([(reversal.pressure_a, reversal.pressure_b) for reversal in reversals])
    for name, pressure in (
        ('a', pressures[:, 0]),
        ('b', pressures[:, 1]),
        ('a less b', pressures[:, 0] - pressures[:, 1]),
    ):
        if np.ptp(pressure) > 0.0 and abs(np.corrcoef(pressure, offsets)[0, 1]) > STRAIGHT:
            slope = float(np.polyfit(pressure, offsets, 1)[0])
            return (
                f'the offset of the force sum follows the pressure of chamber {name}: an area in it is off by '
                f'{slope * 1e6:.4g} mm2'
            )
    return ''
