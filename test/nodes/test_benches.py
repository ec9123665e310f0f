"""The benches of the live node run, and what they count is counted; how fast it is, they say and no test."""

from benches import bench


def test_every_round_trip_is_answered_by_every_node_asked():
    found = bench('live', '--seconds', '0.6', '--rates', '500')
    assert len(found['figures']) == 4
    for figures in found['figures'].values():
        assert figures['500']['missed'] == 0
        assert 0.0 < figures['500']['p50 [us]'] <= figures['500']['p99 [us]']
    assert len(found['ratios']) == 3
    woken = found['figures']['estimator']['500']['event thread woken per sample']
    assert woken < 3.0  # what config/fastdds.xml is for; without it four to eight times


def test_the_start_is_timed():
    found = bench('start', '--times', '1')
    assert 0.0 < found['bare interpreter [s]'] < found['estimator, to the first estimate [s]']


def test_a_short_soak_leaves_nothing_behind_and_loses_nothing_unreported():
    found = bench('soak', '--minutes', '0.15')
    assert found['received'] > 1000
    assert found['lost'] <= found['reported missing']
    assert {value for name, value in found.items() if name.endswith(' more')} == {0}


def test_a_fault_that_does_as_required_is_reported_so():
    found = bench('faults', '--only', ' no ', '--times', '1')
    assert found == {'bytes that are no message': [[]], 'an input has no publisher at first': [[]]}


def test_a_sample_is_timed_stage_by_stage():
    found = bench('step', '--batches', '1')
    assert (
        0.0
        < found['bare call [us]']
        < found['receive velocity [us]']
        < found['receive velocity, with feed-forward [us]']
    )
    assert min(found.values()) > 0.0


def test_files_are_timed_by_size():
    found = bench('offline', '--largest', '10000', '--tasks', 'import', 'replay, message by message')
    assert found['sizes'] == [10_000]
    assert [task['time [s]']['10000'] > 0.0 for task in found['tasks'].values()] == [True, True]
