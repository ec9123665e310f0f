"""The command ``seal_friction``: files in, files out.

Exit code 0: good; 1: a difference or a failed check; 2: unusable input. With ``--json`` stdout holds one JSON object
and nothing else; everything said to a person goes to stderr.
"""

import argparse
import dataclasses
import json
import math
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

DIFFERENT, UNUSABLE, INTERRUPTED = 1, 2, 130


def _import_log(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.import_log import import_log

    summary = import_log(arguments.log, config_path('rigs', arguments.rig), arguments.out)
    return _tell(arguments, summary, f'{arguments.out}: made')


def _import_thesis(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.import_thesis import import_thesis

    return _tell(arguments, import_thesis(arguments.out), f'{arguments.out}: made')


def _replay(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.replay import chosen_configuration, replay

    override = chosen_configuration(arguments.params, arguments.seal)
    verdict = replay(arguments.bag, override, arguments.out, arguments.namespace)
    figures = {**dataclasses.asdict(verdict), 'identical': verdict.identical}
    if not arguments.verify:
        return _tell(arguments, figures, f'{verdict.velocity_samples} velocity samples replayed')
    if verdict.identical:
        counts = f'{verdict.recorded_estimates} estimates and {verdict.recorded_feedforwards} feed-forwards'
        return _tell(arguments, figures, f'{counts}, identical to the byte')
    recorded = verdict.recorded_estimates + verdict.recorded_feedforwards
    what = f'{verdict.differing} of {recorded} recorded messages differ; {verdict.first_difference}'
    _tell(arguments, figures, what if verdict.recorded_estimates else 'no estimates in the bag to compare with')
    return DIFFERENT


def _compare(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.compare import compare, differing_fields

    found = compare(arguments.a, arguments.b, arguments.topic, arguments.atol, arguments.rtol)
    words = 'agree' if found.agree else f'differ: {found.first_difference}'
    rows = [f'{name}: largest {f.largest:.6g}, RMS {f.rms:.6g}' for name, f in differing_fields(found)]
    counts = f'{found.messages_a} and {found.messages_b} messages on {found.topic}'
    figures = {**dataclasses.asdict(found), 'agree': found.agree}
    _tell(arguments, figures, '\n'.join([f'{counts}: {words}', *rows]))
    return 0 if found.agree else DIFFERENT


def _info(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.info import bag_info

    info = bag_info(arguments.bag)
    lines = [f'{info.bag}: {info.messages} messages in {info.duration_s:.3f} s']
    lines += [f'  {topic}: {t["count"]} x {t["type"]}, {t["rate_Hz"]} Hz' for topic, t in info.topics.items()]
    for title, values in (('seals', info.seals), ('states', _counts(info.states)), ('status', _counts(info.status))):
        lines += [f'  {title}: {", ".join(values)}'] if values else []
    return _tell(arguments, info, '\n'.join(lines))


def _report(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.report import write_report

    return _tell(
        arguments, write_report(arguments.bag, arguments.out, arguments.namespace), f'{arguments.out}: written'
    )


def _charts(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.seal_charts import write_seal_charts

    path = config_path('seals', arguments.seal)
    return _tell(arguments, write_seal_charts(path, arguments.out), f'{arguments.out}: written')


def _ehl_run(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.ehl_commands import run_command

    return _tell(
        arguments, *run_command(arguments.case, arguments.jobs, arguments.out, arguments.bag, arguments.window)
    )


def _ehl_study(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.ehl_commands import study_command

    return _tell(arguments, *study_command(arguments.case, arguments.jobs, arguments.out, arguments.work))


def _ehl_map(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.ehl_commands import map_command

    return _tell(
        arguments, *map_command(arguments.case, arguments.jobs, arguments.out, arguments.work, arguments.seal_file)
    )


def _counts(counts: dict[str, int]) -> Iterable[str]:
    return [f'{name} {count}' for name, count in counts.items()]


def _tell(arguments: argparse.Namespace, figures: Any, words: str) -> int:
    """Say the result: figures as JSON on stdout and words on stderr, or words on stdout."""
    if arguments.json:
        print(json.dumps(_plain(figures), allow_nan=False))
        print(words, file=sys.stderr)
    else:
        print(words)
    return 0


def _plain(value: Any) -> Any:
    """What JSON can hold: records as mappings, paths as text, numbers that are not finite as null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _plain(dataclasses.asdict(value))
    if hasattr(value, '_asdict'):
        return _plain(value._asdict())
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _add(commands: Any, name: str, run: Callable[[argparse.Namespace], int], help_text: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(name, help=help_text, description=help_text)
    parser.add_argument('--json', action='store_true', help='figures as one JSON object on stdout')
    parser.set_defaults(run=run)
    return parser


def make_parser() -> argparse.ArgumentParser:
    """Make the parser of the command line."""
    parser = argparse.ArgumentParser(prog='seal_friction', description='Seal friction from bags and logs, without ROS.')
    commands = parser.add_subparsers(title='commands', required=True, metavar='COMMAND')

    importing = commands.add_parser('import', help='make a bag from measurements', description='Make a bag.')
    sources = importing.add_subparsers(title='sources', required=True, metavar='SOURCE')
    log = _add(sources, 'log', _import_log, 'a measured log, CSV or white space, to a bag')
    log.add_argument('log', type=Path, help='the log')
    log.add_argument('--rig', required=True, help='rig file: a path, or the name of one in config/rigs')
    thesis = _add(sources, 'thesis', _import_thesis, 'the pull test of the thesis, Tables A-1 to A-3, to a bag')
    for source in (log, thesis):
        source.add_argument('--out', type=Path, required=True, metavar='BAG', help='bag to make; must not exist')

    replay = _add(commands, 'replay', _replay, 'a bag through the estimator, as fast as it goes')
    replay.add_argument('bag', type=Path)
    replay.add_argument('--params', type=Path, metavar='FILE', help='ROS parameter file instead of what the bag says')
    replay.add_argument(
        '--seal', type=Path, metavar='FILE', help='seal file for every seal instead of what the bag says'
    )
    replay.add_argument('--out', type=Path, metavar='BAG', help='write inputs and new estimates to this bag')
    replay.add_argument('--namespace', default='', help='look only at topics below it')
    replay.add_argument('--verify', action='store_true', help='compare with the estimates in the bag byte for byte')

    compare = _add(commands, 'compare', _compare, 'a topic of two bags: first, largest and RMS difference')
    compare.add_argument('a', type=Path, metavar='A')
    compare.add_argument('b', type=Path, metavar='B')
    compare.add_argument('--topic', default='', help='default: the friction estimates of each')
    compare.add_argument('--atol', type=_tolerance, default=0.0, help='absolute tolerance, default 0')
    compare.add_argument('--rtol', type=_tolerance, default=0.0, help='relative tolerance, default 0')

    _add(commands, 'info', _info, 'what is in a bag').add_argument('bag', type=Path)

    report = _add(commands, 'report', _report, 'a page with figures and numbers, PNG and SVG beside it')
    report.add_argument('bag', type=Path)
    report.add_argument('--namespace', default='', help='look only at topics below it')
    charts = _add(commands, 'charts', _charts, 'a page with the curves of a seal file, PNG and SVG beside it')
    charts.add_argument('seal', help='seal file: a path, or the name of one in config/seals')
    for page in (report, charts):
        page.add_argument('--out', type=Path, required=True, metavar='FILE.html')
    _add_ehl(commands)
    return parser


def _add_ehl(commands: Any) -> None:
    ehl = commands.add_parser('ehl', help='lubricated contact of a seal', description='Lubricated contact of a seal.')
    steps = ehl.add_subparsers(title='commands', required=True, metavar='COMMAND')
    run = _add(steps, 'run', _ehl_run, 'friction, film and contact over a motion')
    run.add_argument('--bag', type=Path, help='run through the position of this bag, and compare with its force')
    run.add_argument('--window', type=float, nargs=2, metavar=('FROM', 'TO'), help='part of the bag to take [s]')
    study = _add(steps, 'study', _ehl_study, 'friction with other solid shear stresses')
    chart = _add(steps, 'map', _ehl_map, 'friction map: steady friction over speed and pressure')
    chart.add_argument('--seal-file', type=Path, metavar='FILE.yaml', help='write it as a seal file; must not exist')
    for step in (run, study, chart):
        step.add_argument('case', help='case file: a path, or the name of one in config/ehl')
        step.add_argument('--jobs', type=int, default=os.cpu_count() or 1, help='processes; default: one for each core')
        step.add_argument('--out', type=Path, metavar='FILE.html', help='write a page with figures')
    for step in (study, chart):
        step.add_argument('--work', type=Path, metavar='FOLDER', help='keep finished parts here, and go on from them')


def _tolerance(text: str) -> float:
    value = float(text)
    if not 0.0 <= value < float('inf'):
        raise argparse.ArgumentTypeError(f'{text} is not a tolerance')
    return value


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parsed = make_parser().parse_args(arguments)
    try:
        return int(parsed.run(parsed))
    except ValueError as error:
        print(f'seal_friction: {error}', file=sys.stderr)
        return UNUSABLE
    except BrokenPipeError:
        raise
    except OSError as error:
        print(f'seal_friction: {error.filename}: {error.strerror}', file=sys.stderr)
        return UNUSABLE
    except KeyboardInterrupt:
        return INTERRUPTED


def run_and_exit() -> None:
    """Entry point; a reader that closes the pipe early is no error."""
    try:
        code = main()
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    sys.exit(code)


if __name__ == '__main__':
    run_and_exit()
