"""Every bench runs in its shortest form and counts what it should count; no test depends on the times it prints."""

import pytest
from harness.browser import chromium
from harness.commands import run_json
from paths import ROOT

SMALL_CASE = """name: small
motion: {cycles: 1}
numerics: {cells: 48, time_step: 2.0e-3}
map: {velocity_min: 1.0e-3, velocity_max: 1.0e-1, velocities: 3, pressure_max: 1.0e+5, pressures: 2}
"""


@pytest.mark.long
def test_every_node_answers_round_trips():
    found = run_json('bench/live.py', '--seconds', '0.6', '--rates', '500')
    echoes = ['bare echo, SingleThreadedExecutor', 'bare echo, events executor']
    assert list(found['figures']) == [*echoes, 'estimator', 'estimator, recording']
    for figures in found['figures'].values():
        assert 0.0 < figures['500']['p50 [us]'] <= figures['500']['p99 [us]']
    assert len(found['ratios']) == 3
    wakes = found['figures']['estimator']['500']['event thread woken per sample']
    assert wakes < 1.0  # the effect of config/fastdds.xml; four to eight times without


@pytest.mark.long
def test_round_trips_are_compared_with_those_of_another_tree():
    found = run_json('bench/live.py', '--before', str(ROOT), '--seconds', '4', '--rates', '200')
    assert len(found['figures']) == 4
    assert len(found['ratios']) == 2
    assert all(figures['CPU per sample'][0] > 0.0 for figures in found['ratios'].values())


@pytest.mark.long
def test_a_machine_is_timed_and_its_bags_replay_to_the_byte():
    found = run_json('bench/machine.py', '--actuators', '2', '--rounds', '1', '--seconds', '0.5', '--rate', '100')
    bare = 'bare node with the messages of 2'
    together = ', answers together'
    forms = ['', together, f'{together}, and commands']
    assert list(found) == ['one actuator, own messages', *(f'machine of 2{form}' for form in forms), bare]
    assert [figures['replay identical'] for figures in found.values()] == ['', *[True] * 3, '']
    assert [figures['missed'] for figures in found.values()] == [0] * 5


@pytest.mark.long
@pytest.mark.parametrize('case', ['one actuator', 'machine of three'])
def test_what_the_live_view_costs_is_timed(case):
    found = run_json('bench/monitor.py', '--cases', case, '--seconds', '0.5', '--warm-up', '0.1', '--rounds', '1')
    assert list(found) == [case]
    assert min(value for name, value in found[case].items() if name != 'load of the machine') > 0.0


@pytest.mark.long
def test_the_start_is_timed():
    found = run_json('bench/start.py', '--times', '1')
    assert list(found) == [
        'bare interpreter [s]', 'seal_friction --help [s]', 'completion of a command [s]',
        'estimator, to the first estimate [s]', 'estimator, memory [MB]',
    ]  # fmt: skip
    assert min(found.values()) > 0.0


def test_a_step_of_a_loop_in_c_is_timed_beside_that_of_python():
    found = run_json('bench/loop.py', '--steps', '5000')['step']
    assert 0.0 < found['C, median [us]'] <= found['C, p99 [us]'] <= found['C, worst [us]']
    assert found['ratio'] > 1.0


def test_a_sample_is_timed_stage_by_stage():
    found = run_json('bench/step.py', '--batches', '1')
    assert {'bare call [us]', 'receive velocity [us]', 'receive velocity, with feed-forward [us]'} <= set(found)
    assert min(found.values()) > 0.0


@pytest.mark.long
def test_files_are_timed_by_size():
    found = run_json('bench/offline.py', '--largest', '10000', '--tasks', 'import', 'replay, message by message')
    assert found['sizes'] == [10_000]
    assert [task['time [s]']['10000'] > 0.0 for task in found['tasks'].values()] == [True, True]


@pytest.mark.long
def test_the_servo_is_timed_by_inner_step():
    rows = run_json('bench/servo.py', '--seconds', '0.1')['rows']
    assert len(rows) == 4
    assert all(min(row['step'], row['simulate']) > 0.0 for row in rows)


@pytest.mark.long
def test_the_o_ring_is_timed_by_mesh():
    (row,) = run_json('bench/oring.py', '--lines', '9')
    assert row['unknowns'] > 100
    assert row['Newton steps'] > 10


@pytest.mark.long
def test_the_lubricated_contact_is_timed_by_grid_and_step(tmp_path):
    (tmp_path / 'small.yaml').write_text(SMALL_CASE)
    grid = ('--cells', '32', '48', '--steps', '8e-3', '4e-3', '--calls', '200')
    small = str(tmp_path / 'small.yaml')
    found = run_json('bench/ehl.py', '--case', small, '--edge', small, *grid)
    assert {'cycle, 32 cells [s]', 'exponent in steps', 'map, 3 x 2 [s]'} <= set(found)
    assert found['estimator step, friction_map [us]'] > 0.0


@pytest.mark.long
def test_a_fleet_is_timed_by_step_and_number_of_bags():
    found = run_json('bench/scale.py', '--seconds', '2', '--bags', '2')
    hour = found['an hour']
    assert hour['bytes [MB/h]']['recorded'] > hour['bytes [MB/h]']['inputs'] > 100.0
    assert min(step['time [s/h]'] for step in hour['steps'].values()) > 0.0
    assert {len(rows) for rows in found['bags'].values()} == {1}


@pytest.mark.long
@pytest.mark.skipif(not chromium(), reason='no Chromium')
def test_large_pages_are_timed_in_a_browser():
    rows = run_json('bench/pages.py', '--seconds', '4', '--bags', '2', '--times', '1')
    assert [row['page'] for row in rows] == ['report of 4 s at 1 kHz', 'fleet of 2 bags']
    assert min(row[name] for row in rows for name in ('size [MB]', 'open [s]', 'zoom [ms]')) > 0.0


def test_every_bench_is_run_here():
    benches = {path.name for path in (ROOT / 'bench').glob('*.py')} - {'one_core.py'}
    source = (ROOT / 'test' / 'test_benches.py').read_text()
    assert {name for name in benches if f"'bench/{name}'" not in source} == set()
