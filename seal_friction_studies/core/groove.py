r"""Axial force of the groove on the seal: a spring, or two stable positions with an unstable one; Coulomb friction."""

from dataclasses import dataclass

from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.lubrication.lubrication_case import SealHold


@dataclass(frozen=True)
class GrooveSpring(SealHold):
    r"""Force of the spool on the seal over the lag e of the contact behind the spool.

    .. math:: F(e) = k (|e| - c)\,\mathrm{sgn}(e)\ (|e| \ge c),\quad F(e) = \tfrac{k}{2} e (e^2 / c^2 - 1)\ (|e| < c)

    With an axial clearance 2 c the seal can lean on either flank of the groove: two stable positions at e = -c and c
    and an unstable one at 0, as the spool-valve paper describes (section 7.1). The cubic between them is our choice:
    the simplest that joins the springs with their slope. Both numbers are ours: the paper's geometry is not public.

    The bottom of the seal lags by :math:`b(s) = s - F(s) / k`, k the shear of the seal between bottom and contact, and
    s the lag at which the seal would be at rest without friction. Coulomb friction of the bottom, at most
    :math:`\mu N`, holds b, and so s, while

    .. math:: |k (e - b) - F(s)| = k |e - s| \le \mu N,\quad \text{force} = k (e - b) = F(s) + k (e - s):

    s follows e through a play of half-width :math:`\mu N / k`. A bottom on a flank cannot move, and s does not matter:
    without clearance the force is k e. The friction takes :math:`\mu N |\mathrm{d}b|` from the motion and never gives.

    Source of the coefficient: spool-valve paper, Table 1, mu_seal-spool = 0.15. Where it acts is our choice: on the
    bottom, whose normal force is taken as that of the contact.
    """

    half_clearance: float = parameter(
        0.0, unit='m', lower=0.0, upper=1e-2, description='c, half the axial clearance; 0 is a plain spring.'
    )
    friction_coefficient: float = parameter(
        0.0,
        unit='1',
        lower=0.0,
        upper=2.0,
        description='mu of the bottom of the seal in its groove (paper: 0.15). Acts only with a clearance.',
    )

    def force(self, lag: float, seat: float | None = None) -> float:
        """Force [N] on the seal in the direction of the spool's lead.

        Args:
            lag: Of the contact, e [m].
            seat: Lag at which it would rest without friction, s [m]; default: ``lag``, as without friction.
        """
        if seat is None:
            seat = lag
        clearance, held = self.half_clearance, self.stiffness * (lag - seat)
        if abs(seat) >= clearance:
            return self.stiffness * (seat - clearance if seat > 0.0 else seat + clearance) + held
        return 0.5 * self.stiffness * seat * ((seat / clearance) ** 2 - 1.0) + held

    def seat(self, before: float, lag: float, normal_force: float) -> float:
        """Lag at rest s [m] once the contact lags by ``lag`` [m] under a ``normal_force`` [N], 0 or more."""
        play = self.friction_coefficient * normal_force / self.stiffness
        return min(max(before, lag - play), lag + play)
