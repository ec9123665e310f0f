"""Comparison of two bags: messages of equal stamp; first, largest and RMS difference."""

import json
import math
import struct
from pathlib import Path

import pytest
from harness.compensation import compensating
from harness.example_bags import STEP, rewrite, write_recorded
from paths import ROOT

from seal_friction_ros.core.messages.coder import DECODERS, encode
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, ESTIMATE_TYPE
from seal_friction_ros.offline.bags.bag import BagMessage, bag_topics, read_messages
from seal_friction_ros.offline.commands.main import main

PULL_TEST = str(ROOT / 'bags' / 'pull_test')


def test_compare_says_first_largest_and_rms_difference(tmp_path: Path, capsys):
    seal, other = ROOT / 'config' / 'seals' / 'ms28775_114_table.yaml', str(tmp_path / 'other')
    assert main(['replay', PULL_TEST, '--seal', str(seal), '--out', other]) == 0
    capsys.readouterr()
    assert main(['compare', PULL_TEST, other, '--json']) == 1
    found = json.loads(capsys.readouterr().out)
    coulomb = found['fields']['coulomb_friction']
    assert not found['agree']
    assert found['first_difference'].startswith('message 1 at')
    assert 0.0 < coulomb['rms'] <= coulomb['largest'] < 1.0
    assert coulomb['outside'] == found['messages_a'] == 900
    assert found['fields']['stamp']['largest'] == 0.0


def test_learnt_fields_do_not_decide_a_comparison_unless_named(tmp_path: Path, capsys):
    """Another deviation and another age of the inputs are no other friction; states are counted."""
    counter = iter(range(10_000))

    def changed(_: int, message: BagMessage) -> BagMessage:
        if message.type_name != ESTIMATE_TYPE:
            return message
        record = DECODERS[ESTIMATE_TYPE](message.data)
        state = record.state if next(counter) >= 12 else (record.state + 1) % 3
        data = encode(record._replace(adaptation_scale=0.5, input_age=1.0, state=state), b'rod')
        return message._replace(data=data)

    other = rewrite(Path(PULL_TEST), tmp_path / 'other', changed)
    assert main(['compare', PULL_TEST, str(other)]) == 1
    said = capsys.readouterr().out
    assert 'state: 12 of 900 differ' in said
    assert 'not compared, and different: input_age, adaptation_scale (--fields)' in said
    assert main(['compare', PULL_TEST, str(other), '--fields', 'friction_force', 'breakaway_force']) == 0
    assert main(['compare', PULL_TEST, str(other), '--fields', 'input_age']) == 1
    assert main(['compare', PULL_TEST, str(other), '--fields', 'input_age=2', 'adaptation_scale=2']) == 0
    assert main(['compare', PULL_TEST, str(other), '--fields', 'fiction']) == 2
    assert main(['compare', PULL_TEST, str(other), '--fields', 'state=x']) == 2


def compared(first: str | Path, second: str | Path, capsys, *options: str) -> dict:
    main(['compare', str(first), str(second), '--json', *options])
    return json.loads(capsys.readouterr().out)


@pytest.fixture(scope='module')
def pair(tmp_path_factory) -> tuple[Path, Path]:
    """A recording with frozen and repeated stamps, and its replay with other seals."""
    folder = tmp_path_factory.mktemp('pair')

    def stall(_: int, message: BagMessage) -> BagMessage:
        data, sample = bytearray(message.data), message.log_time // STEP
        if message.type_name != CONFIGURATION_TYPE:
            seconds, nanoseconds = struct.unpack_from('<iI', data, 4)
            if 150 < sample < 180:
                nanoseconds = 7 * (sample % 2)  # a clock that goes to and fro
            struct.pack_into('<iI', data, 4, seconds, nanoseconds)
        return message._replace(data=bytes(data))

    source = rewrite(write_recorded(folder, compensating()), folder / 'stalled', stall)
    seal = str(ROOT / 'config' / 'seals' / 'ms28775_114_table.yaml')
    assert main(['replay', str(source), '--seal', seal, '--out', str(folder / 'other')]) == 0
    return source, folder / 'other'


def without_first(source: Path, out: Path, topic: str, count: int) -> Path:
    seen = 0

    def change(_: int, message: BagMessage) -> BagMessage | None:
        nonlocal seen
        seen += message.topic == topic
        return None if message.topic == topic and seen <= count else message

    return rewrite(source, out, change)


@pytest.mark.parametrize('count', [10, *(pytest.param(count, marks=pytest.mark.long) for count in (1, 100))])
def test_a_recording_that_began_later_differs_in_nothing_from_the_whole_one(pair, count, tmp_path: Path, capsys):
    source, _ = pair
    for number, (topic, info) in enumerate(bag_topics(source).items()):
        if info.message_count > count:
            later = without_first(source, tmp_path / str(number), topic, count)
            for found in (compared(source, later, capsys, '--topic', topic), compared(later, source, capsys)):
                assert all(field['largest'] == field['rms'] == 0.0 for field in found['fields'].values())
            found = compared(source, later, capsys, '--topic', topic)
            assert (found['without_partner_a'], found['without_partner_b'], found['agree']) == (count, 0, False)


@pytest.mark.parametrize('count', [1, 10, 100])
def test_differences_are_those_of_equal_stamps_whatever_the_second_bag_lacks(pair, count, tmp_path: Path, capsys):
    source, other = pair
    topic = '/friction_estimate'
    whole = compared(source, other, capsys, '--atol', '0.001')
    later = compared(source, without_first(other, tmp_path / 'later', topic, count), capsys, '--atol', '0.001')
    decoded = [
        [DECODERS[ESTIMATE_TYPE](message.data) for message in read_messages(bag) if message.topic == topic]
        for bag in (source, other)
    ]
    differences = [b.coulomb_friction - a.coulomb_friction for a, b in zip(*decoded, strict=True)]
    expected = math.sqrt(sum(value**2 for value in differences[count:]) / len(differences[count:]))
    assert whole['without_partner_a'] == whole['without_partner_b'] == later['without_partner_b'] == 0
    assert later['without_partner_a'] == count
    assert later['fields']['coulomb_friction']['rms'] == pytest.approx(expected, rel=1e-12)
    assert whole['fields']['coulomb_friction']['largest'] == max(map(abs, differences))


def test_bags_without_a_common_stamp_cannot_be_compared(pair, tmp_path: Path, capsys):
    source, _ = pair
    half = [
        rewrite(source, tmp_path / name, lambda _, m, late=late: m if (m.log_time > 2_500_000_000) == late else None)
        for name, late in (('early', False), ('late', True))
    ]
    assert main(['compare', *map(str, half), '--topic', '/rod_velocity']) == 2
    assert 'no stamp on /rod_velocity is in both' in capsys.readouterr().err
