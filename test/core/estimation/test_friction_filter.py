"""The filter is the Kalman filter of the books, and knows what a motion tells, and no more."""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.estimation.friction_filter import (
    ASYMMETRY_PRIOR,
    COULOMB_PRIOR,
    CURVED,
    DRIFT_MEMORY,
    DRIFT_TIME,
    FEWEST_OUTLIERS,
    GRADIENT_PRIOR,
    GRADIENT_WALK,
    LEAP,
    LEAST_NOISE,
    LEAST_STRAYED,
    LONGEST_STEP,
    MISFIT,
    MISFIT_RANGE,
    MOST_STRAYED,
    NOISE_TIME,
    NOT_BEGUN,
    OFFSET_PRIOR,
    OFFSET_WALK,
    OUTLIER,
    PROVEN,
    REMAINDER,
    REMAINDER_TIME,
    SCALE_PRIOR,
    SHORTEST_STROKE,
    STEP_READINGS,
    USUAL_TIME,
    VISCOUS_PRIOR,
    WALK,
    WRONG_DIRECTION,
    FrictionFilter,
    Reading,
    Terms,
    expected,
    friction_magnitude,
    updated,
)
from seal_friction_ros.core.messages.records import NEVER

SECOND = 1_000_000_000  # [ns]
INTERVAL = 0.02  # [s] between readings
FILE_STD = 0.08  # [-] of the friction
NAMES = Terms._fields


class Machine(NamedTuple):
    """A rod that moves to and fro, its law 1 share of friction at `frictions[0]`, and what the law does not say."""

    terms: Terms = Terms(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # the remainder is not used
    frictions: tuple[float, ...] = (40.0,)  # [N] of the law, one a pair of strokes
    misfits: tuple[float, ...] = (0.0,)  # [-] share of the friction that the law misses, likewise
    speeds: tuple[float, ...] = (0.05,)  # [m/s] likewise
    directions: tuple[int, ...] = (1, -1)
    stroke_time: float = 1.0  # [s]
    white: float = 0.02  # [-] share
    wavering: float = 0.02  # [-] share, within `REMAINDER_TIME`


def readings(machine: Machine, seconds: float, seed: int = 0, start: float = 0.0) -> Iterator[Reading]:
    """Readings of a machine."""
    rng, wavering, kept = np.random.default_rng(seed), 0.0, math.exp(-INTERVAL / REMAINDER_TIME)
    position = 0.0  # [m]
    for number in range(round(seconds / INTERVAL)):
        stroke = int(number * INTERVAL / machine.stroke_time + 1e-9)
        direction = machine.directions[stroke % len(machine.directions)]
        law = machine.frictions[stroke // 2 % len(machine.frictions)]
        misfit = law * machine.misfits[stroke // 2 % len(machine.misfits)]
        velocity = direction * machine.speeds[stroke // 2 % len(machine.speeds)]
        wavering = kept * wavering + math.sqrt(1.0 - kept * kept) * machine.wavering * rng.standard_normal()
        way = velocity * INTERVAL
        position += way
        scale, coulomb, viscous, asymmetry, offset, gradient, _, _ = machine.terms
        force = direction * (scale * law + coulomb + misfit) + viscous * velocity + asymmetry * law + offset
        force += gradient * position
        force += law * (wavering + machine.white * rng.standard_normal())
        stamp = round((start + number * INTERVAL) * SECOND)
        yield Reading(stamp, force, direction, velocity, way, law, FILE_STD * law)


def after(known: Iterable[Reading], state: FrictionFilter = NOT_BEGUN) -> FrictionFilter:
    for reading in known:
        state = updated(state, reading)
    return state


def magnitude(state: FrictionFilter, machine: Machine, direction: int) -> float:
    """Friction [N] by the filter."""
    return friction_magnitude(state.terms, direction, machine.speeds[0], machine.frictions[0])


def true_magnitude(machine: Machine, direction: int) -> float:
    return friction_magnitude(machine.terms, direction, machine.speeds[0], machine.frictions[0])


def matrix(state: FrictionFilter) -> np.ndarray:
    """Covariance."""
    upper = np.zeros((8, 8))
    upper[np.triu_indices(8)] = state.covariance
    return upper + np.triu(upper, 1).T


def stds(state: FrictionFilter) -> Terms:
    """Standard deviation of each term."""
    return Terms(*np.sqrt(np.diag(matrix(state))).tolist())


# --- the filter of the books ---


class Textbook:
    """A Kalman filter with matrices; a reading that is an outlier has a larger noise, a row of them frees the load."""

    def __init__(self, first: Reading) -> None:
        force = first.friction
        scale = math.hypot(SCALE_PRIOR, first.friction_std / force)
        shares = (COULOMB_PRIOR, VISCOUS_PRIOR)
        prior = [scale, *(share * force for share in shares), ASYMMETRY_PRIOR]
        prior += [share * force for share in (OFFSET_PRIOR, GRADIENT_PRIOR, REMAINDER, MISFIT)]
        self.stamp, self.noise, self.usual, self.number = first.stamp, LEAST_NOISE, force, 0
        self.direction, self.last, self.second, self.law = 0, 0.0, 0.0, force
        self.mean = self.settled = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        self.shown, self.stroke, self.longest, self.drift, self.drift_square = (
            SHORTEST_STROKE,
            0.0,
            SHORTEST_STROKE,
            0.0,
            0.0,
        )
        self.covariance, self.steps, self.friction_steps = np.diag(np.square(prior)), 0, 0
        self.strayed, self.gradient = 0.0, 0.0

    def predict(self, law: float, elapsed: float, moved: float, way: float) -> None:
        kept = REMAINDER_TIME / (REMAINDER_TIME + elapsed)
        fits = MISFIT_RANGE / (MISFIT_RANGE + abs(law - self.law) / ((law + self.law) / 2.0))
        self.law = law
        transition = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, kept, fits])
        transition[4, 5] = way
        walks = [WALK * SCALE_PRIOR, WALK * COULOMB_PRIOR * law, WALK * VISCOUS_PRIOR * law, WALK * ASYMMETRY_PRIOR]
        added = [*(moved * walk**2 for walk in walks), elapsed * (OFFSET_WALK * law) ** 2]
        is_curved = self.drift_square > (CURVED * law) ** 2
        added.append(is_curved * abs(way) / self.longest * (GRADIENT_WALK * law / self.longest) ** 2)
        added += [(1.0 - kept**2) * (REMAINDER * law) ** 2, (1.0 - fits**2) * (MISFIT * law) ** 2]
        self.mean = transition @ self.mean
        self.covariance = transition @ self.covariance @ transition.T + np.diag(added)

    def update(self, reading: Reading) -> None:
        _, force, direction, velocity, way, law, *_ = reading
        elapsed = min(max((reading.stamp - self.stamp) * 1e-9, 0.0), 3600.0)
        self.stamp = reading.stamp
        moved = min(elapsed, LONGEST_STEP)
        turns, strayed, before = direction != self.direction, self.strayed, self.mean[5]
        self.shown = max(self.shown, self.stroke) if turns else self.shown
        self.gradient, self.strayed = (
            (before, 0.0) if turns else (self.gradient, strayed + way * (before - self.gradient))
        )
        self.stroke = abs(way) + (0.0 if turns else self.stroke)
        self.longest = max(self.longest, self.stroke)
        self.predict(law, elapsed, moved, way)
        offset = self.mean[4]
        row = np.array([direction * law, direction, velocity, law, 1.0, 0.0, 1.0, direction])
        missed = force - row @ self.mean
        spread = self.noise * max(law, self.usual)
        self.usual += moved / (moved + USUAL_TIME) * (law - self.usual)
        expected = row @ self.covariance @ row + spread**2
        was_friction = (
            turns
            and LEAST_STRAYED * strayed**2 < -missed * strayed < MOST_STRAYED * strayed**2
            and missed**2 > OUTLIER**2 * expected
        )
        left = 0.0 if was_friction else missed
        most = WRONG_DIRECTION * law
        self.follow_drift(float(np.clip(left + self.mean[6], -most, most)), moved)
        follow = moved / (moved + NOISE_TIME) * (min(left**2 / expected, OUTLIER**2) - 1.0)
        noise = min(max(math.sqrt(self.noise**2 * (1.0 + follow)), LEAST_NOISE), 1.0)
        if was_friction:  # scale and offset show one half of it each
            both = np.array([direction / law, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
            self.covariance += (missed / 2.0) ** 2 * np.outer(both, both)
            self.number, self.direction, self.friction_steps = 0, direction, self.friction_steps + 1
        elif self.is_step(direction, missed, expected):
            self.mean, self.steps = self.settled, self.steps + 1
            missed = force - row @ self.mean
            self.covariance[4, 4] += missed**2
        if self.number == 0 or abs(self.number) > FEWEST_OUTLIERS:
            gain = self.covariance @ row / self.weighted(row, missed, spread)
            self.mean = self.mean + gain * missed
            self.covariance = (np.eye(8) - np.outer(gain, row)) @ self.covariance
        self.noise = noise
        self.strayed = self.strayed + self.mean[4] - offset if self.shown > SHORTEST_STROKE else 0.0
        if self.number == 0:
            self.settled = self.mean

    def follow_drift(self, unexplained: float, moved: float) -> None:
        unexplained = unexplained if self.direction else 0.0
        self.drift += moved / (moved + DRIFT_TIME) * (unexplained - self.drift)
        self.drift_square += moved / (moved + DRIFT_MEMORY) * (self.drift**2 - self.drift_square)

    def is_step(self, direction: int, missed: float, expected: float) -> bool:
        """Whether the outliers in a row are a step."""
        turns, before = direction != self.direction, self.number
        side = int(np.sign(missed)) if missed**2 > OUTLIER**2 * expected else 0
        leap = missed if turns else missed - self.second
        if before * side <= 0 and leap**2 < LEAP**2 * expected:
            side = 0
        count = before + side if before * side > 0 else side
        if before == 0:
            self.settled = self.mean
        steps = abs(count) >= STEP_READINGS or (turns and abs(before) >= FEWEST_OUTLIERS)
        self.second, self.last = missed if turns else self.last, missed
        self.direction, self.number = direction, 0 if steps else count
        return steps

    def weighted(self, row: np.ndarray, missed: float, noise: float) -> float:
        """Variance of the innovation [N^2] with the weight of an outlier."""
        of_terms = row @ self.covariance @ row
        distance = abs(missed) / math.sqrt(of_terms + noise**2)
        return float(of_terms + noise**2 * max(distance / OUTLIER, 1.0) ** 2)


def rough_readings(seed: int, count: int) -> Iterator[Reading]:
    """Any motion at any pressure, with spikes, pauses, a clock that goes back, and steps of the load."""
    rng, stamp, load = np.random.default_rng(seed), 0, 0.0
    for _ in range(count):
        stamp += int(rng.choice([4e6, 2e7, 3e8, 4e12, -1e8], p=[0.5, 0.4, 0.06, 0.02, 0.02]))
        law, direction = float(rng.uniform(5.0, 200.0)), int(rng.choice([-1, 1]))
        velocity = direction * float(rng.uniform(1e-3, 0.5))
        load += float(rng.normal(0.0, 600.0)) * (rng.random() < 0.01)
        spike = float(rng.normal(0.0, 1e3)) * (rng.random() < 0.05)
        force = direction * 1.2 * law + 30.0 * velocity + load + spike + 0.1 * law * float(rng.normal())
        way = direction * float(rng.uniform(0.0, 0.01))
        yield Reading(stamp, force, direction, velocity, way, law, float(rng.uniform(0.0, 0.3)) * law)


@pytest.mark.parametrize('seed', range(5))
def test_it_is_a_kalman_filter_with_matrices_whatever_the_readings(seed):
    known = list(rough_readings(seed, 600))
    book, state = Textbook(known[0]), NOT_BEGUN
    for reading in known:
        book.update(reading)
        state = updated(state, reading)
        assert state.terms == pytest.approx(book.mean, rel=1e-6, abs=1e-8)
        assert state.unexplained.noise == pytest.approx(book.noise)
        assert state.outliers.number == book.number
        assert matrix(state) == pytest.approx(book.covariance, rel=1e-6, abs=1e-9 * np.abs(book.covariance).max())
    assert book.steps > 0


@pytest.mark.parametrize('seed', range(3))
def test_the_covariance_stays_symmetric_and_positive(seed):
    state = NOT_BEGUN
    for reading in rough_readings(seed, 1500):
        state = updated(state, reading)
        found = matrix(state)
        std = np.sqrt(np.diag(found))
        correlation = found / np.outer(std, std)
        assert correlation == pytest.approx(correlation.T, abs=1e-9)
        assert np.linalg.eigvalsh(0.5 * (correlation + correlation.T)).min() > 0.0
        assert state.friction_std > 0.0


def test_one_reading_that_is_far_away_moves_the_friction_by_less_than_a_deviation():
    machine = Machine()
    calm = list(readings(machine, 20.0))
    spike = calm[-1]._replace(force=calm[-1].force + 1e6)
    clean, spoilt = after(calm), after([*calm[:-1], spike])
    assert magnitude(spoilt, machine, 1) == pytest.approx(magnitude(clean, machine, 1), abs=clean.friction_std)
    assert spoilt.unexplained.noise < 1.1 * clean.unexplained.noise


# --- consistency: data of the model itself ---


def drawn(seed: int, count: int) -> Iterator[tuple[Reading, np.ndarray]]:
    """Readings of a machine that is drawn from the prior and walks as the filter believes, with its terms."""
    rng, kept = np.random.default_rng(seed), REMAINDER_TIME / (REMAINDER_TIME + INTERVAL)
    law = 40.0
    prior = (math.hypot(SCALE_PRIOR, FILE_STD), COULOMB_PRIOR * law, VISCOUS_PRIOR * law, ASYMMETRY_PRIOR)
    std = np.array([*prior, OFFSET_PRIOR * law, GRADIENT_PRIOR * law, REMAINDER * law, MISFIT * law])
    truth = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]) + std * rng.standard_normal(8)
    for number in range(count):
        if number:
            walk = (
                WALK * SCALE_PRIOR,
                WALK * COULOMB_PRIOR * law,
                WALK * VISCOUS_PRIOR * law,
                WALK * ASYMMETRY_PRIOR,
                OFFSET_WALK * law,
            )
            truth[:5] += math.sqrt(INTERVAL) * np.array(walk) * rng.standard_normal(5)
            truth[6] = kept * truth[6] + math.sqrt(1.0 - kept**2) * REMAINDER * law * float(rng.standard_normal())
        direction = 1 if number // 25 % 2 else -1
        velocity = direction * float(rng.uniform(0.01, 0.2))
        way = velocity * INTERVAL
        truth[4] += way * truth[5]
        row = np.array([direction * law, direction, velocity, law, 1.0, 0.0, 1.0, direction])
        force = float(row @ truth) + LEAST_NOISE * law * float(rng.standard_normal())
        stamp = round(number * INTERVAL * SECOND)
        yield Reading(stamp, force, direction, velocity, way, law, FILE_STD * law), truth.copy()


def test_the_errors_of_the_terms_are_as_large_as_their_covariance_says():
    """NEES: eight terms, so its mean is 8; of 60 machines within 8 +- 1.7 in 99.9 %."""
    squares = []
    for seed in range(60):
        known = list(drawn(seed, 400))
        state, (_, truth) = after(reading for reading, _ in known), known[-1]
        missed = np.array(state.terms) - truth
        squares.append(float(missed @ np.linalg.solve(matrix(state), missed)))
    assert 6.3 < np.mean(squares) < 9.7


def test_innovations_are_as_large_as_expected_and_each_is_new():
    """NIS: their mean square is 1, and one tells nothing of the next."""
    distances = []
    for seed in range(40):
        state, each = NOT_BEGUN, []
        for reading, _ in drawn(seed, 400):
            before, state = state, updated(state, reading)
            if before.stamp != NEVER:
                each.append(innovation(before, reading) / state.innovation_std)
        distances.append(each[100:])
    found = np.array(distances)
    assert 0.85 < np.mean(found**2) < 1.05  # the noise is never below its least, and follows by chance
    assert abs(np.mean(found[:, 1:] * found[:, :-1])) < 0.05
    assert abs(np.mean(found)) < 0.05


def innovation(before: FrictionFilter, reading: Reading) -> float:
    """What a reading shows more than expected [N]."""
    elapsed = (reading.stamp - before.stamp) * 1e-9
    remainder = before.terms.remainder * REMAINDER_TIME / (REMAINDER_TIME + elapsed)
    terms = before.terms._replace(offset=before.terms.offset + reading.way * before.terms.gradient, remainder=remainder)
    return reading.force - expected(terms, reading)


# --- what a motion tells ---

VARIED = {'frictions': (40.0, 80.0, 20.0, 60.0), 'speeds': (0.05, 0.2, 0.02, 0.1, 0.3)}
LAW = Terms(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
MACHINES = {
    'scale': LAW._replace(scale=1.4),
    'coulomb': LAW._replace(coulomb=15.0),
    'viscous': LAW._replace(viscous=60.0),
    'asymmetry': LAW._replace(asymmetry=0.15),
    'offset': LAW._replace(offset=70.0),
    'gradient': LAW._replace(gradient=800.0),
    'all': Terms(0.7, 8.0, 40.0, -0.1, -50.0, 300.0, 0.0, 0.0),
}


@pytest.mark.parametrize('name', MACHINES)
def test_strokes_at_several_pressures_and_speeds_tell_each_term(name):
    machine = Machine(MACHINES[name], **VARIED)
    prior, found = stds(after(list(readings(machine, 60.0))[:1])), after(readings(machine, 120.0))
    for term in ('scale', 'coulomb', 'viscous', 'asymmetry', 'offset', 'gradient'):
        std = getattr(stds(found), term)
        assert abs(getattr(found.terms, term) - getattr(machine.terms, term)) < 3.0 * std, term
        assert std < 0.25 * getattr(prior, term), term


@pytest.mark.parametrize('scale', [0.8, 1.25])
def test_what_the_law_misses_at_each_pressure_is_friction_there_and_does_not_pull_the_scale(scale):
    """As where one law stands for two unlike kinds of seals; the scale alone would be that of the last pressure."""
    frictions, misfits = (20.0, 40.0, 80.0, 160.0), (-0.12, 0.12, 0.04, -0.04)  # of mean 0
    machine = Machine(LAW._replace(scale=scale), frictions, misfits)
    state, wrong = NOT_BEGUN, []
    for number, reading in enumerate(readings(machine, 160.0)):
        state, stroke = updated(state, reading), int(number * INTERVAL + 1e-9)
        true = (scale + misfits[stroke // 2 % 4]) * reading.friction
        if stroke >= 16 and number * INTERVAL - stroke > 0.1:  # of each stroke the filter has seen five readings
            found = friction_magnitude(state.terms, reading.direction, abs(reading.velocity), reading.friction)
            wrong.append((abs(found - true) / true, abs(found - true) / state.friction_std))
            assert state.terms.scale == pytest.approx(scale, abs=0.06)
    shares, distances = np.array(wrong).T
    assert np.sqrt(np.mean(shares**2)) < 0.04
    assert np.mean(distances < 1.96) > 0.95


def test_asymmetry_and_offset_of_one_pressure_are_told_together_and_stay_apart_in_the_deviation():
    machine = Machine(LAW._replace(asymmetry=0.15))
    found, law = after(readings(machine, 60.0)), machine.frictions[0]
    covariance, both = matrix(found), np.array([0.0, 0.0, 0.0, law, 1.0, 0.0, 0.0, 0.0])
    assert both @ found.terms == pytest.approx(0.15 * law, abs=0.02 * law)
    assert math.sqrt(both @ covariance @ both) < 0.02 * law
    assert found.friction_std > 0.9 * ASYMMETRY_PRIOR * law
    for direction in machine.directions:
        assert (
            abs(magnitude(found, machine, direction) - true_magnitude(machine, direction)) < 1.96 * found.friction_std
        )


def test_one_direction_alone_tells_no_friction():
    """What it shows may be an offset as well."""
    machine = Machine(LAW._replace(scale=1.4), directions=(1,))
    begun, found = after(list(readings(machine, 60.0))[:1]), after(readings(machine, 60.0))
    assert magnitude(found, machine, 1) == pytest.approx(machine.frictions[0], rel=0.05)
    assert stds(found)[:4] == pytest.approx(stds(begun)[:4], rel=0.1)
    assert found.friction_std > PROVEN * machine.frictions[0]


def test_one_speed_leaves_viscous_friction_at_its_prior():
    machine = Machine(LAW._replace(viscous=60.0))
    begun, found = after(list(readings(machine, 60.0))[:1]), after(readings(machine, 60.0))
    assert magnitude(found, machine, 1) == pytest.approx(true_magnitude(machine, 1), rel=0.03)
    assert stds(found).viscous == pytest.approx(stds(begun).viscous, rel=0.05)
    assert abs(found.terms.viscous) < 0.1 * stds(begun).viscous


def test_an_hour_at_one_speed_winds_nothing_up():
    """Without a motion that tells them apart the terms do not walk away with the noise."""
    machine = Machine(stroke_time=10.0)
    ten_minutes = after(reading for i, reading in enumerate(readings(machine, 3600.0)) if i % 5 == 0)
    assert magnitude(ten_minutes, machine, 1) == pytest.approx(machine.frictions[0], rel=0.05)
    for value, true, std in zip(ten_minutes.terms, machine.terms, stds(ten_minutes), strict=True):
        assert abs(value - true) < 1.5 * std


@pytest.mark.parametrize('share', [1.0, 3.0, 10.0])
@pytest.mark.parametrize('when', [20.0, 20.5])  # at a reversal, and within a stroke
def test_a_load_step_is_no_friction_once_there_was_a_reversal_and_is_in_the_band_before(share, when):
    machine = Machine()
    law = machine.frictions[0]
    loaded = machine._replace(terms=LAW._replace(offset=share * law))
    state = after(readings(machine, when))
    for reading in readings(loaded, when + 4.0):
        if reading.stamp < when * SECOND:
            continue
        state = updated(state, reading)
        seconds = reading.stamp / SECOND - when
        if seconds > STEP_READINGS * INTERVAL:
            missed = magnitude(state, machine, reading.direction) - law
            assert abs(missed) < 1.96 * state.friction_std
        if seconds > 2.0:
            assert abs(missed) < 0.05 * law
    assert state.terms.offset == pytest.approx(share * law, abs=0.1 * law)


@pytest.mark.parametrize('share', [0.5, 1.0, 2.0])
def test_a_load_that_came_at_rest_is_no_friction_at_the_next_reversal(share):
    """The reversal alone would make half of it friction; a sudden change at rest says that it is a load."""
    machine, start = Machine(), 20.0
    law = machine.frictions[0]
    state, loaded = after(readings(machine, start)), machine._replace(terms=LAW._replace(offset=share * law))
    first, *others = (one for one in readings(loaded, start + 1.0) if one.stamp >= start * SECOND)
    for reading in (first._replace(loaded=share * law), *others):
        state = updated(state, reading)
        assert magnitude(state, machine, reading.direction) == pytest.approx(law, rel=0.1)
    assert state.terms.offset == pytest.approx(share * law, abs=0.1 * law)


def test_a_change_of_the_force_sum_at_rest_is_no_load_if_the_next_motion_needs_none():
    machine, start = Machine(), 20.0
    state = after(readings(machine, start))
    first = next(one for one in readings(machine, start + 1.0) if one.stamp >= start * SECOND)
    assert updated(state, first._replace(loaded=machine.frictions[0])) == updated(state, first)


def test_noise_of_the_force_sum_is_no_uncertainty_of_the_friction():
    quiet, noisy = (after(readings(Machine(white=white), 60.0)) for white in (0.02, 0.4))
    law = Machine().frictions[0]
    assert noisy.unexplained.noise == pytest.approx(0.4, rel=0.1)
    assert quiet.unexplained.noise == pytest.approx(LEAST_NOISE)
    assert noisy.friction_std < 0.5 * noisy.unexplained.noise * law
    assert noisy.terms.scale == pytest.approx(1.0, abs=0.05)


def test_a_friction_that_wavers_is_in_the_deviation():
    """Nobody knows of a remainder whether it is friction."""
    machine = Machine(wavering=0.2)
    law, found = machine.frictions[0], after(readings(machine, 60.0))
    assert found.friction_std > 0.1 * law
    assert found.friction_std > 1.3 * after(readings(Machine(), 60.0)).friction_std


@given(st.builds(Terms, *[st.floats(-1e3, 1e3)] * 7), st.sampled_from([-1, 0, 1]), st.floats(0.0, 10.0))
def test_friction_never_drives(terms, direction, speed):
    assert friction_magnitude(terms, direction, speed, 40.0) >= 0.0


def test_a_pause_leaves_the_friction_and_makes_the_offset_less_certain():
    machine = Machine()
    calm = after(readings(machine, 20.0))
    later = updated(calm, next(readings(machine, 1.0, start=3000.0)))
    assert magnitude(later, machine, 1) == pytest.approx(magnitude(calm, machine, 1), rel=0.05)
    assert stds(later).scale == pytest.approx(stds(calm).scale, rel=0.05)
    assert stds(later).offset > stds(calm).offset
