"""Axial force of the groove on the seal: a spring, or two stable positions with an unstable one between them."""

from dataclasses import dataclass

from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True)
class GrooveSpring(CheckedParameters):
    r"""Force of the spool on the seal over the lag e of the contact behind the spool.

    .. math:: F(e) = k (|e| - c)\,\mathrm{sgn}(e)\ (|e| \ge c),\quad F(e) = \tfrac{k}{2} e (e^2 / c^2 - 1)\ (|e| < c)

    With an axial clearance 2 c the seal can lean on either flank of the groove: two stable positions at e = -c and c
    and an unstable one at 0, as the spool-valve paper describes (section 7.1). The cubic between them is our choice:
    the simplest that joins the springs with their slope. Both numbers are ours: the paper's geometry is not public.
    """

    stiffness: float = parameter(
        2.2e4,
        unit='N/m',
        lower=10.0,
        upper=1e9,
        description='k, about G A / t: shear modulus, contact area and height of the seal.',
    )
    half_clearance: float = parameter(
        0.0, unit='m', lower=0.0, upper=1e-2, description='c, half the axial clearance; 0 is a plain spring.'
    )

    def force(self, lag: float) -> float:
        """Force [N] on the seal in the direction of the spool's lead at a ``lag`` [m]."""
        clearance = self.half_clearance
        if abs(lag) >= clearance:
            return self.stiffness * (lag - clearance if lag > 0.0 else lag + clearance)
        return 0.5 * self.stiffness * lag * ((lag / clearance) ** 2 - 1.0)
