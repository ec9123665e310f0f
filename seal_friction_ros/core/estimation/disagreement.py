"""Why the force sum may show another friction than the law: what the last strokes tell, in words.

Each reason is told from the data, in this order: a force sum that does not follow the motion, a wrong sign, a pressure
in another unit, an area of the force sum that is off, another seal. All thresholds are our choice.
"""

import math
from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.adaptation import Learnt
from seal_friction_ros.core.friction.actuator import SealNumbers, friction_of_seals
from seal_friction_ros.core.friction.mounting import pressure_at_seal

FROZEN = 0.05  # [-] a share of the friction below this is none
PRESSURE_UNITS = {'psi': 6894.757, 'bar': 1e5, 'kPa': 1e3, 'MPa': 1e6}  # [Pa]
IMPLAUSIBLE = 0.01  # [-] of the highest identified pressure, below which a unit may be wrong
EXPLAINED = 1.3  # [-] a unit explains the friction up to this factor
HALF = 0.06  # [-] how near to a half or twice the friction counts as such
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


def last_reversal(learnt: Learnt) -> Reversal:
    """The reversal that was learnt from last."""
    level, ratio = learnt.before, learnt.ratios.first
    offset = level.reading - level.direction * ratio * level.friction
    return Reversal(level.stamp, ratio, level.friction, offset, level.pressure_a, level.pressure_b)


def likely_reason(seals: tuple[SealNumbers, ...], reversals: Sequence[Reversal]) -> str:
    """The likely reason why the friction of the last reversals is not that of the law, as a clause; '' if it is.

    Args:
        seals: Of the estimator.
        reversals: The last ones, in order of time.
    """
    if not reversals:
        return ''
    ratio = median(reversal.ratio for reversal in reversals)
    if abs(ratio) < FROZEN:
        return 'the force sum does not follow the motion: is its sensor frozen or not connected?'
    if ratio < 0.0:
        return 'the friction drives: the sign of the velocity or of the force sum is wrong'
    unit = _unit(seals, reversals)
    if unit:
        return f'the pressure looks like {unit}, not Pa'
    area = _area_error(reversals)
    if area:
        return area
    for factor, name in ((0.5, 'half of'), (2.0, 'twice')):
        if abs(ratio / factor - 1.0) < HALF:
            return (
                f'the force sum shows {name} the friction of the seal file: is an area in it halved or doubled? '
                'Else it is another seal'
            )
    return f'the force sum shows {ratio:.2f} times the friction of the seal file: another seal, or it has changed'


def _unit(seals: tuple[SealNumbers, ...], reversals: Sequence[Reversal]) -> str:
    """Unit in which the pressures explain the friction, if they are too small to be Pa."""
    highest = min(seal.pressure_high for seal in seals)
    if not math.isfinite(highest):
        return ''
    newest = reversals[-1]
    pair = newest.pressure_a, newest.pressure_b
    seen = [abs(pressure_at_seal(seal.chamber, *pair)) for seal in seals]
    if max(seen) > IMPLAUSIBLE * highest or max(seen) == 0.0:
        return ''
    misses = {}
    for name, factor in PRESSURE_UNITS.items():
        if max(seen) * factor <= highest:
            law = friction_of_seals(seals, pair[0] * factor, pair[1] * factor, 0.0).coulomb_friction
            misses[name] = abs(math.log(newest.ratio * newest.friction / law)) if newest.ratio > 0.0 < law else math.inf
    as_given = abs(math.log(newest.ratio)) if newest.ratio > 0.0 else math.inf
    best = min(misses, key=lambda name: misses[name], default='')
    return best if best and misses[best] < min(math.log(EXPLAINED), as_given) else ''


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
