"""Deflection of the seal surface under pressure: a layer bonded to a rigid base."""

import math

import numpy as np
from scipy.linalg import toeplitz

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.lubrication.elasticity import ElasticBody, influence_of_cells


def bonded_layer(cells: int, cell_width: float, modulus: float, height: float) -> ElasticBody:
    r"""An incompressible layer of ``height`` h [m] on cells of a width [m], bonded to a rigid base.

    A pressure of wave number q deflects it by :math:`2 S(q h) / (E^* q)`, in plane strain without friction,

    .. math:: S(y) = \frac{\sinh 2y - 2y}{\cosh 2y + 1 + 2 y^2}

    so the kernel is that of the half-plane of depth h and a smooth part c,

    .. math:: u(x) = \frac{2}{\pi E^*} \int p(s) \left[\ln\frac{h}{|x - s|} + c\Big(\frac{x - s}{h}\Big)\right] ds,\quad
        c(\xi) = \int_0^\infty \frac{(S(y) - 1) \cos y\xi + e^{-y}}{y}\,dy

    Near the load it is a half-plane of depth :math:`h e^{c(0)}` = 0.377 h. Source: G. Carbone, L. Mangialardi:
    Analysis of the adhesive contact of confined layers by using a Green's function approach, J. Mech. Phys. Solids 56,
    2008, pp. 684-706.
    """
    distance = np.arange(cells)
    smooth = _of_layer(np.asarray(distance * (cell_width / height), dtype=np.float64))
    deep = influence_of_cells(distance, cell_width, modulus, height)
    return ElasticBody(cell_width, modulus, toeplitz(deep + 2.0 * cell_width / (math.pi * modulus) * smooth))


_LARGEST_WAVE_NUMBER = 25.0  # [1/h] S is 1 to the last digit beyond
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def _of_layer(distance: FloatArray) -> FloatArray:
    """Smooth part c of the kernel of a bonded layer, at ``distance`` over its height; Gauss's rule by panels."""
    panels = math.ceil(_LARGEST_WAVE_NUMBER * (1.0 + float(distance[-1])))
    half = 0.5 * _LARGEST_WAVE_NUMBER / panels
    y = ((2.0 * np.arange(panels)[:, None] + 1.0 + _NODES) * half).ravel()
    weights = np.tile(_WEIGHTS * half, panels)
    decay = np.exp(-2.0 * y)
    share = (1.0 - decay**2 - 4.0 * y * decay) / (1.0 + decay**2 + 2.0 * decay * (1.0 + 2.0 * y**2))
    even, odd = (share - 1.0) / y * weights, np.exp(-y) / y * weights
    return np.array([float((even * np.cos(y * xi) + odd).sum()) for xi in distance])
