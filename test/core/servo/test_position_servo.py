"""The servo as a whole: rest, Figure 25, feed-forward, and invalid references."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
import yaml
from harness.compensation import COMPENSATING
from paths import ROOT

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.pipeline import PipelineParameters
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import Force, Pressure
from seal_friction_ros.core.servo.closed_loop import Axis, run_closed_loop, with_wrong_friction
from seal_friction_ros.core.servo.controller import ControllerState, Limited, ServoController, control, limit_reference
from seal_friction_ros.core.servo.cylinder import Cylinder
from seal_friction_ros.core.servo.elastic_plant import ElasticSeals
from seal_friction_ros.core.servo.hydraulics import ServoValve
from seal_friction_ros.core.servo.motions import Setpoint, Sine, Step
from seal_friction_ros.core.servo.plant import Load, stored_energy
from seal_friction_ros.core.servo.position_servo import (
    ServoParameters,
    advance,
    init,
    measure,
    outputs,
    simulate,
    step,
)
from seal_friction_ros.core.servo.tracking import dwell_per_reversal, reversals, tracking_peak, tracking_rms

SEAL = parse_seal(yaml.safe_load((ROOT / 'config/seals/ms28775_114.yaml').read_text()))
SEALS = (MountedSeal(SEAL, 'a'), MountedSeal(SEAL, 'b'))
SERVO = ServoParameters(seals=SEALS)
FREE = ServoParameters(seals=())
ESTIMATOR = estimator.EstimatorParameters(estimator.EstimatorSettings(), SEALS)
WAVE = Sine()
SKIP = 800  # samples until the start is forgotten


def references(wave, n=3200):
    """For the step from sample i; the output of that step is at sample i + 1."""
    return [wave.at(i * SERVO.control_period) for i in range(n)]


def closed_loop(wave, error=1.0):
    """Servo, estimator and feed-forward in one loop, with the estimate wrong by a factor."""
    parameters = PipelineParameters(ESTIMATOR, COMPENSATING)
    return run_closed_loop(Axis(SERVO, with_wrong_friction(parameters, error - 1.0)), wave, 3200, 0.0)


@cache
def run(wave, error):
    if error is None:
        return simulate(SERVO, init(SERVO), references(wave))[1]
    return closed_loop(wave, error)


def wanted(wave, n=3200):
    return np.array([r.position for r in references(wave, n + 1)[1:]])


def rms(wave, error):
    return tracking_rms(wanted(wave)[SKIP:], run(wave, error).position[SKIP:])


def dwell(wave, error):
    return dwell_per_reversal(run(wave, error).velocity[SKIP:], SERVO.control_period)


def test_simulate_is_many_steps():
    state, rows = init(SERVO), []
    for reference in references(WAVE, 100):
        state, out = step(SERVO, state, reference, 3.0, 1.0)
        rows.append((out.position, out.velocity, out.pressure_a, out.pressure_b, out.spool, out.force_sum))
    last, trajectory = simulate(SERVO, init(SERVO), references(WAVE, 100), 3.0, 1.0)
    assert last == state
    np.testing.assert_array_equal(np.array(trajectory[:6]).T, rows)


def test_no_chatter_at_rest_with_noise_on_every_sensor():
    rng = np.random.default_rng(1)
    c, g = SERVO.constants, SERVO.gains
    plant, controller, seen = init(SERVO).plant, ControllerState(0.0, 0.0), estimator.init(ESTIMATOR)
    states = set()
    noise = rng.normal(size=(20000, 5)) * [1e-6, 2e-4, 2e3, 2e3, 1.0]
    for i, (x, v, a, b, f) in enumerate(noise.tolist()):
        exact, out = measure(c.cylinder, plant), outputs(SERVO, plant)
        noisy = exact._replace(
            position=exact.position + x,
            velocity=exact.velocity + v,
            pressure_a=exact.pressure_a + a,
            pressure_b=exact.pressure_b + b,
        )
        controller, command = control(g, c, controller, noisy, Setpoint(1e-4, 0.0, 0.0), 0.0)
        plant = advance(SERVO, plant, command.spool)
        stamp = i * 500_000
        pressure = Pressure(stamp, noisy.pressure_a, noisy.pressure_b)
        sample = RodSample(stamp, noisy.velocity, pressure, Force(stamp, out.force_sum + f))
        seen, estimate = estimator.step(ESTIMATOR, seen, sample)
        states.add((estimate.state, estimate.status) if i > 10 else None)  # the first samples are marked uncertain
    assert plant.transitions == 0
    assert plant.position == 0.0
    assert states == {None, (FrictionState.STUCK, 0)}
    assert 5.0 < abs(outputs(SERVO, plant).force_sum) < 20.0  # 0.1 mm error: the rod is held against a force


def test_figure_25_flat_peaks_with_friction_and_none_without():
    with_friction = run(WAVE, None)
    _, without = simulate(FREE, init(FREE), references(WAVE))
    period = 1.0 / WAVE.frequency
    assert dwell_per_reversal(with_friction.velocity[SKIP:], SERVO.control_period) > 0.05 * period
    assert dwell_per_reversal(without.velocity[SKIP:], SERVO.control_period) == 0.0
    assert reversals(without.velocity[SKIP:]) == reversals(with_friction.velocity[SKIP:]) == 12
    slow = 0.01 * WAVE.amplitude * 2.0 * math.pi * WAVE.frequency  # the same with a speed that both cross
    assert dwell_per_reversal(with_friction.velocity[SKIP:], SERVO.control_period, slow) > 0.05 * period
    assert dwell_per_reversal(without.velocity[SKIP:], SERVO.control_period, slow) < 0.01 * period
    assert tracking_rms(wanted(WAVE)[SKIP:], without.position[SKIP:]) < 0.02 * WAVE.amplitude


def test_feedforward_cuts_tracking_error_by_60_and_dwell_by_80_percent():
    assert rms(WAVE, 1.0) <= 0.4 * rms(WAVE, None)
    assert dwell(WAVE, 1.0) <= 0.2 * dwell(WAVE, None)


@pytest.mark.parametrize('error', [0.7, 1.3])
def test_feedforward_of_a_model_30_percent_wrong_is_better_than_none(error):
    assert rms(WAVE, error) < 0.7 * rms(WAVE, None)
    assert dwell(WAVE, error) < dwell(WAVE, None)
    assert reversals(run(WAVE, error).velocity[SKIP:]) == reversals(run(WAVE, None).velocity[SKIP:])


@pytest.mark.parametrize('error', [0.7, 1.0, 1.3])
def test_feedforward_does_not_limit_cycle(error):
    held = closed_loop(Step(size=0.003, start_time=0.1), error)
    assert np.all(held.velocity[1000:] == 0.0)
    assert abs(held.position[-1] - 0.003) < 1e-3


def test_position_error_at_rest_is_within_breakaway_over_gain():
    _, moved = simulate(SERVO, init(SERVO), references(Step(size=0.003)))
    assert tracking_peak(np.full(100, 0.003), moved.position[-100:]) < 48.0 / SERVO.controller.position_gain


def test_integrator_takes_most_of_that_error():
    integrating = dataclasses.replace(SERVO, controller=ServoController(integral_gain=1e6))
    _, moved = simulate(integrating, init(integrating), references(Step(size=0.003), 4000))
    _, plain = simulate(SERVO, init(SERVO), references(Step(size=0.003)))
    assert abs(moved.position[-1] - 0.003) < 0.1 * abs(plain.position[-1] - 0.003)


@pytest.mark.parametrize(
    ('wish', 'flag', 'followed'),
    [
        (Setpoint(math.nan, 0.0, 0.0), Limited.REFERENCE_NOT_FINITE, Setpoint(1e-3, 0.0, 0.0)),
        (Setpoint(1e-3, math.inf, 0.0), Limited.REFERENCE_NOT_FINITE, Setpoint(1e-3, 0.0, 0.0)),
        (Setpoint(1e-3, 0.01, 0.5), 0, Setpoint(1e-3, 0.01, 0.5)),
        (Setpoint(2e-3, 0.0, 0.0), Limited.REFERENCE_TOO_FAST, Setpoint(1.1e-3, 0.2, 0.0)),
        (Setpoint(1e-3, 0.9, 0.0), Limited.REFERENCE_TOO_FAST, Setpoint(1e-3, 0.2, 0.0)),
        (
            Setpoint(-9.0, 0.0, 0.0),
            Limited.REFERENCE_OUT_OF_STROKE | Limited.REFERENCE_TOO_FAST,
            Setpoint(0.9e-3, -0.2, 0.0),
        ),
    ],
)
def test_bad_reference_is_limited_and_says_so(wish, flag, followed):
    reference, limited = limit_reference(SERVO.gains, 1e-3, wish)
    assert reference == pytest.approx(followed)
    assert limited == flag


def test_rod_goes_no_further_than_short_of_the_stop():
    _, moved = simulate(SERVO, init(SERVO), [Setpoint(1.0, 0.0, 0.0)] * 1000)
    assert 0.0235 < moved.position[-1] < 0.0245
    assert moved.limited[-1] == Limited.REFERENCE_OUT_OF_STROKE


def test_feedforward_that_is_not_finite_counts_as_zero():
    state, out = step(SERVO, init(SERVO), Setpoint(0.0, 0.0, 0.0), math.nan)
    assert out.command.limited == Limited.FEEDFORWARD_NOT_FINITE
    assert state == step(SERVO, init(SERVO), Setpoint(0.0, 0.0, 0.0))[0]


def test_command_beyond_what_supply_and_spool_can_do_is_cut_and_says_so():
    _, out = step(SERVO, init(SERVO), Setpoint(0.0, 0.0, 0.0), 1e9)
    assert out.command.limited == Limited.FORCE
    assert out.command.force == pytest.approx(SERVO.cylinder.area_a * (SERVO.valve.supply_pressure - 1e5))
    fast = measure(SERVO.cylinder, init(SERVO).plant)._replace(velocity=5.0)
    _, command = control(SERVO.gains, SERVO.constants, ControllerState(0.0, 0.0), fast, Setpoint(0.0, 0.0, 0.0), 0.0)
    assert command.limited == Limited.FORCE | Limited.SPOOL
    assert command.spool == 1.0


def test_a_breakaway_that_follows_the_load_holds_the_simulated_rod_as_it_does_the_estimate():
    seal = dataclasses.replace(SEAL, stiction=0.5, stiction_ratio=0.3)
    servo = ServoParameters(seals=(MountedSeal(seal, 'a'), MountedSeal(seal, 'b')))
    out = outputs(servo, init(servo).plant)
    expected = actuator_friction(servo.seals, out.pressure_a, out.pressure_b)
    assert expected.stiction > 2.0 * seal.stiction + 10.0
    assert out.breakaway_force == pytest.approx(expected.coulomb_friction + expected.stiction, rel=1e-5)
    plant = init(servo).plant
    for share, moves in ((0.99, False), (1.01, True)):
        for _ in range(200):
            plant = advance(servo, plant, 0.0, share * out.breakaway_force)
        assert (plant.position != 0.0) == moves


MAP = FrictionMap(
    speeds=(1e-3, 1e-2, 1e-1), pressures=(0.0, 7e6), frictions=(9.0, 7.0, 8.0, 32.0, 28.0, 30.0), reference_speed=0.02
)
BY_VELOCITY = {
    'velocity terms': dataclasses.replace(SEAL, velocity_terms=VelocityTerms(150.0, 4.0, 0.01, 0.1)),
    'friction map': dataclasses.replace(SEAL, coulomb_law=MAP),
}


@pytest.mark.parametrize('name', ['velocity terms', pytest.param('friction map', marks=pytest.mark.long)])
def test_friction_that_depends_on_the_velocity_is_that_of_the_estimator_and_balances_the_energy(name):
    servo = ServoParameters(
        seals=(MountedSeal(BY_VELOCITY[name], 'a'), MountedSeal(SEAL, 'difference')), inner_step=2.5e-5
    )
    state = start = init(servo)
    wave, seen = Sine(0.002, 4.0), set()
    for i in range(500):
        state, out = step(servo, state, wave.at(i * servo.control_period))
        friction = actuator_friction(servo.seals, out.pressure_a, out.pressure_b, out.velocity)
        sliding = friction.coulomb_friction + friction.velocity_friction
        assert out.coulomb_friction == friction.coulomb_friction
        assert out.velocity == 0.0 or out.friction_force == pytest.approx(math.copysign(sliding, out.velocity))
        seen.add(out.direction if out.velocity else 0)
    assert seen == {-1, 0, 1}
    c, end = servo.constants, state.plant
    stored = stored_energy(c, end) - stored_energy(c, start.plant)
    assert end.energy_in > 0.1
    assert abs(end.energy_in - stored - end.energy_dissipated) < 1e-6 * end.energy_in


@pytest.mark.parametrize('name', ['velocity terms', pytest.param('friction map', marks=pytest.mark.long)])
def test_simulate_and_step_have_the_same_friction_over_velocity(name):
    servo = ServoParameters(seals=(MountedSeal(BY_VELOCITY[name], 'a'), MountedSeal(SEAL, 'b')), inner_step=2.5e-5)
    setpoints = [Sine(0.002, 4.0).at(i * servo.control_period) for i in range(600)]
    _, trajectory = simulate(servo, init(servo), setpoints)
    state, rows = init(servo), []
    for setpoint in setpoints:
        state, out = step(servo, state, setpoint)
        rows.append(out[:9])
    np.testing.assert_array_equal(np.array(rows).T, trajectory[:9])
    sliding = trajectory.velocity != 0.0
    assert np.abs(np.abs(trajectory.friction_force) - trajectory.coulomb_friction)[sliding].max() > 1.0  # [N]


def test_a_viscous_seal_brakes_a_coasting_rod_as_the_closed_form_has_it():
    """One seal, of the law of the servo without seals: it needs no other compiled code."""
    terms = VelocityTerms(100.0)
    seal = dataclasses.replace(SEAL, coulomb_law=ConstantCoulomb(0.0), stiction=0.0, velocity_terms=terms)
    servo = ServoParameters(
        valve=ServoValve(null_leakage=0.0, rated_flow=1e-8),
        cylinder=Cylinder(internal_leakage=1e-8, stroke=0.2, dead_volume=1e-2),  # both chambers at one pressure
        load=Load(mass=5.0, viscous_damping=0.0),
        seals=(MountedSeal(seal, 'a'),),
    )
    plant = init(servo).plant._replace(velocity=0.1, direction=1)
    for _ in range(60):
        plant = advance(servo, plant, 0.0)
    elapsed = 60 * servo.control_period
    assert plant.velocity == pytest.approx(0.1 * math.exp(-100.0 / 5.0 * elapsed), rel=0.02)


def test_friction_that_rises_too_steeply_for_the_inner_step_is_rejected_with_the_step_that_suits():
    seal = dataclasses.replace(SEAL, velocity_terms=VelocityTerms(viscous_friction=1e6))
    with pytest.raises(ValueError, match=r'inner_step = 0.0001 s is too long: at most .*damping'):
        ServoParameters(seals=(MountedSeal(seal, 'a'),))


CONSTANT = dataclasses.replace(SEAL, coulomb_law=ConstantCoulomb(10.0), stiction=0.0, stiction_ratio=0.0)
ASYMMETRIC = dataclasses.replace(CONSTANT, stiction=0.5, velocity_terms=VelocityTerms(asymmetry=0.3))
CALM = {
    'valve': ServoValve(null_leakage=0.0, rated_flow=1e-8),
    'cylinder': Cylinder(internal_leakage=1e-8, stroke=0.2, dead_volume=1e-2),  # both chambers at one pressure
    'seals': (MountedSeal(ASYMMETRIC, 'a'),),
}


@pytest.mark.parametrize(('side', 'held', 'moved'), [(1.0, 12.9, 13.1), (-1.0, 10.4, 10.6)])
def test_a_rod_is_held_by_the_larger_of_breakaway_and_slowest_friction_of_the_direction(side, held, moved):
    """Friction of 13 N on extension and 7 N on retraction, breakaway of 10.5 N both ways."""
    servo = ServoParameters(**CALM)
    for force, moves in ((held, False), (moved, True)):
        state = init(servo).plant
        for _ in range(20):
            state = advance(servo, state, 0.0, side * force)
        assert (side * state.position > 0.0) is moves
        assert state.transitions == int(moves)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_rod_without_stiction_is_held_by_exactly_its_friction(side):
    servo = ServoParameters(**(CALM | {'seals': (MountedSeal(CONSTANT, 'a'),)}))
    for force, moves in ((10.0, False), (10.001, True)):
        state = init(servo).plant
        for _ in range(20):
            state = advance(servo, state, 0.0, side * force)
        assert (side * state.position > 0.0) is moves
        assert (state.transitions, state.direction) == (int(moves), side * moves)


@pytest.mark.parametrize('elastic', [None, ElasticSeals(Presliding(stiffness=1e5))])
@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_sliding_rod_has_the_friction_of_its_direction(side, elastic):
    """30 % more than Coulomb friction on extension, 30 % less on retraction."""
    seals = tuple(MountedSeal(dataclasses.replace(SEAL, velocity_terms=VelocityTerms(asymmetry=0.3)), s) for s in 'ab')
    servo = ServoParameters(**(CALM | {'seals': seals}), elastic=elastic, load=Load(mass=5.0, viscous_damping=20.0))
    _, track = simulate(servo, init(servo), [Setpoint(0.0)] * 60, 0.0, side * 300.0)
    friction, coulomb = track.friction_force[-1], track.coulomb_friction[-1]
    assert coulomb > 10.0
    assert friction == pytest.approx(side * (1.0 + 0.3 * side) * coulomb, rel=1e-6)
    assert track.breakaway_force[-1] == pytest.approx((1.0 + SEAL.stiction_ratio) * coulomb + 2.0 * SEAL.stiction)
    # m a = F - b v - friction; the oil takes no more than a hundredth
    acceleration = (track.velocity[-1] - track.velocity[-2]) / servo.control_period
    assert 5.0 * acceleration == pytest.approx(side * 300.0 - friction - 20.0 * track.velocity[-1], rel=0.01)


def test_a_step_without_feed_forward_and_load_has_none_and_ideal_sensors_measure_the_truth():
    state = init(SERVO)
    for i in range(20):
        setpoint = WAVE.at(i * SERVO.control_period)
        ideal = measure(SERVO.cylinder, state.plant)
        assert step(SERVO, state, setpoint, 5.0, measured=ideal) == step(SERVO, state, setpoint, 5.0, 0.0)
        assert step(SERVO, state, setpoint, measured=ideal) == step(SERVO, state, setpoint)
        assert step(SERVO, state, setpoint)[1].command.force == pytest.approx(
            step(SERVO, state, setpoint, 5.0)[1].command.force - 5.0
        )
        state, out = step(SERVO, state, setpoint)
    assert advance(SERVO, state.plant, 0.1) == advance(SERVO, state.plant, 0.1, 0.0)
    assert outputs(SERVO, state.plant).force_sum == pytest.approx(out.force_sum)
    last, track = simulate(SERVO, state, [WAVE.at(0.01)])
    assert last == step(SERVO, state, WAVE.at(0.01), 0.0, 0.0)[0]
    assert simulate(SERVO, state, [])[0] == state
    assert len(track.position) == 1
