"""A long bag is verified in stretches between its states: the result is that of one go, or nothing is concluded."""

import dataclasses
import json
import random
from itertools import pairwise
from pathlib import Path

import pytest
from harness.compensation import compensating
from harness.example_bags import as_recorded, rewrite, write_inputs
from mcap.writer import Writer

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.configuration import ALGORITHM_VERSION
from seal_friction_ros.core.messages.blocks import Kind
from seal_friction_ros.core.messages.coder import decode_text, encode_text
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, FORCE_TYPE, VELOCITY_TYPE
from seal_friction_ros.offline.bags.actuator_bag import find_topics
from seal_friction_ros.offline.bags.bag import (
    STATE_TYPE,
    BagMessage,
    BagWriter,
    bag_topics,
    read_messages,
    storage,
)
from seal_friction_ros.offline.bags.block_reader import Stretch, read_in_bulk, times_of
from seal_friction_ros.offline.bags.mcap_reader import LAST_TIME
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay import parallel_replay, shared_replay
from seal_friction_ros.offline.replay import replay as replay_module
from seal_friction_ros.offline.replay.answer_comparison import ReplayResult
from seal_friction_ros.offline.replay.parallel_replay import replay_many, verify_shared
from seal_friction_ros.offline.replay.replay import replay

SAMPLES = 1000  # 100 a second
STATE = '/friction_estimator/state'


@pytest.fixture(scope='module')
def recorded(tmp_path_factory) -> Path:
    """10 s of an adapting estimator, a state every half second."""
    folder = tmp_path_factory.mktemp('shared')
    configuration = dataclasses.replace(compensating(), adaptation=AdaptationSettings('on'))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(replay_module, 'STATE_PERIOD', 0.5)
        replay(write_inputs(folder / 'inputs', SAMPLES, configuration), out=folder / 'replayed')
    return rewrite(folder / 'replayed', folder / 'recorded', lambda _, message: as_recorded(message))


def shared(bag: Path) -> ReplayResult | None:
    """In seven stretches: every third state ends one."""
    return shared_replay.verify_stretches(bag, find_topics(bag), 2)


def nth(type_name: str, number: int, change):
    """Change one message of a type."""
    seen = 0

    def apply(_: int, message: BagMessage) -> BagMessage | None:
        nonlocal seen
        if message.type_name != type_name:
            return message
        seen += 1
        return change(message) if seen == number else message

    return apply


def test_a_replayed_bag_has_states_and_they_change_nothing_of_its_replay(recorded: Path):
    assert bag_topics(recorded)[STATE].message_count == 20
    without = replay(rewrite(recorded, recorded.parent / 'bare', lambda _, m: None if m.type_name == STATE_TYPE else m))
    assert replay(recorded) == without
    assert without.identical


def test_stretches_give_the_result_of_one_go_whatever_the_number_of_workers(recorded: Path, monkeypatch):
    expected = replay(recorded)
    for stretches in (1, 3, 30):
        monkeypatch.setattr(shared_replay, 'STRETCHES', stretches)
        assert shared(recorded) == expected
    assert len(shared_replay.stretches_of(recorded, find_topics(recorded), 30)) == 21
    assert len(shared_replay.stretches_of(recorded, find_topics(recorded), 4)) == 4
    assert len(shared_replay.stretches_of(recorded, find_topics(recorded), 1)) == 1


def test_each_stretch_begins_in_what_was_learnt_before_it(recorded: Path):
    texts = [decode_text(message.data) for message in read_messages(recorded) if message.topic == STATE]
    learnt = [json.loads(text)['state']['estimator']['adaptation']['strokes']['reversals'] for text in texts]
    assert learnt == sorted(learnt)
    assert learnt[-1] > learnt[0]


def other_byte(message: BagMessage) -> BagMessage:
    data = bytearray(message.data)
    data[40] ^= 1
    return message._replace(data=bytes(data))


def other_learnt(message: BagMessage) -> BagMessage:
    """The state of a seal that has learnt another offset."""
    document = json.loads(decode_text(message.data))
    document['state']['estimator']['adaptation']['filter']['terms']['offset'] = (3.5).hex()
    return message._replace(data=encode_text(json.dumps(document, sort_keys=True)))


def older(message: BagMessage) -> BagMessage:
    text = decode_text(message.data).replace(f'"version": {ALGORITHM_VERSION}', '"version": 1')
    assert '"version": 1' in text
    return message._replace(data=encode_text(text))


@pytest.mark.parametrize(
    ('type_name', 'number', 'change'),
    [
        (ESTIMATE_TYPE, 700, other_byte),
        (ESTIMATE_TYPE, 700, lambda _: None),
        (FORCE_TYPE, 700, lambda _: None),
        (STATE_TYPE, 9, other_learnt),
        (STATE_TYPE, 9, older),
        (STATE_TYPE, 9, lambda message: message._replace(data=encode_text('{}'))),
        (STATE_TYPE, 9, lambda message: message._replace(data=b'')),
    ],
)
def test_nothing_is_concluded_from_stretches_that_differ_or_do_not_fit(
    recorded: Path, tmp_path: Path, type_name: str, number: int, change, monkeypatch
):
    bag = rewrite(recorded, tmp_path / 'bag', nth(type_name, number, change))
    assert shared(bag) is None
    alone = replay(bag)
    assert alone.identical == (type_name == STATE_TYPE)
    monkeypatch.setattr(parallel_replay, 'BULK_FROM', 0)
    assert replay_many([bag], workers=2)[0].result == alone  # in one go


def test_an_answer_beyond_a_state_is_no_answer_to_its_stretch(recorded: Path, tmp_path: Path):
    """Every answer is there, one of them after the state that follows it: only one go can tell."""
    messages = list(read_messages(recorded))
    place = [i for i, message in enumerate(messages) if message.topic == STATE][5]
    before = max(i for i in range(place) if messages[i].type_name == ESTIMATE_TYPE)
    moved = messages.pop(before)
    messages.insert(place, moved._replace(log_time=messages[place - 1].log_time))
    with BagWriter(tmp_path / 'bag') as writer:
        for message in messages:
            writer.write(*message)
    assert replay(tmp_path / 'bag').identical
    assert shared(tmp_path / 'bag') is None


def test_answers_that_lack_just_before_a_state_is_a_difference(recorded: Path, tmp_path: Path):
    """At the end of a bag the last answer may lack, since a recording may stop there; amid a bag it may not."""
    messages = list(read_messages(recorded))
    place = [i for i, message in enumerate(messages) if message.topic == STATE][5]
    velocity = max(i for i in range(place) if messages[i].type_name == VELOCITY_TYPE)
    assert place - velocity == 3  # estimate and feed-forward
    del messages[velocity + 1 : place]
    with BagWriter(tmp_path / 'bag') as writer:
        for message in messages:
            writer.write(*message)
    assert shared(tmp_path / 'bag') is None
    assert replay(tmp_path / 'bag').differing == 2


def test_a_bag_of_several_files_is_shared_too(recorded: Path, tmp_path: Path):
    with BagWriter(tmp_path / 'bag', split_size=50_000) as writer:
        for message in read_messages(recorded):
            writer.write(*message)
    assert len(storage(tmp_path / 'bag').files) > 5
    assert len({file for file, _ in times_of(tmp_path / 'bag', STATE)}) > 5
    assert shared(tmp_path / 'bag') == replay(recorded)


def test_what_cannot_be_shared_is_replayed_in_one_go(recorded: Path, monkeypatch):
    assert verify_shared(recorded, workers=2) is None  # short
    assert verify_shared(recorded, workers=1, bulk_from=0) is None
    assert verify_shared(recorded.parent / 'inputs', workers=2, bulk_from=0) is None  # without states
    assert verify_shared(recorded, workers=2, bulk_from=0) == replay(recorded)
    monkeypatch.setattr(shared_replay, 'times_of', lambda *_: (_ for _ in ()).throw(OSError('gone')))
    assert verify_shared(recorded, workers=2, bulk_from=0) is None


def test_the_command_says_the_same_however_many_workers_there_are(recorded: Path, capsys, monkeypatch):
    asked = []
    real = shared_replay.verify_stretches
    monkeypatch.setattr(shared_replay, 'verify_stretches', lambda *a: asked.append(a) or real(*a))
    monkeypatch.setattr(parallel_replay.verify_shared, '__kwdefaults__', {'bulk_from': 0})
    said = []
    for workers in ('1', '2'):
        assert main(['replay', str(recorded), '--verify', '--workers', workers]) == 0
        said.append(capsys.readouterr())
    assert said[0] == said[1]
    assert len(asked) == 1


# -- reading a part of a bag ------------------------------------------------------------------------------------------


def kind_of(topic: str, _: str) -> Kind:
    return Kind.OTHER


def read(bag: Path, stretch: Stretch | None = None) -> list[tuple[int, bytes]]:
    return [
        (int(messages.received[number]), messages.message(number))
        for messages in read_in_bulk(bag, kind_of, stretch)
        for number in range(len(messages.kinds))
    ]


def test_stretches_of_a_bag_hold_each_of_its_messages_once(recorded: Path, tmp_path: Path):
    with BagWriter(tmp_path / 'bag', split_size=50_000) as writer:
        for message in read_messages(recorded):
            writer.write(*message)
    files, end = len(storage(tmp_path / 'bag').files), LAST_TIME + 1
    for bag, last in ((recorded, 0), (tmp_path / 'bag', files - 1)):
        whole = read(bag)
        chances = random.Random(5)  # noqa: S311  no secret depends on it
        for _ in range(20):
            places = sorted(
                (chances.randint(0, last), chances.choice(whole)[0] + chances.randint(-1, 1)) for _ in '123'
            )
            ends = [(0, 0), *places, (last, end)]
            parts = [read(bag, Stretch(*a, *b)) for a, b in pairwise(ends)]
            assert [message for part in parts for message in part] == whole


def test_the_index_of_a_bag_tells_the_times_of_a_topic(recorded: Path, tmp_path: Path):
    expected = [message.log_time for message in read_messages(recorded) if message.topic == STATE]
    assert [time for _, time in times_of(recorded, STATE)] == expected
    assert times_of(recorded, '/nobody') == []
    with (tmp_path / 'bare.mcap').open('wb') as file:  # another writer, without an index
        writer = Writer(file, use_chunking=False)
        writer.start()
        schema = writer.register_schema(STATE_TYPE, 'ros2msg', b'string data\n')
        channel = writer.register_channel(STATE, 'cdr', schema)
        writer.add_message(channel, 5, encode_text('x'), 5)
        writer.finish()
    assert times_of(tmp_path / 'bare.mcap', STATE) == []
