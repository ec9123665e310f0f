"""Inputs by URL of fsspec: copied where they are read, removed afterwards, and one line for what cannot be read."""

import json
import multiprocessing
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from harness.example_bags import write_inputs, write_recorded
from paths import ROOT

from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay import bag_summary
from seal_friction_ros.offline.work.finished_parts import input_digest
from seal_friction_ros.offline.work.places import as_path, name_of, place_of

fsspec = pytest.importorskip('fsspec')


@pytest.fixture(autouse=True)
def copies(tmp_path, monkeypatch) -> Path:
    """Folder of the copies; there is none after a test."""
    folder = tmp_path / 'copies'
    folder.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(folder))
    yield folder
    assert not list(folder.iterdir())


@pytest.fixture
def memory(tmp_path) -> str:
    """A bag in memory, which processes inherit."""
    files = fsspec.filesystem('memory')
    files.store.clear()
    for file in write_recorded(tmp_path).iterdir():
        files.pipe_file(f'/store/recorded/{file.name}', file.read_bytes())
    return 'memory://store/recorded'


def test_a_text_is_a_path_or_a_url_and_a_file_url_is_a_path():
    assert place_of('a/b: c') == Path('a/b: c')
    assert place_of('file:///a/b%20c') == place_of('file://localhost/a/b%20c') == Path('/a/b c')
    assert place_of('s3://bucket/bag') == 's3://bucket/bag'
    with pytest.raises(ValueError, match='of computer other: write file:///PATH'):
        place_of('file://other/a')
    assert [name_of(place) for place in ('s3://a/run/', 's3://a/log.csv', Path('a/log.csv'))] == ['run', 'log', 'log']


def test_every_command_takes_the_bag_of_a_url_as_it_takes_a_path(memory, tmp_path, capsys):
    bag = str(tmp_path / 'recorded')
    said = {}
    for place in (bag, memory):
        for words in (
            ['replay', place, '--verify'],
            ['replay', place, bag, '--verify', '--work', str(tmp_path / 'work')],
            ['import', 'bag', place, '--mapping', 'test_bench', '--out', str(tmp_path / 'out')],
            ['identify', place, '--out', str(tmp_path / 'seal.yaml')],
        ):
            code = main([*words, '--workers', '2'])
            out, errors = capsys.readouterr()
            texts = [text.replace(place, 'BAG').replace(bag, 'BAG') for text in (out, errors)]
            said.setdefault(place, []).append((code, *texts))
    assert said[bag] == said[memory]
    assert [code for code, *_ in said[bag]] == [0, 0, 2, 2]  # with their reasons


@pytest.mark.parametrize('is_quick', [True, pytest.param(False, marks=pytest.mark.long)])
def test_the_list_of_a_fleet_takes_urls_each_once(memory, tmp_path, capsys, monkeypatch, is_quick):
    if is_quick:  # what is computed takes the compiler
        monkeypatch.setattr(bag_summary, 'compile_first', lambda *_: None)
        monkeypatch.setattr(bag_summary, 'bag_summary', no_summary)
    (tmp_path / 'list').write_text(f'{memory}\n{memory}\nmemory://store/gone\n')
    assert main(['fleet', str(tmp_path / 'list'), '--out', str(tmp_path / 'fleet.html'), '--json']) == 2
    out, errors = capsys.readouterr()
    found = {one['bag']: one for one in json.loads(out)['bags']}
    assert found.keys() == {memory, 'memory://store/gone'}
    assert 'seal_friction: memory://store/gone: there is no such file or bag\n' in errors
    if is_quick:
        assert f'seal_friction: {memory}: 2 files\n' in errors
    else:
        assert found[memory]['replay'] == 'identical'
    assert 'memory://store' in (tmp_path / 'fleet.html').read_text()


def no_summary(bag: Path, *_: object) -> None:
    raise ValueError(f'{bag}: {len(list(bag.iterdir()))} files')


def test_finished_parts_follow_the_content_of_a_url(memory, tmp_path, capsys):
    digest = input_digest(memory)
    assert input_digest(memory) == digest
    fsspec.filesystem('memory').pipe_file('/store/recorded/more', b'more')
    assert input_digest(memory) != digest
    listed = f'local://{write_inputs(tmp_path / "listed", 3)}'  # whose store lists the time of a change
    digest = input_digest(listed)
    assert input_digest(listed) == digest
    with (tmp_path / 'listed' / 'metadata.yaml').open('a') as file:
        file.write('\n')
    assert input_digest(listed) != digest


def test_a_log_is_imported_and_named_as_in_the_store(tmp_path):
    fsspec.filesystem('memory').pipe_file('/logs/monday.csv', b'0,1,2,3\n20,1,2,3\n')
    (tmp_path / 'rig.yaml').write_text(
        '{name: rig, time: {column: 0, unit: ms}, chamber_a: {terms: [{column: 1, unit: bar}]}, '
        'chamber_b: {constant: 0.0}, force_sum: {terms: [{column: 2, unit: N}]}, '
        'velocity: {terms: [{column: 3, unit: mm/s}]}}'
    )
    words = ['import', 'log', '--rig', str(tmp_path / 'rig.yaml'), '--out']
    assert main([*words, str(tmp_path / 'one'), 'memory://logs/monday.csv']) == 0
    (tmp_path / 'other.csv').write_text('0,1,2,3\n')
    assert main([*words, str(tmp_path / 'bags'), 'memory://logs/monday.csv', str(tmp_path / 'other.csv')]) == 0
    assert {path.name for path in (tmp_path / 'bags').iterdir()} == {'monday', 'other'}


@pytest.mark.parametrize(
    ('url', 'said'),
    [
        ('nonsense://a/b', 'Protocol not known: nonsense'),
        ('s3://bucket/bag', 'Install s3fs'),
        ('memory://nowhere', 'there is no such file or bag'),
        ('local:///nowhere/bag', 'there is no such file or bag'),
        (f'local://{ROOT}/config', 'not a rosbag2 bag: there is no metadata.yaml'),
        ('file://other/bag', 'of computer other'),
    ],
)
def test_what_cannot_be_read_is_one_line(url, said, capsys):
    fsspec.filesystem('memory').store.clear()
    try:
        code = main(['replay', url])
    except SystemExit as error:  # of the parser
        code = error.code
    errors = capsys.readouterr().err
    assert (code, errors.count('\n')) == (2, 1)
    assert url in errors
    assert said in errors


def test_no_copy_is_left_by_a_process_that_is_ended(memory, copies):
    context = multiprocessing.get_context('fork')
    ours, its = context.Pipe()

    def read() -> None:
        with as_path(memory) as path:
            its.send(str(path))
            its.recv()

    process = context.Process(target=read)
    process.start()
    assert ours.poll(10.0)
    assert Path(ours.recv()).parent.parent == copies
    process.terminate()
    process.join()
    assert process.exitcode == 143


def test_a_command_without_a_url_does_not_load_fsspec():
    program = 'import sys; from seal_friction_ros.offline.commands.main import main; '
    program += (
        "code = main(['replay', 'bags/pull_test', 'bags/faults']); sys.exit(99 if 'fsspec' in sys.modules else code)"
    )
    assert subprocess.run([sys.executable, '-c', program], cwd=ROOT, capture_output=True, check=False).returncode == 0
