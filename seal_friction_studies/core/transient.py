r"""A whole motion of one seal, step by step: `initial_state`, then `transient_step` repeatedly.

The spool drives the contact through the groove (`groove`): lag e, velocity of the contact v = spool velocity - de/dt.
A step first computes v from the balance of spring and friction, with the film of the previous step and with sticking,
then the film with that v. The film is integrated by the backward differentiation formula of second order with variable
steps (BDF2, [Hairer1993]_ section III.5), which damps as the implicit Euler step does. The first step, and all steps of
a seal that hands lubricant over to the wall, are implicit Euler steps: each of them conserves what is handed over (our
choice). Forces are positive where they resist a motion to the right, so friction has the sign of the velocity.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.lubrication.contact import (
    ContactState,
    contact_step,
    dry_contact,
    film_properties,
)
from seal_friction_ros.core.lubrication.model import LubricationModel, fluid_force, profile_model, solid_limit
from seal_friction_ros.core.lubrication.reynolds import FilmEnds
from seal_friction_studies.core.balance import sliding_velocity
from seal_friction_studies.core.kinematics import SpoolMotion
from seal_friction_studies.core.krylov import gmres
from seal_friction_studies.core.study_case import StudyCase
from seal_friction_studies.core.wall import WallFilm

_MOST_HALVINGS = 10
_LONGEST_WALL = 1_000_000  # cells of its film
_LARGEST_RECORD = 100_000_000  # numbers along the seal that a run may keep, 0.8 GB


@dataclass(frozen=True, eq=False)
class TransientModel(LubricationModel):
    """A seal on a wall that may have a control edge; `transient_model` makes it."""

    case: StudyCase

    def rigid_gap(self, contact_place: float) -> FloatArray:
        """Gap of the undeformed seal [m] with its crown at ``contact_place`` along the wall [m]."""
        edge = self.case.control_edge
        return self.profile if edge is None else self.profile + edge.fall(contact_place + self.place)[0]


def transient_model(case: StudyCase) -> TransientModel:
    """Model of a case; as `profile_model`.

    Raises:
        ValueError: The grid does not fit the seal, or the seal is an O-ring.
    """
    if case.oring is not None:
        raise ValueError(f'case {case.name}: an O-ring has a friction map only: seal_friction ehl map')
    model = profile_model(case, case.air.pressure_left, case.air.pressure_right)
    return TransientModel(**vars(model) | {'contact': dataclasses.replace(model.contact, solve=gmres)})


class StepBefore(NamedTuple):
    """What the formula of second order needs of the step before."""

    thickness: FloatArray  # theta h at its start [m], shape (n,)
    creep: FloatArray  # at its start [m], shape (parts, n)
    step: float  # [s]
    velocity: float  # of the contact, mean of the step [m/s]


class TransientState(NamedTuple):
    """State of a seal between two steps."""

    time: float  # [s]
    position: float  # of the spool [m]
    lag: float  # of the contact behind the spool [m]
    seat: float  # lag at which the seal would rest in its groove, s of `groove` [m]
    state: ContactState
    wall_film: WallFilm | None  # film on the wall outside the seal; None where it is flooded
    creep: FloatArray  # viscoelastic parts of the deflection [m], shape (parts, n); none for an elastic seal
    before: StepBefore | None = None  # None: the next step is an implicit Euler step

    @property
    def contact_place(self) -> float:
        """Crown of the seal along the wall [m]."""
        return self.position - self.lag


class SealForces(NamedTuple):
    """Forces of the wall on the seal at the end of a step [N]."""

    friction: float  # solid + fluid + edge
    solid: float
    fluid: float
    edge: float  # axial part of the pressure on the chamfer; it pushes the seal out of the seat
    sliding_velocity: float  # of the contact over the wall [m/s]


class TransientResult(NamedTuple):
    """A run; arrays with one entry per step, the first after the first step."""

    case: StudyCase
    time: FloatArray  # [s]
    position: FloatArray  # of the spool [m]
    velocity: FloatArray  # of the spool [m/s]
    sliding_velocity: FloatArray  # of the contact [m/s]
    friction: FloatArray  # [N], with the sign of the velocity it resists
    solid: FloatArray  # [N]
    fluid: FloatArray  # [N]
    edge: FloatArray  # [N]
    lag: FloatArray  # [m]
    place: FloatArray  # cells along the seal [m], shape (n,)
    gap: FloatArray  # [m], shape (steps, n)
    film_pressure: FloatArray  # [Pa], shape (steps, n)
    contact_pressure: FloatArray  # [Pa], shape (steps, n)
    saturation: FloatArray  # shape (steps, n)
    retried_steps: int  # steps that did not converge and were repeated in halves
    newton_iterations: int
    mass_defect: float
    """largest difference between lubricant in and out and that in the film, over that in the film, of any step"""


def last_cycle(result: TransientResult) -> BoolArray:
    """Whether each step is in the last cycle of the motion of the case, shape (steps,)."""
    begin = result.time[-1] * (1.0 - 1.0 / result.case.motion.cycles)
    return np.asarray(result.time > begin + 1e-12)


def initial_state(model: TransientModel, position: float) -> TransientState:
    """The seal at rest and relaxed on its left seat: dry contact, gap filled by the film on the wall.

    Raises:
        NotConvergedError: The dry contact was not found.
        ValueError: The wall is too long to carry a film.
    """
    case = model.case
    n = case.numerics.cells
    lag = -case.seated_groove.half_clearance
    air_deflects = model.contact.body.deflection(model.ambient)
    gap = dry_contact(model.contact, model.rigid_gap(position - lag) + air_deflects)
    pressure, _ = model.contact.asperity_pressure(gap)
    shares, _ = _creep(case)
    creep = np.outer(shares, model.contact.body.deflection(pressure + model.ambient))
    saturation, wall_film = np.ones(n), None
    if case.film_supply:
        film = case.film_supply.initial_film
        saturation = np.minimum(1.0, 2.0 * film / gap)
        width = model.contact.body.cell_width
        reach = case.motion.distance + 2.0 * case.numerics.film_width
        count = math.ceil(2.0 * reach / width)
        if count > _LONGEST_WALL:
            raise ValueError(
                f'case {case.name}: the film on the wall has {count} cells: make motion.distance shorter, '
                'or leave out film_supply'
            )
        start = position - reach
        wall_film = WallFilm(start, width, np.full(count, film * width))
    state = ContactState(gap, np.array(model.ambient), saturation)
    return TransientState(0.0, position, lag, lag, state, wall_film, creep)


def transient_step(
    model: TransientModel, moment: TransientState, time: float, position: float
) -> tuple[TransientState, SealForces, int, float]:
    """One step to ``time`` [s], when the spool is at ``position`` [m].

    Returns:
        The next moment, forces, iterations of Newton's method, and the share of the lubricant that was not conserved.

    Raises:
        NotConvergedError: The step did not converge; a smaller one may.
    """
    case, contact = model.case, model.contact
    width = contact.body.cell_width
    step = time - moment.time
    velocity, lag = _slide(model, moment, step, position)
    at_end = _velocity_at_end(moment, velocity, step)
    contact_place = position - lag
    way = contact_place - moment.contact_place
    ends, taken = _supply(model, moment, way, step)
    start = start_of_step(moment, step)
    shares, times = _creep(case)
    kept = times / (times + start.step)  # of each creep after an implicit Euler step
    compliance = 1.0 - float(shares @ kept)
    rigid = model.rigid_gap(contact_place) + kept @ start.creep
    done = contact_step(contact, moment.state, rigid, -at_end, ends, start.thickness, start.step, compliance)
    state = done.state

    film_volume = float((state.saturation * state.gap).sum()) * width
    gained = (float(done.flow[0]) - float(done.flow[-1])) * start.step
    defect = abs(film_volume - float(start.thickness.sum()) * width - gained) / film_volume
    wall_film = moment.wall_film
    if wall_film is not None:
        wall_film = _wall_film_after(model, moment, wall_film, taken, done.flow * step, contact_place)
    solid_pressure, _ = contact.asperity_pressure(state.gap)
    deflected = contact.body.deflection(state.pressure + solid_pressure)
    creep = kept[:, None] * start.creep + np.outer(shares * (1.0 - kept), deflected)
    before = None if wall_film is not None else StepBefore(_thickness(moment), moment.creep, step, velocity)
    seat = case.seated_groove.seat(moment.seat, lag, _bottom_force(model, moment.state))
    after = TransientState(time, position, lag, seat, state, wall_film, creep, before)
    return after, _forces(model, after, at_end), done.iterations, defect


def _creep(case: StudyCase) -> tuple[FloatArray, FloatArray]:
    """Shares of the compliance that creep, and their times [s]; both empty for an elastic seal."""
    parts = case.viscoelasticity.creep if case.viscoelasticity else ()
    shares, times = np.array(parts, dtype=np.float64).reshape(-1, 2).T
    return shares, times


def _thickness(moment: TransientState) -> FloatArray:
    """Film theta h [m], shape (n,)."""
    thickness: FloatArray = moment.state.saturation * moment.state.gap
    return thickness


def start_of_step(moment: TransientState, step: float) -> StepBefore:
    r"""Start and length of the implicit Euler step that is one step of BDF2.

    With :math:`w = \Delta t_n / \Delta t_{n-1}` the formula is

    .. math:: u_{n+1} - \frac{(1 + w)^2 u_n - w^2 u_{n-1}}{1 + 2 w} = \frac{1 + w}{1 + 2 w} \Delta t_n\, \dot u_{n+1}.

    Where it would start from less than no film, the step is an implicit Euler step.
    """
    thickness, creep, before = _thickness(moment), moment.creep, moment.before
    if before is None:
        return StepBefore(thickness, creep, step, 0.0)
    ratio = step / before.step
    now, earlier = (1.0 + ratio) ** 2 / (1.0 + 2.0 * ratio), ratio**2 / (1.0 + 2.0 * ratio)
    start = now * thickness - earlier * before.thickness
    if start.min() <= 0.0:
        return StepBefore(thickness, creep, step, 0.0)
    length = step * (1.0 + ratio) / (1.0 + 2.0 * ratio)
    return StepBefore(start, now * creep - earlier * before.creep, length, 0.0)


def _velocity_at_end(moment: TransientState, velocity: float, step: float) -> float:
    """Velocity of the contact [m/s] at the end of a step, from its mean over this step and over the one before."""
    before = moment.before
    if before is None or velocity * before.velocity <= 0.0:
        return velocity
    at_end = velocity + (velocity - before.velocity) * step / (step + before.step)
    return at_end if at_end * velocity > 0.0 else velocity


def _edge_force(model: TransientModel, moment: TransientState) -> float:
    edge = model.case.control_edge
    if edge is None:
        return 0.0
    solid, _ = model.contact.asperity_pressure(moment.state.gap)
    _, slope = edge.fall(moment.contact_place + model.place)
    axial = float(((moment.state.pressure + solid) * slope).sum()) * model.contact.body.cell_width
    return -model.circumference * axial


def _bottom_force(model: TransientModel, state: ContactState) -> float:
    """Normal force of the seal on the bottom of its groove [N]: that of film and asperities on its face."""
    if model.case.groove.friction_coefficient == 0.0:
        return 0.0
    solid, _ = model.contact.asperity_pressure(state.gap)
    return model.circumference * model.contact.body.cell_width * float((state.pressure + solid).sum())


def _slide(model: TransientModel, moment: TransientState, step: float, position: float) -> tuple[float, float]:
    """Sliding velocity [m/s] during the step and lag [m] after it."""
    groove = model.case.seated_groove
    stuck_lag = moment.lag + position - moment.position
    edge = _edge_force(model, moment)
    fluid_at_rest = fluid_force(model, moment.state, 0.0)
    solid = solid_limit(model, moment.state)
    normal_force = _bottom_force(model, moment.state)

    def spring(lag: float) -> float:
        return groove.force(lag, groove.seat(moment.seat, lag, normal_force))

    drive = spring(stuck_lag) - edge - fluid_at_rest
    if abs(drive) <= solid:
        return 0.0, stuck_lag
    velocity = sliding_velocity(
        drive,
        solid,
        lambda v: fluid_force(model, moment.state, v) - fluid_at_rest,
        lambda v: spring(stuck_lag - v * step) - edge - fluid_at_rest,
        max(abs(position - moment.position), (abs(drive) - solid) / groove.stiffness) / step,
    )
    return velocity, stuck_lag - velocity * step


def _forces(model: TransientModel, moment: TransientState, velocity: float) -> SealForces:
    fluid = fluid_force(model, moment.state, velocity)
    edge = _edge_force(model, moment)
    limit = solid_limit(model, moment.state)
    if velocity:
        solid = math.copysign(limit, velocity)
    else:  # stuck: the asperities balance the spring, up to their limit
        asked = model.case.seated_groove.force(moment.lag, moment.seat) - edge - fluid
        solid = min(max(asked, -limit), limit)
    return SealForces(solid + fluid + edge, solid, fluid, edge, velocity)


def _supply(model: TransientModel, moment: TransientState, way: float, step: float) -> tuple[FilmEnds, FloatArray]:
    """Ends of the film for a step by ``way`` [m], and the lubricant taken from each cell of the wall [m^2]."""
    if moment.wall_film is None or way == 0.0:
        return model.ends(), np.zeros(1)
    left, right = _seal_ends(model, moment.contact_place)
    swept = (right, right + way) if way > 0.0 else (left + way, left)
    taken = moment.wall_film.ahead(*swept, left, right)
    end = -1 if way > 0.0 else 0
    numbers, rough = model.case.grease.numbers, model.contact.rough
    height = film_properties(moment.state.gap, way / step, numbers, rough)[2, end]
    filled = min(1.0, float(taken.sum()) / (0.5 * abs(way) * float(height)))
    return (model.ends(right=filled) if way > 0.0 else model.ends(left=filled)), taken


def _seal_ends(model: TransientModel, contact_place: float) -> tuple[float, float]:
    half = 0.5 * model.case.numerics.film_width
    return contact_place - half, contact_place + half


def _wall_film_after(
    model: TransientModel,
    moment: TransientState,
    wall_film: WallFilm,
    taken: FloatArray,
    through: FloatArray,
    contact_place: float,
) -> WallFilm:
    """Film on the wall after the volumes ``through`` the faces [m^2] have moved; the seal is at ``contact_place``."""
    old_left, old_right = _seal_ends(model, moment.contact_place)
    left, right = _seal_ends(model, contact_place)
    if contact_place == moment.contact_place:
        spilled = wall_film.moved(np.zeros_like(wall_film.volume), 0.0, left, left, left, -float(through[0]))
        return spilled.moved(np.zeros_like(wall_film.volume), 0.0, right, right, right, float(through[-1]))
    if contact_place > moment.contact_place:
        pushed = float(taken.sum()) + float(through[-1])
        return wall_film.moved(taken, pushed, right, old_left, left, -float(through[0]))
    pushed = float(taken.sum()) - float(through[0])
    return wall_film.moved(taken, pushed, left, right, old_right, float(through[-1]))


def run_transient(
    case: StudyCase, motion: SpoolMotion | None = None, on_step: Callable[[int], None] | None = None
) -> TransientResult:
    """Run a case through its motion, or through another.

    A step that does not converge is repeated in two halves, up to 10 times. Of steps that were taken at once
    (``numerics.steps_at_once``) those in between are interpolated.

    Args:
        case: The case.
        motion: Position of the spool; default: that of the case.
        on_step: Called with 1 after every step, for a progress bar.

    Raises:
        NotConvergedError: A step did not converge at the smallest size; the message has its time.
        ValueError: The result would not fit in memory.
    """
    moved = case.motion if motion is None else motion
    model = transient_model(case)
    steps = max(1, math.ceil(moved.duration / case.numerics.time_step - 1e-9))
    if 4 * steps * case.numerics.cells > _LARGEST_RECORD:
        raise ValueError(
            f'case {case.name}: {steps} steps of {case.numerics.cells} cells are too many to keep: make the motion '
            'shorter, or numerics.time_step longer'
        )
    moment = initial_state(model, moved.position(0.0))
    rows: list[FloatArray] = []
    profiles: list[FloatArray] = []
    retried = iterations = 0
    worst = 0.0
    while len(rows) < steps:
        first = len(rows)
        times = [
            moved.duration * i / steps for i in range(first + 1, min(first + case.numerics.steps_at_once, steps) + 1)
        ]
        if first == 0 or not _may_be_one_step(model, moment, [moved.position(time) for time in times]):
            times = times[:1]
        goals = times[-1:]
        while goals:
            goal = goals[-1]
            try:
                after, forces, newton, defect = transient_step(model, moment, goal, moved.position(goal))
            except NotConvergedError as error:
                retried += 1
                if len(goals) > _MOST_HALVINGS:
                    raise NotConvergedError(f'case {case.name} at {goal:.6g} s: {error}') from None
                goals.append(0.5 * (moment.time + goal))
                continue
            goals.pop()
            velocity = (after.position - moment.position) / (after.time - moment.time)
            moment = after
            iterations += newton
            worst = max(worst, defect)
        row = np.array([moment.time, moment.position, velocity, moment.lag, *forces])
        solid_pressure, _ = model.contact.asperity_pressure(moment.state.gap)
        profile = np.array([moment.state.gap, moment.state.pressure, solid_pressure, moment.state.saturation])
        for k in range(1, len(times)):
            share = k / len(times)
            rows.append(rows[first - 1] + share * (row - rows[first - 1]))
            profiles.append(profiles[first - 1] + share * (profile - profiles[first - 1]))
        rows.append(row)
        profiles.append(profile)
        if on_step:
            on_step(len(times))
    time, position, velocities, lag, friction, solid, fluid, edge, sliding = np.array(rows).T
    gap, film, contact, saturation = (np.array(values) for values in zip(*profiles, strict=True))
    return TransientResult(
        case, time, position, velocities, sliding, friction, solid, fluid, edge, lag, model.place,
        gap, film, contact, saturation, retried, iterations, worst,
    )  # fmt: skip


def _may_be_one_step(model: TransientModel, moment: TransientState, positions: list[float]) -> bool:
    """Whether the spool may go on to the last of some ``positions`` [m] at once.

    It has to go on in one direction, without the loaded part of the seal (beyond 1 % of the highest pressure, our
    choice) on a rounded corner of the control edge on the way.
    """
    ways = np.diff([moment.position, *positions])
    if not (np.all(ways > 0.0) or np.all(ways < 0.0)):
        return False
    edge = model.case.control_edge
    if edge is None:
        return True
    solid, _ = model.contact.asperity_pressure(moment.state.gap)
    load = moment.state.pressure + solid
    loaded = model.place[load > 0.01 * load.max()]
    places = moment.contact_place, positions[-1] - moment.lag
    low, high = min(places) + loaded[0], max(places) + loaded[-1]
    begin, end = edge.position - 2.0 * edge.rounding, edge.position + edge.depth / edge.slope + 2.0 * edge.rounding
    return bool(high < begin or low > end)


def with_solid_shear_stress(case: StudyCase, solid_shear_stress: float) -> StudyCase:
    """The case with another tau_c [Pa]."""
    return dataclasses.replace(case, seal=dataclasses.replace(case.seal, solid_shear_stress=solid_shear_stress))
