"""Several logs or bags become a bag each: the same bytes whatever the number of workers."""

import json
import os
import signal
from functools import partial
from pathlib import Path

import pytest
import yaml
from harness.example_bags import write_inputs
from harness.standard_bags import MAPPING, write_standard
from offline.bags.test_import_log import RIG, ROWS

from seal_friction_ros.offline.bags import import_log
from seal_friction_ros.offline.bags import import_many as import_many_module
from seal_friction_ros.offline.bags.bag import BagError, bag_topics
from seal_friction_ros.offline.bags.import_log import convert_log
from seal_friction_ros.offline.bags.import_many import import_many
from seal_friction_ros.offline.bags.rig_file import read_rig
from seal_friction_ros.offline.commands.main import main


@pytest.fixture
def words(tmp_path, monkeypatch) -> list[str]:
    """An import of two logs and one that is none."""
    monkeypatch.chdir(tmp_path)
    Path('rig.yaml').write_text(yaml.safe_dump(RIG))
    Path('a.csv').write_text(ROWS)
    Path('b.csv').write_text(ROWS.replace('30', '31'))
    Path('bad.csv').write_text('no numbers\n')
    return ['import', 'log', 'a.csv', 'bad.csv', 'b.csv', '--rig', './rig.yaml']


def contents(folder: Path) -> dict[Path, bytes]:
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob('*') if path.is_file()}


def test_each_log_gets_the_bag_that_it_gets_alone_and_a_bad_one_spoils_no_other(words, capsys):
    said = []
    for workers in ('1', '3'):
        assert main([*words, '--out', f'bags{workers}', '--workers', workers, '--json']) == 2
        said.append(capsys.readouterr())
    assert said[0].err.replace('bags1', 'bags3') == said[1].err
    assert said[1].err.count('seal_friction: bad.csv: ') == 1
    found = json.loads(said[1].out)['sources']
    assert [one.get('out') for one in found] == ['bags3/a', None, 'bags3/b']
    assert found[0]['imported']['rows'] == 3
    for name in ('a', 'b'):
        assert main(['import', 'log', f'{name}.csv', '--rig', './rig.yaml', '--out', f'alone/{name}']) == 0
    assert contents(Path('bags1')) == contents(Path('bags3')) == contents(Path('alone'))


def test_without_one_good_source_and_after_a_refusal_nothing_is_left(words, capsys):
    before = contents(Path())
    Path('c').mkdir()
    Path('c/a.csv').write_text(ROWS)
    bad = ['import', 'log', 'bad.csv', 'gone.csv', '--rig', './rig.yaml', '--out', 'bags']
    assert main(bad) == 2
    assert main(['import', 'log', 'a.csv', 'c/a.csv', '--rig', './rig.yaml', '--out', 'bags']) == 2
    assert 'a.csv and c/a.csv would both be bag a: rename one' in capsys.readouterr().err
    assert contents(Path()).keys() - before.keys() == {Path('c/a.csv')}
    (Path('bags')).mkdir()
    with pytest.raises(BagError, match='bags exists already'):
        import_many(partial(convert_log, rig=read_rig(Path('rig.yaml'))), [Path('a.csv')], Path('bags'), 1)


def test_a_process_that_dies_costs_its_own_bag_only_and_leaves_no_part_of_it(words):
    def dying(log: Path, out: Path) -> tuple[dict[str, int], str]:
        out.mkdir(parents=True)
        (out / 'part').touch()
        return os._exit(9) if log.name == 'a.csv' else ({'rows': 1}, 'done')

    dead, done = import_many(dying, [Path('a.csv'), Path('b.csv')], Path('bags'), 2)
    assert dead.error.startswith('a.csv: its process ended')
    assert done.result == {'numbers': {'rows': 1}, 'text': 'done'}
    assert [*contents(Path('bags'))] == [Path('b/part')]
    (alone,) = import_many(dying, [Path('b.csv')], Path('folder/alone'), 2)  # as on a cluster
    assert alone.result == done.result
    assert [*contents(Path('folder'))] == [Path('alone/part')]
    assert not list(Path().glob('.*'))


def test_an_interrupted_import_goes_on_and_says_and_makes_the_same(words, capsys, monkeypatch):
    asked = [*words, '--out', 'bags', '--work', 'work', '--workers', '1', '--json']
    assert main([*words, '--out', 'plain', '--json']) == 2
    plain = capsys.readouterr()
    convert, log_of_calls = import_log.convert_log, Path('calls')

    def counted(log: Path, out: Path, rig: object) -> object:
        with log_of_calls.open('a') as calls:
            calls.write(f'{log.name} ')
        return convert(log, out, rig)

    monkeypatch.setattr(import_log, 'convert_log', counted)
    with monkeypatch.context() as patch:
        patch.setattr(import_many_module.shutil, 'move', lambda *_: signal.raise_signal(signal.SIGINT))
        assert main(asked) == 130
    assert not Path('bags').exists()
    assert main(asked) == 2
    assert log_of_calls.read_text() == 'a.csv bad.csv b.csv '  # once each; also the failure was kept
    assert capsys.readouterr().out == plain.out.replace('plain', 'bags')
    assert contents(Path('bags')) == contents(Path('plain'))
    assert not list(Path('work').glob('*.bag'))
    assert main([*words, '--out', 'again', '--work', 'work']) == 2
    assert contents(Path('again')) == contents(Path('plain'))


def test_bags_with_standard_messages_get_a_bag_for_each_actuator(tmp_path, capsys):
    source = write_inputs(tmp_path / 'inputs', 20)
    runs = [str(write_standard(source, tmp_path / name)) for name in ('monday', 'tuesday')]
    mapping = tmp_path / 'robot.yaml'
    for count, text in ((1, ''), (2, MAPPING.partition('actuators:\n')[2].replace('  axis:', '  twin:'))):
        mapping.write_text(MAPPING + text)
        out = tmp_path / f'bags {count}'
        work = ['--work', str(tmp_path / 'work')] if count == 2 else []
        assert main(['import', 'bag', *runs, '--mapping', str(mapping), '--out', str(out), '--json', *work]) == 0
        found = json.loads(capsys.readouterr().out)['sources']
        bags = [Path(actuator['bag']) for one in found for actuator in one['imported'].values()]
        assert [one['out'] for one in found] == [str(out / 'monday'), str(out / 'tuesday')]
        assert len({*bags}) == 2 * count
        for bag in bags:
            assert bag_topics(bag)['/rod_velocity'].message_count == 20
