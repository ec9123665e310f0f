"""Parts of one step of a run: its forces, its creep, its balance of lubricant, and how a run is made of steps."""

import dataclasses
import math

import numpy as np
import pytest

from seal_friction_ros.core.lubrication.contact import ContactState
from seal_friction_ros.core.lubrication.grease import Grease
from seal_friction_ros.core.lubrication.model import fluid_force, solid_limit
from seal_friction_studies.core import transient
from seal_friction_studies.core.groove import GrooveSpring
from seal_friction_studies.core.kinematics import MeasuredMotion
from seal_friction_studies.core.study_case import AirPressure, StudyCase, StudyNumerics, Viscoelasticity
from seal_friction_studies.core.transient import (
    StepBefore,
    TransientState,
    initial_state,
    run_transient,
    start_of_step,
    transient_model,
    transient_step,
)
from seal_friction_studies.core.wall import ControlEdge, FilmSupply, WallFilm

CASE = StudyCase(name='small', numerics=StudyNumerics(cells=32, time_step=1e-3))
EDGE = dataclasses.replace(CASE, control_edge=ControlEdge())
OIL = Grease(yield_stress=0.0, consistency_index=0.0, base_viscosity=0.5)
CREEPING = dataclasses.replace(CASE, viscoelasticity=Viscoelasticity(stiffening=3.0, relaxation_time=0.01, decades=1))
CIRCUMFERENCE, FILM = math.pi * 6e-3, 0.6e-3  # [m]


def plates(gap: float, pressure: float) -> ContactState:
    """A full film of one gap [m] and one pressure [Pa]."""
    return ContactState(np.full(32, gap), np.full(32, pressure), np.ones(32))


def at_rest(case: StudyCase, position: float = 0.0) -> TransientState:
    return initial_state(transient_model(case), position)


# -- forces


@pytest.mark.parametrize('velocity', [0.03, -0.03])
def test_film_resists_motion_by_the_shear_of_newton_all_round(velocity):
    """Viscosity 0.5 Pa s, gap 2 um; air of one pressure on both sides."""
    air = AirPressure(pressure_left=2e5, pressure_right=2e5)
    model = transient_model(dataclasses.replace(CASE, grease=OIL, air=air))
    force = fluid_force(model, plates(2e-6, 2e5), velocity)
    assert force == pytest.approx(0.5 * velocity / 2e-6 * CIRCUMFERENCE * FILM, rel=1e-9)


def test_solid_friction_is_tau_c_on_all_the_surface_where_all_of_it_touches():
    case = dataclasses.replace(CASE, topography=dataclasses.replace(CASE.topography, filling=True))
    assert solid_limit(transient_model(case), plates(1e-9, 0.0)) == pytest.approx(1.5e6 * CIRCUMFERENCE * FILM)
    assert solid_limit(transient_model(case), plates(1e-3, 0.0)) == 0.0


@pytest.mark.parametrize('gap', [1e-3, 2e-6])
def test_chamfer_pushes_by_the_pressure_on_what_the_wall_falls_below_the_seal(gap):
    """Pressure of film and asperities times the height of the step, towards the open side."""
    model = transient_model(EDGE)
    moment = at_rest(EDGE)._replace(position=0.25e-3, lag=-0.05e-3, state=plates(gap, 3e5))
    solid = model.contact.asperity_pressure(np.array([gap]))[0][0]
    fall, _ = EDGE.control_edge.fall(0.3e-3 + np.array([-0.3e-3, 0.3e-3]))
    assert (solid > 1e4) == (gap < 1e-5)
    exact = -(3e5 + solid) * (fall[1] - fall[0]) * CIRCUMFERENCE
    assert transient._edge_force(model, moment) == pytest.approx(exact, rel=2e-3)
    assert transient._edge_force(transient_model(CASE), moment) == 0.0


def test_bottom_of_the_groove_bears_what_film_and_asperities_push_unless_it_has_no_friction():
    state = plates(2e-6, 3e5)
    rubbing = dataclasses.replace(CASE, groove=GrooveSpring(friction_coefficient=0.15))
    model = transient_model(rubbing)
    solid = model.contact.asperity_pressure(state.gap[:1])[0][0]
    assert transient._bottom_force(model, state) == pytest.approx((3e5 + solid) * CIRCUMFERENCE * FILM)
    assert transient._bottom_force(transient_model(CASE), state) == 0.0


@pytest.mark.parametrize('way', [0.3e-3, -0.3e-3])
def test_seal_slides_as_fast_as_groove_and_wall_balance(way):
    """Spring less chamfer and film is the solid friction; the film is driven by an uneven pressure, too."""
    case = dataclasses.replace(EDGE, grease=OIL)
    model = transient_model(case)
    moment = at_rest(case, 0.25e-3)
    uneven = moment.state._replace(pressure=np.linspace(0.0, 1e6, 32))
    moment = moment._replace(state=uneven, lag=0.01e-3)
    velocity, lag = transient._slide(model, moment, 0.01, 0.25e-3 + way)
    assert lag == pytest.approx(0.01e-3 + way - velocity * 0.01, rel=1e-12)
    edge, fluid = transient._edge_force(model, moment), fluid_force(model, moment.state, velocity)
    assert abs(edge) > 0.1
    assert abs(fluid_force(model, moment.state, 0.0)) > 1e-3
    solid = math.copysign(solid_limit(model, moment.state), way)
    assert case.groove.stiffness * lag == pytest.approx(solid + fluid + edge, rel=1e-4)
    assert velocity * way > 0.0


@pytest.mark.parametrize('share', [0.99, -0.99, 1.01, -1.01])
def test_seal_sticks_until_the_spring_pulls_as_strongly_as_the_asperities_hold(share):
    model = transient_model(CASE)
    moment = at_rest(CASE)
    position = share * solid_limit(model, moment.state) / CASE.groove.stiffness
    velocity, lag = transient._slide(model, moment, 1e-3, position)
    assert (velocity == 0.0) == (abs(share) < 1.0)
    assert velocity * share >= 0.0
    assert abs(lag) <= abs(position)


@pytest.mark.parametrize('share', [-0.5, 0.5, 2.0, -2.0])
def test_asperities_of_a_seal_that_sticks_balance_the_spring_up_to_their_limit(share):
    model = transient_model(EDGE)
    moment = at_rest(EDGE, 0.25e-3)
    moment = moment._replace(state=moment.state._replace(pressure=np.linspace(0.0, 1e6, 32)))
    limit, edge = solid_limit(model, moment.state), transient._edge_force(model, moment)
    fluid = fluid_force(model, moment.state, 0.0)
    lag = (share * limit + edge + fluid) / EDGE.groove.stiffness
    moment = moment._replace(lag=lag, position=moment.position + lag, seat=lag)
    forces = transient._forces(model, moment, 0.0)
    assert forces.solid == pytest.approx(limit * min(max(share, -1.0), 1.0))
    assert (forces.edge, forces.fluid, forces.sliding_velocity) == pytest.approx((edge, fluid, 0.0))
    assert forces.friction == pytest.approx(forces.solid + fluid + edge)


# -- what a step carries over


def test_seal_at_rest_under_air_touches_as_without_it_and_has_crept_under_all_of_its_load():
    """The air pushes rubber from all sides: h = g + K p_c(h); what creeps answers to film and asperities."""
    case = dataclasses.replace(CREEPING, air=AirPressure(pressure_left=4e5, pressure_right=0.0))
    model = transient_model(case)
    start = initial_state(model, 0.0)
    solid, _ = model.contact.asperity_pressure(start.state.gap)
    rigid = model.place**2 / 2e-3 - 60e-6  # 36 um, and 60 um/MPa of 0.4 MPa
    matrix = model.contact.body.matrix
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
    model = transient_model(CREEPING)
    start = initial_state(model, 0.0)
    after, *_ = transient_step(model, start, 5e-3, 0.2e-3)
    solid, _ = model.contact.asperity_pressure(after.state.gap)
    deflected = model.contact.body.matrix @ (after.state.pressure + solid)
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


def test_seal_that_stuck_or_would_stop_keeps_the_mean_velocity_of_its_step():
    start, speed = at_rest(CASE), 2.0**-8
    for before in (0.0, 3.0 * speed):  # the other half of this step would end at 1.5 and at 0 times the speed
        moment = start._replace(before=StepBefore(start.state.gap, start.creep, 1e-3, before))
        assert transient._velocity_at_end(moment, speed, 1e-3) == speed


@pytest.mark.parametrize('lost', [1e-9, -1e-9])
def test_defect_of_a_step_is_what_is_lost_over_what_is_there_whichever_way(monkeypatch, lost):
    """1e-9 m^2/s more, or less, through the right end over 2 ms."""
    really = transient.contact_step

    def leaks(*arguments):
        done = really(*arguments)
        return done._replace(flow=done.flow + lost * np.eye(33)[32])

    model = transient_model(CASE)
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


@pytest.mark.parametrize('way', [30e-6, -30e-6])
def test_seal_takes_the_film_ahead_of_it_and_is_fed_by_half_of_its_speed(way):
    """0.1 um on the wall is 0.2 um under a seal, over the height that shear carries at its end."""
    model = transient_model(STARVED)
    moment = initial_state(model, 0.0)
    wedge = np.linspace(4e-6, 8e-6, 32)  # [m] which shear carries, as the roughness of wall and seal cancel
    ends, taken = transient._supply(model, moment._replace(state=moment.state._replace(gap=wedge)), way, 1e-3)
    assert taken.sum() == pytest.approx(0.1e-6 * 30e-6)
    filled = (1.0, 0.2e-6 / 8e-6) if way > 0.0 else (0.2e-6 / 4e-6, 1.0)
    assert (ends.saturation_left, ends.saturation_right) == pytest.approx(filled)
    rich = dataclasses.replace(STARVED, film_supply=FilmSupply(1e-3))
    ends, _ = transient._supply(transient_model(rich), at_rest(rich), way, 1e-3)
    assert (ends.saturation_left, ends.saturation_right) == (1.0, 1.0)


def test_flooded_seal_and_one_at_rest_take_nothing():
    for case, way in ((CASE, 30e-6), (STARVED, 0.0)):
        ends, taken = transient._supply(transient_model(case), at_rest(case), way, 1e-3)
        assert (ends, taken.sum()) == (transient_model(case).ends(), 0.0)


def wall_after(moment: TransientState, place: float, taken: np.ndarray) -> np.ndarray:
    """Change of the film on the wall as 3e-14 m^2 flow in at the left of the seal and 7e-14 m^2 out at the right."""
    through = np.array([3e-14, 0.0, 7e-14])
    after = transient._wall_film_after(transient_model(STARVED), moment, moment.wall_film, taken, through, place)
    return (after.volume - WALL) * 1e14


def test_seal_at_rest_drinks_at_one_end_and_spills_at_the_other():
    """Its ends stand in cells 32 and 64 of the wall, 0.6 mm apart."""
    change = wall_after(starved(0.009e-3), 0.009e-3, np.zeros(100))
    assert change == pytest.approx(-3.0 * np.eye(100)[32] + 7.0 * np.eye(100)[64], abs=1e-9)


def test_seal_on_its_way_pushes_what_it_did_not_take_in_and_leaves_what_flows_out_behind():
    """One cell of the wall to the right, or to the left, from ends at 32 and 64 whole cells."""
    width, taken = FILM / 32, 2e-14 * np.eye(100)[50]
    change = wall_after(starved(0.0), width, taken)  # pushed: 2 + 7; left behind: -3
    assert change == pytest.approx(-2.0 * np.eye(100)[50] + 9.0 * np.eye(100)[65] - 3.0 * np.eye(100)[32], abs=1e-9)
    change = wall_after(starved(0.0), -1.5 * width, taken)  # pushed: 2 - 3; left behind: 7, over a cell and a half
    behind = 7.0 / 1.5 * np.eye(100)[63] + 3.5 / 1.5 * np.eye(100)[62]
    assert change == pytest.approx(-2.0 * np.eye(100)[50] - np.eye(100)[30] + behind, abs=1e-9)


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
