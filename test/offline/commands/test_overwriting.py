"""No command overwrites what it did not make, or an input of its own, unless ``--force`` for the former."""

from pathlib import Path

import pytest
from harness.example_bags import write_inputs
from offline.commands.test_main import PULL_TEST, parsers
from paths import ROOT

from seal_friction_ros.offline.commands.main import main, make_parser
from seal_friction_ros.offline.work.targets import BAG, Kind, mark

LOG, RIG = 'ram.csv', 'mbari'
COMMANDS = {
    ('replay',): [PULL_TEST],
    ('recover',): [PULL_TEST],
    ('report',): [PULL_TEST],
    ('compare',): [PULL_TEST, PULL_TEST],
    ('import', 'log'): [LOG, '--rig', RIG],
    ('import', 'bag'): [PULL_TEST, '--mapping', 'test_bench'],
    ('import', 'thesis'): [],
    ('new', 'robot'): ['--from-bag', PULL_TEST],
    ('new', 'rig'): [LOG],
    ('identify',): [PULL_TEST],
    ('sheet',): ['rod_seal'],
    ('spool',): ['ten_cycles.csv'],
    ('charts',): ['ms28775_114'],
    ('health',): [PULL_TEST],
    ('new', 'policy'): [str(ROOT / 'config' / 'machines' / 'test_bench.yaml')],
    ('fleet',): [PULL_TEST],
    ('adapt',): [PULL_TEST, '--seal', 'ms28775_114'],
    ('tune',): [],
    ('servo',): [],
    ('oring',): ['ms28775_114'],
    ('ehl', 'run'): ['inner_seal'],
    ('ehl', 'study'): ['inner_seal'],
    ('ehl', 'map'): ['inner_seal'],
    ('export', 'c'): ['delft_o_ring'],
    ('export', 'fmu'): ['delft_o_ring'],
    ('section',): ['x_ring', '--height', '3.53mm', '--rod', '25.4mm', '--gland', '31.55mm', '--pressure', '20bar'],
    ('topics', 'param'): ['friction_estimator'],
}
"""command -> its arguments besides the targets; a command that is missing here writes nothing"""


def targets() -> list[tuple[tuple[str, ...], str, Kind]]:
    """Every command with each of its targets."""
    found = []
    for command, parser in parsers(make_parser()).items():
        for name, kind in (parser.get_default('targets') or {}).items():
            found.append((command, f'--{name.replace("_", "-")}', kind))
    return found


def command_line(command: tuple[str, ...], option: str, target: Path) -> list[str]:
    """Arguments of a command that writes ``target``, and what it needs besides."""
    other = target.with_name('o.html' if command[0] == 'fleet' else 'o.yaml')
    needed = [] if option == '--out' or command[0] in ('oring', 'ehl', 'topics') else ['--out', str(other)]
    return [*command, *COMMANDS[command], *needed, option, str(target)]


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob('*') if path.is_file()}


def refused(arguments: list[str], folder: Path, capsys) -> str:
    """The one line with which a command refuses; nothing in the folder changed."""
    before = contents(folder)
    capsys.readouterr()
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert contents(folder) == before
    return said


def test_every_option_that_writes_is_known_as_a_target():
    assert {command for command, _, _ in targets()} == set(COMMANDS)
    for command, parser in parsers(make_parser()).items():
        written = {'out', 'report', 'seal_file', 'next', 'parquet', 'save'} & {
            action.dest for action in parser._actions
        }
        assert written == set(parser.get_default('targets') or {}), command


@pytest.mark.parametrize(('command', 'option', 'kind'), targets(), ids=str)
def test_a_command_refuses_to_overwrite_a_file_that_it_did_not_make(
    command, option, kind: Kind, tmp_path: Path, capsys
):
    target = tmp_path / f'mine{kind.suffixes[0] if kind.suffixes else ""}'
    if kind is BAG:
        write_inputs(target, 3)
    elif kind.inside:
        target.mkdir()
        (target / kind.inside).write_text(f'my own notes, {mark("info")}\n')
    else:
        target.write_text(f'my own notes, {mark("info")}\n')
    said = refused(command_line(command, option, target), tmp_path, capsys)
    assert f'{target} exists already: not overwriting' in said


@pytest.mark.parametrize(('command', 'option', 'kind'), [target for target in targets() if target[2].has_page], ids=str)
def test_a_page_or_folder_beside_the_target_is_refused_too(command, option, kind: Kind, tmp_path: Path, capsys):
    target = tmp_path / f'mine{kind.suffixes[0]}'
    figures = tmp_path / 'mine_figures'
    figures.mkdir()
    assert f'{figures} exists already' in refused(command_line(command, option, target), tmp_path, capsys)
    page = target.with_suffix('.html')
    page.write_text('my notes')
    assert f'{page} exists already' in refused(command_line(command, option, target), tmp_path, capsys)


@pytest.mark.parametrize(('command', 'option', 'kind'), [target for target in targets() if target[2].suffixes], ids=str)
def test_a_name_with_the_suffix_of_another_format_is_refused(command, option, kind: Kind, tmp_path: Path, capsys):
    target = tmp_path / 'x.pdf'
    said = refused(command_line(command, option, target), tmp_path, capsys)
    assert f'{target}: ' in said
    assert f'name it {kind.suffixes[0]}' in said


@pytest.mark.parametrize('force', [[], ['--force']], ids=['', 'force'])
def test_an_input_is_never_overwritten(force: list[str], tmp_path: Path, capsys):
    table = tmp_path / 'mine.yaml'
    table.write_bytes((ROOT / 'data' / 'thesis' / 'friction_tests.csv').read_bytes())
    assert 'input' in refused(['identify', str(table), '--out', str(table), *force], tmp_path, capsys)
    seal = tmp_path / 'seal.yaml'
    seal.write_text(f'# {mark("identify")}\n')
    arguments = ['identify', PULL_TEST, '--seal', str(seal), '--out', str(tmp_path / '.' / 'seal.yaml'), *force]
    assert 'input' in refused(arguments, tmp_path, capsys)
    bag = write_inputs(tmp_path / 'bag', 3)
    assert 'input' in refused(['replay', str(bag), '--out', str(bag), *force], tmp_path, capsys)
    assert 'input' in refused(['identify', str(bag), '--out', str(bag / 'metadata.yaml'), *force], tmp_path, capsys)
    assert 'input' in refused(['replay', str(bag), '--out', str(tmp_path), *force], tmp_path, capsys)


def test_a_page_is_made_again_and_one_of_another_command_is_not(tmp_path: Path, capsys):
    page = tmp_path / 'page.html'
    assert main(['report', PULL_TEST, '--out', str(page)]) == 0
    made = contents(tmp_path)
    assert main(['report', PULL_TEST, '--out', str(page)]) == 0
    assert contents(tmp_path) == made
    assert 'seal_friction charts did not make it' in refused(
        ['charts', 'ms28775_114', '--out', str(page)], tmp_path, capsys
    )
    assert main(['charts', 'ms28775_114', '--out', str(page), '--force']) == 0
    assert page.read_bytes() != made[page]


def test_force_replaces_a_bag_only_if_another_one_is_made(tmp_path: Path):
    bag = write_inputs(tmp_path / 'bag', 3)
    before = contents(tmp_path)
    assert main(['replay', str(tmp_path / 'absent'), '--out', str(bag), '--force']) == 2
    assert contents(tmp_path) == before
    assert main(['replay', PULL_TEST, '--out', str(bag), '--force']) == 0
    assert contents(tmp_path) != before
    assert [path.name for path in tmp_path.iterdir()] == ['bag']
    assert main(['replay', str(bag), '--verify']) == 0


def test_a_folder_that_is_no_bag_is_kept_with_force(tmp_path: Path, capsys):
    (tmp_path / 'photos').mkdir()
    (tmp_path / 'photos' / 'one.jpg').write_text('')
    arguments = ['replay', PULL_TEST, '--out', str(tmp_path / 'photos'), '--force']
    assert 'no bag' in refused(arguments, tmp_path, capsys)


def test_a_filled_data_sheet_is_replaced_only_with_force(tmp_path: Path, capsys):
    sheet = tmp_path / 'sheet.csv'
    arguments = ['sheet', 'rod_seal', '--out', str(sheet)]
    assert main(arguments) == 0
    empty = sheet.read_bytes()
    sheet.write_bytes(empty + b'0,1,2,3\n')
    assert 'did not make it' in refused(arguments, tmp_path, capsys)
    assert main([*arguments, '--force']) == 0
    assert sheet.read_bytes() == empty
    assert sorted(path.suffix for path in tmp_path.iterdir()) == ['.csv', '.html']
