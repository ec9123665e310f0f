"""The friction laws of a seal, one file a law, and their registry."""

from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.contact_shear import ContactShear
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.laws.law import FrictionLaw
from seal_friction_ros.core.friction.laws.physics_based import PhysicsBased
from seal_friction_ros.core.friction.laws.pressure_power_law import PressurePowerLaw
from seal_friction_ros.core.friction.laws.prior_art_chart import PriorArtChart

FRICTION_LAWS: list[type[FrictionLaw]] = [
    ConstantCoulomb, PressurePowerLaw, PhysicsBased, PriorArtChart, ContactShear, FrictionMap]  # fmt: skip
"""Every law: seal files, the live node, replay, simulation and identification know a law from here."""
