"""Friction against speed and pressure as a table that the live estimate can afford.

The table is the steady sliding friction. Two lengths say how it lags: over ``memory_length`` of sliding the film
follows a change of speed, F' = (F_steady - F) / memory_length; over ``presliding_length`` the spool moves
before the seal does.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from seal_friction_ros.core.foundation.parameters import check, parameter


@dataclass(frozen=True)
class FrictionMap:
    """Coulomb friction of one seal from a table over speed and pressure.

    Between the points the table is linear in pressure and in the logarithm of the speed, beyond its ends constant. The
    law without a velocity is the table at ``reference_speed``.

    Raises:
        ValueError: The table is not of the size of its axes, or an axis does not increase.
    """

    speeds: tuple[float, ...] = parameter(unit='m/s', lower=1e-9, upper=1e3, description='Increasing, in equal ratios.')
    pressures: tuple[float, ...] = parameter(unit='Pa', lower=0.0, upper=1e9, description='Gauge, increasing.')
    frictions: tuple[float, ...] = parameter(
        unit='N', lower=0.0, upper=1e6, description='Pressure by pressure, one for each speed.'
    )
    reference_speed: float = parameter(unit='m/s', lower=1e-9, upper=1e3, description='Speed of the plain Coulomb law.')
    memory_length: float = parameter(
        0.0, unit='m', lower=0.0, upper=10.0, description='Sliding over which friction follows a change of speed.'
    )
    presliding_length: float = parameter(
        0.0,
        unit='m',
        lower=0.0,
        upper=1.0,
        description='Way of the rod before the seal slides.',
    )
    _rows: tuple[tuple[float, ...], ...] = field(init=False, repr=False, compare=False)
    _start: float = field(init=False, repr=False, compare=False)
    _rate: float = field(init=False, repr=False, compare=False)
    _at_reference: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check(self)
        n = len(self.speeds)
        if n < 2 or len(self.pressures) < 2 or len(self.frictions) != n * len(self.pressures):
            raise ValueError(
                f'FrictionMap.frictions has {len(self.frictions)} values '
                f'for {n} speeds and {len(self.pressures)} pressures'
            )
        for name in ('speeds', 'pressures'):
            values = getattr(self, name)
            if any(b <= a for a, b in pairwise(values)):
                raise ValueError(f'FrictionMap.{name} = {list(values)} does not increase')
        start, end = math.log(self.speeds[0]), math.log(self.speeds[-1])
        even = np.linspace(start, end, n)
        if not np.allclose(np.log(self.speeds), even, atol=1e-3 * (end - start) / n, rtol=0.0):
            raise ValueError('FrictionMap.speeds are not in equal ratios')
        rows = tuple(self.frictions[i * n : (i + 1) * n] for i in range(len(self.pressures)))
        object.__setattr__(self, '_rows', rows)
        object.__setattr__(self, '_start', start)
        object.__setattr__(self, '_rate', (n - 1) / (end - start))
        at_reference = tuple(self.sliding_friction(p, self.reference_speed) for p in self.pressures)
        object.__setattr__(self, '_at_reference', at_reference)

    def sliding_friction(self, pressure: float, speed: float) -> float:
        """Magnitude of the steady sliding friction [N] at ``pressure`` [Pa, gauge] and ``speed`` [m/s, >= 0]."""
        speeds = self.speeds
        j, along = 0, 0.0
        if speed >= speeds[-1]:
            j, along = len(speeds) - 2, 1.0
        elif speed > speeds[0]:
            column = (math.log(speed) - self._start) * self._rate
            j = min(int(column), len(speeds) - 2)
            along = column - j
        i, across = self._between_pressures(pressure)
        low, high = self._rows[i], self._rows[i + 1]
        at_low = low[j] + along * (low[j + 1] - low[j])
        at_high = high[j] + along * (high[j + 1] - high[j])
        return at_low + across * (at_high - at_low)

    def coulomb_friction(self, pressure: float) -> float:
        """Magnitude of the sliding friction [N] at ``pressure`` [Pa, gauge] and the reference speed."""
        i, across = self._between_pressures(pressure)
        low = self._at_reference[i]
        return low + across * (self._at_reference[i + 1] - low)

    def added(self, coulomb_friction: float, pressure: float, velocity: float) -> float:
        """Magnitude [N] that sliding at ``velocity`` [m/s] has above ``coulomb_friction`` [N]; 0 at rest."""
        return self.sliding_friction(pressure, abs(velocity)) - coulomb_friction if velocity else 0.0

    def _between_pressures(self, pressure: float) -> tuple[int, float]:
        """Row below ``pressure`` [Pa] in the table, and the share of the way to the next."""
        pressures = self.pressures
        if pressure >= pressures[-1]:
            return len(pressures) - 2, 1.0
        if pressure <= pressures[0]:
            return 0, 0.0
        i = bisect_right(pressures, pressure) - 1
        return i, (pressure - pressures[i]) / (pressures[i + 1] - pressures[i])

    def lagged(self, friction: float, pressure: float, speed: float, way: float) -> float:
        """Friction [N] after sliding on by ``way`` [m] at ``speed`` [m/s], when it was ``friction`` [N] before."""
        steady = self.sliding_friction(pressure, speed)
        if self.memory_length == 0.0:
            return steady
        return steady + (friction - steady) * math.exp(-way / self.memory_length)
