"""Bags of a machine of several actuators replay as those of one: with another configuration, into a bag, again."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from harness.example_bags import rewrite
from harness.machines import BENCH, EXCAVATOR, made, message

from seal_friction_ros.core.estimation.configuration import ALGORITHM_VERSION
from seal_friction_ros.core.machine import machine as m
from seal_friction_ros.core.machine.machine_snapshot import machine_text, parse_machine_text, snapshot_of
from seal_friction_ros.core.messages.coder import decode, decode_text, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, FEEDFORWARD_TYPE
from seal_friction_ros.offline.bags.actuator_bag import RECORDED
from seal_friction_ros.offline.bags.bag import STATE_TYPE, BagMessage, BagWriter, read_messages
from seal_friction_ros.offline.bags.info import bag_info
from seal_friction_ros.offline.replay.replay import chosen_configuration, replay

MS = 1_000_000  # [ns]
NAMES = ['boom', 'arm', 'bucket']
MACHINE = made(EXCAVATOR)


@pytest.fixture(scope='module')
def inputs(tmp_path_factory) -> Path:
    """What comes in for 70 s, at 5 Hz."""
    bag = tmp_path_factory.mktemp('machine') / 'inputs'
    with BagWriter(bag) as writer:
        text = encode_text(machine_text(snapshot_of(MACHINE, m.init(MACHINE))))
        writer.write('/digger/configuration', CONFIGURATION_TYPE, 1, text)
        for number in range(1, 350):
            at = 10**9 + number * 200 * MS
            joints = message('sensor_msgs/JointState', at, name=NAMES, velocity=[0.05, -0.03, 0.02])
            pressures = message('std_msgs/Float64MultiArray', data=[30.0] * 3)
            for topic in ('/a', '/b'):
                writer.write(topic, 'std_msgs/msg/Float64MultiArray', at, pressures)
            for topic in ('/set', '/joint_states'):
                writer.write(topic, 'sensor_msgs/msg/JointState', at, joints)
    return bag


@pytest.fixture(scope='module')
def bag(inputs: Path) -> Path:
    """The same with the answers."""
    replay(inputs, out=inputs.parent / 'bag')
    return inputs.parent / 'bag'


def snapshots(bag: Path, kind: str = CONFIGURATION_TYPE) -> list:
    return [parse_machine_text(decode_text(one.data)) for one in read_messages(bag) if one.type_name == kind]


def test_every_answer_of_every_actuator_is_replayed_to_the_byte(bag: Path):
    result = replay(bag)
    assert result.identical, result.first_difference
    assert result.velocity_samples == result.recorded_estimates == 3 * 349
    assert [one.is_replayed for one in snapshots(bag)] == [True]
    assert [list(one.actuators) for one in snapshots(bag, STATE_TYPE)] == [NAMES]  # after 60 s


def test_a_difference_is_named_with_its_actuator(bag: Path, tmp_path: Path):
    def changed(number: int, one: BagMessage) -> BagMessage:
        is_changed = one.topic == '/arm/friction_estimate' and number > 500
        return one._replace(data=one.data[:-8] + bytes(8)) if is_changed else one

    result = replay(rewrite(bag, tmp_path / 'changed', changed))
    assert result.first_difference.startswith('/arm/friction_estimate: estimate ')


def test_another_configuration_is_that_of_every_actuator(bag: Path, tmp_path: Path):
    override = chosen_configuration(None, 'delft_o_ring')
    replay(bag, override, tmp_path / 'out')
    (used,) = snapshots(tmp_path / 'out')
    assert list(used.configurations.values()) == [override] * 3
    assert [one.snapshot.recorded.feedforward for one in used.actuators.values()] == [
        actuator.configuration.feedforward for actuator in MACHINE.actuators
    ]
    found = replay(bag, replace(override, feedforward=replace(override.feedforward, scale=0.0)))
    assert not found.identical


def test_the_force_that_acted_stays_however_often_a_bag_is_replayed(inputs: Path, tmp_path: Path):
    """Of the bag of a live node, whose configuration is not marked as replayed."""
    replay(inputs, out=tmp_path / 'made')
    live = rewrite(tmp_path / 'made', tmp_path / 'live', lambda _, one: as_live(one))
    replay(live, chosen_configuration(None, 'delft_o_ring'), tmp_path / 'first')
    replay(tmp_path / 'first', out=tmp_path / 'second')
    for again in ('first', 'second'):
        kept = forces(tmp_path / again, '/boom/friction_feedforward' + RECORDED)
        assert kept == forces(live, '/boom/friction_feedforward') != []
        assert not any('_recorded_recorded' in one.topic for one in read_messages(tmp_path / again))


def as_live(one: BagMessage) -> BagMessage:
    if one.type_name != CONFIGURATION_TYPE:
        return one
    document = json.loads(decode_text(one.data))
    for actuator in document['actuators'].values():
        del actuator['snapshot']['recorded']
    return one._replace(data=encode_text(json.dumps(document)))


def forces(bag: Path, topic: str) -> list[float]:
    return [decode(FEEDFORWARD_TYPE, one.data).force for one in read_messages(bag) if one.topic == topic]


def test_the_version_of_a_bag_is_that_of_its_oldest_actuator(bag: Path, tmp_path: Path):
    def older(_: int, one: BagMessage) -> BagMessage:
        if one.type_name != CONFIGURATION_TYPE:
            return one
        document = json.loads(decode_text(one.data))
        document['actuators']['arm']['snapshot']['version'] = 1
        return one._replace(data=encode_text(json.dumps(document)))

    assert replay(bag).recorded_version == ALGORITHM_VERSION
    assert replay(rewrite(bag, tmp_path / 'older', older)).recorded_version == 1


def test_info_names_the_seals_as_they_are_mounted(tmp_path: Path):
    """Also those whose chambers the mapping file does not name."""
    machine = made(BENCH, seals=['ms28775_114', 'ms28775_114'])
    with BagWriter(tmp_path / 'bag') as writer:
        text = machine_text(snapshot_of(machine, m.init(machine)))
        writer.write('/machine_estimator/configuration', CONFIGURATION_TYPE, 1, encode_text(text))
    seals = bag_info(tmp_path / 'bag').seals
    assert seals == ['axis: ms28775_114 on chamber a', 'axis: ms28775_114 on chamber b']
