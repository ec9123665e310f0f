"""Equilibrium of the ring by Newton's method with a sparse stiffness and a direct solver; paths of equilibria."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.errors import NotConvergedError, named_errors
from seal_friction_ros.core.oring_contact.elements import (
    Elements,
    deformation_gradient,
    element_forces,
    is_inside_out,
    make_elements,
)
from seal_friction_ros.core.oring_contact.material import Rubber, RubberField
from seal_friction_ros.core.oring_contact.mesh import Mesh
from seal_friction_ros.core.oring_contact.surroundings import Surroundings, outline_freedoms, surface_forces

TOLERANCE = 1e-9  # Largest residual force at a node over 2 pi R E d (our choice).
MAX_ITERATIONS = 25  # Limit of Newton steps (our choice: good load steps take 3 to 8).
_SHORTEST_STEP = 1.0 / 64.0  # of the full Newton step, below which an inverted element is an error
_PIVOT = 0.01  # diagonal entry over the largest of its column, above which it is the pivot: little fill-in


class OringModel(NamedTuple):
    """Meshed ring of one rubber, or of one for each element."""

    mesh: Mesh
    elements: Elements
    rubber: Rubber | RubberField
    force_scale: float  # 2 pi R E d, R the radius of the ring [N]: reference of the residual forces
    guide: tuple[int, int]  # inner and outer node of the guide against rolling
    guide_stiffness: float  # force over difference of their axial displacements [N/m]


class OringState(NamedTuple):
    """Displacements and tensions of the ring."""

    displacement: FloatArray  # r and z of the nodes in turn [m], shape (2 n,)
    tension: FloatArray  # mean tension of the elements [Pa], shape (e,)


class Assembly(NamedTuple):
    """Places of the element, outline and guide entries in the sparse stiffness of the free displacements."""

    free: IntArray  # free displacements, shape (f,)
    slots: IntArray
    """index of each entry in the stored values; entries of fixed displacements go to one extra place at the end"""
    rows: IntArray  # row of each stored value
    starts: IntArray  # first stored value of each column, shape (f + 1,)


class ForceBalance(NamedTuple):
    """Residual forces and stiffness of the whole ring."""

    residual: FloatArray  # [N], shape (2 n,)
    entries: FloatArray  # stiffness of elements, outline and guide, flat [N/m]
    tension: FloatArray  # [Pa], shape (e,)
    tension_rows: FloatArray  # [Pa/m], shape (e, 8)


def make_model(
    mesh: Mesh, rubber: Rubber, section_diameter: float, guide: float, field: RubberField | None = None
) -> OringModel:
    """Model of a meshed ring of ``section_diameter`` d [m].

    Between frictionless walls a round ring rolls almost freely: only its hoop strain resists, and the facets of the
    mesh make the motion jump. The guide, a couple without net force, keeps the two nodes halfway to rod and gland at
    the same axial position (our choice; docs/oring.md has its influence). Its stiffness ``guide`` is that over 2 pi R
    E, R the radius of the ring. With a ``field`` each element has its own rubber, and ``rubber`` gives the scales.
    """
    center = mesh.nodes.mean(axis=0)
    quarter = np.array([section_diameter / 4.0, 0.0])
    inner, outer = (int(np.argmin(np.linalg.norm(mesh.nodes - center - side * quarter, axis=1))) for side in (-1, 1))
    per_length = float(2.0 * np.pi * center[0] * rubber.modulus)
    return OringModel(
        mesh, make_elements(mesh), field or rubber, per_length * section_diameter, (inner, outer), guide * per_length
    )


def unstressed_state(model: OringModel) -> OringState:
    """State without displacement and tension."""
    return OringState(np.zeros(model.mesh.nodes.size), np.zeros(len(model.mesh.elements)))


def outline(model: OringModel, state: OringState) -> FloatArray:
    """Positions of the nodes of the outline [m], shape (s, 2)."""
    position: FloatArray = model.mesh.nodes + state.displacement.reshape(-1, 2)
    return position[model.mesh.surface]


def make_assembly(model: OringModel, held: tuple[int, ...] = ()) -> Assembly:
    """Sparsity of the stiffness without the fixed displacements ``held`` (2 node for r, 2 node + 1 for z)."""
    count = model.mesh.nodes.size
    number = np.full(count, -1)
    free = np.setdiff1d(np.arange(count), held)
    number[free] = np.arange(len(free))
    stencil = outline_freedoms(model.mesh.surface)
    guided = np.array([[2 * node + 1 for node in model.guide]])
    blocks = ((model.elements.freedoms, model.elements.freedoms), (stencil[:, 2:4], stencil), (guided, guided))
    row = number[np.concatenate([np.repeat(rows, columns.shape[1], axis=1).ravel() for rows, columns in blocks])]
    column = number[np.concatenate([np.tile(columns, (1, rows.shape[1])).ravel() for rows, columns in blocks])]
    keys = np.where((row >= 0) & (column >= 0), column * len(free) + row, len(free) ** 2)
    stored, slots = np.unique(keys, return_inverse=True)
    stored = stored[stored < len(free) ** 2]
    starts = np.searchsorted(stored, np.arange(len(free) + 1) * len(free))
    return Assembly(free, slots, stored % len(free), starts)


def force_balance(model: OringModel, surroundings: Surroundings, state: OringState) -> ForceBalance | None:
    """Residual forces at a state; None if an element is inverted."""
    gradient = deformation_gradient(model.elements, state.displacement)
    if is_inside_out(gradient):
        return None
    inner = element_forces(model.elements, model.rubber, gradient, state.tension)
    outer = surface_forces(surroundings, outline(model, state))
    count = len(state.displacement)
    residual: FloatArray = np.bincount(model.elements.freedoms.ravel(), inner.force.ravel(), count).astype(float)
    residual.reshape(-1, 2)[model.mesh.surface] += outer.force
    low, high = (2 * node + 1 for node in model.guide)
    pull = model.guide_stiffness * (state.displacement[high] - state.displacement[low])
    residual[high] += pull
    residual[low] -= pull
    couple = model.guide_stiffness * np.array([1.0, -1.0, -1.0, 1.0])
    entries = np.concatenate((inner.stiffness.ravel(), outer.stiffness.ravel(), couple))
    return ForceBalance(residual, entries, inner.tension, inner.tension_rows)


def stiffness_matrix(assembly: Assembly, entries: FloatArray) -> csc_array:
    """Stiffness of the free displacements [N/m], shape (f, f)."""
    size, count = len(assembly.rows), len(assembly.free)
    data = np.bincount(assembly.slots, entries, size + 1)[:size]
    return csc_array((data, assembly.rows, assembly.starts), shape=(count, count))


def solve_equilibrium(
    model: OringModel, assembly: Assembly, surroundings: Surroundings, start: OringState
) -> tuple[OringState, int]:
    """Equilibrium state from a start state, and the number of Newton steps.

    NotConvergedError: an element is inverted, the stiffness is singular, or 25 steps do not converge.
    """
    state, now = start, force_balance(model, surroundings, start)
    if now is None:
        raise NotConvergedError('an element is inverted at the start')
    imbalance = np.inf
    for step in range(MAX_ITERATIONS + 1):
        residual = now.residual[assembly.free]
        imbalance = float(np.abs(residual).max()) / model.force_scale
        if not np.isfinite(imbalance):
            break
        if imbalance < TOLERANCE:
            return OringState(state.displacement, now.tension), step
        matrix = stiffness_matrix(assembly, now.entries)
        with named_errors('the stiffness is singular', RuntimeError, NotConvergedError):
            factors = splu(
                matrix, permc_spec='MMD_AT_PLUS_A', diag_pivot_thresh=_PIVOT, options={'SymmetricMode': True}
            )
        state, now = _take_newton_step(model, surroundings, state, now, assembly.free, factors.solve(residual))
    raise NotConvergedError(f'residual of {imbalance:.1e} 2 pi R E d after {MAX_ITERATIONS} Newton steps')


def _take_newton_step(
    model: OringModel,
    surroundings: Surroundings,
    state: OringState,
    now: ForceBalance,
    free: IntArray,
    step: FloatArray,
) -> tuple[OringState, ForceBalance]:
    """Take a Newton step, halved until no element is inverted; tensions change linearly with it."""
    length = 1.0
    while length >= _SHORTEST_STEP:
        change = np.zeros_like(state.displacement)
        change[free] = -length * step
        tension = now.tension + (now.tension_rows * change[model.elements.freedoms]).sum(axis=1)
        trial = OringState(state.displacement + change, tension)
        after = force_balance(model, surroundings, trial)
        if after is not None:
            return trial, after
        length /= 2.0
    raise NotConvergedError('a Newton step inverts an element')


_EASY = 6  # Newton steps; a step with no more is an easy one
_GROW, _SHRINK = 1.6, 0.5
_SMALLEST = 1e-4  # of the path


class PathEnd(NamedTuple):
    """Equilibrium at the end of a path."""

    state: OringState
    surroundings: Surroundings
    newton_steps: int  # without those of failed steps
    stride: float  # fraction of the path proposed for a next step


def follow_path(
    model: OringModel,
    assembly: Assembly,
    path: Callable[[float, OringState, float], Surroundings],
    start: OringState,
    stride: float = 1.0,
    guess: Callable[[OringState, float, float], OringState] | None = None,
) -> PathEnd:
    """Follow the equilibrium along a path of surroundings, in steps that grow after easy ones and shrink after failed.

    ``path`` gives the surroundings at a fraction of the path, 0 to 1, the last equilibrium, from ``start`` at 0, and
    its fraction; the first step is the fraction ``stride``. ``guess`` gives the start of Newton's method from the last
    equilibrium, its fraction and the next one, by default the linear extrapolation of the last two equilibria.
    NotConvergedError: a step fails at the smallest size; the message has the fraction reached.
    """
    done, state, before, total = 0.0, start, (0.0, start), 0
    surroundings = path(0.0, start, 0.0)
    while done < 1.0:
        wanted = done + stride
        wanted = 1.0 if wanted > 1.0 - 0.1 * stride else wanted
        first = guess(state, done, wanted) if guess else _extrapolated(before, (done, state), wanted)
        next_surroundings = path(wanted, state, done)
        try:
            after, steps = solve_equilibrium(model, assembly, next_surroundings, first)
        except NotConvergedError as error:
            stride = _SHRINK * (wanted - done)
            if stride < _SMALLEST:
                raise NotConvergedError(f'at {100.0 * done:.3g} % of the path: {error}') from None
            before = done, state  # start the retry from the last equilibrium
            continue
        if steps <= _EASY:
            stride = max(stride, _GROW * (wanted - done))
        before, done, state = (done, state), wanted, after
        surroundings, total = next_surroundings, total + steps
    return PathEnd(state, surroundings, total, stride)


def _extrapolated(before: tuple[float, OringState], now: tuple[float, OringState], wanted: float) -> OringState:
    if before[0] >= now[0]:
        return now[1]
    ratio = (wanted - now[0]) / (now[0] - before[0])
    change = now[1].displacement - before[1].displacement
    return now[1]._replace(displacement=now[1].displacement + ratio * change)
