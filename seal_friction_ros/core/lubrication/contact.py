r"""Film, roughness and elastic seal together: one implicit step in time.

Each cell has three unknowns: gap h, film pressure p and saturation theta. Three equations: Reynolds and complementarity
(`reynolds`), and the elastic gap

.. math:: h = g + K\,(p + p_c(h))

with the rigid gap g (negative where the seal overlaps the wall), the compliance K of the half-plane (`elasticity`) and
the contact pressure p_c (`topography`). Newton's method solves all three together. Its linear system is dense through
K, but the inverse of K decays as 1 / r^2: a banded approximation gives a banded system, which is solved directly and
preconditions GMRES on the elastic equation. The flow is balanced to rounding whatever the tolerance of the elastic
equation.

Scheme and preconditioner are our choice; GMRES: Y. Saad, M. H. Schultz 1986.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.foundation.errors import NotConvergedError, named_errors
from seal_friction_ros.core.lubrication.elasticity import ElasticBody
from seal_friction_ros.core.lubrication.flow_factors import (
    flow_factor_coefficients,
    pressure_flow_factor,
    shear_flow_factor,
    shear_stress_coefficients,
)
from seal_friction_ros.core.lubrication.grease import Grease, apparent_viscosity
from seal_friction_ros.core.lubrication.reynolds import FilmEnds, complementarity, reynolds_rows
from seal_friction_ros.core.lubrication.topography import Topography, contact_pressure

_ITERATIONS = 40
_GMRES_ITERATIONS = 60
_GMRES_TOLERANCE = 1e-2  # of the elastic residual, at each Newton iteration
_GAP_TOLERANCE = 1e-13  # [m] left of the elastic equation
_FLOW_TOLERANCE = 1e-13  # of the largest flow
_ROUNDING = 2e-15  # relative
_LEAST_FLOW = 1e-25  # [m^2/s] lower limit of the reference flow: a dry contact has none
_COMPLEMENTARITY_TOLERANCE = 1e-13
_PRESSURE_SCALE = 1e5  # [Pa] p_s of the complementarity
THINNEST = 1e-9  # [m] a gap below this flows like this


Solver = Callable[[Callable[[FloatArray], FloatArray], FloatArray, float, int], FloatArray]
"""Solves A x = b from the product A x, b, the tolerance of the residual (2-norm) and the most products"""


class StalledError(ArithmeticError):
    """The residual did not fall below the tolerance."""


def scipy_gmres(
    product: Callable[[FloatArray], FloatArray], right: FloatArray, tolerance: float, iterations: int
) -> FloatArray:
    """`Solver` of SciPy, without restart.

    StalledError: the residual is larger after ``iterations``, or not a number.
    """
    operator = LinearOperator((len(right), len(right)), product, dtype=np.float64)
    found, failed = gmres(operator, right, rtol=0.0, atol=tolerance, restart=iterations, maxiter=1)
    if failed or not np.isfinite(found).all():
        raise StalledError(f'GMRES: not solved after {iterations} iterations')
    return np.asarray(found)


class ContactState(NamedTuple):
    """Film and gap at one moment, each of shape (n,)."""

    gap: FloatArray  # mean separation of the surfaces [m]
    pressure: FloatArray  # film pressure above the cavitation pressure [Pa]
    saturation: FloatArray  # share of the gap that is filled


class ContactStep(NamedTuple):
    """Result of one step."""

    state: ContactState
    flow: FloatArray  # through the faces of the cells [m^2/s], shape (n + 1,), in the direction of x
    iterations: int  # of Newton's method


@dataclass(frozen=True, eq=False)
class LubricatedContact:
    """Elastic body, roughness and lubricant of a contact."""

    body: ElasticBody
    topography: Topography
    grease: Grease
    solve: Solver = scipy_gmres

    @property
    def rough(self) -> tuple[float, float, tuple[float, ...]]:
        """Rms height [m], share of the wall less that of the seal, and coefficients of the flow factors."""
        t = self.topography
        return t.rms_height, 2.0 * t.wall_share - 1.0, flow_factor_coefficients(t.peklenik_number)

    @property
    def stress_roughness(self) -> tuple[float, tuple[float, ...]]:
        """Rms height [m] and coefficients of the shear-stress factors; height 0: without them."""
        t = self.topography
        return t.rms_height if t.shear_stress_factors else 0.0, shear_stress_coefficients(t.peklenik_number)

    def asperity_pressure(self, gap: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Contact pressure [Pa] and its derivative [Pa/m] in each cell at a ``gap`` [m]."""
        t = self.topography
        return contact_pressure(t.contact_stiffness(self.body.modulus), t.separation_length, t.filling, gap)


@compiled
def film_properties(
    gap: FloatArray,
    sliding_velocity: float,
    grease: tuple[float, float, float, float, float],
    rough: tuple[float, float, tuple[float, ...]],
) -> FloatArray:
    """Mobility M, dM/dh, carried height c and dc/dh of each cell, shape (4, n).

    The viscosity is that at the mean shear rate U / h, U of either sign (our choice). c = h + sigma (wall - seal)
    phi_s: roughness of the wall, which moves in the frame of the seal, carries more; roughness of the seal carries
    less.
    """
    n = gap.shape[0]
    properties = np.empty((4, n))
    rms, asymmetry, coefficients = rough
    yield_stress, consistency, index, _base, floor = grease
    for i in range(n):
        h = max(gap[i], THINNEST)
        ratio = h / rms
        phi, phi_slope = pressure_flow_factor(coefficients, ratio)
        shear_rate = sliding_velocity / h
        viscosity = apparent_viscosity(grease, shear_rate)
        rate = math.sqrt(shear_rate * shear_rate + floor * floor)
        by_rate = (consistency * (index - 1.0) * rate**index - yield_stress) / (rate * rate)
        viscosity_slope = -by_rate * shear_rate * shear_rate / (h * rate)
        mobility = phi * h * h * h / (12.0 * viscosity)
        shear, shear_slope = shear_flow_factor(coefficients, ratio)
        inside = 1.0 if gap[i] > THINNEST else 0.0
        properties[0, i] = mobility
        properties[1, i] = inside * mobility * (phi_slope / (phi * rms) + 3.0 / h - viscosity_slope / viscosity)
        properties[2, i] = h + rms * asymmetry * shear
        properties[3, i] = inside * (1.0 + asymmetry * shear_slope)
    return properties


@compiled
def _factored_band(rows: FloatArray, kept: FloatArray, slope: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Banded approximation of the linear system, eliminated without exchange of rows.

    With LAPACK (``dgbtrf``, which exchanges rows) one cycle of ``inner_seal`` took 2049 Newton iterations, not 1578.

    Unknowns: change of h and the one that the complementarity leaves, cell by cell. Equations: elasticity (in units of
    pressure), then Reynolds. Entry (i, j) is stored at [i, j - i + w], w half the band.
    """
    n, reach = slope.shape[0], stiffness.shape[0] - 1
    w = max(2 * reach, 3)
    band = np.zeros((2 * n, 2 * w + 1))
    for i in range(n):
        for j in range(max(0, i - reach), min(n, i + reach + 1)):
            band[2 * i, 2 * (j - i) + w] = stiffness[abs(j - i)]
        band[2 * i, w] -= slope[i]
        band[2 * i, w + 1] = -kept[1, i]
        for j in range(max(0, i - 1), min(n, i + 2)):
            k = j - i + 1
            band[2 * i + 1, 2 * (j - i) + w - 1] = rows[2, k, i]
            band[2 * i + 1, 2 * (j - i) + w] = rows[0, k, i] * kept[1, j] + rows[1, k, i] * kept[3, j]
    for column in range(2 * n):
        pivot = band[column, w]
        if pivot == 0.0:  # needs an exchange of rows: the step is repeated, as after any solution that is no number
            band[:] = math.nan
            return band
        for row in range(column + 1, min(2 * n, column + w + 1)):
            offset = column - row + w
            if band[row, offset] != 0.0:
                factor = band[row, offset] / pivot
                band[row, offset] = factor
                for k in range(1, w + 1):
                    band[row, offset + k] -= factor * band[column, w + k]
    return band


@compiled
def _solve_band(band: FloatArray, elastic: FloatArray, flow: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Change of gap and of the unknown that is left, for right-hand sides of both equations, each of shape (n,)."""
    n = elastic.shape[0]
    w = (band.shape[1] - 1) // 2
    x = np.empty(2 * n)
    for i in range(n):
        x[2 * i], x[2 * i + 1] = elastic[i], flow[i]
    for row in range(2 * n):
        total = x[row]
        for k in range(max(0, w - row), w):
            total -= band[row, k] * x[row + k - w]
        x[row] = total
    for row in range(2 * n - 1, -1, -1):
        total = x[row]
        for k in range(w + 1, min(2 * w, 2 * n - 1 - row + w) + 1):
            total -= band[row, k] * x[row + k - w]
        x[row] = total / band[row, w]
    return x[0::2].copy(), x[1::2].copy()


def _flow_right_side(residual: FloatArray, rows: FloatArray, kept: FloatArray) -> FloatArray:
    """Right-hand side of the Reynolds rows once the complementarity is eliminated, shape (n,)."""
    known = np.pad(kept[::2], ((0, 0), (1, 1)))  # change of pressure and saturation; nothing beyond both ends
    around = np.stack([known[:, k : k + len(residual)] for k in range(3)], axis=1)
    right: FloatArray = -residual - (rows[:2] * around).sum(axis=(0, 1))
    return right


def _newton_change(
    contact: LubricatedContact,
    residual: FloatArray,
    rows: FloatArray,
    kept: FloatArray,
    slope: FloatArray,
    elastic: FloatArray,
    compliance_factor: float,
) -> tuple[FloatArray, FloatArray]:
    """Changes of gap and of the unknown left in each cell; NotConvergedError: GMRES did not converge."""
    stiffness = contact.body.stiffness_band / compliance_factor
    kernel = np.concatenate((stiffness[:0:-1], stiffness))  # of the product with the banded stiffness
    band = _factored_band(rows, kept, slope, stiffness)
    none = np.zeros_like(elastic)

    def deflected(gap: FloatArray, pressure: FloatArray) -> FloatArray:
        return gap - compliance_factor * contact.body.deflection(pressure)

    def solved(y: FloatArray, flow: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Changes of gap, unknown and total pressure for a right-hand side y [m] of the banded elastic equation."""
        pushed = np.convolve(y, kernel, 'same')
        gap, left = _solve_band(band, pushed + kept[0], flow) if flow is not none else _solve_band(band, pushed, none)
        return gap, left, np.convolve(gap, kernel, 'same') - pushed

    gap, left, total = solved(-elastic, _flow_right_side(residual, rows, kept))
    wanted = -elastic - deflected(gap, total)
    tolerance = max(_GMRES_TOLERANCE * float(np.linalg.norm(elastic)), 0.1 * _GAP_TOLERANCE)

    def product(y: FloatArray) -> FloatArray:
        by_gap, _, by_total = solved(y, none)
        return deflected(by_gap, by_total)

    with named_errors('contact step', StalledError, NotConvergedError):
        y = contact.solve(product, wanted, tolerance, _GMRES_ITERATIONS)
    more_gap, more_left, _ = solved(y, none)
    return gap + more_gap, left + more_left


def contact_step(
    contact: LubricatedContact,
    guess: ContactState,
    rigid_gap: FloatArray,
    wall_velocity: float,
    ends: FilmEnds,
    old_thickness: FloatArray,
    time_step: float,
    compliance_factor: float = 1.0,
) -> ContactStep:
    """Film and gap after one implicit Euler step; infinite ``time_step`` [s] for the steady film.

    ``guess`` is the start of Newton's method: the state before the step, or an extrapolation. ``rigid_gap`` [m] is that
    at the end of the step without the deflection by film and asperities, ``old_thickness`` [m] theta h before the step,
    shape (n,) each; the wall has its velocity [m/s] in the frame of the seal. ``compliance_factor`` scales the
    compliance of the half-plane (viscoelastic seal). NotConvergedError: Newton's method or GMRES did not converge, or
    the surfaces would overlap.
    """
    plane, rough, numbers = contact.body, contact.rough, contact.grease.numbers
    rate = 1.0 / time_step
    gap, pressure, saturation = (np.array(values) for values in guess)
    for iteration in range(_ITERATIONS):
        properties = film_properties(gap, wall_velocity, numbers, rough)
        residual, rows, flow = reynolds_rows(
            gap, pressure, saturation, properties, 0.5 * wall_velocity, rate, old_thickness, plane.cell_width, ends
        )
        kept, imperfection = complementarity(pressure, saturation, _PRESSURE_SCALE)
        solid, slope = contact.asperity_pressure(gap)
        elastic = gap - rigid_gap - compliance_factor * plane.deflection(pressure + solid)
        largest_flow = (
            _LEAST_FLOW + float(np.abs(flow).max()) + rate * plane.cell_width * float(np.abs(old_thickness).max())
        )
        off = float(np.abs(elastic).max())
        # rounding error of the difference of two pressures, times the mobility
        rounding = _ROUNDING * float((properties[0] * pressure).max()) / plane.cell_width
        flow_off = max(float(np.abs(residual).max()) - rounding, 0.0) / largest_flow
        if not math.isfinite(off + flow_off):
            break
        if off <= _GAP_TOLERANCE and flow_off <= _FLOW_TOLERANCE and imperfection <= _COMPLEMENTARITY_TOLERANCE:
            if gap.min() <= 0.0:
                raise NotConvergedError(
                    f'contact step: the surfaces overlap by {-gap.min():.2g} m: the roughness is crushed; give it a '
                    'larger rms_height or a shorter roll_off_length'
                )
            return ContactStep(ContactState(gap, pressure, saturation), flow, iteration)
        change, left = _newton_change(contact, residual, rows, kept, slope, elastic, compliance_factor)
        gap = gap + change
        pressure = pressure + kept[0] + kept[1] * left
        saturation = saturation + kept[2] + kept[3] * left
    raise NotConvergedError(
        f'contact step: not converged after {iteration + 1} iterations: {off:.2g} m of elastic equation, '
        f'{flow_off:.2g} of the largest flow and {imperfection:.2g} of complementarity left'
    )


def dry_contact(contact: LubricatedContact, rigid_gap: FloatArray, guess: FloatArray | None = None) -> FloatArray:
    """Gap of the dry rough contact [m], shape (n,): h = g + K p_c(h); Newton's method begins at ``guess``, or at g.

    NotConvergedError: Newton's method did not converge.
    """
    plane = contact.body
    matrix = plane.matrix
    gap = np.array(rigid_gap if guess is None else guess)
    identity: Any = np.eye(plane.cells)
    for _iteration in range(_ITERATIONS):
        solid, slope = contact.asperity_pressure(gap)
        elastic = gap - rigid_gap - matrix @ solid
        if np.abs(elastic).max() <= _GAP_TOLERANCE:
            return gap
        gap = gap - np.linalg.solve(identity - matrix * slope, elastic)
    raise NotConvergedError(f'dry contact: {np.abs(elastic).max():.2g} m left after {_ITERATIONS} iterations')
