"""``seal_friction topics``: look at the topics of running nodes, set their parameters, call their services."""

import argparse
import json
import subprocess
import sys
from importlib.util import find_spec
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.status import show_status
from seal_friction_ros.offline.work.targets import LIVE_PARAMETERS, mark

_ARGUMENTS = ('topic', 'seconds', 'count', 'node', 'name', 'value', 'service', 'request', 'wait', 'json', 'save')


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'look at the topics of running nodes, set parameters, call services: where there is no ros2 command'
    examples = ('topics list', 'topics hz rod_velocity', 'topics param friction_estimator feedforward.scale 0.0')
    steps = cli.add_group(commands, 'topics', 'COMMAND', description, *examples)
    listed, rate, shown, parameter, call = (
        cli.add_command(steps, action, run, text, *(f'topics {action}{example}' for example in of_action))
        for action, (text, *of_action) in _ACTIONS.items()
    )
    for step in (rate, shown):
        step.add_argument('topic', help='name of the topic')
        text = 'time to listen, 5 s unless given' if step is rate else 'time to listen at most; default: until Ctrl-C'
        step.add_argument('--seconds', type=cli.positive, default=5.0 if step is rate else None, help=text)
    shown.add_argument('--count', type=cli.at_least(1), metavar='N', help='end after N messages')
    parameter.add_argument('node', help='name of the node')
    parameter.add_argument('name', nargs='?', help='parameter; default: list all')
    parameter.add_argument('value', nargs='?', help='value to set, as in YAML')
    text = 'write what changes live into a parameter file, for the next start'
    cli.add_target(parameter, '--save', LIVE_PARAMETERS, metavar='FILE.yaml', help=text)
    call.add_argument('service', help='name of the service')
    call.add_argument('request', nargs='?', default='{}', help='fields of the request, as in YAML; default: empty')
    for step, action in zip((listed, rate, shown, parameter, call), _ACTIONS, strict=True):
        wait, what = (1.5, 'the names on the graph') if step is listed else (10.0, 'a name on the graph or an answer')
        text = f'wait for {what}, {wait:g} s unless given'
        step.add_argument('--wait', type=cli.positive, default=wait, metavar='SECONDS', help=text)
        step.set_defaults(action=action)


_ACTIONS = {
    'list': ('list topics with type, publishers and subscribers', ''),
    'hz': ('measure the rate of a topic and the gaps between its messages', ' rod_velocity'),
    'echo': ('print the messages of a topic', ' friction_estimate --count 1'),
    'param': (
        'list, get, set or save parameters of a node',
        ' friction_estimator',
        ' friction_estimator feedforward.scale',
        ' friction_estimator feedforward.scale 0.0',
        ' friction_estimator --save tuned.yaml',
    ),
    'call': ('call a service', ' friction_estimator/start_recording'),
}
"""Action -> its description, and what follows its name in examples."""


def run(arguments: argparse.Namespace) -> int:
    """Run the tool in a process of its own, so that this one needs no ROS."""
    if find_spec('rclpy') is None:
        raise ValueError('topics needs ROS 2: source your distribution, or run make setup')
    given = {name: value for name, value in vars(arguments).items() if name in _ARGUMENTS and value is not None}
    if 'save' in given:
        return _save(arguments, {**given, 'save': True, 'json': True})
    return _tool(arguments.action, given).returncode


def _tool(action: str, given: dict[str, Any], **options: Any) -> subprocess.CompletedProcess[str]:
    task = json.dumps({'action': action, **given})
    show_status('')
    command = [sys.executable, '-m', 'seal_friction_ros.nodes.topic_tool', task]
    return subprocess.run(command, check=False, text=True, **options)


def _save(arguments: argparse.Namespace, given: dict[str, Any]) -> int:
    """Write the parameters of a node that change live into a parameter file."""
    from seal_friction_ros.offline.work.atomic_file import write_whole

    if arguments.name:
        raise ValueError(f'--save writes all that changes live: leave out {arguments.name}')
    found = _tool(arguments.action, given, stdout=subprocess.PIPE)
    if found.returncode:
        return found.returncode
    saved = json.loads(found.stdout)
    write_whole(arguments.save, _parameter_text(**saved).encode())
    count, path = len(saved['parameters']), arguments.save
    text = f'{path}: {count} parameters of {saved["node"]}; give it after your own: --params-file {path}'
    return cli.print_result(arguments, {'file': path, **saved}, text)


def _parameter_text(node: str, parameters: list[dict[str, Any]]) -> str:
    import yaml

    lines = [f'# What changes live of {node}, {mark("topics")} param. Give it after your own file.', f'{node}:']
    lines.append('  ros__parameters:')
    for one in parameters:
        value = yaml.safe_dump(one['value'], default_flow_style=True, width=1000).split('\n')[0]
        lines.append(f'    {one["name"]}: {value}  # {one["meaning"]}')
    return '\n'.join(lines) + '\n'
