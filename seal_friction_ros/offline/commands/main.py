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

from seal_friction_ros.core.foundation.parameters import Meaning, meanings
from seal_friction_ros.core.tuning.settings import MatchSettings, TuningSettings

DIFFERENT, UNUSABLE, INTERRUPTED = 1, 2, 130

# Before numpy is loaded: with several threads the last bits of a sum depend on how many there are, and the long, narrow
# matrices of a fit take many times longer.
for _library in ('OPENBLAS', 'MKL', 'OMP'):
    os.environ.setdefault(f'{_library}_NUM_THREADS', '1')


def _import_log(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.bags.import_log import import_log

    summary = import_log(arguments.log, config_path('rigs', arguments.rig), arguments.out)
    return _tell(arguments, summary, f'{arguments.out}: made')


def _import_thesis(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.bags.import_thesis import import_thesis

    return _tell(arguments, import_thesis(arguments.out), f'{arguments.out}: made')


def _replay(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.replay.replay import chosen_configuration, replay

    override = chosen_configuration(arguments.params, arguments.seal)
    if len(arguments.bags) > 1:
        return _replay_many(arguments, override)
    verdict = replay(arguments.bags[0], override, arguments.out, arguments.namespace)
    _tell(arguments, _with_identical(verdict), _in_words(verdict, verify=arguments.verify))
    return DIFFERENT if arguments.verify and not verdict.identical else 0


def _replay_many(arguments: argparse.Namespace, override: Any) -> int:
    """Several bags: a line and an exit code for all of them, whatever becomes of one."""
    from seal_friction_ros.offline.replay.parallel_replay import available_cores, replay_many

    if arguments.out:
        raise ValueError('--out is for one bag: give several one after the other')
    outcomes = replay_many(arguments.bags, override, arguments.namespace, arguments.workers or available_cores())
    bags, lines, failed = [], [], [outcome for outcome in outcomes if outcome.verdict is None]
    for bag, verdict, error in outcomes:
        bags.append({'bag': bag, **(_with_identical(verdict) if verdict else {'error': error})})
        lines += [f'{bag}: {_in_words(verdict, verify=arguments.verify)}'] if verdict else []
    identical = all(outcome.verdict and outcome.verdict.identical for outcome in outcomes)
    _tell(arguments, {'bags': bags, 'identical': identical}, '\n'.join(lines))
    for outcome in failed:
        print(f'seal_friction: {outcome.error}', file=sys.stderr)
    return UNUSABLE if failed else DIFFERENT if arguments.verify and not identical else 0


def _with_identical(verdict: Any) -> dict[str, Any]:
    return {**dataclasses.asdict(verdict), 'identical': verdict.identical}


def _in_words(verdict: Any, *, verify: bool) -> str:
    if not verify:
        return f'{verdict.velocity_samples} velocity samples replayed'
    if verdict.identical:
        counts = f'{verdict.recorded_estimates} estimates and {verdict.recorded_feedforwards} feed-forwards'
        return f'{counts}, identical to the byte'
    if not verdict.recorded_estimates:
        return 'no estimates in the bag to compare with'
    recorded = verdict.recorded_estimates + verdict.recorded_feedforwards
    return f'{verdict.differing} of {recorded} recorded messages differ; {verdict.first_difference}'


def _compare(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.replay.compare import compare, differing_fields

    found = compare(arguments.a, arguments.b, arguments.topic, arguments.atol, arguments.rtol)
    words = 'agree' if found.agree else f'differ: {found.first_difference}'
    rows = [f'{name}: largest {f.largest:.6g}, RMS {f.rms:.6g}' for name, f in differing_fields(found)]
    counts = f'{found.messages_a} and {found.messages_b} messages on {found.topic}'
    figures = {**dataclasses.asdict(found), 'agree': found.agree}
    _tell(arguments, figures, '\n'.join([f'{counts}: {words}', *rows]))
    return 0 if found.agree else DIFFERENT


def _info(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.bags.info import bag_info

    info = bag_info(arguments.bag)
    lines = [f'{info.bag}: {info.messages} messages in {info.duration_s:.3f} s']
    lines += [f'  {topic}: {t["count"]} x {t["type"]}, {t["rate_Hz"]} Hz' for topic, t in info.topics.items()]
    for title, values in (('seals', info.seals), ('states', _counts(info.states)), ('status', _counts(info.status))):
        lines += [f'  {title}: {", ".join(values)}'] if values else []
    return _tell(arguments, info, '\n'.join(lines))


def _recover(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.bags.recover import recover

    found = recover(arguments.bag, arguments.out)
    return _tell(arguments, found, found.in_words())


def _report(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.reports.bag_report import write_report

    return _tell(
        arguments, write_report(arguments.bag, arguments.out, arguments.namespace), f'{arguments.out}: written'
    )


def _charts(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.reports.seal_charts import write_seal_charts

    path = config_path('seals', arguments.seal)
    return _tell(arguments, write_seal_charts(path, arguments.out), f'{arguments.out}: written')


def _oring(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.contact.oring_runs import compute_case, seal_comment, seal_document
    from seal_friction_ros.offline.reports.oring_report import numbers_text, write_oring_report
    from seal_friction_ros.offline.work.seal_writer import check_new, write_seal

    if arguments.out:
        check_new(arguments.out)
    path = config_path('oring', arguments.case)
    computed = compute_case(path, arguments.pressures, for_seal_file=arguments.out is not None)
    if arguments.report:
        write_oring_report(computed, arguments.report)
    if arguments.out:
        write_seal(seal_document(computed), arguments.out, seal_comment(computed))
    return _tell(arguments, computed.summary, numbers_text(computed))


def _ehl_run(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.contact.lubrication_commands import run_command

    chosen = arguments.bag, arguments.window, arguments.average
    return _tell(arguments, *run_command(arguments.case, _jobs(arguments), arguments.out, *chosen))


def _ehl_study(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.contact.lubrication_commands import study_command

    return _tell(arguments, *study_command(arguments.case, _jobs(arguments), arguments.out, arguments.work))


def _ehl_map(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.contact.lubrication_commands import map_command

    return _tell(
        arguments, *map_command(arguments.case, _jobs(arguments), arguments.out, arguments.work, arguments.seal_file)
    )


def _jobs(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.replay.parallel_replay import available_cores

    return arguments.jobs or available_cores()


def _tune(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.replay.replay import chosen_configuration
    from seal_friction_ros.offline.reports.tune_report import write_tuning_page
    from seal_friction_ros.offline.tuning.tune import check_target, page_of, tune_bag, tune_simulator, write_parameters

    kind, other = (MatchSettings, TuningSettings) if arguments.bag else (TuningSettings, MatchSettings)
    given = {name: value for name in _tuning_options() if (value := getattr(arguments, name)) is not None}
    foreign = [name for name in given if name in meanings(other) and name not in meanings(kind)]
    if foreign or (arguments.namespace and not arguments.bag):
        name = (foreign or ['namespace'])[0].replace('_', '-')
        raise ValueError(f'--{name} is {"not for" if arguments.bag else "only for"} a --bag')
    configuration = chosen_configuration(arguments.params, arguments.seal)
    check_target(arguments.out)
    if arguments.bag:
        tuning: Any = tune_bag(arguments.bag, MatchSettings(**given), configuration, arguments.namespace)
    else:
        tuning = tune_simulator(TuningSettings(**given), configuration)
    page = page_of(arguments.out)
    figures = {**tuning.numbers, 'file': arguments.out, 'page': page, 'figures': write_tuning_page(tuning, page)}
    write_parameters(arguments.out, tuning)
    _tell(arguments, figures, f'{tuning.verdict}\n{arguments.out} and {page}: written')
    return 0 if tuning.found.better_in_every_case else DIFFERENT


def _tuning_options() -> dict[str, Meaning]:
    """Settings of both kinds of tuning by name."""
    return meanings(TuningSettings) | meanings(MatchSettings)


def _servo(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.reports.servo_charts import write_servo_charts

    return _tell(arguments, write_servo_charts(arguments.out), f'{arguments.out}: written')


def _identify(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.offline.identification.identify import Wishes, as_figures, identify, in_words
    from seal_friction_ros.offline.identification.sources import Choices
    from seal_friction_ros.offline.work.seal_writer import write_seal

    choices = Choices(
        rig=arguments.rig,
        chambers=arguments.seal_chambers,
        namespace=arguments.namespace,
        slowest=arguments.slowest,
        largest_acceleration=arguments.largest_acceleration,
    )
    wishes = Wishes(
        sources=choices,
        seal=arguments.seal,
        squeeze_force=arguments.squeeze_force,
        law=arguments.law,
        run_to_run=arguments.run_to_run,
        name=arguments.name,
    )
    found = identify(arguments.sources, wishes, arguments.out.stem)
    written: dict[str, Any] = {'seal_file': str(arguments.out)}
    if arguments.report:
        from seal_friction_ros.offline.reports.identification_report import write_identification_report

        figures = write_identification_report(found, arguments.report)
        written |= {'report': str(arguments.report), 'figures': [str(path) for path in figures]}
    write_seal(found.document, arguments.out)
    return _tell(arguments, as_figures(found) | written, f'{in_words(found)}\n{arguments.out}: written')


def _sheet(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.core.foundation.parameters import from_mapping
    from seal_friction_ros.core.friction.geometry import SealGeometry
    from seal_friction_ros.files import config_path, read_yaml
    from seal_friction_ros.offline.identification.data_sheet import make_plan, write_sheet

    geometry = None
    if arguments.seal:
        path = config_path('seals', arguments.seal)
        document = read_yaml(path)
        if not isinstance(document, dict):
            raise ValueError(f'{path}: a seal file is a mapping of names to values')
        geometry = from_mapping(SealGeometry, document.get('geometry'), f'{path}: geometry')
    low, high, steps = arguments.pressures
    plan = make_plan(
        arguments.name,
        low,
        high,
        steps,
        tests=arguments.tests,
        seals=arguments.seals,
        pressure_unit=arguments.pressure_unit,
        force_unit=arguments.force_unit,
        length_unit=arguments.length_unit,
        geometry=geometry,
    )
    sheet, page = write_sheet(plan, arguments.out)
    return _tell(arguments, {'sheet': str(sheet), 'page': str(page)}, f'{sheet}, {page}: written')


def _spool(arguments: argparse.Namespace) -> int:
    from seal_friction_ros.core.identification.spool_evaluation import SpoolEvaluation
    from seal_friction_ros.offline.reports.spool_report import write_spool_report

    law = SpoolEvaluation(cycles=arguments.cycles, evaluated_cycle=arguments.cycle, moving_average=arguments.average)
    summary = write_spool_report(arguments.table, arguments.out, law, arguments.reference)
    return _tell(arguments, summary, f'{arguments.out}: written')


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

    _add_import(commands)
    _add_replay(commands)

    compare = _add(commands, 'compare', _compare, 'a topic of two bags: first, largest and RMS difference')
    compare.add_argument('a', type=Path, metavar='A')
    compare.add_argument('b', type=Path, metavar='B')
    compare.add_argument('--topic', default='', help='default: the friction estimates of each')
    compare.add_argument('--atol', type=_tolerance, default=0.0, help='absolute tolerance, default 0')
    compare.add_argument('--rtol', type=_tolerance, default=0.0, help='relative tolerance, default 0')

    _add(commands, 'info', _info, 'what is in a bag').add_argument('bag', type=Path)

    _add_identify(commands)
    _add_sheet(commands)
    _add_spool(commands)
    _add_oring(commands)

    recover = _add(commands, 'recover', _recover, 'a valid bag of what can be read of a damaged or unfinished one')
    recover.add_argument('bag', type=Path)
    recover.add_argument('--out', type=Path, metavar='BAG', help='bag to make; default: BAG_recovered')

    report = _add(commands, 'report', _report, 'a page with figures and numbers, PNG and SVG beside it')
    report.add_argument('bag', type=Path)
    report.add_argument('--namespace', default='', help='look only at topics below it')
    charts = _add(commands, 'charts', _charts, 'a page with the curves of a seal file, PNG and SVG beside it')
    charts.add_argument('seal', help='seal file: a path, or the name of one in config/seals')
    servo = _add(
        commands, 'servo', _servo, 'a page on a simulated servo with and without friction, PNG and SVG beside it'
    )
    for page in (report, charts, servo):
        page.add_argument('--out', type=Path, required=True, metavar='FILE.html')

    _add_tune(commands)
    _add_ehl(commands)
    return parser


def _add_replay(commands: Any) -> None:
    replay = _add(commands, 'replay', _replay, 'bags through the estimator, as fast as it goes')
    replay.add_argument('bags', type=Path, nargs='+', metavar='BAG')
    replay.add_argument(
        '--workers', type=_at_least_one, metavar='N', help='bags at a time, one core each; default: all cores'
    )
    replay.add_argument('--params', type=Path, metavar='FILE', help='ROS parameter file instead of what the bag says')
    replay.add_argument(
        '--seal', type=Path, metavar='FILE', help='seal file for every seal instead of what the bag says'
    )
    replay.add_argument('--out', type=Path, metavar='BAG', help='write inputs and new estimates to this bag')
    replay.add_argument('--namespace', default='', help='look only at topics below it')
    replay.add_argument('--verify', action='store_true', help='compare with the estimates in the bag byte for byte')


def _add_tune(commands: Any) -> None:
    tune = _add(commands, 'tune', _tune, 'parameters of the feed-forward for the simulated servo or a recorded axis')
    tune.add_argument('--bag', type=Path, help='tune on this bag of a real axis instead of the simulated servo')
    tune.add_argument('--out', type=Path, required=True, metavar='FILE', help='parameter file; a report goes beside it')
    tune.add_argument('--params', type=Path, metavar='FILE', help='ROS parameter file with seals and what is not tuned')
    tune.add_argument('--seal', type=Path, metavar='FILE', help='seal file for every seal')
    tune.add_argument('--namespace', default='', help='with --bag: look only at topics below it')
    for name, meaning in _tuning_options().items():
        where = '' if name in meanings(TuningSettings) else 'with --bag: '
        number = int if name == 'seed' else float
        unit = f' [{meaning.unit}]' if meaning.unit else ''
        text = f'{where}{meaning.description}{unit}'.replace('%', '%%')
        tune.add_argument(f'--{name.replace("_", "-")}', type=number, metavar='X', help=text)


def _add_oring(commands: Any) -> None:
    oring = _add(commands, 'oring', _oring, 'contact stress and normal force of an O-ring, by finite elements')
    oring.add_argument('case', metavar='CASE', help='case file: a path, or the name of one in config/oring')
    oring.add_argument(
        '--pressures',
        type=float,
        nargs='+',
        default=(),
        metavar='PA',
        help='gauge pressures, instead of those in the file',
    )
    oring.add_argument('--out', type=Path, metavar='SEAL.yaml', help='write a seal file; must not exist')
    oring.add_argument(
        '--report', type=Path, metavar='FILE.html', help='write a page with figures, PNG and SVG beside it'
    )


def _add_identify(commands: Any) -> None:
    identify = _add(commands, 'identify', _identify, 'a seal file from bags, logs, tables or filled data sheets')
    identify.add_argument('sources', type=Path, nargs='+', metavar='SOURCE', help='bag, log, table or data sheet')
    identify.add_argument('--out', type=Path, required=True, metavar='SEAL.yaml', help='seal file to write')
    identify.add_argument('--report', type=Path, metavar='FILE.html', help='page with figures and numbers')
    identify.add_argument('--rig', help='rig file of the logs: a path, or the name of one in config/rigs')
    identify.add_argument('--seal', help='seal file with the geometry of the ring: a path, or one in config/seals')
    identify.add_argument(
        '--squeeze-force', action='store_true', help='normal force from the geometry, even if --seal has one'
    )
    identify.add_argument(
        '--seal-chambers', type=_chambers, metavar='a,b', help='chamber that each seal sees, one letter for each seal'
    )
    identify.add_argument('--law', help='law to save instead of the recommended one')
    identify.add_argument(
        '--run-to-run', type=_tolerance, metavar='SHARE', help='relative standard deviation between runs, if known'
    )
    identify.add_argument('--name', default='', help='name of the seal; default: that of the file')
    identify.add_argument('--slowest', type=_tolerance, metavar='M/S', help='slower counts as at rest')
    identify.add_argument(
        '--largest-acceleration', type=_tolerance, metavar='M/S2', help='samples beyond it are not used'
    )
    identify.add_argument('--namespace', default='', help='look only at topics below it')


def _add_spool(commands: Any) -> None:
    spool = _add(commands, 'spool', _spool, 'a rig that drives to and fro, evaluated as the spool-valve paper does')
    spool.add_argument('table', type=Path, help='columns time_s, displacement_mm, force_N')
    spool.add_argument('--out', type=Path, required=True, metavar='FILE.html')
    spool.add_argument('--cycles', type=int, default=10, help='cycles of a measurement, default 10')
    spool.add_argument('--cycle', type=int, default=9, help='the one to evaluate, default 9')
    spool.add_argument('--average', type=int, default=50, metavar='SAMPLES', help='moving average, default 50')
    spool.add_argument('--reference', type=float, metavar='N', help='reference force of another measurement')


def _add_sheet(commands: Any) -> None:
    sheet = _add(commands, 'sheet', _sheet, 'an empty data sheet of the friction test plan: CSV, and a page to print')
    sheet.add_argument('name', help='name of the seal')
    sheet.add_argument('--out', type=Path, required=True, metavar='SHEET.csv', help='must not exist')
    sheet.add_argument(
        '--pressures', type=_pressures, default=(0.0, 1000.0, 10), metavar='LOW:HIGH:STEPS', help='default 0:1000:10'
    )
    sheet.add_argument('--tests', type=int, default=3, help='default 3')
    sheet.add_argument('--seals', type=int, default=2, help='seals that share the pressure, default 2')
    sheet.add_argument('--seal', help='seal file whose geometry is filled in: a path, or the name of one')
    sheet.add_argument('--pressure-unit', choices=('psi', 'bar', 'MPa', 'kPa'), default='psi')
    sheet.add_argument('--force-unit', choices=('lbf', 'N', 'kN'), default='lbf')
    sheet.add_argument('--length-unit', choices=('in', 'mm'), default='in')


def _chambers(text: str) -> tuple[str, ...]:
    chambers = tuple(text.split(','))
    if not set(chambers) <= {'a', 'b'}:
        raise argparse.ArgumentTypeError(f'{text} is not a list like a,b')
    return chambers


def _pressures(text: str) -> tuple[float, float, int]:
    low, high, steps = text.split(':')
    return float(low), float(high), int(steps)


def _add_import(commands: Any) -> None:
    importing = commands.add_parser('import', help='make a bag from measurements', description='Make a bag.')
    sources = importing.add_subparsers(title='sources', required=True, metavar='SOURCE')
    log = _add(sources, 'log', _import_log, 'a measured log, CSV or white space, to a bag')
    log.add_argument('log', type=Path, help='the log')
    log.add_argument('--rig', required=True, help='rig file: a path, or the name of one in config/rigs')
    thesis = _add(sources, 'thesis', _import_thesis, 'the pull test of the thesis, Tables A-1 to A-3, to a bag')
    for source in (log, thesis):
        source.add_argument('--out', type=Path, required=True, metavar='BAG', help='bag to make; must not exist')


def _add_ehl(commands: Any) -> None:
    ehl = commands.add_parser('ehl', help='lubricated contact of a seal', description='Lubricated contact of a seal.')
    steps = ehl.add_subparsers(title='commands', required=True, metavar='COMMAND')
    run = _add(steps, 'run', _ehl_run, 'friction, film and contact over a motion')
    run.add_argument('--bag', type=Path, help='run through the position of this bag, and compare with its force')
    run.add_argument('--window', type=float, nargs=2, metavar=('FROM', 'TO'), help='part of the bag to take [s]')
    run.add_argument('--average', type=_at_least_one, metavar='SAMPLES', help='with --bag: moving average, default 50')
    study = _add(steps, 'study', _ehl_study, 'friction with other solid shear stresses')
    chart = _add(steps, 'map', _ehl_map, 'friction map: steady friction over speed and pressure')
    chart.add_argument('--seal-file', type=Path, metavar='FILE.yaml', help='write it as a seal file; must not exist')
    for step in (run, study, chart):
        step.add_argument('case', help='case file: a path, or the name of one in config/ehl')
        step.add_argument(
            '--jobs', type=_at_least_one, metavar='N', help='processes, one core each; default: all cores'
        )
        step.add_argument('--out', type=Path, metavar='FILE.html', help='write a page with figures')
    for step in (study, chart):
        step.add_argument('--work', type=Path, metavar='FOLDER', help='keep finished parts here, and go on from them')


def _tolerance(text: str) -> float:
    value = float(text)
    if not 0.0 <= value < float('inf'):
        raise argparse.ArgumentTypeError(f'{text} is not a tolerance')
    return value


def _at_least_one(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'{text} is below 1')
    return value


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parser = make_parser()
    if '_ARGCOMPLETE' in os.environ:  # a shell asks what may come next
        from argcomplete import autocomplete

        autocomplete(parser)
    parsed = parser.parse_args(arguments)
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
