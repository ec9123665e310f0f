r"""Rubber: nearly incompressible, hyperelastic under axisymmetric deformation; its modulus may relax with time.

With the deformation gradient

.. math:: F = \begin{pmatrix} F_{rr} & F_{rz} \\ F_{zr} & F_{zz} \end{pmatrix} \oplus t, \quad
    T = \sum F_{ij}^2, \; D = \det, \; t = r / R, \quad J = D t

the shear energy per reference volume is independent of volume change through its powers of J [Simo1985]_:

.. math:: W = \sum_p C_p \big(J^{-\alpha_p/3} (\lambda_1^{\alpha_p} + \lambda_2^{\alpha_p} + t^{\alpha_p}) - 3\big)
    + \sum_{k=2}^3 C_{k0} (J^{-2/3} I_1 - 3)^k

The first sum is the rubber of Ogden [Ogden1972]_, :math:`C_p = \mu_p / \alpha_p`; that of Mooney and Rivlin has the
exponents 2 and -2 (C10 and C01), that of Yeoh [Yeoh1993]_ only 2, and the second sum. The stretches of the section are
:math:`\lambda_{1,2} = \sqrt D e^{\pm\varphi/2}` with :math:`\cosh\varphi = T / 2D`, so

.. math:: \lambda_1^\alpha + \lambda_2^\alpha = 2 D^{\alpha/2} \cosh(\tfrac{\alpha}{2} \varphi)

is smooth in T and D even where both are equal.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear
from scipy.special import hyp2f1

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter

_SERIES = 'give as many of one as of the other'


@dataclass(frozen=True)
class Rubber(CheckedParameters):
    r"""Material constants.

    The modulus at a time t since the ring was mounted is that of a series of Prony, by which all stress but that of
    the volume is proportional to it (our choice: squeeze and pressure count as applied at once):

    .. math:: E(t) = E \Big(1 - \sum_i g_i (1 - e^{-t / \tau_i})\Big)

    ValueError: a value is out of bounds, the bulk modulus is below 20 E, or a series is not complete.
    """

    elastic_modulus: float = parameter(
        unit='Pa', lower=1e4, upper=1e10, description="Young's modulus at small strain, E; at once if it relaxes."
    )
    mooney_ratio: float = parameter(0.25, unit='1', lower=0.0, upper=10.0, description='C01 / C10; 0: neo-Hookean.')
    yeoh_second: float = parameter(0.0, unit='1', lower=-0.5, upper=10.0, description='C20 / C10 of Yeoh.')
    yeoh_third: float = parameter(0.0, unit='1', lower=0.0, upper=10.0, description='C30 / C10 of Yeoh.')
    ogden_moduli: tuple[float, ...] = parameter(
        (),
        unit='Pa',
        lower=-1e10,
        upper=1e10,
        description='mu_p of Ogden, instead of these ratios; a modulus beside them scales them.',
    )
    ogden_exponents: tuple[float, ...] = parameter(
        (), unit='1', lower=-20.0, upper=20.0, description='alpha_p, each of the sign of its modulus.'
    )
    bulk_modulus: float = parameter(
        2.0e9, unit='Pa', lower=1e6, upper=1e12, description='Bulk modulus, K; about 2 GPa for rubber.'
    )
    prony_shares: tuple[float, ...] = parameter(
        (), unit='1', lower=0.0, upper=1.0, description='g_i of Prony: what relaxes, over E.'
    )
    prony_times: tuple[float, ...] = parameter((), unit='s', lower=1e-9, upper=1e12, description='tau_i.')
    time_since_mounting: float = parameter(0.0, unit='s', lower=0.0, upper=1e12, description='Time t of relaxation.')

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bulk_modulus < 20.0 * self.elastic_modulus:
            raise ValueError(
                f'Rubber.bulk_modulus = {self.bulk_modulus} Pa is below 20 times elastic_modulus = '
                f'{self.elastic_modulus} Pa: not a nearly incompressible rubber'
            )
        moduli, exponents = self.ogden_moduli, self.ogden_exponents
        if len(moduli) != len(exponents) or len(set(exponents)) < len(exponents):
            raise ValueError(f'Rubber.ogden_moduli and ogden_exponents: {_SERIES}, no exponent twice')
        if any(modulus * exponent <= 0.0 for modulus, exponent in zip(moduli, exponents, strict=True)):
            raise ValueError('Rubber.ogden_moduli: each needs the sign of its exponent, neither is 0: else not stable')
        if len(self.prony_shares) != len(self.prony_times) or sum(self.prony_shares) >= 1.0:
            raise ValueError(f'Rubber.prony_shares and prony_times: {_SERIES}, shares below 1 in sum')

    @property
    def modulus(self) -> float:
        """Young's modulus at small strain at the time since mounting [Pa]."""
        gone = zip(self.prony_shares, self.prony_times, strict=True)
        relaxed = sum(share * -math.expm1(-self.time_since_mounting / time) for share, time in gone)
        return self.elastic_modulus * (1.0 - relaxed)

    @property
    def terms(self) -> dict[float, float]:
        """C_p [Pa] of each exponent; 3 times half the sum of C_p alpha_p^2 is the modulus. Source: [Rivlin1951]_."""
        if self.ogden_moduli:
            series = dict(zip(self.ogden_exponents, self.ogden_moduli, strict=True))
            scale = self.modulus / modulus_of_ogden(self.ogden_moduli, self.ogden_exponents)
            return {exponent: scale * modulus / exponent for exponent, modulus in series.items()}
        c10 = self.modulus / 6.0 / (1.0 + self.mooney_ratio)
        return {2.0: c10, -2.0: self.mooney_ratio * c10}

    @property
    def yeoh(self) -> tuple[float, float]:
        """C20 and C30 [Pa]."""
        c10 = 0.0 if self.ogden_moduli else self.terms[2.0]
        return self.yeoh_second * c10, self.yeoh_third * c10


class RubberField(NamedTuple):
    """Constants of `Rubber`, one for each element, shape (e, 1)."""

    modulus: FloatArray
    bulk_modulus: FloatArray
    terms: Mapping[float, FloatArray]
    yeoh: tuple[FloatArray, FloatArray]


def rubber_field(rubbers: Sequence[Rubber], which: IntArray) -> RubberField:
    """Constants of elements that are made of the rubbers number ``which``, shape (e,)."""

    def spread(values: Sequence[float]) -> FloatArray:
        return np.array(values)[which, None]

    return RubberField(
        spread([rubber.modulus for rubber in rubbers]),
        spread([rubber.bulk_modulus for rubber in rubbers]),
        {exponent: spread([r.terms.get(exponent, 0.0) for r in rubbers]) for r in rubbers for exponent in r.terms},
        (spread([rubber.yeoh[0] for rubber in rubbers]), spread([rubber.yeoh[1] for rubber in rubbers])),
    )


def modulus_of_ogden(moduli: Sequence[float], exponents: Sequence[float]) -> float:
    """Young's modulus [Pa] of the rubber of Ogden with ``moduli`` [Pa]: 3/2 of the sum of mu_p alpha_p [Ogden1972]_."""
    return 1.5 * sum(modulus * exponent for modulus, exponent in zip(moduli, exponents, strict=True))


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

    .. math:: P = \sum_p C_p \alpha_p (\lambda^{\alpha_p - 1} - \lambda^{-\alpha_p/2 - 1})
        + 2 (\lambda - \lambda^{-2}) \sum_{k=2}^3 k C_{k0} (\lambda^2 + 2 / \lambda - 3)^{k-1}

    ``model`` is one of `TEST_MODELS`. No constant but C20 is below 0. ValueError: fewer than four points, or a curve
    that no such rubber has.

    Source: [Rivlin1951]_, [Yeoh1993]_, [Ogden1972]_.
    """
    if model not in TEST_MODELS:
        raise ValueError(f'model {model!r} is none of {", ".join(TEST_MODELS)}')
    away = np.abs(stretch - 1.0) > 1e-6
    stretch, stress = stretch[away], stress[away]
    if len(stretch) < 4 or not (stretch > 0.0).all():
        raise ValueError('a test curve needs four points or more off the unloaded state, of a stretch above 0')
    exponents, powers = TEST_MODELS[model]
    columns = [alpha * (stretch ** (alpha - 1.0) - stretch ** (-0.5 * alpha - 1.0)) for alpha in exponents]
    a = stretch**2 + 2.0 / stretch - 3.0
    columns += [2.0 * k * a ** (k - 1) * (stretch - stretch**-2) for k in powers]
    lower = [0.0 for _ in exponents] + [-np.inf if k == 2 else 0.0 for k in powers]
    size = np.abs(columns).max(axis=1)
    found = lsq_linear(np.transpose(columns) / size, stress, (lower, np.inf), method='bvls').x / size
    terms = {alpha: c for alpha, c in zip(exponents, found.tolist(), strict=False) if c > 0.0}
    first, elastic_modulus = terms.get(2.0, 0.0), 1.5 * sum(c * alpha**2 for alpha, c in terms.items())
    if not (first > 1e3 or (model == 'ogden' and elastic_modulus > 6e3)):
        said = f'C10 is {first:.3g} Pa, its modulus {elastic_modulus:.3g} Pa'
        raise ValueError(f'the test curve is not that of a rubber of {model}: {said}')
    if model == 'ogden':
        moduli = tuple(alpha * c for alpha, c in terms.items())
        return Rubber(elastic_modulus=elastic_modulus, ogden_moduli=moduli, ogden_exponents=tuple(terms))
    second, third = (found[len(exponents) :] / first).tolist() if powers else (0.0, 0.0)
    return Rubber(elastic_modulus, terms.get(-2.0, 0.0) / first, second, third)


TEST_MODELS: dict[str, tuple[tuple[float, ...], tuple[int, ...]]] = {
    'mooney': ((2.0, -2.0), ()),
    'yeoh': ((2.0,), (2, 3)),
    'ogden': ((-2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0), ()),
}
"""Model of a rubber -> exponents alpha_p, and powers k of Yeoh; those of Ogden are our choice, the test selects."""


class MaterialResponse(NamedTuple):
    """An energy density W(F) with its derivatives by F, at points; components in the order rr, rz, zr, zz, t."""

    energy: FloatArray  # W [Pa], shape (...)
    stress: FloatArray  # dW/dF [Pa], shape (..., 5)
    stiffness: FloatArray  # d2W/dF2 [Pa], shape (..., 5, 5)


_DETERMINANT_HESSIAN = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], dtype=float)


def shear_response(rubber: Rubber | RubberField, gradient: FloatArray) -> MaterialResponse:
    """Shear energy density with its derivatives, for a deformation gradient of shape (..., 5) with D > 0 and t > 0."""
    plane = gradient[..., :4]
    # A copy: numpy 1.26 rounds powers of a view differently if their result happens to lie right behind it in memory.
    hoop = np.ascontiguousarray(gradient[..., 4])
    squares = (plane**2).sum(axis=-1)
    cofactor = _cofactor(plane)
    area = 0.5 * (plane * cofactor).sum(axis=-1)
    yeoh = _yeoh(rubber, squares, area, hoop)
    ratio = 0.5 * squares / area
    w, w_T, w_D, w_t, w_TT, w_TD, w_Tt, w_DD, w_Dt, w_tt = (np.zeros_like(hoop) for _ in range(10))
    for exponent, constant in rubber.terms.items():
        factor = yeoh.slope if exponent == 2.0 and yeoh is not None else constant
        m, k = exponent / 3.0, exponent / 6.0
        by_hoop = factor * area**-m * hoop ** (2.0 * m)  # C J^(-alpha/3) t^alpha
        w += by_hoop - 3.0 * factor
        w_D -= m * by_hoop / area
        w_t += 2.0 * m * by_hoop / hoop
        w_DD += m * (m + 1.0) * by_hoop / area**2
        w_Dt -= 2.0 * m * m * by_hoop / (area * hoop)
        w_tt += 2.0 * m * (2.0 * m - 1.0) * by_hoop / hoop**2
        value, slope, curve = _chebyshev(0.5 * exponent, ratio)
        by_plane = 2.0 * factor * area**k * hoop**-m  # C J^(-alpha/3) (lambda_1^alpha + lambda_2^alpha) over value
        w += by_plane * value
        along_T, along_D = slope / (2.0 * area), (k * value - ratio * slope) / area
        w_T += by_plane * along_T
        w_D += by_plane * along_D
        w_t -= m * by_plane * value / hoop
        w_TT += by_plane * curve / (4.0 * area**2)
        w_TD += by_plane * ((k - 1.0) * slope - ratio * curve) / (2.0 * area**2)
        w_Tt -= m * by_plane * along_T / hoop
        w_DD += by_plane * (k * (k - 1.0) * value + 2.0 * (1.0 - k) * ratio * slope + ratio**2 * curve) / area**2
        w_Dt -= m * by_plane * along_D / hoop
        w_tt += m * (m + 1.0) * by_plane * value / hoop**2
    stress = np.concatenate((2.0 * w_T[..., None] * plane + w_D[..., None] * cofactor, w_t[..., None]), axis=-1)
    stiffness = np.empty((*hoop.shape, 5, 5))
    cross = 2.0 * w_TD[..., None, None] * plane[..., :, None] * cofactor[..., None, :]
    stiffness[..., :4, :4] = (
        2.0 * w_T[..., None, None] * np.eye(4)
        + w_D[..., None, None] * _DETERMINANT_HESSIAN
        + 4.0 * w_TT[..., None, None] * plane[..., :, None] * plane[..., None, :]
        + w_DD[..., None, None] * cofactor[..., :, None] * cofactor[..., None, :]
        + cross
        + np.swapaxes(cross, -1, -2)
    )
    mixed = 2.0 * w_Tt[..., None] * plane + w_Dt[..., None] * cofactor
    stiffness[..., :4, 4] = mixed
    stiffness[..., 4, :4] = mixed
    stiffness[..., 4, 4] = w_tt
    if yeoh is not None:
        w += yeoh.energy
        change = np.concatenate(
            (2.0 * yeoh.by_squares[..., None] * plane + yeoh.by_area[..., None] * cofactor, yeoh.by_hoop[..., None]),
            axis=-1,
        )
        stiffness += yeoh.curvature[..., None, None] * change[..., :, None] * change[..., None, :]
    return MaterialResponse(w, stress, stiffness)


def _chebyshev(n: float, ratio: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """cosh(n arcosh(ratio)) with its first and second derivative: the function of Chebyshev, of any real degree n."""
    if abs(n) == 1.0:
        return ratio, np.ones_like(ratio), np.zeros_like(ratio)
    z, slope, curve = 0.5 * (1.0 - ratio), n**2, n**2 * (n**2 - 1.0) / 3.0
    value, first, second = (np.asarray(hyp2f1(i - n, i + n, i + 0.5, z), dtype=float) for i in range(3))
    return value, slope * first, curve * second


class _Yeoh(NamedTuple):
    """What the higher powers of a = J^(-2/3) I_1 - 3 add, shape (...)."""

    slope: FloatArray  # dW/da [Pa]
    energy: FloatArray  # W less a dW/da [Pa]
    curvature: FloatArray  # d2W/da2 [Pa]
    by_squares: FloatArray
    by_area: FloatArray
    by_hoop: FloatArray  # derivatives of a


def _yeoh(rubber: Rubber | RubberField, squares: FloatArray, area: FloatArray, hoop: FloatArray) -> _Yeoh | None:
    """None for a rubber without higher powers."""
    second, third = rubber.yeoh
    if not (np.any(second) or np.any(third)):
        return None
    c10 = rubber.terms[2.0]
    by_squares = (area * hoop) ** (-2.0 / 3.0)
    first = by_squares * (squares + hoop**2)
    a = first - 3.0
    slope = c10 + 2.0 * second * a + 3.0 * third * a**2
    energy = c10 * a + second * a**2 + third * a**3 - slope * a
    by_hoop = by_squares * (4.0 / 3.0 * hoop - 2.0 / 3.0 * squares / hoop)
    return _Yeoh(slope, energy, 2.0 * second + 6.0 * third * a, by_squares, -2.0 / 3.0 * first / area, by_hoop)


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
