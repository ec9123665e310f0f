"""Normal force -> coefficient of friction of rubber on a lubricated metal wall."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import linear_regression
from typing import Protocol

from seal_friction_ros.core.foundation.monotone_table import MonotoneTable
from seal_friction_ros.core.foundation.parameters import check, parameter


class FrictionCoefficientLaw(Protocol):
    """A law of the coefficient of friction."""

    def coefficient_of_friction(self, normal_force: float) -> float:
        """Coefficient of dynamic friction [-] at ``normal_force`` [N, > 0]."""
        ...


@dataclass(frozen=True)
class PowerLaw:
    """Coefficient of friction falling as a power of the normal force: mu = c (F_n / 1 N)^-n.

    An elastic contact whose real area grows as F_n^(2/3) gives n = 1/3 [Schallamach1958]_; n < 1 keeps the friction
    itself rising with normal force.

    Raises:
        ValueError: A parameter is out of bounds.
    """

    coefficient: float = parameter(unit='1', lower=1e-6, upper=100.0, description='c, coefficient of friction at 1 N.')
    exponent: float = parameter(unit='1', lower=0.0, upper=0.99, description='n; 0 is a constant coefficient.')

    def __post_init__(self) -> None:
        check(self)

    def coefficient_of_friction(self, normal_force: float) -> float:
        """Coefficient of dynamic friction [-] at ``normal_force`` [N, > 0]."""
        return self.coefficient * math.pow(normal_force, -self.exponent)


@dataclass(frozen=True)
class CoefficientTable:
    """Coefficient of friction by monotone interpolation over normal force, constant beyond both ends.

    Source: thesis, chapter 7 ("mu defined at multiple F_n values") and Figure 18.

    Raises:
        ValueError: Fewer than two points, forces that do not increase, or a coefficient that is not positive.
    """

    normal_forces: tuple[float, ...] = parameter(
        unit='N', lower=0.0, upper=1e9, description='Normal forces, increasing.'
    )
    coefficients: tuple[float, ...] = parameter(
        unit='1', lower=1e-6, upper=100.0, description='Coefficient of friction at each of them.'
    )
    table: MonotoneTable = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check(self)
        table = MonotoneTable(self.normal_forces, self.coefficients, 'CoefficientTable')
        object.__setattr__(self, 'table', table)  # frozen: the only way to keep what was built from the fields

    def coefficient_of_friction(self, normal_force: float) -> float:
        """Coefficient of dynamic friction [-] at ``normal_force`` [N, > 0]."""
        return self.table(normal_force)


def power_law_from_points(normal_forces: Sequence[float], frictions: Sequence[float]) -> PowerLaw:
    """Power law through measured friction, by least squares of log(friction) over log(normal force).

    log f_c = log c + (1 - n) log F_n: relative deviations count alike at every pressure, as the scatter of the
    readings is a share of the reading.

    Args:
        normal_forces: Normal force of each reading [N], shape (n,), n >= 2.
        frictions: Coulomb friction of each reading [N], shape (n,).

    Raises:
        ValueError: The points make no power law (see `PowerLaw`).
    """
    x = [math.log(force) for force in normal_forces]
    y = [math.log(friction) for friction in frictions]
    slope, intercept = linear_regression(x, y)
    return PowerLaw(math.exp(intercept), 1.0 - slope)
