"""The SROS2 policy allows what the running nodes have, and nothing else: neither can drift from the other."""

from contextlib import contextmanager
from xml.etree import ElementTree

import pytest
from harness.spin_nodes import ros_context
from paths import ROOT
from rclpy.parameter import Parameter

from seal_friction_ros.nodes.friction_estimator import FrictionEstimator
from seal_friction_ros.nodes.servo_simulator import ServoSimulator

POLICY = ROOT / 'config' / 'security' / 'policy.xml'
# Every way a node can be wired: the policy has to allow each, and nothing beyond all of them.
WIRINGS = {
    'friction_estimator': (FrictionEstimator, [{}, {'use_sim_time': True}]),
    'servo_simulator': (ServoSimulator, [{}, {'wave': 'topic', 'publish_clock': True}]),
}


def allowed(node: str, kind: str, direction: str) -> set[str]:
    """Absolute names that the policy allows a node without a namespace."""
    tree = ElementTree.parse(POLICY)  # noqa: S314  our own file
    (profile,) = tree.iterfind(f".//profile[@node='{node}']")
    names = [item.text or '' for part in profile.iterfind(f"{kind}[@{direction}='ALLOW']") for item in part]
    return {name.replace('~', f'/{node}') if name[0] in '/~' else f'/{name}' for name in names}


@contextmanager
def running(kind, values):
    with ros_context() as context:
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        node = kind(context=context, parameter_overrides=overrides)
        try:
            assert node.autostart()
            yield node
        finally:
            node.finish()
            node.destroy_node()


@pytest.mark.parametrize('name', WIRINGS)
def test_the_policy_is_what_the_nodes_have(name):
    kind, wirings = WIRINGS[name]
    # rcl gives a node name one publisher on /rosout per process, and an earlier test may have it.
    found = {'publish': {'/rosout'}, 'subscribe': set(), 'reply': set(), 'request': set()}
    for values in wirings:
        with running(kind, values) as node:
            where = name, node.get_namespace()
            found['publish'] |= {topic for topic, _ in node.get_publisher_names_and_types_by_node(*where)}
            found['subscribe'] |= {topic for topic, _ in node.get_subscriber_names_and_types_by_node(*where)}
            found['reply'] |= {service for service, _ in node.get_service_names_and_types_by_node(*where)}
            found['request'] |= {service for service, _ in node.get_client_names_and_types_by_node(*where)}
    assert found['publish'] == allowed(name, 'topics', 'publish')
    assert found['subscribe'] == allowed(name, 'topics', 'subscribe')
    assert found['reply'] == allowed(name, 'services', 'reply')
    assert found['request'] == allowed(name, 'services', 'request') == set()


def test_nothing_is_allowed_by_a_wildcard():
    assert '*' not in POLICY.read_text()
