"""What benches, campaigns, demo and commands print can be read in 80 columns, in a pipe and without colours."""

import os
import subprocess
import sys

import demo
import pytest
from harness.campaign import show
from paths import ROOT
from rich.console import Console

COLUMNS = 80
FIGURES = {f'time of stage {number} [us]': number / 3.0 for number in range(9)}
PLAIN = {**os.environ, 'NO_COLOR': '1', 'COLUMNS': str(COLUMNS)}


def printed(command: list[str], **environment: str) -> str:
    return subprocess.run(
        command, env=PLAIN | environment, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
    ).stdout


@pytest.fixture
def narrow(monkeypatch):
    monkeypatch.setenv('COLUMNS', str(COLUMNS))


@pytest.mark.usefixtures('narrow')
def test_a_table_that_is_too_wide_is_a_list_of_figures_with_nothing_cut(capsys):
    show({'a node with feed-forward': FIGURES, 'another': FIGURES}, 'Round trip')
    wide = capsys.readouterr().out
    assert max(map(len, wide.splitlines())) <= COLUMNS
    assert '…' not in wide
    for name, value in FIGURES.items():
        assert [line.split()[-1] for line in wide.splitlines() if name in line] == [f'{value:.4g}'] * 2
    show({'a node': {'p50 [us]': 1.0}, 'another': {'p50 [us]': 2.0}})
    assert '┃ p50 [us] ┃' in capsys.readouterr().out


@pytest.mark.usefixtures('narrow')
def test_the_tables_of_the_demo_fit():
    for table in (demo.friction_table([]), demo.run_table([])):
        table.add_row('O-ring257_03bar', *['12345.67'] * (len(table.columns) - 1))
        console = Console(width=COLUMNS)
        with console.capture() as captured:
            console.print(table)
        assert '…' not in captured.get()


@pytest.mark.parametrize('words', [('info', 'bags/pull_test'), ('seals',), ('replay', 'bags/pull_test', '--verify')])
def test_in_a_pipe_there_are_no_escape_codes_and_no_long_lines(words: tuple[str, ...]):
    text = printed([sys.executable, '-m', 'seal_friction_ros', *words], TERM='xterm-256color')
    assert '\x1b' not in text
    assert max(map(len, text.splitlines())) <= COLUMNS
