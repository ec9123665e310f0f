"""Coulomb friction read from the charts of seal catalogues."""

from dataclasses import dataclass
from functools import cached_property

from seal_friction_ros.core.foundation.compiled import Bound, evaluate
from seal_friction_ros.core.foundation.monotone_table import MonotoneTable
from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.friction.geometry import SealGeometry, contact_length, projected_area
from seal_friction_ros.core.friction.laws.law import FrictionLaw


def prior_art_chart(squeeze_part: float, table: Bound, projected_area: float, pressure: float, _speed: float) -> float:
    """F = f_c L_r + f_h(P) A_r [N]; constant above the chart."""
    return squeeze_part + evaluate(table, pressure, 0.0) * projected_area


@dataclass(frozen=True)
class PriorArtChart(FrictionLaw):
    """Coulomb friction read from charts: F = f_c L_r + f_h(P) A_r.

    ValueError: a chart value is out of bounds, or friction falls with pressure.

    Source: thesis, chapter 2 (Tables 1 to 3); monotone interpolation between the chart readings is our choice.
    """

    NAME = 'prior_art_chart'
    FORMULA = 'f_c L_r + f_h(P) A_r'
    PART = 'chart'
    function = staticmethod(prior_art_chart)

    geometry: SealGeometry
    squeeze_friction: float = parameter(
        unit='N/m', lower=0.0, upper=1e6, description='f_c, friction per contact length.'
    )
    pressures: tuple[float, ...] = parameter(
        unit='Pa', lower=0.0, upper=1e9, description='Gauge pressures of the chart, increasing.'
    )
    pressure_frictions: tuple[float, ...] = parameter(
        unit='Pa', lower=0.0, upper=1e9, description='f_h, friction per projected area.'
    )

    def check_together(self) -> None:
        """Check that the friction does not fall with pressure."""
        self.check_rises('pressure_frictions')

    @cached_property
    def table(self) -> MonotoneTable:
        """f_h over pressure."""
        return MonotoneTable(self.pressures, self.pressure_frictions, 'PriorArtChart')

    @property
    def squeeze_part(self) -> float:
        """f_c L_r [N]."""
        return self.squeeze_friction * contact_length(self.geometry)

    @property
    def projected_area(self) -> float:
        """A_r [m^2]."""
        return projected_area(self.geometry)
