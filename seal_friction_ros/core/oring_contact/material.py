r"""Rubber: nearly incompressible Mooney-Rivlin material under axisymmetric deformation.

With the deformation gradient

.. math:: F = \begin{pmatrix} F_{rr} & F_{rz} \\ F_{zr} & F_{zz} \end{pmatrix} \oplus t, \quad
    T = \sum F_{ij}^2, \; D = \det, \; t = r / R, \quad I_1 = T + t^2, \; I_2 = D^2 + t^2 T, \; J = D t

the shear energy per reference volume is independent of volume change through its powers of J [Simo1985]_:

.. math:: W = \sum_{k=1}^3 C_{k0} (J^{-2/3} I_1 - 3)^k + C_{01} (J^{-4/3} I_2 - 3)

with :math:`C_{20} = C_{30} = 0` the rubber of Mooney and Rivlin, with :math:`C_{01} = 0` that of Yeoh [Yeoh1993]_. Both
invariants are sums of monomials in T, D and t, so their derivatives need no tensor algebra.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True)
class Rubber(CheckedParameters):
    """Material constants; ValueError: a value is out of bounds, or the bulk modulus is below 20 E."""

    elastic_modulus: float = parameter(
        unit='Pa', lower=1e4, upper=1e10, description="Young's modulus at small strain, E."
    )
    mooney_ratio: float = parameter(0.25, unit='1', lower=0.0, upper=10.0, description='C01 / C10; 0: neo-Hookean.')
    yeoh_second: float = parameter(0.0, unit='1', lower=-0.5, upper=10.0, description='C20 / C10 of Yeoh.')
    yeoh_third: float = parameter(0.0, unit='1', lower=0.0, upper=10.0, description='C30 / C10 of Yeoh.')
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


class RubberField(NamedTuple):
    """Constants of `Rubber`, one for each element, shape (e, 1)."""

    elastic_modulus: FloatArray
    mooney_ratio: FloatArray
    yeoh_second: FloatArray
    yeoh_third: FloatArray
    bulk_modulus: FloatArray


def rubber_field(rubbers: Sequence[Rubber], which: IntArray) -> RubberField:
    """Constants of elements that are made of the rubbers number ``which``, shape (e,)."""
    return RubberField(*(np.array([getattr(r, name) for r in rubbers])[which, None] for name in RubberField._fields))


def mooney_rivlin_constants(rubber: Rubber | RubberField) -> tuple[Any, Any]:
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


def rubber_of_tension(stretch: FloatArray, stress: FloatArray, model: str = 'yeoh') -> Rubber:
    r"""Rubber of a uniaxial test, by least squares: stretches and nominal stresses [Pa], shape (n,) each.

    .. math:: P = 2 (\lambda - \lambda^{-2}) (dW/dI_1 + C_{01} / \lambda), \quad I_1 = \lambda^2 + 2 / \lambda

    ``model`` is one of `TEST_MODELS`. No constant but C20 is below 0. ValueError: fewer than four points, or a curve
    that no such rubber has.

    Source: [Rivlin1951]_, [Yeoh1993]_.
    """
    if model not in TEST_MODELS:
        raise ValueError(f'model {model!r} is none of {", ".join(TEST_MODELS)}')
    away = np.abs(stretch - 1.0) > 1e-6
    stretch, stress = stretch[away], stress[away]
    if len(stretch) < 4 or not (stretch > 0.0).all():
        raise ValueError('a test curve needs four points or more off the unloaded state, of a stretch above 0')
    a = stretch**2 + 2.0 / stretch - 3.0
    base = 2.0 * (stretch - stretch**-2)
    columns = {'c10': base, 'c01': base / stretch, 'c20': 2.0 * a * base, 'c30': 3.0 * a**2 * base}
    names = TEST_MODELS[model]
    lower = [-np.inf if name == 'c20' else 0.0 for name in names]
    matrix = np.stack([columns[name] for name in names], axis=1)
    size = np.abs(matrix).max(axis=0)
    found = lsq_linear(matrix / size, stress, (lower, np.inf)).x / size
    constants = dict.fromkeys(columns, 0.0) | dict(zip(names, found.tolist(), strict=True))
    if not constants['c10'] > 1e3:
        raise ValueError(f'the test curve is not that of a rubber of {model}: C10 = {constants["c10"]:.3g} Pa')
    c10 = constants['c10']
    return Rubber(
        elastic_modulus=6.0 * (c10 + constants['c01']),
        mooney_ratio=constants['c01'] / c10,
        yeoh_second=constants['c20'] / c10,
        yeoh_third=constants['c30'] / c10,
    )


TEST_MODELS = {'mooney': ('c10', 'c01'), 'yeoh': ('c10', 'c20', 'c30')}
"""Model of a rubber -> its constants; that of Mooney and Rivlin is Ogden's with exponents 2 and -2."""


class MaterialResponse(NamedTuple):
    """An energy density W(F) with its derivatives by F, at points; components in the order rr, rz, zr, zz, t."""

    energy: FloatArray  # W [Pa], shape (...)
    stress: FloatArray  # dW/dF [Pa], shape (..., 5)
    stiffness: FloatArray  # d2W/dF2 [Pa], shape (..., 5, 5)


_DETERMINANT_HESSIAN = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], dtype=float)


def shear_response(rubber: Rubber | RubberField, gradient: FloatArray) -> MaterialResponse:
    """Shear energy density with its derivatives, for a deformation gradient of shape (..., 5) with D > 0 and t > 0."""
    c10, c01 = mooney_rivlin_constants(rubber)
    plane = gradient[..., :4]
    # A copy: numpy 1.26 rounds powers of a view differently if their result happens to lie right behind it in memory.
    hoop = np.ascontiguousarray(gradient[..., 4])
    squares = (plane**2).sum(axis=-1)
    cofactor = _cofactor(plane)
    area = 0.5 * (plane * cofactor).sum(axis=-1)
    yeoh = _yeoh(rubber, c10, squares, area, hoop)
    if yeoh is not None:
        c10 = yeoh.slope
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
    energy = w - 3.0 * (c10 + c01)
    if yeoh is not None:
        energy += yeoh.energy
        change = np.concatenate(
            (2.0 * yeoh.by_squares[..., None] * plane + yeoh.by_area[..., None] * cofactor, yeoh.by_hoop[..., None]),
            axis=-1,
        )
        stiffness += yeoh.curvature[..., None, None] * change[..., :, None] * change[..., None, :]
    return MaterialResponse(energy, stress, stiffness)


class _Yeoh(NamedTuple):
    """What the higher powers of a = J^(-2/3) I_1 - 3 add, shape (...)."""

    slope: FloatArray  # dW/da [Pa]
    energy: FloatArray  # W less a dW/da [Pa]
    curvature: FloatArray  # d2W/da2 [Pa]
    by_squares: FloatArray
    by_area: FloatArray
    by_hoop: FloatArray  # derivatives of a


def _yeoh(
    rubber: Rubber | RubberField, c10: Any, squares: FloatArray, area: FloatArray, hoop: FloatArray
) -> _Yeoh | None:
    """None for a rubber of Mooney and Rivlin."""
    second, third = rubber.yeoh_second, rubber.yeoh_third
    if not (np.any(second) or np.any(third)):
        return None
    by_squares = (area * hoop) ** (-2.0 / 3.0)
    first = by_squares * (squares + hoop**2)
    a = first - 3.0
    slope = c10 * (1.0 + 2.0 * second * a + 3.0 * third * a**2)
    energy = c10 * (a + second * a**2 + third * a**3) - slope * a
    by_hoop = by_squares * (4.0 / 3.0 * hoop - 2.0 / 3.0 * squares / hoop)
    return _Yeoh(slope, energy, c10 * (2.0 * second + 6.0 * third * a), by_squares, -2.0 / 3.0 * first / area, by_hoop)


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


def von_mises_stress(rubber: Rubber | RubberField, gradient: FloatArray) -> FloatArray:
    """Von Mises stress [Pa], shape (...), of the Cauchy stress P F^T / J; independent of the bulk modulus."""
    piola = shear_response(rubber, gradient).stress
    plane = gradient[..., :4].reshape(*gradient.shape[:-1], 2, 2)
    ratio = volume_response(gradient).energy
    cauchy = piola[..., :4].reshape(plane.shape) @ np.swapaxes(plane, -1, -2) / ratio[..., None, None]
    rr, zz, rz = cauchy[..., 0, 0], cauchy[..., 1, 1], cauchy[..., 0, 1]
    hoop = piola[..., 4] * gradient[..., 4] / ratio
    return np.sqrt(0.5 * ((rr - zz) ** 2 + (zz - hoop) ** 2 + (hoop - rr) ** 2) + 3.0 * rz**2)
