"""Pressure -> normal force of one seal on the wall it slides on."""

from dataclasses import dataclass, field
from typing import Protocol

from seal_friction_ros.core.foundation.monotone_table import MonotoneTable
from seal_friction_ros.core.foundation.parameters import check, parameter


class NormalForceLaw(Protocol):
    """A law of the normal force."""

    def normal_force(self, pressure: float, projected_area: float) -> float:
        """Normal force [N] at ``pressure`` [Pa, gauge, >= 0] on ``projected_area`` [m^2]."""
        ...


@dataclass(frozen=True)
class AreaDeformationGain:
    """Normal force linear in the axial force: F_n = G F_ax + F_rad with F_ax = P A_r.

    Source: thesis, chapters 6.2 and 7.

    Raises:
        ValueError: A parameter is out of bounds.
    """

    area_deformation_gain: float = parameter(unit='1', lower=0.0, upper=100.0, description='G, slope of F_n over F_ax.')
    radial_force: float = parameter(unit='N', lower=1e-6, upper=1e6, description='F_rad, normal force at no pressure.')

    def __post_init__(self) -> None:
        check(self)

    def normal_force(self, pressure: float, projected_area: float) -> float:
        """Normal force [N] at ``pressure`` [Pa, gauge, >= 0] on ``projected_area`` [m^2]."""
        return self.area_deformation_gain * (pressure * projected_area) + self.radial_force


@dataclass(frozen=True)
class NormalForceTable:
    """Normal force by monotone interpolation of computed or measured values over pressure.

    Above the last pressure it goes on with the slope it has there (our choice: rubber under pressure is as good as a
    fluid, so the normal force keeps rising).

    Raises:
        ValueError: Fewer than two points, or pressures or forces that do not increase, or a force that is not positive.
    """

    pressures: tuple[float, ...] = parameter(
        unit='Pa', lower=0.0, upper=1e9, description='Gauge pressures, increasing.'
    )
    normal_forces: tuple[float, ...] = parameter(
        unit='N', lower=1e-6, upper=1e9, description='Normal force at each pressure, not decreasing.'
    )
    table: MonotoneTable = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check(self)
        if list(self.normal_forces) != sorted(self.normal_forces):
            raise ValueError(f'NormalForceTable.normal_forces = {list(self.normal_forces)} N falls with pressure')
        table = MonotoneTable(self.pressures, self.normal_forces, 'NormalForceTable')
        object.__setattr__(self, 'table', table)  # frozen: the only way to keep what was built from the fields

    def normal_force(self, pressure: float, projected_area: float) -> float:
        """Normal force [N] at ``pressure`` [Pa, gauge, >= 0]; ``projected_area`` is in the table already."""
        del projected_area
        beyond = max(pressure - self.pressures[-1], 0.0)
        return self.table(pressure) + self.table.end_slope * beyond
