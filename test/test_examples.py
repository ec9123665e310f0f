"""Every example runs and asserts its numbers, and the table of examples says what each shows."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
from harness.processes import free_domain, graph_environment
from paths import ROOT

from seal_friction_ros.offline.work.outcome import THREAD_VARIABLES

EXAMPLES = sorted(path for path in (ROOT / 'examples').glob('*.py') if not path.name.endswith('.launch.py'))
README = (ROOT / 'examples' / 'README.md').read_text()
LONGEST = 45  # lines
TIMEOUT = 120.0  # [s] ends an example that hangs


@pytest.mark.parametrize('example', EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(example: Path, tmp_path: Path):
    environment = graph_environment(free_domain()) | dict.fromkeys(THREAD_VARIABLES, '1')
    environment |= {'PYTHONPATH': str(ROOT), 'MPLBACKEND': 'agg'}
    run = subprocess.run(
        [sys.executable, str(example)],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('example', EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_says_what_it_shows_and_asserts_a_number(example: Path):
    source = example.read_text()
    tree = ast.parse(source)
    assert len(source.splitlines()) <= LONGEST
    first = ast.get_docstring(tree).splitlines()[0]
    assert f'| [{example.name}]({example.name}) | {first.rstrip(".")} |' in README
    asserted = [node for node in ast.walk(tree) if isinstance(node, ast.Assert)]
    assert any(isinstance(part, ast.Constant) for node in asserted for part in ast.walk(node.test))


def test_the_table_has_no_example_that_is_not_there():
    named = re.findall(r'\]\((\w+\.py)\)', README)
    assert sorted(named) == [path.name for path in EXAMPLES]
    assert len(named) >= 10
