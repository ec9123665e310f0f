"""GMRES: a linear system known only by what its matrix does to a vector."""

import math
from collections.abc import Callable

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray


class StalledError(ArithmeticError):
    """The residual did not fall far enough."""


def gmres(
    product: Callable[[FloatArray], FloatArray], right: FloatArray, tolerance: float, iterations: int
) -> FloatArray:
    """Vector x with |right - A x| <= ``tolerance`` (2-norm), from x = 0, without restart.

    Args:
        product: Gives A x.
        right: Right-hand side, shape (n,).
        tolerance: Of the residual, in the unit of ``right``.
        iterations: Most products to take.

    Raises:
        StalledError: The residual is not that small after ``iterations``, or not a number.

    Source: Y. Saad, M. H. Schultz 1986.
    """
    size = float(np.linalg.norm(right))
    if size <= tolerance:
        return np.zeros_like(right)
    basis = np.empty((iterations + 1, len(right)))
    basis[0] = right / size
    columns: list[list[float]] = []  # of the triangle that rotations make of the Hessenberg matrix
    rotations: list[tuple[float, float]] = []
    rotated = [size]
    for k in range(iterations):
        image = product(basis[k])
        vectors = basis[: k + 1]
        shares = vectors @ image
        image = image - shares @ vectors
        again = vectors @ image
        image -= again @ vectors
        column = (shares + again).tolist()
        length = float(np.linalg.norm(image))
        for i, (cosine, sine) in enumerate(rotations):
            column[i], column[i + 1] = (
                cosine * column[i] + sine * column[i + 1],
                cosine * column[i + 1] - sine * column[i],
            )
        radius = math.hypot(column[k], length)
        if not 0.0 < radius < math.inf:
            break
        rotations.append((column[k] / radius, length / radius))
        column[k] = radius
        columns.append(column)
        rotated.append(-rotations[k][1] * rotated[k])
        rotated[k] *= rotations[k][0]
        if abs(rotated[k + 1]) <= tolerance:
            weights = [0.0] * (k + 1)
            for i in range(k, -1, -1):
                above = sum(columns[j][i] * weights[j] for j in range(i + 1, k + 1))
                weights[i] = (rotated[i] - above) / columns[i][i]
            return np.asarray(weights @ vectors)
        basis[k + 1] = image / length
    raise StalledError(f'GMRES: {abs(rotated[-1]):.2g} of {size:.2g} left after {len(columns)} iterations')
