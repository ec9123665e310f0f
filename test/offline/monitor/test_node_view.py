"""What a view holds of one estimator: the newest message of each topic, and what could not be read is counted."""

import json
import random
from collections.abc import Iterator
from typing import Any

import pytest
from harness.closed_loop_bags import START, write_closed_loop
from harness.machines import EXCAVATOR, installed, made

from seal_friction_ros.core.estimation.configuration import first_snapshot, snapshot_text
from seal_friction_ros.core.machine import machine
from seal_friction_ros.core.machine.machine_snapshot import machine_text, snapshot_of
from seal_friction_ros.core.messages.coder import encode, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, FEEDFORWARD_TYPE, PRESSURE_TYPE
from seal_friction_ros.core.messages.records import FeedForward, Pressure
from seal_friction_ros.core.messages.together import TopicMessage, encode_newest
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.files import default_configuration
from seal_friction_ros.offline.bags.bag import read_messages
from seal_friction_ros.offline.monitor.live_view import LiveView
from seal_friction_ros.offline.monitor.node_view import NodeView

PRESSURE, FORCE = Pressure(10, 2e6, 1e6), FeedForward(11, 5.0, 0.9, 0)
NEWEST = [
    TopicMessage('/axis/cylinder_pressure', PRESSURE_TYPE, encode(PRESSURE)),
    TopicMessage('/friction_feedforward', FEEDFORWARD_TYPE, encode(FORCE)),
]


def view() -> NodeView:
    made = NodeView('/friction_estimator', lambda _: {})
    made.without_configuration()
    return made


def test_newest_inputs_and_answers_are_held_with_their_time_of_receipt():
    shown = view()
    shown.take_newest(encode_newest(NEWEST), 12)
    assert shown.held[''].records == {Pressure: PRESSURE, FeedForward: FORCE}
    assert set(shown.held[''].receipts.values()) == {12}
    assert shown.malformed == 0


TEXTS = (
    snapshot_text(first_snapshot(default_configuration())),
    machine_text(snapshot_of(made(EXCAVATOR), machine.init(made(EXCAVATOR)))),
)
STRANGE: tuple[Any, ...] = (
    None, True, -1, 1e308, float('nan'), float('inf'), '', 'x', '0x1p2000', [], {}, [1], [[]], {'a': 1}, 2**70,
)  # fmt: skip


def followed() -> NodeView:
    return NodeView('/axis', lambda types: {kind: installed(kind) for kind in types})


@pytest.mark.parametrize('opened', ['{"a":', '[', '{"machine":[', '{"machine":{},"actuators":{"a":'], ids=str)
def test_a_configuration_as_deep_as_one_likes_is_counted_and_said(opened: str):
    shown = followed()
    shown.take('/axis/configuration', CONFIGURATION_TYPE, encode_text(opened * 100_000), 1)
    assert shown.malformed == 1
    assert shown.refused.startswith('configuration')
    assert shown.known == {}
    shown.take('/axis/configuration', CONFIGURATION_TYPE, encode_text(TEXTS[0]), 2)
    assert shown.refused == ''
    assert list(shown.known) == ['']


def places(document: Any, above: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Path of every value of a document."""
    keys = document if isinstance(document, dict) else range(len(document)) if isinstance(document, list) else ()
    for key in keys:
        yield (*above, key)
        yield from places(document[key], (*above, key))


def test_no_configuration_ends_the_view():
    """One value of a good one is another, or missing: it is read or refused, and the view goes on."""
    chance, taken = random.Random(43), [0, 0]  # noqa: S311  no secret
    for number in range(1200):
        document = json.loads(TEXTS[number % 2])
        *above, last = chance.choice(list(places(document)))
        node = document
        for key in above:
            node = node[key]
        if number % 5:
            node[last] = chance.choice(STRANGE)
        else:
            del node[last]
        shown, view = followed(), LiveView(0)
        view.add(shown)
        shown.take('/axis/configuration', CONFIGURATION_TYPE, encode_text(json.dumps(document)), 1)
        view.sample(2)
        json.dumps(view.view('', -1.0), allow_nan=False)
        taken[bool(shown.refused)] += 1
    assert min(taken) > 20  # both happen


def test_what_cannot_be_read_is_counted_and_the_rest_is_held():
    shown = view()
    shown.take_newest(encode_newest(NEWEST)[:-1], 12)
    shown.take_newest(encode_newest([TopicMessage(*NEWEST[0][:2], b'\0'), NEWEST[1]]), 12)
    assert shown.malformed == 2
    assert set(shown.held[''].records) == {FeedForward}


def test_a_feed_forward_that_raises_the_error_is_told_while_it_acts(tmp_path):
    """Two seconds each without, with twice the friction, and without again; what is told a tenth before each end."""
    bag = write_closed_loop(tmp_path / 'loop', (0.0, 2.0, 0.0), waves=(Sine(amplitude=0.0005),))
    shown, told = followed(), []
    ends = [1.9, 3.9, 5.9]  # [s]
    for message in read_messages(bag):
        while ends and message.log_time > START + ends[0] * 1e9:
            told.append([one.what for one in shown.findings('') if 'raises the tracking error' in one.what])
            ends.pop(0)
        shown.take(message.topic, message.type_name, message.data, message.log_time)
    assert [len(whats) for whats in told] == [0, 1, 0]
