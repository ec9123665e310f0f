"""A first mapping file from a bag: it loads, and finds the signals that are there."""

import re

import pytest
import yaml
from harness.closed_loop_bags import write_closed_loop
from harness.foreign_messages import CONTROL_MSGS
from harness.machines import installed
from harness.standard_bags import write_standard
from paths import ROOT
from rosbags.rosbag2 import StoragePlugin

from seal_friction_ros.core.machine.machine import make_machine
from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.definitions import parse_definition
from seal_friction_ros.core.messages.records import Position
from seal_friction_ros.files import config_path, machine_configurations, read_machine
from seal_friction_ros.offline.bags.bag import BagError, BagWriter, read_messages
from seal_friction_ros.offline.bags.import_bag import convert_bag
from seal_friction_ros.offline.bags.mapped_bag import read_mapping
from seal_friction_ros.offline.bags.new_machine import new_machine
from seal_friction_ros.offline.commands.main import main


@pytest.fixture(scope='module')
def source(tmp_path_factory):
    return write_closed_loop(tmp_path_factory.mktemp('source') / 'run', scales=(0.0,), seconds=0.3)


@pytest.mark.parametrize('storage', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_the_mapping_that_is_written_imports_the_bag(tmp_path, source, storage):
    foreign = write_standard(source, tmp_path / 'foreign', storage)
    out = tmp_path / 'robot.yaml'
    assert main(['new', 'robot', '--from-bag', str(foreign), '--out', str(out)]) == 0
    axis = yaml.safe_load(out.read_text())['actuators']['axis']
    assert axis['inputs'] == {
        'position': '/joint_states position[axis]',
        'velocity': '/joint_states velocity[axis]',
        'reference_position': '/set position[axis]',
        'reference_velocity': '/set velocity[axis]',
        'pressure_a': '/p_a',
        'pressure_b': '/p_b',
    }
    assert axis['force_sum'] == {'load_force': {'topic': '/load', 'field': 'wrench.force.z', 'gain': -1.0}}
    text = out.read_text()
    assert 'bore: 40 mm  # missing' in text
    assert text.count('Pa: absolute') == 2
    assert convert_bag(foreign, tmp_path / 'imported', read_mapping(str(out)))['axis'].messages['/rod_velocity'] == 300


def test_candidates_for_what_is_missing_are_listed_with_topic_element_and_range(tmp_path, source):
    foreign = write_standard(source, tmp_path / 'foreign')
    kinds = {'/p_a': 'seal_friction_msgs/msg/RodPosition', '/p_b': 'seal_friction_msgs/msg/RodPosition'}
    with BagWriter(tmp_path / 'odd') as writer:  # pressures in a message of a type that is not looked for
        for number, message in enumerate(read_messages(foreign)):
            if message.topic in kinds:
                data = encode(Position(message.log_time, 1e5 + number % 3), b'')
                message = message._replace(type_name=kinds[message.topic], data=data)  # noqa: PLW2901
            writer.write(*message)
    text = new_machine(tmp_path / 'odd')
    (tmp_path / 'robot.yaml').write_text(text)
    assert text.count('missing: no topic found') == 2
    listed = [line for line in text.splitlines() if line.startswith('#   ')]
    assert any(
        re.match(r'#   /p_a position: 1e\+05 to 1e\+05, seal_friction_msgs/msg/RodPosition', line) for line in listed
    )
    assert not any('velocity[axis]' in line for line in listed)
    assert new_machine(foreign).count('candidates') == 1  # bore and rod are missing


def test_the_commands_of_the_docs_run(tmp_path, source, monkeypatch):
    write_standard(source, tmp_path / 'RUN')
    monkeypatch.chdir(tmp_path)
    block = (ROOT / 'docs' / 'machines.md').read_text().split('```')[1]
    commands = [line.partition('#')[0].split()[1:] for line in block.strip().splitlines()]
    assert [words[0] for words in commands] == ['new', 'report', 'tune']
    for words in commands:
        assert main(words) in ((0, 1) if words[0] == 'tune' else (0,))


def test_a_bag_without_joints_is_refused_with_what_it_has(source):
    with pytest.raises(BagError, match='/cylinder_pressure'):
        new_machine(source)


@pytest.mark.parametrize(
    'name', sorted(path.stem for path in config_path('machines', 'test_bench').parent.glob('*.yaml'))
)
def test_every_example_is_a_machine(name):
    file = read_machine(name)
    texts = {kind: CONTROL_MSGS[kind.replace('/', '/msg/')] for kind in file.topics.values() if 'control_msgs' in kind}
    definitions = {
        kind: parse_definition(kind, texts[kind]) if kind in texts else installed(kind) for kind in file.topics.values()
    }
    machine = make_machine(file, machine_configurations(file, name), definitions)
    assert set(machine.plans) == set(file.topics)
    lines = [line for line in config_path('machines', name).read_text().splitlines() if not line.startswith('#')]
    if len(machine.actuators) == 1:
        assert len(lines) <= 25
