"""Every sample of damaged logs and bags is used, or left out with a reason, in the JSON of each command."""

import json
from pathlib import Path

import numpy as np
import pytest
from harness.closed_loop_bags import write_closed_loop
from harness.example_bags import rewrite
from harness.identify_run import Run
from harness.standard_bags import MAPPING, write_standard

from seal_friction_ros.core.messages.coder import decode, encode
from seal_friction_ros.core.messages.layouts import VELOCITY_TYPE
from seal_friction_ros.offline.bags.bag import BagMessage, BagWriter, read_messages
from seal_friction_ros.offline.commands.main import main

RIG = """name: rig
source: simulated
frame_id: rod
header: row
start: 1.0
time: {column_name: t, unit: s}
chamber_a: {terms: [{column_name: p, unit: bar}]}
chamber_b: {constant: 0.0}
force_sum: {terms: [{column_name: f, unit: N}]}
velocity: {terms: [{column_name: v, unit: m/s}]}
"""
DAMAGE = ('word', 'empty', 'nan', 'short', 'same time', 'back in time')


def rows() -> list[list[str]]:
    """Strokes of 2 s out and back, with rests between, at four pressures; 50 Hz."""
    rng, found = np.random.default_rng(0), []
    for bar in (1.0, 3.0, 5.0, 7.0):
        for velocity in (0.02, 0.0, -0.02, 0.0) * 3:
            for _ in range(100 if velocity else 20):
                force = np.sign(velocity) * (4.0 + 0.6 * bar) * (1.0 + 0.01 * rng.normal()) + 1.0
                found.append([f'{0.02 * len(found):.2f}', f'{bar}', f'{velocity}', f'{force:.5g}'])
    return found


def damaged(seed: int) -> list[list[str]]:
    """The rows, with up to one in four hundred of each kind of damage anywhere."""
    rng, found = np.random.default_rng(seed), rows()
    for kind in DAMAGE:
        for i in rng.choice(np.arange(1, len(found)), rng.integers(0, len(found) // 400), replace=False):
            cell = int(rng.integers(0, 4))
            found[i] = {
                'word': [*found[i][:cell], 'broken', *found[i][cell + 1 :]],
                'empty': [*found[i][:3], ''],
                'nan': [*found[i][:3], 'nan'],
                'short': found[i][:2],
                'same time': [found[i - 1][0], *found[i][1:]],
                'back in time': ['0.01', *found[i][1:]],
            }[kind]
    return found


@pytest.mark.parametrize('seed', range(6))
def test_every_row_of_a_damaged_log_is_used_or_left_out_with_a_reason(seed, tmp_path, capsys):
    made = damaged(seed)
    log, rig = tmp_path / 'log.csv', tmp_path / 'rig.yaml'
    log.write_text('\n'.join(['t,p,v,f', *(','.join(row) for row in made)]))
    rig.write_text(RIG)
    assert main(['import', 'log', str(log), '--rig', str(rig), '--out', str(tmp_path / 'bag'), '--json']) == 0
    imported = json.loads(capsys.readouterr().out)
    assert imported['rows'] + sum(imported['dropped'].values()) == len(made)
    for source in ((str(log), '--rig', str(rig)), (str(tmp_path / 'bag'), '--seal-chambers', 'a')):
        figures = Run(tmp_path, *source, name=source[0][-3:]).figures
        (used,), (total,) = figures['samples_used'].values(), figures['samples_total'].values()
        assert used + sum(figures['samples_left_out'].values()) == total
        assert total == (len(made) if source[0] == str(log) else imported['rows'])


@pytest.fixture(scope='module')
def axis(tmp_path_factory):
    return write_closed_loop(tmp_path_factory.mktemp('source') / 'run', scales=(0.0,), seconds=2.0)


def damaged_bag(source: Path, folder: Path, seed: int) -> Path:
    """The signals as standard messages; some velocities are no numbers, repeat or go back in time, or are cut short."""
    rng = np.random.default_rng(seed)

    def chosen(bag: Path, kind: str) -> list[int]:
        places = [i for i, message in enumerate(read_messages(bag)) if message.type_name == kind]
        return rng.choice(places[1:], int(rng.integers(1, len(places) // 40)), replace=False).tolist()

    missing, again, back = (chosen(source, VELOCITY_TYPE) for _ in range(3))
    before = [0]

    def change(number: int, message: BagMessage) -> BagMessage:
        if message.type_name != VELOCITY_TYPE:
            return message
        record = decode(message.type_name, message.data)
        if number in missing:
            record = record._replace(velocity=float('nan'))
        if number in again:
            record = record._replace(stamp=before[-1])
        if number in back:
            record = record._replace(stamp=before[-1] - 5_000_000)
        before.append(record.stamp)
        return message._replace(data=encode(record))

    foreign = write_standard(rewrite(source, folder / 'own', change), folder / 'foreign')
    short = chosen(foreign, 'sensor_msgs/msg/JointState')
    late = int(rng.integers(1, 200))
    with BagWriter(folder / 'damaged') as writer:
        for number, message in enumerate(read_messages(foreign)):
            if message.topic != '/p_a' or number > late:
                writer.write(*message._replace(data=message.data[:7] if number in short else message.data))
    return folder / 'damaged'


def count_of(bag: Path, *, topic: str) -> int:
    return sum(message.topic == topic for message in read_messages(bag))


@pytest.mark.parametrize('seed', range(3))
def test_every_message_of_a_damaged_bag_is_used_or_left_out_with_a_reason(seed, axis, tmp_path, capsys):
    made, bag, out = damaged_bag(axis, tmp_path, seed), str(tmp_path / 'bag'), str(tmp_path / 'out')
    (tmp_path / 'robot.yaml').write_text(MAPPING)
    mapped = ['--mapping', str(tmp_path / 'robot.yaml')]
    used = {}
    for name, words in {
        'import': ['import', 'bag', str(made), *mapped, '--out', bag],
        'identify': ['identify', bag, '--largest-acceleration', '100', '--out', f'{out}.yaml'],
        'mapped': ['identify', str(made), *mapped, '--largest-acceleration', '100', '--out', f'{out}_mapped.yaml'],
        'tune': ['tune', '--bag', bag, '--out', f'{out}_feedforward.yaml'],
        'health': ['health', bag],
    }.items():
        assert main([*words, '--json']) == 0
        figures = json.loads(capsys.readouterr().out)
        figures = {'import': lambda f: f['axis'], 'health': lambda f: f['bags'][0]}.get(name, lambda f: f)(figures)
        counts = [figures[key] for key in ('samples_used', 'samples_total')]
        used[name], total = (next(iter(one.values())) if isinstance(one, dict) else one for one in counts)
        is_foreign = name in ('import', 'mapped')
        topic = '/joint_states' if is_foreign else '/rod_velocity'
        assert total == count_of(made if is_foreign else Path(bag), topic=topic)
        assert used[name] + sum(figures['samples_left_out'].values()) == total
        assert min(figures['samples_left_out'].values()) > 0
        assert ('malformed' in figures['samples_left_out']) == is_foreign
    assert used['import'] == count_of(Path(bag), topic='/rod_velocity')
    assert 0 < used['identify'] < used['import']
