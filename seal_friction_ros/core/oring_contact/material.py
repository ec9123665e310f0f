r"""Rubber: nearly incompressible Mooney-Rivlin material under axisymmetric deformation.

With the deformation gradient

.. math:: F = \begin{pmatrix} F_{rr} & F_{rz} \\ F_{zr} & F_{zz} \end{pmatrix} \oplus t, \quad
    T = \sum F_{ij}^2, \; D = \det, \; t = r / R, \quad I_1 = T + t^2, \; I_2 = D^2 + t^2 T, \; J = D t

the shear energy per reference volume is independent of volume change through its powers of J [Simo1985]_:

.. math:: W = C_{10} (J^{-2/3} I_1 - 3) + C_{01} (J^{-4/3} I_2 - 3)

It is a sum of monomials in T, D and t, so its derivatives need no tensor algebra.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True)
class Rubber(CheckedParameters):
    """Material constants; ValueError: a value is out of bounds, or the bulk modulus is below 20 E."""

    elastic_modulus: float = parameter(
        unit='Pa', lower=1e4, upper=1e10, description="Young's modulus at small strain, E."
    )
    mooney_ratio: float = parameter(0.25, unit='1', lower=0.0, upper=10.0, description='C01 / C10; 0: neo-Hookean.')
    bulk_modulus: float = parameter(
        2.0e9, unit='Pa', lower=1e6, upper=1e12, description='Bulk modulus, K; about 2 GPa for rubber.'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bulk_modulus < 20.0 * self.elastic_modulus:
            raise ValueError(
                f'Rubber.bulk_modulus = {self.bulk_modulus} Pa is below 20 times elastic_modulus = '
                f'{self.elastic_modulus} Pa: not a nearly incompressible rubber'
            )


def mooney_rivlin_constants(rubber: Rubber) -> tuple[float, float]:
    """C10 and C01 [Pa]: 2 (C10 + C01) is the shear modulus, E / 3 for an incompressible rubber.

    Source: [Rivlin1951]_.
    """
    c10 = rubber.elastic_modulus / 6.0 / (1.0 + rubber.mooney_ratio)
    return c10, rubber.mooney_ratio * c10


def elastic_modulus_of_hardness(shore_a: float) -> float:
    """Young's modulus [Pa] of a rubber of hardness ``shore_a`` [Shore A].

    E = 0.0981 MPa (56 + 7.62336 S) / (0.137505 (254 - 2.54 S)); 5.52 MPa at 70. ValueError: the hardness is not between
    20 and 95.

    Source: [Gent1958]_; the bounds are our choice.
    """
    if not 20.0 <= shore_a <= 95.0:
        raise ValueError(
            f'hardness = {shore_a} Shore A is outside 20 to 95, the range of the hardness-modulus relation'
        )
    return 0.0981e6 * (56.0 + 7.62336 * shore_a) / (0.137505 * (254.0 - 2.54 * shore_a))


def hardness_of_elastic_modulus(elastic_modulus: float) -> float:
    """Hardness [Shore A] of a rubber of modulus ``elastic_modulus`` [Pa]: `elastic_modulus_of_hardness` inverted."""
    ratio = 0.137505 * elastic_modulus / 0.0981e6
    return (254.0 * ratio - 56.0) / (7.62336 + 2.54 * ratio)


class MaterialResponse(NamedTuple):
    """An energy density W(F) with its derivatives by F, at points; components in the order rr, rz, zr, zz, t."""

    energy: FloatArray  # W [Pa], shape (...)
    stress: FloatArray  # dW/dF [Pa], shape (..., 5)
    stiffness: FloatArray  # d2W/dF2 [Pa], shape (..., 5, 5)


_DETERMINANT_HESSIAN = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], dtype=float)


def shear_response(rubber: Rubber, gradient: FloatArray) -> MaterialResponse:
    """Shear energy density with its derivatives, for a deformation gradient of shape (..., 5) with D > 0 and t > 0."""
    c10, c01 = mooney_rivlin_constants(rubber)
    plane = gradient[..., :4]
    # A copy: numpy 1.26 rounds powers of a view differently if their result happens to lie right behind it in memory.
    hoop = np.ascontiguousarray(gradient[..., 4])
    squares = (plane**2).sum(axis=-1)
    cofactor = _cofactor(plane)
    area = 0.5 * (plane * cofactor).sum(axis=-1)
    # W = sum of factor T^k D^m t^n, k = 0 or 1
    monomials = ((c10, 1, -2 / 3, -2 / 3), (c10, 0, -2 / 3, 4 / 3), (c01, 0, 2 / 3, -4 / 3), (c01, 1, -4 / 3, 2 / 3))
    w, w_T, w_D, w_t, w_TD, w_Tt, w_DD, w_Dt, w_tt = (np.zeros_like(hoop) for _ in range(9))
    for factor, k, m, n in monomials:
        per_T = factor * area**m * hoop**n
        value = per_T * squares if k else per_T
        w += value
        w_D += m * value / area
        w_t += n * value / hoop
        w_DD += m * (m - 1) * value / area**2
        w_Dt += m * n * value / (area * hoop)
        w_tt += n * (n - 1) * value / hoop**2
        if k:
            w_T += per_T
            w_TD += m * per_T / area
            w_Tt += n * per_T / hoop
    stress = np.concatenate((2.0 * w_T[..., None] * plane + w_D[..., None] * cofactor, w_t[..., None]), axis=-1)
    stiffness = np.empty((*hoop.shape, 5, 5))
    cross = 2.0 * w_TD[..., None, None] * plane[..., :, None] * cofactor[..., None, :]
    stiffness[..., :4, :4] = (
        2.0 * w_T[..., None, None] * np.eye(4)
        + w_D[..., None, None] * _DETERMINANT_HESSIAN
        + w_DD[..., None, None] * cofactor[..., :, None] * cofactor[..., None, :]
        + cross
        + np.swapaxes(cross, -1, -2)
    )
    mixed = 2.0 * w_Tt[..., None] * plane + w_Dt[..., None] * cofactor
    stiffness[..., :4, 4] = mixed
    stiffness[..., 4, :4] = mixed
    stiffness[..., 4, 4] = w_tt
    return MaterialResponse(w - 3.0 * (c10 + c01), stress, stiffness)


def volume_response(gradient: FloatArray) -> MaterialResponse:
    """Volume ratio J = D t [-] (as ``energy``) with its derivatives, for a deformation gradient of shape (..., 5)."""
    plane, hoop = gradient[..., :4], gradient[..., 4]
    cofactor = _cofactor(plane)
    area = 0.5 * (plane * cofactor).sum(axis=-1)
    first = np.concatenate((hoop[..., None] * cofactor, area[..., None]), axis=-1)
    second = np.zeros((*hoop.shape, 5, 5))
    second[..., :4, :4] = hoop[..., None, None] * _DETERMINANT_HESSIAN
    second[..., :4, 4] = cofactor
    second[..., 4, :4] = cofactor
    return MaterialResponse(area * hoop, first, second)


def _cofactor(plane: FloatArray) -> FloatArray:
    """dD/dF for components rr, rz, zr, zz, shape (..., 4)."""
    cofactor: FloatArray = plane[..., ::-1] * np.array([1.0, -1.0, -1.0, 1.0])
    return cofactor


def von_mises_stress(rubber: Rubber, gradient: FloatArray) -> FloatArray:
    """Von Mises stress [Pa], shape (...), of the Cauchy stress P F^T / J; independent of the bulk modulus."""
    piola = shear_response(rubber, gradient).stress
    plane = gradient[..., :4].reshape(*gradient.shape[:-1], 2, 2)
    ratio = volume_response(gradient).energy
    cauchy = piola[..., :4].reshape(plane.shape) @ np.swapaxes(plane, -1, -2) / ratio[..., None, None]
    rr, zz, rz = cauchy[..., 0, 0], cauchy[..., 1, 1], cauchy[..., 0, 1]
    hoop = piola[..., 4] * gradient[..., 4] / ratio
    return np.sqrt(0.5 * ((rr - zz) ** 2 + (zz - hoop) ** 2 + (hoop - rr) ** 2) + 3.0 * rz**2)
