"""Correction of a measured force sum whose areas or zero are wrong, or that holds a load."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True)
class ForceSumCorrection(CheckedParameters):
    """What the measured force sum of a machine lacks, see `corrected_force_sum`."""

    area_a: float = parameter(
        0.0, unit='m2', lower=-1.0, upper=1.0, description='Area of chamber a that the measured force sum lacks.'
    )
    area_b: float = parameter(
        0.0,
        unit='m2',
        lower=-1.0,
        upper=1.0,
        description='The same for chamber b; negative where its pressure pushes the rod in.',
    )
    offset: float = parameter(
        0.0, unit='N', lower=-1e6, upper=1e6, description='Force that it lacks at any pressure: zero of a load cell.'
    )
    contains_load: bool = parameter(
        False,
        unit='',
        description='Whether the measured force sum also holds a load that no sensor measures, as without a load cell.',
    )


NO_CORRECTION = ForceSumCorrection()


@compilable
def corrected_force_sum(correction: ForceSumCorrection, force_sum: Any, pressure_a: Any, pressure_b: Any) -> Any:
    r"""True force sum from the measured one [N] and both pressures [Pa, gauge], numbers or arrays.

    .. math:: \Sigma F = \Sigma F_{measured} + A_a p_a + A_b p_b + F_0

    Source: the force sum is linear in the pressures, so an area or a zero that is wrong gives this. One correction that
    does not change with time is our choice. A load that the force sum contains stays in it.
    """
    return force_sum + correction.area_a * pressure_a + correction.area_b * pressure_b + correction.offset


def measured_force_sum(correction: ForceSumCorrection, force_sum: float, pressure_a: float, pressure_b: float) -> float:
    """Inverse of `corrected_force_sum`: what a simulated machine measures of its true force sum [N]."""
    lacking = correction.area_a * pressure_a + correction.area_b * pressure_b + correction.offset
    return force_sum - lacking


def one_correction(corrections: Iterable[ForceSumCorrection | None]) -> ForceSumCorrection | None:
    """The correction of a machine from those of all its seals, which applies once; None if no seal has one.

    ValueError: two differ.
    """
    different = list(dict.fromkeys(correction for correction in corrections if correction is not None))
    if len(different) > 1:
        raise ValueError(
            f'two seals have different force_sum_correction, {different[0]} and {different[1]}: an actuator has one '
            'force sum, so leave one of them out'
        )
    return different[0] if different else None
