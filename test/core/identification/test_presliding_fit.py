"""Elasticity from reversals: recovered from noise, scored on reversals kept back, refused where it is not told."""

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
    PreslidingRefusedError,
    ReversalLog,
    fit_presliding,
    friction_after_reversal,
    position_noise,
    reversal_curves,
    score_presliding,
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
    assert miss == pytest.approx(0.0, abs=4.0 * fit.relative_stiffness_std + 0.03)
    assert fit.presliding.yield_exponent == pytest.approx(exponent, abs=4.0 * fit.yield_exponent_std + 0.1)
    assert fit.friction == pytest.approx([FRICTION], abs=0.3)
    assert fit.offset == pytest.approx([OFFSET], abs=0.3)
    assert fit.relative_stiffness_std < 0.2
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
    assert fit.presliding.stiffness == pytest.approx(2e5, rel=4.0 * fit.relative_stiffness_std + 0.03)


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
