"""Friction law and feed-forward from recordings that are made from formulas."""

import dataclasses
import math

import numpy as np
import pytest
from harness.compensation import COMPENSATING

from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.identification.admission import Account
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.core.tuning.recorded_axis import (
    RecordedLaw,
    Recording,
    acceleration,
    delayed,
    feedforward_force,
    fit_law,
    largest_friction,
    near_reversals,
    residual,
    tune_recorded_axis,
)
from seal_friction_ros.core.tuning.settings import FORCE_MARGIN, RecordedAxisSettings
from seal_friction_ros.core.tuning.simulated_axis import nearest_preferred, preferred

RATE, SECONDS = 500.0, 4.0  # [Hz], [s]
TIME = np.arange(round(RATE * SECONDS)) / RATE
SETTINGS = COMPENSATING
KNOWN = RecordedAxisSettings()


def recording(
    *, scale=0.8, mass=5.0, offset=3.0, width=0.0, noise=0.0, frequency=2.0, coulomb=40.0, velocity=None, status=0
):
    """A rod that follows its sine, with a friction of ``scale`` times ``coulomb``, smooth over ``width`` [m/s]."""
    rate, speed = 2.0 * math.pi * frequency, 0.03
    if velocity is None:
        velocity, slope = speed * np.cos(rate * TIME), -speed * rate * np.sin(rate * TIME)
    else:
        slope = np.gradient(velocity, TIME)
    pressure_part = coulomb * (1.0 + 0.1 * np.sin(3.0 * TIME))
    direction = np.tanh(velocity / width) if width else np.sign(velocity)
    force = scale * pressure_part * direction + mass * slope + offset
    force = force + noise * np.random.default_rng(5).normal(size=len(TIME))
    state = np.where(np.abs(velocity) > 1e-3, int(FrictionState.SLIDING), int(FrictionState.STUCK))
    return Recording(
        stamps=np.round(TIME * 1e9).astype(np.int64),
        state=state,
        status=np.full(len(TIME), status),
        coulomb_friction=pressure_part,
        velocity=velocity,
        force_sum=force,
        reference_velocity=velocity,
        reference_acceleration=slope,
        reference_age=np.zeros(len(TIME)),
    )


def test_scale_mass_and_offset_of_a_simulated_axis_are_found():
    law = fit_law(recording(noise=2.0))
    assert law.scale == pytest.approx(0.8, abs=4.0 * law.scale_std)
    assert law.scale_std < 0.01
    assert law.mass == pytest.approx(5.0, abs=0.5)  # 0.17 kg is one standard deviation
    assert law.offset == pytest.approx(3.0, abs=0.3)
    assert law.mass_is_fitted


def test_stated_deviation_is_that_of_the_scale():
    scales = []
    for seed in range(40):
        made = recording()
        noise = 5.0 * np.random.default_rng(seed).normal(size=len(TIME))
        law = fit_law(made._replace(force_sum=made.force_sum + noise))
        scales.append(law.scale)
    assert np.std(scales) == pytest.approx(law.scale_std, rel=0.35)


@pytest.mark.parametrize(('age', 'usable'), [(0.029, True), (0.031, False), (-0.029, True), (-0.031, False)])
def test_a_reference_counts_within_its_timeout_before_and_after_the_sample(age, usable):
    made = recording()
    aged = made._replace(reference_age=np.full(len(TIME), age))
    assert bool(np.any(feedforward_force(SETTINGS, aged)[500:])) is usable


def test_given_mass_is_taken():
    law = fit_law(recording(), 5.0)
    assert (law.mass, law.mass_is_fitted) == (5.0, False)
    assert law.scale == pytest.approx(0.8, abs=1e-3)
    noisy = recording(noise=2.0)
    assert fit_law(noisy, 5.0).scale_std == pytest.approx(fit_law(noisy).scale_std, rel=0.1)  # its force is taken off


def test_one_direction_cannot_tell_an_offset_so_none_is_taken_off():
    velocity = 0.02 + 0.01 * np.sin(2.0 * math.pi * TIME)
    law = fit_law(recording(velocity=velocity, offset=0.0))
    assert law.offset == 0.0
    assert law.scale == pytest.approx(0.8, rel=1e-2)


def test_steady_speed_in_one_direction_tells_no_mass_but_is_no_error():
    velocity = np.full(len(TIME), 0.02)
    with pytest.raises(ValueError, match='record several speeds'):
        fit_law(recording(velocity=velocity, offset=0.0))
    assert fit_law(recording(velocity=velocity, offset=0.0), 5.0).scale == pytest.approx(0.8)


@pytest.mark.parametrize('status', [Status.PRESSURE_STALE, Status.PRESSURE_MISSING])
def test_unusable_estimates_do_not_count(status):
    with pytest.raises(ValueError, match='slides in 0 usable samples'):
        fit_law(recording(status=int(status)))


def test_acceleration_is_exact_for_a_parabola_and_unknown_at_gaps_and_faults():
    velocity = 3.0 * TIME**2
    slope = acceleration(TIME, velocity)
    np.testing.assert_allclose(slope[5:-5], 6.0 * TIME[5:-5], atol=1e-9)
    assert np.isnan(slope[:5]).all()
    gap = TIME + np.where(np.arange(len(TIME)) > 700, 0.1, 0.0)
    slope = acceleration(gap, velocity)
    assert np.isnan(slope[696:706]).all()
    assert np.isfinite(slope[[694, 707]]).all()
    faulty = velocity.copy()
    faulty[900] = math.nan
    slope = acceleration(TIME, faulty)
    assert np.isnan(slope[895:906]).all()
    assert np.isfinite(slope[[894, 906]]).all()


def test_a_steady_velocity_has_no_acceleration_and_a_slow_change_has():
    assert not acceleration(TIME, np.full(len(TIME), 0.1))[5:-5].any()  # 0, not rounding
    np.testing.assert_allclose(acceleration(TIME, 0.1 + 1e-5 * TIME)[5:-5], 1e-5, rtol=1e-3)


def test_acceleration_of_next_to_nothing_is_unknown():
    assert np.isnan(acceleration(np.zeros(20), np.zeros(20))).all()
    assert np.isnan(acceleration(np.arange(3.0), np.arange(3.0))).all()


@pytest.mark.parametrize(('stretch', 'known'), [(1.4, True), (1.6, False), (0.6, True), (0.4, False)])
def test_a_sample_that_is_half_a_period_early_or_late_has_no_acceleration(stretch, known):
    time = TIME + np.where(np.arange(len(TIME)) > 700, (stretch - 1.0) / RATE, 0.0)
    slope = acceleration(time, 3.0 * TIME)
    assert np.isfinite(slope[696:706]).all() == known
    assert np.isfinite(slope[[695, 706]]).all()


def only(made, keep):
    """The recording with the estimates outside ``keep`` unusable."""
    return made._replace(status=np.where(keep, made.status, int(Status.PRESSURE_STALE)))


def test_a_doubtful_motion_counts_from_a_tenth_of_the_largest_speed_on():
    made = recording(status=int(Status.MOTION_UNCERTAIN))
    speed = np.abs(made.velocity[5:-5])
    np.testing.assert_array_equal(fit_law(made).sliding[5:-5], speed >= 0.1 * 0.03)
    sure = fit_law(recording()).sliding[5:-5]
    np.testing.assert_array_equal(sure, speed > 1e-3)


def test_a_law_takes_a_hundred_samples():
    made = recording()
    places = np.flatnonzero(fit_law(made).sliding)
    for count in (99, 100):
        keep = np.isin(np.arange(len(TIME)), places[:: len(places) // count][:count])
        if count == 100:
            assert fit_law(only(made, keep)).scale == pytest.approx(0.8, rel=0.01)
        else:
            with pytest.raises(ValueError, match='slides in 99 usable samples, the friction needs 100'):
                fit_law(only(made, keep))


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize(('percent', 'offset'), [(11, 3.0), (10, 3.0), (9, 0.0)])
def test_an_offset_takes_a_tenth_of_the_samples_in_each_direction(percent, offset, side):
    made = recording()
    places = np.flatnonzero(fit_law(made).sliding)
    few, many = (places[side * s * made.velocity[places] > 0.0] for s in (1.0, -1.0))
    chosen = [*few[:: len(few) // percent][:percent], *many[:: len(many) // 100][: 100 - percent]]
    law = fit_law(only(made, np.isin(np.arange(len(TIME)), chosen)))
    assert np.count_nonzero(law.sliding) == 100
    assert law.offset == pytest.approx(offset, abs=1e-2 if offset else 0.0)


@pytest.mark.parametrize(('noise', 'low', 'high', 'known'), [(110.0, 0.05, 0.1, False), (50.0, 0.025, 0.05, True)])
def test_a_scale_is_known_to_5_percent_or_not_at_all(noise, low, high, known):
    made = recording(noise=noise)
    law = fit_law(made)
    assert low < law.scale_std / law.scale < high
    found = tune_recorded_axis(made, SETTINGS, KNOWN)
    assert found.identified['scale'] is known
    assert found.feedforward.scale == (round(law.scale, 2) if known else SETTINGS.scale)


@pytest.mark.parametrize(('share', 'counts'), [(0.015, True), (0.005, False)])
def test_the_largest_hundredth_of_the_frictions_is_noise(share, counts):
    made = recording(coulomb=40.0, scale=1.0)
    law = fit_law(made)
    places = np.flatnonzero(law.sliding)
    peaks = places[np.linspace(0, len(places) - 1, round(share * len(places))).astype(int)]
    law.friction[peaks] = -300.0
    expected = 300.0 if counts else 44.0  # of the law: the friction rises by a tenth
    assert largest_friction(made, law) == pytest.approx(expected, rel=0.01)
    assert largest_friction(made, law._replace(friction=0.0 * law.friction)) == pytest.approx(44.0, rel=0.01)


def test_the_residual_counts_where_the_rod_slides_and_near_a_reversal():
    law = RecordedLaw(
        1.0, 0.0, 0.0, False, 0.0, np.array([3.0, 5.0, 9.0, np.nan]), np.array([True, True, False, False]),
        Account('', 2, {'at rest': 2}),
    )  # fmt: skip
    left = residual(law, np.array([False, True, True, True]), np.array([0.0, 1.0, 0.0, 0.0]))
    assert left == pytest.approx((math.sqrt((9.0 + 16.0) / 2.0), 4.0))
    assert residual(law, np.zeros(4, bool), np.zeros(4)).reversal == 0.0
    assert left.better_than(left._replace(sliding=4.0))
    assert not left.better_than(left)


def test_an_estimate_that_is_unusable_has_no_force_and_a_wrong_model_has_its_share_more():
    made = recording()
    assert not feedforward_force(SETTINGS, only(made, np.zeros(len(TIME), bool))).any()
    plain, more = (feedforward_force(SETTINGS, made, error) for error in (0.0, 0.2))
    steady = np.abs(plain) > 0.99 * np.abs(plain).max()
    np.testing.assert_allclose(more[steady], 1.2 * plain[steady], rtol=0.01)


def test_reversals_of_the_reference_are_found_also_across_rest():
    time = np.arange(100.0)
    velocity = np.select([time < 20, time < 30, time < 60, time < 90], [1.0, 0.0, -1.0, 1.0], 0.0)
    near = near_reversals(time, velocity)
    assert list(np.flatnonzero(near)) == [21, 22, 23, 24, 25, 26, 27, 28, 56, 57, 58, 59, 60, 61, 62, 63]


def test_reference_that_does_not_reverse_is_rejected():
    with pytest.raises(ValueError, match='reverses 0 times'):
        near_reversals(TIME, np.ones(len(TIME)))


def test_tuning_takes_the_scale_and_most_of_the_friction():
    found = tune_recorded_axis(recording(noise=1.0), SETTINGS, KNOWN)
    assert found.feedforward.scale == 0.8
    assert found.identified == {
        'force_limit': True, 'scale': True, 'lead_time': False, 'smoothing_velocity': True, 'slew_limit': True
    }  # fmt: skip
    assert found.without.sliding == pytest.approx(32.0, rel=0.05)
    assert found.nominal.sliding < 0.1 * found.without.sliding
    assert found.nominal.reversal < 0.25 * found.without.reversal
    assert found.better_in_every_case


def test_wrong_model_leaves_its_share():
    found = tune_recorded_axis(recording(), SETTINGS, KNOWN)
    for case in found.cases:
        if case.friction_error:
            assert case.outcome.sliding == pytest.approx(0.3 * found.without.sliding, rel=0.15)
    assert len(found.cases) == 9


def test_smoothing_follows_the_seal():
    """A seal whose friction rises over a speed wants a feed-forward that does."""
    sharp = tune_recorded_axis(recording(), SETTINGS, KNOWN).feedforward.smoothing_velocity
    soft = tune_recorded_axis(recording(width=0.008), SETTINGS, KNOWN).feedforward.smoothing_velocity
    assert sharp < 0.002
    assert soft == pytest.approx(0.008, rel=0.5)


def test_fast_rod_cannot_tell_the_smoothing_and_keeps_it():
    velocity = 0.03 * np.sign(np.cos(4.0 * math.pi * TIME)) * (1.0 + 0.2 * np.sin(40.0 * TIME))
    found = tune_recorded_axis(recording(velocity=velocity, mass=0.0), SETTINGS, KNOWN)
    assert not found.identified['smoothing_velocity']  # never slower than 24 mm/s
    assert found.feedforward.smoothing_velocity == SETTINGS.smoothing_velocity


def test_given_delay_is_the_lead_time_and_else_it_stays():
    assert tune_recorded_axis(recording(), SETTINGS, KNOWN).feedforward.lead_time == SETTINGS.lead_time
    found = tune_recorded_axis(recording(), SETTINGS, RecordedAxisSettings(whole_delay=0.007))
    assert found.feedforward.lead_time == 0.007
    assert found.identified['lead_time']


def test_friction_against_the_model_is_not_taken_for_a_scale():
    found = tune_recorded_axis(recording(scale=-0.5), SETTINGS, KNOWN)
    assert not found.identified['scale']
    assert found.feedforward.scale == SETTINGS.scale
    assert not found.better_in_every_case


def test_delayed_force_comes_later():
    force = np.arange(5.0)
    np.testing.assert_allclose(delayed(np.arange(5.0), force, 1.5), [0.0, 0.0, 0.5, 1.5, 2.5])


def test_force_limit_follows_the_friction_and_cuts_nothing():
    pressure_part = (275.0 + 55.0 * np.sin(2.0 * TIME)) / (1.0 + 0.1 * np.sin(3.0 * TIME))  # 220 to 330 N in all
    made = recording(scale=1.0, coulomb=pressure_part, noise=3.0)
    found = tune_recorded_axis(made, SETTINGS, KNOWN)
    assert found.largest_friction == pytest.approx(330.0, rel=0.02)
    assert found.feedforward.force_limit == pytest.approx(500.0, rel=0.03)
    assert found.identified['force_limit']
    free = feedforward_force(dataclasses.replace(found.feedforward, force_limit=1e6), made, 0.3)
    np.testing.assert_array_equal(feedforward_force(found.feedforward, made, 0.3), free)
    assert np.abs(free).max() > 400.0
    assert found.nominal.sliding < 0.2 * found.without.sliding


def test_force_limit_falls_with_the_friction_and_a_peak_of_noise_does_not_raise_it():
    made = recording(coulomb=40.0, scale=1.0)
    force = made.force_sum.copy()
    force[300] += 1000.0
    for each in (made, made._replace(force_sum=force)):
        limit = tune_recorded_axis(each, SETTINGS, KNOWN).feedforward.force_limit
        assert FORCE_MARGIN * 40.0 <= limit <= FORCE_MARGIN * 50.0 < SETTINGS.force_limit


def test_time_counts_from_the_first_sample_to_the_nanosecond_with_stamps_since_1970():
    made = recording()
    start = 1_700_000_000_123_456_789  # [ns]
    later = made._replace(stamps=made.stamps + start)
    np.testing.assert_allclose(later.time, TIME, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize('count', [9, 10, 11, 12])
def test_an_acceleration_takes_eleven_samples(count):
    slope = acceleration(TIME[:count], 3.0 * TIME[:count])
    assert np.count_nonzero(np.isfinite(slope)) == max(count - 10, 0)
    assert slope[5 : count - 5] == pytest.approx(3.0)


@pytest.mark.parametrize(('share', 'counts'), [(0.7, False), (1.4, True)])
def test_a_change_of_a_billionth_of_the_speed_in_a_sample_is_an_acceleration(share, counts):
    slope = share * 1e-9 * 0.1 * RATE  # [m/s2] at 0.1 m/s
    found = acceleration(TIME, 0.1 - slope * TIME)[5:-5]
    np.testing.assert_allclose(found, -slope if counts else 0.0, rtol=0.1, atol=0.0)


def test_every_reversal_has_its_neighbourhood_of_a_tenth_of_the_usual_time_between_two():
    """Reversals at 20, 50, 60 and 90 s and 30 s between them in the median: 3 s before and after each."""
    time = np.arange(120.0) + 0.5
    velocity = np.select([time < 20.0, time < 50.0, time < 60.0, time < 90.0], [1.0, -1.0, 1.0, -1.0], 1.0)
    expected = np.any([np.abs(time - moment) <= 3.0 for moment in (20.0, 50.0, 60.0, 90.0)], axis=0)
    np.testing.assert_array_equal(near_reversals(time, velocity), expected)
    np.testing.assert_array_equal(near_reversals(time, -velocity), expected)
    with pytest.raises(ValueError, match='reverses 1 times'):
        near_reversals(time[:40], velocity[:40])


def test_a_force_that_is_not_measured_does_not_count():
    made = recording()
    sliding = np.flatnonzero(fit_law(made).sliding)
    force = made.force_sum.copy()
    force[sliding[::3]] = math.nan
    law = fit_law(made._replace(force_sum=force))
    assert np.count_nonzero(law.sliding) == len(sliding) - len(sliding[::3])
    assert (law.scale, law.mass, law.offset) == pytest.approx((0.8, 5.0, 3.0), rel=3e-3)
    assert np.isnan(law.friction[sliding[::3]]).all()


def test_a_seal_without_friction_has_no_scale():
    with pytest.raises(ValueError, match='cannot be separated'):
        fit_law(recording(coulomb=0.0))


def test_the_deviation_of_the_scale_is_that_of_least_squares():
    """Text book: sigma^2 (X'X)^-1 with sigma^2 the squares left over n - 3, here of 100 samples."""
    made = recording(noise=5.0)
    places = np.flatnonzero(fit_law(made).sliding)
    made = only(made, np.isin(np.arange(len(TIME)), places[:: len(places) // 100][:100]))
    law = fit_law(made)
    inputs = np.column_stack([made.coulomb_friction * np.sign(made.velocity), acceleration(TIME, made.velocity)])
    inputs = np.column_stack([inputs, np.ones(len(TIME))])[law.sliding]
    solution, squares, *_ = np.linalg.lstsq(inputs, made.force_sum[law.sliding], rcond=None)
    assert (law.scale, law.mass, law.offset) == pytest.approx(solution)
    assert law.scale_std == pytest.approx(math.sqrt(squares[0] / 97.0 * np.linalg.inv(inputs.T @ inputs)[0, 0]))


def shuttle(speed, friction=20.0, noise=0.0, slow=0):
    """A rod at ``speed`` to and fro, always sliding, with an exact law and noise of alternating sign.

    Of 100 samples ``slow`` are at 1 nm/s.
    """
    made = recording(coulomb=0.0)
    number = np.arange(len(TIME))
    velocity = np.where(number // 250 % 2, -speed, speed)
    velocity = np.where(number % 100 >= slow, velocity, 1e-9 * np.sign(velocity))
    scatter = noise * np.where(np.arange(len(TIME)) // 2 % 2, -1.0, 1.0)
    return made._replace(
        coulomb_friction=np.full(len(TIME), friction),
        state=np.full(len(TIME), int(FrictionState.SLIDING)),
        velocity=velocity,
        reference_velocity=velocity,
        reference_acceleration=np.zeros(len(TIME)),
        force_sum=friction * np.sign(velocity) + scatter,
    )


def smoothing(made):
    """Identified smoothing [m/s] of a rod almost without mass; None if it is not identified."""
    found = tune_recorded_axis(made, SETTINGS, RecordedAxisSettings(mass=1e-9))
    return found.feedforward.smoothing_velocity if found.identified['smoothing_velocity'] else None


@pytest.mark.parametrize(
    ('speed', 'noise', 'width'),
    [
        (0.02, 0.0, 0.01),  # 1 - tanh(v / w) = 5 % at w = 0.0109 m/s; preferred 0.01, 0.0125
        (0.024, 40.0, 0.016),  # 5 % of 44.7 N besides the noise are 11 % of 20 N: w = 0.0170 m/s; 0.016, 0.02
        (2.1e-5, 0.0, 1e-5),  # the sharpest of all: w = 0.0115 mm/s
    ],
)
def test_the_smoothing_costs_a_twentieth_of_the_friction_and_the_next_wider_one_more(speed, noise, width):
    assert smoothing(shuttle(speed, noise=noise, slow=2)) == width


@pytest.mark.parametrize(('slow', 'width'), [(0, None), (1, None), (2, 0.01)])
def test_a_smoothing_is_known_only_where_a_hundredth_of_the_motion_was_slower(slow, width):
    assert smoothing(shuttle(0.02, slow=slow)) == width


@pytest.mark.parametrize(('speed', 'noise'), [(1e-6, 0.0), (0.02, 400.0)])
def test_a_rod_slower_than_any_smoothing_or_mostly_noise_tells_no_smoothing(speed, noise):
    assert smoothing(shuttle(speed, noise=noise)) is None


def test_a_recording_that_is_mostly_noise_leaves_smoothing_and_slew_limit():
    found = tune_recorded_axis(shuttle(0.02, noise=400.0), SETTINGS, RecordedAxisSettings(mass=5.0))
    assert not found.identified['smoothing_velocity']
    assert not found.identified['slew_limit']
    assert found.feedforward.smoothing_velocity == SETTINGS.smoothing_velocity
    assert found.feedforward.slew_limit == SETTINGS.slew_limit


def test_the_next_lower_slew_limit_costs_more_than_a_twentieth_of_the_force():
    made = recording()
    often = np.repeat(np.arange(len(TIME)), np.where(np.arange(len(TIME)) % 50 == 0, 2, 1))  # stamps that come twice
    twice = Recording(*(column[often] for column in made[:-1]))
    for each in (made, twice):
        found = tune_recorded_axis(each, SETTINGS, KNOWN).feedforward
        free = feedforward_force(dataclasses.replace(found, slew_limit=1e9), each)
        for index, enough in ((0, True), (-1, False)):
            slew = preferred(nearest_preferred(found.slew_limit) + index)
            lost = feedforward_force(dataclasses.replace(found, slew_limit=slew), each) - free
            assert bool(np.mean(lost**2) <= 0.05**2 * np.mean(free**2)) is enough


def test_a_reference_that_is_always_late_tells_no_slew_limit():
    made = recording()
    late = made._replace(reference_age=np.ones(len(TIME)))
    assert not tune_recorded_axis(late, SETTINGS, KNOWN).identified['slew_limit']


def test_a_force_by_the_measured_velocity_does_not_follow_the_reference():
    made = recording()
    backwards = made._replace(velocity=-made.velocity)
    settings = dataclasses.replace(SETTINGS, use_measured_velocity=True, lead_time=0.0)
    by_reference = dataclasses.replace(settings, use_measured_velocity=False)
    assert np.abs(feedforward_force(settings, backwards)).max() > 30.0
    np.testing.assert_array_equal(feedforward_force(settings, backwards), -feedforward_force(by_reference, made))


def test_cases_are_friction_then_delay_and_a_late_force_leaves_more_friction():
    """A whole delay of 20 ms that is a fifth longer or shorter shifts the force by 4 ms to one side or the other."""
    known = RecordedAxisSettings(whole_delay=0.02, mass=5.0)
    made = recording()
    found = tune_recorded_axis(made, SETTINGS, known)
    assert (found.law.mass, found.law.mass_is_fitted) == (5.0, False)
    errors = [case[:2] for case in found.cases]
    assert errors == [(f, d) for f in (-0.3, 0.0, 0.3) for d in (-0.2, 0.0, 0.2)]
    for friction, lateness, outcome in found.cases:
        force = feedforward_force(found.feedforward, made, friction)
        acting = np.interp(TIME - 0.02 - 0.02 * lateness, TIME, force, left=0.0)
        left = (found.law.friction - acting)[found.law.sliding]
        assert outcome.sliding == pytest.approx(math.sqrt(np.mean(left**2)))
    early, nominal, late = (case.outcome.sliding for case in found.cases[3:6])
    assert early < nominal < late  # the force never leads the reference through a reversal
    assert found.nominal.sliding == nominal
    np.testing.assert_allclose(found.force[10:], feedforward_force(found.feedforward, made)[:-10], atol=1e-9)
    assert not found.force[:10].any()
    fast = np.abs(made.velocity) > 0.02
    assert (np.sign(found.force) == np.sign(made.velocity))[fast][20:].all()  # led by the delay, it acts in time
