"""Any rosbag with standard messages becomes a bag of this project with the same signals."""

import json
import math
import struct
from itertools import pairwise
from statistics import fmean

import pytest
from harness.closed_loop_bags import write_closed_loop
from harness.standard_bags import MAPPING, write_standard
from rosbags.rosbag2 import StoragePlugin

from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.layouts import INPUTS
from seal_friction_ros.offline.bags.bag import BagError, BagWriter, read_messages
from seal_friction_ros.offline.bags.import_bag import convert_bag
from seal_friction_ros.offline.bags.mapped_bag import read_mapping
from seal_friction_ros.offline.commands.main import main


@pytest.fixture(scope='module')
def source(tmp_path_factory):
    return write_closed_loop(tmp_path_factory.mktemp('source') / 'run', scales=(0.0,), seconds=1.0)


def mapping_file(folder, *changes):
    text = MAPPING
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / 'robot.yaml').write_text(text)
    return str(folder / 'robot.yaml')


def signals(bag):
    found = {}
    for message in read_messages(bag):
        if message.type_name in INPUTS.values():
            found.setdefault(message.type_name, []).append(decode(message.type_name, message.data))
    return found


@pytest.mark.parametrize('storage', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_the_signals_are_those_of_the_machine(tmp_path, source, storage):
    foreign = write_standard(source, tmp_path / 'foreign', storage)
    found = convert_bag(foreign, tmp_path / 'imported', read_mapping(mapping_file(tmp_path)))
    assert found['axis'].remarks == ()
    expected, imported = signals(source), signals(tmp_path / 'imported')
    assert imported.keys() == expected.keys()
    for kind, records in expected.items():
        assert len(imported[kind]) == len(records)
        for one, other in zip(imported[kind], records, strict=True):
            assert one[0] == other[0]
            numbers, others = ([v for v in record if isinstance(v, float)] for record in (one, other))
            assert numbers == pytest.approx(others, abs=1e-9, rel=1e-9)


def test_stamps_of_a_simulation_keep_their_own_clock(tmp_path, source):
    foreign = write_standard(source, tmp_path / 'foreign', clock_offset=-1_700_000_000_000_000_000)
    convert_bag(foreign, tmp_path / 'imported', read_mapping(mapping_file(tmp_path)))
    assert main(['replay', str(tmp_path / 'imported'), '--out', str(tmp_path / 'replayed')]) == 0
    kinds = 'seal_friction_msgs/msg/FrictionEstimate'
    estimates = [decode(kinds, m.data) for m in read_messages(tmp_path / 'replayed') if m.type_name == kinds]
    assert len(estimates) == 1000
    assert estimates[-1].stamp < 2_000_000_000
    assert not any(estimate.status & 65536 for estimate in estimates)  # the age of the stamps


def test_an_imported_bag_is_tuned_identified_and_replayed(tmp_path, source, capsys):
    foreign = write_standard(source, tmp_path / 'foreign')
    imported, seals = tmp_path / 'imported', ('[ms28775_114@a, ms28775_114@b]', '[placeholder@a, placeholder@b]')
    mapping = mapping_file(tmp_path, seals)
    assert main(['import', 'bag', str(foreign), '--mapping', mapping, '--out', str(imported)]) == 0
    numbers = {}
    for bag in (source, imported):
        capsys.readouterr()
        out = tmp_path / f'{bag.name}.yaml'
        assert main(['tune', '--bag', str(bag), '--out', str(out), '--json']) in (0, 1)
        numbers[bag.name] = json.loads(capsys.readouterr().out)
    for key in ('largest_friction', 'mass', 'friction_over_model', 'recorded_tracking_rms'):
        # The simulated loop began without settling, so its first 0.1 s count in the one bag alone.
        assert numbers['imported'][key] == pytest.approx(numbers['run'][key], rel=2e-2)
    assert main(['replay', str(imported), '--out', str(tmp_path / 'replayed')]) == 0
    assert main(['replay', str(tmp_path / 'replayed'), '--verify']) == 0


@pytest.mark.parametrize(
    ('change', 'error'),
    [
        (('velocity[axis]\n      position', 'velocity[axes]\n      position'), "no 'axes' in name: it has axis, other"),
        (('/p_a: sensor_msgs/msg/FluidPressure', '/p_a: std_msgs/msg/Float64'), 'but .* has sensor_msgs'),
        (('/joint_states velocity[axis]', '/joint_states velocitys[axis]'), 'did you mean velocity'),
    ],
)
def test_a_mapping_that_does_not_fit_is_refused_and_leaves_nothing(tmp_path, source, change, error):
    foreign = write_standard(source, tmp_path / 'foreign')
    with pytest.raises(ValueError, match=error):
        convert_bag(foreign, tmp_path / 'imported', read_mapping(mapping_file(tmp_path, change)))
    assert not (tmp_path / 'imported').exists()


def test_a_bag_of_other_topics_is_refused(tmp_path, source):
    with pytest.raises(ValueError, match='none of the topics'):
        convert_bag(source, tmp_path / 'imported', read_mapping(mapping_file(tmp_path)))
    with pytest.raises(BagError):
        convert_bag(tmp_path / 'nothing', tmp_path / 'imported', read_mapping(mapping_file(tmp_path)))


def test_gauge_taken_for_absolute_and_the_reverse_are_said(tmp_path, source):
    foreign = write_standard(source, tmp_path / 'foreign')
    wrong = mapping_file(tmp_path, ('pressure_a: /p_a\n', 'pressure_a: {topic: /p_a, absolute: false}\n'))
    (remark,) = convert_bag(foreign, tmp_path / 'as_gauge', read_mapping(wrong))['axis'].remarks
    assert 'write absolute: true' in remark
    gauge = mapping_file(tmp_path, ('pressure_a: /p_a\n', 'pressure_a: {topic: /p_a, offset: -200 bar}\n'))
    (remark,) = convert_bag(foreign, tmp_path / 'below', read_mapping(gauge))['axis'].remarks
    assert 'write absolute: false' in remark


def damaged(bag, out, damage):
    """The bag with the bytes of each message as ``damage(number, message)`` gives them."""
    with BagWriter(out) as writer:
        for number, message in enumerate(read_messages(bag)):
            writer.write(*message._replace(data=damage(number, message)))
    return out


def stamped_ahead(message, seconds):
    stamp, nanoseconds = struct.unpack_from('<iI', message.data, 4)
    return message.data[:4] + struct.pack('<iI', stamp + seconds, nanoseconds) + message.data[12:]


def test_stamps_that_jump_are_repaired_and_said_by_import_info_and_identify(tmp_path, source, capsys):
    foreign, count = write_standard(source, tmp_path / 'foreign'), 0
    count = len(list(read_messages(foreign)))
    late = damaged(foreign, tmp_path / 'jump', lambda i, m: stamped_ahead(m, 3600 if i < count // 2 else 0))
    mapping = mapping_file(tmp_path)
    convert_bag(foreign, tmp_path / 'as_it_was', read_mapping(mapping))
    found = convert_bag(late, tmp_path / 'imported', read_mapping(mapping))['axis']
    assert sum('jumps 1 times' in remark for remark in found.remarks) >= 3
    for kind, records in signals(tmp_path / 'imported').items():
        stamps = [record.stamp for record in records]
        whole = [record.stamp for record in signals(tmp_path / 'as_it_was')[kind]]
        assert [b - a for a, b in pairwise(stamps)] == pytest.approx([b - a for a, b in pairwise(whole)], abs=2e6)
    assert main(['info', str(late), '--json']) == 0
    told = json.loads(capsys.readouterr().out)['stamps']
    assert {found['jumps of the stamp'] for found in told.values()} == {1}
    assert main(['info', str(foreign), '--json']) == 0
    assert json.loads(capsys.readouterr().out)['stamps'] == {}


def test_a_short_message_is_left_out_and_counted(tmp_path, source, capsys):
    foreign = write_standard(source, tmp_path / 'foreign')
    place = [number for number, message in enumerate(read_messages(foreign)) if message.topic == '/p_a'][100]
    short = damaged(foreign, tmp_path / 'short', lambda number, m: m.data[:7] if number == place else m.data)
    found = convert_bag(short, tmp_path / 'imported', read_mapping(mapping_file(tmp_path)))['axis']
    (remark,) = found.remarks
    assert remark.startswith('/p_a: ')
    assert remark.endswith('(1 messages)')
    assert found.messages['/rod_velocity'] == 1000
    assert main(['info', str(short), '--json']) == 0
    assert json.loads(capsys.readouterr().out)['stamps']['/p_a']['messages not of their type'] == 1


def test_the_tracking_error_is_that_of_positions_and_references_of_the_same_time(tmp_path, source):
    given = signals(source)
    pairs = zip(
        given['seal_friction_msgs/msg/ServoReference'], given['seal_friction_msgs/msg/RodPosition'], strict=True
    )
    expected = math.sqrt(fmean((wanted.position - measured.position) ** 2 for wanted, measured in pairs))
    found = convert_bag(
        write_standard(source, tmp_path / 'foreign'), tmp_path / 'imported', read_mapping(mapping_file(tmp_path))
    )
    assert found['axis'].tracking_rms == pytest.approx(expected, rel=1e-3)


def test_a_recording_that_hears_its_pressures_last_begins_with_the_first_one(tmp_path, source):
    late = tmp_path / 'late'
    with BagWriter(late) as writer:
        messages = list(read_messages(write_standard(source, tmp_path / 'foreign')))
        for message in messages[: len(messages) // 10]:
            if message.topic != '/p_a':
                writer.write(*message)
        for message in messages[len(messages) // 10 :]:
            writer.write(*message)
    counts = convert_bag(late, tmp_path / 'imported', read_mapping(mapping_file(tmp_path)))['axis'].messages
    assert counts['/rod_velocity'] == 900
    kinds = [message.topic for message in read_messages(tmp_path / 'imported')]
    assert kinds.index('/cylinder_pressure') < kinds.index('/rod_velocity')


def test_a_topic_of_no_actuator_is_copied_on_request_and_an_absent_one_is_refused(tmp_path, source):
    foreign = write_standard(source, tmp_path / 'foreign')
    mapping = mapping_file(tmp_path)
    convert_bag(foreign, tmp_path / 'imported', read_mapping(mapping), ('/set',))
    copied, given = (
        [bytes(message.data) for message in read_messages(bag) if message.topic == '/set']
        for bag in (tmp_path / 'imported', foreign)
    )
    assert copied == given != []
    with pytest.raises(ValueError, match='/command is not in it'):
        convert_bag(foreign, tmp_path / 'again', read_mapping(mapping), ('/command',))
    assert not (tmp_path / 'again').exists()


def test_several_actuators_get_a_bag_each(tmp_path, source):
    foreign = write_standard(source, tmp_path / 'foreign')
    mapping = mapping_file(tmp_path)
    text = MAPPING + MAPPING.partition('actuators:\n')[2].replace('  axis:', '  twin:')
    (tmp_path / 'robot.yaml').write_text(text)
    found = convert_bag(foreign, tmp_path / 'imported', read_mapping(mapping))
    assert [one.bag for one in found.values()] == [tmp_path / 'imported' / 'axis', tmp_path / 'imported' / 'twin']
    assert signals(found['axis'].bag) == signals(found['twin'].bag)
