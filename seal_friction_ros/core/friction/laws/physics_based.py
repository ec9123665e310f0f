"""Coulomb friction from geometry, normal force and coefficient of friction."""

from dataclasses import dataclass

from seal_friction_ros.core.foundation.compiled import Bound, evaluate
from seal_friction_ros.core.friction.geometry import SealGeometry, projected_area
from seal_friction_ros.core.friction.laws.friction_coefficient import FrictionCoefficientLaw, PowerLaw
from seal_friction_ros.core.friction.laws.law import FrictionLaw
from seal_friction_ros.core.friction.laws.normal_force import NormalForceLaw


def physics_based(
    normal_force_law: Bound, friction_coefficient_law: Bound, projected_area: float, pressure: float, _speed: float
) -> float:
    """f_c = mu(F_n) F_n with F_n(P, A_r) [N]."""
    normal_force = evaluate(normal_force_law, pressure, projected_area)
    return evaluate(friction_coefficient_law, normal_force, 0.0) * normal_force


@dataclass(frozen=True)
class PhysicsBased(FrictionLaw):
    """Coulomb friction from geometry, normal force and coefficient of friction: f_c = mu(F_n) F_n.

    Source: thesis, chapter 7.
    """

    NAME = 'physics_based'
    FORMULA = 'mu(F_n) F_n'
    function = staticmethod(physics_based)
    FITTED_PART = ('friction_coefficient_law', PowerLaw)

    geometry: SealGeometry
    normal_force_law: NormalForceLaw
    friction_coefficient_law: FrictionCoefficientLaw

    @property
    def projected_area(self) -> float:
        """Area the pressure acts on in axial direction [m^2]."""
        return projected_area(self.geometry)
