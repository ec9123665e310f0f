"""How roughness hinders the flow of pressure and adds to that of shear, and what it does to the shear stress.

Factors of the average Reynolds equation and of the mean shear stress of N. Patir and H. S. Cheng.
"""

import math

from seal_friction_ros.core.foundation.compiled import compiled

PEKLENIK_NUMBERS = (1.0, 3.0, 6.0, 9.0)
"""Roughness as long as wide, and longer along the motion; for shorter ones the fits turn negative in thin films."""

_PRESSURE = {1.0: (0.90, 0.56), 3.0: (0.225, 1.5), 6.0: (0.520, 1.5), 9.0: (0.870, 1.5)}  # C, r
_SHEAR = {  # A_1, alpha_1, alpha_2, alpha_3, A_2
    1.0: (1.899, 0.98, 0.92, 0.05, 1.126),
    3.0: (1.560, 0.85, 1.13, 0.08, 0.556),
    6.0: (1.290, 0.62, 1.09, 0.08, 0.388),
    9.0: (1.011, 0.54, 1.07, 0.08, 0.295),
}
_STRESS = {  # A_3, alpha_4, alpha_5, alpha_6 of phi_fs; D, s of phi_fp
    1.0: (11.1, 2.31, 2.38, 0.11, 1.40, 0.66),
    3.0: (9.8, 2.25, 2.80, 0.18, 0.98, 0.79),
    6.0: (10.1, 2.25, 2.90, 0.18, 0.97, 0.91),
    9.0: (8.7, 2.15, 2.97, 0.18, 0.73, 0.91),
}
_THINNEST_SHARE = 1.0 / 300.0  # of 3 rms: the film between asperities that sheared first, as in 1979
_LARGEST_RATIO = 7.0  # of the fit of phi_fs; 0 beyond


def flow_factor_coefficients(peklenik_number: float) -> tuple[float, ...]:
    """Peklenik number and coefficients (C, r, A_1, alpha_1, alpha_2, alpha_3, A_2) for the compiled functions.

    ValueError: there are none for this number.

    Source: N. Patir, H. S. Cheng 1978 (Table 2) and 1979 (Table 2).
    """
    if peklenik_number not in _PRESSURE:
        known = ', '.join(f'{number:g}' for number in PEKLENIK_NUMBERS)
        raise ValueError(f'peklenik_number = {peklenik_number} has no Patir-Cheng coefficients here: choose {known}')
    return (peklenik_number, *_PRESSURE[peklenik_number], *_SHEAR[peklenik_number])


@compiled
def pressure_flow_factor(coefficients: tuple[float, ...], ratio: float) -> tuple[float, float]:
    """phi_x and its derivative at ``ratio`` H = gap / rms roughness, H > 0.

    1 - C exp(-r H) for isotropic roughness, else 1 + C H^-r. Used below the H = 0.5 of the fit too (our choice: it
    stays positive down to contact).
    """
    c, r = coefficients[1], coefficients[2]
    if coefficients[0] <= 1.0:
        tail = c * math.exp(-r * ratio)
        return 1.0 - tail, r * tail
    tail = c * ratio ** (-r)
    return 1.0 + tail, -r * tail / ratio


@compiled
def shear_flow_factor(coefficients: tuple[float, ...], ratio: float) -> tuple[float, float]:
    """phi_s of one rough surface and its derivative at ``ratio`` H = gap / rms roughness, H > 0.

    A_1 H^alpha_1 exp(-alpha_2 H + alpha_3 H^2) up to H = 5, then A_2 exp(-0.25 H).
    """
    _number, _c, _r, a_1, alpha_1, alpha_2, alpha_3, a_2 = coefficients
    if ratio > 5.0:
        factor = a_2 * math.exp(-0.25 * ratio)
        return factor, -0.25 * factor
    factor = a_1 * ratio**alpha_1 * math.exp(-alpha_2 * ratio + alpha_3 * ratio * ratio)
    return factor, factor * (alpha_1 / ratio - alpha_2 + 2.0 * alpha_3 * ratio)


def shear_stress_coefficients(peklenik_number: float) -> tuple[float, ...]:
    """A_3, alpha_4, alpha_5, alpha_6, D and s for `shear_stress_factors`; a number of `PEKLENIK_NUMBERS`.

    Source: N. Patir, H. S. Cheng 1979 (Tables 3 and 4).
    """
    return _STRESS[peklenik_number]


@compiled
def shear_stress_factors(coefficients: tuple[float, ...], ratio: float) -> tuple[float, float]:
    r"""Factors of the shear by sliding and by pressure at ``ratio`` H = gap / rms roughness, H > 0.

    The first is phi_f + phi_fs: phi_f is the mean of 1 / gap (with z = H / 3, and films between asperities no thinner
    than 3 rms / 300), and phi_fs the drag of the pressure on the slopes of the asperities. Patir and Cheng give the
    viscous stress of either surface, phi_f - phi_fs on the rough one; the whole force, which is what friction is, is
    the stress on a smooth surface opposite, phi_f + phi_fs, and that of roughness on both is the same. The second is
    phi_fp.

    .. math:: \phi_f = \tfrac{35}{32} z \Big[(1 - z^2)^3 \ln\tfrac{z + 1}{1/300} + \tfrac{1}{60} \big(-55 + z (132
        + z (345 + z (-160 + z (-405 + z (60 + 147 z)))))\big)\Big]\ (z \le 1)

    .. math:: \phi_{fs} = A_3 H^{\alpha_4} e^{-\alpha_5 H + \alpha_6 H^2}\ (H \le 7),\quad
        \phi_{fp} = 1 - D e^{-s H}

    The fits hold from H = 0.5; below it they are used, too (our choice: all go to 0 or stay finite).

    Source: N. Patir, H. S. Cheng 1979 (equations 15 to 20).
    """
    a_3, alpha_4, alpha_5, alpha_6, d, s = coefficients
    z = ratio / 3.0
    square = z * z
    if z <= 1.0:
        series = -55.0 + z * (132.0 + z * (345.0 + z * (-160.0 + z * (-405.0 + z * (60.0 + 147.0 * z)))))
        sheared = (1.0 - square) ** 3 * math.log((z + 1.0) / _THINNEST_SHARE) + series / 60.0
    elif z < 10.0:
        series = 66.0 + square * (30.0 * square - 80.0)
        sheared = (1.0 - square) ** 3 * math.log((z + 1.0) / (z - 1.0)) + z / 15.0 * series
    else:  # the difference of the two terms is lost in rounding; 1 within 0.2 %
        sheared = 32.0 / (35.0 * z)
    dragged = 0.0
    if ratio <= _LARGEST_RATIO:
        dragged = a_3 * ratio**alpha_4 * math.exp(-alpha_5 * ratio + alpha_6 * ratio * ratio)
    return 35.0 / 32.0 * z * sheared + dragged, 1.0 - d * math.exp(-s * ratio)
