r"""Air through the gap that opens at a control edge: why a control edge is computed without air pressure only.

Two laws bound the mass flow per length of circumference. Viscous: isothermal, compressible, slow; the square of the
pressure is linear in the resistance of the gap,

.. math:: m_v = \frac{p_1^2 - p_2^2}{24\, \eta\, R\, T \int h^{-3} \mathrm{d}x}

Choked: a frictionless nozzle with the speed of sound in its throat, at its narrowest gap,

.. math:: m_c = h_{min}\, p_1 \sqrt{\frac{\gamma}{R T}}\,
    \left(\frac{2}{\gamma + 1}\right)^{\frac{\gamma + 1}{2 (\gamma - 1)}}

The smaller one is nearer to the truth: above the gap at which they are equal, a film equation for the air is wrong. The
Reynolds number with the hydraulic diameter 2 h is :math:`2 m / \eta`. Grease that fills the gap is driven by the
pressure over its effective length :math:`L = h_{min}^3 \int h^{-3} \mathrm{d}x` with the mean velocity
:math:`h_{min}^2 \Delta p / (12 \eta_g L)`; above the sliding speed it is blown out.

Source: B. J. Hamrock, S. R. Schmid, B. O. Jacobson: Fundamentals of fluid film lubrication, 2004 (gas-lubricated
bearings); ISO 6358-1 for the choked flow. The comparison of velocities is our choice.
"""

import math
from typing import NamedTuple

import numpy as np

ATMOSPHERE = 101_325.0
"""[Pa]"""
_GAS_CONSTANT, _TEMPERATURE, _VISCOSITY = 287.05, 293.15, 1.82e-5  # of air [J/(kg K)], [K], [Pa s]
_RATIO = 1.4  # of specific heats, gamma
_CRITICAL = (2.0 / (_RATIO + 1.0)) ** (_RATIO / (_RATIO - 1.0))  # pressure ratio at which the throat is choked


class BlowBy(NamedTuple):
    """Flow through an open gap."""

    viscous: float  # [kg/(m s)]
    choked: float  # [kg/(m s)]; infinite where the pressure ratio is too small to choke
    reynolds_number: float  # of the smaller one
    blow_out: float  # velocity of grease that fills the gap over the sliding speed

    @property
    def is_choked(self) -> bool:
        """Whether the viscous law would pass more than the speed of sound allows."""
        return self.viscous > self.choked


def blow_by(gap: np.ndarray, cell_width: float, pressure: float, grease_viscosity: float, speed: float) -> BlowBy:
    """Flow under a gauge ``pressure`` [Pa] on one side.

    Args:
        gap: Open gap along the wall [m], above zero, shape (n,).
        cell_width: [m]
        pressure: Gauge, the other side being at ambient pressure [Pa], above zero.
        grease_viscosity: Of grease that may fill the gap [Pa s].
        speed: Sliding speed [m/s].
    """
    high, throat = ATMOSPHERE + pressure, float(gap.min())
    resistance = float((gap**-3).sum()) * cell_width
    heat = _GAS_CONSTANT * _TEMPERATURE
    viscous = (high**2 - ATMOSPHERE**2) / (24.0 * _VISCOSITY * heat * resistance)
    sonic = throat * high * math.sqrt(_RATIO / heat) * _CRITICAL ** ((_RATIO + 1.0) / (2.0 * _RATIO))
    choked = sonic if ATMOSPHERE / high <= _CRITICAL else math.inf
    driven = throat**2 * pressure / (12.0 * grease_viscosity * throat**3 * resistance)
    return BlowBy(viscous, choked, 2.0 * min(viscous, choked) / _VISCOSITY, driven / speed)
