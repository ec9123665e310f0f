"""Apparent viscosity of a grease that yields and thins."""

import math
from dataclasses import dataclass

from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True)
class Grease(CheckedParameters):
    """Palacios-Palacios grease: tau = tau_0 + k gamma^n + eta_b gamma. Defaults: Table 1 of the paper.

    A yield stress and an index of 0 make a Newtonian fluid of viscosity ``base_viscosity``.

    Source: J. Palacios, M. Palacios 1984; spool-valve paper, Table 1.
    """

    yield_stress: float = parameter(530.96, unit='Pa', lower=0.0, upper=1e5, description='tau_0.')
    consistency_index: float = parameter(6.7823, unit='Pa s^n', lower=0.0, upper=1e4, description='k.')
    flow_index: float = parameter(0.6327, unit='1', lower=0.05, upper=1.0, description='n.')
    base_viscosity: float = parameter(94.779e-3, unit='Pa s', lower=1e-6, upper=1e3, description='eta_b.')
    shear_rate_floor: float = parameter(
        100.0,
        unit='1/s',
        lower=1e-3,
        upper=1e6,
        description='The grease is never stiffer than at this shear rate (our choice; acts on films at rest only).',
    )

    @property
    def numbers(self) -> tuple[float, float, float, float, float]:
        """The parameters in order of declaration, for compiled functions."""
        return (self.yield_stress, self.consistency_index, self.flow_index, self.base_viscosity, self.shear_rate_floor)


@compiled
def apparent_viscosity(grease: tuple[float, float, float, float, float], shear_rate: float) -> float:
    """Viscosity eta = tau / gamma [Pa s] at ``shear_rate`` [1/s] of either sign, for `Grease.numbers`.

    The rate is floored smoothly, gamma = sqrt(rate^2 + floor^2) (our choice): a yield stress has no viscosity at rest.
    """
    yield_stress, consistency, index, base, floor = grease
    rate = math.sqrt(shear_rate * shear_rate + floor * floor)
    viscosity: float = (yield_stress + consistency * rate**index) / rate + base
    return viscosity
