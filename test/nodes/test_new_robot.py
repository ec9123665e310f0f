"""A mapping file from the topics of a running machine."""

import subprocess
import sys

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from harness.processes import free_domain, graph_environment
from harness.spin_nodes import SpunNodes, ros_context
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import String

from seal_friction_ros.files import read_machine


def new_robot(out, domain, *options):
    command = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main', 'new', 'robot', '--from-topics']
    return subprocess.Popen(
        [*command, *options, '--out', str(out)],
        env=graph_environment(domain),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def drivers():
    """A machine on a domain of its own, whose joint slides; pressures are gauge, against the definition of the type."""
    domain = free_domain()
    with ros_context(domain) as context:
        node = Node('drivers', context=context)
        senders = {
            topic: node.create_publisher(kind, topic, qos_profile_sensor_data)
            for topic, kind in (('/joint_states', JointState), ('/ram/p_a', FluidPressure), ('/ram/p_b', FluidPressure))
        }
        position = 0.0

        def send():
            nonlocal position
            position += 1e-4
            senders['/joint_states'].publish(JointState(name=['ram'], position=[position], velocity=[0.05]))
            for chamber, pressure in (('a', 2.0e6), ('b', 0.0)):
                senders[f'/ram/p_{chamber}'].publish(FluidPressure(fluid_pressure=pressure))

        node.create_timer(0.002, send)
        idle = Node('idle', context=context, start_parameter_services=False)
        idle.create_publisher(WrenchStamped, '/load_cell', 10)
        compiling = Node('compiling', context=context)
        yield domain, SpunNodes(context, node)
        for made in (node, idle, compiling):
            made.destroy_node()


def test_the_mapping_file_of_a_running_machine_loads_and_names_gauge_pressures(tmp_path, drivers):
    domain, nodes = drivers
    process = new_robot(tmp_path / 'robot.yaml', domain, '1')
    assert nodes.spin_until(lambda: process.poll() is not None)
    said, errors = process.communicate()
    assert process.returncode == 0, errors
    text = (tmp_path / 'robot.yaml').read_text()
    (ram,) = read_machine(str(tmp_path / 'robot.yaml')).actuators
    assert ram.name == 'ram'
    assert set(ram.inputs) == {'position', 'velocity', 'pressure_a', 'pressure_b'}
    assert text.count('absolute: false}') == 2
    assert yaml.safe_load(text)['topics']['/ram/p_a'] == 'sensor_msgs/msg/FluidPressure'
    assert 'gauge' in said
    assert 'missing: /load_cell of /idle is there but silent' in said
    assert 'missing: node /compiling is there but silent' in said
    assert 'node /idle' not in said
    assert 'node /drivers' not in said
    assert 'bore' in said


def test_a_graph_without_a_machine_is_one_line_with_all_types_and_the_nodes_that_are_silent(tmp_path):
    types = '/ram/p_a (sensor_msgs/msg/FluidPressure, std_msgs/msg/String)'
    with ros_context(domain := free_domain()) as context, ros_context(domain) as other:
        compiling, idle, foreign = (
            Node('compiling', context=context),
            Node('idle', context=context),
            Node('foreign', context=other),
        )
        compiling.create_publisher(DiagnosticArray, '/diagnostics', 10)
        idle.create_publisher(FluidPressure, '/ram/p_a', 10)
        foreign.create_publisher(String, '/ram/p_a', 10)
        for wait in ('0.5', '4', '30'):  # a busy machine takes longer to find the nodes
            process = new_robot(tmp_path / 'robot.yaml', domain, '--wait', wait)
            _, said = process.communicate(timeout=120)
            assert process.returncode == 2
            assert f'no message of a type that can be an input within {wait} s' in said
            assert len(said.strip().splitlines()) == 1
            if types in said and 'node /compiling' in said:
                break
        for made in (compiling, idle, foreign):
            made.destroy_node()
    assert types in said
    assert 'silent: /ram/p_a of /foreign, /idle; node /compiling' in said
    assert not (tmp_path / 'robot.yaml').exists()
