"""The command line: help, exit codes, JSON alone on stdout, one line for each error, no files after a failure."""

import argparse
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from harness.example_bags import default_configuration, write_inputs
from paths import ROOT

from seal_friction_ros.core.estimation.messages import encode_text
from seal_friction_ros.offline.bags.bag import BagWriter
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
    assert main(['compare', PULL_TEST, other, '--rtol', '0.5', '--atol', '0.5']) == 0
    assert main(['replay', str(write_inputs(tmp_path / 'inputs')), '--verify']) == 1


@pytest.mark.parametrize(
    'arguments',
    [
        ['info', PULL_TEST],
        ['replay', PULL_TEST, '--verify'],
        ['compare', PULL_TEST, PULL_TEST],
        ['import', 'thesis', '--out', 'BAG'],
        ['report', PULL_TEST, '--out', 'PAGE.html'],
        ['charts', 'ms28775_114', '--out', 'PAGE.html'],
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
        write_inputs(bag, 50, default_configuration())
        file = next(bag.glob('*.mcap'))
        file.write_bytes(file.read_bytes()[:-300])
    out = [] if command == 'info' else ['--out', str(tmp_path / ('out.html' if command == 'report' else 'out'))]
    before = sorted(tmp_path.rglob('*'))
    expected = 0 if (command, kind) == ('info', 'other') else 2
    assert main([command, str(bag), *out]) == expected
    said = capsys.readouterr().err
    assert expected == 0 or (said.count('\n') == 1 and str(bag) in said)
    assert sorted(tmp_path.rglob('*')) == before


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('exponent: 0.562321', 'exponent: 1.7', ['exponent', '1.7', '0.99']),
        ('gland_diameter: 20.8534e-3', 'gland_diameter: 0.015', ['gland_diameter', '0.015', 'rod_diameter']),
        ('law: power_law', 'law: magic', ['friction_coefficient', 'magic', 'power_law']),
        ('stiction: 2.47685', 'stiction: lots', ['stiction', 'lots']),
        ('stiction: 2.47685', 'stiction: 2e-1', ['stiction', '2e-1', 'signed exponent']),
    ],
)
def test_a_seal_that_makes_no_sense_is_exit_code_2_with_field_value_and_bound(
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


@pytest.mark.parametrize(
    ('typed', 'offered'), [('rep', ['replay', 'report']), ('replay bag --v', ['--verify']), ('report --x', [])]
)
def test_a_shell_is_told_what_may_come_next(typed: str, offered: list[str], tmp_path: Path):
    line, told = f'seal_friction {typed}', tmp_path / 'told'
    asked = {'_ARGCOMPLETE': '1', '_ARGCOMPLETE_STDOUT_FILENAME': str(told), '_ARGCOMPLETE_IFS': '\n'}
    environment = {**os.environ, **asked, 'COMP_LINE': line, 'COMP_POINT': str(len(line)), 'PYTHONPATH': str(ROOT)}
    subprocess.run(
        [sys.executable, '-m', 'seal_friction_ros.offline.commands.main'], env=environment, cwd=tmp_path, check=True
    )
    assert told.read_text().split() == offered
