"""The friction map: computed, and as a law that the live estimate can use."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.estimation.estimator import EstimatorParameters, EstimatorSettings, init, step
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.seal_file import mount_seals
from seal_friction_ros.core.lubrication import friction_map as module
from seal_friction_ros.core.lubrication.contact import ContactState
from seal_friction_ros.core.lubrication.friction_map import friction_map, memory_length, stacked, steady_friction
from seal_friction_ros.core.lubrication.grease import Grease
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase, MapGrid
from seal_friction_ros.core.lubrication.model import film_at_rest, profile_model, solid_limit
from seal_friction_ros.core.lubrication.oring_film import oring_film
from seal_friction_ros.core.lubrication.seal_section import LubricationNumerics
from seal_friction_ros.core.lubrication.topography import Topography
from seal_friction_ros.core.messages.records import Force, Pressure
from seal_friction_ros.core.oring_contact.oring_case import OringNumerics
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case

CASE = LubricationCase(
    name='inner',
    numerics=LubricationNumerics(cells=96),
    map=MapGrid(velocity_min=1e-3, velocity_max=0.1, velocities=5, pressure_max=3e5, pressures=2),
)
LAW = FrictionMap(
    speeds=(1e-3, 1e-2, 1e-1),
    pressures=(0.0, 1e5),
    frictions=(3.0, 2.0, 1.0, 6.0, 4.0, 2.0),
    reference_speed=1e-2,
    memory_length=1e-3,
)


@pytest.fixture(scope='module')
def rows():
    return [steady_friction(CASE, pressure) for pressure in (3e5, 0.0)]


def test_map_falls_with_speed_and_rises_with_pressure(rows):
    law = friction_map(CASE, stacked(rows), 1e-4)
    table = np.array(law.frictions).reshape(2, 5)
    assert (np.diff(table, axis=1) < 0.0).all()
    assert (np.diff(table, axis=0) > 0.0).all()
    assert law.pressures == (0.0, 3e5)
    assert law.presliding_length == pytest.approx(table[0, 0] / CASE.groove.stiffness)


def test_shear_of_the_film_rises_with_speed_and_is_the_smaller_part_of_the_friction(rows):
    for row in rows:
        fluid = row.friction - row.solid
        assert fluid[0] > 0.0
        assert (np.diff(fluid) > 0.0).all()
        assert (fluid < 0.5 * row.friction).all()


def test_symmetrical_seal_without_pressure_rubs_alike_both_ways(rows):
    assert np.abs(rows[1].direction_difference).max() < 1e-6
    assert np.abs(rows[0].direction_difference).max() > 0.01


def test_rows_that_are_not_of_the_grid_are_refused(rows):
    with pytest.raises(ValueError, match='the rows are not those'):
        friction_map(CASE, stacked(rows[:1]), 0.0)


@pytest.fixture(scope='module')
def ring_row():
    text = (ROOT / 'config' / 'oring' / 'ms28775_114_blind.yaml').read_text()
    ring = dataclasses.replace(parse_oring_case(yaml.safe_load(text)).case, numerics=OringNumerics(lines=13))
    case = dataclasses.replace(
        CASE,
        oring=ring,
        topography=Topography(rms_height=1e-6, rms_slope=0.3, filling=True),
        grease=Grease(yield_stress=0.0, consistency_index=0.0, base_viscosity=0.017),
    )
    return case, [steady_friction(case, pressure) for pressure in (0.0, 3e5)]


def test_friction_of_a_ring_from_its_drawing_falls_with_speed_and_rises_with_pressure(ring_row):
    case, rows = ring_row
    table = np.array([row.friction for row in rows])
    assert (np.diff(table, axis=1) < 0.0).all()
    assert (np.diff(table, axis=0) > 0.0).all()
    assert rows[0].direction_difference == pytest.approx(np.zeros(5), abs=1e-3)  # the same both ways without fluid
    law = friction_map(case, stacked(rows), 1e-4)
    assert law.presliding_length == pytest.approx(rows[1].friction[0] / rows[1].stiffness)


def test_a_ring_that_lets_no_lubricant_in_has_one_friction_at_all_speeds(ring_row):
    """A contact percolates at a real contact of 0.42. A seal of the paper stays far below."""
    case, rows = ring_row
    assert not module.carries_film(stacked(rows))
    law = friction_map(case, stacked(rows), 1e-4)
    live = module.live_map(law, stacked(rows))
    assert not live.depends_on_speed
    assert (live.speeds, live.memory_length) == ((case.motion.speed,), 0.0)
    for pressure in (0.0, 1e5, 3e5, 9e5):
        for speed in (0.0, 1e-4, 0.034, 1.0):
            assert live.sliding_friction(pressure, speed) == pytest.approx(law.coulomb_friction(pressure))
    stiffness = law.frictions[0] / law.presliding_length
    assert live.frictions[0] / live.presliding_length == pytest.approx(stiffness)


def test_the_share_of_a_direction_is_that_of_the_line_through_no_pressure():
    """At 10 mm/s: 12 N towards and 8 N away at 1e5 Pa, where the mean is 10 N; half the share at half the pressure."""
    law = dataclasses.replace(LAW, pressures=(0.0, 0.5e5, 1e5), frictions=(10.0,) * 9)
    rows = [
        module.SteadyFriction(p, np.full(3, 10.0), np.full(3, 9.0), np.array([0.0, d, 2.0 * d]), 2e4, 0)
        for p, d in ((0.0, 0.0), (0.5e5, 2.0), (1e5, 4.0))
    ]
    assert module.directions(law, stacked(rows))[:, 2] == pytest.approx([12.0, 8.0])
    assert module.pressure_asymmetry(law, stacked(rows)) == pytest.approx(0.2)


def test_a_ring_rubs_less_towards_its_pressure(ring_row):
    case, rows = ring_row
    assert -0.9 < module.pressure_asymmetry(friction_map(case, stacked(rows), 1e-4), stacked(rows)) < -0.01


def test_a_seal_that_lets_lubricant_in_keeps_its_speeds(rows):
    assert module.carries_film(stacked(rows))
    law = friction_map(CASE, stacked(rows), 1e-4)
    assert module.live_map(law, stacked(rows)) == law


@pytest.mark.parametrize(('fall', 'is_levelled'), [(0.0004, True), (0.029, True), (0.04, False)])
def test_a_fall_with_pressure_within_the_error_of_the_mesh_is_levelled(rows, fall, is_levelled):
    falls = dataclasses.replace(LAW, frictions=(3.0, 2.0, 1.0, *(np.array([3.0, 2.0, 1.0]) * (1.0 - fall)).tolist()))
    live = module.live_map(falls, stacked(rows))
    assert (live.coulomb_friction(1e5) >= (1.0 - 1e-12) * live.coulomb_friction(0.0)) == is_levelled
    assert live.frictions[:3] == falls.frictions[:3]
    if not is_levelled:
        assert live == falls


def test_solid_friction_of_a_ring_is_at_most_tau_c_on_the_contact(ring_row):
    case, rows = ring_row
    film = oring_film(case, case.oring, 3e5)
    area = film.model.circumference * film.model.film_width
    assert 0.0 < rows[1].solid[0] < case.seal.solid_shear_stress * area


def test_film_remembers_over_about_the_length_of_the_contact():
    found = memory_length(CASE)
    assert 0.05e-3 < found.length < 0.6e-3
    assert found.retried_steps == 0


def test_step_of_the_map_that_fails_is_taken_in_halves_and_counted(monkeypatch):
    really, asked = module.contact_step, []

    def fails_at_first(*arguments):
        asked.append(arguments[6])
        if len(asked) in (3, 13):  # a finite step, then the infinite one
            raise NotConvergedError('told to')
        return really(*arguments)

    model = profile_model(CASE, 0.0, 0.0)
    start = film_at_rest(model)
    smoothly, none = module.steady_state(model, start, 0.01)
    monkeypatch.setattr(module, 'contact_step', fails_at_first)
    state, retried = module.steady_state(model, start, 0.01)
    assert (none, retried) == (0, 2)
    assert asked[3] == asked[4] == 0.5 * asked[2]
    assert math.isinf(asked[12])
    assert math.isinf(asked[14])
    assert state.gap == pytest.approx(smoothly.gap, rel=1e-9)


@pytest.mark.parametrize(('failures', 'gives_up'), [(20, False), (21, True)])
def test_map_gives_up_when_more_than_twenty_steps_have_failed(monkeypatch, failures, gives_up):
    asked = []

    def fails_often(_contact, state, *arguments):
        asked.append(arguments[4])
        if len(asked) <= failures:
            raise NotConvergedError('told to')
        return SimpleNamespace(state=state)

    model = profile_model(CASE, 0.0, 0.0)
    start = film_at_rest(model)
    monkeypatch.setattr(module, 'contact_step', fails_often)
    if gives_up:
        with pytest.raises(NotConvergedError, match=r'^told to$'):
            module._slid(model, start, 0.1, [1e-3])
    else:
        assert module._slid(model, start, 0.1, [1e-3])[2] == 20
        assert asked[20] == 1e-3 / 2**20


def test_step_to_the_steady_film_that_fails_is_led_by_one_of_250_passages(monkeypatch):
    """0.6 mm at 0.1 m/s: 6 ms a passage."""
    asked = []

    def fails_at_first(_contact, state, *arguments):
        asked.append(arguments[4])
        if len(asked) == 1:
            raise NotConvergedError('told to')
        return SimpleNamespace(state=state)

    model = profile_model(CASE, 0.0, 0.0)
    start = film_at_rest(model)
    monkeypatch.setattr(module, 'contact_step', fails_at_first)
    _, states, retried = module._slid(model, start, -0.1, [math.inf])
    assert asked == [math.inf, pytest.approx(1.5), math.inf]
    assert (len(states), retried) == (1, 1)


@pytest.mark.parametrize('velocity', [0.1, -0.1])
def test_film_is_led_to_the_steady_one_by_steps_each_two_to_five_times_as_long_as_the_last(monkeypatch, velocity):
    """From a fiftieth of a passage on: 0.6 mm at 0.1 m/s last 6 ms."""
    led: list[float] = []

    def slid(_model, start, _velocity, durations):
        led.extend(durations)
        return start, [start], 0

    monkeypatch.setattr(module, '_slid', slid)
    assert module.steady_state(SimpleNamespace(film_width=0.6e-3), 1.0, velocity) == (1.0, 0)
    growth = np.array(led[1:-1]) / np.array(led[:-2])
    assert growth.min() >= 2.0 - 1e-9
    assert growth.max() <= 5.0 + 1e-9
    assert led[0] == pytest.approx(0.02 * 6e-3)
    assert led[-2:] == [pytest.approx(100.0 * 6e-3), math.inf]


def test_map_takes_both_ways_from_rest_speed_after_speed_and_its_mean(monkeypatch):
    """The film of a speed is the number of speeds before it. 10 N the one way and 14 N towards the pressure."""
    begun = []

    def steady(_model, state, velocity):
        begun.append((state, velocity))
        return state + 1, 2

    def friction(_model, state, velocity):
        return (10.0 if velocity > 0.0 else 14.0) + state, (4.0 if velocity > 0.0 else 5.0) + state

    open_gap = ContactState(np.full(96, 4e-6), np.zeros(96), np.ones(96))
    contact = profile_model(CASE, 0.0, 0.0).contact

    class Counted(int):
        gap = open_gap.gap

    rest = SimpleNamespace(case=CASE, contact=contact), Counted(0), 7.0
    monkeypatch.setattr(module, '_at_rest', lambda case, pressure: rest if (case, pressure) == (CASE, 2e5) else None)
    monkeypatch.setattr(module, 'steady_state', steady)
    monkeypatch.setattr(module, '_friction', friction)
    row = steady_friction(CASE, 2e5)
    after = np.arange(1.0, 6.0)
    assert row.friction == pytest.approx(12.0 + after)
    assert row.solid == pytest.approx(4.5 + after)
    assert row.direction_difference == pytest.approx(np.full(5, 4.0))  # the pressure is on the left
    assert (row.pressure, row.stiffness, row.retried_steps) == (2e5, 7.0, 20)
    assert row.thinnest == pytest.approx(4e-6 / CASE.topography.rms_height)
    assert 0.0 < row.real_contact < 0.1
    speeds = np.geomspace(1e-3, 0.1, 5)
    assert [state for state, _ in begun] == [0, 1, 2, 3, 4] * 2
    assert [velocity for _, velocity in begun] == pytest.approx([*speeds, *-speeds])


@pytest.mark.parametrize('velocity', [0.03, -0.03])
def test_friction_is_that_of_asperities_and_film_whichever_way(velocity):
    """Oil of 0.5 Pa s in an even gap of 2 um."""
    oil = Grease(yield_stress=0.0, consistency_index=0.0, base_viscosity=0.5)
    model = profile_model(dataclasses.replace(CASE, grease=oil), 0.0, 0.0)
    state = ContactState(np.full(96, 2e-6), np.zeros(96), np.ones(96))
    friction, solid = module._friction(model, state, velocity)
    assert solid == solid_limit(model, state)
    assert solid > 0.0
    assert friction - solid == pytest.approx(0.5 * 0.03 / 2e-6 * math.pi * 6e-3 * 0.6e-3)


def test_memory_of_a_friction_that_falls_exponentially_is_the_length_of_its_exponential(monkeypatch):
    """From 5 to 2 N over 0.1 mm; from steady sliding at a fifth of 34 mm/s, without pressure."""
    asked = []

    def steady(_model, state, velocity):
        asked.append((state, velocity))
        return (2.0, 10) if velocity == 34e-3 else (5.0, 1)

    def slid(_model, start, velocity, durations):
        states = (2.0 + (start - 2.0) * np.exp(-np.cumsum(durations) * velocity / 0.1e-3)).tolist()
        return states[-1], states, 100

    rest = SimpleNamespace(film_width=0.6e-3), 0.0, 7.0
    monkeypatch.setattr(module, '_at_rest', lambda _, pressure: rest if pressure == 0.0 else None)
    monkeypatch.setattr(module, 'steady_state', steady)
    monkeypatch.setattr(module, '_slid', slid)
    monkeypatch.setattr(module, '_friction', lambda _model, state, velocity: (state, velocity))
    found = memory_length(CASE)
    assert found.length == pytest.approx(0.1e-3, rel=2e-3)
    assert found.retried_steps == 111
    assert asked == [(0.0, pytest.approx(6.8e-3)), (5.0, 34e-3)]


def test_map_is_of_the_seal_on_a_flooded_wall_with_the_pressure_on_its_left():
    model, start, stiffness = module._at_rest(CASE, 2e5)
    assert (model.pressure_left, model.pressure_right) == (2e5, 0.0)
    assert stiffness == CASE.groove.stiffness
    assert start.saturation.min() == 1.0


def test_map_that_does_not_converge_is_an_error_that_says_where(monkeypatch):
    def fails(*_arguments):
        raise NotConvergedError('told to')

    monkeypatch.setattr(module, 'contact_step', fails)
    with pytest.raises(NotConvergedError, match=r'^case inner at 0.001 m/s, 3e\+05 Pa: told to$'):
        steady_friction(CASE, 3e5)


def test_law_passes_through_its_table_and_holds_beyond_its_ends():
    assert LAW.sliding_friction(0.0, 1e-3) == 3.0
    assert LAW.sliding_friction(1e5, 1e-2) == pytest.approx(4.0)
    assert LAW.sliding_friction(0.0, math.sqrt(1e-5)) == pytest.approx(2.5)
    assert LAW.sliding_friction(0.5e5, 1e-2) == pytest.approx(3.0)
    assert [LAW.sliding_friction(p, v) for p, v in ((0.0, 0.0), (0.0, 5.0), (9e9, 1e-2))] == pytest.approx(
        [3.0, 1.0, 4.0]
    )
    assert LAW.coulomb_friction(0.0) == pytest.approx(2.0)


@given(st.floats(0.0, 2e5), st.floats(0.0, 1.0))
def test_law_stays_within_its_table(pressure, speed):
    assert 1.0 - 1e-12 <= LAW.sliding_friction(pressure, speed) <= 6.0 + 1e-12


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'frictions': (1.0, 2.0)}, '2 values for 3 speeds and 2 pressures'),
        ({'speeds': (1e-3, 1e-1, 1e-2)}, 'does not increase'),
        ({'speeds': (1e-3, 2e-3, 1e-1)}, 'not in equal ratios'),
        ({'pressures': (1e5, 0.0)}, 'does not increase'),
    ],
)
def test_an_invalid_table_is_refused(change, words):
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(LAW, **change)


def document(law: FrictionMap) -> dict:
    fields = {f.name: getattr(law, f.name) for f in dataclasses.fields(law) if f.init}
    return {
        'name': 'mapped',
        'coulomb_law': 'friction_map',
        'friction_map': {k: list(v) if isinstance(v, tuple) else v for k, v in fields.items()},
        'uncertainty': {'relative_std': 0.1},
        'identified_pressure': [0.0, 1e5],
    }


def test_map_in_a_seal_file_is_a_coulomb_law_of_the_estimator():
    (mounted,) = mount_seals((document(LAW),), ('a',))
    assert actuator_friction((mounted,), 1e5, 0.0).coulomb_friction == pytest.approx(4.0)


@pytest.mark.parametrize('velocity', [-0.2, -1e-2, -1e-5, 1e-5, 3e-3, 5.0])
def test_estimator_slides_with_the_friction_of_the_map_at_its_velocity(velocity):
    seals = mount_seals((document(LAW),), ('a',))
    friction = actuator_friction(seals, 0.5e5, 0.0, velocity)
    assert friction.coulomb_friction + friction.velocity_friction == pytest.approx(
        LAW.sliding_friction(0.5e5, abs(velocity))
    )
    assert friction.coulomb_friction_std == pytest.approx(0.1 * LAW.sliding_friction(0.5e5, abs(velocity)))
    assert actuator_friction(seals, -1e4, 0.0, velocity) == actuator_friction(seals, 0.0, 0.0, velocity)._replace(
        in_identified_range=False
    )
    sample = RodSample(1, velocity, Pressure(1, 0.5e5, 0.0), Force(1, 0.0))
    parameters = EstimatorParameters(EstimatorSettings(stick_velocity=0.0, slip_velocity=0.0), seals)
    _, estimate = step(parameters, init(parameters), sample)
    assert estimate.friction_force == pytest.approx(math.copysign(LAW.sliding_friction(0.5e5, abs(velocity)), velocity))


def test_at_rest_the_map_adds_nothing():
    seals = mount_seals((document(LAW),), ('a',))
    assert actuator_friction(seals, 0.5e5, 0.0, 0.0).velocity_friction == 0.0


def test_map_and_velocity_terms_together_are_refused():
    with pytest.raises(ValueError, match=r'Seal mapped: its friction_map has the velocity in it: leave out'):
        mount_seals((document(LAW) | {'velocity_terms': {'viscous_friction': 1.0}},), ('a',))
