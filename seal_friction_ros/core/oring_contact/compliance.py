"""How the face of a loaded ring on the sliding wall, rod or bore, gives way to a little more pressure.

The ring is in equilibrium under squeeze and fluid pressure. A lubricated wall then changes the pressure on its face a
little. The ring answers linearly, with its stiffness in that state (geometric stiffness, nearly incompressible), held
by the other walls and the fluid. Where it touches it sticks: along the walls of its groove, and along the sliding wall
while the face moves towards or away from it (our choice: without friction a ring under a given pressure would roll
away).
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import dia_array
from scipy.sparse.linalg import splu

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import NotConvergedError, named_errors
from seal_friction_ros.core.oring_contact.equilibrium import (
    OringModel,
    OringState,
    force_balance,
    make_assembly,
    outline,
    stiffness_matrix,
)
from seal_friction_ros.core.oring_contact.loading import LoadedRing
from seal_friction_ros.core.oring_contact.surroundings import (
    GLAND,
    ROD,
    WALL,
    Surroundings,
    node_areas,
    surface_pressure,
)

_OUT_OF_REACH = 1.0  # [m]


class SlidingFace(NamedTuple):
    """Nodes of the outline that face the sliding wall, m of them, from upstream to downstream."""

    place: FloatArray  # z [m], shape (m,)
    gap: FloatArray  # to the wall [m]; negative by the penetration that the penalty allows, shape (m,)
    pressure: FloatArray  # on the ring, of fluid and sliding wall together [Pa], shape (m,)
    compliance: FloatArray  # displacement off the wall by a force off it on a node, all round [m/N], shape (m, m)
    axial_stiffness: float  # axial force on the contact over its mean axial displacement [N/m]


def sliding_face(model: OringModel, loaded: LoadedRing, wall: int) -> SlidingFace:
    """The face of a loaded ring on ``wall``, `ROD` or `GLAND`, with the stiffness of the ring without that wall.

    NotConvergedError: the stiffness is singular.
    """
    inward = 1.0 if wall == ROD else -1.0  # towards the axis
    position = outline(model, loaded.state)
    there = surface_pressure(loaded.surroundings, position)
    center = model.mesh.nodes.mean(axis=0)
    original = model.mesh.nodes[model.mesh.surface] - center
    facing = np.flatnonzero(-inward * original[:, 0] >= np.abs(original[:, 1]) - 1e-12)
    facing = facing[np.argsort(position[facing, 1])]
    nodes = model.mesh.surface

    shares = there.shares[:, 1:]
    areas = np.linalg.norm(node_areas(position), axis=1)
    stuck = np.zeros(model.mesh.nodes.size)
    stuck[2 * nodes + 1] = loaded.surroundings.penalty * areas * shares[:, GLAND if wall == ROD else ROD]
    stuck[2 * nodes] = loaded.surroundings.penalty * areas * shares[:, WALL]
    weight = shares[facing, wall] * areas[facing]
    weight = weight / weight.sum()
    radial, axial = 2 * nodes[facing], 2 * nodes[facing] + 1

    pulled = np.zeros((model.mesh.nodes.size, 1))
    pulled[axial, 0] = weight
    moved = small_displacements(model, loaded.surroundings, loaded.state, pulled, stuck)
    axial_stiffness = 1.0 / float(weight @ moved[axial, 0])

    stuck[2 * nodes + 1] += loaded.surroundings.penalty * areas * shares[:, wall]
    pushed = np.zeros((model.mesh.nodes.size, len(facing)))
    pushed[radial, np.arange(len(facing))] = 1.0
    walls = loaded.surroundings
    radius = walls.rod_radius if wall == ROD else walls.gland_radius
    beyond = radius - inward * _OUT_OF_REACH
    without = walls._replace(rod_radius=beyond) if wall == ROD else walls._replace(gland_radius=beyond)
    compliance = small_displacements(model, without, loaded.state, pushed, stuck)[radial]
    return SlidingFace(
        place=position[facing, 1],
        gap=inward * (position[facing, 0] - radius),
        pressure=there.total[facing] * (there.shares[facing, 0] + shares[facing, wall]),
        compliance=compliance,
        axial_stiffness=axial_stiffness,
    )


def small_displacements(
    model: OringModel,
    surroundings: Surroundings,
    state: OringState,
    loads: FloatArray,
    springs: FloatArray | None = None,
    held: tuple[int, ...] = (),
) -> FloatArray:
    """Displacements of a meshed ring or section by small ``loads`` [N] about an equilibrium [m], both (2 n, columns).

    ``springs`` to the ground have a stiffness [N/m], shape (2 n,). Displacements that are ``held`` are zero (2 node for
    r, 2 node + 1 for z). NotConvergedError: an element is inverted, or the stiffness is singular.
    """
    balance = force_balance(model, surroundings, state)
    if balance is None:
        raise NotConvergedError('small_displacements: an element is inverted')
    assembly = make_assembly(model, held)
    matrix = stiffness_matrix(assembly, balance.entries)
    if springs is not None:
        size = len(assembly.free)
        matrix = matrix + dia_array((springs[None, assembly.free], np.zeros(1, int)), shape=(size, size))
    moved = np.zeros_like(loads)
    with named_errors('small_displacements: the stiffness is singular', RuntimeError, NotConvergedError):
        moved[assembly.free] = splu(matrix.tocsc()).solve(loads[assembly.free])
    return moved
