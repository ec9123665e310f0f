"""The command line: help, exit codes, JSON alone on stdout, one line for each error, no files after a failure."""

import argparse
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from harness.compensation import compensating
from harness.example_bags import rewrite, write_inputs, write_recorded
from paths import ROOT

from seal_friction_ros.core.estimation.configuration import ALGORITHM_VERSION
from seal_friction_ros.core.messages.coder import decode_text, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
from seal_friction_ros.offline.bags.bag import BagMessage, BagWriter
from seal_friction_ros.offline.commands.main import main, make_parser

PULL_TEST = str(ROOT / 'bags' / 'pull_test')


@pytest.fixture
def other(tmp_path: Path) -> str:
    seal = ROOT / 'config' / 'seals' / 'ms28775_114_table.yaml'
    assert main(['replay', PULL_TEST, '--seal', str(seal), '--out', str(tmp_path / 'other')]) == 0
    return str(tmp_path / 'other')


def test_a_reference_bag_verifies():
    assert main(['replay', PULL_TEST, '--verify']) == 0


@pytest.mark.parametrize('bag', sorted((ROOT / 'bags').glob('*/metadata.yaml')), ids=lambda path: path.parent.name)
def test_every_bag_of_the_repository_verifies_and_says_where_it_is_from(bag: Path):
    assert main(['replay', str(bag.parent), '--verify']) == 0
    assert 'sha256' in (bag.parent / 'provenance.yaml').read_text()


def test_a_difference_is_exit_code_1(other: str, tmp_path: Path):
    seal = ROOT / 'config' / 'seals' / 'ms28775_114_table.yaml'
    assert main(['replay', PULL_TEST, '--seal', str(seal), '--verify']) == 1
    assert main(['compare', PULL_TEST, other]) == 1
    assert main(['compare', PULL_TEST, other, '--rtol', '0.5', '--atol', '10.0']) == 0
    assert main(['replay', str(write_inputs(tmp_path / 'inputs')), '--verify']) == 1


@pytest.mark.parametrize(
    'arguments',
    [
        ['info', PULL_TEST],
        ['replay', PULL_TEST, '--verify'],
        ['compare', PULL_TEST, PULL_TEST],
        ['import', 'thesis', '--out', 'BAG'],
        pytest.param(['report', PULL_TEST, '--out', 'PAGE.html'], marks=pytest.mark.long),
        pytest.param(['charts', 'ms28775_114', '--out', 'PAGE.html'], marks=pytest.mark.long),
    ],
    ids=lambda arguments: arguments[0],
)
def test_with_json_stdout_is_one_object_and_nothing_else(arguments: list[str], tmp_path: Path):
    command = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main', *arguments, '--json']
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0
    assert isinstance(json.loads(result.stdout), dict)


@pytest.mark.parametrize('command', ['info', 'replay', 'report'])
@pytest.mark.parametrize('kind', ['absent', 'text', 'folder', 'empty', 'other', 'truncated'])
def test_unusable_bags_are_exit_code_2_one_line_and_nothing_written(command: str, kind: str, tmp_path: Path, capsys):
    bag = tmp_path / 'bag'
    if kind == 'text':
        bag.write_text('no bag')
    elif kind == 'folder':
        bag.mkdir()
    elif kind in ('empty', 'other'):
        with BagWriter(bag) as writer:
            if kind == 'other':
                writer.write('/chatter', 'std_msgs/msg/String', 1, encode_text('hello'))
    elif kind == 'truncated':
        write_inputs(bag, 50, compensating())
        file = next(bag.glob('*.mcap'))
        file.write_bytes(file.read_bytes()[:-300])
    out = [] if command == 'info' else ['--out', str(tmp_path / ('out.html' if command == 'report' else 'out'))]
    before = sorted(tmp_path.rglob('*'))
    expected = 0 if (command, kind) == ('info', 'other') else 2
    assert main([command, str(bag), *out]) == expected
    said = capsys.readouterr().err
    assert expected == 0 or (said.count('\n') == 1 and str(bag) in said)
    assert sorted(tmp_path.rglob('*')) == before


DEEP = '{"a":' * 100_000 + '1' + '}' * 100_000


@pytest.mark.parametrize('text', [DEEP, '[' * 100_000, f'{{"machine": {DEEP}, "actuators": {{}}}}'], ids=len)
@pytest.mark.parametrize('command', ['info', 'replay', 'report', 'health', 'monitor'])
def test_a_configuration_as_deep_as_one_likes_is_exit_code_2_and_one_line(
    command: str, text: str, tmp_path: Path, capsys
):
    bag = write_recorded(tmp_path / 'good')
    bomb = encode_text(text)
    rewrite(bag, tmp_path / 'bag', lambda _, m: m._replace(data=bomb) if m.type_name == CONFIGURATION_TYPE else m)
    out = {'replay': ['--out', str(tmp_path / 'x')], 'report': ['--out', str(tmp_path / 'x.html')]}
    assert main([command, str(tmp_path / 'bag'), *out.get(command, [])]) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert len(said) < 300
    assert 'configuration' in said


def test_a_bag_of_a_later_version_of_the_algorithm_is_one_line_that_says_so(tmp_path: Path, capsys):
    def later(_: int, message: BagMessage) -> BagMessage:
        if message.type_name != CONFIGURATION_TYPE:
            return message
        document = json.loads(decode_text(message.data)) | {'version': ALGORITHM_VERSION + 1}
        return message._replace(data=encode_text(json.dumps(document)))

    bag = rewrite(write_recorded(tmp_path / 'good'), tmp_path / 'bag', later)
    for command in ('replay', 'info', 'health'):
        assert main([command, str(bag)]) == 2
        said = capsys.readouterr().err
        assert f'made by version {ALGORITHM_VERSION + 1} of the algorithm, this is version {ALGORITHM_VERSION}' in said
        assert said.count('\n') == 1


@pytest.mark.parametrize('name', ['metadata.yaml', 'seal.yaml'])
@pytest.mark.parametrize('text', ['[' * 100_000, '{a: ' * 100_000, '- ' * 100_000])
def test_a_yaml_file_as_deep_as_one_likes_is_exit_code_2_and_one_line(name: str, text: str, tmp_path: Path, capsys):
    bag, seal = write_inputs(tmp_path / 'bag', 20), tmp_path / 'seal.yaml'
    (bag / name if name == 'metadata.yaml' else seal).write_text(text)
    assert main(['replay', str(bag), '--seal', str(seal) if name == 'seal.yaml' else 'ms28775_114']) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert name in said


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('exponent: 0.562321', 'exponent: 1.7', ['exponent', '1.7', '0.99']),
        ('gland_diameter: 20.8534e-3', 'gland_diameter: 0.015', ['gland_diameter', '0.015', 'rod_diameter']),
        ('law: power_law', 'law: magic', ['friction_coefficient', 'magic', 'power_law']),
        ('stiction: 0.724347', 'stiction: lots', ['stiction', 'lots']),
        ('stiction: 0.724347', 'stiction: 2 mm', ['stiction', 'mm', 'not for a']),
    ],
)
def test_an_invalid_seal_is_exit_code_2_with_field_value_and_bound(
    old: str, new: str, words: list[str], tmp_path: Path, capsys
):
    seal = tmp_path / 'seal.yaml'
    text = (ROOT / 'config' / 'seals' / 'ms28775_114.yaml').read_text()
    assert old in text
    seal.write_text(text.replace(old, new))
    assert main(['replay', PULL_TEST, '--seal', str(seal), '--out', str(tmp_path / 'out')]) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert [word for word in words if word not in said] == []
    assert not (tmp_path / 'out').exists()


def test_no_command_overwrites_a_bag(tmp_path: Path, capsys):
    bag = write_inputs(tmp_path / 'bag', 3)
    before = {path: path.read_bytes() for path in bag.iterdir()}
    assert main(['import', 'thesis', '--out', str(bag)]) == 2
    assert main(['replay', PULL_TEST, '--out', str(bag)]) == 2
    assert 'not overwriting' in capsys.readouterr().err
    assert {path: path.read_bytes() for path in bag.iterdir()} == before


def test_a_reader_that_closes_the_pipe_early_is_no_error():
    command = (
        f'{sys.executable} -m seal_friction_ros.offline.commands.main info {PULL_TEST} | true; exit ${{PIPESTATUS[0]}}'
    )
    result = subprocess.run(['bash', '-c', command], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, '')


def parsers(parser: argparse.ArgumentParser, *above: str) -> dict[tuple[str, ...], argparse.ArgumentParser]:
    """Every command and its parser."""
    found = {above: parser}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                found |= parsers(command, *above, name)
    return found


@pytest.mark.parametrize('command', parsers(make_parser()), ids=' '.join)
def test_every_command_has_help_and_its_examples_are_command_lines(command: tuple[str, ...], capsys):
    with pytest.raises(SystemExit) as stopped:
        main([*command, '--help'])
    assert stopped.value.code == 0
    text = capsys.readouterr().out
    assert text.startswith(' '.join(['usage: seal_friction', *command]))
    examples = re.findall(r'^  seal_friction (.*)$', text, re.MULTILINE)
    assert all(tuple(example.split()[: len(command)]) == command for example in examples)
    for example in examples:
        make_parser().parse_args(example.split())


def test_help_lists_every_command_in_its_group(capsys):
    with pytest.raises(SystemExit):
        main(['--help'])
    groups = re.findall(r'^(\w+):\n((?:  .*\n)+)', capsys.readouterr().out, re.MULTILINE)
    listed = {title: re.findall(r'^  (\w+)', text, re.MULTILINE) for title, text in groups}
    del listed['options']
    assert list(listed) == ['replay', 'identify', 'watch', 'tune', 'compute', 'machine']
    names = [name for of_group in listed.values() for name in of_group]
    assert sorted(names) == sorted(command[0] for command in parsers(make_parser()) if len(command) == 1)


def test_help_loads_no_numerics_no_compiler_and_no_ros():
    program = (
        'import json, sys\n'
        'from seal_friction_ros.offline.commands.main import main\n'
        'try:\n    main(sys.argv[1:])\n'
        'except SystemExit:\n    print(json.dumps(sorted(sys.modules)))\n'
    )
    for arguments in (['--help'], ['replay', '--help'], ['tune', '--help']):
        found = subprocess.run([sys.executable, '-c', program, *arguments], capture_output=True, text=True, check=True)
        loaded = set(json.loads(found.stdout.splitlines()[-1]))
        assert 'usage: seal_friction' in found.stdout
        assert not loaded & {'numpy', 'scipy', 'matplotlib', 'numba', 'rclpy', 'rosbags', 'mcap', 'rich', 'yaml'}
        assert not loaded & {'dask', 'distributed', 'pyarrow'}


def test_a_command_without_a_cluster_loads_no_dask():
    program = (
        'import sys\n'
        'from seal_friction_ros.offline.commands.main import main\n'
        "assert main(['replay', 'bags/pull_test', 'bags/faults', '--verify']) == 0\n"
        "print('loaded', *{'dask', 'distributed', 'pyarrow'} & set(sys.modules))\n"
    )
    found = subprocess.run([sys.executable, '-c', program], cwd=ROOT, check=True, capture_output=True, text=True)
    assert found.stdout.splitlines()[-1].split() == ['loaded']


@pytest.mark.parametrize(
    ('typed', 'offered'),
    [
        ('rep', ['replay', 'report']),
        ('replay bag --v', ['--verify']),
        ('report --x', []),
        ('charts ms28775_114_s', ['ms28775_114_stress']),
        ('charts ms28775_114_', [f'ms28775_114_{name}' for name in ('fem', 'prior_art', 'stress', 'table')]),
        ('identify bag --rig d', ['delft']),
    ],
)
def test_a_shell_is_told_what_may_come_next(typed: str, offered: list[str], tmp_path: Path):
    line, told = f'seal_friction {typed}', tmp_path / 'told'
    asked = {'_ARGCOMPLETE': '1', '_ARGCOMPLETE_STDOUT_FILENAME': str(told), '_ARGCOMPLETE_IFS': '\n'}
    environment = {**os.environ, **asked, 'COMP_LINE': line, 'COMP_POINT': str(len(line)), 'PYTHONPATH': str(ROOT)}
    subprocess.run(
        [sys.executable, '-m', 'seal_friction_ros.offline.commands.main'], env=environment, cwd=tmp_path, check=True
    )
    assert told.read_text().split() == offered


@pytest.mark.parametrize(
    ('typed', 'words'),
    [
        (['reprot', 'bag'], ['reprot is no command', 'did you mean report?', 'charts', 'tune']),
        (['import', 'lgo'], ['lgo is no source', 'did you mean log?', 'bag, log, thesis']),
        (['report', 'bag', '--ot', 'x.html'], ['--ot', 'did you mean --out?', '--namespace']),
        (['info', 'bag', 'other'], ['other is one argument too many']),
        (['report', 'bag'], ['--out', 'for example: seal_friction report bags/pull_test --out pull_test.html']),
        (['sheet', 'x', '--out', 'x.csv', '--force-unit', 'lb'], ['lb is no value of --force-unit', 'mean lbf?', 'kN']),
        (['sheet', 'x', '--out', 'x.csv', '--pressures', '0:5'], ['0:5 is not LOW:HIGH:STEPS']),
        ([], ['COMMAND']),
    ],
    ids=' '.join,
)
def test_a_mistyped_word_is_one_line_that_says_what_was_meant_and_what_there_is(typed, words, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(typed)
    assert stopped.value.code == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert [word for word in words if word not in said] == []


@pytest.mark.parametrize(
    ('typed', 'words'),
    [
        (['charts', 'ms28775_115', '--out', 'x.html'], ['no ms28775_115', 'mean ms28775_114?', 'delft_o_ring']),
        (['replay', PULL_TEST, '--seal', 'placehodler'], ['mean placeholder?']),
        (['oring', 'ms28775_115'], ['config/oring', 'mean ms28775_114?']),
        (['import', 'log', 'x.csv', '--rig', 'delf', '--out', 'x'], ['config/rigs', 'mean delft?']),
    ],
    ids=lambda value: value[0],
)
def test_a_mistyped_seal_or_case_is_one_line_with_the_files_that_there_are(typed, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(typed) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert [word for word in words if word not in said] == []


def test_the_version_is_that_of_the_manifest_and_the_package_runs_as_a_module():
    command = [sys.executable, '-m', 'seal_friction_ros', '--version']
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    assert told[0] == 'seal_friction'
    assert f'<version>{told[1]}</version>' in (ROOT / 'package.xml').read_text()


def test_help_of_tune_has_a_group_for_each_kind_of_axis(capsys):
    with pytest.raises(SystemExit):
        main(['tune', '--help'])
    groups = dict(re.findall(r'^(\w.*):\n((?:  .*\n)+)', capsys.readouterr().out, re.MULTILINE))
    assert '--machine ' in groups['on the simulated servo, without --bag']
    assert '--bag ' in groups['on a recorded axis']
    assert '--command-topic ' in groups['on a recorded axis']


@pytest.mark.parametrize('command', [c for c in parsers(make_parser()) if c], ids=' '.join)
def test_every_command_has_an_example(command, capsys):
    with pytest.raises(SystemExit):
        main([*command, '--help'])
    assert re.search(rf'^  seal_friction {" ".join(command)}\b', capsys.readouterr().out, re.MULTILINE)


def test_a_command_says_every_file_that_it_wrote(tmp_path: Path, capsys):
    page, sheet = tmp_path / 'page.html', tmp_path / 'sheet.csv'
    assert main(['charts', 'ms28775_114', '--out', str(page)]) == 0
    assert capsys.readouterr().out == f'{page}: written, figures in {tmp_path / "page_figures"}\n'
    assert main(['sheet', 'rod_seal', '--out', str(sheet)]) == 0
    assert capsys.readouterr().out == f'{sheet}: written, {sheet.with_suffix(".html")}\n'


def test_a_sheet_is_metric_unless_asked_for(tmp_path: Path):
    assert main(['sheet', 'rod_seal', '--seal', 'ms28775_114', '--out', str(tmp_path / 'sheet.csv')]) == 0
    text = (tmp_path / 'sheet.csv').read_text()
    assert all(f'[{unit}]' in text or f',{unit}' in text or f' {unit}' in text for unit in ('bar', 'N', 'mm'))
    assert not re.search(r'\b(psi|lbf|inch)\b', text)


def test_seals_lists_every_file_with_law_range_and_source(tmp_path: Path, capsys):
    assert main(['seals', '--json']) == 0
    listed = {seal['file']: seal for seal in json.loads(capsys.readouterr().out)['seals']}
    assert set(listed) == {path.stem for path in (ROOT / 'config' / 'seals').glob('*.yaml')}
    assert listed['ms28775_114']['law'] == 'physics_based'
    assert listed['ms28775_114']['range'] == '0 to 68.9 bar'
    assert listed['ms28775_114']['source'].startswith('Thesis.')
    (tmp_path / 'bad.yaml').write_text('name: bad\n')
    assert main(['seals', str(tmp_path)]) == 1
    assert 'bad.yaml: unusable' in capsys.readouterr().out
    assert main(['seals', str(tmp_path / 'absent')]) == 2


def test_a_terminal_shows_at_once_what_is_being_done():
    """Before the packages of the command are loaded, and nothing of it is left at the end."""
    leader, follower = os.openpty()
    command = [sys.executable, '-m', 'seal_friction_ros', 'info', PULL_TEST]
    environment = {**os.environ, 'PYTHONPATH': str(ROOT), 'TERM': 'xterm'}
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=follower, env=environment) as process:
        os.close(follower)
        first = os.read(leader, 1000)
        said = b''.join(iter(lambda: _read(leader), b''))
    os.close(leader)
    assert process.returncode == 0
    assert b'info ...' in first
    assert said.endswith(b'\r\x1b[K')


def _read(handle: int) -> bytes:
    try:
        return os.read(handle, 1000)
    except OSError:  # Linux: the other end is closed
        return b''


def test_seals_finds_those_for_a_cylinder_nearest_first(capsys):
    assert main(['seals', '--kind', 'rod', '--diameter', '36mm', '--json']) == 0
    found = json.loads(capsys.readouterr().out)['seals']
    assert found[0]['diameter'] == pytest.approx(36e-3)
    assert {seal['kind'] for seal in found} == {'rod'}
    distances = [abs(seal['diameter'] - 36e-3) for seal in found]
    assert distances == sorted(distances)
    assert max(distances) <= 3.6e-3
    assert main(['seals', '--kind', 'piston', '--diameter', '1m']) == 2
    assert 'no seal file for a piston of 1000 mm: compute one' in capsys.readouterr().err
    assert main(['seals', '--kind', 'rod']) == 2
    assert '--kind and --diameter go together' in capsys.readouterr().err


def test_every_seal_of_the_catalogue_says_that_it_is_computed_and_how_far_off_it_may_be(capsys):
    folder = ROOT / 'config' / 'seals' / 'catalogue'
    assert main(['seals', str(folder), '--json']) == 0
    found = json.loads(capsys.readouterr().out)['seals']
    assert len(found) >= 15
    for seal in found:
        assert seal['source'].startswith('Computed, no reading: friction within a factor of 4.')
        assert seal['relative_std'] == 2.0
        assert seal['law'] == ('constant_coulomb' if 'wiper' in seal['file'] else 'contact_shear')
