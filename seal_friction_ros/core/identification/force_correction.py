"""Error of an area in the force sum, found from how its offset follows the pressure."""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from seal_friction_ros.core.identification.readings import NARROWEST_PRESSURES, FrictionReadings
from seal_friction_ros.core.identification.signal_preparation import OffsetLine, Signals, offset_line

CONFIDENCE = 0.995  # one-sided, that the offset follows the pressure (our choice)
NOTICED = 0.1  # of the mean friction: a smaller change of the offset over the pressures is left in (our choice)


class ForceCorrection(NamedTuple):
    """Areas that the force sum lacks: area times pressure of each chamber is to be added to it."""

    areas: tuple[float, float]  # [m^2] to be added to those of chambers a and b, with the sign of their force
    is_significant: bool  # whether they are beyond the noise, and large enough to matter
    chamber: str = ''  # a or b, the one under pressure; empty: both areas were fitted together with the friction
    standard_error: float = math.nan  # of the area of this chamber [m^2]
    line: OffsetLine | None = None  # offset of the force sum over its pressure

    @property
    def area(self) -> float:
        """To be added to the area of the one chamber under pressure [m^2]."""
        return sum(self.areas)

    def corrected(self, signals: Signals) -> Signals:
        """Signals whose force sum has the areas corrected; the offset stays, since each source may have its own."""
        change = self.areas[0] * signals.pressure_a + self.areas[1] * signals.pressure_b
        return signals._replace(force_sum=signals.force_sum + change)


def force_correction(readings: FrictionReadings) -> ForceCorrection | None:
    """Area error from a line through the offsets of the force sum over the pressure.

    The offset of a level is half the sum of its two directions, in which friction cancels. A wrong area adds a share of
    the pressure to it; a load cell adds a constant. The area counts as wrong if the slope is beyond the noise of the
    line (t-test at `CONFIDENCE`) and changes the offset by more than `NOTICED` of the friction.
    None for swept logs and manual readings, fewer than three pressures, and if both chambers are under pressure, so
    that it is not known whose area is wrong.
    """
    levels = readings.levels
    if not readings.samples or len(levels) < 3:
        return None
    spans = np.ptp(readings.chamber_pressures, axis=0)
    if np.count_nonzero(spans > NARROWEST_PRESSURES) != 1:
        return None
    number = int(np.argmax(spans))
    pressure = readings.level_means(readings.chamber_pressures[:, number])
    friction, offset = readings.half_ranges
    line = offset_line(pressure, offset)
    freedom = len(levels) - 2
    spread = float(np.sum((pressure - pressure.mean()) ** 2))
    error = line.rms * float(np.sqrt(len(levels) / freedom / spread))
    sure = abs(line.area_error) > float(stdtrit(freedom, CONFIDENCE)) * error
    large = abs(line.area_error) * float(np.ptp(pressure)) > NOTICED * float(friction.mean())
    areas = (-line.area_error, 0.0) if number == 0 else (0.0, -line.area_error)
    return ForceCorrection(areas, bool(sure and large), 'ab'[number], error, line)
