"""Duplicate publishers and endpoints that cannot exchange messages are reported with the node and the reason."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from harness.live_graph import graph
from harness.spin_nodes import ros_context
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from seal_friction_msgs.msg import FrictionEstimate, RodVelocity
from std_msgs.msg import Float64

from seal_friction_ros.nodes import qos
from seal_friction_ros.nodes.graph_watch import full_name, incompatibility, other_definitions, why_unheard
from seal_friction_ros.offline.replay.replay import replay

SECOND = 10**9  # [ns]
BOOL = 1  # rcl_interfaces/ParameterType
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def boolean(name: str, value: bool) -> Parameter:
    return Parameter(name=name, value=ParameterValue(type=BOOL, bool_value=value))


def test_a_best_effort_publisher_is_heard():
    with graph(qos=qos_profile_sensor_data) as g:
        assert g.spin_until(lambda: g.probe.velocity.get_subscription_count() == 1)
        g.connect()
        assert g.estimate(SECOND, 0.1).state == FrictionEstimate.SLIDING
        (info,) = g.probe.get_subscriptions_info_by_topic('/rod_velocity')
        assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT


def test_a_second_publisher_is_named_and_refused_unless_it_is_allowed(tmp_path: Path):
    with graph({'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}) as g:
        g.connect()
        assert g.estimate(SECOND, 0.1).status == 0
        intruder = Node('intruder', namespace='/other', context=g.context)
        publisher = intruder.create_publisher(RodVelocity, '/rod_velocity', 10)
        words = '/rod_velocity has several publishers: /other/intruder, /probe'
        assert g.spin_until(lambda: words in g.probe.values('estimate').get('message', ''))
        assert g.probe.values('estimate')['level'] == '2'
        refused = g.estimate(SECOND + 10**6, 0.1)
        assert (refused.status, refused.state) == (FrictionEstimate.INPUT_REFUSED, FrictionEstimate.UNKNOWN)

        def refuse(value: bool) -> None:
            request = SetParametersAtomically.Request(parameters=[boolean('refuse_second_publisher', value)])
            answer = g.call(SetParametersAtomically, 'friction_estimator/set_parameters_atomically', request)
            assert answer.result.successful

        refuse(False)
        assert g.estimate(SECOND + 2 * 10**6, 0.1).status == 0
        assert g.spin_until(lambda: g.probe.values('estimate').get('level') == '1')

        refuse(True)
        assert g.estimate(SECOND + 3 * 10**6, 0.1).status == FrictionEstimate.INPUT_REFUSED
        intruder.destroy_publisher(publisher)
        assert g.spin_until(lambda: 'several' not in g.probe.values('estimate').get('message', ''))
        assert g.estimate(SECOND + 4 * 10**6, 0.1).status == 0
        intruder.destroy_node()
    assert replay(tmp_path / 'bag').identical  # the refusal is in the recording


def test_an_input_of_another_type_is_reported_with_the_node_and_the_reason():
    # Within one context the middleware itself refuses a second type.
    with graph() as g, ros_context(g.context.get_domain_id()) as context:
        other = Node('other_driver', context=context)
        other.create_publisher(Float64, '/servo_reference', 10)
        words = (
            '/servo_reference: /other_driver publishes std_msgs/msg/Float64, not seal_friction_msgs/msg/ServoReference'
        )
        assert g.spin_until(lambda: words in g.probe.values('estimate').get('message', ''))
        other.destroy_node()


def test_a_subscriber_that_requests_what_is_not_offered_is_reported_with_the_reason():
    with graph() as g:
        other = Node('logger', context=g.context)
        other.create_subscription(FrictionEstimate, 'friction_estimate', lambda _: None, LATCHED)
        words = '/friction_estimate: /logger wants incompatible quality of service (volatile where transient local'
        assert g.spin_until(lambda: words in g.probe.values('estimate').get('message', ''))
        other.destroy_node()


@pytest.mark.parametrize(
    ('offered', 'requested', 'reason'),
    [
        (qos.STREAM, qos.STREAM, ''),
        (qos.LATCHED, qos.STREAM, ''),
        (qos_profile_sensor_data, qos.best_effort(qos.STREAM), ''),
        (qos_profile_sensor_data, qos.STREAM, 'best effort where reliable is wanted'),
        (qos.STREAM, LATCHED, 'volatile where transient local is wanted'),
        (qos_profile_sensor_data, LATCHED, 'best effort where reliable is wanted, volatile where transient local'),
    ],
)
def test_incompatible_quality_of_service_has_a_reason(offered, requested, reason):
    assert incompatibility(offered, requested).startswith(reason)
    assert bool(incompatibility(offered, requested)) == bool(reason)


def endpoint(
    name: str, namespace: str = '/', topic_type: str = 't', profile: QoSProfile = qos.STREAM, type_hash: str = 'h'
):
    return SimpleNamespace(
        node_name=name, node_namespace=namespace, topic_type=topic_type, qos_profile=profile, topic_type_hash=type_hash
    )


def test_a_node_is_named_with_its_namespace_once_discovery_knows_it():
    assert [full_name(endpoint('a')), full_name(endpoint('a', '/left'))] == ['/a', '/left/a']
    assert full_name(endpoint('_NODE_NAME_UNKNOWN_')) == 'a node of unknown name'


def test_a_publisher_is_unheard_for_its_type_or_its_quality_of_service():
    assert why_unheard(endpoint('a'), 't', qos.STREAM) == ''
    assert why_unheard(endpoint('a'), 'u', qos.STREAM) == '/a publishes t, not u'
    assert why_unheard(endpoint('a'), 't', LATCHED).startswith('/a offers incompatible quality of service (volatile')


def test_another_definition_of_a_message_is_reported_with_the_node_and_the_reason():
    endpoints = [endpoint('a'), endpoint('me'), endpoint('old', type_hash='i'), endpoint('odd', topic_type='u')]
    endpoints.append(endpoint('no_hash', type_hash='INVALID'))
    (text,) = other_definitions('/topic', 't', endpoints, '/me')
    assert text.startswith('/topic: /old has another definition of t (i, not h)')


def test_every_topic_has_the_definition_of_this_node():
    with graph() as g:
        g.connect()
        endpoints = g.estimator.get_publishers_info_by_topic('/rod_velocity')
        endpoints += g.estimator.get_subscriptions_info_by_topic('/rod_velocity')
        assert all(str(found.topic_type_hash).startswith('RIHS01_') for found in endpoints)
        assert other_definitions('/rod_velocity', endpoints[0].topic_type, endpoints, '/friction_estimator') == []
