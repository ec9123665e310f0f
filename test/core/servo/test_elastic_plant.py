"""Servo with elastic seals: energy balance, limits, a rod that is held by its springs."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from paths import ROOT

from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.presliding import Presliding, Slide
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.cylinder import Cylinder
from seal_friction_ros.core.servo.elastic_plant import (
    NO_SHEAR,
    ElasticSeals,
    elastic_seals,
    energy_of_seals,
    seals_of_plant,
    sheared,
)
from seal_friction_ros.core.servo.hydraulics import ServoValve
from seal_friction_ros.core.servo.motions import Setpoint, Sine
from seal_friction_ros.core.servo.plant import Load, stored_energy
from seal_friction_ros.core.servo.position_servo import ServoParameters, _advance, advance, init, simulate, step
from seal_friction_ros.files import read_yaml

DOCUMENT = read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml')
SEAL = parse_seal(DOCUMENT)
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
WAVE = Sine(amplitude=1e-3, frequency=5.0)
SOFT = Presliding(stiffness=1e5)
GENTLE = ServoController(position_gain=1e3, velocity_gain=0.0, force_bandwidth=50.0)
PLANTS = {
    'elements': ElasticSeals(SOFT),
    'two seals unlike each other': ElasticSeals(Presliding(stiffness=1.5e5, yield_exponent=3.0), SOFT, 0.6),
    'LuGre': ElasticSeals(SOFT, bristle_damping=100.0),
}


def run(elastic, samples=800, wave=WAVE):
    servo = ServoParameters(seals=SEALS, elastic=elastic)
    first = init(servo)
    last, rows = simulate(servo, first, [wave.at(i * servo.control_period) for i in range(samples)])
    return servo, first, last, rows


@pytest.mark.parametrize('elastic', PLANTS.values(), ids=PLANTS)
def test_energy_in_is_energy_stored_and_dissipated(elastic):
    servo, first, last, _ = run(elastic)
    stored = stored_energy(servo.constants, last.plant) - stored_energy(servo.constants, first.plant)
    stored += energy_of_seals(elastic.numbers, last.seals)
    assert last.plant.energy_in > 1.0
    assert last.plant.energy_in - last.plant.energy_dissipated == pytest.approx(stored, abs=1e-6)


def test_the_stiffer_the_seals_the_closer_to_rigid_ones():
    rigid = run(None)[3].position
    misses = [np.abs(run(ElasticSeals(replace(SOFT, stiffness=k)))[3].position - rigid).max() for k in (1e5, 1e6, 1e7)]
    assert misses[0] > 2.0 * misses[1] > 4.0 * misses[2]


def test_a_rod_at_rest_holds_a_load_below_breakaway_on_its_springs():
    servo = ServoParameters(seals=SEALS, elastic=ElasticSeals(SOFT))
    state, rows = simulate(servo, init(servo), [Setpoint(0.0)] * 2000, 0.0, 5.0)
    assert abs(rows.friction_force[-1] - rows.force_sum[-1]) < 1e-3  # balance
    assert abs(state.plant.velocity) < 1e-6


def test_the_seal_files_tell_the_elasticity():
    document = DOCUMENT | {'presliding': {'stiffness': 5e4, 'yield_exponent': 2.0}}
    seals = tuple(MountedSeal(parse_seal(document), chamber) for chamber in 'ab')
    assert elastic_seals(seals) == ElasticSeals(
        Presliding(stiffness=5e4, yield_exponent=2.0), Presliding(stiffness=5e4, yield_exponent=2.0), 0.5
    )
    assert elastic_seals(SEALS) is None
    with pytest.raises(ValueError, match='1 of 2 seal files have presliding'):
        elastic_seals((seals[0], SEALS[1]))
    with pytest.raises(ValueError, match=r'seal ms28775_114: presliding: .*stiffness = -1.0'):
        parse_seal(DOCUMENT | {'presliding': {'stiffness': -1.0}})


def test_the_plants_of_the_simulator_are_as_stiff_as_the_seal_files():
    seals = tuple(MountedSeal(replace(SEAL, presliding=replace(SOFT, stiffness=k)), 'a') for k in (1e5, 2e5))
    assert seals_of_plant('rigid', SEALS, 5.0) is None
    assert seals_of_plant('elements', seals, 5.0) == elastic_seals(seals)
    lugre = seals_of_plant('lugre', seals, 5.0)
    assert lugre.stiffness == 3e5
    assert lugre.bristle_damping == pytest.approx(np.sqrt(3e5 * 5.0))
    with pytest.raises(ValueError, match='no seal file has presliding: identify it'):
        seals_of_plant('elements', SEALS, 5.0)


def test_one_seal_has_all_of_the_friction_and_three_are_too_many():
    one = MountedSeal(replace(SEAL, presliding=SOFT), 'a')
    assert elastic_seals((one,)) == ElasticSeals(SOFT, None, 1.0)
    assert ElasticSeals(SOFT, None, 0.3).numbers.first_share == 1.0  # no second group to have the rest
    assert ElasticSeals(SOFT, replace(SOFT, stiffness=3e5), 0.3).stiffness == 4e5
    with pytest.raises(ValueError, match='3 of 3 seal files have presliding: the simulated servo takes one or two'):
        elastic_seals((one, one, one))


def test_lugre_may_have_no_damping_and_elements_have_no_bristles():
    assert ElasticSeals(SOFT, bristle_damping=0.0).numbers.is_lugre
    assert not ElasticSeals(SOFT).numbers.is_lugre
    assert ElasticSeals(SOFT).numbers.lugre.bristle_damping == 0.0


def test_two_groups_share_friction_excess_and_stiction():
    numbers = ElasticSeals(SOFT, replace(SOFT, stiffness=3e5, yield_exponent=0.0), 0.3).numbers
    for slide, friction in (
        (Slide(1.0, 0.1, 20.0, 4.0, 6.0), 24.0),  # both slide
        (Slide(0.0, 0.1, 20.0, 4.0, 6.0), 0.0),
        (Slide(1e-9, 0.1, 20.0, 4.0, 6.0), 4e5 * 1e-9),  # both stick: their springs add up
    ):
        assert sheared(numbers, NO_SHEAR, slide, 0.1).friction == pytest.approx(friction)
    slid = sheared(numbers, NO_SHEAR, Slide(1.0, 0.1, 20.0, 4.0, 6.0), 0.1)
    held = sheared(numbers, slid, Slide(0.0, 0.1, 20.0, 4.0, 6.0), 0.0)
    assert (slid.first.excess, slid.second.excess) == pytest.approx((0.3 * 4.0, 0.7 * 4.0))
    assert (held.first.excess, held.second.excess) == pytest.approx((0.3 * 6.0, 0.7 * 6.0))
    assert held.deflection == 0.0  # elements have no bristles
    lugre = ElasticSeals(SOFT, bristle_damping=0.0).numbers
    bent = sheared(lugre, NO_SHEAR, Slide(1.0, 0.1, 20.0, 4.0, 6.0), 0.1)
    assert (bent.friction, bent.deflection) == pytest.approx((24.0, 24.0 / 1e5))
    assert energy_of_seals(lugre, bent) == pytest.approx(0.5 * 24.0**2 / 1e5)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_rod_on_elastic_seals_ends_at_the_stop_with_the_loss_of_its_energy(side):
    servo = ServoParameters(seals=SEALS, elastic=ElasticSeals(SOFT))
    limit = servo.cylinder.limit
    start = init(servo, side * (limit - 1e-5))
    state, seen = start, []
    for _ in range(60):
        state, _ = step(servo, state, Setpoint(0.0), side * 2000.0, side * 500.0)
        assert abs(state.plant.position) <= limit * (1.0 + 1e-6)
        assert abs(state.plant.spool) <= 1.0
        seen.append(side * state.plant.position >= limit)
    assert any(seen)
    stored = stored_energy(servo.constants, state.plant) - stored_energy(servo.constants, start.plant)
    stored += energy_of_seals(servo.elastic.numbers, state.seals)
    turnover = abs(state.plant.energy_in)
    assert turnover > 0.1
    assert abs(state.plant.energy_in - state.plant.energy_dissipated - stored) < 2e-2 * turnover


def test_refusals_name_the_remedy():
    with pytest.raises(ValueError, match='for the mass on its elastic seals'):
        ServoParameters(seals=SEALS, elastic=ElasticSeals(SOFT, bristle_damping=1e6))
    servo = ServoParameters(seals=SEALS, elastic=ElasticSeals(SOFT))
    with pytest.raises(ValueError, match='use step'):
        advance(servo, init(servo).plant, 0.0)


def test_the_longest_inner_step_of_elastic_seals_is_that_of_the_mass_on_them():
    """0.625 kg on 1e9 N/m swing at 4e4 rad/s, with a bristle damping of 12500 N s/m the rate is 6e4 1/s."""
    stiff = ElasticSeals(replace(SOFT, stiffness=1e9))
    for elastic, rate in ((stiff, 4e4), (replace(stiff, bristle_damping=12500.0), 6e4)):
        for share, taken in ((0.99, True), (1.01, False)):
            time = share * 2.5 / rate
            parts = {'elastic': elastic, 'inner_step': time, 'control_period': 8.0 * time}
            with nullcontext() if taken else pytest.raises(ValueError, match='for the mass on its elastic seals'):
                ServoParameters(seals=SEALS, load=Load(mass=0.625), controller=GENTLE, **parts)


def test_a_mass_on_elastic_seals_swings_as_on_a_spring():
    """Far below yielding: omega^2 = K / m, with chambers as one; 4e5 N/m under 10 kg swing at 200 rad/s."""
    spring = Presliding(stiffness=4e5, yield_exponent=0.0)
    servo = ServoParameters(
        valve=ServoValve(null_leakage=0.0, rated_flow=1e-8),
        cylinder=Cylinder(internal_leakage=1e-8, stroke=0.2, dead_volume=1e-2),
        load=Load(mass=10.0, viscous_damping=0.0),
        seals=SEALS,
        elastic=ElasticSeals(spring),
    )
    state, positions = init(servo), []
    state = state._replace(plant=state.plant._replace(velocity=1e-4))  # amplitude 0.5 um, 0.2 N
    for _ in range(400):
        plant, seals = state.plant, state.seals
        plant, seals = _advance(servo.kept, plant, seals, 0.0, 0.0)
        state = state._replace(plant=plant, seals=seals)
        positions.append(plant.position)
    time = 5e-4 * np.arange(1, 401)
    np.testing.assert_allclose(positions, 5e-7 * np.sin(200.0 * time), atol=2e-8)


def test_a_rod_on_elastic_seals_counts_its_starts_and_its_stops():
    servo = ServoParameters(seals=SEALS, elastic=ElasticSeals(SOFT))
    still = init(servo)
    for _ in range(3):
        still, _ = step(servo, still, Setpoint(0.0))
    assert (still.plant.direction, still.plant.transitions, still.plant.velocity) == (0, 0, 0.0)
    for side in (1, -1):
        limit = side * servo.cylinder.limit
        state = init(servo, limit - side * 1e-3)
        seen = []
        for _ in range(30):
            state, _ = step(servo, state, Setpoint(limit), side * 2000.0, side * 500.0)
            seen.append((state.plant.direction, state.plant.transitions))
            assert state.plant.direction == np.sign(state.plant.velocity)
        assert seen[0] == (side, 1)
        assert (0, 2) in seen
        assert state.plant.position == limit


def test_a_spool_that_overshoots_ends_at_full_opening_with_elastic_seals_too():
    valve = ServoValve(damping_ratio=0.2)
    servo = ServoParameters(
        valve=valve, controller=GENTLE, seals=SEALS, elastic=ElasticSeals(SOFT), control_period=1e-4
    )
    for side in (1.0, -1.0):
        plant, seals, spool = init(servo).plant, NO_SHEAR, []
        for _ in range(60):
            plant, seals = _advance(servo.kept, plant, seals, side, 0.0)
            spool.append(side * plant.spool)
            assert plant.spool_rate == 0.0 or spool[-1] < 1.0
        assert max(spool) == 1.0
        assert spool[-1] > 0.9


def test_halving_the_step_of_elastic_seals_reduces_the_error_to_a_sixteenth():
    """Runge-Kutta of fourth order where the law is smooth: below yielding, with a spool that moves."""
    spring = Presliding(stiffness=2e6, yield_exponent=0.0)
    servo = ServoParameters(seals=SEALS, elastic=ElasticSeals(spring), load=Load(spring_stiffness=2e4))
    ends = []
    for steps in (20, 40, 80, 640):
        fine = replace(servo, control_period=4e-3 / steps, inner_step=4e-3 / steps)
        plant, seals = init(servo).plant, NO_SHEAR
        for _ in range(steps):
            plant, seals = _advance(fine.kept, plant, seals, 1e-3, 5.0)
        ends.append(np.array(plant[:8]) / [1e-6, 1e-3, 1e6, 1e6, 1e-3, 1.0, 1e-3, 1e-3])
    errors = [np.abs(end - ends[-1]).max() for end in ends[:3]]
    assert errors[0] > 1e-9
    assert errors[1] < errors[0] / 12.0
    assert errors[2] < errors[1] / 12.0


@pytest.mark.parametrize(
    ('name', 'lowest', 'highest', 'beyond'),
    [('first_share', 0.0, 1.0, (-0.01, 1.01)), ('bristle_damping', -1.0, 1e6, (-1.01, 1.01e6))],
)
def test_a_share_is_between_none_and_all_and_a_damping_is_not_infinite(name, lowest, highest, beyond):
    for value in (lowest, highest):
        assert getattr(ElasticSeals(SOFT, **{name: value}), name) == value
    for value in beyond:
        with pytest.raises(ValueError, match=f'ElasticSeals.{name} = {value}'):
            ElasticSeals(SOFT, **{name: value})
