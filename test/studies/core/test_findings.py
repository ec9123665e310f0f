"""What is read from a run: its numbers, their errors, several seals on one spool; on runs made by hand."""

import dataclasses
import math

import numpy as np
import pytest

from seal_friction_studies.core.findings import check_time_step, discretisation_errors, error_of_levels, findings
from seal_friction_studies.core.groove import GrooveSpring
from seal_friction_studies.core.kinematics import ConstantAcceleration
from seal_friction_studies.core.spool import SpoolSealMotion, stroke_friction, superposed
from seal_friction_studies.core.study import study_table
from seal_friction_studies.core.study_case import SpoolSeal, StudyCase, StudyNumerics
from seal_friction_studies.core.transient import TransientResult, last_cycle, with_solid_shear_stress
from seal_friction_studies.core.wall import ControlEdge

MOTION = ConstantAcceleration(distance=2e-3, speed=20e-3, acceleration=0.4, cycles=2)
"""Speeds up for 50 ms over 0.5 mm; 150 ms from end to end."""
CASE = StudyCase(name='made', motion=MOTION, groove=GrooveSpring(stiffness=1e4))
EDGE = dataclasses.replace(CASE, control_edge=ControlEdge(position=0.8e-3))


def made(case: StudyCase = CASE, steps: int = 600, **columns: object) -> TransientResult:
    """A run whose ``columns`` are functions of position and velocity of the spool; friction is their sum by default."""
    time = case.motion.duration * np.arange(1, steps + 1) / steps
    ends = np.array([case.motion.position(t) for t in (0.0, *time)])
    position, velocity = ends[1:], np.diff(ends) * steps / case.motion.duration
    none = np.zeros(steps)
    made = {name: none + column(position, velocity) for name, column in columns.items()}
    parts = {name: made.get(name, none) for name in ('solid', 'fluid', 'edge')}
    profiles = np.zeros((steps, 4))
    return TransientResult(
        case, time, position, velocity, made.get('sliding_velocity', velocity),
        made.get('friction', sum(parts.values())), parts['solid'], parts['fluid'], parts['edge'],
        made.get('lag', none), np.zeros(4), profiles, profiles, profiles, profiles, 0, 0, 0.0,
    )  # fmt: skip


def along(force: float):
    """A friction of one magnitude."""
    return lambda _, velocity: force * np.sign(velocity)


def test_last_cycle_is_the_last_half_of_two():
    last = last_cycle(made())
    assert last.tolist() == [False] * 300 + [True] * 300
    one = dataclasses.replace(CASE, motion=dataclasses.replace(MOTION, cycles=1))
    assert last_cycle(made(one)).all()


def test_friction_of_one_magnitude_is_found_wherever_it_is_read():
    found = findings(made(solid=along(3.0), fluid=along(1.0)))
    assert (found.friction, found.solid_share) == pytest.approx((4.0, 0.75))
    assert (found.solid_slow, found.solid_fast, found.fluid_slow, found.fluid_fast) == pytest.approx((3, 3, 1, 1))
    assert found.rise_on_deceleration == pytest.approx(0.0, abs=1e-12)
    assert found.second_lobe is None
    assert [found.edge_peak, found.edge_assist, found.friction_on_leaving, found.after_edge] == [None] * 4


def test_mean_friction_is_that_within_half_a_millimetre_of_the_middle_in_the_last_cycle():
    """|x| on a way of 2 mm at one speed there: 0.25 mm on average."""
    found = findings(made(steps=6000, solid=lambda place, velocity: 1e4 * np.abs(place) * np.sign(velocity)))
    assert found.friction == pytest.approx(2.5, rel=0.01)
    away = dataclasses.replace(CASE, motion=dataclasses.replace(MOTION, centre=5e-3))
    moved = findings(made(away, 6000, solid=lambda place, velocity: 1e4 * (place - 5e-3) * np.sign(velocity)))
    assert moved.friction == pytest.approx(2.5, rel=0.01)


def test_seal_that_sticks_in_the_middle_takes_no_part_in_the_shares():
    found = findings(
        made(
            solid=lambda place, velocity: np.where(place < 0.0, 9.0, 3.0) * np.sign(velocity),
            fluid=along(1.0),
            sliding_velocity=lambda place, velocity: np.where(place < 0.0, 0.0, velocity),
        )
    )
    assert found.solid_share == pytest.approx(0.75)
    with pytest.raises(ValueError, match=r'case made: the seal does not slide within 0.0005 m of the middle'):
        findings(made(solid=along(3.0), sliding_velocity=lambda *_: 0.0))


def test_friction_is_read_while_slowing_down_to_a_fifth_of_the_speed_and_last_at_the_whole():
    """Friction 6 N at rest, falling by 0.1 N for each mm/s, but twice that while speeding up: 5.6 N, 4 N and 40 %."""

    def stribeck(place, velocity):
        speeding_up = np.sign(place) != np.sign(velocity)
        return np.where(speeding_up, 2.0, 1.0) * (6.0 - 100.0 * np.abs(velocity)) * np.sign(velocity)

    found = findings(made(steps=6000, solid=stribeck, fluid=lambda _, velocity: 50.0 * velocity))
    assert found.solid_slow == pytest.approx(5.6, abs=0.01)
    assert found.solid_fast == pytest.approx(4.0, abs=0.01)
    assert found.fluid_slow == pytest.approx(0.2, abs=0.005)
    assert found.fluid_fast == pytest.approx(1.0, abs=1e-3)
    assert found.rise_on_deceleration == pytest.approx(5.8 / 5.0 - 1.0, abs=0.005)


def test_seal_assists_after_a_reversal_until_its_groove_has_let_go():
    """2 N on a groove of 1e4 N/m: 0.2 mm; the friction changes sign there if the lag goes with the spool."""

    def sprung(place, velocity):
        end = np.where(velocity > 0.0, -1e-3, 1e-3)
        return np.clip(1e4 * (place - end) - 2.0 * np.sign(velocity), -2.0, 2.0)

    found = findings(made(steps=6000, solid=sprung))
    assert found.assisted_length == pytest.approx(0.2e-3, rel=0.01)
    assert found.elastic_length == pytest.approx(0.2e-3, rel=0.01)
    off = dataclasses.replace(CASE, motion=dataclasses.replace(MOTION, centre=3e-3))
    moved = findings(made(off, 6000, solid=lambda place, velocity: sprung(place - 3e-3, velocity)))
    assert moved.assisted_length == pytest.approx(0.2e-3, rel=0.01)


def test_friction_that_is_hardly_there_before_a_reversal_assists_nothing():
    found = findings(
        made(solid=lambda place, velocity: np.where(np.abs(place) > 0.9e-3, 0.02, 2.0) * np.sign(velocity))
    )
    assert (found.assisted_length, found.elastic_length) == (None, None)


BISTABLE = dataclasses.replace(CASE, groove=GrooveSpring(stiffness=1e4, half_clearance=1e-4))


def lobed(place, velocity):
    """A parabola of friction about -0.71 mm on the way to the right."""
    return np.where((velocity > 0.0) & (place < -0.4e-3), 3.0 - 2e7 * (place + 0.71e-3) ** 2, 2.0 * np.sign(velocity))


def test_second_lobe_is_the_vertex_of_the_friction_while_the_seal_sticks():
    def stuck(place, velocity):
        return np.where(place < 0.0, 0.0, velocity)

    assert findings(made(BISTABLE, solid=lobed, sliding_velocity=stuck)).second_lobe == pytest.approx(
        -0.71e-3, abs=2e-6
    )
    assert findings(made(BISTABLE, solid=lobed)).second_lobe is None  # slides: it stays on one seat
    assert findings(made(solid=lobed, sliding_velocity=stuck)).second_lobe is None  # no clearance
    assert findings(made(BISTABLE, solid=along(2.0), sliding_velocity=stuck)).second_lobe is None  # no maximum


def test_control_edge_is_read_on_the_way_in_and_on_the_way_out():
    """In: 2 N in the seat, 5 N at the edge. Out: the chamfer pushes with up to 1.5 N, against 2 N of friction."""

    def solid(place, velocity):
        return np.where((velocity < 0.0) & (place > 0.5e-3), 5.0, 2.0) * np.sign(velocity)

    def edge(place, velocity):
        return np.where((velocity > 0.0) & (place > 0.5e-3), -1.5e3 * np.abs(place), -1e-3)

    result = made(EDGE, 6000, solid=solid, edge=edge, fluid=along(0.5))
    found = findings(result)
    assert found.after_edge == pytest.approx(2.501, rel=1e-3)
    assert found.edge_peak == pytest.approx(5.501 / 2.501, rel=1e-3)
    assert found.edge_assist == pytest.approx(1.5, rel=1e-3)
    assert found.friction_on_leaving == pytest.approx(1.0, abs=2e-3)
    assert (found.solid_slow, found.fluid_slow, found.rise_on_deceleration) == (None, None, None)


def test_friction_after_the_edge_is_read_a_whole_film_within_the_seat_above_half_of_the_speed():
    """The film of 0.6 mm has left an edge at 0.8 mm when its crown is at 0.2 mm; slower than 10 mm/s from -0.875 mm."""

    def solid(place, velocity):
        inside = (place < 0.2e-3) & (place > -0.875e-3)
        return np.where(inside & (velocity < 0.0), 2.0, 7.0) * np.sign(velocity)

    found = findings(made(EDGE, 6000, solid=solid))
    assert found.after_edge == pytest.approx(2.0, rel=0.02)
    assert found.edge_assist == 0.0  # a chamfer that does not push
    half = dataclasses.replace(EDGE, numerics=StudyNumerics(film_width=0.3e-3))
    assert findings(made(half, 6000, solid=solid)).after_edge > 2.5


def test_friction_at_speed_is_read_in_the_seat_where_there_is_an_edge():
    """The right end of a film of 0.6 mm is at an edge of 0.601 mm with the crown at 0.301 mm."""
    edge = dataclasses.replace(CASE, control_edge=ControlEdge(position=0.601e-3))
    found = findings(
        made(
            edge,
            6000,
            solid=lambda place, way: np.where(place < 0.301e-3, 2.0, 1.0) * np.sign(way),
            fluid=lambda place, way: np.where(place < 0.29e-3, 0.1, 0.4) * np.sign(way),
        )
    )
    assert (found.solid_fast, found.fluid_fast) == pytest.approx((2.0, 0.4))
    nowhere = dataclasses.replace(EDGE, control_edge=ControlEdge(position=-0.9e-3))
    found = findings(made(nowhere, 6000, solid=lambda place, velocity: (3.0 + 1e3 * place) * np.sign(velocity)))
    assert found.solid_fast == pytest.approx(2.5, abs=0.01)


def unlike(place, velocity):
    """A friction that is larger at slow speed and twice as large on the way to the left."""
    return np.where(velocity < 0.0, 2.0, 1.0) * (6.0 - 100.0 * np.abs(velocity)) * np.sign(velocity)


@pytest.mark.parametrize('case', [CASE, EDGE], ids=['plain', 'edge'])
def test_only_the_last_cycle_is_read(case):
    """What was a hundred times as large in the first one, and slid or not, changes nothing."""

    def edge(place, velocity):
        return np.where((velocity > 0.0) & (place > 0.5e-3), -2.0, 0.0)

    run = made(case, 1200, solid=unlike, fluid=along(0.5), **({'edge': edge} if case is EDGE else {}))
    last = last_cycle(run)
    odd = {name: np.where(last, getattr(run, name), 100.0 * getattr(run, name)) for name in ('solid', 'fluid', 'edge')}
    other = run._replace(friction=np.where(last, run.friction, -100.0 * run.friction), **odd)
    assert findings(other) == findings(run)
    assert findings(other._replace(sliding_velocity=np.where(last, run.velocity, 0.0))) == findings(run)


def test_both_strokes_count_alike_on_slowing_down():
    """At 4 mm/s 5.6 and 11.2 N, at 20 mm/s 4 and 8 N."""
    found = findings(made(steps=6000, solid=unlike))
    assert found.solid_slow == pytest.approx(8.4, abs=0.02)
    assert found.solid_fast == pytest.approx(4.0, abs=0.01)
    assert found.rise_on_deceleration == pytest.approx(0.4, abs=0.01)  # the last fast step is slower by 1 %
    one_way = dataclasses.replace(CASE, motion=dataclasses.replace(MOTION, cycles=1))
    run = made(one_way, 6000, solid=unlike)
    assert findings(run._replace(velocity=np.abs(run.velocity))).rise_on_deceleration == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize('sense', [1.0, -1.0])
def test_friction_on_slowing_down_is_that_of_the_last_step_at_each_speed_resisting_or_not(sense):
    """Steps of 0.5 ms, 0.2 mm/s slower each: 19.9 mm/s in the first (1 % is 0.2 mm/s), 4.1 mm/s in the eightieth."""
    run = made(steps=1200, solid=along(4.0))
    solid = run.solid.copy()
    for turn in (900, 1200):
        solid[turn - 100] *= 5.0 / 4.0
        solid[turn - 100 + 79] *= sense * 7.0 / 4.0
    found = findings(run._replace(solid=solid, friction=solid))
    assert found.rise_on_deceleration == pytest.approx(7.0 / 5.0 - 1.0)
    assert found.solid_slow == pytest.approx(7.0)


@pytest.mark.parametrize('force', [2.0, 0.02])
@pytest.mark.parametrize('mirror', [1.0, -1.0])
def test_a_seal_assists_over_the_same_way_whatever_its_friction_and_whichever_way_it_turns(force, mirror):
    """Over 0.1 mm, with a groove that is stiffer the stronger the friction."""
    stiff = dataclasses.replace(CASE, groove=GrooveSpring(stiffness=1e4 * force))

    def sprung(place, velocity):  # slowly at first about its zero
        end = np.where(velocity > 0.0, -1e-3, 1e-3)
        return force * np.clip((place - end) / 0.1e-3 - np.sign(velocity), -1.0, 1.0) ** 3

    run = made(stiff, 6000, solid=sprung)
    columns = {name: mirror * getattr(run, name) for name in ('position', 'velocity', 'friction', 'solid')}
    found = findings(run._replace(**columns))
    assert found.assisted_length == pytest.approx(0.1e-3, rel=0.01)
    assert found.elastic_length == pytest.approx(0.1e-3, rel=0.01)


@pytest.mark.parametrize(('share', 'counts'), [(0.04, False), (0.08, True)])
def test_friction_before_a_reversal_counts_from_a_twentieth_of_the_largest_on(share, counts):
    found = findings(
        made(solid=lambda place, velocity: np.where(np.abs(place) > 0.9e-3, share, 1.0) * 2.0 * np.sign(velocity))
    )
    assert (found.elastic_length is not None) == counts


@pytest.mark.parametrize('force', [1.0, 0.01])
def test_second_lobe_is_the_first_maximum_above_zero_and_between_two_steps_if_they_are_equal(force):
    """On the way to the right from -1 mm: a maximum of -1 below zero, then 3, 3 about the middle of two steps."""
    run = made(BISTABLE, solid=along(2.0), sliding_velocity=lambda *_: 0.0)
    middle = np.abs(run.position) < 0.3e-3
    first = int(np.flatnonzero(last_cycle(run) & (run.velocity > 0.0))[0])
    friction = run.friction.copy()
    friction[first : first + 10] = force * np.array([-2.0, -1.0, -2.0, 1.0, 2.0, 3.0, 3.0, 2.0, 5.0, 1.0])
    moved = run._replace(friction=friction, sliding_velocity=np.where(middle, run.velocity, 0.0))
    exact = 0.5 * (run.position[first + 5] + run.position[first + 6])
    assert findings(moved).second_lobe == pytest.approx(exact, rel=1e-12)


def test_second_lobe_may_be_in_the_second_step():
    """A parabola through 2, 3 and 1 N has its vertex a sixth of a step before its middle."""
    run = made(BISTABLE, solid=along(2.0))
    first = int(np.flatnonzero(last_cycle(run) & (run.velocity > 0.0))[0])
    friction, sliding = run.friction.copy(), run.velocity.copy()
    friction[first : first + 3], sliding[first : first + 3] = (2.0, 3.0, 1.0), 0.0
    exact = run.position[first + 1] - (run.position[first + 1] - run.position[first]) / 6.0
    found = findings(run._replace(friction=friction, sliding_velocity=sliding))
    assert found.second_lobe == pytest.approx(exact, rel=1e-12)


def test_friction_on_leaving_is_read_while_the_chamfer_pushes_with_half_of_its_most():
    """It pushes with 2 N, then 1.2 N, then 0.8 N, against 1, 0.1 and 0.01 N of friction."""

    def edge(place, velocity):
        return np.where(velocity > 0.0, np.where(place > 0.7e-3, -2.0, np.where(place > 0.6e-3, -1.2, -0.8)), 0.0)

    def solid(place, velocity):
        return np.where(place > 0.7e-3, 1.0, np.where(place > 0.6e-3, 0.1, 0.01)) * np.sign(velocity)

    run = made(EDGE, 6000, edge=edge, solid=solid)
    found = findings(run._replace(friction=run.solid))
    assert (found.edge_assist, found.friction_on_leaving) == (2.0, 0.1)


# -- errors


def test_number_that_a_level_does_not_have_has_no_error():
    """The second lobe: there at 0.5 ms and at 1 ms, and on the grids, not at 2 ms."""

    def stuck(place, velocity):
        return np.where(place < 0.0, 0.0, velocity)

    def run(case: StudyCase) -> TransientResult:
        return made(case, solid=lobed if case.numerics.time_step < 2e-3 else along(2.0), sliding_velocity=stuck)

    case = dataclasses.replace(BISTABLE, numerics=StudyNumerics(cells=160, time_step=5e-4))
    by_step, by_grid = discretisation_errors(case, findings(run(case)), run)
    assert 'second_lobe' not in by_step
    assert by_grid['second_lobe'] == 0.0
    assert 'friction' in by_step


def test_time_step_may_pass_the_rounding_of_the_edge_in_four():
    """20 um at 20 mm/s in four steps: 0.25 ms."""
    for step in (2.5e-4, 1e-4):
        check_time_step(dataclasses.replace(EDGE, numerics=StudyNumerics(time_step=step)))
    with pytest.raises(ValueError, match=r'case made: numerics.time_step is 0.00026 s, .* at most 0.00025 s'):
        check_time_step(dataclasses.replace(EDGE, numerics=StudyNumerics(time_step=2.6e-4)))
    check_time_step(dataclasses.replace(CASE, numerics=StudyNumerics(time_step=0.1)))


@pytest.mark.parametrize(
    ('levels', 'error'),
    [
        ((1.0, 1.5, 3.5), 0.5 / 3.0),  # second order: changes by a factor 4
        ((1.0, 1.5, 2.5), 0.5),  # first order
        ((5.0, 4.0, 1.0), 0.5),  # a factor 3, falling
        ((0.0, 1.0, 11.0), 1.0 / 3.0),  # no scheme is of more than second order
        ((0.0, 1.0, 2.2), 2.0),  # slower than it can be: no convergence
        ((0.0, 1.0, -0.5), 2.5),  # to and fro
        ((0.0, 1.0, 1.0), 1.0),
    ],
)
def test_error_of_three_levels_is_that_of_richardson_within_bounds(levels, error):
    assert error_of_levels(*levels) == pytest.approx(error, rel=1e-12)


def test_errors_come_from_doubled_steps_and_halved_grids():
    """Friction 2 + 1e3 dt + 2e4 / n^2 N, at 0.5 ms and 120 cells: of first order in dt, of second in 1 / n."""
    runs = []

    def run(case: StudyCase) -> TransientResult:
        runs.append((case.numerics.time_step, case.numerics.cells))
        force = 2.0 + 1e3 * case.numerics.time_step + 2e4 / case.numerics.cells**2
        return made(case, solid=along(force))

    case = dataclasses.replace(CASE, numerics=StudyNumerics(cells=160, time_step=5e-4))
    by_step, by_grid = discretisation_errors(case, findings(run(case)), run)
    assert runs[1:] == [(1e-3, 160), (2e-3, 160), (5e-4, 80), (5e-4, 40)]
    assert by_step['friction'] == pytest.approx(0.5, rel=1e-6)
    assert by_grid['friction'] == pytest.approx(2e4 / 160**2, rel=1e-6)
    assert by_step['solid_share'] == 0.0
    assert 'edge_peak' not in by_step
    runs.clear()
    coarse = dataclasses.replace(CASE, numerics=StudyNumerics(cells=50))
    discretisation_errors(coarse, findings(run(coarse)), run)
    assert [cells for _, cells in runs[3:]] == [32, 32]


# -- study of the solid shear stress


def test_study_is_in_order_of_shear_stress_and_relative_to_its_mean():
    """Friction 2 and 6 N at 1 and 2 MPa: 2 and 3 N/MPa about 2.5; position by position between 1 and 4 about it."""

    def solid(force):
        return lambda place, velocity: force * np.where(place < 0.0, 0.5, 1.5) * np.sign(velocity)

    runs = [
        made(with_solid_shear_stress(CASE, 2e6), solid=solid(6.0), fluid=along(0.0)),
        made(with_solid_shear_stress(CASE, 1e6), solid=along(2.0), fluid=along(0.0)),
    ]
    table = study_table(runs)
    assert table.solid_shear_stress == (1e6, 2e6)
    assert table.friction == pytest.approx((2.0, 6.0), rel=0.02)
    assert table.solid_share == (1.0, 1.0)
    assert table.deviation == pytest.approx((-0.2, 0.2), abs=0.01)
    assert table.curve_deviation == pytest.approx((1.0 - 2.0 / 3.25, 4.5 / 3.25 - 1.0), rel=1e-6)


def test_study_looks_at_the_last_cycle_within_half_a_millimetre_of_the_middle_of_the_way():
    """About 5 mm: there 2 and 4 N at 1 and 2 MPa, so in proportion; elsewhere and before 7 N."""
    away = dataclasses.replace(CASE, motion=dataclasses.replace(MOTION, centre=5e-3))

    def solid(force):
        def friction(place, velocity):
            return np.where(np.abs(place - 5e-3) < 0.51e-3, force, 7.0) * np.sign(velocity)

        return friction

    runs = [made(with_solid_shear_stress(away, 1e6 * n), solid=solid(2.0 * n), fluid=along(0.0)) for n in (1, 2)]
    runs = [run._replace(friction=np.where(last_cycle(run), run.friction, 7.0)) for run in runs]
    assert study_table(runs).curve_deviation == pytest.approx((0.0, 0.0), abs=1e-12)


def test_study_of_nothing_is_refused():
    with pytest.raises(ValueError, match='study_table: there is no run'):
        study_table([])


# -- several seals on one spool


def test_mirrored_seal_moves_the_other_way_from_where_it_stands():
    forth, back = (SpoolSealMotion(MOTION, SpoolSeal('made', mirrored, 1e-4)) for mirrored in (False, True))
    assert forth.duration == MOTION.duration
    for time in (0.0, 0.03, 0.1, 0.2):
        place = MOTION.position(time)
        assert (forth.position(time), back.position(time)) == pytest.approx((1e-4 + place, 1e-4 - place))


def moving(member: SpoolSeal, run: TransientResult) -> TransientResult:
    """The run of a seal whose spool is where that of ``run`` is."""
    return run._replace(position=member.shift + (-run.position if member.mirrored else run.position))


@pytest.mark.parametrize('mirrored', [False, True])
def test_frictions_of_the_seals_of_a_spool_add_up_and_a_mirrored_one_counts_the_other_way(mirrored):
    first, second = SpoolSeal('made', mirrored, 1e-4), SpoolSeal('made', not mirrored)
    runs = [made(solid=along(2.0)), made(solid=along(-0.5))]
    both = superposed((first, second), [moving(first, runs[0]), moving(second, runs[1])])
    assert both.position == pytest.approx(runs[0].position, abs=1e-18)
    assert both.friction == pytest.approx((-2.5 if mirrored else 2.5) * np.sign(runs[0].velocity))
    assert both.members.shape == (2, 600)
    assert both.last_cycle.sum() == 300


@pytest.mark.parametrize('steps', [300, 599])
def test_seals_of_other_time_steps_are_refused(steps):
    members = (SpoolSeal('made'), SpoolSeal('made'))
    with pytest.raises(ValueError, match='superposed: the seals have different time steps'):
        superposed(members, [made(), made(steps=steps)])
    with pytest.raises(ValueError, match='longer than argument 1'):
        superposed(members[:1], [made(), made()])
    later = made()
    with pytest.raises(ValueError, match='different time steps'):
        superposed(members, [made(), later._replace(time=later.time + 0.01)])


def test_stroke_of_a_spool_has_its_peak_and_its_level_at_speed():
    """2 N at the highest speed and 6 N at 0.3 mm on the way to the right; 3 N back; 9 N in the first cycle only."""

    def solid(place, velocity):
        return np.where(velocity < 0.0, -3.0, np.where(np.abs(place - 0.3e-3) < 2e-5, 6.0, 2.0))

    run = made(solid=solid)
    run = run._replace(friction=np.where(last_cycle(run), run.friction, 9.0))
    spool = superposed((SpoolSeal('made'),), [run])
    forth, back = stroke_friction(spool, 1.0), stroke_friction(spool, -1.0)
    assert (forth.peak, forth.level) == (6.0, 2.0)
    assert forth.peak_position == pytest.approx(0.3e-3, abs=4e-5)
    assert (back.peak, back.level) == (3.0, 3.0)
    slow = made(solid=lambda _, velocity: np.where(np.abs(velocity) > 19.9e-3, 2.0, 5.0))
    assert stroke_friction(superposed((SpoolSeal('made'),), [slow]), 1.0).level == 2.0


def test_spool_that_does_not_move_that_way_has_no_stroke():
    run = made(solid=along(2.0))
    spool = superposed((SpoolSeal('made'),), [run._replace(position=1e-3 * run.time)])
    with pytest.raises(ValueError, match=r'stroke_friction: the spool does not move in direction -1$'):
        stroke_friction(spool, -1.0)
    assert math.isclose(stroke_friction(spool, 1.0).peak, 2.0)
    still = superposed((SpoolSeal('made'),), [run._replace(position=np.zeros(600))])
    with pytest.raises(ValueError, match=r'does not move in direction 1$'):
        stroke_friction(still, 1.0)


def test_where_no_chamfer_pushes_there_is_no_friction_on_leaving():
    run = made(EDGE, 6000, edge=lambda place, _: np.zeros_like(place), solid=along(2.0))
    friction = np.where(last_cycle(run), run.friction, -50.0)  # of another cycle
    found = findings(run._replace(friction=friction))
    assert (found.edge_assist, found.friction_on_leaving) == (0.0, None)
