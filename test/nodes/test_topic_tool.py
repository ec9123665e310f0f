"""``seal_friction topics``: topics, rates, messages, parameters and services of a running estimator."""

import json
import subprocess
import sys

import pytest
import yaml
from harness.compensation import LIVE
from harness.pages import blocks_of
from harness.processes import free_domain, graph_environment, node_process
from harness.spin_nodes import ros_context
from paths import ROOT
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from seal_friction_ros.nodes import topic_tool
from seal_friction_ros.nodes.friction_estimator import FrictionEstimator
from seal_friction_ros.nodes.topic_tool import filled, for_reading, plain
from seal_friction_ros.offline.commands import topics
from seal_friction_ros.offline.commands.main import main


@pytest.fixture(scope='module')
def domain(tmp_path_factory):
    """A domain with an estimator and a simulated servo."""
    domain, folder = free_domain(), tmp_path_factory.mktemp('topics')
    log, recording = folder / 'nodes.log', {'record_directory': str(folder)}
    simulator = ROOT / 'config' / 'servo_simulator.yaml'
    with (
        node_process('friction_estimator', domain, {**LIVE, **recording}, log),
        node_process('servo_simulator', domain, {'rate': 500.0}, log, parameter_file=simulator),
    ):
        code, said = run(domain, 'echo', 'friction_estimate', '--count', '1', '--seconds', '120')
        while code == 2 and 'friction_estimate within' in said:  # the nodes are still loading
            code, said = run(domain, 'echo', 'friction_estimate', '--count', '1', '--seconds', '120')
        assert code == 0, log.read_text() + said
        yield domain


@pytest.fixture
def tool(domain, monkeypatch, capsys):
    """The command without its processes: gives the exit code, and what was printed."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))

    def run_task(task: list[str], *, stdout: int | None = None, **_: bool) -> subprocess.CompletedProcess:
        monkeypatch.setattr(sys, 'argv', task[2:])
        code = topic_tool.main()
        return subprocess.CompletedProcess(task, code, capsys.readouterr().out if stdout else None)

    def run_here(*arguments: str) -> tuple[int, str]:
        monkeypatch.setattr(topics.subprocess, 'run', run_task)
        code = main(['topics', *arguments])
        said = capsys.readouterr()
        return code, said.out or said.err

    return run_here


def run(domain: int, *arguments: str) -> tuple[int, str]:
    """Exit code, and what was printed, by the command in a process of its own."""
    command = [sys.executable, '-m', 'seal_friction_ros', 'topics', *arguments]
    result = subprocess.run(
        command, cwd=ROOT, env=graph_environment(domain), capture_output=True, text=True, check=False
    )
    return result.returncode, result.stdout or result.stderr


def test_list_names_type_publisher_and_subscriber_of_each_topic(tool):
    for _ in range(10):  # it lists what it hears within its wait, which is not all on a busy machine
        code, said = tool('list', '--json')
        listed = json.loads(said)
        assert code == 0
        seen = listed.get('/rod_velocity', {})
        if '/servo_simulator' in seen.get('publishers', []) and '/friction_estimator' in seen.get('subscribers', []):
            break
    assert listed['/rod_velocity'] == {
        'type': 'seal_friction_msgs/msg/RodVelocity',
        'publishers': ['/servo_simulator'],
        'subscribers': ['/friction_estimator'],
    }
    assert not any('seal_friction_topics' in str(one) for one in listed.values())


def test_hz_counts_the_messages_of_the_simulator(tool):
    code, said = tool('hz', 'rod_velocity', '--seconds', '1', '--json')
    rate = json.loads(said)
    assert code == 0
    assert rate['messages'] > 100
    assert rate['shortest_gap_s'] <= rate['mean_gap_s'] <= rate['longest_gap_s']
    assert rate['rate_Hz'] == pytest.approx(1.0 / rate['mean_gap_s'])


def test_echo_prints_every_field_of_a_message(tool):
    code, said = tool('echo', '/friction_estimate', '--count', '2', '--json')
    messages = [json.loads(line) for line in said.splitlines()]
    assert (code, len(messages)) == (0, 2)
    assert {'header', 'coulomb_friction', 'state', 'status'} <= set(messages[0])


def test_a_topic_that_is_not_there_is_one_line_with_what_there_is(tool):
    code, said = tool('hz', 'rod_velocty', '--wait', '1')
    if 'did you mean' not in said:  # a busy machine takes longer to find the topics
        code, said = tool('hz', 'rod_velocty')
    assert code == 2
    assert said.count('\n') == 1
    assert 'did you mean /rod_velocity?' in said


def test_param_sets_what_the_node_accepts_and_says_why_it_refuses(tool):
    name = 'feedforward.scale'
    assert tool('param', 'friction_estimator', name, '0.25') == (0, f'{{{name}: 0.25}}\n')
    assert json.loads(tool('param', 'friction_estimator', '--json')[1])[name] == 0.25
    code, said = tool('param', 'friction_estimator', name, '-1')
    assert code == 1
    assert '0.25' in said
    assert 'refused: ' in said
    code, said = tool('param', 'friction_estimator', 'feedforward.scal')
    assert code == 2
    assert f'did you mean {name}?' in said


def test_param_saves_what_was_tuned_live_and_the_next_node_takes_it(tool, tmp_path):
    path, name = tmp_path / 'tuned.yaml', 'feedforward.lead_time'
    assert tool('param', 'friction_estimator', name, '0.0045')[0] == 0
    code, said = tool('param', 'friction_estimator', '--save', str(path))
    assert code == 0, said
    with ros_context() as context:
        node = FrictionEstimator(context=context, cli_args=['--ros-args', '--params-file', str(path)])
        assert node.get_parameter(name).value == 0.0045
        node.destroy_node()
    (parameters,) = (part['ros__parameters'] for part in yaml.safe_load(path.read_text()).values())
    assert set(parameters) > {'feedforward.scale', 'adaptation.mode', 'stick_velocity'}
    assert not {'seals', 'record', 'use_sim_time'} & set(parameters)
    path.write_text('my own\n')
    code, said = tool('param', 'friction_estimator', '--save', str(path))
    assert (code, path.read_text()) == (2, 'my own\n')
    assert 'not overwriting' in said


def test_call_finds_the_type_of_a_service_and_a_refusal_is_exit_code_1(tool):
    code, said = tool('call', 'friction_estimator/stop_recording', '--json')
    assert code == 1
    assert json.loads(said) == {'success': False, 'message': 'not recording'}
    code, said = tool('call', 'friction_estimator/stop_recording', '{data: true}')
    assert code == 2
    assert 'has no field data' in said


def test_every_command_of_the_docs_runs(tool, tmp_path, monkeypatch):
    (tmp_path / 'build').mkdir()
    monkeypatch.chdir(tmp_path)
    (block,) = (b for b in blocks_of(ROOT / 'docs' / 'interfaces.md') if b.kind == 'topics')
    for line in block.text.splitlines():
        code, said = tool(*line.removeprefix('seal_friction topics ').split())
        assert code == 0, f'{line}: {said}'
    assert 'success: true' in said


def test_no_action_but_recording_loads_what_reads_and_writes_bags():
    program = "import sys, seal_friction_ros.nodes.topic_tool; print([one for one in sys.modules if '.bags' in one])"
    assert subprocess.run([sys.executable, '-c', program], capture_output=True, check=True).stdout == b'[]\n'


def test_fields_are_set_by_name_and_of_their_type():
    assert filled(SetBool.Request(), {'data': True}).data is True
    with pytest.raises(ValueError, match='has no field date: did you mean data'):
        filled(SetBool.Request(), {'date': True})
    with pytest.raises(ValueError, match="data: 'yes' is no boolean"):
        filled(SetBool.Request(), {'data': 'yes'})
    assert plain(filled(SetBool.Request(), {'data': True})) == {'data': True}


def test_of_a_long_array_a_person_sees_the_beginning_and_a_program_all():
    message = plain(Parameter('numbers', value=[0.0] * 50).to_parameter_msg())
    assert message['value']['double_array_value'] == [0.0] * 50
    assert for_reading(message)['value']['double_array_value'] == [0.0] * 20 + ['... 30 more']


def test_without_ros_one_line_says_what_to_do(monkeypatch, capsys):
    monkeypatch.setattr(topics, 'find_spec', lambda _: None)
    assert main(['topics', 'list']) == 2
    assert capsys.readouterr().err == 'seal_friction: topics needs ROS 2: source your distribution, or run make setup\n'
