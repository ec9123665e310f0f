"""The SROS2 policy allows what the running nodes have, and nothing else: neither can drift from the other."""

import re
from contextlib import contextmanager
from xml.etree import ElementTree

import pytest
import yaml
from harness.spin_nodes import ros_context
from paths import ROOT
from rclpy.parameter import Parameter

from seal_friction_ros.nodes.friction_estimator import FrictionEstimator
from seal_friction_ros.nodes.machine_estimator import MachineEstimator
from seal_friction_ros.nodes.servo_simulator import ServoSimulator
from seal_friction_ros.offline.commands.main import main

POLICY = ROOT / 'config' / 'security' / 'policy.xml'
# Every way a node can be wired: the policy has to allow each, and nothing beyond all of them.
WIRINGS = {
    'friction_estimator': (FrictionEstimator, [{}, {'use_sim_time': True}]),
    'servo_simulator': (ServoSimulator, [{}, {'wave': 'topic', 'publish_clock': True}]),
}


RIGHTS = {'subscribe': 'topics', 'publish': 'topics', 'reply': 'services', 'request': 'services'}


def allowed(policy: str, node: str) -> dict[str, set[str]]:
    """Absolute names for which a policy gives a node without a namespace each right."""
    tree = ElementTree.fromstring(policy)  # noqa: S314  our own file
    (profile,) = tree.iterfind(f".//profile[@node='{node}']")

    def names(kind: str, right: str) -> set[str]:
        found = [item.text or '' for part in profile.iterfind(f"{kind}[@{right}='ALLOW']") for item in part]
        return {name.replace('~', f'/{node}') if name[0] in '/~' else f'/{name}' for name in found}

    return {right: names(kind, right) for right, kind in RIGHTS.items()}


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
    policy = POLICY.read_text()
    assert rights_of(*WIRINGS[name], name) == allowed(policy, name)


OF_EVERY_NODE = ('/transition_event', '/parameter_events', '/rosout')


@pytest.mark.parametrize('name', WIRINGS)
def test_topics_in_the_docs_are_those_of_the_node(name):
    page = (ROOT / 'docs' / 'interfaces.md').read_text()
    section = page.split(f'## Node `{name}`')[1].split('\n## ')[0].split('\n| service |')[0]
    documented: dict[str, set[str]] = {'in': set(), 'out': set()}
    for topics, about in re.findall(r'^\| (`.+`) \| .+? \| (.+) \|$', section, re.MULTILINE):
        for way in re.findall(r'\b(in|out)\b', about.split(':')[0]) if 'in bags only' not in about else ():
            documented[way] |= {topic.replace('~', f'/{name}') for topic in re.findall(r'`(\S+?)`', topics)}
    rights = allowed(POLICY.read_text(), name)
    for way, right in (('in', 'subscribe'), ('out', 'publish')):
        found = {topic for topic in rights[right] if not topic.endswith(OF_EVERY_NODE)}
        assert {topic if topic[0] == '/' else f'/{topic}' for topic in documented[way]} == found


def test_the_policy_of_a_machine_is_what_its_node_has(tmp_path):
    for path in (*machines(), write_together(tmp_path)):
        target = tmp_path / f'{path.stem}.xml'
        assert main(['new', 'policy', str(path), '--out', str(target)]) == 0
        wirings = [{'machine': str(path)}, {'machine': str(path), 'use_sim_time': True}]
        found = rights_of(MachineEstimator, wirings, 'machine_estimator')
        assert found == allowed(target.read_text(), 'machine_estimator')


def machines():
    """Mapping files whose messages are installed: control_msgs is not."""
    return [
        path for path in sorted((ROOT / 'config' / 'machines').glob('*.yaml')) if 'control_msgs' not in path.read_text()
    ]


def write_together(folder):
    """Write a mapping file with one message for all answers, an ambient pressure that is measured, and an angle."""
    document = yaml.safe_load((ROOT / 'config' / 'machines' / 'test_bench.yaml').read_text())
    document['topics'] |= {'/ambient': 'sensor_msgs/msg/FluidPressure', '/angle': 'std_msgs/msg/Float64'}
    document |= {'answers': 'together', 'ambient_pressure': '/ambient'}
    for actuator in document['actuators'].values():
        actuator['force_sum']['weight'] = {'mass': '80 kg', 'angle': '/angle'}
    path = folder / 'together.yaml'
    path.write_text(yaml.safe_dump(document))
    return path


def rights_of(kind, wirings, name):
    """Names that a node uses by each right, in any of its wirings."""
    # rcl gives a node name one publisher on /rosout per process, and an earlier test may have it.
    found = {'subscribe': set(), 'publish': {'/rosout'}, 'reply': set(), 'request': set()}
    for values in wirings:
        with running(kind, values) as node:
            where = name, node.get_namespace()
            found['publish'] |= {topic for topic, _ in node.get_publisher_names_and_types_by_node(*where)}
            found['subscribe'] |= {topic for topic, _ in node.get_subscriber_names_and_types_by_node(*where)}
            found['reply'] |= {service for service, _ in node.get_service_names_and_types_by_node(*where)}
            found['request'] |= {service for service, _ in node.get_client_names_and_types_by_node(*where)}
    assert not found['request']
    return found


def test_nothing_is_allowed_by_a_wildcard():
    assert '*' not in POLICY.read_text()
