"""Calibration of the band: on made readings, the share inside is the nominal share, and a run effect shows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm, t

from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.identification.calibration import (
    NOMINAL,
    between_runs,
    calibration,
    repeated_runs,
    run_numbers,
    runs_of,
    shares_inside,
    within_run,
)
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions, Variation, candidate_laws
from seal_friction_ros.core.identification.fitting import fit
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.validation import deviations_in_std, deviations_of_left_out

LAW = next(law for law in candidate_laws(Variation()) if law.name == 'pressure_power_law_2_3')
TRUTH = {'friction_at_no_pressure': 5.0, 'friction_at_one_bar': 0.9, 'pressure_exponent': 2.0 / 3.0}


def strokes(runs=6, scatter=0.05, run_scatter=0.0, seed=0, pressures=5, count=8, one_pressure=False):
    """Strokes of some runs in both directions; each run is a file, or a file for each pressure if ``one_pressure``."""
    rng = np.random.default_rng(seed)
    level = np.tile(np.repeat(np.arange(pressures), count), runs)
    run = np.repeat(np.arange(runs), pressures * count)
    source = run * pressures + level if one_pressure else run
    direction = np.tile([1.0, -1.0], len(run) // 2)
    at = OperatingConditions((1e5 + 1e6 * level)[:, np.newaxis], 0.01 * direction, direction)
    effect = run_scatter * rng.normal(size=int(source.max()) + 1)[source]
    shares = 1.0 + scatter * rng.normal(size=len(run)) + effect
    return FrictionReadings(
        at=at,
        force=2.0 + direction * LAW.friction(at, TRUTH) * shares,
        source=source,
        group=level if one_pressure else run,
        level=level,
        names=tuple(f'run {i}' for i in np.unique(source)),
        left_out_by='pressure' if one_pressure else 'file',
        are_samples=False,
    )


def mean_shares(seeds, judged, **made):
    """Mean over some seeds of the curve that ``judged`` gives for readings and parameters."""
    curves = []
    for seed in range(seeds):
        readings = strokes(seed=seed, **made)
        curves.append(shares_inside(np.concatenate(list(judged(readings, fit(LAW, readings).values)))))
    return np.mean(curves, axis=0)


def judged_within(readings, values):
    return (within_run(LAW, run, values)[0] for run in runs_of(readings))


def judged_between(readings, values):
    for others, left_out in repeated_runs(readings):
        yield between_runs(LAW, readings.taken(others), readings.taken(left_out), values)


def test_shares_of_normal_deviations_are_the_nominal_shares():
    shares = shares_inside(np.abs(np.random.default_rng(0).normal(size=20000)))
    assert shares == pytest.approx(NOMINAL, abs=0.015)
    assert np.isnan(shares_inside(np.empty(0))).all()
    assert (NOMINAL[0], NOMINAL[-1], len(NOMINAL)) == (0.10, 0.99, 90)


def test_a_deviation_at_the_edge_of_a_band_is_inside():
    edges = norm.ppf(0.5 * (1.0 + NOMINAL))
    shares = shares_inside(np.array([edges[40], 9.0]))
    assert shares.tolist() == [0.0] * 40 + [0.5] * 50


def test_a_run_repeats_another_at_the_pressures_that_they_share():
    made = strokes(runs=3, pressures=4)
    fewer = made.taken((made.source != 2) | (made.level == 1))
    found = repeated_runs(fewer)
    assert [np.unique(fewer.source[others]).tolist() for others, _ in found] == [[1, 2], [0, 2], [0, 1]]
    assert [np.unique(fewer.level[out]).tolist() for _, out in found] == [[0, 1, 2, 3], [0, 1, 2, 3], [1]]
    alone = made.taken((made.source == 0) & (made.level < 2) | (made.source == 1) & (made.level > 1))
    assert repeated_runs(alone) == []
    swept = replace(alone, are_samples=True)
    assert [np.count_nonzero(out) for _, out in repeated_runs(swept)] == [16, 16]


@pytest.mark.parametrize(('count', 'parts'), [(8, 8), (6, 0)])
def test_a_run_at_few_pressures_is_judged_in_four_parts_of_eight_readings_at_least(count, parts):
    run = strokes(runs=1, pressures=2, count=count)
    ratios, groups = within_run(LAW, run, TRUTH)
    assert groups == parts
    assert len(ratios) == (2 * count if parts else 0)


def test_with_normal_scatter_alone_both_curves_are_near_the_diagonal():
    made = {'runs': 4, 'pressures': 8, 'count': 10}
    assert mean_shares(2, judged_within, **made) == pytest.approx(NOMINAL, abs=0.13)
    assert mean_shares(2, judged_between, **made) == pytest.approx(NOMINAL, abs=0.13)


def test_with_an_effect_of_the_run_the_curve_between_runs_stays_near_the_diagonal():
    made = {'runs': 8, 'pressures': 3, 'count': 2, 'scatter': 0.02, 'run_scatter': 0.2}
    assert mean_shares(6, judged_between, **made) == pytest.approx(NOMINAL, abs=0.12)


def test_with_an_effect_of_the_run_the_band_of_one_run_is_too_narrow_for_the_others():
    shares = []
    for seed in range(4):
        readings = strokes(scatter=0.02, run_scatter=0.2, seed=seed, runs=4)
        one = readings.taken(readings.group == 0)
        one = replace(one, group=one.level, left_out_by='pressure')
        others = readings.taken(readings.group != 0)
        shares.append(shares_inside(deviations_in_std(LAW, one, others, fit(LAW, one).values)))
    at_95 = float(np.mean(shares, axis=0)[np.argmin(np.abs(NOMINAL - 0.95))])
    assert at_95 < 0.5


def test_a_run_is_not_judged_by_the_scatter_of_another():
    """Within runs the effect of the run cancels: the band is that of the scatter, not wider."""
    readings = strokes(scatter=0.02, run_scatter=0.2, runs=2)
    law_values = fit(LAW, readings).values
    same = [within_run(LAW, run, law_values)[0] for run in runs_of(readings)]
    quiet = strokes(scatter=0.02, runs=2)
    alone = [within_run(LAW, run, law_values)[0] for run in runs_of(quiet)]
    assert np.concatenate(same).mean() == pytest.approx(np.concatenate(alone).mean(), rel=0.05)


def test_runs_at_one_pressure_each_are_repeated_where_they_share_it():
    readings = strokes(runs=2, one_pressure=True, count=16, run_scatter=0.1)
    found = calibration(LAW, readings, fit(LAW, readings).values)
    assert (found.groups, found.runs) == (40, 10)
    assert np.isfinite(found.within_runs).all()
    assert found.between_runs[-1] == 1.0
    alone = readings.taken((readings.source != 3) & (readings.source != 4))
    assert len(repeated_runs(alone)) == 6  # pressures 3 and 4 are in one run only


def test_one_run_has_no_curve_between_runs():
    readings = replace(strokes(runs=1), left_out_by='pressure')
    readings = replace(readings, group=readings.level)
    found = calibration(LAW, readings, fit(LAW, readings).values)
    assert np.isfinite(found.within_runs).all()
    assert np.isnan(found.between_runs).all()
    assert (found.groups, found.runs) == (5, 0)


def test_a_stated_deviation_between_runs_makes_the_band():
    readings = strokes(runs=3, run_scatter=0.1)
    values = fit(LAW, readings).values
    (others, left_out), *_ = repeated_runs(readings)
    parts = readings.taken(others), readings.taken(left_out)
    narrow, wide = (between_runs(LAW, *parts, values, stated).max() for stated in (0.1, 1.0))
    assert wide < 0.3 * narrow


def test_a_run_is_its_test_or_file_if_those_are_left_out_and_else_its_source():
    made = strokes(runs=2, pressures=2)
    grouped = replace(made, group=made.group + 7)
    for by, numbers in (('test', {7, 8}), ('file', {7, 8}), ('block', {0, 1}), ('pressure', {0, 1})):
        assert set(run_numbers(replace(grouped, left_out_by=by)).tolist()) == numbers
    assert [run.count for run in runs_of(made)] == [16, 16]


def test_a_run_has_four_contiguous_parts_in_each_direction():
    run = strokes(runs=1, pressures=1, count=16)
    constant = candidate_laws(Variation(speeds=False))[0]
    typical = {constant.parameters[0].name: np.abs(run.force).mean() / run.at.pressure.shape[1]}
    one_way = run.taken(run.at.direction > 0.0)
    for made, group in ((run, np.repeat([0, 1, 2, 3], 4)), (one_way, np.repeat([0, 1, 2, 3], 2))):
        parts = replace(made, group=group, left_out_by='block')
        ratios, groups = within_run(LAW, made, TRUTH)
        assert groups == 4
        assert ratios == pytest.approx(deviations_of_left_out(constant, parts, typical))


def test_within_a_run_the_band_is_that_of_its_pressures_or_its_blocks():
    run = replace(strokes(runs=1, pressures=5), left_out_by='block')
    by_pressure = replace(run, group=run.level, left_out_by='pressure')
    ratios, groups = within_run(LAW, run, TRUTH)
    assert groups == 5
    assert ratios == pytest.approx(deviations_of_left_out(LAW, by_pressure, TRUTH))
    blocks = replace(run, are_samples=True, group=np.arange(run.count) // 20)
    ratios, groups = within_run(LAW, blocks, TRUTH)
    assert groups == 2
    assert ratios == pytest.approx(deviations_of_left_out(LAW, blocks, TRUTH))
    one_block, groups = within_run(LAW, replace(blocks, group=np.zeros(run.count, int)), TRUTH)
    assert (len(one_block), groups) == (0, 0)


def test_between_runs_the_band_is_that_of_the_other_runs_or_has_the_prior():
    readings = strokes(runs=3, run_scatter=0.1)
    values = fit(LAW, readings).values
    (others, left_out), *_ = repeated_runs(readings)
    two, out = readings.taken(others), readings.taken(left_out)
    # Two other runs show how runs differ; a stated deviation takes the place of that.
    assert between_runs(LAW, two, out, values) == pytest.approx(deviations_in_std(LAW, two, out, values))
    assert between_runs(LAW, two, out, values, 0.3) == pytest.approx(deviations_in_std(LAW, two, out, values, 0.3))
    # One other run shows none: its pressures are left out, and the prior of 15 % is added.
    one = readings.taken(readings.source == 1)
    by_pressure = replace(one, group=one.level, left_out_by='pressure')
    prior = 0.15 * t.ppf(0.975, 8.0) / BAND_95
    expected = deviations_in_std(LAW, by_pressure, out, values, prior)
    assert between_runs(LAW, one, out, values) == pytest.approx(expected, rel=1e-5)
    found = calibration(LAW, readings, values, 0.3)
    stated = [between_runs(LAW, readings.taken(a), readings.taken(b), values, 0.3) for a, b in repeated_runs(readings)]
    assert found.between_runs == pytest.approx(shares_inside(np.concatenate(stated)))
