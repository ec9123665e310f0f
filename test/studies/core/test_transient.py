"""Whole motions: what the spool-valve paper found, as numbers, on a grid coarse enough for a test.

The numbers of the paper's own grid and their errors are in docs/ehl.md.
"""

import dataclasses
from functools import cache

import numpy as np
import pytest
import yaml
from paths import ROOT

from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.lubrication.friction_map import steady_friction
from seal_friction_ros.core.lubrication.lubrication_case import MapGrid
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_studies.core import transient
from seal_friction_studies.core.findings import discretisation_errors, error_of_levels, findings
from seal_friction_studies.core.groove import GrooveSpring
from seal_friction_studies.core.kinematics import ConstantAcceleration, MeasuredMotion
from seal_friction_studies.core.spool import SpoolSealMotion, superposed
from seal_friction_studies.core.study import study_table
from seal_friction_studies.core.study_case import (
    AirPressure,
    SpoolSeal,
    StudyCase,
    StudyNumerics,
    Viscoelasticity,
    parse_study_case,
)
from seal_friction_studies.core.transient import (
    StepBefore,
    TransientResult,
    initial_state,
    run_transient,
    start_of_step,
    transient_model,
    with_solid_shear_stress,
)
from seal_friction_studies.core.wall import ControlEdge, FilmSupply

INNER = StudyCase(name='inner', numerics=StudyNumerics(cells=96, time_step=1e-3))
EDGE = dataclasses.replace(INNER, motion=ConstantAcceleration(distance=2.7e-3), control_edge=ControlEdge())


@cache
def done(case: StudyCase) -> TransientResult:
    return run_transient(case)


def test_solid_friction_has_the_largest_share_above_90_percent():
    assert findings(done(INNER)).solid_share > 0.9


def test_solid_friction_falls_and_fluid_friction_rises_with_speed():
    found = findings(done(INNER))
    assert found.solid_fast < 0.9 * found.solid_slow
    assert found.fluid_fast > 2.0 * found.fluid_slow


@pytest.mark.long
def test_friction_rises_on_deceleration_by_more_than_step_and_grid_blur():
    found = findings(done(INNER))
    by_step, by_grid = discretisation_errors(INNER, found, run_transient)
    assert found.rise_on_deceleration > 0.1
    assert by_step['rise_on_deceleration'] + by_grid['rise_on_deceleration'] < 0.3 * found.rise_on_deceleration


def test_friction_is_the_sum_of_its_shares_and_balances_the_groove_while_sticking():
    result = done(EDGE)
    assert result.friction == pytest.approx(result.solid + result.fluid + result.edge, abs=1e-12)
    stuck = (result.sliding_velocity == 0.0) & (result.edge > -1e-3)
    spring = np.array([EDGE.groove.force(lag) for lag in result.lag])
    assert stuck.sum() > 10
    assert result.friction[stuck] == pytest.approx(spring[stuck], abs=0.01 * np.abs(result.friction).max())


def test_after_a_reversal_friction_pushes_along_for_as_long_as_elasticity_says():
    found = findings(done(INNER))
    assert found.assisted_length == pytest.approx(found.elastic_length, rel=0.01)
    softer = dataclasses.replace(INNER, groove=GrooveSpring(stiffness=0.5 * INNER.groove.stiffness))
    assert findings(done(softer)).assisted_length == pytest.approx(2.0 * found.assisted_length, rel=0.1)


@pytest.mark.long
def test_seal_that_may_lean_either_way_has_a_second_lobe_near_minus_1_4_mm():
    long_way = dataclasses.replace(INNER, motion=ConstantAcceleration(distance=3e-3))
    bistable = dataclasses.replace(long_way, groove=GrooveSpring(half_clearance=0.14e-3))
    result = done(bistable)
    assert findings(result).second_lobe == pytest.approx(-1.4e-3, abs=0.03e-3)
    forth = (result.time > 0.5 * result.time[-1]) & (result.velocity > 0.0)
    signs = np.sign(result.friction[forth])
    assert (np.diff(signs[signs != 0.0]) != 0.0).sum() == 3  # along, against, along, against
    assert findings(done(long_way)).second_lobe is None


def test_friction_in_the_groove_holds_the_seal_on_one_seat():
    """0.15 is that of the paper: more than the wall can pull beyond the ridge."""
    groove = GrooveSpring(half_clearance=0.14e-3, friction_coefficient=0.15)
    case = dataclasses.replace(INNER, motion=ConstantAcceleration(distance=3e-3), groove=groove)
    result = done(case)
    assert findings(result).second_lobe is None
    leaning = result.lag[result.time > 0.5 * result.time[-1]]
    assert leaning.max() < 0.0 or leaning.min() > 0.0


def test_pressure_difference_takes_the_second_seat_away():
    under_air = dataclasses.replace(
        INNER, groove=GrooveSpring(half_clearance=0.14e-3), air=AirPressure(pressure_left=1e5)
    )
    assert under_air.seated_groove.half_clearance == 0.0


def test_control_edge_makes_a_peak_on_the_way_in_and_pushes_on_the_way_out():
    result, found = done(EDGE), findings(done(EDGE))
    assert found.edge_peak > 1.15
    assert found.edge_assist > 0.2
    away = result.position > EDGE.control_edge.position + 0.5e-3
    assert np.abs(result.friction[away]).max() < 0.05 * np.abs(result.friction).max()


def test_chamfer_gives_back_what_it_took_but_for_what_friction_changes():
    """Quasi-static and dry, its force is conservative: the same work in and out."""
    slow = dataclasses.replace(
        EDGE,
        motion=ConstantAcceleration(distance=2.7e-3, speed=5e-3, cycles=1),
        film_supply=FilmSupply(1e-9),
        seal=dataclasses.replace(EDGE.seal, solid_shear_stress=1e3),
        numerics=StudyNumerics(cells=96, time_step=2e-3),
    )
    result = done(slow)
    way = result.sliding_velocity * np.diff(result.time, prepend=0.0)
    works = [float((result.edge * way)[result.velocity * sign > 0.0].sum()) for sign in (1.0, -1.0)]
    assert works[0] == pytest.approx(-works[1], rel=0.05)


@pytest.mark.long
def test_starved_film_removes_the_rise_on_deceleration():
    starved = dataclasses.replace(INNER, film_supply=FilmSupply(0.6e-6), motion=ConstantAcceleration(cycles=3))
    found, flooded = findings(done(starved)), findings(done(INNER))
    assert found.rise_on_deceleration < 0.2 * flooded.rise_on_deceleration
    assert found.friction > flooded.friction


def test_starved_film_is_neither_made_nor_lost():
    starved = dataclasses.replace(INNER, film_supply=FilmSupply(0.6e-6), motion=ConstantAcceleration(cycles=1))
    model = transient.transient_model(starved)
    motion = starved.motion
    moment = initial_state(model, motion.position(0.0))

    def lubricant(moment) -> float:
        width = model.contact.body.cell_width
        return moment.wall_film.volume.sum() + (moment.state.gap * moment.state.saturation).sum() * width

    before = lubricant(moment)
    for i in range(1, 101):
        time = i * 1e-3
        moment, *_ = transient.transient_step(model, moment, time, motion.position(time))
        assert lubricant(moment) == pytest.approx(before, rel=1e-12)
        assert moment.wall_film.volume.min() >= -1e-20


def test_starved_seal_goes_to_the_left_as_it_goes_to_the_right():
    starved = dataclasses.replace(INNER, film_supply=FilmSupply(0.6e-6), numerics=StudyNumerics(cells=64))
    model = transient.transient_model(starved)
    ends, forces = [], []
    for direction in (1.0, -1.0):
        moment = initial_state(model, 0.0)
        for i in range(1, 7):
            moment, force, *_ = transient.transient_step(model, moment, i * 2e-3, direction * i * 6e-5)
        ends.append(moment)
        forces.append(force)
    right, left = ends
    assert right.lag == pytest.approx(-left.lag, rel=1e-6)
    assert right.lag < 0.3e-3  # it slides
    assert right.state.gap == pytest.approx(left.state.gap[::-1], rel=1e-6)
    assert right.state.saturation == pytest.approx(left.state.saturation[::-1], rel=1e-6)
    assert forces[0].friction == pytest.approx(-forces[1].friction, rel=1e-6)
    middle = slice(200, len(right.wall_film.volume) - 200)  # of the wall, about the start
    there, mirrored = (moment.wall_film.volume[middle] for moment in ends)
    assert there.sum() == pytest.approx(mirrored.sum(), rel=1e-6)


@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_velocity_at_the_end_of_a_step_is_that_of_an_even_acceleration(direction):
    """0.4 m/s^2: 4 mm/s on average over 20 ms, then 11 mm/s over 15 ms and 14 mm/s at their end."""
    start = initial_state(transient_model(INNER), 0.0)
    after = start._replace(before=StepBefore(start.state.gap, start.creep, 20e-3, direction * 4e-3))
    assert transient._velocity_at_end(after, direction * 11e-3, 15e-3) == pytest.approx(direction * 14e-3)
    assert transient._velocity_at_end(after, -direction * 11e-3, 15e-3) == -direction * 11e-3  # turned round
    fast = start._replace(before=StepBefore(start.state.gap, start.creep, 20e-3, direction * 0.4))
    assert transient._velocity_at_end(fast, direction * 1e-3, 15e-3) == direction * 1e-3  # would turn round
    assert transient._velocity_at_end(start, direction * 11e-3, 15e-3) == direction * 11e-3  # the first step


def test_steps_are_taken_at_once_until_a_loaded_part_comes_to_the_rounded_edge():
    """Two roundings of 20 um before the chamfer from 0.3 to 0.4667 mm, and two after it."""
    model = transient_model(EDGE)
    loads = initial_state(model, -1e-3)
    solid, _ = model.contact.asperity_pressure(loads.state.gap)
    loaded = model.place[solid > 0.01 * solid.max()]
    before, after = 0.26e-3 - loaded[-1], 0.3e-3 + 60e-6 / 0.36 + 40e-6 - loaded[0]

    def may(position, *positions, lag=0.0):
        at = loads._replace(position=position, lag=lag)
        return transient._may_be_one_step(model, at, list(positions))

    near, far = 1e-7, 1e-4
    assert may(before - far, before - 0.5 * far, before - near)
    assert not may(before - far, before + near)
    assert not may(before + near, before - near)
    assert may(after + far, after + near)
    assert not may(after + far, after - near)
    assert not may(after - near, after + near)
    assert not may(before - far, after + far)
    assert may(before + 0.5 * far, before + far - near, lag=far)  # the contact counts, not the spool
    assert not may(before - 2.0 * far, before - far, before - 1.5 * far)  # to and fro
    assert not may(before - far, before - far)
    assert transient._may_be_one_step(transient_model(INNER), loads, [0.0, 1.0])


def test_run_of_more_numbers_than_fit_is_refused():
    long = dataclasses.replace(INNER, motion=ConstantAcceleration(cycles=1000), numerics=StudyNumerics(4000))
    with pytest.raises(ValueError, match=r'case inner: \d+ steps of 4000 cells are too many to keep'):
        run_transient(long)


def test_creep_in_decades_has_the_whole_compliance_in_equal_shares():
    parts = Viscoelasticity(stiffening=3.0, relaxation_time=0.01, decades=3).creep
    assert [time for _, time in parts] == pytest.approx([0.01, 0.1, 1.0, 10.0])
    assert {share for share, _ in parts} == {0.75 / 4}


@pytest.mark.parametrize('decades', [0, 1, 2])
def test_a_seal_that_creeps_at_once_is_the_elastic_one(decades):
    fast = dataclasses.replace(INNER, viscoelasticity=Viscoelasticity(relaxation_time=1e-6, decades=decades))
    assert findings(done(fast)).friction == pytest.approx(findings(done(INNER)).friction, rel=0.01)


@pytest.mark.long  # the test below holds that creep raises it
def test_slow_decades_of_creep_raise_the_friction_after_a_control_edge_more():
    after = [
        findings(
            done(dataclasses.replace(EDGE, viscoelasticity=Viscoelasticity(relaxation_time=0.01, decades=d)))
        ).after_edge
        for d in (0, 2)
    ]
    assert after[0] < after[1]


@pytest.mark.long
def test_viscoelastic_seal_rubs_more_after_a_control_edge_and_no_more_without_one():
    stiffer = Viscoelasticity(stiffening=1.0, relaxation_time=0.3)
    after_edge = [
        findings(done(case)).after_edge for case in (EDGE, dataclasses.replace(EDGE, viscoelasticity=stiffer))
    ]
    assert after_edge[1] > 1.1 * after_edge[0]
    plain = [findings(done(case)).friction for case in (INNER, dataclasses.replace(INNER, viscoelasticity=stiffer))]
    assert plain[1] == pytest.approx(plain[0], rel=0.02)


def test_pressure_raises_the_friction():
    assert (
        findings(done(dataclasses.replace(INNER, air=AirPressure(pressure_left=6e5)))).friction
        > 1.3 * findings(done(INNER)).friction
    )


@pytest.mark.parametrize('case', [INNER, EDGE], ids=['inner', 'edge'])
def test_no_step_loses_lubricant(case):
    assert done(case).mass_defect < 1e-12


def test_film_and_void_exclude_each_other_at_every_moment():
    result = done(EDGE)
    assert (result.film_pressure / 1e6 * (1.0 - result.saturation)).max() <= 1e-12
    assert result.gap.min() > 0.0


@pytest.mark.long  # five runs
def test_friction_over_solid_shear_stress_is_constant_within_15_percent_and_worst_at_the_smallest():
    one = dataclasses.replace(INNER, motion=ConstantAcceleration(cycles=1))
    table = study_table([done(with_solid_shear_stress(one, stress)) for stress in (2.5e6, 0.5e6, 1.5e6)])
    assert table.solid_shear_stress == (0.5e6, 1.5e6, 2.5e6)
    assert max(map(abs, table.deviation)) == abs(table.deviation[0]) < 0.15
    assert max(table.curve_deviation) == table.curve_deviation[0] < 0.15
    assert list(table.solid_share) == sorted(table.solid_share)


def test_measured_motion_of_the_same_course_gives_the_same_friction():
    motion = ConstantAcceleration(cycles=1)
    times = np.linspace(0.0, motion.duration, 4001)
    signal = MeasuredMotion(times.tolist(), [motion.position(t) for t in times])
    one = dataclasses.replace(INNER, motion=motion)
    assert run_transient(one, signal).friction == pytest.approx(done(one).friction, abs=2e-3)


def test_runs_are_the_same_to_the_bit():
    one = dataclasses.replace(INNER, motion=ConstantAcceleration(cycles=1))
    assert run_transient(one).friction.tobytes() == run_transient(one).friction.tobytes()


def test_the_formula_of_second_order_follows_a_parabola_over_steps_of_any_length():
    start = initial_state(transient_model(INNER), 0.0)

    def at(time):
        return np.full(INNER.numerics.cells, 1e-6 + 1e-6 * time**2)

    for earlier, now, then in ((0.0, 0.3, 0.5), (0.3, 0.5, 0.6), (0.5, 0.6, 1.0)):
        film = start.state._replace(gap=at(now), saturation=np.ones_like(start.state.gap))
        moment = start._replace(state=film, before=StepBefore(at(earlier), start.creep, now - earlier, 0.0))
        begun = start_of_step(moment, then - now)
        slope = (at(then) - begun.thickness) / begun.step
        assert slope == pytest.approx(2e-6 * then)


@pytest.mark.long
def test_friction_is_of_nearly_second_order_in_the_time_step():
    """On slowing down; a scheme of first order would halve its error with the step."""
    one = dataclasses.replace(INNER, motion=ConstantAcceleration(cycles=1))
    friction = []
    for step in (1e-3, 5e-4, 2.5e-4):
        result = run_transient(dataclasses.replace(one, numerics=StudyNumerics(cells=96, time_step=step)))
        friction.append(np.interp(np.linspace(0.4, 0.46, 7) * result.time[-1], result.time, result.friction))
    coarse, fine = (np.abs(change).mean() for change in np.diff(friction, axis=0))
    assert coarse > 2.5 * fine
    assert coarse < 1e-4  # [N] of 0.65 N


@pytest.mark.long  # fine steps
def test_steps_at_once_away_from_the_edge_leave_the_findings_as_they_are():
    once = dataclasses.replace(EDGE, motion=ConstantAcceleration(distance=2.7e-3, cycles=1))
    runs = [
        run_transient(dataclasses.replace(once, numerics=dataclasses.replace(EDGE.numerics, time_step=4e-4, **more)))
        for more in ({}, {'steps_at_once': 4})
    ]
    assert runs[1].newton_iterations < 0.7 * runs[0].newton_iterations
    assert runs[1].time == pytest.approx(runs[0].time, rel=1e-12)
    assert runs[1].position == pytest.approx(runs[0].position, abs=1e-6)
    plain, found = (findings(run)._asdict() for run in runs)
    for field in ('friction', 'edge_peak', 'edge_assist', 'after_edge', 'solid_share'):
        assert found[field] == pytest.approx(plain[field], rel=0.01), field


@pytest.mark.long
def test_the_error_of_the_peak_at_the_control_edge_holds_a_finer_one():
    def with_step(step):
        return dataclasses.replace(EDGE, numerics=StudyNumerics(cells=64, time_step=step))

    case = with_step(1.4e-4)
    found = findings(run_transient(case))
    by_step, _ = discretisation_errors(case, found, run_transient)
    finer = findings(run_transient(with_step(0.7e-4)))
    assert abs(finer.edge_peak - found.edge_peak) < by_step['edge_peak'] < 0.05 * found.edge_peak


def test_steps_that_pass_the_control_edge_unseen_are_refused_as_levels():
    """At 1, 2 and 4 ms the peaks agree within 0.001, and are 0.18 off."""
    with pytest.raises(ValueError, match=r'time_step is 0.001 s, too long to see .* at most 0\.00015 s'):
        discretisation_errors(EDGE, findings(done(EDGE)), run_transient)


@pytest.mark.parametrize(('order', 'error'), [(1, 1.0), (2, 1.0), (0.5, 1.0)])
def test_error_of_three_levels_is_that_of_the_finest(order, error):
    levels = [3.0 + error * 2.0 ** (order * k) for k in range(3)]
    assert error_of_levels(*levels) == pytest.approx(error, rel=0.2)


def test_levels_without_an_order_have_both_changes_as_error():
    assert error_of_levels(1.0, 1.1, 0.8) == pytest.approx(0.4)
    assert error_of_levels(1.0, 1.1, 1.11) == pytest.approx(0.2)  # slower and slower: twice the last change
    assert error_of_levels(1.0, 1.0, 1.0) == 0.0


def test_step_that_fails_is_taken_in_halves_and_counted(monkeypatch):
    one = dataclasses.replace(INNER, motion=ConstantAcceleration(cycles=1))
    really, asked = transient.transient_step, []

    def fails_at_first(model, moment, time, position):
        asked.append(time - moment.time)
        if len(asked) in (3, 4):
            raise NotConvergedError('told to')
        return really(model, moment, time, position)

    monkeypatch.setattr(transient, 'transient_step', fails_at_first)
    result = run_transient(one)
    assert result.retried_steps == 2
    assert asked[3] == pytest.approx(0.5 * asked[2])
    assert asked[4] == pytest.approx(0.25 * asked[2])
    assert len(result.time) == len(done(one).time)
    assert result.friction[20:] == pytest.approx(done(one).friction[20:], rel=0.01)


def test_run_that_does_not_converge_ends_in_an_error_that_says_when(monkeypatch):
    def fails(*_arguments):
        raise NotConvergedError('told to')

    monkeypatch.setattr(transient, 'contact_step', fails)
    with pytest.raises(NotConvergedError, match=r'^case inner at 9\.\d+e-07 s: told to$'):
        run_transient(INNER)


@pytest.mark.long  # two whole runs across the edge
def test_mirrored_pair_of_seals_makes_a_friction_without_preference():
    members = (SpoolSeal('edge', shift=0.33e-3), SpoolSeal('edge', mirrored=True, shift=0.33e-3))
    motion = ConstantAcceleration(distance=2.7e-3, cycles=2)
    runs = [run_transient(EDGE, SpoolSealMotion(motion, member)) for member in members]
    both = superposed(members, runs)
    last = both.time > motion.duration - motion.stroke_time
    stroke_before = np.interp(both.time[last] - motion.stroke_time, both.time, both.friction)
    assert both.friction[last] == pytest.approx(-stroke_before, abs=0.06 * np.abs(both.friction).max())
    assert both.position.min() == pytest.approx(-1.35e-3, abs=1e-6)


def test_case_document_makes_a_case_with_the_defaults_of_the_paper():
    case = parse_study_case({'name': 'x', 'groove': {'half_clearance': 1e-4}, 'viscoelasticity': {}})
    assert isinstance(case, StudyCase)
    assert (case.grease.yield_stress, case.motion.speed, case.numerics.cells) == (530.96, 34e-3, 226)
    assert case.seal.modulus == pytest.approx(8.0 * 1.785e6)
    assert case.groove.half_clearance == 1e-4
    assert case.viscoelasticity is not None
    assert case.control_edge is None


@pytest.mark.parametrize(
    ('document', 'words'),
    [
        ([], 'a case file is a mapping'),
        ({'name': 3}, 'name = 3 is not one line of text'),
        ({'name': 'x', 'grese': {}}, 'case x has no grese: it has air, '),
        ({'name': 'x', 'grease': {'flow_index': 2.0}}, 'flow_index = 2.0 1 is above its upper bound 1.0'),
        ({'name': 'x', 'numerics': {'film_width': 2e-3}}, 'section_height = 0.001 m is less than numerics.film_width'),
        ({'name': 'x', 'film_supply': {}, 'air': {'pressure_left': 1e5}}, 'film_supply needs both sides at ambient'),
        ({'name': 'x', 'control_edge': {}, 'air': {'pressure_right': 1e5}}, 'control_edge needs both sides at ambient'),
        ({'name': 'x', 'seal': {'mooney_c01': 0.0}}, 'give the seal a stiffness'),
        (
            {
                'name': 'x',
                'seal': {'body': 'finite_elements', 'section_hold': 'bottom_and_flanks'},
                'groove': {'half_clearance': 1e-4},
            },
            'half_clearance = 0.0001 m leaves the flanks free, but seal.section_hold is bottom_and_flanks',
        ),
        ({'name': 'x', 'seals': []}, 'seals is empty'),
        ({'name': 'x', 'seals': [{'case': 'y', 'side': 1}]}, r'seals\[0\] has no side'),
    ],
)
def test_an_invalid_case_is_refused_in_one_line(document, words):
    with pytest.raises(ValueError, match=words) as caught:
        parse_study_case(document)
    assert '\n' not in str(caught.value)


def test_map_of_a_case_is_of_its_seal_on_a_plain_flooded_wall_whatever_else_the_case_has():
    grid = MapGrid(velocities=2, pressures=2)
    plain = dataclasses.replace(INNER, map=grid)
    walls = {'control_edge': ControlEdge(), 'film_supply': FilmSupply(), 'viscoelasticity': Viscoelasticity()}
    with_walls = dataclasses.replace(plain, **walls)
    under_air = dataclasses.replace(plain, air=AirPressure(pressure_left=1e5, pressure_right=3e5))
    expected = steady_friction(plain, 2e5).friction
    assert all((steady_friction(case, 2e5).friction == expected).all() for case in (with_walls, under_air))


def test_an_o_ring_has_no_run_of_its_own():
    text = (ROOT / 'config' / 'oring' / 'ms28775_114_blind.yaml').read_text()
    case = dataclasses.replace(INNER, oring=parse_oring_case(yaml.safe_load(text)).case)
    with pytest.raises(ValueError, match='an O-ring has a friction map only: seal_friction ehl map'):
        transient_model(case)
