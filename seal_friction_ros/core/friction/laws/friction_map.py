"""Friction against speed and pressure as a table that the live estimate can afford.

The table is the steady sliding friction. Two lengths, which act live as `presliding_of_map`: over ``memory_length`` of
sliding the film follows a change of speed, F' = (F_steady - F) / memory_length; over ``presliding_length`` the rod
moves before the seal slides.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.friction.laws.law import FrictionLaw

Column = tuple[float, ...]


def interpolated_friction(
    speeds: Column, pressures: Column, frictions: Column, columns_per_log_speed: float, pressure: float, speed: float
) -> float:
    """Linear in pressure and in the logarithm of the speed, constant beyond the ends of both [N]; one speed: any."""
    columns = len(speeds)
    j, along = 0, 0.0
    next_column = 1 if columns > 1 else 0
    if columns > 1 and speed >= speeds[-1]:
        j, along = columns - 2, 1.0
    elif columns > 1 and speed > speeds[0]:
        column = (math.log(speed) - math.log(speeds[0])) * columns_per_log_speed
        j = int(column)
        j = min(j, columns - 2)
        along = column - j
    i, across = 0, 0.0
    if pressure >= pressures[-1]:
        i, across = len(pressures) - 2, 1.0
    elif pressure > pressures[0]:
        i = bisect_right(pressures, pressure) - 1
        across = (pressure - pressures[i]) / (pressures[i + 1] - pressures[i])
    low, high = i * columns + j, (i + 1) * columns + j
    at_low = frictions[low] + along * (frictions[low + next_column] - frictions[low])
    at_high = frictions[high] + along * (frictions[high + next_column] - frictions[high])
    return at_low + across * (at_high - at_low)


@dataclass(frozen=True)
class FrictionMap(FrictionLaw):
    """Friction of one seal from a table over speed and pressure.

    It is linear in pressure and in the logarithm of the speed, beyond its ends constant.

    ValueError: the table is not of the size of its axes, or an axis does not
    increase.
    """

    NAME = 'friction_map'
    FORMULA = 'table over speed and pressure'
    function = staticmethod(interpolated_friction)

    speeds: tuple[float, ...] = parameter(
        unit='m/s',
        lower=1e-9,
        upper=1e3,
        description='Increasing, in equal ratios; one: the friction does not depend on the speed.',
    )
    pressures: tuple[float, ...] = parameter(unit='Pa', lower=0.0, upper=1e9, description='Gauge, increasing.')
    frictions: tuple[float, ...] = parameter(
        unit='N', lower=0.0, upper=1e6, description='Pressure by pressure, one for each speed.'
    )
    reference_speed: float = parameter(
        unit='m/s', lower=1e-9, upper=1e3, description='Speed at which the friction counts as Coulomb friction.'
    )
    memory_length: float = parameter(
        0.0, unit='m', lower=0.0, upper=10.0, description='Sliding over which friction follows a change of speed.'
    )
    presliding_length: float = parameter(
        0.0, unit='m', lower=0.0, upper=1.0, description='Displacement of the rod before the seal slides.'
    )

    def check_together(self) -> None:
        """Check sizes and axes of the table."""
        n = len(self.speeds)
        if n < 1 or len(self.pressures) < 2 or len(self.frictions) != n * len(self.pressures):
            raise ValueError(
                f'FrictionMap.frictions has {len(self.frictions)} values '
                f'for {n} speeds and {len(self.pressures)} pressures'
            )
        for name in ('speeds', 'pressures'):
            values = getattr(self, name)
            if any(b <= a for a, b in pairwise(values)):
                raise ValueError(f'FrictionMap.{name} = {list(values)} does not increase')
        if n == 1:
            return
        start, end = math.log(self.speeds[0]), math.log(self.speeds[-1])
        even = np.linspace(start, end, n)
        if not np.allclose(np.log(self.speeds), even, atol=1e-3 * (end - start) / n, rtol=0.0):
            raise ValueError('FrictionMap.speeds are not in equal ratios')

    @property
    def depends_on_speed(self) -> bool:
        """Whether the table has more than one speed."""
        return len(self.speeds) > 1

    @property
    def columns_per_log_speed(self) -> float:
        """Columns of the table per unit of the natural logarithm of the speed; 0 with one speed."""
        if len(self.speeds) == 1:
            return 0.0
        return (len(self.speeds) - 1) / (math.log(self.speeds[-1]) - math.log(self.speeds[0]))
