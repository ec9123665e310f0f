"""A rig rehearsed on the desk: the thesis's pull test and the spool paper's cycles, and the friction read from them."""

import numpy as np
import pytest
import yaml
from harness.spool_program import spool_cycles
from paths import ROOT

from seal_friction_ros.core.foundation.units import LBF
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.servo.motions import PullTest
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, outputs, step
from seal_friction_ros.core.servo.pull_rig import init_pull_rig, pull_rig, step_pull_rig

SEAL = parse_seal(yaml.safe_load((ROOT / 'config/seals/ms28775_114.yaml').read_text()))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
PLAN = PullTest(repetitions=1, rest_time=0.1, pull_time=1.5, carriage_speed=0.01)
RIG = pull_rig(PLAN, SEALS, 1e-3)


@pytest.mark.parametrize('test', [0, 5, 10])
def test_pull_test_reads_the_friction_of_the_seals(test):
    block = PLAN.rest_time + 2 * PLAN.pull_time
    state, readings = init_pull_rig(RIG), []
    for i in range(round(block * 1000)):
        time = test * block + (i + 0.5) * 1e-3
        command = PLAN.at(time)
        state, out = step_pull_rig(RIG, state, time)
        readings.append((command.direction, PLAN.force(command, out.position), out.velocity, out.force_sum))
    direction, force, velocity, force_sum = np.array(readings).T
    pressure = PLAN.at(test * block).pressure
    expected = actuator_friction(SEALS, pressure, pressure)
    static = expected.coulomb_friction + expected.stiction
    assert force[np.flatnonzero(velocity)[0]] == pytest.approx(static, abs=0.11)  # the scale gains 0.1 N a sample
    assert force[direction == -1].min() == pytest.approx(-static, abs=1.0)  # with the drag of the ports
    # On the soft scale the rod sticks and slips, so the mean reading lies between running and breakaway force.
    running = force[direction == 1][-500:].mean()
    assert expected.coulomb_friction - 0.1 < running < static
    # The force sum knows of the drag of the ports too: at rest it is what the scale pulls.
    assert force_sum[np.flatnonzero(velocity)[0] - 1] == pytest.approx(static, abs=0.3)


def test_pull_test_at_1000_psi_is_near_the_thesis_reading():
    servo = RIG.servos[-1]
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


SHORT = PullTest(pressure_max=4e6, intervals=2, repetitions=2, rest_time=0.01, pull_time=0.02, carriage_speed=0.01)


def test_every_pressure_of_the_plan_has_its_rig_with_both_lines_at_it():
    for period, inner in ((1e-3, 2e-4), (1e-4, 1e-4), (7e-4, 7e-4 / 4)):  # near 0.2 ms, a part of the sample time
        rig = pull_rig(SHORT, SEALS, period)
        assert [servo.valve.supply_pressure for servo in rig.servos] == [0.0, 2e6, 4e6]
        for servo in rig.servos:
            assert servo.valve.return_pressure == servo.valve.supply_pressure
            assert servo.inner_step == pytest.approx(inner)
            assert servo.control_period == period


def test_a_new_test_begins_at_rest_with_its_pressure_where_the_rod_was_left():
    rig = pull_rig(SHORT, SEALS, 1e-3)
    state = init_pull_rig(rig)
    assert (state.test, state.plant.charge_a, state.plant.charge_b) == (0, 0.0, 0.0)
    moved = state._replace(plant=state.plant._replace(position=0.0005, velocity=0.01, direction=1))
    same, _ = step_pull_rig(rig, moved, 0.005)
    assert same.test == 0
    assert same.plant.velocity != 0.0
    for test, pressure in ((1, 2e6), (2, 4e6), (3, 0.0), (4, 2e6), (5, 4e6)):  # the plan, twice
        new, out = step_pull_rig(rig, moved, 0.05 * test + 0.001)
        assert new.test == test
        assert (out.pressure_a, out.pressure_b) == pytest.approx((pressure, pressure), abs=1.0)
        assert new.plant.position == 0.0005
        assert out.velocity == 0.0
        assert out.force_sum == pytest.approx(-5.0)  # the scale of 10 N/mm, relaxed at 0
