"""Bags with late inputs: how late each came is in the bag, and every replay does with it what the node did."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from harness.closed_loop_bags import write_closed_loop
from harness.compensation import SCALE, compensating
from harness.example_bags import as_recorded, rewrite
from harness.machines import EXCAVATOR, made, message

from seal_friction_ros.core.machine import machine as m
from seal_friction_ros.core.machine.machine_snapshot import machine_text, snapshot_of
from seal_friction_ros.core.messages.coder import decode, decode_text, encode_text
from seal_friction_ros.core.messages.layouts import (
    CLOCK_TYPE,
    CONFIGURATION_TYPE,
    ESTIMATE_TYPE,
    FEEDFORWARD_TYPE,
    INPUTS,
)
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.offline.bags.actuator_bag import find_topics, open_actuator
from seal_friction_ros.offline.bags.bag import BagMessage, BagWriter, read_messages
from seal_friction_ros.offline.replay.compiled_replay import replay_in_bulk
from seal_friction_ros.offline.replay.replay import Replay, replay

MS = 1_000_000  # [ns]
FIRST, LAST = 0.2, 0.45  # [s] while inputs come late
LATE = 200 * MS


def changed(source: Path, out: Path, change: Callable[[float, BagMessage], BagMessage]) -> Path:
    """Copy of a bag; ``change`` gets the time since its begin [s]."""
    start = next(read_messages(source)).log_time
    return rewrite(source, out, lambda _, one: change((one.log_time - start) * 1e-9, one))


def of(bag: Path, type_name: str) -> list:
    """Records of a type in a bag."""
    return [decode(type_name, one.data) for one in read_messages(bag) if one.type_name == type_name]


def sent_late(moment: float, one: BagMessage) -> BagMessage:
    """The same message, sent 0.2 s before its receipt in the middle of the bag."""
    is_late = one.type_name in INPUTS.values() and FIRST < moment < LAST
    return one._replace(publish_time=one.log_time - LATE * is_late)


@pytest.fixture(scope='module')
def in_time(tmp_path_factory) -> Path:
    """A servo with a force from the first sample on, 0.6 s."""
    return write_closed_loop(tmp_path_factory.mktemp('late') / 'in_time', (SCALE,), seconds=0.6)


@pytest.fixture(scope='module')
def late(in_time: Path) -> Path:
    """The same as a node records it whose inputs come late for 0.25 s."""
    folder = in_time.parent
    replay(changed(in_time, folder / 'inputs', sent_late), out=folder / 'replayed')
    return changed(folder / 'replayed', folder / 'late', lambda _, one: as_recorded(one))


def assert_identical(bag: Path) -> None:
    """Replays to the byte, message by message and in bulk."""
    result = replay(bag)
    assert result.identical, result.first_difference
    assert result.recorded_feedforwards > 300
    assert replay_in_bulk(bag, find_topics(bag), None, lambda _: None) == result


def test_a_bag_with_late_inputs_replays_to_the_byte_in_both_ways(late: Path):
    assert_identical(late)
    marked = [estimate.status & Status.LATE_INPUT for estimate in of(late, ESTIMATE_TYPE)]
    assert sum(map(bool, marked)) == round((LAST - FIRST) * 1000)
    assert any(feedforward.force == 0.0 and feedforward.scale == 0.0 for feedforward in of(late, FEEDFORWARD_TYPE))


def test_how_late_an_input_came_decides_over_the_force(late: Path, tmp_path: Path):
    bag = changed(late, tmp_path / 'in_time', lambda _, one: one._replace(publish_time=one.log_time))
    result = replay(bag)
    assert not result.identical
    assert replay_in_bulk(bag, find_topics(bag), None, lambda _: None) == result


def test_a_replay_keeps_when_each_input_was_sent(late: Path, tmp_path: Path):
    replay(late, out=tmp_path / 'out')
    times = [
        [(one.topic, one.log_time, one.publish_time) for one in read_messages(bag) if one.type_name in INPUTS.values()]
        for bag in (late, tmp_path / 'out')
    ]
    assert times[0] == times[1]
    assert max(log_time - sent for _, log_time, sent in times[1]) == LATE
    assert_identical(tmp_path / 'out')


def without_lateness(one: BagMessage) -> BagMessage:
    """A configuration that checks no lateness, as bags have it from before there was any."""
    if one.type_name != CONFIGURATION_TYPE:
        return one
    document = json.loads(decode_text(one.data))
    document['feedforward']['lateness_max'] = 0.0
    return one._replace(data=encode_text(json.dumps(document)))


def test_a_bag_that_checks_no_lateness_ignores_its_publish_times(in_time: Path, tmp_path: Path):
    """They were times of day, or anything else."""
    bag = changed(in_time, tmp_path / 'before', lambda moment, one: without_lateness(sent_late(moment, one)))
    assert_identical(bag)
    at_sea = changed(bag, tmp_path / 'at_sea', lambda moment, one: one._replace(publish_time=round(moment * 1e6)))
    assert_identical(at_sea)
    assert any(feedforward.force for feedforward in of(at_sea, FEEDFORWARD_TYPE))


def test_another_configuration_keeps_what_the_bag_tells(late: Path, tmp_path: Path):
    """How late inputs came is a fact of the recording; what follows from it is the configuration's."""
    never_late = compensating(lateness_max=0.0)
    replay(late, never_late, out=tmp_path / 'out')
    assert not any(estimate.status & Status.LATE_INPUT for estimate in of(tmp_path / 'out', ESTIMATE_TYPE))
    strict = compensating(lateness_max=1e-3)
    replay(late, strict, out=tmp_path / 'strict')
    assert sum(bool(one.status & Status.LATE_INPUT) for one in of(tmp_path / 'strict', ESTIMATE_TYPE)) > 200


# --- simulated time ---


def clock(nanoseconds: int) -> bytes:
    """A message of simulated time."""
    seconds, rest = divmod(nanoseconds, 10**9)
    return message('rosgraph_msgs/Clock', clock__sec=seconds, clock__nanosec=rest)


def test_a_bag_with_simulated_time_that_stands_still_replays_to_the_byte(in_time: Path, tmp_path: Path):
    start = next(read_messages(in_time)).log_time
    with BagWriter(tmp_path / 'inputs') as writer:
        for one in read_messages(in_time):
            if one.type_name == INPUTS['servo_reference']:
                moment = (one.log_time - start) * 1e-9
                shown = one.log_time if not FIRST < moment < LAST else start + round(FIRST * 1e9)
                writer.write('/clock', CLOCK_TYPE, one.log_time, clock(shown))
            writer.write(*one)
    replay(tmp_path / 'inputs', out=tmp_path / 'replayed')
    bag = changed(tmp_path / 'replayed', tmp_path / 'bag', lambda _, one: as_recorded(one))
    result = replay(bag)
    assert result.identical, result.first_difference
    marked = sum(bool(estimate.status & Status.LATE_INPUT) for estimate in of(bag, ESTIMATE_TYPE))
    assert 200 < marked < 250
    forces = [feedforward.force for feedforward in of(bag, FEEDFORWARD_TYPE)]
    assert 0.0 in forces[300:]


# --- a machine ---


def test_a_machine_with_late_inputs_replays_to_the_byte(tmp_path: Path):
    """Messages without a stamp have the time of their sending, or if they come late of their receipt."""
    machine = made(EXCAVATOR)
    text = encode_text(machine_text(snapshot_of(machine, m.init(machine))))
    names = ['boom', 'arm', 'bucket']
    with BagWriter(tmp_path / 'inputs') as writer:
        writer.write('/machine_estimator/configuration', CONFIGURATION_TYPE, 1, text)
        for number in range(1, 900):
            at = 10**9 + number * MS
            late = LATE * (400 <= number < 700)
            joints = {'name': names, 'velocity': [0.05, -0.03, 0.02]}
            pressures = message('std_msgs/Float64MultiArray', data=[30.0] * 3)
            for topic, kind, data in (
                ('/a', 'std_msgs/msg/Float64MultiArray', pressures),
                ('/b', 'std_msgs/msg/Float64MultiArray', pressures),
                ('/set', 'sensor_msgs/msg/JointState', message('sensor_msgs/JointState', at - late, **joints)),
                ('/joint_states', 'sensor_msgs/msg/JointState', message('sensor_msgs/JointState', at - late, **joints)),
            ):
                writer.write(topic, kind, at, data, at - late)
    replay(tmp_path / 'inputs', out=tmp_path / 'replayed')
    found = replay(tmp_path / 'replayed')
    assert found.identical, found.first_difference
    marked = sum(bool(one.status & Status.LATE_INPUT) for one in of(tmp_path / 'replayed', ESTIMATE_TYPE))
    assert marked == 3 * 300
    forces = [one.force for one in of(tmp_path / 'replayed', FEEDFORWARD_TYPE)]
    assert 0.0 in forces[1200:]
    alone = open_actuator(tmp_path / 'replayed', 'arm')
    replayed = [answer.data for step in Replay(alone).steps() for answer in step.answers]
    assert replayed == [one.data for one in read_messages(tmp_path / 'replayed') if one.topic.startswith('/arm/')]
    in_time = rewrite(tmp_path / 'replayed', tmp_path / 'in_time', lambda _, one: one._replace(publish_time=None))
    assert not replay(in_time).identical
