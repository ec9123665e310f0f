"""A command compiles once for each version; whatever is wrong with the folder, it works without."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import pytest
from paths import ROOT

from seal_friction_ros import compiled_code

PROGRAM = """
import json, sys
from seal_friction_ros.compiled_code import keep_compiled_code
keep_compiled_code()
from seal_friction_ros.core.lubrication.grease import apparent_viscosity as function
grease = tuple((float, int)[int(digit)](2) for digit in sys.argv[1])
print(json.dumps([function(grease, 3.0), sum(function.stats.cache_hits.values())]))
"""


def started(
    folder: Path | str, program: str = PROGRAM, kinds: str = '00000', errors: int | None = None, **more: str
) -> subprocess.Popen[str]:
    environment = {name: value for name, value in os.environ.items() if name != compiled_code.VARIABLE}
    environment |= {'XDG_CACHE_HOME': str(folder), 'PYTHONPATH': str(ROOT), **more}
    command = [sys.executable, '-c', program, kinds]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=errors, text=True)


def result(process: subprocess.Popen[str]) -> list[float]:
    """Value of the function, and whether it came from disk."""
    out, _ = process.communicate(timeout=100.0)
    assert process.returncode == 0
    return json.loads(out)


class Filled(NamedTuple):
    """A folder that a process has compiled into, and the value of the function."""

    folder: Path
    value: float

    def copied(self, folder: Path) -> Path:
        return shutil.copytree(self.folder, folder, dirs_exist_ok=True)


@pytest.fixture(scope='module')
def filled(tmp_path_factory) -> Filled:
    """Filled with a umask that closes nothing."""
    folder = tmp_path_factory.mktemp('filled')
    value, hits = result(started(folder, PROGRAM.replace('import json, sys', 'import json, os, sys; os.umask(0)')))
    assert hits == 0
    return Filled(folder, value)


def test_the_second_process_compiles_nothing(filled):
    assert result(started(filled.folder)) == [filled.value, 1]


@pytest.mark.parametrize('variable', ['XDG_CACHE_HOME', compiled_code.VARIABLE])
def test_a_folder_of_the_user_is_taken(tmp_path, variable):
    named = tmp_path / 'named'
    result(started(tmp_path / 'other', **{variable: str(named)}))
    assert list(named.rglob('*.nbc'))
    assert not (tmp_path / 'other').exists()


def test_without_a_folder_it_works_as_well(tmp_path):
    (tmp_path / 'file').write_text('')
    value, hits = result(started(tmp_path / 'file'))
    assert value > 0.0
    assert hits == 0


def test_damaged_files_are_as_good_as_none(filled, tmp_path):
    filled.copied(tmp_path)
    for path in (*tmp_path.rglob('*.nbi'), *tmp_path.rglob('*.nbc')):
        path.write_bytes(path.read_bytes()[:40])
    assert result(started(tmp_path)) == [filled.value, 0]


def open_to_all(folder: Path) -> None:
    folder.chmod(0o777)


def open_to_the_group(folder: Path) -> None:
    folder.chmod(0o770)


def of_another_user(folder: Path) -> None:
    if os.geteuid() == 0:
        os.chown(folder, 65534, 65534)
    else:
        shutil.rmtree(folder)
        folder.symlink_to('/usr')


@pytest.mark.parametrize('make', [open_to_all, open_to_the_group, of_another_user])
@pytest.mark.parametrize('variable', ['XDG_CACHE_HOME', compiled_code.VARIABLE])
def test_a_folder_that_another_user_could_write_to_is_refused_with_one_line(filled, tmp_path, make, variable):
    """Whoever may write there could let this process run anything."""
    folder = tmp_path / 'seal_friction_ros'
    named = {variable: str(folder)} if variable == compiled_code.VARIABLE else {}
    filled.copied(tmp_path)
    make(folder)
    before = sorted(tmp_path.rglob('*'))
    out, errors = started(tmp_path, errors=subprocess.PIPE, **named).communicate(timeout=100.0)
    assert json.loads(out) == [filled.value, 0]
    assert errors.startswith(f'compiled code is not kept in {folder}: ')
    assert errors.count('\n') == 1
    assert sorted(tmp_path.rglob('*')) == before


def test_the_folder_is_for_its_user_alone_whatever_the_umask(filled):
    made = [filled.folder / 'seal_friction_ros', *(filled.folder / 'seal_friction_ros').iterdir()]
    assert len(made) == 2
    assert all(folder.stat().st_mode & 0o777 == 0o700 for folder in made)


GONE = "import os, pathlib, shutil; place = pathlib.Path(os.environ['NUMBA_CACHE_DIR']); shutil.rmtree(place); "
FULL = 'import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))'


@pytest.mark.parametrize('wrong', [GONE + "place.write_text('')", FULL], ids=['gone', 'full'])
def test_a_folder_that_takes_no_file_is_as_good_as_none(tmp_path, wrong):
    value, hits = result(started(tmp_path, PROGRAM.replace('grease =', f'{wrong}; grease =')))
    assert value > 0.0
    assert hits == 0
    assert not list(tmp_path.rglob('*.nbc'))


@pytest.mark.long
def test_processes_that_compile_at_once_mix_nothing_up(tmp_path):
    """Each for arguments of other types: numba alone may give the files of both the same name."""
    kinds = ['00000', '00001']
    once = [result(each) for each in [started(tmp_path, kinds=kind) for kind in kinds]]
    again = [result(each) for each in [started(tmp_path, kinds=kind) for kind in kinds]]
    assert [value for value, _ in again] == [value for value, _ in once]
    assert [hits for _, hits in again] == [1, 1]


def test_what_was_not_used_for_a_month_is_removed(tmp_path, monkeypatch):
    monkeypatch.setenv(compiled_code.VARIABLE, 'set, so that it comes back')
    monkeypatch.delenv(compiled_code.VARIABLE)
    ages = {'today': 0.0, 'last week': 7.0, 'last year': 365.0}  # [days]
    for name, age in ages.items():
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, 2 * (time.time() - age * 86400.0,))
    monkeypatch.setattr('numba.config.CACHE_DIR', '')
    compiled_code.use_folder(tmp_path)
    made = Path(os.environ[compiled_code.VARIABLE])
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(['last week', 'today', made.name])


def test_a_changed_source_is_compiled_anew(tmp_path):
    source = tmp_path / 'part' / 'module.py'
    source.parent.mkdir()
    source.write_text('a = 1')
    keys = [compiled_code.key_of(tmp_path)]
    os.utime(source, (1.0, 1.0))
    keys.append(compiled_code.key_of(tmp_path))
    (tmp_path / 'new.py').write_text('')
    keys.append(compiled_code.key_of(tmp_path))
    assert len(set(keys)) == 3
    (tmp_path / 'notes.txt').write_text('')
    assert compiled_code.key_of(tmp_path) == keys[-1]
