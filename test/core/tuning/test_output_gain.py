"""Gain from force to command: of simulated servos, whose gain is known, and of data that cannot tell it."""

import dataclasses

import numpy as np
import pytest

from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.cylinder import Cylinder, pressure_force
from seal_friction_ros.core.servo.motions import Setpoint, Sine
from seal_friction_ros.core.servo.plant import Load
from seal_friction_ros.core.servo.pneumatics import PneumaticValve
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, simulate
from seal_friction_ros.core.tuning.output_gain import CommandRecord, output_gain
from seal_friction_ros.files import default_configuration

SEALS = default_configuration().parameters().estimator.seals
PERIOD = 1e-3  # [s]
HYDRAULIC = ServoParameters(seals=SEALS, control_period=PERIOD)
PNEUMATIC = ServoParameters(
    valve=PneumaticValve(),
    cylinder=Cylinder(type='single_rod', bore_diameter=0.032, rod_diameter=0.012, stroke=0.2, dead_volume=2e-5),
    load=Load(mass=3.0, viscous_damping=10.0),
    controller=ServoController(position_gain=8e3, velocity_gain=150.0, force_bandwidth=100.0, reference_speed_max=0.8),
    seals=SEALS,
    control_period=PERIOD,
)


def position_servo(servo, amplitude, frequency, seconds=12.0):
    """A servo that takes positions only: its command, with encoder counts, noisy pressures and velocity."""
    wave, count = Sine(amplitude, frequency), round(seconds / PERIOD)
    commands = np.array([wave.at(i * PERIOD).position for i in range(count)])
    _, track = simulate(servo, init(servo), [Setpoint(command, 0.0, 0.0) for command in commands])
    noise = np.random.default_rng(1).normal(size=(count, 3))
    pressures = track.pressure_a + 500.0 * noise[:, 0], track.pressure_b + 500.0 * noise[:, 1]
    force = np.array([pressure_force(servo.cylinder, a, b) for a, b in zip(*pressures, strict=True)])
    position = 1e-6 * np.round(track.position / 1e-6)
    return CommandRecord(np.arange(count) * PERIOD, commands, force, position, track.velocity + 2e-4 * noise[:, 2])


@pytest.fixture(scope='module')
def hydraulic():
    return position_servo(HYDRAULIC, 0.002, 0.5)


@pytest.mark.parametrize(('servo', 'amplitude', 'frequency'), [(HYDRAULIC, 0.002, 0.5), (PNEUMATIC, 0.02, 0.25)])
def test_gain_of_a_position_servo_is_one_over_its_stiffness(servo, amplitude, frequency):
    found = output_gain(position_servo(servo, amplitude, frequency))
    stiffness = servo.controller.position_gain
    assert found.gain == pytest.approx(1.0 / stiffness, rel=0.1)
    assert found.standard_error < 0.05 * found.gain
    assert found.position_share == pytest.approx(1.0, abs=0.02)


def test_outliers_do_not_move_the_gain(hydraulic):
    command = hydraulic.command.copy()
    command[np.random.default_rng(2).choice(len(command), len(command) // 200, replace=False)] += 0.05
    found, clean = output_gain(hydraulic._replace(command=command)), output_gain(hydraulic)
    assert found.gain == pytest.approx(clean.gain, rel=0.1)


@pytest.mark.long  # many draws
def test_standard_error_covers_the_spread_of_the_gain_over_noise():
    rng = np.random.default_rng(3)
    n, gains, errors = 4000, [], []
    for _ in range(40):
        force = np.cumsum(rng.normal(size=n))
        velocity = np.cumsum(rng.normal(size=n)) * 1e-3
        rough = np.convolve(rng.normal(size=n + 100), np.ones(101) / 101, mode='valid')  # correlated noise
        command = 2e-5 * force + 0.3 * velocity + 2e-4 * rough
        found = output_gain(CommandRecord(np.arange(n) * 1e-3, command, force, np.full(n, np.nan), velocity))
        gains.append(found.gain)
        errors.append(found.standard_error)
    assert np.mean(gains) == pytest.approx(2e-5, rel=0.01)
    assert 0.5 < np.std(gains) / np.sqrt(np.mean(np.square(errors))) < 2.0


def made(noise=0.0, samples=2000, gain=2e-5, seed=3):
    """A command that is exactly linear in force, velocity and position, with noise over its standard deviation."""
    time = np.arange(samples) * PERIOD
    force, velocity = 300.0 * np.sin(7.0 * time), 0.02 * np.cos(11.0 * time)
    position = 0.01 * np.sin(3.0 * time + 1.0)
    command = gain * force + 0.3 * velocity + 1.5 * position + 0.4
    command = command + noise * command.std() * np.random.default_rng(seed).normal(size=samples)
    return CommandRecord(time, command, force, position, velocity)


def test_an_exact_relation_comes_back_with_every_share():
    found = output_gain(made())
    assert found == pytest.approx((2e-5, 0.0, 1.5, 0.3, 2000 - 19), abs=1e-12)  # averaged over 20 samples of 1 ms
    record = made()
    nothing = record._replace(position=np.full(2000, np.nan), command=record.command - 1.5 * record.position)
    assert output_gain(nothing)[::2] == pytest.approx((2e-5, 0.0, 2000 - 19), abs=1e-12)


@pytest.mark.parametrize('samples', [499, 500])
def test_a_gain_takes_500_samples(samples):
    record = CommandRecord(*(values[:samples] for values in made()))
    if samples == 500:
        assert output_gain(record).gain == pytest.approx(2e-5)
    else:
        with pytest.raises(ValueError, match='499 usable samples'):
            output_gain(record)


def test_samples_that_are_not_finite_do_not_count():
    record = made()
    record.force[7] = record.velocity[1900] = np.nan
    assert output_gain(record).samples == 1998 - 19
    slow = made()._replace(time=np.arange(2000) * 1e-5)  # 0.02 s are all of its samples
    with pytest.raises(ValueError, match='2000 usable samples'):
        output_gain(slow)


def test_a_record_slower_than_the_average_is_taken_sample_by_sample():
    slow = made()._replace(time=np.arange(2000) * 0.05)  # 20 samples a second, the average takes 0.02 s
    assert output_gain(slow) == pytest.approx((2e-5, 0.0, 1.5, 0.3, 2000), abs=1e-12)


def test_a_record_is_at_least_four_averages_long():
    for samples in (1999, 2000):
        record = CommandRecord(*(values[:samples] for values in made(samples=2000)))
        fast = record._replace(time=np.arange(samples) * 4e-5)  # an average of 500 samples
        if samples == 2000:
            assert output_gain(fast).samples == 1501
        else:
            with pytest.raises(ValueError, match='1999 usable samples'):
                output_gain(fast)


def test_one_sample_is_too_few():
    with pytest.raises(ValueError, match='1 usable samples'):
        output_gain(CommandRecord(*(values[:1] for values in made())))


def test_a_rod_that_stands_cannot_tell_what_is_by_position_and_what_is_offset():
    with pytest.raises(ValueError, match='do not change independently'):
        output_gain(made()._replace(position=np.full(2000, 0.125)))


def inputs_of(record):
    return np.column_stack([record.force, record.velocity, record.position, np.ones(len(record.time))])


def huber(inputs, command):
    """Solution of Huber's equation by least squares with weights, again and again."""
    found = np.linalg.lstsq(inputs, command, rcond=None)[0]
    for _ in range(100):
        residual = np.abs(command - inputs @ found)
        weight = np.sqrt(np.minimum(1.0, 1.345 * 1.4826 * np.median(residual) / np.maximum(residual, 1e-300)))
        found = np.linalg.lstsq(inputs * weight[:, np.newaxis], command * weight, rcond=None)[0]
    return found


def test_the_gain_solves_the_equation_of_huber():
    r"""The sum of psi(r / s) x is 0, with psi(u) = u up to 1.345 and 1.345 beyond, s = 1.4826 median of \|r\|."""
    rng = np.random.default_rng(11)
    record = made(samples=600)._replace(time=np.arange(600) * 0.05)  # no average
    columns = rng.normal(size=(3, 600)) * np.array([[300.0], [0.02], [0.01]])
    record = record._replace(force=columns[0], velocity=columns[1], position=columns[2])
    inputs, right = inputs_of(record), np.array([2e-5, 0.3, 1.5, 0.4])
    command = inputs @ right + 1e-3 * rng.standard_t(2, size=600)  # heavy tails: a sixth has less weight
    found = huber(inputs, command)
    assert output_gain(record._replace(command=command)).gain == pytest.approx(found[0], rel=1e-6)
    residual = command - inputs @ found
    share = residual / (1.4826 * np.median(np.abs(residual)))
    limited = np.clip(share, -1.345, 1.345)
    assert 0.1 < np.mean(limited != share) < 0.4
    size = np.abs(inputs).T @ np.abs(limited)
    np.testing.assert_allclose(inputs.T @ limited / size, 0.0, atol=1e-6)
    least_squares = np.linalg.lstsq(inputs, command, rcond=None)[0]
    assert np.abs(found - right)[0] < 0.7 * np.abs(least_squares - right)[0]


def test_the_standard_error_is_that_of_a_jackknife_over_twenty_blocks():
    """(g - 1) / g times the sum of squares of g estimates, each without one of g equal blocks [Kunsch1989]."""
    record = made(0.05, samples=1000)._replace(time=np.arange(1000) * 0.05)  # no average
    inputs = inputs_of(record)
    gains = []
    for block in np.split(np.arange(1000), 20):
        left = np.setdiff1d(np.arange(1000), block)
        gains.append(huber(inputs[left], record.command[left])[0])
    variance = 19.0 / 20.0 * sum((gain - np.mean(gains)) ** 2 for gain in gains)
    found = output_gain(record)
    assert found.standard_error == pytest.approx(variance**0.5, rel=1e-6)
    assert found.gain == pytest.approx(2e-5, abs=4.0 * found.standard_error)


@pytest.mark.parametrize(('variation', 'taken'), [(0.8e-6, False), (1.5e-6, True)])
def test_a_command_that_changes_by_a_millionth_of_its_size_changes(variation, taken):
    record = made()
    shape = record.command - record.command.mean()
    record = record._replace(command=1.0 + variation * shape / np.ptp(shape))
    if taken:
        assert output_gain(record).gain > 0.0
    else:
        with pytest.raises(ValueError, match='does not change'):
            output_gain(record)


@pytest.mark.parametrize(('noise', 'taken'), [(0.5, True), (2.0, False)])
def test_a_gain_is_known_to_a_tenth_or_not_at_all(noise, taken):
    """Its relative standard deviation over noise, from 40 draws, decides as the standard error of each does."""
    errors = []
    for seed in range(40):
        record = made(noise, seed=seed)
        inputs = np.column_stack([record.force, record.velocity, record.position, np.ones(2000)])
        errors.append(np.linalg.lstsq(inputs, record.command, rcond=None)[0][0] / 2e-5 - 1.0)
    assert bool(np.std(errors) < 0.05) is taken
    assert bool(np.std(errors) > 0.12) is not taken
    if taken:
        found = output_gain(made(noise))
        assert 0.5 < found.standard_error / found.gain / np.std(errors) < 2.0
    else:
        with pytest.raises(ValueError, match='more than 10%'):
            output_gain(made(noise))


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        (lambda r: r._replace(command=np.full_like(r.command, 0.001)), 'does not change'),
        (lambda r: r._replace(command=1e3 + 1e-2 * r.command), 'does not change'),  # in whatever unit
        (lambda r: CommandRecord(*(values[:100] for values in r)), '100 usable samples'),
        (lambda r: r._replace(force=-r.force), 'check the sign'),
        (lambda r: r._replace(velocity=np.zeros_like(r.velocity)), 'do not change independently'),
        (
            lambda r: r._replace(force=np.random.default_rng(4).normal(size=len(r.force))),
            'standard error of .* record',
        ),
    ],
)
def test_data_that_cannot_tell_the_gain_are_rejected_with_what_to_record(hydraulic, change, reason):
    with pytest.raises(ValueError, match=reason):
        output_gain(change(hydraulic))


def test_gain_times_a_force_added_to_the_command_is_that_force_on_the_rod(hydraulic):
    """Closed loop: the friction of the seals, fed through the gain, makes a position servo follow."""
    gain = output_gain(hydraulic).gain
    wave, count = Sine(0.002, 0.5), 4000
    stronger = dataclasses.replace(HYDRAULIC, load=Load(viscous_damping=0.0))
    errors = []
    for scale in (0.0, 0.9):
        added = []
        for i in range(count):
            position, velocity, _ = wave.at(i * PERIOD)
            friction = 35.0 * np.tanh(velocity / 1e-4)  # [N]
            added.append(Setpoint(position + scale * gain * friction, velocity, 0.0))
        _, track = simulate(stronger, init(stronger), added)
        reference = np.array([wave.at((i + 1) * PERIOD).position for i in range(count)])
        errors.append(float(np.sqrt(np.mean((track.position - reference)[1000:] ** 2))))
    assert errors[1] < 0.5 * errors[0]
