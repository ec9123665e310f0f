"""The command ``seal_friction``.

Exit code 0: success; 1: a difference or a failed check; 2: unusable input. With ``--json`` stdout holds one JSON object
and nothing else; all text for people goes to stderr.
"""

import argparse
import os
import shutil
import sys
import textwrap

from seal_friction_ros.compiled_code import keep_compiled_code
from seal_friction_ros.offline.commands import (
    bags,
    doctor,
    ehl,
    export,
    health,
    identify,
    import_data,
    monitor,
    new,
    oring,
    seals,
    topics,
    tune,
)
from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.commands.studies import of_studies
from seal_friction_ros.offline.work.interrupt import take_interrupts
from seal_friction_ros.offline.work.outcome import THREAD_VARIABLES, error_text
from seal_friction_ros.offline.work.status import as_typed, show_status
from seal_friction_ros.packages import as_missing, needed

GROUPS = {
    'replay': (bags, import_data),
    'identify': (identify, *of_studies('commands.spool'), seals),
    'watch': (monitor, topics, health),
    'tune': (tune,),
    'compute': (oring, ehl),
    'machine': (new, export, doctor),
}

# Before numpy is loaded: the last bits of a sum depend on the number of threads, and the long, narrow matrices of a fit
# take many times longer with several threads.
for _variable in THREAD_VARIABLES:
    os.environ.setdefault(_variable, '1')


class _Version(argparse.Action):
    """Prints the version, which is read only if it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from seal_friction_ros.files import package_version

        print(f'seal_friction {package_version()}')
        parser.exit()


def make_parser() -> argparse.ArgumentParser:
    """Make the parser of the command line."""
    parser = cli.Parser(
        prog='seal_friction',
        usage='seal_friction [-h] [--version] COMMAND ...',
        description='Seal friction from bags and logs, without ROS.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--version', action=_Version, nargs=0, help='print the version and exit')
    commands = parser.add_subparsers(prog='seal_friction', required=True, metavar='COMMAND', help=argparse.SUPPRESS)
    lines = []
    for title, modules in GROUPS.items():
        first = len(commands.choices)
        for module in modules:
            module.add_parser(commands)
        lines += [f'\n{title}:', *(_entry(name, p) for name, p in list(commands.choices.items())[first:])]
    parser.epilog = '\n'.join([*lines, '\nseal_friction COMMAND --help shows the options and examples of a command.'])
    return parser


def _entry(name: str, parser: argparse.ArgumentParser) -> str:
    """Lines of the list of commands for one command."""
    width = shutil.get_terminal_size().columns - 2
    return textwrap.fill(parser.description or '', width, initial_indent=f'  {name:<10}', subsequent_indent=' ' * 12)


def main(arguments: list[str] | None = None) -> int:
    """Run a command; return its exit code."""
    parser = make_parser()
    try:
        if '_ARGCOMPLETE' in os.environ:  # a shell asks for completions
            needed('argcomplete').autocomplete(parser)
        parsed = parser.parse_args(arguments)
        typed = sys.argv[1:] if arguments is None else arguments
        show_status(f'{parsed.command} ...')  # packages take a second to load
        with as_typed(typed), cli.checked(parsed):
            cli.check_packages(parsed)
            return int(parsed.run(parsed))
    except BrokenPipeError:
        raise
    except ModuleNotFoundError as error:
        missing = as_missing(error)
        if missing is error:
            raise
        cli.print_error(str(missing))
        return cli.UNUSABLE
    except (ValueError, OSError) as error:
        cli.print_error(error_text(error))
        return cli.UNUSABLE
    except KeyboardInterrupt:
        show_status('')
        return cli.INTERRUPTED


def run_and_exit() -> None:
    """Entry point; a reader that closes the pipe early is no error."""
    take_interrupts()
    keep_compiled_code()
    try:
        code = main()
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    sys.exit(code)


if __name__ == '__main__':
    run_and_exit()
