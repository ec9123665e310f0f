"""``seal_friction fleet``: every bag in its row, whatever becomes of the others; finished bags are not read again."""

import json
import os
import shutil
from pathlib import Path

import pytest
from harness.closed_loop_bags import write_closed_loop
from harness.compensation import compensating
from harness.example_bags import rewrite, write_recorded
from harness.report_page import checked_page

from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, FEEDFORWARD_TYPE
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay import bag_summary as module


@pytest.fixture(scope='module')
def fleet(tmp_path_factory) -> Path:
    """A good bag, one without estimates, a garbage file, a cut bag, a folder that says it is a bag."""
    folder = tmp_path_factory.mktemp('fleet') / 'bags'
    (folder / 'rig ä').mkdir(parents=True)
    recorded = write_closed_loop(folder.parent / 'recorded', seconds=1.0)
    shutil.copytree(recorded, folder / 'rig ä' / 'gut')
    answers = (ESTIMATE_TYPE, FEEDFORWARD_TYPE)
    rewrite(recorded, folder / 'inputs', lambda _, one: None if one.type_name in answers else one)
    (folder / 'garbage.mcap').write_bytes(os.urandom(5000))
    cut = shutil.copytree(recorded, folder / 'rig ä' / 'cut')
    file = next(cut.glob('*.mcap'))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    (folder / 'empty').mkdir()
    (folder / 'empty' / 'metadata.yaml').write_text('[')
    return folder


def run(capsys, *words: object) -> tuple[int, dict, str]:
    code = main(['fleet', *map(str, words), '--json', '--workers', '2'])
    said = capsys.readouterr()
    return code, json.loads(said.out) if said.out else {}, said.err


def test_every_bag_has_a_row_and_damaged_ones_are_listed_with_their_reason(fleet, tmp_path, capsys):
    code, found, errors = run(capsys, fleet, '--out', tmp_path / 'fleet.html')
    assert code == 2
    levels = {Path(bag['bag']).name: (bag['level'], bag['why'][:8]) for bag in found['bags']}
    damaged = {name for name, (level, why) in levels.items() if (level, why) == ('bad', 'damaged:')}
    assert damaged == {'garbage.mcap', 'cut', 'empty'}
    assert {bag['replay'] for bag in found['bags'] if Path(bag['bag']).name == 'gut'} == {'identical'}
    assert all(errors.count(f'seal_friction: {fleet}') == 3 and name in errors for name in damaged)
    page = checked_page(tmp_path / 'fleet.html')
    assert page.texts['p.said'][0].startswith('Bad: 5 of 5 bags are bad, 3 damaged')  # two have placeholder seals


def test_finished_bags_are_not_computed_again_and_failed_ones_only_when_asked(fleet, tmp_path, capsys, monkeypatch):
    words = (fleet, '--out', tmp_path / 'fleet.html', '--work', tmp_path / 'work')
    first = run(capsys, *words)
    page = (tmp_path / 'fleet.html').read_bytes()
    assert len(list((tmp_path / 'work').iterdir())) == 5
    computed = tmp_path / 'computed'

    def noted(bag, chosen):
        with computed.open('a') as file:
            file.write(f'{bag.name}\n')
        return summary(bag, chosen)

    summary = module.bag_summary
    monkeypatch.setattr(module, 'bag_summary', noted)
    assert run(capsys, *words) == first
    assert (tmp_path / 'fleet.html').read_bytes() == page
    assert not computed.exists()
    assert run(capsys, *words, '--retry-failed') == first
    assert sorted(computed.read_text().split()) == ['cut', 'empty', 'garbage.mcap']
    computed.unlink()
    (fleet / 'garbage.mcap').write_bytes(os.urandom(500))  # another content is another part
    run(capsys, *words)
    assert computed.read_text().split() == ['garbage.mcap']


def test_a_bag_that_ends_its_process_is_listed_and_tried_again(fleet, tmp_path, capsys, monkeypatch):
    summary = module.bag_summary

    def dying(bag, chosen):
        return os._exit(9) if bag.name == 'inputs' else summary(bag, chosen)

    words = (fleet, '--out', tmp_path / 'fleet.html', '--work', tmp_path / 'work')
    monkeypatch.setattr(module, 'bag_summary', dying)
    _, found, _ = run(capsys, *words)
    assert [bag['why'] for bag in found['bags'] if bag['bag'].endswith('inputs')] == [
        'damaged: its process ended before it was done: is there enough memory?'
    ]
    monkeypatch.setattr(module, 'bag_summary', summary)
    _, found, _ = run(capsys, *words)
    (tried,) = [bag['why'] for bag in found['bags'] if bag['bag'].endswith('inputs')]
    assert 'placeholder' in tried


def test_the_table_has_a_row_for_each_bag_and_pressure_level(fleet, tmp_path, capsys):
    parquet = pytest.importorskip('pyarrow.parquet')
    out, listed = tmp_path / 'fleet.parquet', tmp_path / 'bags.txt'
    recorded = write_recorded(tmp_path, compensating())  # at several pressures
    listed.write_text(f'{recorded}\n{fleet / "rig ä" / "cut"}\n')
    run(capsys, listed, '--out', tmp_path / 'fleet.html', '--parquet', out)
    rows = parquet.read_table(out).to_pylist()
    of_bag = [row for row in rows if row['bag'].endswith('recorded')]
    assert len(of_bag) > 1
    assert len({row['level_pressure'] for row in of_bag}) == len(of_bag)
    assert all(row['level_samples'] >= 1 and row['replay'] == 'identical' for row in of_bag)
    (damaged,) = [row for row in rows if row['bag'].endswith('cut')]
    assert damaged['why'].startswith('damaged: ')
    assert damaged['duration'] is None
    assert damaged['level_pressure'] is None
    assert run(capsys, listed, '--out', tmp_path / 'fleet.html', '--parquet', out)[0] == 2  # not overwritten
    assert out.read_bytes()


def test_names_that_are_no_text_and_devices_are_rows_like_others(tmp_path, capsys):
    name = os.fsencode(tmp_path) + b'/bags/\xff\xfe.mcap'
    (tmp_path / 'bags').mkdir()
    Path(os.fsdecode(name)).write_bytes(b'garbage')
    os.mkfifo(tmp_path / 'bags' / 'fifo.mcap')
    (tmp_path / 'bags' / 'zero.mcap').symlink_to('/dev/zero')
    code = main(['fleet', str(tmp_path / 'bags'), '--out', str(tmp_path / 'f.html'), '--work', str(tmp_path / 'work')])
    said = capsys.readouterr()
    assert code == 2
    assert '3 bags: 0 good, 0 look, 3 bad' in said.out
    assert checked_page(tmp_path / 'f.html').texts['p.said'][0].startswith('Bad: 3 of 3 bags are bad, 3 damaged')


@pytest.mark.parametrize('content', [None, b'', b'\x00\xff\x89', b'# nothing\n'])
def test_what_is_no_fleet_is_one_line_and_nothing_is_written(content, tmp_path, capsys):
    where = tmp_path / 'where'
    if content is not None:
        where.write_bytes(content)
    assert main(['fleet', str(where), '--out', str(tmp_path / 'fleet.html')]) == 2
    assert capsys.readouterr().err.count('\n') == 1
    assert not (tmp_path / 'fleet.html').exists()
