"""Deflection of the seal surface under pressure: a half-plane, or finite elements."""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import toeplitz

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray

_HALF_BAND = 6  # of the approximate inverse; 4 to 10 run alike


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """What the contact needs of the body under the film, on cells of one width; `half_plane`, `condensed_body`."""

    cell_width: float  # [m]
    modulus: float  # plane-strain modulus E* = E / (1 - nu^2) [Pa], of the asperities, too
    matrix: FloatArray = field(repr=False)
    """deflection of a cell by a pressure in another [m/Pa], shape (cells, cells)"""
    stiffness_band: FloatArray = field(init=False, repr=False)
    """banded approximate inverse of the matrix: stiffness against a cell r away [Pa/m], shape (7,)"""

    def __post_init__(self) -> None:
        object.__setattr__(self, 'stiffness_band', _stiffness_band(self.cells, self.cell_width, self.modulus))

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.matrix)

    def deflection(self, pressure: FloatArray) -> FloatArray:
        """Deflection [m] of each cell under ``pressure`` [Pa], shape (cells,)."""
        deflected: FloatArray = self.matrix @ pressure
        return deflected


def half_plane(cells: int, cell_width: float, modulus: float, depth: float) -> ElasticBody:
    r"""A half-plane on a uniform grid of cells, each with one pressure, rigid at a depth.

    .. math:: u(x) = \frac{2}{\pi E^*} \int p(s) \ln\frac{d}{|x - s|}\,ds

    exact for a pressure that is constant in each cell. The deflection of a half-plane is unbounded, so a ``depth`` d
    [m] fixes where it is zero: about the height of the seal section (our choice). ValueError: there are fewer than 16
    cells, or the film is wider than the depth.

    Source: K. L. Johnson, Contact Mechanics, 1985, section 2.3 and appendix.
    """
    if cells < 16:
        raise ValueError(f'half_plane: cells = {cells} is too few: take 16 at least')
    if depth < cells * cell_width:
        raise ValueError(f'half_plane: depth = {depth} m is less than the {cells * cell_width} m of the film')
    influence = influence_of_cells(np.arange(cells), cell_width, modulus, depth)
    return ElasticBody(cell_width, modulus, np.asarray(toeplitz(influence)))


def hat_functions(places: FloatArray, nodes: FloatArray) -> FloatArray:
    """Value of the hat function of each of ``nodes`` (increasing) at each of ``places``, shape (places, nodes)."""
    return np.stack([np.interp(places, nodes, unit) for unit in np.eye(len(nodes))], axis=1)


def condensed_body(
    places: FloatArray, nodes: FloatArray, compliance: FloatArray, modulus: float, circumference: float
) -> ElasticBody:
    r"""Body on the cells of a film from the compliance of the nodes of its surface.

    .. math:: K = N C N^T + A - \Pi A \Pi,\quad \Pi = N (N^T N)^{-1} N^T

    with the compliance C of the nodes, all round [m/N], shape (m, m), their hat functions N in the cells, and the
    influence matrix A of the half-plane of the plane-strain ``modulus`` E* [Pa], which answers to what is shorter than
    the elements (the split is our choice). Where C is that of a half-plane, K is A, whatever the mesh. A pressure that
    follows the surface makes C slightly unsymmetric; K is made symmetric, and nowhere stiffer than A at its stiffest,
    which keeps it positive (our choice). The centres of the cells ``places`` [m], shape (n,), are in equal steps within
    the increasing ``nodes`` [m], shape (m,); a force acts on the ``circumference`` [m], 1 m for plane strain.
    """
    width = float(places[1] - places[0])
    hats = hat_functions(places, nodes)
    deep = half_plane(len(places), width, modulus, 2.0 * len(places) * width).matrix
    seen = hats @ np.linalg.pinv(hats)  # what the nodes can follow
    coarse = circumference * width * hats @ compliance @ hats.T
    whole = coarse + deep - seen @ deep @ seen
    values, shapes = np.linalg.eigh(0.5 * (whole + whole.T))
    least = float(np.linalg.eigvalsh(deep)[0])
    return ElasticBody(width, modulus, (shapes * np.maximum(values, least)) @ shapes.T)


def influence_of_cells(distance: FloatArray | IntArray, width: float, modulus: float, depth: float) -> FloatArray:
    """Integral of the kernel over a cell whose centre is ``distance`` cells away [m/Pa]."""
    far, near = (distance + 0.5) * width, (distance - 0.5) * width
    logarithms = far * np.log(far) - near * np.log(np.abs(near))
    return np.asarray(2.0 / (math.pi * modulus) * (width * (1.0 + math.log(depth)) - logarithms))


def _stiffness_band(cells: int, width: float, modulus: float) -> FloatArray:
    """Inverse of the influence matrix of a long periodic grid, cut to a band; the diagonal keeps the sum of a row."""
    length = 8 * cells
    distance = np.minimum(np.arange(length), length - np.arange(length))
    spectrum = np.fft.rfft(influence_of_cells(distance, width, modulus, length * width)).real
    spectrum[0] = math.inf
    band = np.fft.irfft(1.0 / spectrum, length)[: _HALF_BAND + 1]
    band[0] = -2.0 * band[1:].sum() + modulus / (cells * width)
    return np.asarray(band)
