"""Shared by all commands: parsers, options, exit codes, output. Loads nothing heavy, so that ``--help`` is fast."""

import argparse
import dataclasses
import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from seal_friction_ros.core.foundation.parameters import meant
from seal_friction_ros.offline.work.status import show_status
from seal_friction_ros.offline.work.targets import PAGE, Kind, checked_targets
from seal_friction_ros.packages import needed

if TYPE_CHECKING:
    from seal_friction_ros.offline.bags.mapped_bag import MappingFile
    from seal_friction_ros.offline.work.executor import Workers
    from seal_friction_ros.offline.work.finished_parts import Kept
    from seal_friction_ros.offline.work.places import Place

_OF_A_PAGE = ('matplotlib', 'jinja2')
SUCCESS, DIFFERENT, UNUSABLE, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: no difference; a difference or a failed check; unusable input; interrupted by SIGINT."""


# -- parsers and options ----------------------------------------------------------------------------------------------


class Parser(argparse.ArgumentParser):
    """Parser whose errors are one line that says what is meant, or what there is."""

    def error(self, message: str) -> NoReturn:
        """End with one line and the exit code of unusable input."""
        example = self.get_default('examples')
        hint = f'; for example: {example[0]}' if example and 'required' in message else ''
        self.exit(UNUSABLE, f'{self.prog}: {message}{hint}; {self.prog} --help says more\n')

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """As of the base class; the parser of a command names its own unknown options."""
        if not any(isinstance(action, argparse._SubParsersAction) for action in self._actions):
            for word in (given.partition('=')[0] for given in args or ()):
                is_option = word.startswith('--') and word != '--'
                if is_option and not any(option.startswith(word) for option in self._options()):
                    self._refuse(word)  # before what is missing
        known, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self._refuse(unknown[0].partition('=')[0])
        return known, unknown

    def _options(self) -> list[str]:
        return [option for action in self._actions for option in action.option_strings if option.startswith('--')]

    def _refuse(self, word: str) -> NoReturn:
        is_option = word.startswith('-')
        what = f'there is no option {word}: {meant(word, self._options())}'
        self.error(what if is_option else f'{word} is one argument too many')

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Check a command, or a choice of an option."""
        if action.choices is None or value in action.choices:
            return
        is_command = isinstance(action, argparse._SubParsersAction)
        what = f'{action.metavar or "value"}'.lower() if is_command else f'value of {"/".join(action.option_strings)}'
        self.error(f'{value} is no {what}: {meant(str(value), action.choices)}')


def add_group(commands: Any, name: str, metavar: str, description: str, *examples: str) -> Any:
    """Add a command that has kinds, each with a parser of its own; returns the subparsers for them."""
    parser = _new_parser(commands, name, description, examples)
    return parser.add_subparsers(title=f'{metavar.lower()}s', required=True, metavar=metavar)


def add_command(
    commands: Any,
    name: str,
    run: Callable[[argparse.Namespace], int],
    description: str,
    *examples: str,
    needs: tuple[str, ...] = (),
) -> argparse.ArgumentParser:
    """Add a command with the option ``--json``; ``run`` runs it and returns the exit code.

    The ``examples`` are command lines for ``--help``, without ``seal_friction``. The command does not work without the
    optional packages that it ``needs``, though it could be imported.
    """
    parser = _new_parser(commands, name, description, examples)
    parser.add_argument('--json', action='store_true', help='print the numbers as one JSON object on stdout')
    parser.set_defaults(run=run, command=parser.prog.split()[1], targets={}, needs=needs)
    return parser


def _new_parser(commands: Any, name: str, description: str, examples: Sequence[str]) -> argparse.ArgumentParser:
    of_user = [f'seal_friction {example}' for example in examples]
    epilog = '\n  '.join(['examples:' if examples[1:] else 'example:', *of_user])
    form: Any = argparse.RawDescriptionHelpFormatter
    shown = {'help': description, 'description': description, 'epilog': epilog, 'formatter_class': form}
    parser: argparse.ArgumentParser = commands.add_parser(name, **shown)
    parser.set_defaults(examples=of_user)
    return parser


Settings = dict[str, Any]  # Of an option, as of `argparse`.


def add_options(parser: Any, table: Mapping[str, tuple[str, Settings]]) -> None:
    """Add options: name -> text for ``--help`` and settings."""
    for name, (text, settings) in table.items():
        parser.add_argument(name, help=text, **settings)


def add_file(parser: Any, option: str, folder: str, what: str, **options: Any) -> None:
    """Add an argument for a file of ``config/FOLDER``: a path, or the name of one there, which the shell completes."""
    text = f'{what}: a path, or the name of one in config/{folder}'
    action: Any = parser.add_argument(option, help=text, **options)
    action.completer = lambda prefix, **_: _file_names(folder, prefix)


def _file_names(folder: str, prefix: str) -> list[str]:
    """Names in ``config/FOLDER`` and paths of YAML files that begin with what is typed."""
    from seal_friction_ros.files import config_names

    beside, start = Path(prefix).parent, Path(prefix).name
    found = [path for path in beside.glob(f'{start}*') if path.is_dir() or path.suffix in ('.yaml', '.yml')]
    paths = [f'{path}/' if path.is_dir() else str(path) for path in sorted(found)]
    return [name for name in (*config_names(folder), *paths) if name.startswith(prefix)]


def add_target(parser: argparse.ArgumentParser, option: str, kind: Kind, **options: Any) -> None:
    """Add an option for a file or bag that the command writes; the first one adds ``--force``."""
    targets = parser.get_default('targets')
    if not targets:
        parser.add_argument('--force', action='store_true', help='overwrite files that this command did not make, too')
    action = parser.add_argument(option, type=Path, **options)
    parser.set_defaults(targets={**targets, action.dest: kind})


def add_page(parser: argparse.ArgumentParser, option: str = '--out', *, required: bool = True) -> None:
    """Add the option for an HTML page."""
    text = 'page with figures to write, PNG and SVG beside it'
    add_target(parser, option, PAGE, required=required, metavar='FILE.html', help=text)


def add_shared(parser: Any, *names: str) -> None:
    """Add options that several commands have."""
    add_options(parser, {name: _SHARED[name] for name in names})


def add_actuator(parser: Any) -> None:
    """Add the options that restrict a bag to one actuator, and for bags that tell nothing of their machine."""
    add_shared(parser, '--namespace')
    add_mapping(parser)


def add_mapping(parser: Any) -> None:
    """Add the option for bags that tell nothing of their machine."""
    add_file(parser, '--mapping', 'machines', 'mapping file of the machine, for a bag without configuration')


def mapping_of(arguments: argparse.Namespace) -> 'MappingFile | None':
    """Mapping file, if one is given; ValueError if it cannot be read or is invalid."""
    from seal_friction_ros.offline.bags.mapped_bag import read_mapping

    return read_mapping(arguments.mapping) if arguments.mapping else None


def add_configuration(parser: argparse.ArgumentParser) -> None:
    """Add the options that replace the configuration of a bag or the default one."""
    add_shared(parser, '--params')
    add_file(parser, '--seal', 'seals', 'seal file for every seal', metavar='SEAL')


def add_workers(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the options for who computes; ``what`` each of the workers works on."""
    text = f'{what} at a time, one process each; default: number of cores'
    group = parser.add_mutually_exclusive_group()
    group.add_argument('--workers', '--jobs', type=at_least(1), metavar='N', help=text)
    group.add_argument('--scheduler', metavar='ADDRESS', help='compute on the Dask cluster with this scheduler')
    files = ('CA', 'CERT', 'KEY')
    parser.add_argument(
        '--scheduler-tls', type=Path, nargs=3, metavar=files, help='certificates for the scheduler, PEM files'
    )


def workers_of(arguments: argparse.Namespace) -> 'Workers':
    """Who computes: the cluster or the number of processes as given, else as many processes as there are cores.

    Raises ValueError if the address of the cluster is none.
    """
    from seal_friction_ros.offline.work.cluster import Cluster
    from seal_friction_ros.offline.work.executor import available_cores

    if arguments.scheduler is not None:
        return Cluster(arguments.scheduler, tuple(arguments.scheduler_tls) if arguments.scheduler_tls else None)
    check_only_for(arguments, ['scheduler_tls'], 'a --scheduler')
    return arguments.workers or available_cores()


def check_only_for(arguments: argparse.Namespace, options: Iterable[str], what: str) -> None:
    """Check that options are not given, since what they are for is not; ValueError if one is."""
    for name in options:
        if getattr(arguments, name):
            raise ValueError(f'--{name.replace("_", "-")} is only for {what}')


def samples_of(arguments: argparse.Namespace) -> tuple[int, int] | None:
    """Number of samples and seed; None without samples, ValueError if there is an option for them then."""
    if arguments.uncertain is not None:
        return arguments.uncertain, arguments.seed or 0
    check_only_for(arguments, ['seed'], '--uncertain N')
    return None


def kept_in(arguments: argparse.Namespace) -> 'Kept':
    """Where finished parts are kept, as given; ValueError if an option is for a folder that is not given."""
    from seal_friction_ros.offline.work.finished_parts import Kept

    if arguments.work is None:
        check_only_for(arguments, ['retry_failed'], 'a --work FOLDER')
    return Kept(arguments.work, arguments.retry_failed)


def checked(arguments: argparse.Namespace) -> AbstractContextManager[None]:
    """Context in which the command runs, if it may write its targets; see `checked_targets`."""
    values = vars(arguments)
    targets = [(values[name], kind) for name, kind in arguments.targets.items() if values[name] is not None]
    inputs = [path for name, value in values.items() if name not in arguments.targets for path in _paths(value)]
    return checked_targets(arguments.command, targets, inputs, force=bool(values.get('force')))


def check_packages(arguments: argparse.Namespace) -> None:
    """Check before the work that the packages for it and its page are installed; MissingPackageError if not."""
    values = vars(arguments)
    has_page = any(kind is PAGE and values[name] is not None for name, kind in arguments.targets.items())
    for package in (*arguments.needs, *(_OF_A_PAGE if has_page else ())):
        needed(package)


def _paths(value: Any) -> Iterator[Path]:
    """Every path in the value of an argument; a text may be one."""
    for item in value if isinstance(value, list) else [value]:
        if isinstance(item, Path) or (isinstance(item, str) and item):
            yield Path(item)


def place(text: str) -> 'Place':
    """Type of an argument: a path, or a URL of fsspec."""
    if '://' not in text:
        return Path(text)
    from seal_friction_ros.offline.work.places import place_of

    try:
        return place_of(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def non_negative(text: str) -> float:
    """Type of an option: a finite number of at least 0."""
    if not 0.0 <= float(text) < math.inf:
        raise argparse.ArgumentTypeError(f'{text} is not a finite number of at least 0')
    return float(text)


def positive(text: str) -> float:
    """Type of an option: a finite number above 0."""
    if not 0.0 < float(text) < math.inf:
        raise argparse.ArgumentTypeError(f'{text} is not a finite number above 0')
    return float(text)


def quantity(unit: str) -> Callable[[str], float]:
    """Type of an option: a number in SI or with a unit; ``unit`` is that of SI."""
    values = quantities(unit)
    return lambda text: values(text)[0]


def quantities(*units: str) -> Callable[[str], tuple[float, ...]]:
    """Type of an option: numbers in SI or with a unit, separated by commas, one for each of these ``units`` of SI."""

    def values(text: str) -> tuple[float, ...]:
        """Numbers in SI."""
        parts = text.split(',')
        if len(parts) != len(units):
            raise argparse.ArgumentTypeError(f'{text} is not {len(units)} values, separated by commas')
        try:
            return tuple(_in_si(part.strip(), unit) for part, unit in zip(parts, units, strict=True))
        except ValueError as error:
            raise argparse.ArgumentTypeError(f'{text}: {error}') from None

    return values


def _in_si(text: str, unit: str) -> float:
    """Number in SI of a text with or without a unit, finite and at least 0."""
    from seal_friction_ros.core.foundation.units import in_si

    try:
        value = float(text)
    except ValueError:
        value = in_si(text, unit, 'value')
    if not 0.0 <= value < math.inf:
        raise ValueError(f'{text} is not a finite number of at least 0')
    return value


def at_least(least: int) -> Callable[[str], int]:
    """Type of an option: a whole number of at least ``least``."""

    def whole_number(text: str) -> int:
        if int(text) < least:
            raise argparse.ArgumentTypeError(f'{text} is below {least}')
        return int(text)

    return whole_number


PRESSURE = 'gauge, in Pa or with a unit', {'type': quantity('Pa'), 'nargs': '+', 'required': True, 'metavar': 'P'}
_SAMPLES = 'quantiles from N samples of what the case lists as unknown'
_SHARED: dict[str, tuple[str, Settings]] = {
    'bags': ('path, or URL of fsspec', {'type': place, 'nargs': '+', 'metavar': 'BAG'}),
    '--namespace': (
        'use only the topics below this namespace; with several actuators, the name of one',
        {'default': ''},
    ),
    '--params': ('ROS parameter file of the estimator', {'type': Path, 'metavar': 'FILE'}),
    '--work': ('keep finished parts in this folder, and resume from them', {'type': Path, 'metavar': 'FOLDER'}),
    '--retry-failed': ('with --work: try again what failed before', {'action': 'store_true'}),
    '--uncertain': (_SAMPLES, {'type': at_least(2), 'metavar': 'N'}),
    '--seed': ('with --uncertain: of the samples; default: 0', {'type': at_least(0), 'metavar': 'S'}),
    '--reading': (
        'measured sliding friction of one seal, in SI or with units; repeat it for several',
        {
            'action': 'append', 'default': [], 'type': quantities('Pa', 'm/s', 'N'),
            'metavar': 'PRESSURE,SPEED,FRICTION',
        },
    ),
    '--film': (
        'viscosity [Pa s] and speed: film of each direction and leakage, as of a smooth seal',
        {'type': quantities('Pa s', 'm/s'), 'metavar': 'VISCOSITY,SPEED'},
    ),
}  # fmt: skip


# -- output -----------------------------------------------------------------------------------------------------------


def print_result(
    arguments: argparse.Namespace, numbers: Any, summary: str, code: int = SUCCESS, errors: Sequence[str] = ()
) -> int:
    """Print the summary and what was written, or with ``--json`` the numbers and the rest on stderr; then the errors.

    Returns the exit code.
    """
    values = vars(arguments)
    written = [written_text(values[name], kind) for name, kind in arguments.targets.items()]
    summary = '\n'.join(filter(None, [summary, *written])).encode(errors='backslashreplace').decode()
    show_status('')
    if arguments.json:
        print(json.dumps(json_value(numbers), allow_nan=False))
    print(summary, file=sys.stderr if arguments.json else sys.stdout)
    for error in errors:
        print_error(error)
    return code


def written_text(target: Path | None, kind: Kind) -> str:
    """That a target was written, with the page and the figures beside it; empty if there is none."""
    if target is None or not target.exists():
        return ''
    page = target.with_suffix('.html') if kind.has_page and kind is not PAGE else target
    figures = page.with_name(f'{page.stem}_figures')
    beside = [str(page)] if page != target and page.is_file() else []
    beside += [f'figures in {figures}'] if kind.has_page and figures.is_dir() else []
    return ', '.join([f'{target}: written', *beside])


def options_from(arguments: argparse.Namespace, record: type[Any]) -> dict[str, Any]:
    """The arguments that are named after fields of a record."""
    return {f.name: getattr(arguments, f.name) for f in dataclasses.fields(record) if hasattr(arguments, f.name)}


def print_error(text: str) -> None:
    """Print one line on stderr."""
    show_status('')
    print(f'seal_friction: {text}', file=sys.stderr)


def json_value(value: Any) -> Any:
    """A value as JSON can hold it: records as mappings, paths as text, numbers that are not finite as null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return json_value(dataclasses.asdict(value))
    if hasattr(value, '_asdict'):
        return json_value(value._asdict())
    if isinstance(value, dict):
        return {str(key): json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)
