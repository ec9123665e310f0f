"""The spool-valve paper's evaluation, on a rig whose friction and resonance are known."""

import numpy as np
import pytest

from seal_friction_studies.core.spool_evaluation import (
    SpoolEvaluation,
    cycle_starts,
    evaluate_cycles,
    moving_average,
    reference_force,
    resonance_frequency,
    without_resonance,
)

RATE, CYCLES = 20_000.0, 10  # [Hz], paper: 10 cycles
FREQUENCY, STROKE, SPEED, RAMP = 3.0, 1.8e-3, 34e-3, 0.680  # [Hz], [m], [m/s], [m/s^2] of the paper
RINGING = 157.0  # [Hz] of the paper
PAPER = SpoolEvaluation()


def rig(speed=SPEED, ringing=RINGING, amplitude=0.8, frictions=None):
    """Time, displacement and force: friction of a trapezoidal motion to and fro, which makes the chain ring."""
    n = int(RATE / FREQUENCY)
    moving = int(STROKE / speed * RATE)
    ramp = int(speed / RAMP * RATE)
    profile = np.minimum(np.minimum(np.arange(moving + ramp), np.arange(moving + ramp)[::-1]) / ramp, 1.0)
    half = np.zeros(n // 2)
    half[: len(profile)] = profile * STROKE / (profile.sum() / RATE)
    velocity = np.tile(np.concatenate((half, -half)), CYCLES)
    time = np.arange(len(velocity)) / RATE
    displacement = np.cumsum(velocity) / RATE
    level = np.repeat(np.ones(CYCLES) if frictions is None else frictions, len(velocity) // CYCLES)
    force = level * np.tanh(velocity / 1e-3)
    since = time % (0.5 / FREQUENCY)
    force += amplitude * np.exp(-since / 0.03) * np.sin(2.0 * np.pi * ringing * since)
    return time, displacement, force


@pytest.mark.parametrize('speed', [15e-3, 34e-3, 60e-3])
@pytest.mark.parametrize('ringing', [120.0, 157.0, 240.0])
def test_the_resonance_is_recognised_at_any_speed(speed, ringing):
    time, _, force = rig(speed, ringing)
    assert resonance_frequency(time, force, PAPER) == pytest.approx(ringing, rel=0.025)


def test_noise_and_friction_alone_have_no_resonance():
    time, _, force = rig(amplitude=0.0)
    noise = np.random.default_rng(3).normal(scale=0.05, size=len(time))
    assert resonance_frequency(time, force + noise, PAPER) is None
    assert resonance_frequency(time, noise, PAPER) is None


def test_the_filter_takes_the_resonance_and_leaves_the_friction():
    time, _, force = rig(amplitude=0.0)
    ringing = 0.5 * np.sin(2.0 * np.pi * RINGING * time)
    cleaned = without_resonance(time, force + ringing, RINGING, PAPER)
    unrung = without_resonance(time, force, RINGING, PAPER)
    middle = slice(1000, -1000)
    assert np.std((cleaned - unrung)[middle]) < 0.02 * np.std(ringing)
    assert np.median(np.abs(unrung - force)[middle]) < 0.02


def test_a_resonance_beyond_half_the_sampling_rate_is_refused():
    with pytest.raises(ValueError, match='not below half the sampling rate'):
        without_resonance(np.arange(100) / 100.0, np.zeros(100), 60.0, PAPER)


def test_a_resonance_below_one_hertz_is_filtered():
    time = np.arange(2000) / 10.0
    wave = np.sin(2.0 * np.pi * 0.5 * time)
    assert np.abs(without_resonance(time, wave, 0.5, PAPER)[500:-500]).max() < 0.02


def test_moving_average_of_fifty_smooths_white_noise_by_the_root_of_fifty():
    noise = np.random.default_rng(2).normal(size=100_000)
    assert np.std(moving_average(noise, 50)) == pytest.approx(1.0 / np.sqrt(50.0), rel=0.05)


def test_the_ninth_of_ten_cycles_is_evaluated():
    frictions = np.ones(CYCLES)
    frictions[8] = 3.0
    time, displacement, force = rig(frictions=frictions, amplitude=0.3)
    ninth = evaluate_cycles(time, displacement, force, PAPER)
    fifth = evaluate_cycles(time, displacement, force, SpoolEvaluation(evaluated_cycle=5))
    assert ninth.reference_force == pytest.approx(3.0, rel=0.03)
    assert fifth.reference_force == pytest.approx(1.0, rel=0.03)


def test_normalised_friction_is_one_in_the_middle_of_the_stroke_and_has_the_sign_of_the_velocity():
    found = evaluate_cycles(*rig(), PAPER)
    middle = np.abs(found.displacement) <= 0.5e-3
    assert np.abs(found.normalised[middle]).mean() == pytest.approx(1.0, abs=1e-9)
    assert np.sign(found.normalised[middle]) == pytest.approx(np.sign(found.velocity[middle]))
    assert found.resonance == pytest.approx(RINGING, rel=0.025)
    assert found.displacement.max() == pytest.approx(STROKE / 2.0, rel=0.02)


def test_another_measurement_may_give_the_reference():
    own = evaluate_cycles(*rig(), PAPER)
    doubled = evaluate_cycles(*rig(), PAPER, reference=2.0 * own.reference_force)
    assert doubled.normalised == pytest.approx(own.normalised / 2.0)


def test_cycles_begin_a_quarter_before_the_rod_passes_the_middle_upwards():
    time = np.arange(3500) / 1000.0
    displacement = 2.0 + 1.5 * np.sin(2.0 * np.pi * (time - 0.3))  # upwards through the middle at 0.3, 1.3, 2.3, 3.3 s
    starts = cycle_starts(displacement)
    assert starts == pytest.approx([50, 1050, 2050, 3050, 3500], abs=1)
    cut = cycle_starts(displacement[200:])
    assert cut == pytest.approx([0, 850, 1850, 2850, 3300], abs=1)
    one = cycle_starts(displacement[:2000])
    assert one == pytest.approx([50, 1050, 2000], abs=1)
    assert cycle_starts(displacement[:2100])[-1] == pytest.approx(2050, abs=1)  # a whole period long


def test_the_reference_force_is_the_mean_magnitude_up_to_half_a_millimetre_from_the_middle():
    displacement = np.array([-0.6, -0.5, 0.0, 0.5, 0.6]) * 1e-3
    force = np.array([99.0, -3.0, 5.0, -7.0, 99.0])
    assert reference_force(displacement, force, 0.5e-3) == pytest.approx(5.0)
    assert reference_force(displacement[1:4], force[1:4], 0.5e-3) == pytest.approx(5.0)  # it just reaches
    with pytest.raises(ValueError, match=r'the stroke of \+/- 0.5 mm does not reach \+/- 0.501 mm'):
        reference_force(displacement[1:4], force[1:4], 0.501e-3)
    with pytest.raises(ValueError, match='does not reach'):
        reference_force(displacement[[0, 4]], force[[0, 4]], 0.5e-3)  # no sample there
    with pytest.raises(ValueError, match='force in the middle of the stroke is zero'):
        reference_force(displacement, 0.0 * force, 0.5e-3)


def test_a_moving_average_holds_its_ends_and_has_no_delay():
    step = np.where(np.arange(20) >= 10, 1.0, 0.0)
    smooth = moving_average(step, 5)
    assert smooth[[0, 7, 8, 9, 10, 11, 12, 19]] == pytest.approx([0.0, 0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.0])


def test_a_force_without_resonance_is_not_filtered_and_the_last_cycle_can_be_evaluated():
    time, displacement, force = rig(amplitude=0.0)
    last = SpoolEvaluation(evaluated_cycle=CYCLES, moving_average=1)
    found = evaluate_cycles(time, displacement, force, last)
    assert found.resonance is None
    assert np.array_equal(found.filtered, found.force)
    assert found.normalised == pytest.approx(found.force / found.reference_force)
    assert np.abs(found.velocity).max() == pytest.approx(SPEED, rel=0.03)


def test_too_few_cycles_and_too_short_strokes_are_refused():
    time, displacement, force = rig()
    third = len(time) // 3
    with pytest.raises(ValueError, match='but cycle 9 is to be evaluated'):
        evaluate_cycles(time[:third], displacement[:third], force[:third], PAPER)
    eight = slice(0, len(time) * 8 // 10)
    with pytest.raises(ValueError, match=r'^8 cycles, but cycle 9 is to be evaluated: drive 10 cycles'):
        evaluate_cycles(time[eight], displacement[eight], force[eight], PAPER)
    nine = slice(0, len(time) * 9 // 10)
    assert len(evaluate_cycles(time[nine], displacement[nine], force[nine], PAPER).force) > 1000
    with pytest.raises(ValueError, match='no cycle: drive in both directions'):
        cycle_starts(np.linspace(0.0, 1.0, 100))
    with pytest.raises(ValueError, match='does not reach'):
        reference_force(displacement / 10.0, force, 0.5e-3)
    with pytest.raises(ValueError, match='not finite'):
        evaluate_cycles(time, np.where(time > 1.0, np.nan, displacement), force, PAPER)
    with pytest.raises(ValueError, match='evaluated_cycle = 12 is above cycles = 10'):
        SpoolEvaluation(evaluated_cycle=12)


# --- the resonance in a spectrum ---


def lines(humps=(), seconds=2.0, rate=2000.0, fundamental=2.0):
    """Force whose spectrum has lines at multiples of 2 Hz that fall as 1 / f, times what ``humps`` add.

    Each hump is a frequency [Hz], a height, and a width [Hz] of even height.
    """
    time = np.arange(round(seconds * rate)) / rate
    force = np.zeros(len(time))
    for f in fundamental * np.arange(1, int(0.5 * rate / fundamental)):
        height = 1.0 / f
        for middle, times, width in humps:
            if abs(f - middle) <= width / 2.0:
                height *= times
        force += height * np.sin(2.0 * np.pi * f * time + 0.1 * f)
    return time, force


def test_a_resonance_is_a_hump_that_is_higher_than_its_sides_by_the_prominence():
    """Lines fall as 1 / f: at two thirds of the frequency, within 10 Hz, they are f / (2 f / 3 - 10 Hz) higher."""
    for middle in (120.0, 300.0):
        side = middle / (middle / 1.5 - 10.0)  # [-] the envelope there over the lines without a hump
        for times, found in ((1.85 * side, False), (2.6 * side, True)):
            frequency = resonance_frequency(*lines([(middle, times, 4.0)]), PAPER)
            assert (frequency is not None) is found, (middle, times)
            assert not found or frequency == pytest.approx(middle, abs=3.0)
    assert resonance_frequency(*lines(), PAPER) is None


def test_a_resonance_is_looked_for_between_the_motion_and_two_thirds_of_the_highest_frequency():
    for middle, found in ((44.0, False), (60.0, True), (640.0, True), (690.0, False)):
        frequency = resonance_frequency(*lines([(middle, 30.0, 4.0)]), PAPER)
        assert (frequency is not None and frequency == pytest.approx(middle, abs=4.0)) is found, middle
    low = SpoolEvaluation(lowest_resonance=30.0)
    assert resonance_frequency(*lines([(44.0, 30.0, 4.0)]), low) == pytest.approx(44.0, abs=4.0)


def test_the_frequency_is_the_mean_of_the_lines_under_the_hump_by_their_power():
    """Two lines of 1 and 2 in amplitude at 200 and 210 Hz, nothing else within 15 %: mean weighted with 1 and 4."""
    time = np.arange(8000) / 2000.0
    force = np.sin(2.0 * np.pi * 200.0 * time) + 2.0 * np.sin(2.0 * np.pi * 210.0 * time)
    assert resonance_frequency(time, force, PAPER) == pytest.approx((200.0 + 4.0 * 210.0) / 5.0, abs=0.05)
    beyond = force + 1.5 * np.sin(2.0 * np.pi * 250.0 * time)  # 19 % above the largest
    assert resonance_frequency(time, beyond, PAPER) == pytest.approx((200.0 + 4.0 * 210.0) / 5.0, abs=0.05)
    offset = resonance_frequency(time, 1e3 + force, PAPER)
    assert offset == pytest.approx(208.0, abs=0.05)  # the mean of the force is no line


def test_a_record_too_short_or_too_slow_shows_no_resonance():
    time, force = lines([(60.0, 30.0, 4.0)], rate=160.0)
    assert resonance_frequency(time, force, PAPER) is None  # 50 Hz to two thirds of 80 Hz: six lines
    with pytest.raises(ValueError, match=r'a resonance of 80.1 Hz is not below half the sampling rate of 160 Hz'):
        without_resonance(time, force, 80.1, PAPER)
    with pytest.raises(ValueError, match='a resonance of 0 Hz'):
        without_resonance(time, force, 0.0, PAPER)
    assert len(without_resonance(time, force, 79.0, PAPER)) == len(time)


def test_the_notch_is_as_wide_as_the_resonance_over_its_quality_and_has_no_delay():
    """At the edges of the width, 157 Hz +/- a tenth, one pass leaves 1 / sqrt(2); to and fro it is a half."""
    time = np.arange(20000) / RATE
    for frequency, gain in ((157.0, 0.0), (157.0 * 0.905, 0.5), (157.0 * 1.105, 0.5), (15.7, 1.0), (1570.0, 1.0)):
        wave = np.sin(2.0 * np.pi * frequency * time)
        left = without_resonance(time, wave, 157.0, PAPER)[5000:-5000]
        assert np.std(left) * np.sqrt(2.0) == pytest.approx(gain, abs=0.02)
        assert left == pytest.approx(gain * wave[5000:-5000], abs=0.03)


def test_without_a_choice_the_evaluation_is_that_of_the_paper():
    """Ninth of ten cycles, average of 50 samples, reference within 0.5 mm; resonance and notch are our choice."""
    assert (PAPER.cycles, PAPER.evaluated_cycle, PAPER.moving_average) == (10, 9, 50)
    assert PAPER.reference_half_width == 0.5e-3
    assert (PAPER.lowest_resonance, PAPER.resonance_prominence, PAPER.notch_quality) == (50.0, 2.2, 5.0)


@pytest.mark.parametrize(
    ('name', 'lower', 'upper'),
    [
        ('cycles', 1, 10**6),
        ('moving_average', 1, 10**6),
        ('reference_half_width', 1e-6, 1.0),
        ('lowest_resonance', 0.1, 1e5),
        ('resonance_prominence', 1.0, 1e6),
        ('notch_quality', 0.5, 1e3),
    ],
)
def test_a_setting_is_taken_at_its_bounds_and_refused_beyond_them(name, lower, upper):
    more = 1 if isinstance(lower, int) else 1e-3 * lower
    for value in (lower, upper):
        assert getattr(SpoolEvaluation(**{'evaluated_cycle': 1} | {name: value}), name) == value
    for value in (lower - more, upper + (1 if isinstance(upper, int) else 1e-3 * upper)):
        with pytest.raises(ValueError, match=name):
            SpoolEvaluation(**{'evaluated_cycle': 1} | {name: value})


def test_any_of_a_million_cycles_may_be_evaluated():
    assert SpoolEvaluation(cycles=10**6, evaluated_cycle=10**6).evaluated_cycle == 10**6
    with pytest.raises(ValueError, match='evaluated_cycle'):
        SpoolEvaluation(evaluated_cycle=0)
    with pytest.raises(ValueError, match='evaluated_cycle'):
        SpoolEvaluation(cycles=10**6, evaluated_cycle=10**6 + 1)
