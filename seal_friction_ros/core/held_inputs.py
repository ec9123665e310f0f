"""The newest pressure and force sum, held until the next velocity sample triggers an estimate."""

from typing import NamedTuple

from seal_friction_ros.core.records import Force, Pressure, RodSample


class HeldInputs(NamedTuple):
    """Newest samples; None before the first."""

    pressure: Pressure | None = None
    force: Force | None = None

    def rod_sample(self, stamp: int, velocity: float) -> RodSample:
        """Velocity sample at ``stamp`` [ns] of ``velocity`` [m/s], with what is held."""
        return RodSample(stamp, velocity, self.pressure, self.force)
