"""``seal_friction monitor``: a live view of running estimators, or of a bag, in a browser."""

import argparse
import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli

_NODE = 'seal_friction_ros.nodes.friction_monitor'


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'monitor', run, 'show running estimators, or a bag, in a browser on this machine',
        'monitor',
        'monitor --allow-changes',
        'monitor bags/pull_test',
    )  # fmt: skip
    parser.add_argument('bag', type=Path, nargs='?', metavar='BAG', help='bag to show; without: the running estimators')
    cli.add_mapping(parser)
    help_text = 'let the page set scale, lead time and limit, and switch off'
    parser.add_argument('--allow-changes', action='store_true', help=help_text)
    parser.add_argument('--port', type=int, default=0, metavar='N', help='port on 127.0.0.1; default: any free one')
    help_text = 'keep the token of the address in this file, for the next start; default: a new one each time'
    parser.add_argument('--token-file', type=Path, metavar='FILE', help=help_text)


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until SIGINT; for running estimators this process becomes the node that listens.

    ValueError: the options contradict each other, ROS 2 is not installed, or the bag cannot be shown.
    """
    if arguments.bag is not None:
        if arguments.allow_changes:
            raise ValueError('--allow-changes is for running estimators: a bag cannot be changed')
        return _show_bag(arguments)
    if arguments.mapping is not None:
        raise ValueError('--mapping is for a BAG: running estimators have their own')
    if find_spec('rclpy') is None:
        raise ValueError('monitor without a bag needs ROS 2: run make setup, or source a distribution')
    options = [f'--{name.replace("_", "-")}' for name in ('allow_changes', 'json') if getattr(arguments, name)]
    options += ['--token-file', str(arguments.token_file)] if arguments.token_file else []
    command = [sys.executable, '-m', _NODE, '--port', str(arguments.port), *options]
    return os.execv(sys.executable, command)  # noqa: S606  nothing of the command is from a stranger


def _show_bag(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.monitor.recorded_view import RecordedView
    from seal_friction_ros.offline.monitor.server import MonitorServer
    from seal_friction_ros.offline.monitor.token_file import kept_token

    token = kept_token(arguments.token_file) if arguments.token_file else ''
    view = RecordedView(arguments.bag, cli.mapping_of(arguments))
    server = MonitorServer(view, arguments.port, token, view.read())
    print(server.told(as_json=arguments.json), flush=True)
    server.serve()
    return cli.SUCCESS
