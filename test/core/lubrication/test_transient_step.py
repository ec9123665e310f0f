"""Parts of one step of a run: its forces, its creep, its balance of lubricant, and how a run is made of steps."""

import dataclasses
import math
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from seal_friction_ros.core.lubrication import transient
from seal_friction_ros.core.lubrication.contact import ContactState, asperity_pressure
from seal_friction_ros.core.lubrication.grease import Grease
from seal_friction_ros.core.lubrication.groove import GrooveSpring
from seal_friction_ros.core.lubrication.kinematics import MeasuredMotion
from seal_friction_ros.core.lubrication.lubrication_case import (
    AirPressure,
    LubricationCase,
    LubricationNumerics,
    Viscoelasticity,
)
from seal_friction_ros.core.lubrication.reynolds import FilmEnds
from seal_friction_ros.core.lubrication.transient import (
    SealForces,
    StepBefore,
    TransientState,
    fluid_force,
    initial_state,
    lubrication_model,
    run_transient,
    solid_limit,
    start_of_step,
    transient_step,
)
from seal_friction_ros.core.lubrication.wall import ControlEdge, FilmSupply, WallFilm

CASE = LubricationCase(name='small', numerics=LubricationNumerics(cells=32, time_step=1e-3))
EDGE = dataclasses.replace(CASE, control_edge=ControlEdge())
OIL = Grease(yield_stress=0.0, consistency_index=0.0, base_viscosity=0.5)
CREEPING = dataclasses.replace(CASE, viscoelasticity=Viscoelasticity(stiffening=3.0, relaxation_time=0.01, decades=1))
CIRCUMFERENCE, FILM = math.pi * 6e-3, 0.6e-3  # [m]


def plates(gap: float, pressure: float) -> ContactState:
    """A full film of one gap [m] and one pressure [Pa]."""
    return ContactState(np.full(32, gap), np.full(32, pressure), np.ones(32))


def at_rest(case: LubricationCase, position: float = 0.0) -> TransientState:
    return initial_state(lubrication_model(case), position)


NO_FLOW = np.zeros(33)
INSTANT = 1e-12  # [s] in which nothing slides


class Step(NamedTuple):
    """A step whose film is the one that it began with."""

    after: TransientState
    forces: SealForces
    ends: FilmEnds


@pytest.fixture
def stepped(monkeypatch):
    """Function that takes a step of a case in which the film stays as it is, while ``flow`` [m^2/s] goes through it."""

    def take(case, moment, step, position, flow=NO_FLOW) -> Step:
        asked = []

        def contact(_contact, state, _rigid, _velocity, ends, *_):
            asked.append(ends)
            return SimpleNamespace(state=state, flow=flow, iterations=1)

        monkeypatch.setattr(transient, 'contact_step', contact)
        after, forces, *_ = transient_step(lubrication_model(case), moment, moment.time + step, position)
        return Step(after, forces, *asked)

    return take


# -- forces


@pytest.mark.parametrize('velocity', [0.03, -0.03])
def test_film_resists_motion_by_the_shear_of_newton_all_round(velocity):
    """Viscosity 0.5 Pa s, gap 2 um; air of one pressure on both sides."""
    air = AirPressure(2e5, 2e5)
    model = lubrication_model(dataclasses.replace(CASE, grease=OIL, air=air))
    force = fluid_force(model, plates(2e-6, 2e5), velocity)
    assert force == pytest.approx(0.5 * velocity / 2e-6 * CIRCUMFERENCE * FILM, rel=1e-9)


def test_solid_friction_is_tau_c_on_all_the_surface_where_all_of_it_touches():
    case = dataclasses.replace(CASE, topography=dataclasses.replace(CASE.topography, filling=True))
    assert solid_limit(lubrication_model(case), plates(1e-9, 0.0)) == pytest.approx(1.5e6 * CIRCUMFERENCE * FILM)
    assert solid_limit(lubrication_model(case), plates(1e-3, 0.0)) == 0.0


@pytest.mark.parametrize('gap', [1e-3, 2e-6])
def test_chamfer_pushes_by_the_pressure_on_what_the_wall_falls_below_the_seal(stepped, gap):
    """Pressure of film and asperities times the height of the step, towards the open side."""
    model = lubrication_model(EDGE)
    moment = at_rest(EDGE)._replace(position=0.25e-3, lag=-0.05e-3, state=plates(gap, 3e5))
    solid = asperity_pressure(np.array([gap]), model.contact.asperities)[0][0]
    fall, _ = EDGE.control_edge.fall(0.3e-3 + np.array([-0.3e-3, 0.3e-3]))
    assert (solid > 1e4) == (gap < 1e-5)
    exact = -(3e5 + solid) * (fall[1] - fall[0]) * CIRCUMFERENCE
    assert stepped(EDGE, moment, INSTANT, moment.position).forces.edge == pytest.approx(exact, rel=2e-3)
    assert stepped(CASE, moment, INSTANT, moment.position).forces.edge == 0.0


def test_bottom_of_the_groove_bears_what_film_and_asperities_push_unless_it_has_no_friction(stepped):
    """The seat follows the lag but for the friction of that force."""
    state = plates(2e-6, 3e5)
    rubbing = dataclasses.replace(CASE, groove=GrooveSpring(friction_coefficient=0.15))
    model = lubrication_model(rubbing)
    solid = asperity_pressure(state.gap[:1], model.contact.asperities)[0][0]
    for case, force in ((rubbing, (3e5 + solid) * CIRCUMFERENCE * FILM), (CASE, 0.0)):
        moment = at_rest(case)._replace(state=state, lag=0.1e-3, position=0.1e-3)
        after = stepped(case, moment, INSTANT, moment.position).after
        assert after.seat == pytest.approx(case.seated_groove.seat(moment.seat, after.lag, force), rel=1e-9)


@pytest.mark.parametrize('way', [0.3e-3, -0.3e-3])
def test_seal_slides_as_fast_as_groove_and_wall_balance(stepped, way):
    """Spring less chamfer and film is the solid friction; the film is driven by an uneven pressure, too."""
    case = dataclasses.replace(EDGE, grease=OIL)
    model = lubrication_model(case)
    moment = at_rest(case, 0.25e-3)
    uneven = moment.state._replace(pressure=np.linspace(0.0, 1e6, 32))
    moment = moment._replace(state=uneven, lag=0.01e-3)
    step = stepped(case, moment, 0.01, 0.25e-3 + way)
    velocity, lag = step.forces.sliding_velocity, step.after.lag
    assert lag == pytest.approx(0.01e-3 + way - velocity * 0.01, rel=1e-12)
    edge, fluid = stepped(case, moment, INSTANT, 0.25e-3).forces.edge, fluid_force(model, moment.state, velocity)
    assert abs(edge) > 0.1
    assert abs(fluid_force(model, moment.state, 0.0)) > 1e-3
    solid = math.copysign(solid_limit(model, moment.state), way)
    assert case.groove.stiffness * lag == pytest.approx(solid + fluid + edge, rel=1e-4)
    assert velocity * way > 0.0


@pytest.mark.parametrize('share', [0.99, -0.99, 1.01, -1.01])
def test_seal_sticks_until_the_spring_pulls_as_strongly_as_the_asperities_hold(stepped, share):
    model = lubrication_model(CASE)
    moment = at_rest(CASE)
    position = share * solid_limit(model, moment.state) / CASE.groove.stiffness
    step = stepped(CASE, moment, 1e-3, position)
    assert (step.forces.sliding_velocity == 0.0) == (abs(share) < 1.0)
    assert step.forces.sliding_velocity * share >= 0.0
    assert abs(step.after.lag) <= abs(position)


@pytest.mark.parametrize('share', [-0.5, 0.5, 2.0, -2.0])
def test_asperities_of_a_seal_that_sticks_balance_the_spring_up_to_their_limit(stepped, share):
    model = lubrication_model(EDGE)
    moment = at_rest(EDGE, 0.25e-3)
    moment = moment._replace(state=moment.state._replace(pressure=np.linspace(0.0, 1e6, 32)))
    limit, edge = solid_limit(model, moment.state), stepped(EDGE, moment, INSTANT, 0.25e-3).forces.edge
    fluid = fluid_force(model, moment.state, 0.0)
    lag = (share * limit + edge + fluid) / EDGE.groove.stiffness
    moment = moment._replace(lag=lag, position=moment.position + lag, seat=lag)
    forces = stepped(EDGE, moment, INSTANT, moment.position).forces
    assert forces.solid == pytest.approx(limit * min(max(share, -1.0), 1.0))
    assert forces.edge == pytest.approx(edge)
    assert (forces.sliding_velocity == 0.0) == (abs(share) < 1.0)
    assert forces.fluid == pytest.approx(fluid_force(model, moment.state, forces.sliding_velocity))
    assert forces.friction == pytest.approx(forces.solid + forces.fluid + forces.edge)
    assert forces.fluid == pytest.approx(fluid) or abs(share) > 1.0


# -- what a step carries over


def test_seal_at_rest_under_air_touches_as_without_it_and_has_crept_under_all_of_its_load():
    """The air pushes rubber from all sides: h = g + K p_c(h); what creeps answers to film and asperities."""
    case = dataclasses.replace(CREEPING, air=AirPressure(4e5, 0.0))
    model = lubrication_model(case)
    start = initial_state(model, 0.0)
    solid, _ = asperity_pressure(start.state.gap, model.contact.asperities)
    rigid = model.place**2 / 2e-3 - 60e-6  # 36 um, and 60 um/MPa of 0.4 MPa
    matrix = model.contact.body.matrix()
    assert start.state.gap == pytest.approx(rigid + matrix @ solid, abs=1e-12)
    assert start.state.pressure == pytest.approx(model.ambient)
    assert start.creep == pytest.approx(np.stack([0.375 * matrix @ (solid + model.ambient)] * 2), rel=1e-9)
    assert (start.time, start.before) == (0.0, None)


def test_seal_on_its_left_seat_stands_to_the_right_of_its_spool_at_the_edge():
    """A clearance of twice 0.05 mm: the crown is 0.05 mm ahead of the spool."""
    loose = dataclasses.replace(EDGE, groove=GrooveSpring(half_clearance=0.05e-3))
    leaning, standing = at_rest(loose, 0.2e-3), at_rest(EDGE, 0.25e-3)
    assert leaning.contact_place == pytest.approx(standing.contact_place)
    assert leaning.state.gap == pytest.approx(standing.state.gap, rel=1e-9)


def test_seal_gives_way_at_once_by_a_quarter_and_creeps_towards_the_rest():
    """Stiffening 3: a quarter at once, 3 / 8 with 10 ms and 3 / 8 with 0.1 s: tau c' = 3 / 8 K p - c."""
    model = lubrication_model(CREEPING)
    start = initial_state(model, 0.0)
    after, *_ = transient_step(model, start, 5e-3, 0.2e-3)
    solid, _ = asperity_pressure(after.state.gap, model.contact.asperities)
    deflected = model.contact.body.matrix() @ (after.state.pressure + solid)
    for part, time in enumerate((0.01, 0.1)):
        rate = (after.creep[part] - start.creep[part]) / 5e-3
        assert time * rate == pytest.approx(0.375 * deflected - after.creep[part], rel=1e-6, abs=1e-12)
    assert after.state.gap == pytest.approx(model.profile + 0.25 * deflected + after.creep.sum(axis=0), abs=1e-11)
    assert np.abs(after.creep - start.creep).max() > 1e-9


def test_creep_follows_a_parabola_over_steps_of_any_length():
    start = at_rest(CREEPING)

    def at(time):
        return np.full((2, 32), 1e-6 + 1e-6 * time**2)

    for earlier, now, then in ((0.0, 0.3, 0.5), (0.5, 0.6, 1.0)):
        before = StepBefore(0.9 * start.state.gap, at(earlier), now - earlier, 0.0)
        begun = start_of_step(start._replace(creep=at(now), before=before), then - now)
        assert (at(then) - begun.creep) / begun.step == pytest.approx(2e-6 * then)


def test_film_that_would_begin_below_nothing_begins_anew():
    """Before the last of two equal steps it was five times as thick: 4/3 - 5/3 of it are left."""
    start = at_rest(CREEPING)
    gap = start.state.gap
    moment = start._replace(before=StepBefore(5.0 * gap, 2.0 * start.creep, 1e-3, 0.0))
    begun = start_of_step(moment, 1e-3)
    assert (begun.thickness.tolist(), begun.creep.tolist(), begun.step) == (gap.tolist(), start.creep.tolist(), 1e-3)
    thinner = start_of_step(moment._replace(before=StepBefore(3.0 * gap, start.creep, 1e-3, 0.0)), 1e-3)
    assert thinner.thickness == pytest.approx(gap / 3.0)
    assert thinner.step == pytest.approx(2e-3 / 3.0)


@pytest.mark.parametrize('way', [1e-3, -1e-3])
@pytest.mark.parametrize(
    ('before', 'at_end'),
    [
        (None, 1.0),  # the first step
        (4.0 / 11.0, 14.0 / 11.0),  # of an even acceleration: 4 mm/s over 20 ms, then 11 mm/s over 15 ms, 14 at the end
        (0.0, 1.0),  # it stuck
        (-1.0, 1.0),  # it turned round
        (3.3, 1.0 / 70.0),  # it nearly stops
        (3.4, 1.0),  # it would turn round
    ],
)
def test_velocity_at_the_end_of_a_step_is_that_of_an_even_acceleration(stepped, way, before, at_end):
    """Shares of the mean velocity of the step."""
    start = at_rest(CASE)
    after = stepped(CASE, start, 15e-3, way).after
    mean = after.contact_place / 15e-3
    assert mean * way > 0.0
    if before is not None:
        start = start._replace(before=StepBefore(start.state.gap, start.creep, 20e-3, before * mean))
    assert stepped(CASE, start, 15e-3, way).forces.sliding_velocity == pytest.approx(at_end * mean)


@pytest.mark.parametrize('lost', [1e-9, -1e-9])
def test_defect_of_a_step_is_what_is_lost_over_what_is_there_whichever_way(monkeypatch, lost):
    """1e-9 m^2/s more, or less, through the right end over 2 ms."""
    really = transient.contact_step

    def leaks(*arguments):
        done = really(*arguments)
        return done._replace(flow=done.flow + lost * np.eye(33)[32])

    model = lubrication_model(CASE)
    monkeypatch.setattr(transient, 'contact_step', leaks)
    after, _, _, defect = transient_step(model, initial_state(model, 0.0), 2e-3, 0.0)
    there = (after.state.gap * after.state.saturation).sum() * FILM / 32
    assert defect == pytest.approx(2e-12 / there, rel=1e-6)


# -- lubricant on the wall

STARVED = dataclasses.replace(CASE, film_supply=FilmSupply(0.1e-6))
WALL = np.arange(1.0, 101.0) * 1e-14  # [m^2] in cells of 18.75 um, as those of the film


def starved(place: float) -> TransientState:
    """A seal at ``place`` on a wall of 100 cells from -0.9 mm on."""
    film = WallFilm(-0.9e-3, FILM / 32, WALL)
    return at_rest(STARVED)._replace(position=place, lag=0.0, wall_film=film)


HELD = dataclasses.replace(STARVED, groove=dataclasses.replace(STARVED.groove, stiffness=1e9))  # moves with the spool


@pytest.mark.parametrize('way', [30e-6, -30e-6])
def test_seal_takes_the_film_ahead_of_it_and_is_fed_by_half_of_its_speed(stepped, way):
    """0.1 um on the wall is 0.2 um under a seal, over the height that shear carries at its end."""
    moment = at_rest(HELD)
    wedge = np.linspace(4e-6, 8e-6, 32)  # [m] which shear carries, as the roughness of wall and seal cancel
    step = stepped(HELD, moment._replace(state=moment.state._replace(gap=wedge)), 1e-3, way)
    ahead = moment.wall_film.ahead(*((0.3e-3, 0.3e-3 + way) if way > 0.0 else (way - 0.3e-3, -0.3e-3)), -0.3e-3, 0.3e-3)
    assert ahead.sum() == pytest.approx(0.1e-6 * 30e-6)
    filled = (1.0, 0.2e-6 / 8e-6) if way > 0.0 else (0.2e-6 / 4e-6, 1.0)
    assert (step.ends.saturation_left, step.ends.saturation_right) == pytest.approx(filled, rel=1e-3)
    rich = dataclasses.replace(HELD, film_supply=FilmSupply(1e-3))
    ends = stepped(rich, at_rest(rich), 1e-3, way).ends
    assert (ends.saturation_left, ends.saturation_right) == (1.0, 1.0)


def test_flooded_seal_and_one_at_rest_take_nothing(stepped):
    for case, way in ((CASE, 30e-6), (STARVED, 0.0)):
        step = stepped(case, at_rest(case), 1e-3, way)
        assert step.ends == lubrication_model(case).ends()
        if step.after.wall_film is not None:
            assert step.after.wall_film.volume.tolist() == at_rest(case).wall_film.volume.tolist()


@pytest.fixture
def wall_change(stepped):
    """Change of the film on the wall [1e-14 m^2] as 3 flow in at the left of the seal and 7 out at the right."""

    def change(place: float, to: float) -> np.ndarray:
        through = np.zeros(33)
        through[[0, -1]] = 3e-14, 7e-14
        after = stepped(HELD, starved(place), 1e-3, to, through / 1e-3).after
        return (after.wall_film.volume - WALL) * 1e14

    return change


def test_seal_at_rest_drinks_at_one_end_and_spills_at_the_other(wall_change):
    """Its ends stand in cells 32 and 64 of the wall, 0.6 mm apart."""
    change = wall_change(0.009e-3, 0.009e-3)
    assert change == pytest.approx(-3.0 * np.eye(100)[32] + 7.0 * np.eye(100)[64], abs=1e-9)


def test_seal_on_its_way_pushes_what_it_did_not_take_in_and_leaves_what_flows_out_behind(wall_change):
    """One cell of the wall to the right, or one and a half to the left, from ends at 32 and 64 whole cells."""
    width, cell = FILM / 32, np.eye(100)
    change = wall_change(0.0, 1.001 * width)  # taken: all 65 of a cell; pushed: 65 + 7; left behind: -3
    assert change == pytest.approx(-65.0 * cell[64] + 72.0 * cell[65] - 3.0 * cell[32], abs=0.1)
    change = wall_change(0.0, -1.5 * width)  # taken: 32 and half of 31; pushed: 47.5 - 3; behind: 7 over 1.5 cells
    taken = 32.0 * cell[31] + 15.5 * cell[30]
    assert change == pytest.approx(44.5 * cell[30] - taken + 7.0 / 1.5 * cell[63] + 3.5 / 1.5 * cell[62], abs=0.1)


# -- a run


def glide(milliseconds: float) -> MeasuredMotion:
    """30 mm/s to the right from 0.1 mm on."""
    return MeasuredMotion([0.0, 1e-3 * milliseconds], [0.1e-3, 0.1e-3 + 30e-6 * milliseconds])


@pytest.mark.parametrize(('milliseconds', 'steps'), [(0.2, 1), (3.0, 3), (3.001, 4)])
def test_run_has_as_many_steps_as_fit_into_its_motion_and_one_at_least(milliseconds, steps):
    result = run_transient(CASE, glide(milliseconds))
    assert result.time == pytest.approx(1e-3 * milliseconds * np.arange(1, steps + 1) / steps)
    assert result.position == pytest.approx(0.1e-3 + 0.03 * result.time)
    assert result.velocity == pytest.approx(np.full(steps, 0.03))
    assert result.gap.shape == result.contact_pressure.shape == (steps, 32)


def test_record_may_be_as_large_as_the_memory_that_is_given_to_it(monkeypatch):
    """Four numbers for each of 32 cells in each of 3 steps."""
    monkeypatch.setattr(transient, '_LARGEST_RECORD', 4 * 32 * 3)
    assert len(run_transient(CASE, glide(3.0)).time) == 3
    monkeypatch.setattr(transient, '_LARGEST_RECORD', 4 * 32 * 3 - 1)
    with pytest.raises(ValueError, match='3 steps of 32 cells are too many to keep'):
        run_transient(CASE, glide(3.0))


def test_steps_at_once_are_straight_between_their_ends():
    """Ten steps: the first alone, four, four and one. Nothing turns round, and there is no edge."""
    case = dataclasses.replace(CASE, numerics=dataclasses.replace(CASE.numerics, steps_at_once=4))
    taken: list[int] = []
    result = run_transient(case, glide(10.0), taken.append)
    assert taken == [1, 4, 4, 1]
    assert result.time == pytest.approx(1e-3 * np.arange(1, 11))
    assert result.position == pytest.approx(0.1e-3 + 0.03 * result.time)
    share = np.arange(5)[:, None] / 4.0
    for column in (result.lag, result.solid, result.gap, result.film_pressure, result.saturation):
        values = column.reshape(10, -1)
        for first in (0, 4):
            straight = values[first] + share * (values[first + 4] - values[first])
            assert values[first : first + 5] == pytest.approx(straight, rel=1e-9, abs=1e-18)
    assert np.abs(np.diff(result.gap[[0, 4, 8]], axis=0)).max() > 1e-10


def test_run_tells_the_worst_defect_and_all_iterations_of_its_steps(monkeypatch):
    really, told = transient.transient_step, iter([(3, 1e-13), (5, 4e-13), (1, 2e-13)])

    def tells(*arguments):
        after, forces, *_ = really(*arguments)
        return (after, forces, *next(told))

    monkeypatch.setattr(transient, 'transient_step', tells)
    result = run_transient(CASE, glide(3.0))
    assert (result.newton_iterations, result.mass_defect, result.retried_steps) == (9, 4e-13, 0)
