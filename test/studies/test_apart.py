"""The studies are apart: the package works without them, and their source counts where they compute."""

import subprocess
import sys

import pytest
from jinja2 import UndefinedError
from paths import ROOT

from seal_friction_ros.offline.reports.page import render_page
from seal_friction_ros.offline.work import versions as module
from seal_friction_ros.offline.work.versions import versions

WITHOUT = [sys.executable, 'test/harness/without.py', 'seal_friction_studies', '--']
COMMAND = 'seal_friction_ros.offline.commands.entry_point:seal_friction'


def without_studies(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*WITHOUT, COMMAND, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


def test_without_the_studies_the_other_commands_are_there():
    said = without_studies('--help').stdout
    assert '\n  ehl ' in said
    assert '\n  spool ' not in said
    steps = without_studies('ehl', '--help').stdout
    assert '\n    map ' in steps
    assert '\n    study ' not in steps


@pytest.mark.parametrize(
    ('case', 'said'),
    [('nowhere', 'config/ehl has no nowhere: there are'), ('inner_seal_starved', 'has no film_supply: it has air, ')],
)
def test_without_the_studies_a_map_is_of_what_the_package_knows(case, said):
    done = without_studies('ehl', 'map', case)
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert said in done.stderr


def test_a_finished_part_is_of_the_source_of_the_studies_too(tmp_path, monkeypatch):
    """Otherwise a changed study would go on with old parts."""
    (tmp_path / 'seal_friction_studies').mkdir()
    source = tmp_path / 'seal_friction_studies' / 'a.py'
    source.touch()
    assert (ROOT / 'seal_friction_studies') in module._SOURCES
    monkeypatch.setattr(module, '_PACKAGE', tmp_path / 'seal_friction_ros')
    monkeypatch.setattr(module, '_SOURCES', (tmp_path / 'seal_friction_studies',))
    before = versions.__wrapped__()
    source.write_text('A = 1\n')
    assert versions.__wrapped__() != before


def test_every_page_of_the_studies_has_its_template_which_is_installed_and_strict():
    folder = ROOT / 'seal_friction_studies' / 'offline' / 'templates'
    pages = {path.stem for path in folder.glob('*.html')} - {'lubrication_macros'}
    sources = ''.join(path.read_text() for path in folder.parent.glob('*.py'))
    assert {name for name in pages if f"'{name}'" in sources} == pages
    assert "f'{STUDIES}.offline': ['templates/*.html']" in (ROOT / 'setup.py').read_text()
    for name in pages:
        with pytest.raises(UndefinedError):
            render_page(folder / name, {}, {})
