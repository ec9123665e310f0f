"""Elasticity from reversals: recovered from noise, scored on reversals kept back, refused where it is not told."""

from itertools import pairwise

import numpy as np
import pytest

from seal_friction_ros.core.friction.presliding import (
    NO_ELEMENTS,
    NOT_SHEARED,
    Presliding,
    Slide,
    element_forces,
    presliding_numbers,
    shear,
)
from seal_friction_ros.core.identification.presliding_fit import (
    PreslidingFit,
    PreslidingRefusedError,
    ReversalCurve,
    ReversalLog,
    fit_curves,
    fit_presliding,
    friction_after_reversal,
    half_stroke,
    position_noise,
    reversal_curves,
    score_presliding,
    smoothed_position,
    turning_points,
)

FRICTION, OFFSET = 20.0, -1.5  # [N]
SPEED = 32e-3  # [m/s]


def strokes(periods=8, rests=(0.0,)):
    """Time [s] and position [m] of strokes of 16 mm at 1 kHz, with these rests [s] at the ends, in turn."""
    step, parts, place = 1e-3 * SPEED, [], -8e-3
    for half in range(2 * periods):
        way = np.arange(1, 501) * step * (1 if half % 2 == 0 else -1)
        parts += [place + way, np.full(round(1e3 * rests[half % len(rests)]), place + way[-1])]
        place += way[-1]
    position = np.concatenate(parts)
    return 1e-3 * np.arange(len(position)), position


def log(seals, noise=0.3, step=0.0, periods=8, friction=FRICTION, offset=OFFSET):
    """Log of seals of unlike elasticity, with sensor noise and steps of the position."""
    rng = np.random.default_rng(7)
    time, position = strokes(periods)
    force = np.full(len(position), offset) + noise * rng.normal(size=len(position))
    for seal in seals:
        numbers, forces, last = presliding_numbers([seal]), NO_ELEMENTS, position[0]
        for i, x in enumerate(position.tolist()):
            forces, acting = element_forces(numbers, forces, x - last, friction / len(seals))
            force[i] += acting
            last = x
    measured = step * np.round(position / step) if step else position + 1e-6 * rng.normal(size=len(position))
    return ReversalLog('log', time, measured, force)


@pytest.mark.parametrize(('stiffness', 'exponent'), [(1e5, 1.0), (4e5, 0.5), (1e5, 3.0)])
def test_stiffness_and_exponent_are_found_within_their_standard_errors(stiffness, exponent):
    fit = fit_presliding([log([Presliding(stiffness=stiffness, yield_exponent=exponent)])])
    miss = np.log(fit.presliding.stiffness / stiffness)
    assert miss == pytest.approx(0.0, abs=4.0 * fit.presliding.relative_std + 0.03)
    assert fit.presliding.yield_exponent == pytest.approx(exponent, abs=4.0 * fit.yield_exponent_std + 0.1)
    assert fit.friction == pytest.approx([FRICTION], abs=0.3)
    assert fit.offset == pytest.approx([OFFSET], abs=0.3)
    assert fit.presliding.relative_std < 0.2
    assert fit.presliding.memory_length == fit.presliding.dwell_time == 0.0  # there is none


def test_friction_that_rises_over_the_whole_stroke_is_no_memory_length():
    plain = log([Presliding(stiffness=1.5e5)])
    outwards = np.sign(np.gradient(np.round(plain.position, 5)))
    rising = 0.3 * FRICTION * outwards * (1.0 + outwards * plain.position / 8e-3)  # up to 60 % at the end of a stroke
    fit = fit_presliding([plain._replace(force_sum=plain.force_sum + rising)])
    assert 4.0 * fit.presliding.memory_length <= fit.length
    assert fit.presliding.stiffness == pytest.approx(1.5e5, rel=0.25)


def test_logs_at_several_pressures_share_the_elasticity():
    seal = Presliding(stiffness=2e5, yield_exponent=1.5)
    fit = fit_presliding([log([seal]), log([seal], friction=35.0, offset=4.0)])
    assert fit.friction == pytest.approx([FRICTION, 35.0], abs=0.3)
    assert fit.offset == pytest.approx([OFFSET, 4.0], abs=0.3)
    assert fit.presliding.stiffness == pytest.approx(2e5, rel=4.0 * fit.presliding.relative_std + 0.03)


def test_reversals_kept_back_of_two_seals_unlike_each_other_are_predicted_better_than_by_rigid_seals():
    made = [log([Presliding(stiffness=3e5, yield_exponent=0.5), Presliding(stiffness=6e4, yield_exponent=2.0)])]
    fit = fit_presliding(made)
    score = score_presliding(made, fit.length, 1e-3)
    assert score.reversals >= 6
    assert score.elastic < 0.15 * score.rigid
    assert score.elastic > score.repeatability  # one exponent does not hold two unlike seals


def test_lag_and_dwell_are_found_where_the_rests_tell_them():
    seal = Presliding(stiffness=2e5, memory_length=3e-4, dwell_time=0.5)
    numbers, state, rng = presliding_numbers([seal]), NOT_SHEARED, np.random.default_rng(2)
    time, position = strokes(periods=16, rests=(0.05, 2.0, 0.5))
    force = []
    for displacement in np.diff(position, prepend=position[0]).tolist():
        state, acting = shear(numbers, state, Slide(displacement, 1e-3, FRICTION, 0.0, 6.0))
        force.append(acting)
    noise = rng.normal(size=(2, len(force)))
    fit = fit_presliding([ReversalLog('log', time, position + 1e-6 * noise[0], np.array(force) + 0.2 * noise[1])])
    assert fit.excess == pytest.approx(0.3, abs=0.06)
    assert fit.presliding.memory_length == pytest.approx(3e-4, rel=0.25)
    assert fit.presliding.dwell_time == pytest.approx(0.5, rel=0.35)
    assert fit.relative_dwell_time_std < 0.3
    assert fit.presliding.stiffness == pytest.approx(2e5, rel=0.1)
    assert fit.length == pytest.approx(2.5 * fit.full_yield + 4.0 * 3e-4, rel=0.15)


def test_friction_after_a_reversal_is_that_of_the_elements():
    numbers = presliding_numbers([Presliding(stiffness=1e5, yield_exponent=2.0)])
    forces, _ = element_forces(numbers, NO_ELEMENTS, -1.0, FRICTION)
    way = np.linspace(0.0, 2e-3, 50)
    expected = [element_forces(numbers, forces, s, FRICTION)[1] for s in way.tolist()]
    shared = np.array([np.log(1e5), 2.0, 0.0, 0.0, -np.inf])
    np.testing.assert_allclose(friction_after_reversal(shared, way, FRICTION, 0.0), expected, atol=1e-9)


@pytest.mark.parametrize('rest', [0.0, 0.3, 5.0])
@pytest.mark.parametrize('exponent', [0.0, 1.5])
def test_after_a_rest_stiction_has_grown_and_falls_over_the_memory_length(rest, exponent):
    """The same as a seal that slid, rested and is drawn back without loss of time."""
    length, dwell, stiction = 3e-4, 0.5, 6.0
    seal = Presliding(stiffness=1e5, yield_exponent=exponent, memory_length=length, dwell_time=dwell)
    numbers = presliding_numbers([seal])
    state, _ = shear(numbers, NOT_SHEARED, Slide(-1.0, 1.0, FRICTION, 0.0, stiction))
    state, _ = shear(numbers, state, Slide(0.0, rest, FRICTION, 0.0, stiction))
    way, expected = np.arange(1, 2001) * 1e-6, []
    for _ in way:
        state, force = shear(numbers, state, Slide(1e-6, 0.0, FRICTION, 0.0, stiction))
        expected.append(force)
    shared = np.array([np.log(1e5), exponent, stiction / FRICTION, np.log(length), np.log(dwell)])
    found = friction_after_reversal(shared, way, FRICTION, rest)
    np.testing.assert_allclose(found, expected, atol=0.05)  # [N] of 26: the step of the walk
    at_once = friction_after_reversal(np.array([*shared[:4], -np.inf]), way, FRICTION, rest)
    grown = friction_after_reversal(shared, way, FRICTION, 1e3)
    np.testing.assert_allclose(at_once, grown, atol=1e-6)


def test_friction_that_rises_with_the_speed_is_lower_where_the_rod_turns():
    """Excess below zero: at the reversal 14 N, after some memory lengths 20 N again."""
    shared = np.array([np.log(1e5), 0.0, -0.3, np.log(3e-4), -np.inf])
    way = np.array([0.0, 1e-4, 2.8e-4, 2.8e-4 + 3e-4, 1e-2])
    found = friction_after_reversal(shared, way, FRICTION, 0.0)
    slid = 2.8e-4 + 3e-4 - 2.0 * 14.0 / 1e5
    expected = [-14.0, -4.0, 14.0, 20.0 - 6.0 * np.exp(-slid / 3e-4), 20.0]
    assert found == pytest.approx(expected, abs=1e-6)


def test_a_position_turns_where_it_comes_back_by_more_than_the_threshold():
    position = np.array([0.0, 1.0, 3.0, 2.0, 4.0, 2.9, 1.0, -2.0, -1.0, -2.5, 0.0])
    assert turning_points(position, 1.2) == [0, 4, 9, 10]
    assert turning_points(position, 0.9) == [0, 2, 3, 4, 7, 8, 9, 10]
    assert turning_points(position, 1.0) == [0, 4, 9, 10]  # by more, not by as much
    assert turning_points(-position, 1.2) == [0, 4, 9, 10]
    assert turning_points(np.zeros(5), 0.1) == [0, 4]


def test_a_curve_begins_where_the_rod_turns_and_knows_how_long_it_rested():
    time, position = strokes(periods=3, rests=(0.05, 2.0))
    force = 1e3 * position
    curves = reversal_curves([ReversalLog('log', time, position, force)], 1e-3)
    assert [curve.direction for curve in curves] == [-1, 1, -1, 1, -1]
    assert [curve.rest for curve in curves] == pytest.approx(
        [0.057, 2.007, 0.057, 2.007, 0.057], abs=2e-3
    )  # with four steps about it
    ends = [8.0 if curve.direction < 0 else -8.0 for curve in curves]
    for curve, end in zip(curves, ends, strict=True):
        assert curve.log == 0
        assert curve.displacement[0] <= 3.2e-5 < curve.displacement[1]  # of the rest one sample
        assert curve.displacement[-1] == pytest.approx(1e-3, abs=5e-5)
        assert curve.friction[0] == pytest.approx(end, abs=0.05)
        assert len(curve.up_to(5e-4).displacement) == pytest.approx(0.5 * len(curve.displacement), abs=2)


def test_the_noise_of_a_position_is_its_step_or_its_standard_deviation():
    rng = np.random.default_rng(1)
    ramp = np.linspace(0.0, 0.1, 20_000)
    assert position_noise(np.round(ramp / 5e-5) * 5e-5) == pytest.approx(5e-5, rel=1e-6)
    assert position_noise(ramp + 4e-5 * rng.normal(size=len(ramp))) == pytest.approx(4e-5, rel=0.05)


def test_a_log_that_does_not_tell_is_refused():
    with pytest.raises(PreslidingRefusedError, match='too coarse for seals that slide after'):
        fit_presliding([log([Presliding(stiffness=1e6)], step=2e-5)])
    with pytest.raises(PreslidingRefusedError, match='record more strokes'):
        fit_presliding([log([Presliding(stiffness=1e5)], periods=2)])
    told = log([Presliding(stiffness=1e5)])
    with pytest.raises(PreslidingRefusedError, match='check signs'):
        fit_presliding([told._replace(force_sum=-told.force_sum)])
    noise = np.random.default_rng(3).normal(size=len(told.time))
    with pytest.raises(PreslidingRefusedError, match='record slower reversals'):
        fit_presliding([told._replace(force_sum=np.sign(told.force_sum) + 40.0 * noise)])


def test_a_short_way_back_within_a_stroke_is_no_reversal():
    time, position = strokes(periods=2)
    position[700:720] = position[700] + np.concatenate((np.linspace(0.0, 3e-4, 10), np.linspace(3e-4, 0.0, 10)))
    curves = reversal_curves([ReversalLog('log', time, position, np.zeros(len(time)))], 1e-3)
    assert [curve.direction for curve in curves] == [-1, 1, -1]


# --- from a log to its curves ---


def test_a_position_of_coarse_steps_repeats_itself_more_than_twice():
    steps = 1e-5 * np.arange(20.0)
    assert position_noise(np.repeat(steps, 3)) == pytest.approx(1e-5)
    # Two samples a step may be noise: that of second differences of one step, of white noise sqrt(6) of it.
    assert position_noise(np.repeat(steps, 2)) == pytest.approx(1e-5 / 0.6745 / np.sqrt(6.0))
    assert position_noise(np.array([0.0, 5.0])) == 0.0
    assert position_noise(np.array([0.0, 0.0, 3.0])) == pytest.approx(3.0 / 0.6745 / np.sqrt(6.0))
    assert position_noise(np.full(9, 0.3)) == 0.0


def test_a_position_is_smoothed_over_the_way_of_twice_its_noise():
    zigzag = np.arange(301.0) % 2
    assert smoothed_position(zigzag, 0.4) == pytest.approx(zigzag)  # one sample is enough
    assert smoothed_position(zigzag, 1.0)[100:102] == pytest.approx([2.0 / 3.0, 1.0 / 3.0])
    assert smoothed_position(zigzag, 2.0)[100:102] == pytest.approx([2.0 / 5.0, 3.0 / 5.0])
    assert smoothed_position(zigzag, 99.0)[150:152] == pytest.approx([50.0 / 101.0, 51.0 / 101.0], abs=0.02)
    assert smoothed_position(zigzag, 99.0)[150] != pytest.approx(0.5, abs=1e-3)  # over no more than 101 samples
    assert smoothed_position(np.full(5, 2.0), 1.0).tolist() == [2.0] * 5
    assert smoothed_position(np.array([2.0]), 1.0).tolist() == [2.0]


def saw(*ends, step=1e-5):
    """Position [m] from end to end [mm] in even steps."""
    parts = [np.array([1e-3 * ends[0]])]
    for start, end in pairwise(ends):
        count = round(abs(end - start) * 1e-3 / step)
        parts.append(1e-3 * start + np.sign(end - start) * step * np.arange(1, count + 1))
    return np.round(np.concatenate(parts), 9)


@pytest.mark.parametrize(('way', 'counts'), [(1.49, 0), (1.51, 1)])
def test_a_curve_takes_a_way_of_one_and_a_half_lengths_before_it_and_more_than_a_length_after_it(way, counts):
    position = saw(0.0, way, way - 1.02)
    made = ReversalLog('log', 1e-3 * np.arange(len(position)), position, 1e4 * position)
    still = made._replace(time=made.time[:3], position=made.position[:3], force_sum=made.force_sum[:3])
    found = reversal_curves([still, made], 1e-3)
    assert [(curve.log, curve.direction) for curve in found] == [(1, -1)] * counts
    for curve in found:
        assert curve.friction == pytest.approx(1e4 * (1e-3 * way - curve.displacement), abs=0.11)  # of a step
        assert np.diff(curve.displacement[3:]) == pytest.approx(np.full(len(curve.displacement) - 4, 1e-5))
        assert curve.displacement[-1] == pytest.approx(1e-3, abs=1.1e-5)
    short = saw(0.0, way, way - 0.98)
    assert reversal_curves([ReversalLog('log', 1e-3 * np.arange(len(short)), short, short)], 1e-3) == []


def test_a_reversal_is_a_way_back_of_a_tenth_of_the_length_and_eight_times_the_noise():
    for back, step, counts in ((0.09, 1e-6, 1), (0.11, 1e-6, 0), (0.14, 2e-5, 1), (0.19, 2e-5, 0)):
        # At 1 mm of 1.6 mm the rod comes back: a reversal there leaves too short a way to the next one.
        position = saw(0.0, 1.0, 1.0 - back, 1.6, 0.0, step=step)
        found = reversal_curves([ReversalLog('log', 1e-3 * np.arange(len(position)), position, position)], 1e-3)
        assert len(found) == counts, (back, step)


def curve(displacement, friction, log=0, direction=1, rest=0.0):
    return ReversalCurve(log, direction, rest, np.asarray(displacement, float), np.asarray(friction, float))


def test_readings_up_to_a_displacement_hold_it():
    found = curve([0.0, 1.0, 2.0, 3.0], [5.0, 6.0, 7.0, 8.0], rest=4.0).up_to(2.0)
    assert (found.displacement.tolist(), found.friction.tolist()) == ([0.0, 1.0, 2.0], [5.0, 6.0, 7.0])
    assert (found.log, found.direction, found.rest) == (0, 1, 4.0)


def test_the_way_to_sliding_is_that_of_the_last_element():
    for exponent, share in ((0.0, 2.0), (1.0, 2.0 * 5.5 / 3.0)):  # six elements; the last has 5.5 of 18 parts
        seal = Presliding(stiffness=1e5, yield_exponent=exponent)
        fit = PreslidingFit(seal, (15.0, 25.0), (0.0, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 8, 1e-3)
        last = share * 20.0 / 1e5  # at the mean friction of both logs
        assert fit.full_yield == pytest.approx(last)
        shared = np.array([np.log(1e5), exponent, 0.0, 0.0, -np.inf])
        around = friction_after_reversal(shared, np.array([0.99, 1.0]) * last, 20.0, 0.0)
        assert around[0] < 19.99 < around[1] == pytest.approx(20.0)


def test_curves_of_one_kind_or_with_wrong_signs_at_their_ends_are_refused():
    """The median of the last fifth counts, whatever came before; then that of the reversals."""
    way = np.linspace(0.0, 1e-3, 11)

    def ending(end, direction):
        return curve(way, [*[99.0] * 8, end - 1.0, end, end + 50.0], direction=direction)

    for one_kind, counts in (([ending(18.0, 1)] * 4, '4 and 0'), ([ending(-24.0, -1)] * 4, '0 and 4')):
        with pytest.raises(PreslidingRefusedError, match=counts):
            fit_curves([*one_kind, curve([], [])], ['log'], 1e-3)
    for out, back in ((-22.0, 18.0), (3.0, 3.0)):
        with pytest.raises(PreslidingRefusedError, match='check signs'):
            fit_curves([ending(out, 1), ending(back, -1)] * 2, ['log'], 1e-3)


def test_curves_are_tried_up_to_half_of_the_median_stroke_of_the_shortest_log():
    def of(*positions):
        return [ReversalLog(f'{i}', np.arange(len(x)), x, x) for i, x in enumerate(positions)]

    strokes_ = saw(0.0, 9.0, 1.0, 5.0, 3.0, 9.0)  # ways of 9, 8, 4, 2 and 6 mm: the first and the last do not count
    assert half_stroke(of(strokes_)) == pytest.approx(2e-3, rel=0.01)
    assert half_stroke(of(strokes_, saw(0.0, 9.0, 8.0, 9.0))) == pytest.approx(0.5e-3, rel=0.02)
    for back, half in ((0.8, 4.5), (1.0, 0.5)):  # of 9 mm: from a tenth on it is a stroke
        assert half_stroke(of(saw(0.0, 9.0, 0.0, *[9.0, 9.0 - back] * 3, 9.0))) == pytest.approx(1e-3 * half, rel=0.12)
    with pytest.raises(PreslidingRefusedError, match=r'^0: 1 reversals, but 8 are needed'):
        half_stroke(of(saw(0.0, 9.0, 0.0)))
    with pytest.raises(PreslidingRefusedError, match=r'^0: 0 reversals, but 8 are needed'):
        half_stroke(of(np.zeros(20)))


# --- the fit ---


def curves_of(parameters, rests, friction=(FRICTION,), offset=(OFFSET,), length=3e-3, noise=0.0):
    """Curves of each log out and back at each rest, by the equation."""
    rng, way, made = np.random.default_rng(4), np.linspace(0.0, length, 120), []
    for number, (f, o) in enumerate(zip(friction, offset, strict=True)):
        for rest in rests:
            for direction in (1, -1):
                acting = direction * friction_after_reversal(np.asarray(parameters), way, f, rest) + o
                made.append(curve(way, acting + noise * rng.normal(size=120), number, direction, rest))
    return made


@pytest.mark.parametrize('reversals', [8, pytest.param(26, marks=pytest.mark.long)])
def test_standard_errors_are_those_of_the_jackknife_over_twenty_groups_of_reversals_at_most(reversals):
    """Stiffness and exponent, fitted without each group. The errors are to first order."""
    made = curves_of((np.log(2e5), 1.0, 0.0, 0.0, -np.inf), (0.1,) * (reversals // 2), noise=0.02)
    fit, groups = fit_curves(made, ['log'], 3e-3), min(reversals, 20)
    left = [[one for i, one in enumerate(made) if i % groups != number] for number in range(groups)]
    without = [fit_curves(some, ['log'], 3e-3) for some in left]
    values = [(np.log(one.presliding.stiffness), one.presliding.yield_exponent) for one in without]
    errors = np.sqrt((groups - 1) * np.var(values, axis=0))
    assert (fit.presliding.relative_std, fit.yield_exponent_std) == pytest.approx(tuple(errors), rel=0.05)
    assert np.isnan([fit.relative_memory_length_std, fit.relative_dwell_time_std]).all()


LAG = (np.log(2e5), 1.0, 0.4, np.log(3e-4), np.log(1.0))


def test_curves_made_by_the_equation_give_its_parameters_back():
    made = curves_of(LAG, (0.3, 0.6, 1.5, 4.0), friction=(20.0, 35.0), offset=(-1.5, 4.0), noise=0.02)
    fit = fit_curves(made, ['one', 'other'], 3e-3)
    found = fit.presliding
    assert (found.stiffness, found.yield_exponent) == pytest.approx((2e5, 1.0), rel=0.01)
    assert (fit.excess, found.memory_length, found.dwell_time) == pytest.approx((0.4, 3e-4, 1.0), rel=0.02)
    assert (fit.friction, fit.offset) == (pytest.approx((20.0, 35.0), abs=0.02), pytest.approx((-1.5, 4.0), abs=0.02))
    assert (fit.reversals, fit.length) == (16, 3e-3)
    assert fit.rms == pytest.approx(0.02, rel=0.05)
    assert 0.0 < fit.presliding.relative_std == found.relative_std < 0.01
    errors = fit.yield_exponent_std, fit.relative_memory_length_std, fit.relative_dwell_time_std
    assert 0.0 < min(errors) < max(errors) < 0.02


def test_four_reversals_of_each_log_are_needed():
    made = curves_of((np.log(2e5), 1.0, 0.0, 0.0, -np.inf), (0.1, 0.1), noise=0.02)
    assert fit_curves(made, ['log'], 3e-3).reversals == 4
    with pytest.raises(PreslidingRefusedError, match=r'^log: 2 and 1 reversals out and back .* but 4 are needed'):
        fit_curves(made[:3], ['log'], 3e-3)


@pytest.mark.parametrize(('longer', 'told'), [(2.9, False), (3.1, True)])
def test_a_dwell_time_is_told_where_the_rests_differ_three_times(longer, told):
    fit = fit_curves(curves_of(LAG, (0.7, 0.7, 0.7 * longer, 0.7 * longer), noise=0.02), ['log'], 3e-3)
    assert (fit.presliding.dwell_time > 0.0) is told
    assert np.isfinite(fit.relative_dwell_time_std) == told
    assert fit.presliding.memory_length == pytest.approx(3e-4, rel=0.3)


@pytest.mark.parametrize(('length', 'told'), [(3e-3 / 4.2, True), (3e-3 / 3.8, False)])
def test_a_memory_length_is_told_where_a_curve_is_four_times_as_long(length, told):
    fit = fit_curves(
        curves_of((np.log(2e5), 1.0, -0.3, np.log(length), -np.inf), (0.1,) * 4, noise=0.005), ['log'], 3e-3
    )
    assert (fit.presliding.memory_length > 0.0) is told
    if told:
        assert (fit.excess, fit.presliding.memory_length) == pytest.approx((-0.3, length), rel=0.02)
    else:
        assert fit.excess == 0.0


def test_an_excess_that_takes_away_less_than_a_twentieth_of_the_squares_is_none():
    """The noise has 0.2 N; the excess fades over a short way, so that few readings hold it."""
    for excess, told in ((0.008, False), (0.016, True)):
        made = curves_of((np.log(2e5), 1.0, excess, np.log(2e-4), -np.inf), (0.1,) * 6, noise=0.2)
        fit = fit_curves(made, ['log'], 3e-3)
        assert (fit.excess != 0.0) is told
        assert np.isnan(fit.relative_memory_length_std) != told


# --- the score ---


def test_rigid_seals_miss_a_reversal_by_the_area_of_the_spring():
    """All elements yield at once: from -20 N with 1e5 N/m to 20 N within 0.4 mm, of 1 mm that count."""
    made = [log([Presliding(stiffness=1e5, yield_exponent=0.0)], noise=0.01, offset=-15.0)]
    score = score_presliding(made, 2e-3, 1e-3)
    assert score.rigid == pytest.approx(np.sqrt(40.0**3 / (3.0 * 1e5 * 1e-3)), rel=0.06)
    assert score.elastic < 0.5  # half a step of 32 um, which are 3.2 N, at the turn alone
    assert score.repeatability < 1.0
    assert score.within == 1e-3
    assert score.reversals == 7  # of 15, eight one way and seven the other: every second one


def test_repeatability_is_the_deviation_from_the_mean_at_equal_displacement():
    made = [log([Presliding(stiffness=1e5)]), log([Presliding(stiffness=1e5)], friction=30.0, offset=4.0)]
    grid, missed = np.linspace(0.0, 1e-3, 101), []
    curves = reversal_curves(made, 2e-3)
    for number, direction in ((0, -1), (0, 1), (1, -1), (1, 1)):
        own = [one for one in curves if (one.log, one.direction) == (number, direction)]
        mean = np.mean([np.interp(grid, one.displacement, one.friction) for one in own[::2]], axis=0)
        missed += [one.friction - np.interp(one.displacement, grid, mean) for one in (o.up_to(1e-3) for o in own[1::2])]
    rms = np.sqrt(np.mean(np.concatenate(missed) ** 2))
    assert score_presliding(made, 2e-3, 1e-3).repeatability == pytest.approx(rms, rel=1e-3)


@pytest.mark.parametrize(('step', 'told'), [(1.1e-4, True), (1.9e-4, False)])
def test_a_position_needs_five_steps_on_the_way_to_sliding(step, told):
    """The last of the elements slides after 0.73 mm: 5.5 of 18 parts of 40 N over a sixth of 1e5 N/m."""
    made = [log([Presliding(stiffness=1e5)], noise=0.05, step=step)]
    if told:
        assert fit_presliding(made).full_yield == pytest.approx(0.73e-3, rel=0.3)
    else:
        with pytest.raises(PreslidingRefusedError, match=r'steps or noise of the position of 0.00019 m are too coarse'):
            fit_presliding(made)


def test_curves_are_twenty_steps_long_of_the_coarsest_position():
    """Seals that slide after 0.29 mm would take 0.73 mm."""
    seal = Presliding(stiffness=2.5e5)
    alone = fit_presliding([log([seal])])
    assert alone.length == pytest.approx(2.5 * 0.293e-3, rel=0.1)
    both = fit_presliding([log([seal]), log([seal], step=4e-5)])
    assert both.length == pytest.approx(20.0 * 4e-5, rel=0.01)
