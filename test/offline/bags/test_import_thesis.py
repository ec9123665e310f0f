"""The thesis's pull test as a bag: every reading of Tables A-1 to A-3 is in it, and nothing else."""

import csv

import numpy as np
import pytest
from paths import ROOT

from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.offline.bags.bag import FORCE_TOPIC, PRESSURE_TOPIC, VELOCITY_TOPIC, read_messages
from seal_friction_ros.offline.bags.import_thesis import import_thesis, read_pulls

TABLE = ROOT / 'data' / 'thesis' / 'friction_tests.csv'
LBF = 4.4482216152605  # [N]
PSI = LBF / 0.0254**2  # [Pa]


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('thesis') / 'pull_test'
    import_thesis(path)
    return path


@pytest.fixture(scope='module')
def samples(bag):
    """Rows of stamp [s], chamber a, chamber b [Pa], force sum [N], velocity [m/s]."""
    rows, pressure, force = [], None, None
    for message in read_messages(bag):
        value = DECODERS[message.type_name](message.data)
        if message.topic == PRESSURE_TOPIC:
            pressure = value
        elif message.topic == FORCE_TOPIC:
            force = value
        else:
            assert message.topic == VELOCITY_TOPIC
            assert pressure.stamp == force.stamp == value.stamp == message.log_time - 2
            rows.append((value.stamp * 1e-9, pressure.chamber_a, pressure.chamber_b, force.force, value.velocity))
    return np.array(rows)


def pulls_seen(samples):
    """Readings as a stranger would take them from the signals: (psi, direction, static, dynamic) of each run."""
    _, pressure, _, force, velocity = samples.T
    starts = np.flatnonzero((velocity[1:] != 0) & (velocity[:-1] == 0)) + 1
    stops = np.flatnonzero((velocity[1:] == 0) & (velocity[:-1] != 0)) + 1
    seen, before = [], 0
    for start, stop in zip(starts, stops, strict=True):
        running = force[start:stop]
        assert np.ptp(running) == 0.0
        assert np.ptp(velocity[start:stop]) == 0.0
        assert np.ptp(pressure[start:stop]) == 0.0
        direction = int(np.sign(velocity[start]))
        peak = (direction * force[before:start]).max()
        seen.append((round(pressure[start] / PSI), direction, peak / LBF, direction * running[0] / LBF))
        before = stop
    return seen


def test_the_bag_holds_exactly_the_132_readings(samples):
    with TABLE.open() as file:
        table = {
            (int(r['test']), int(r['pressure_psig']), r['direction'], r['kind']): float(r['friction_lbf'])
            for r in csv.DictReader(file)
        }
    seen = pulls_seen(samples)
    assert len(table) == 132
    assert len(seen) == 66
    found = {}
    for number, (psi, direction, static, dynamic) in enumerate(seen):
        key = number // 22 + 1, psi, 'extend' if direction > 0 else 'retract'
        found[*key, 'static'] = round(static, 6)
        found[*key, 'dynamic'] = round(dynamic, 6)
    assert found == table


def test_at_rest_the_force_starts_from_zero_and_rises_evenly(samples):
    force, velocity = samples[:, 3], samples[:, 4]
    assert set(np.unique(velocity)) == {-0.01, 0.0, 0.01}
    first = np.abs(force[:70])
    assert not first[:31].any()
    assert np.diff(first[30:70]) == pytest.approx(3.0 * LBF / 39)  # test 1, 0 psi, retract: 3.0 lbf
    assert (force[:70] <= 0).all()


def test_both_chambers_have_the_pressure_of_the_test(samples):
    assert (samples[:, 1] == samples[:, 2]).all()
    assert np.unique(samples[:, 1]) == pytest.approx(np.arange(11) * 100 * PSI)


def test_stamps_and_length(bag, samples):
    assert samples[0, 0] == 1.0
    assert np.diff(samples[:, 0]) == pytest.approx(0.01, abs=1e-12)
    assert samples[-1, 0] - samples[0, 0] == pytest.approx(99.0, abs=0.011)


def test_mean_dynamic_friction_is_the_thesiss(samples):
    by_pressure = {}
    for psi, _, _, dynamic in pulls_seen(samples):
        by_pressure.setdefault(psi, []).append(dynamic)
    means = [np.mean(values) for _, values in sorted(by_pressure.items())]
    assert means == pytest.approx([2.50, 5.25, 6.42, 7.67, 8.42, 9.50, 10.17, 10.92, 11.67, 12.58, 13.33], abs=0.006)


def test_mean_stiction_is_the_thesiss():
    assert np.mean([p.static_friction - p.dynamic_friction for p in read_pulls()]) / LBF == pytest.approx(
        1.11, abs=0.005
    )


def test_the_same_bytes_each_time(bag, tmp_path):
    import_thesis(tmp_path / 'pull_test')
    assert (tmp_path / 'pull_test' / 'pull_test_0.mcap').read_bytes() == (bag / 'pull_test_0.mcap').read_bytes()
