import math
from functools import partial
from itertools import pairwise

import pytest
from harness.spool_program import spool_cycles
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.foundation.units import PSI
from seal_friction_ros.core.servo.motions import (
    Chirp,
    PullCommand,
    PullTest,
    RoundedWave,
    Setpoint,
    Sine,
    Step,
    Trapezoid,
)

WAVES = [Sine(0.002, 3.0, 0.01), Trapezoid(), Chirp(duration=2.0), Chirp(start_frequency=9.0, end_frequency=2.0)]


@pytest.mark.parametrize('wave', WAVES, ids=lambda w: type(w).__name__)
@given(time=st.floats(1e-3, 12.0))
def test_velocity_and_acceleration_are_the_derivatives(wave, time):
    e = 1e-6  # [s]
    before, at, after = wave.at(time - e), wave.at(time), wave.at(time + e)
    if abs(after.acceleration - before.acceleration) > 0.01:
        return  # a corner of the trapezoid, or the end of a sweep
    assert (after.position - before.position) / (2 * e) == pytest.approx(at.velocity, abs=1e-6)
    assert (after.velocity - before.velocity) / (2 * e) == pytest.approx(at.acceleration, abs=1e-2)


@pytest.mark.parametrize('wave', [*WAVES, Step(0.1, 1.0, 0.2)], ids=lambda w: type(w).__name__)
def test_before_time_0_a_wave_stands_still(wave):
    assert wave.at(-1.0) == Setpoint(wave.offset, 0.0, 0.0)


@pytest.mark.parametrize('wave', [*WAVES, Step(0.1, 1.0, 0.2)], ids=lambda w: type(w).__name__)
@given(sample=st.integers(-5, 4000), resolution=st.sampled_from([1e-6, 5e-6, 1e-3]), rate=st.sampled_from([1e3, 2e3]))
def test_a_rounded_wave_is_a_digital_set_point_and_its_differences(wave, sample, resolution, rate):
    rounded = RoundedWave(wave, resolution, 1.0 / rate)
    before, now = (rounded.at(i / rate) for i in (sample - 1, sample))
    steps = now.position / resolution
    assert steps == pytest.approx(round(steps), abs=1e-6)
    assert abs(now.position - wave.at(sample / rate).position) <= 0.5 * resolution * (1.0 + 1e-6)
    assert now.velocity == pytest.approx((now.position - before.position) * rate, abs=1e-9)
    assert now.acceleration == pytest.approx((now.velocity - before.velocity) * rate, abs=1e-6)


def test_a_sine_is_at_its_ends_and_in_its_middle_when_it_should_be():
    wave = Sine(0.002, 5.0, 0.01)
    rate = 10.0 * math.pi
    for quarter, (position, velocity, acceleration) in enumerate(((0, 1, 0), (1, 0, -1), (0, -1, 0), (-1, 0, 1))):
        expected = (0.01 + 0.002 * position, 0.002 * rate * velocity, 0.002 * rate**2 * acceleration)
        assert wave.at(0.05 * quarter) == pytest.approx(expected, abs=1e-12)


def test_strokes_that_fill_the_period_and_just_reach_their_speed():
    """0.5 m at 1 m/s and 2 m/s2: half a second of ramp up, half a second of ramp down, no rest."""
    wave = Trapezoid(distance=0.5, speed=1.0, acceleration=2.0, frequency=0.5, offset=-0.1, cycles=2)
    assert (wave.move_time, wave.duration) == (1.0, 4.0)
    assert wave.at(0.25) == pytest.approx((-0.1 + 0.0625, 0.5, 2.0))
    assert wave.at(0.75) == pytest.approx((0.4 - 0.0625, 0.5, -2.0))
    assert wave.at(1.25) == pytest.approx((0.4 - 0.0625, -0.5, -2.0))
    assert wave.at(3.75) == pytest.approx((-0.1 + 0.0625, -0.5, 2.0))
    assert wave.at(4.0) == Setpoint(-0.1)
    for wrong in ({'speed': 1.001}, {'frequency': 0.501}):
        with pytest.raises(ValueError, match=r'^Trapezoid\.'):
            Trapezoid(**{'distance': 0.5, 'speed': 1.0, 'acceleration': 2.0, 'frequency': 0.5} | wrong)
    assert Trapezoid(cycles=0).duration == math.inf


def test_a_chirp_follows_the_closed_form_in_and_after_its_sweep():
    wave = Chirp(amplitude=0.5, start_frequency=1.0, end_frequency=3.0, duration=4.0, offset=0.2)
    assert wave.at(2.0).position == pytest.approx(0.2 + 0.5 * math.sin(2.0 * math.pi * 1.5 * 2.0), abs=1e-12)
    assert wave.at(2.0).velocity == pytest.approx(0.5 * 2.0 * math.pi * 2.0 * math.cos(2.0 * math.pi * 3.0))
    assert wave.at(6.0).position == pytest.approx(0.2 + 0.5 * math.sin(2.0 * math.pi * (8.0 + 6.0)), abs=1e-9)


def test_step_steps_once():
    wave = Step(0.003, 0.5, 0.001)
    assert [wave.at(t).position for t in (0.0, 0.4999, 0.5, 9.0)] == [0.001, 0.001, 0.004, 0.004]


def test_chirp_sweeps_and_stays():
    wave = Chirp(amplitude=1.0, start_frequency=1.0, end_frequency=3.0, duration=4.0)
    assert wave.at(0.0).velocity == pytest.approx(2 * math.pi)
    assert wave.at(4.0).position == pytest.approx(math.sin(2 * math.pi * 8.0), abs=1e-9)  # 8 turns at 2 Hz in the mean
    assert wave.at(4.0).velocity == pytest.approx(2 * math.pi * 3.0)
    assert wave.at(4.0 + 1 / 3).position == pytest.approx(0.0, abs=1e-9)
    assert wave.at(4.0 - 1e-9).position == pytest.approx(wave.at(4.0).position, abs=1e-6)


@pytest.mark.parametrize('distance', [1.8e-3, 2.7e-3])
def test_spool_cycles_are_those_of_the_paper(distance):
    wave = spool_cycles(distance)
    assert (wave.frequency, wave.cycles, wave.speed) == (3.0, 10, 0.034)
    assert wave.duration == pytest.approx(10 / 3)
    times = [i * 1e-4 for i in range(34000)]
    samples = [wave.at(t) for t in times]
    assert max(s.position for s in samples) == pytest.approx(distance, rel=1e-12)
    assert min(s.position for s in samples) == 0.0
    assert max(s.velocity for s in samples) == 0.034
    assert min(s.velocity for s in samples) == -0.034
    starts = sum(a.velocity <= 0 < b.velocity for a, b in pairwise(samples))
    assert starts == 10
    assert wave.at(0.5 / 3.0 - 1e-6) == Setpoint(distance, 0.0, 0.0)  # rest at the far end
    assert wave.at(10 / 3) == Setpoint(0.0, 0.0, 0.0)


def test_pull_test_is_that_of_appendix_a():
    plan = PullTest()
    assert plan.duration == (30.0 + 10.0) * 33
    block = plan.rest_time + 2 * plan.pull_time
    pressures = [plan.at(block * i + 1.0).pressure / PSI for i in range(33)]
    assert pressures == pytest.approx([100.0 * i for i in range(11)] * 3)
    assert plan.at(29.9) == plan.at(0.0)
    extend, retract = plan.at(32.5), plan.at(37.5)
    assert (extend.direction, retract.direction) == (1, -1)
    assert extend.carriage == pytest.approx(0.01)
    assert retract.carriage == pytest.approx(0.01)
    assert plan.at(1e9) == PullCommand(1000.0 * PSI, 0.0, 32, 0)  # all done: at rest, the carriage back
    assert plan.at(-5.0) == PullCommand(0.0, 0.0, 0, 0)
    assert plan.at(30.0) == PullCommand(0.0, 0.0, 0, 0)
    assert plan.at(35.0) == PullCommand(0.0, 0.02, 0, -1)  # the turn: 5 s at 4 mm/s
    assert plan.at(40.0) == pytest.approx((100.0 * PSI, 0.0, 1, 0))
    assert PullTest(intervals=4, pressure_max=8e5).at(40.0).pressure == 2e5
    assert plan.force(extend, 0.006) == pytest.approx(40.0)


@pytest.mark.parametrize(
    ('make', 'reason'),
    [
        (partial(Trapezoid, distance=1e-4), 'not reached within distance'),
        (partial(Trapezoid, frequency=20.0), 'leaves 0.025 s for a move'),
        (partial(Sine, amplitude=math.nan), 'not finite'),
        (partial(Chirp, duration=0.0), 'below its lower bound'),
        (partial(PullTest, repetitions=0), 'below its lower bound'),
        (partial(Step, size=11.0), 'above its upper bound'),
    ],
)
def test_an_invalid_wave_is_refused(make, reason):
    with pytest.raises(ValueError, match=reason):
        make()
