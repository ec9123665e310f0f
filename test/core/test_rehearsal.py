"""A rig rehearsed on the desk: the thesis's pull test and the spool paper's cycles, and the friction read from them."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from seal_friction_ros.core.coulomb import MountedSeal, actuator_friction
from seal_friction_ros.core.reference import PullTest, spool_cycles
from seal_friction_ros.core.seal_file import parse_seal
from seal_friction_ros.core.servo import ServoParameters, advance, init, outputs, step
from seal_friction_ros.core.servo_controller import ServoController
from seal_friction_ros.core.servo_plant import Cylinder, ServoValve
from seal_friction_ros.core.units import LBF, PSI

SEAL = parse_seal(yaml.safe_load((Path(__file__).parents[2] / 'config/seals/ms28775_114.yaml').read_text()))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
PLAN = PullTest(repetitions=1, rest_time=0.1, pull_time=1.5, carriage_speed=0.01)
SLOW = ServoController(force_bandwidth=50.0, position_gain=1e3)  # not used: the spool stands open


def rig(pressure):
    """Both ports on one line at the test's pressure."""
    valve = ServoValve(supply_pressure=pressure, return_pressure=pressure, rated_flow=2.5e-4)  # wide: little drag
    cylinder = Cylinder(dead_volume=2e-5)  # with its hoses
    return ServoParameters(
        valve=valve, cylinder=cylinder, seals=SEALS, inner_step=2e-4, control_period=1e-3, controller=SLOW
    )


@pytest.mark.parametrize('test', [0, 5, 10])
def test_pull_test_reads_the_friction_of_the_seals(test):
    start = test * (PLAN.rest_time + 2 * PLAN.pull_time)
    pressure = PLAN.at(start).pressure
    servo = rig(pressure)
    plant, readings = init(servo).plant, []
    for i in range(round((PLAN.rest_time + 2 * PLAN.pull_time) / servo.control_period)):
        command = PLAN.at(start + i * servo.control_period)
        force = PLAN.force(command, plant.position)
        plant = advance(servo, plant, 1.0, force)
        readings.append((command.direction, force, plant.velocity))
    direction, force, velocity = np.array(readings).T
    expected = actuator_friction(SEALS, pressure, pressure)
    static = expected.coulomb_friction + expected.stiction
    assert force[np.flatnonzero(velocity)[0]] == pytest.approx(static, abs=0.11)  # the scale gains 0.1 N a sample
    assert force[direction == -1].min() == pytest.approx(-static, abs=1.0)  # with the drag of the ports
    # On the soft scale the rod sticks and slips, so the mean reading lies between running and breakaway force.
    running = force[direction == 1][-500:].mean()
    assert expected.coulomb_friction - 0.1 < running < static


def test_pull_test_at_1000_psi_is_near_the_thesis_reading():
    servo = rig(1000.0 * PSI)
    friction = outputs(servo, init(servo).plant)
    assert friction.coulomb_friction / LBF == pytest.approx(13.33, rel=0.05)
    assert friction.breakaway_force / LBF == pytest.approx(13.33 + 1.11, rel=0.05)


@pytest.mark.parametrize('distance', [1.8e-3, 2.7e-3])
def test_spool_cycles_run_and_the_9th_gives_the_friction(distance):
    servo = ServoParameters(seals=SEALS)
    wave = spool_cycles(distance)
    state, rows = init(servo), []
    for i in range(round(wave.duration / servo.control_period)):
        state, out = step(servo, state, wave.at(i * servo.control_period))
        rows.append((out.velocity, out.friction_force, out.coulomb_friction))
    velocity, friction, coulomb = np.array(rows[round(0.8 * len(rows)) : round(0.9 * len(rows))]).T
    sliding = np.abs(velocity) > 0.03
    assert sliding.sum() > 50
    np.testing.assert_allclose(friction[sliding], coulomb[sliding] * np.sign(velocity[sliding]))
    assert (velocity == 0.0).mean() > 0.4  # rest at both ends
