r"""Internal force and stiffness of the section: bilinear quadrilaterals with mean dilatation.

The energy of an element is the shear energy at its four Gauss points plus the energy of its mean volume ratio
:math:`\Theta = v / V`; the mean prevents volumetric locking [Nagtegaal1974]_, [Simo1985]_:

.. math:: \Pi = \sum_g w_g W(F_g) + V \frac{K}{2} (\Theta - 1)^2, \quad v = \sum_g w_g J_g, \quad w_g = 2 \pi R_g \det

The formulation refers to the undeformed ring, so F = F_0 + B u is linear in the displacements and B is constant.
"""

from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.oring_contact.material import Rubber, RubberField, shear_response, volume_response
from seal_friction_ros.core.oring_contact.mesh import Mesh

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_POINTS = _CORNERS / np.sqrt(3.0)
_UNDEFORMED = np.array([1.0, 0.0, 0.0, 1.0, 1.0])


class Elements(NamedTuple):
    """Quantities of the elements that do not depend on the displacements."""

    freedoms: IntArray  # degrees of freedom of each element: r and z of its corners in turn, shape (e, 8)
    gradient_rows: FloatArray  # B [1/m], shape (e, 4, 5, 8)
    weights: FloatArray  # reference volume of each Gauss point over the full circumference [m^3], shape (e, 4)


class ElementForces(NamedTuple):
    """Contributions of the elements to the balance of forces, in the order of `Elements.freedoms`."""

    force: FloatArray  # [N], shape (e, 8)
    stiffness: FloatArray  # [N/m], shape (e, 8, 8)
    tension: FloatArray  # mean tension K (Theta - 1) [Pa], shape (e,)
    tension_rows: FloatArray  # derivative of the tension by the displacements [Pa/m], shape (e, 8)


def make_elements(mesh: Mesh) -> Elements:
    """Elements of a mesh: gradients of the shape functions and weights at the Gauss points."""
    corners = mesh.nodes[mesh.elements]
    along_x = 1.0 + _POINTS[:, None, 0] * _CORNERS[:, 0]
    along_y = 1.0 + _POINTS[:, None, 1] * _CORNERS[:, 1]
    shape = 0.25 * along_x * along_y  # (4 points, 4 corners)
    slope = 0.25 * np.stack((_CORNERS[:, 0] * along_y, _CORNERS[:, 1] * along_x), axis=-1)  # in natural coordinates
    jacobian = np.einsum('gak,eai->egik', slope, corners)
    gradient = np.einsum('gak,egki->egai', slope, np.linalg.inv(jacobian))
    radius = corners[:, :, 0] @ shape.T
    rows = np.zeros((len(corners), 4, 5, 4, 2))
    rows[:, :, 0, :, 0] = gradient[..., 0]
    rows[:, :, 1, :, 0] = gradient[..., 1]
    rows[:, :, 2, :, 1] = gradient[..., 0]
    rows[:, :, 3, :, 1] = gradient[..., 1]
    rows[:, :, 4, :, 0] = shape / radius[..., None]
    freedoms = (2 * mesh.elements[:, :, None] + np.arange(2)).reshape(-1, 8)
    return Elements(freedoms, rows.reshape(-1, 4, 5, 8), 2.0 * np.pi * radius * np.linalg.det(jacobian))


def deformation_gradient(elements: Elements, displacement: FloatArray) -> FloatArray:
    """Deformation gradient at the Gauss points, shape (e, 4, 5), for displacements [m], shape (2 n,)."""
    change: FloatArray = np.einsum('egif,ef->egi', elements.gradient_rows, displacement[elements.freedoms])
    return _UNDEFORMED + change


def is_inside_out(gradient: FloatArray) -> bool:
    """Whether the volume at any Gauss point is zero or negative, which is not physical."""
    area = gradient[..., 0] * gradient[..., 3] - gradient[..., 1] * gradient[..., 2]
    return bool((area <= 0.0).any() or (gradient[..., 4] <= 0.0).any())


def element_forces(
    elements: Elements, rubber: Rubber | RubberField, gradient: FloatArray, tension: FloatArray | None = None
) -> ElementForces:
    """Internal force and stiffness of every element at a deformation gradient of shape (e, 4, 5).

    The force uses the tension that follows from the volume. The stiffness multiplies the second derivatives of the
    volume by ``tension`` [Pa], shape (e,), if given. Newton's method then treats displacements and tensions as
    independent unknowns, with the tensions condensed out: it converges from larger steps than with displacements alone.
    """
    shear, volume = shear_response(rubber, gradient), volume_response(gradient)
    weights, rows = elements.weights, elements.gradient_rows
    count = len(rows)
    total = weights.sum(axis=1)
    bulk = np.ravel(rubber.bulk_modulus)  # of all elements, or of each
    true_tension: FloatArray = bulk * ((weights * volume.energy).sum(axis=1) / total - 1.0)
    assumed = true_tension if tension is None else tension
    flat = rows.reshape(count, 20, 8)
    transposed = np.swapaxes(flat, 1, 2)
    growth = (transposed @ (weights[..., None] * volume.stress).reshape(count, 20, 1))[..., 0]  # dv/du [m^2]
    force = (transposed @ (weights[..., None] * shear.stress).reshape(count, 20, 1))[..., 0]
    force += true_tension[:, None] * growth
    stiffness = weights[..., None, None] * (shear.stiffness + assumed[:, None, None, None] * volume.stiffness)
    matrix = transposed @ (stiffness @ rows).reshape(count, 20, 8)
    tension_rows = (bulk / total)[:, None] * growth
    matrix += growth[:, :, None] * tension_rows[:, None, :]
    return ElementForces(force, matrix, true_tension, tension_rows)


def volume_ratios(elements: Elements, gradient: FloatArray) -> FloatArray:
    """Theta of each element [-], shape (e,)."""
    volume = (elements.weights * volume_response(gradient).energy).sum(axis=1)
    ratio: FloatArray = volume / elements.weights.sum(axis=1)
    return ratio
