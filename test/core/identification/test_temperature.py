"""The scale over temperature is found where temperature varied by itself, and refused elsewhere."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.temperature import scale_at
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.temperature import at_reference, fit_temperature

BAR = 1e5


def exponential(temperature):
    return np.exp(-0.012 * (temperature - 300.0))


def arrhenius_and_boundary(temperature):
    """Another seal: a third of the friction is dry and does not change, the rest follows Arrhenius' law."""
    return (1.0 + 2.0 * np.exp(2500.0 * (1.0 / temperature - 1.0 / 300.0))) / 3.0


def readings(temperatures, *, seed=0, scale=exponential, run_to_run=0.0, noise=0.02, strokes=8, offset=5.0, run_in=0.0):
    """Runs at three pressures, to and fro; ``temperatures``: of each run a number, or a function of its progress."""
    rng = np.random.default_rng(seed)
    rows = []
    for source, temperature in enumerate(temperatures):
        day = math.exp(run_to_run * rng.standard_normal())
        for level in range(3):
            for stroke in range(strokes):
                progress = (level * strokes + stroke) / (3 * strokes)
                kelvin = temperature(progress) if callable(temperature) else temperature
                side = 1.0 if stroke % 2 == 0 else -1.0
                settling = 1.0 + run_in * math.exp(-4.0 * progress)
                friction = (20.0 + 10.0 * level) * day * settling * float(scale(np.float64(kelvin)))
                force = offset + side * friction * (1.0 + noise * rng.standard_normal())
                rows.append((source, level, side, kelvin, force, progress))
    source, level, side, kelvin, force, progress = np.array(rows).T
    pressure = (1.0 + 2.0 * level)[:, np.newaxis] * BAR
    return FrictionReadings(
        OperatingConditions(pressure, 0.02 * side, side),
        force,
        source.astype(int),
        source.astype(int),
        level.astype(int),
        tuple(f'run {i}' for i in range(len(temperatures))),
        'file',
        are_samples=False,
        travel=10.0 * progress,
        temperature=kelvin,
    )


RUNS = (285.0, 310.0, 295.0, 320.0, 300.0, 330.0)


def test_the_coefficient_of_runs_at_several_temperatures_is_found():
    found = fit_temperature(readings(RUNS))
    assert found.why_not == ''
    assert found.coefficient == pytest.approx(0.012, abs=3.0 * found.error)
    assert found.error < 0.001
    assert (found.lowest, found.highest) == (285.0, 330.0)


def test_the_stated_error_holds_the_coefficient_in_95_percent_of_draws_with_run_to_run_variation():
    inside = []
    for seed in range(300):
        found = fit_temperature(readings(RUNS, seed=seed, run_to_run=0.05, strokes=4))
        inside.append(abs(found.coefficient - 0.012) < 1.96 * found.error or bool(found.why_not))
    assert 0.90 <= np.mean(inside) <= 0.99


def test_one_run_that_warms_up_and_cools_is_enough():
    found = fit_temperature(readings([lambda progress: 300.0 + 15.0 * math.sin(20.0 * progress)], strokes=24))
    assert found.why_not == ''
    assert found.coefficient == pytest.approx(0.012, abs=3.0 * found.error)


def test_a_seal_that_follows_another_law_is_predicted_at_a_temperature_that_was_left_out():
    found = fit_temperature(readings((290.0, 300.0, 320.0, 330.0, 295.0, 325.0), scale=arrhenius_and_boundary))
    truth = float(arrhenius_and_boundary(np.float64(310.0)) / arrhenius_and_boundary(np.float64(found.reference)))
    assert scale_at(found.scale, 310.0) == pytest.approx(truth, rel=0.04)


def test_readings_at_the_reference_have_no_temperature_left_in_them():
    warm = readings(RUNS)
    found = fit_temperature(warm)
    cold = at_reference(warm, found)
    assert abs(fit_temperature(cold).coefficient) < 1e-4
    same = fit_temperature(warm).reference
    expected = readings([same] * len(RUNS)).force
    np.testing.assert_allclose(cold.force, expected, rtol=0.02)


@pytest.mark.parametrize(('span', 'enough'), [(7.9, False), (8.1, True)])
def test_a_temperature_has_to_vary_by_eight_kelvin(span, enough):
    found = fit_temperature(readings([300.0 + span * share for share in (0.0, 1.0, 0.1, 0.9, 0.05, 0.95)], noise=1e-3))
    assert (found.why_not == '') is enough
    assert enough or '8 K are needed' in found.why_not


def test_a_coefficient_that_no_seal_has_is_refused_for_that_and_not_for_its_error():
    found = fit_temperature(readings(RUNS, scale=lambda kelvin: np.exp(-0.15 * (kelvin - 300.0)), noise=1e-3))
    assert found.why_not.startswith('the friction changes by 15 % a kelvin, more than that of any seal')


@pytest.mark.parametrize(('spread', 'enough'), [(1.9, False), (2.1, True)])
def test_what_is_left_of_the_temperature_has_a_standard_deviation_of_two_kelvin(spread, enough):
    half = math.sqrt(6.0) * spread  # two of twelve runs are off by as much
    found = fit_temperature(readings([300.0 - half, 300.0 + half, *[300.0] * 10], noise=1e-3))
    assert (found.why_not == '') is enough
    assert enough or 'went with' in found.why_not


def test_slope_and_error_are_those_of_a_line_through_the_runs_with_the_band_of_student():
    made = readings(RUNS, run_to_run=0.03, seed=2)
    found = fit_temperature(made)
    x = np.array(RUNS)
    friction = [np.log(made.magnitudes(np.full(6, 5.0))[made.source == run]).mean() for run in range(6)]
    line = stats.linregress(x, friction)
    assert found.coefficient == pytest.approx(-line.slope, rel=0.02)
    assert found.error == pytest.approx(line.stderr * stats.t.ppf(0.975, 4) / BAND_95, rel=0.05)
    assert found.scale.reference == np.median(made.temperature)
    assert (found.scale.coefficient, found.scale.coefficient_std) == (found.coefficient, found.error)


@pytest.mark.parametrize(('readings_', 'enough'), [(12, True), (11, False)])
def test_a_scale_takes_twelve_readings(readings_, enough):
    made = readings((280.0, 330.0, 290.0, 320.0), noise=1e-3, strokes=2, offset=0.0)
    found = fit_temperature(made.taken(np.flatnonzero(made.level < 2)[:readings_]))
    assert ('too few readings' in found.why_not) is not enough


@pytest.mark.parametrize('law', [0.0, 0.012])
def test_without_an_effect_none_is_claimed_and_with_one_it_is(law):
    found = fit_temperature(readings(RUNS, scale=lambda kelvin: np.exp(-law * (kelvin - 300.0))))
    assert (abs(found.coefficient) > 3.0 * found.error) == (law > 0.0)


@pytest.mark.parametrize(
    ('name', 'made'),
    [
        ('varied by 2 K', lambda: readings((299.0, 300.0, 301.0, 300.0))),
        ('went with', lambda: readings([lambda progress: 300.0 + 20.0 * progress], run_in=0.2)),
        ('went with', lambda: readings((290.0, 330.0))),
        ('repeat more runs', lambda: readings((290.0, 300.0, 305.0, 310.0), run_to_run=0.4)),
        ('have no temperature', lambda: readings((290.0, math.nan, 310.0, 320.0))),
    ],
)
def test_what_does_not_identify_it_is_refused(name, made):
    assert name in fit_temperature(made()).why_not


def test_readings_without_temperature_have_no_fit():
    plain = readings(RUNS)
    assert fit_temperature(plain.taken(np.arange(0))) is None


# --- what the temperature is told from ---


def drawn(sources: int) -> FrictionReadings:
    """Readings at random temperatures, off the law by 2 %: alike out and back, so that the offset is 5 N."""
    made = readings([300.0] * sources, noise=0.0)
    rng = np.random.default_rng(1)
    warmth, off = (np.repeat(rng.normal(size=made.count // 2), 2) for _ in range(2))
    kelvin = 300.0 + 10.0 * (warmth + rng.normal(size=sources)[made.source])
    return replace(
        made, temperature=kelvin, force=5.0 + np.exp(-0.012 * (kelvin - 300.0) + 0.02 * off) * (made.force - 5.0)
    )


def regressed(made, cells, part, others=()):
    """Coefficient and its error by a line through the means of parts, less a regression on cells and other columns."""
    design = np.column_stack((cells[:, np.newaxis] == np.unique(cells), *others))
    columns = made.temperature, np.log(made.magnitudes(np.full(len(made.names), 5.0)))
    left = [column - design @ np.linalg.lstsq(design, column, rcond=None)[0] for column in columns]
    line = stats.linregress(*([column[part == one].mean() for one in np.unique(part)] for column in left))
    error = line.stderr * stats.t.ppf(0.975, len(np.unique(part)) - 2) / BAND_95
    return pytest.approx((-line.slope, error), rel=1e-6)


def fitted(made):
    found = fit_temperature(made)
    return found.coefficient, found.error


def cells_of(made):
    return 2 * made.level + (made.at.direction > 0.0)


def test_from_four_runs_on_pressures_are_compared_across_them():
    made = drawn(4)
    assert fitted(made) == regressed(made, cells_of(made), made.source)
    tests = replace(drawn(3), group=np.arange(72) // 18, left_out_by='test')  # a file may hold several runs
    assert fitted(tests) == regressed(tests, cells_of(tests), tests.group)


def test_three_runs_are_told_by_eight_parts_of_each_without_the_way_of_the_rod():
    made = drawn(3)
    cells, part = cells_of(made) + 6 * made.source, np.arange(72) // 3
    way = made.travel / np.ptp(made.travel)
    ways = [np.where(made.source == run, way**power, 0.0) for run in range(3) for power in (1, 2)]
    assert fitted(made) == regressed(made, cells, part, ways)
    unknown = replace(made, travel=np.empty(0))
    assert fitted(unknown) == regressed(made, cells, part)
    assert fitted(made) != fitted(unknown)


@pytest.mark.parametrize(('off', 'counts'), [(0.019, False), (0.021, True)])
def test_pressure_and_speed_count_if_they_vary_by_2_percent_within_a_level(off, counts):
    made = drawn(4)
    cells = cells_of(made)
    varying = np.repeat(np.random.default_rng(2).normal(size=made.count // 2), 2)
    varying -= np.array([varying[cells == cell].mean() for cell in cells])
    varying = 1.0 + off * varying / varying.std()
    varied = made.at._replace(velocity=made.at.velocity * varying)
    pressed = made.at._replace(pressure=made.at.pressure.mean() * varying[:, np.newaxis])
    both = pressed._replace(velocity=varied.velocity)  # one column more says nothing new
    expected = regressed(made, cells, made.source, [varying] if counts else [])
    assert (fitted(made) == expected) is not counts
    for at in (varied, pressed, both):
        assert fitted(replace(made, at=at)) == expected
    unknown = made.at._replace(velocity=np.full(made.count, np.nan))
    assert fitted(replace(made, at=unknown)) == fitted(made)


def test_the_samples_behind_the_readings_and_their_offset_go_to_the_reference_with_them():
    made = readings(RUNS, noise=0.0)
    made = replace(made, samples=tuple(np.array([force - 1.0, force, force + 1.0]) for force in made.force))
    found = fit_temperature(made)
    cold = at_reference(made, found)
    share = np.exp(0.012 * (made.temperature - found.reference))
    assert cold.force == pytest.approx(5.0 + share * (made.force - 5.0))
    for samples, force, one in zip(cold.samples, cold.force, share, strict=True):
        assert samples == pytest.approx(force + one * np.array([-1.0, 0.0, 1.0]))
    part = made.taken(made.source < 5)  # a run without readings
    assert at_reference(part, found).force == pytest.approx(cold.force[made.source < 5])


@pytest.mark.parametrize(('noise', 'told'), [(0.09, True), (0.11, False)])
def test_friction_at_the_ends_of_the_temperatures_has_to_be_known_to_a_tenth(noise, told):
    """One point a run; the runs are off the line by a pattern with no slope. Half a band at the ends is ``noise``."""
    kelvin = np.array([290.0, 300.0, 310.0, 320.0, 330.0])
    pattern = np.array([1.0, -2.0, 0.0, 2.0, -1.0])
    pattern = pattern - np.polyval(np.polyfit(kelvin, pattern, 1), kelvin)
    error = np.sqrt(pattern @ pattern / 3.0 / np.sum((kelvin - 310.0) ** 2)) * stats.t.ppf(0.975, 3)
    pattern = pattern * noise / (error * 20.0)
    made = readings(tuple(kelvin), noise=0.0, scale=lambda one: np.exp(-0.012 * (one - 310.0)))
    off = np.exp(pattern)[made.source]
    found = fit_temperature(replace(made, force=5.0 + off * (made.force - 5.0)))
    assert found.coefficient == pytest.approx(0.012, rel=1e-3)
    assert (found.why_not == '') is told
    assert told or 'known to 11 % only' in found.why_not


@pytest.mark.parametrize(('coefficient', 'taken'), [(0.099, True), (0.101, False), (-0.099, True), (-0.101, False)])
def test_a_coefficient_above_a_tenth_a_kelvin_is_no_scale(coefficient, taken):
    made = readings(RUNS, noise=0.0, scale=lambda kelvin: np.exp(-coefficient * (kelvin - 300.0)))
    found = fit_temperature(made)
    assert found.coefficient == pytest.approx(coefficient)
    assert (found.why_not == '') is taken


def test_friction_may_be_as_low_as_it_is_but_not_nothing():
    made = readings(RUNS, noise=1e-3, offset=0.0)
    low = replace(made, force=1e-3 * made.force)  # 10 to 50 mN
    assert fit_temperature(low).coefficient == pytest.approx(fit_temperature(made).coefficient)
    none = made.force.copy()
    none[3] = -none[3]  # in the direction of the motion
    assert 'friction near zero' in fit_temperature(replace(made, force=none)).why_not
