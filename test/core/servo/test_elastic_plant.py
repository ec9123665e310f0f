"""Servo with elastic seals: energy balance, limits, a rod that is held by its springs."""

from dataclasses import replace

import numpy as np
import pytest
from paths import ROOT

from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.servo.elastic_plant import ElasticSeals, elastic_seals, energy_of_seals, seals_of_plant
from seal_friction_ros.core.servo.motions import Setpoint, Sine
from seal_friction_ros.core.servo.plant import stored_energy
from seal_friction_ros.core.servo.position_servo import ServoParameters, advance, init, simulate
from seal_friction_ros.files import read_yaml

DOCUMENT = read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml')
SEAL = parse_seal(DOCUMENT)
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
WAVE = Sine(amplitude=1e-3, frequency=5.0)
SOFT = Presliding(stiffness=1e5)
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


def test_refusals_name_the_remedy():
    with pytest.raises(ValueError, match='for the mass on its elastic seals'):
        ServoParameters(seals=SEALS, elastic=ElasticSeals(SOFT, bristle_damping=1e6))
    servo = ServoParameters(seals=SEALS, elastic=ElasticSeals(SOFT))
    with pytest.raises(ValueError, match='use step'):
        advance(servo, init(servo).plant, 0.0)
