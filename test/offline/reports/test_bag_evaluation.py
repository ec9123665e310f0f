"""Measured against estimated friction: synthetic bags of known friction and known offset."""

import dataclasses
import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from seal_friction_ros.core.estimation.configuration import SealSelection, first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.strokes import Event, offset_of_strokes, pressure_labels
from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.core.messages.coder import encode, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, FORCE_TYPE, PRESSURE_TYPE, VELOCITY_TYPE
from seal_friction_ros.core.messages.records import Force, Pressure, Status, Velocity
from seal_friction_ros.files import load_configuration
from seal_friction_ros.offline.bags import bag as bags
from seal_friction_ros.offline.bags.bag import BagWriter
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.replay.replay import replay
from seal_friction_ros.offline.reports.bag_evaluation import BagEvaluation, evaluate_run, evaluation_numbers

START = 1_700_000_000_123_456_789  # [ns]
RATE = 200  # [Hz]
OFFSET = 4.0  # [N] of the force sum
LEVELS = (1e5, 2.5e6, 6e6)  # [Pa]
CONFIGURATION = load_configuration(SealSelection(), EstimatorSettings())
SEALS = CONFIGURATION.parameters().estimator.seals


def strokes(directions=(1, -1), speed=0.02, rest=0.5, slide=1.0, error=1.0):
    """Velocity, pressure and force sum of a rig that rests, is pushed until it breaks away, and slides.

    ``error`` is the true friction over the estimated one.
    """
    rows = []
    for pressure in LEVELS:
        friction = actuator_friction(SEALS, pressure, pressure)
        dynamic, static = error * friction.coulomb_friction, error * (friction.coulomb_friction + friction.stiction)
        for direction in directions:
            pushes = (direction * static * (k + 1) / (rest * RATE) for k in range(int(rest * RATE)))
            rows += [(0.0, pressure, push + OFFSET) for push in pushes]
            rows += [(direction * speed, pressure, direction * dynamic + OFFSET)] * int(slide * RATE)
    return rows


def make_bag(folder: Path, rows) -> Path:
    inputs = folder / 'inputs'
    with BagWriter(inputs) as writer:
        text = encode_text(snapshot_text(first_snapshot(CONFIGURATION)))
        writer.write(bags.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, START, text)
        for i, (velocity, pressure, force) in enumerate(rows):
            stamp = START + i * 1_000_000_000 // RATE
            data = encode(Pressure(stamp, pressure, pressure))
            writer.write(bags.PRESSURE_TOPIC, PRESSURE_TYPE, stamp, data)
            writer.write(bags.FORCE_TOPIC, FORCE_TYPE, stamp, encode(Force(stamp, force)))
            data = encode(Velocity(stamp, velocity, b'rod'))
            writer.write(bags.VELOCITY_TOPIC, VELOCITY_TYPE, stamp, data)
    replay(inputs, out=folder / 'estimates')
    return folder / 'estimates'


def evaluated(folder: Path, rows):
    return friction_of(evaluate_run(read_run(make_bag(folder, rows))))


def friction_of(found: BagEvaluation) -> SimpleNamespace:
    """The comparison with the notes on it."""
    return SimpleNamespace(**vars(found.friction), notes=found.notes)


@pytest.mark.parametrize('error', [1.0, 0.8])
def test_known_friction_is_recovered_whatever_the_offset_of_the_force_sum(tmp_path, error):
    result = evaluated(tmp_path, strokes(directions=(1, -1, 1, -1), error=error))
    assert [level.pressure for level in result.sliding] == pytest.approx(LEVELS)
    for level, pressure in zip(result.sliding, LEVELS, strict=True):
        estimated = actuator_friction(SEALS, pressure, pressure).coulomb_friction
        assert level.measured == pytest.approx(error * estimated, rel=1e-9)
        assert level.estimated == pytest.approx(estimated, rel=1e-9)
        assert level.offset == pytest.approx(OFFSET, rel=1e-9)
        assert level.measured_spread == pytest.approx(0.0, abs=1e-9)
        assert level.deviation_percent == pytest.approx(100.0 * (1.0 / error - 1.0), abs=1e-6)
        assert len(level.events) == 4


def test_breakaway_is_the_peak_at_rest_before_each_stroke(tmp_path):
    result = evaluated(tmp_path, strokes())
    for level, pressure in zip(result.breakaway, LEVELS, strict=True):
        friction = actuator_friction(SEALS, pressure, pressure)
        assert level.measured == pytest.approx(friction.coulomb_friction + friction.stiction, rel=1e-9)
        assert level.deviation_percent == pytest.approx(0.0, abs=1e-6)


def test_noise_averages_out_and_shows_as_spread_between_strokes(tmp_path):
    generator = np.random.default_rng(7)
    rows = []
    for _ in range(6):  # twelve strokes a pressure, each two with a friction of their own
        scale = 1.0 + 0.05 * generator.standard_normal()
        rows += [(v, p, f + generator.normal(0.0, 1.0)) for v, p, f in strokes(error=scale)]
    for level in evaluated(tmp_path, rows).sliding:
        assert level.deviation_percent == pytest.approx(0.0, abs=6.0)
        assert 0.02 < level.measured_spread / level.measured < 0.12


def test_with_one_direction_the_mean_magnitude_is_used_and_said(tmp_path):
    result = evaluated(tmp_path, strokes(directions=(-1,)))
    for level, pressure in zip(result.sliding, LEVELS, strict=True):
        friction = actuator_friction(SEALS, pressure, pressure).coulomb_friction
        assert not level.both_directions
        assert level.measured == pytest.approx(friction - OFFSET, rel=1e-9)  # the offset stays in
    assert any('one direction only' in note for note in result.notes)


def swept_strokes(directions, pressures=(1e6, 1.5e6, 2.1e6, 2.8e6, 3.6e6, 4.5e6, 5.5e6, 6.6e6)):
    """Strokes at even speed, each at a pressure of its own, in these directions one after the other, without a rest."""
    rows = []
    for i, pressure in enumerate(pressures):
        direction = directions[i % len(directions)]
        friction = actuator_friction(SEALS, pressure, pressure).coulomb_friction
        rows += [(direction * 0.02, pressure, direction * friction + 10.0 * OFFSET)] * RATE
    return rows


def test_the_offset_of_a_swept_log_is_removed_and_said(tmp_path):
    """Each pressure has one direction; an offset of a multiple of the friction comes from all strokes."""
    result = evaluated(tmp_path, swept_strokes((1, -1)))
    assert result.offset == pytest.approx(10.0 * OFFSET, abs=1.0)
    assert len(result.sliding) == 8
    for level in result.sliding:
        assert level.has_bag_offset
        assert level.offset == result.offset
        assert level.deviation_percent == pytest.approx(0.0, abs=6.0)  # the friction is not quite linear in pressure
    (note,) = (note for note in result.notes if 'least squares' in note)
    assert '8 of 8 pressures' in note


def test_an_offset_comes_from_the_shape_of_the_estimate_where_directions_differ_in_pressure():
    """Extension at high pressures, retraction at low ones: a line over pressure cannot tell the offset, a law can."""
    pressures = [(1, 8e6 + i * 4e5) for i in range(4)] + [(-1, 1e5 + i * 4e5) for i in range(4)]
    strokes_of = [
        Event(side, p, 150.0 + 1.2 * side * (p / 1e5) ** 1.5, (p / 1e5) ** 1.5, 1.0, 0.02, 100, 0, 1)
        for side, p in pressures
    ]
    assert offset_of_strokes(strokes_of) == pytest.approx(150.0, abs=1e-6)
    scattered = [s._replace(estimated=50.0 + 40.0 * (i % 3)) for i, s in enumerate(strokes_of)]
    assert offset_of_strokes(scattered) is None


def test_an_offset_that_the_strokes_do_not_determine_is_left_in(tmp_path):
    result = evaluated(tmp_path, swept_strokes((1,)))
    assert result.offset is None
    assert all(level.offset is None for level in result.sliding)
    assert any('offset of the force sum remains' in note for note in result.notes)


def test_a_start_that_friction_did_not_hold_has_no_percentage_but_a_reason(tmp_path):
    rows = []
    for velocity, pressure, force in strokes(directions=(1, -1, 1, -1)):
        held = velocity != 0.0 or pressure != LEVELS[1]  # at the second pressure something else starts the rod
        rows.append((velocity, pressure, force if held else OFFSET + 0.05 * (force - OFFSET)))
    result = evaluated(tmp_path, rows)
    first, second, third = result.breakaway
    assert first.deviation_percent == pytest.approx(0.0, abs=1e-6)
    assert third.deviation_percent == pytest.approx(0.0, abs=1e-6)
    assert second.deviation_percent is None
    assert 'no start from rest' in second.why_no_percent
    assert any('25.00 bar there is no percentage of the breakaway' in note for note in result.notes)
    assert all(level.deviation_percent is not None for level in result.sliding)


def test_friction_near_zero_has_no_percentage(tmp_path):
    rows = [(v, p, f if p != LEVELS[0] or v == 0.0 else OFFSET + math.copysign(0.3, v)) for v, p, f in strokes()]
    low, *others = evaluated(tmp_path, rows).sliding
    assert low.deviation_percent is None
    assert low.deviation == pytest.approx(low.estimated - 0.3)
    assert 'below 10 % of the estimate' in low.why_no_percent
    assert all(level.deviation_percent is not None for level in others)


def test_without_sliding_there_is_a_note_and_no_number(tmp_path):
    result = evaluated(tmp_path, [(0.0, 1e6, 5.0)] * 300)
    assert result.sliding == ()
    assert result.breakaway == ()
    assert 'No steady sliding' in result.notes[0]


def test_in_the_middle_of_a_sine_stroke_inertia_averages_out(tmp_path):
    friction = actuator_friction(SEALS, 1e6, 1e6).coulomb_friction
    phases = [2.0 * math.pi * (i + 0.5) / RATE for i in range(5 * RATE)]
    inertia = 40.0  # [N]
    rows = [(0.05 * math.sin(x), 1e6, math.copysign(friction, math.sin(x)) + inertia * math.cos(x)) for x in phases]
    (level,) = evaluated(tmp_path, rows).sliding
    assert level.measured == pytest.approx(friction, rel=0.01)


def test_a_rod_that_only_accelerates_never_slides_steadily(tmp_path):
    rows = [(0.001 * (i % RATE), 1e6, 30.0) for i in range(5 * RATE)]
    assert evaluated(tmp_path, rows).sliding == ()


def test_inputs_that_are_no_numbers_are_left_out_and_counted(tmp_path):
    rows = strokes()
    for i in range(0, len(rows), 7):
        broken = [list(rows[i]), list(rows[i]), list(rows[i])][i % 3]
        broken[i % 3] = (math.nan, math.inf)[i % 2]
        rows[i] = tuple(broken)
    run = read_run(make_bag(tmp_path, rows))
    result = friction_of(evaluate_run(run))
    for level, pressure in zip(result.sliding, LEVELS, strict=True):
        friction = actuator_friction(SEALS, pressure, pressure).coulomb_friction
        assert level.measured == pytest.approx(friction, rel=1e-6)
        assert len(level.events) == 2  # a lost velocity does not cut a stroke in two
    assert any('not finite) are left out' in note for note in result.notes)
    counts = evaluate_run(run).status_counts
    for bit in ('VELOCITY_NOT_FINITE', 'PRESSURE_NOT_FINITE', 'FORCE_NOT_FINITE'):
        assert counts[bit] > 0


def test_rates_shares_ages_and_span_are_those_of_the_bag(tmp_path):
    run = read_run(make_bag(tmp_path, strokes()))
    result = evaluate_run(run)
    assert result.start == START
    assert result.duration == pytest.approx(len(run.time) / RATE, rel=0.01)
    assert result.rates[bags.PRESSURE_TOPIC] == pytest.approx(RATE, rel=0.01)
    assert sum(result.state_shares.values()) == pytest.approx(1.0)
    assert result.state_shares['SLIDING'] == pytest.approx(2 / 3, abs=0.01)
    assert result.input_age == {'p50': 0.0, 'p99': 0.0, 'max': 0.0}
    assert result.status_counts['MOTION_UNCERTAIN'] <= result.flagged <= 0.02 * len(run.time)  # reversals
    figures = json.loads(json.dumps(evaluation_numbers(result), allow_nan=False))
    assert figures['friction']['sliding'][0]['events'] == 2


def test_other_bits_of_a_newer_version_are_counted_not_lost(tmp_path):
    run = read_run(make_bag(tmp_path, strokes()))
    run = dataclasses.replace(run, status=np.full_like(run.status, 2 * int(max(Status))))
    assert evaluate_run(run).status_counts['UNKNOWN_BITS'] == len(run.time)


def test_levels_are_separated_at_gaps_and_ramps_are_cut():
    steps = np.array([0.0, 10.0, 6.8e5, 6.9e5, 6.89e6, 6.9e6])
    assert list(pressure_labels(steps)) == [0, 0, 1, 1, 2, 2]
    ramp = np.linspace(0.0, 1e6, 500)
    labels = pressure_labels(ramp)
    widths = [np.ptp(ramp[labels == label]) for label in np.unique(labels)]
    assert max(widths) <= 0.1e6
    assert list(labels) == sorted(labels)
    assert list(pressure_labels(np.array([2e5]))) == [0]
