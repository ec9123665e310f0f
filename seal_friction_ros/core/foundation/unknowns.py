"""Numbers of a case that are not known exactly: the part ``unknown`` of a case file.

Example; each name is that of a number in the file, each value has one of the four kinds::

    unknown:
      seal.solid_shear_stress: {factor: 2.0}              # from half to double
      topography.rms_height: {relative_std: 0.5}
      geometry.section_diameter: {tolerance: 0.08e-3}     # [m] either side
      wall_friction: {range: [0.0, 0.05]}
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtri

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.parameters import check_names, printable

KINDS = {'relative_std': 1, 'factor': 1, 'tolerance': 1, 'range': 2}  # Numbers that each kind of spread has.
_MOST = {'relative_std': 10.0, 'factor': 1000.0}
_LARGEST = 1e15  # of any amount
_ENDS = np.array([0.005, 0.995])  # shares at which a case has to be possible (our choice)


@dataclass(frozen=True)
class Unknown:
    r"""How a number x of a case, in the case x_0, is distributed; u is uniform between 0 and 1.

    .. math::
        \text{relative\_std: } & x = x_0 e^{s \Phi^{-1}(u)},\ s^2 = \ln(1 + a^2) \\
        \text{factor: } & x = x_0 a^{2 u - 1} \\
        \text{tolerance: } & x = x_0 + a (2 u - 1) \\
        \text{range: } & x = a + (b - a) u

    So a ``relative_std`` is log-normal with the median x_0, the others are uniform, a ``factor`` in the logarithm (our
    choice). ValueError: the kind has other numbers, or x_0 is not positive where the spread is relative to it.
    """

    name: str  # dotted, for example ``rubber.hardness``
    value: float  # x_0, in the unit of the number
    kind: str
    amounts: tuple[float, ...]  # a, or a and b

    def __post_init__(self) -> None:
        first, last = self.amounts[0], self.amounts[-1]
        if self.kind == 'range' and first >= last:
            raise ValueError(f'{self.name}: range [{first:g}, {last:g}] does not go from a lower to a higher value')
        least = {'range': -math.inf, 'factor': 1.0}.get(self.kind, 0.0)
        if first <= least:
            raise ValueError(f'{self.name}: {self.kind} = {first:g} is not above {least:g}')
        if first > (most := _MOST.get(self.kind, math.inf)):
            raise ValueError(f'{self.name}: {self.kind} = {first:g} is above {most:g}')
        if self.kind in ('relative_std', 'factor') and self.value <= 0.0:
            raise ValueError(f'{self.name} is {self.value:g} in the case: give it a range instead of a {self.kind}')

    def at(self, share: FloatArray) -> FloatArray:
        """Values below which a ``share`` u of all lies, between 0 and 1 and neither of them."""
        amount = self.amounts[0]
        if self.kind == 'range':
            return amount + (self.amounts[1] - amount) * share
        if self.kind == 'tolerance':
            return self.value + amount * (2.0 * share - 1.0)
        if self.kind == 'factor':
            return np.asarray(self.value * amount ** (2.0 * share - 1.0))
        return np.asarray(self.value * np.exp(math.sqrt(math.log1p(amount**2)) * ndtri(share)))

    @property
    def ends(self) -> tuple[float, float]:
        """Values below and above which 0.5 % of all lie."""
        low, high = self.at(_ENDS).tolist()
        return low, high


def parse_unknowns(
    values: Any, known: Mapping[str, float], vary: Callable[[Mapping[str, float]], Any], where: str
) -> tuple[Unknown, ...]:
    """Unknowns of a case file from its untrusted mapping of names to spreads; ``where`` names it in error messages.

    ``known`` has the value in the case of each number that may be unknown. ``vary`` makes the case with other values;
    ValueError if there is no such case. ValueError: a name or a spread is invalid, or there is no case at one of its
    `Unknown.ends`; one line.
    """
    if not isinstance(values, Mapping) or not values:
        raise ValueError(f'{where} is not a mapping of names to spreads but {values!r}')
    check_names(values, known, where)
    with named_errors(where):
        unknowns = tuple(Unknown(name, known[name], *_spread(name, spread)) for name, spread in values.items())
    for name, end in ((unknown.name, end) for unknown in unknowns for end in unknown.ends):
        with named_errors(f'{where}: {name} = {end:.6g}'):
            vary({name: end})
    return unknowns


def _spread(name: str, spread: Any) -> tuple[str, tuple[float, ...]]:
    if not isinstance(spread, Mapping) or len(spread) != 1 or next(iter(spread)) not in KINDS:
        raise ValueError(f'{name} = {printable(spread)} is none of {", ".join(f"{{{kind}: ...}}" for kind in KINDS)}')
    ((kind, given),) = spread.items()
    amounts = given if isinstance(given, list) else [given]
    if len(amounts) != KINDS[kind] or not all(type(amount) in (int, float) for amount in amounts):
        wanted = 'one number' if KINDS[kind] == 1 else 'a list of two numbers'
        raise ValueError(f'{name}: {kind} = {printable(given)} is not {wanted}')
    if not all(abs(amount) <= _LARGEST for amount in amounts):
        raise ValueError(f'{name}: {kind} is not finite, or above {_LARGEST:g}')
    return kind, tuple(map(float, amounts))
