r"""A long rubber cylinder between two rigid, smooth plates, at finite strain: independent of the finite elements.

Ritz's method: the displacements of a quarter of the unit disc are polynomials over all of it, products of Chebyshev
polynomials up to a total degree, in the symmetry of the two plates. They minimise

.. math:: \int C_{10} (J^{-2/3} I_1 - 3) + C_{01} (J^{-4/3} I_2 - 3) + \tfrac{K}{2} (J - 1)^2\,\mathrm{d}A
    + \tfrac{\kappa}{2} \int \langle y + v - (1 - s) \rangle^2\,\mathrm{d}l

in plane strain, :math:`I_1 = I + 1,\ I_2 = J^2 + I,\ I = F_{ij} F_{ij}`: the rubber of the O-ring, but no mesh, no mean
dilatation and another contact. Method and numbers are our choice.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

BULK_MODULUS = 400.0
"""over Young's modulus, as 2 GPa over 5 MPa"""
PENALTY = 2e3
"""times Young's modulus over the radius"""
STEP = 0.02
"""of the squeeze"""
_C01, _C10 = 1.0 / 30.0, 4.0 / 30.0  # over Young's modulus: C01 / C10 = 0.25 and 2 (C10 + C01) = E / 3
_TURN = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, -1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])


class Disc(NamedTuple):
    """Polynomials at the points of a quarter of the disc, m of them, and of the outline near the plate."""

    gradient: np.ndarray  # of the displacements: u_x, u_y, v_x, v_y by each polynomial, shape (n, 4, m)
    area: np.ndarray  # of each point, shape (n,)
    height: np.ndarray  # y of the points of the outline, shape (k,)
    lift: np.ndarray  # v of them by each polynomial, shape (k, m)
    length: np.ndarray  # of each of them, shape (k,)


def force_per_length(squeeze: float, degree: int) -> float:
    """Force on a plate per length of the cylinder over E d, at a ``squeeze`` (approach of the plates over d)."""
    disc = _disc(degree)
    target = np.tile([1.0, 0.0, 0.0, -1.0], len(disc.area))
    pure_shear = np.linalg.lstsq(disc.gradient.reshape(len(target), -1), target, rcond=None)[0]
    shape, steps = np.zeros(len(pure_shear)), max(1, round(squeeze / STEP))
    for share in np.linspace(0.0, squeeze, steps + 1)[1:]:
        shape = _equilibrium(disc, shape + squeeze / steps * pure_shear, share)
    return float(PENALTY * _depth(disc, shape, squeeze) @ disc.length)  # half a plate and a radius: as a plate and d


def _disc(degree: int) -> Disc:
    points, weights = np.polynomial.legendre.leggauss(degree + 8)
    radius, angle = np.meshgrid(0.5 * (points + 1.0), np.pi / 4.0 * (points + 1.0), indexing='ij')
    area = (np.outer(weights, weights) * np.pi / 8.0 * radius).ravel()
    x, y = (radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()
    (_, u_x, u_y), (_, v_x, v_y) = (_polynomials(x, y, degree, odd) for odd in (1, 0))
    none = np.zeros_like(u_x), np.zeros_like(v_x)
    rows = [np.hstack(pair) for pair in ((u_x, none[1]), (u_y, none[1]), (none[0], v_x), (none[0], v_y))]
    ends = 0.8 * np.linspace(0.0, 1.0, 301) ** 2  # angles from the plate, denser where it touches first
    middle = 0.5 * (ends[1:] + ends[:-1])
    lift, _, _ = _polynomials(np.sin(middle), np.cos(middle), degree, 0)
    lifts = np.hstack((np.zeros((len(middle), u_x.shape[1])), lift))
    return Disc(np.stack(rows, axis=1), area, np.cos(middle), lifts, np.diff(ends))


def _polynomials(x: np.ndarray, y: np.ndarray, degree: int, odd: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values and derivatives by x and y; odd in x and even in y for ``odd`` 1, the reverse for 0."""
    i, j = np.array([(i, j) for i in range(odd, degree + 1, 2) for j in range(1 - odd, degree + 1 - i, 2)]).T
    (t_x, d_x), (t_y, d_y) = (
        (chebyshev.chebvander(z, degree), chebyshev.chebval(z, chebyshev.chebder(np.eye(degree + 1))).T) for z in (x, y)
    )
    return t_x[:, i] * t_y[:, j], d_x[:, i] * t_y[:, j], t_x[:, i] * d_y[:, j]


def _equilibrium(disc: Disc, shape: np.ndarray, squeeze: float) -> np.ndarray:
    """Newton's method; a step is halved until the energy falls."""
    for _ in range(60):
        force, stiffness = _forces(disc, shape, squeeze)
        scale = 1.0 / np.sqrt(np.diag(stiffness))
        scaled = scale * stiffness * scale[:, None] + 1e-13 * np.eye(len(scale))
        change, part = -scale * np.linalg.solve(scaled, scale * force), 1.0
        before = _energy(disc, shape, squeeze)
        while part > 1e-4 and _energy(disc, shape + part * change, squeeze) > before:
            part *= 0.5
        shape = shape + part * change
        if np.abs(disc.lift @ change).max() < 1e-9:
            return shape
    raise AssertionError(f'no equilibrium at a squeeze of {squeeze}')


def _depth(disc: Disc, shape: np.ndarray, squeeze: float) -> np.ndarray:
    return np.maximum(disc.height + disc.lift @ shape - (1.0 - squeeze), 0.0)


def _strain(disc: Disc, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """F, its cofactor, J and I of every point."""
    gradient = np.array([1.0, 0.0, 0.0, 1.0]) + disc.gradient @ shape
    cofactor = gradient @ _TURN
    return gradient, cofactor, 0.5 * (gradient * cofactor).sum(axis=1), (gradient**2).sum(axis=1)


def _energy(disc: Disc, shape: np.ndarray, squeeze: float) -> float:
    _, _, j, i = _strain(disc, shape)
    if j.min() <= 0.0:
        return np.inf
    rubber = _C10 * j ** (-2 / 3) * (i + 1.0) + _C01 * j ** (-4 / 3) * (j**2 + i) + 0.5 * BULK_MODULUS * (j - 1.0) ** 2
    return float(disc.area @ rubber + 0.5 * PENALTY * disc.length @ _depth(disc, shape, squeeze) ** 2)


def _forces(disc: Disc, shape: np.ndarray, squeeze: float) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivative of the energy."""
    gradient, cofactor, j, i = _strain(disc, shape)
    w_i = _C10 * j ** (-2 / 3) + _C01 * j ** (-4 / 3)
    w_ij = -2 / 3 * _C10 * j ** (-5 / 3) - 4 / 3 * _C01 * j ** (-7 / 3)
    w_j = w_ij * i - 2 / 3 * _C10 * j ** (-5 / 3) + 2 / 3 * _C01 * j ** (-1 / 3) + BULK_MODULUS * (j - 1.0)
    w_jj = 10 / 9 * _C10 * j ** (-8 / 3) * (i + 1.0) + BULK_MODULUS
    w_jj += _C01 * (28 / 9 * j ** (-10 / 3) * i - 2 / 9 * j ** (-4 / 3))
    stress = 2.0 * w_i[:, None] * gradient + w_j[:, None] * cofactor
    mixed = 2.0 * w_ij[:, None, None] * gradient[:, :, None] * cofactor[:, None, :]
    moduli = 2.0 * w_i[:, None, None] * np.eye(4) + w_j[:, None, None] * _TURN + mixed + mixed.transpose(0, 2, 1)
    moduli += w_jj[:, None, None] * cofactor[:, :, None] * cofactor[:, None, :]
    rows = disc.gradient.reshape(-1, len(shape)).T
    depth = _depth(disc, shape, squeeze)
    force = rows @ (disc.area[:, None] * stress).ravel() + PENALTY * disc.lift.T @ (depth * disc.length)
    stiffness = rows @ ((disc.area[:, None, None] * moduli) @ disc.gradient).reshape(-1, len(shape))
    on = depth > 0.0
    return force, stiffness + PENALTY * (disc.lift[on].T * disc.length[on]) @ disc.lift[on]
