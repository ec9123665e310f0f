"""``seal_friction new``: write a file of a kind."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import MAPPING_FILE, POLICY, RIG_FILE


def add_parser(commands: Any) -> None:
    """Add the command."""
    description = 'write a first mapping file for a machine, a rig file for a log, or a security policy'
    kinds = cli.add_group(commands, 'new', 'KIND', description, 'new robot --from-topics --out robot.yaml')
    robot = cli.add_command(
        kinds, 'robot', run_robot, 'write a mapping file with what a bag or the topics show, and what is missing',
        'new robot --from-bag RUN --out robot.yaml',
        'new robot --from-topics --out robot.yaml',
    )  # fmt: skip
    source = robot.add_mutually_exclusive_group(required=True)
    source.add_argument('--from-bag', type=Path, metavar='BAG', help='rosbag2 bag with its messages')
    seconds: dict[str, Any] = {'type': cli.positive, 'metavar': 'SECONDS'}
    text = 'listen to the topics of the running machine, 5 s unless given; needs ROS 2'
    source.add_argument('--from-topics', nargs='?', const=5.0, help=text, **seconds)
    text = 'with --from-topics: wait for the first message, 15 s unless given'
    robot.add_argument('--wait', default=15.0, help=text, **seconds)  # our choice: discovery takes seconds
    cli.add_target(robot, '--out', MAPPING_FILE, required=True, metavar='FILE.yaml', help='mapping file to write')
    description = 'write a rig file with what the head of a log shows, and what is missing'
    rig = cli.add_command(kinds, 'rig', run_rig, description, 'new rig ram.csv --out my_rig.yaml')
    rig.add_argument('log', type=Path, metavar='LOG', help='log file, CSV or white space')
    cli.add_target(rig, '--out', RIG_FILE, required=True, metavar='FILE.yaml', help='rig file to write')
    description = 'write the SROS2 policy of machine_estimator for a machine'
    example = 'new policy config/machines/excavator.yaml --out policy.xml'
    policy = cli.add_command(kinds, 'policy', run_policy, description, example)
    policy.add_argument('machine', type=Path, metavar='MAPPING', help='mapping file of the machine')
    cli.add_target(policy, '--out', POLICY, required=True, metavar='FILE.xml', help='policy to write')


def run_robot(arguments: argparse.Namespace) -> int:
    """Write a mapping file from a bag, or from topics."""
    from seal_friction_ros.offline.bags.new_machine import new_machine, recorded_topics

    if arguments.from_bag:
        text = new_machine(arguments.from_bag)
    else:
        with recorded_topics(arguments.from_topics, arguments.wait) as (bag, silent):
            text = new_machine(bag, silent)
    return _written(arguments, text, lambda: {'actuators': _actuators(arguments.out)})


def run_rig(arguments: argparse.Namespace) -> int:
    """Write a rig file from the head of a log."""
    from seal_friction_ros.offline.bags.new_rig import new_rig

    return _written(arguments, new_rig(arguments.log), dict)


def _written(arguments: argparse.Namespace, text: str, numbers: Callable[[], dict[str, Any]]) -> int:
    """Write a new file, and say which of its points are open; ``numbers`` are of the file."""
    from seal_friction_ros.offline.work.atomic_file import write_whole

    write_whole(arguments.out, text.encode())
    open_points = [line.strip() for line in text.splitlines()[2:] if 'missing' in line or 'guess' in line]
    summary = '\n'.join([f'{len(open_points)} points are open:', *open_points])
    return cli.print_result(arguments, {'file': arguments.out, 'open': open_points, **numbers()}, summary)


def run_policy(arguments: argparse.Namespace) -> int:
    """Write the security policy for a mapping file."""
    from seal_friction_ros.core.machine.security_policy import security_policy
    from seal_friction_ros.files import read_machine
    from seal_friction_ros.offline.work.atomic_file import write_whole
    from seal_friction_ros.offline.work.targets import mark

    machine = read_machine(str(arguments.machine))
    made_by = f'SROS2 policy of machine_estimator for the machine {machine.name}, {mark("new")}'
    write_whole(arguments.out, security_policy(machine, made_by).encode())
    return cli.print_result(arguments, {'file': arguments.out}, '')


def _actuators(path: Path) -> list[str] | str:
    """Names of the actuators; why the file does not load yet, if it does not."""
    from seal_friction_ros.files import read_machine

    try:
        return [actuator.name for actuator in read_machine(str(path)).actuators]
    except ValueError as error:
        return str(error)
