r"""Friction of a seal over its temperature, as a scale on all friction.

.. math:: s(T) = e^{-k (T - T_0)}

Source: the viscosity of a lubricant falls with temperature like this over some tens of kelvin, [Reynolds1886]_. That
the whole friction follows one exponential, boundary friction and breakaway included, is our choice: over the 10 to 60 K
that a machine sees, data do not tell it from Arrhenius' law. Outside the identified temperatures the scale stays at its
value at their end (our choice), since an exponential has no bound.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter

MARGIN = 1.0  # [K] our choice: up to this far outside its ends a temperature counts as identified
COLDEST, HOTTEST = 150.0, 600.0  # [K] no rubber seal works beyond


@dataclass(frozen=True, kw_only=True)
class TemperatureScale(CheckedParameters):
    """The part ``temperature`` of a seal file.

    ValueError: a value is out of bounds, or the reference is not within the identified temperatures.
    """

    reference: float = parameter(
        unit='K', lower=COLDEST, upper=HOTTEST, description='T_0, at which the law holds as it is.'
    )
    coefficient: float = parameter(
        unit='1/K', lower=-0.1, upper=0.1, description='k: share of the friction that 1 K takes away.'
    )
    coefficient_std: float = parameter(unit='1/K', lower=0.0, upper=0.1, description='Standard deviation of k.')
    lowest: float = parameter(unit='K', lower=COLDEST, upper=HOTTEST, description='Lowest temperature identified.')
    highest: float = parameter(unit='K', lower=COLDEST, upper=HOTTEST, description='Highest temperature identified.')

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.lowest <= self.reference <= self.highest:
            raise ValueError(
                f'TemperatureScale.reference = {self.reference} K is not between lowest = {self.lowest} K and '
                f'highest = {self.highest} K'
            )


NO_SCALE = TemperatureScale(reference=300.0, coefficient=0.0, coefficient_std=0.0, lowest=300.0, highest=300.0)
"""Of seals whose friction is not known to depend on the temperature."""


@compilable
def std_of_unknown(law: TemperatureScale) -> float:
    """Relative standard deviation [-] of the friction at a temperature anywhere within the identified ones."""
    return abs(law.coefficient) * (law.highest - law.lowest) / math.sqrt(12.0)


@compilable
def scale_at(law: TemperatureScale, temperature: float) -> float:
    """Friction at ``temperature`` [K] over that at the reference [-], see the equation above."""
    used = between(law.lowest, temperature, law.highest)
    return math.exp(-law.coefficient * (used - law.reference))


@compilable
def is_identified_at(law: TemperatureScale, temperature: float) -> bool:
    """Whether the scale was identified at ``temperature`` [K], up to `MARGIN`."""
    return law.lowest - MARGIN <= temperature <= law.highest + MARGIN


def one_temperature_scale(scales: Iterable[TemperatureScale | None]) -> TemperatureScale | None:
    """The scale of an actuator from those of its seals; None if no seal has one.

    ValueError: two seals differ, or only some have one: one temperature scales the friction of all.
    """
    different = list(dict.fromkeys(scales))
    if len(different) > 1:
        raise ValueError(
            'the seals of an actuator have different temperature parts, or only some have one: give all seal files '
            'the same, or none'
        )
    return different[0] if different else None
