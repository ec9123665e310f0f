"""Replay: the same messages give the same bytes, and every difference is found and named."""

import hashlib
from pathlib import Path

import pytest
from harness.compensation import compensating
from harness.example_bags import rewrite, write_inputs, write_recorded
from paths import ROOT

from seal_friction_ros.core.estimation.configuration import ALGORITHM_VERSION
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.messages.coder import decode, decode_text, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, ESTIMATE_TYPE
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.offline.bags.actuator_bag import find_topics
from seal_friction_ros.offline.bags.bag import ESTIMATE_TOPIC, BagError, BagMessage, BagWriter, read_messages
from seal_friction_ros.offline.replay.parallel_replay import verify
from seal_friction_ros.offline.replay.replay import chosen_configuration, replay


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    return write_recorded(tmp_path, compensating(EstimatorSettings(stick_velocity=2e-3, slip_velocity=5e-3)))


def estimates(bag: Path) -> list[bytes]:
    return [message.data for message in read_messages(bag) if message.type_name == ESTIMATE_TYPE]


def test_a_replayed_bag_verifies_and_replays_to_the_same_file(recorded: Path, tmp_path: Path):
    verdict = replay(recorded, out=tmp_path / 'again')
    assert verdict.identical
    assert (verdict.velocity_samples, verdict.recorded_estimates) == (300, 300)
    replay(recorded, out=tmp_path / 'more' / 'again')
    files = [next((tmp_path / folder).glob('*.mcap')) for folder in ('again', 'more/again')]
    assert len({hashlib.sha256(file.read_bytes()).digest() for file in files}) == 1
    assert estimates(recorded) == estimates(tmp_path / 'again')


def test_the_configuration_in_the_bag_is_the_one_used(recorded: Path, tmp_path: Path):
    other = compensating(EstimatorSettings(stick_velocity=0.0, slip_velocity=0.0))
    verdict = replay(recorded, other)
    assert not verdict.identical
    assert 'state' in verdict.first_difference


def test_one_flipped_bit_in_one_estimate_is_found_and_named(recorded: Path, tmp_path: Path):
    def flip(number: int, message: BagMessage) -> BagMessage:
        if number != chosen:
            return message
        data = bytearray(message.data)
        data[20] ^= 1  # lowest bit of coulomb_friction, behind a header with a frame of three letters
        return message._replace(data=bytes(data))

    chosen = [n for n, message in enumerate(read_messages(recorded)) if message.topic == ESTIMATE_TOPIC][150]
    verdict = replay(rewrite(recorded, tmp_path / 'flipped', flip))
    assert verdict.differing == 1
    assert 'coulomb_friction' in verdict.first_difference


def test_changed_padding_counts_as_a_difference(recorded: Path, tmp_path: Path):
    def pad(number: int, message: BagMessage) -> BagMessage:
        if message.topic == ESTIMATE_TOPIC:
            data = bytearray(message.data)
            data[54] = 0xFF  # between direction and status
            return message._replace(data=bytes(data))
        return message

    verdict = replay(rewrite(recorded, tmp_path / 'padded', pad))
    assert verdict.differing == 300
    assert 'padding' in verdict.first_difference


@pytest.mark.parametrize('lost', [ESTIMATE_TOPIC, '/rod_velocity', '/cylinder_pressure'])
def test_a_lost_message_is_a_difference(recorded: Path, tmp_path: Path, lost: str):
    numbers = [n for n, message in enumerate(read_messages(recorded)) if message.topic == lost]
    bag = rewrite(recorded, tmp_path / 'lost', lambda n, message: None if n == numbers[40] else message)
    assert not replay(bag).identical


def test_a_bag_without_estimates_does_not_verify(tmp_path: Path):
    verdict = replay(write_inputs(tmp_path / 'inputs'))
    assert verdict.recorded_estimates == 0
    assert not verdict.identical


def test_topics_are_found_by_type_whatever_their_names(recorded: Path, tmp_path: Path):
    bag = rewrite(recorded, tmp_path / 'renamed', lambda _, m: m._replace(topic='/plant' + m.topic))
    assert find_topics(bag).velocity == '/plant/rod_velocity'
    assert replay(bag).identical


def test_two_actuators_in_one_bag_are_told_apart_by_namespace(recorded: Path, tmp_path: Path):
    with BagWriter(tmp_path / 'two') as writer:
        for message in read_messages(recorded):
            for side in ('/left', '/right'):
                writer.write(*message._replace(topic=side + message.topic))
    with pytest.raises(BagError, match='--namespace'):
        replay(tmp_path / 'two')
    assert replay(tmp_path / 'two', namespace='/left').identical


def test_a_bag_of_other_types_or_empty_is_refused_and_nothing_is_written(tmp_path: Path):
    with BagWriter(tmp_path / 'other') as writer:
        writer.write('/chatter', 'std_msgs/msg/String', 1, encode_text('hello'))
    with BagWriter(tmp_path / 'empty'):
        pass
    for bag in ('other', 'empty'):
        with pytest.raises(BagError, match='nothing to estimate from'):
            replay(tmp_path / bag, out=tmp_path / 'out')
    assert not (tmp_path / 'out').exists()


def test_a_damaged_message_is_named_and_nothing_is_written(recorded: Path, tmp_path: Path):
    bag = rewrite(recorded, tmp_path / 'bad', lambda n, m: m._replace(data=m.data[:-3]) if n == 400 else m)
    with pytest.raises(BagError, match='bytes where the message has'):
        replay(bag, out=tmp_path / 'out')
    assert not (tmp_path / 'out').exists()


def test_a_seal_given_replaces_every_seal_of_the_bag(recorded: Path, tmp_path: Path):
    seal = ROOT / 'config' / 'seals' / 'ms28775_114_prior_art.yaml'
    replay(recorded, chosen_configuration(None, seal), out=tmp_path / 'out')
    ours = [decode(ESTIMATE_TYPE, data) for data in estimates(recorded)]
    charts = [decode(ESTIMATE_TYPE, data) for data in estimates(tmp_path / 'out')]
    good = [(a, b) for a, b in zip(ours, charts, strict=True) if not a.status & Status.PRESSURE_MISSING]
    assert len(good) > 290
    assert all(b.coulomb_friction > 1.2 * a.coulomb_friction for a, b in good)


def test_a_parameter_file_of_the_node_replaces_the_settings_of_the_bag(tmp_path: Path):
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**:\n  ros__parameters:\n    stick_velocity: 0.01\n    slip_velocity: 0.02\n    record: true\n')
    configuration = chosen_configuration(file, None)
    assert configuration is not None
    assert configuration.settings.slip_velocity == 0.02
    file.write_text('/**:\n  ros__parameters:\n    slip_velocity: -1.0\n')
    with pytest.raises(ValueError, match=r'slip_velocity = -1.0 m/s is below its lower bound 0.0'):
        chosen_configuration(file, None)


def test_a_replay_with_another_seal_verifies_with_that_seal(recorded: Path, tmp_path: Path):
    seal = ROOT / 'config' / 'seals' / 'ms28775_114_table.yaml'
    for source in (recorded, write_inputs(tmp_path / 'bare')):
        out = tmp_path / f'{source.name}_out'
        replay(source, chosen_configuration(None, seal), out)
        texts = [decode_text(m.data) for m in read_messages(out) if m.type_name == CONFIGURATION_TYPE]
        assert len(texts) == 1
        assert 'ms28775_114_table' in texts[0]
        assert replay(out).identical


def test_a_replayed_bag_of_inputs_says_what_it_was_replayed_with(tmp_path: Path):
    replay(write_inputs(tmp_path / 'inputs'), out=tmp_path / 'out')
    assert next(read_messages(tmp_path / 'out')).type_name == CONFIGURATION_TYPE
    assert replay(tmp_path / 'out').identical


def test_one_lost_estimate_is_one_difference_and_not_all_that_follow(recorded: Path, tmp_path: Path):
    chosen = [n for n, message in enumerate(read_messages(recorded)) if message.topic == ESTIMATE_TOPIC][100]
    bag = rewrite(recorded, tmp_path / 'lost', lambda n, message: None if n == chosen else message)
    verdict = replay(bag)
    assert (verdict.recorded_estimates, verdict.differing) == (299, 1)


def test_a_namespace_is_whole_names(recorded: Path, tmp_path: Path):
    with BagWriter(tmp_path / 'two') as writer:
        for message in read_messages(recorded):
            for side in ('/arm', '/arm2'):
                writer.write(*message._replace(topic=side + message.topic))
    assert replay(tmp_path / 'two', namespace='arm').identical
    with pytest.raises(BagError, match='nothing to estimate from'):
        replay(tmp_path / 'two', namespace='/ar')


def test_a_bag_of_an_older_version_replays_and_the_version_is_named():
    result = verify(ROOT / 'test' / 'corpus' / 'version_1' / 'faults', bulk_from=10**9)
    assert (result.recorded_version, result.velocity_samples, result.recorded_estimates) == (1, 570, 570)
    assert not result.identical
    assert f'version 1 of the algorithm made them, this is version {ALGORITHM_VERSION}' in result.summary(verified=True)
    assert verify(ROOT / 'test' / 'corpus' / 'version_1' / 'faults', bulk_from=0) == result


def test_a_replay_of_an_old_bag_is_of_the_present_version_and_verifies(tmp_path: Path):
    replay(ROOT / 'bags' / 'pull_test', out=tmp_path / 'out')
    verdict = replay(tmp_path / 'out')
    assert verdict.identical
    assert verdict.recorded_version == ALGORITHM_VERSION
