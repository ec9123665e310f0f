"""What a view holds of one estimator: the newest message of each topic, and what could not be read is counted."""

from seal_friction_ros.core.estimation.feedforward import FeedForward
from seal_friction_ros.core.estimation.messages import FEEDFORWARD_TYPE, PRESSURE_TYPE, encode
from seal_friction_ros.core.estimation.records import Pressure
from seal_friction_ros.core.machine.newest_messages import TopicMessage, encode_newest
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


def test_what_cannot_be_read_is_counted_and_the_rest_is_held():
    shown = view()
    shown.take_newest(encode_newest(NEWEST)[:-1], 12)
    shown.take_newest(encode_newest([TopicMessage(*NEWEST[0][:2], b'\0'), NEWEST[1]]), 12)
    assert shown.malformed == 2
    assert set(shown.held[''].records) == {FeedForward}
