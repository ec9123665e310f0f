"""GMRES for a linear system whose matrix is known only by its product with a vector.

Own code for whole motions, whose many small systems `contact.scipy_gmres` solves 1.26 to 1.45 times slower. Processor
time of one cycle of ``inner_seal``, best of six, in two series on a busy machine: 1.8 and 2.1 s with this function, 2.6
and 2.9 s with SciPy's (226 cells); best of two and of four with 1000 cells: 11.0 and 8.9 s, 13.8 and 12.5 s. The number
of Newton iterations is the same, and the friction agrees to 1e-15 of its maximum. The matrix is dense, so no sparse
direct solver applies; assembling it and `scipy.linalg.solve` took 12 s (226 cells).
"""

import math
from collections.abc import Callable

import numpy as np
from scipy.linalg.lapack import dgels

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.lubrication.contact import StalledError


def gmres(
    product: Callable[[FloatArray], FloatArray], right: FloatArray, tolerance: float, iterations: int
) -> FloatArray:
    """Vector x with |right - A x| <= ``tolerance`` (2-norm), from x = 0, without restart.

    Args:
        product: Computes A x.
        right: Right-hand side, shape (n,).
        tolerance: Of the residual, in the unit of ``right``.
        iterations: Largest number of products.

    Raises:
        StalledError: The residual is larger after ``iterations``, or not a number.

    Source: Y. Saad, M. H. Schultz 1986.
    """
    size = left = float(np.linalg.norm(right))
    if size <= tolerance:
        return np.zeros_like(right)
    basis, hessenberg = np.empty((iterations + 1, len(right))), np.zeros((iterations + 1, iterations))
    basis[0], start = right / size, np.eye(iterations + 1)[0] * size
    for k in range(iterations):
        vectors, image = basis[: k + 1], product(basis[k])
        for _ in range(2):  # the second orthogonalisation removes the rounding errors of the first
            shares = vectors @ image
            image = image - shares @ vectors
            hessenberg[: k + 1, k] += shares
        length = hessenberg[k + 1, k] = float(np.linalg.norm(image))
        if not math.isfinite(length):
            break
        reduced = hessenberg[: k + 2, : k + 1]
        _, weights, _ = dgels(reduced, start[: k + 2])  # least squares; residual at the end, if the rank is full
        left = abs(float(weights[-1]))
        if left <= tolerance:
            left = float(np.linalg.norm(start[: k + 2] - reduced @ weights[:-1]))
            if left <= 2.0 * tolerance:  # but for rounding the same, unless the matrix is singular
                return np.asarray(weights[:-1] @ vectors)
        if length == 0.0:
            break
        basis[k + 1] = image / length
    raise StalledError(f'GMRES: {left:.2g} of {size:.2g} left after {k + 1} iterations')
