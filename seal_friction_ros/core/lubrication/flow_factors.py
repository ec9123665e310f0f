"""How roughness hinders the flow of pressure and adds to that of shear: factors of the average Reynolds equation."""

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


def flow_factor_coefficients(peklenik_number: float) -> tuple[float, ...]:
    """Peklenik number and coefficients (C, r, A_1, alpha_1, alpha_2, alpha_3, A_2) for the compiled functions.

    Raises:
        ValueError: There are none for this number.

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
    a_1, alpha_1, alpha_2, alpha_3, a_2 = (
        coefficients[3],
        coefficients[4],
        coefficients[5],
        coefficients[6],
        coefficients[7],
    )
    if ratio > 5.0:
        factor = a_2 * math.exp(-0.25 * ratio)
        return factor, -0.25 * factor
    factor = a_1 * ratio**alpha_1 * math.exp(-alpha_2 * ratio + alpha_3 * ratio * ratio)
    return factor, factor * (alpha_1 / ratio - alpha_2 + 2.0 * alpha_3 * ratio)
