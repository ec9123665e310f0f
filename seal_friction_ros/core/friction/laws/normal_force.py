"""Pressure -> normal force of one seal on the wall it slides on."""

from dataclasses import dataclass
from functools import cached_property

from seal_friction_ros.core.foundation.monotone_table import MonotoneTable
from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.friction.laws.law import Law


@dataclass(frozen=True)
class NormalForceLaw(Law):
    """Normal force of one seal [N] from pressure [Pa, gauge, >= 0] and projected area [m^2]."""

    def normal_force(self, pressure: float, projected_area: float) -> float:
        """Normal force [N] at ``pressure`` [Pa, gauge, >= 0] on ``projected_area`` [m^2]."""
        return self.bound(pressure, projected_area)


def linear_normal_force(
    area_deformation_gain: float, radial_force: float, pressure: float, projected_area: float
) -> float:
    """F_n = G P A_r + F_rad [N]."""
    return area_deformation_gain * (pressure * projected_area) + radial_force


@dataclass(frozen=True)
class AreaDeformationGain(NormalForceLaw):
    """Normal force linear in the axial force: F_n = G F_ax + F_rad with F_ax = P A_r.

    Source: thesis, chapters 6.2 and 7.
    """

    function = staticmethod(linear_normal_force)

    area_deformation_gain: float = parameter(unit='1', lower=0.0, upper=100.0, description='G, slope of F_n over F_ax.')
    radial_force: float = parameter(unit='N', lower=1e-6, upper=1e6, description='F_rad, normal force at no pressure.')


@dataclass(frozen=True)
class NormalForceTable(NormalForceLaw):
    """Normal force by monotone interpolation of computed or measured values over pressure.

    Above the last pressure the normal force rises with the slope that it has there (our choice: rubber under pressure
    behaves as a fluid, so the normal force keeps rising).

    ValueError: fewer than two points, or pressures or forces
    that do not increase, or a force that is not positive.
    """

    pressures: tuple[float, ...] = parameter(
        unit='Pa', lower=0.0, upper=1e9, description='Gauge pressures, increasing.'
    )
    normal_forces: tuple[float, ...] = parameter(
        unit='N', lower=1e-6, upper=1e9, description='Normal force at each pressure, not decreasing.'
    )

    def check_together(self) -> None:
        """Check that the normal force does not fall with pressure."""
        self.check_rises('normal_forces')

    @cached_property
    def table(self) -> MonotoneTable:
        """Normal force over pressure."""
        return MonotoneTable(self.pressures, self.normal_forces, 'NormalForceTable', rises=True)


NORMAL_FORCE_LAWS: dict[str, type[NormalForceLaw]] = {
    'area_deformation_gain': AreaDeformationGain,
    'monotone_table': NormalForceTable,
}
"""Name in a seal file -> law."""
