"""``identify`` writes the temperature part of a seal file from logs with a temperature, and from no others."""

import json
import math

import numpy as np
import pytest

from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.temperature import std_of_unknown
from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, TEMPERATURE_TYPE
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags.actuator_bag import find_topics
from seal_friction_ros.offline.bags.bag import BagWriter, read_messages
from seal_friction_ros.offline.bags.import_log import convert_log, read_samples
from seal_friction_ros.offline.bags.rig_file import read_rig
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay.compiled_replay import replay_in_bulk
from seal_friction_ros.offline.replay.replay import chosen_configuration, replay

RIG = """
name: chamber
header: row
start: 1.0
time: {column_name: time, unit: s}
chamber_a: {terms: [{column_name: pressure, unit: bar}]}
chamber_b: {constant: 0.0}
force_sum: {terms: [{column_name: force, unit: N}]}
velocity: {terms: [{column_name: velocity, unit: m/s}]}
"""
COLUMN = 'temperature: {column_name: temperature, unit: degC}\n'
COEFFICIENT = 0.01  # [1/K]
CELSIUS = (15.0, 40.0, 25.0, 55.0, 30.0)


def write_log(path, celsius, seed):
    """Strokes of 1 s to and fro, 8 at each of 1, 3, 5, 7 bar."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 32.0, 0.01)
    stroke = time.astype(int)
    into = time - stroke
    pressure = 1.0 + 2.0 * (stroke // 8)
    side = np.where(stroke % 2 == 0, 1.0, -1.0)
    velocity = 0.02 * side * np.clip(np.minimum(into, 1.0 - into) / 0.1, 0.0, 1.0)
    friction = (4.0 + 2.0 * pressure) * math.exp(-COEFFICIENT * (celsius - 30.0)) * math.exp(0.01 * rng.normal())
    force = side * friction + 1.0 + 0.05 * rng.normal(size=len(time))
    table = np.column_stack((time, pressure, force, velocity, np.full(len(time), celsius)))
    np.savetxt(path, table, fmt='%.9g', delimiter=',', header='time,pressure,force,velocity,temperature', comments='')


@pytest.fixture(scope='module')
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp('chamber')
    for seed, celsius in enumerate(CELSIUS):
        write_log(folder / f'{celsius:.0f}.csv', celsius, seed)
    (folder / 'with.yaml').write_text(RIG + COLUMN)
    (folder / 'without.yaml').write_text(RIG)
    return folder


def identified(logs, rig, out, capsys):
    names = [str(logs / f'{celsius:.0f}.csv') for celsius in CELSIUS]
    assert main(['identify', *names, '--rig', str(logs / rig), '--json', '--out', str(out)]) == 0
    return read_yaml(out), json.loads(capsys.readouterr().out)


def test_the_seal_file_has_the_coefficient_the_reference_and_the_law_there(logs, tmp_path, capsys):
    document, numbers = identified(logs, 'with.yaml', tmp_path / 'seal.yaml', capsys)
    part = document['temperature']
    assert part['coefficient'] == pytest.approx(COEFFICIENT, abs=3.0 * part['coefficient_std'])
    assert part['coefficient_std'] < 0.001
    assert [part[name] for name in ('lowest', 'reference', 'highest')] == pytest.approx([288.15, 303.15, 328.15])
    law = parse_seal(document).coulomb_law
    assert law.coulomb_friction(5e5) == pytest.approx(14.0, rel=0.03)
    assert any('per kelvin' in remark for remark in numbers['remarks'])


def test_without_the_column_nothing_is_said_of_temperature_and_the_law_is_less_sure(logs, tmp_path, capsys):
    known, _ = identified(logs, 'with.yaml', tmp_path / 'with.yaml', capsys)
    document, numbers = identified(logs, 'without.yaml', tmp_path / 'without.yaml', capsys)
    assert 'temperature' not in document
    assert numbers['temperature'] is None
    assert document['uncertainty']['relative_std'] > 1.5 * known['uncertainty']['relative_std']


def test_a_node_that_knows_no_temperature_is_as_unsure_as_the_temperatures_make_it(logs, tmp_path, capsys):
    document, _ = identified(logs, 'with.yaml', tmp_path / 'seal.yaml', capsys)
    seal = parse_seal(document)
    assert std_of_unknown(seal.temperature) == pytest.approx(COEFFICIENT * 40.0 / math.sqrt(12.0), rel=0.05)


def test_a_column_in_celsius_is_read_in_kelvin_and_a_pressure_is_no_temperature(logs, tmp_path):
    read = read_samples(logs / '25.csv', read_rig(logs / 'with.yaml'))
    assert read.track.temperature[0] == pytest.approx(298.15)
    assert read_samples(logs / '25.csv', read_rig(logs / 'without.yaml')).track.temperature is None
    wrong = tmp_path / 'wrong.yaml'
    wrong.write_text(RIG + 'temperature: {column_name: pressure, unit: bar}\n')
    with pytest.raises(ValueError, match='is not a temperature: use one of K, degC'):
        read_rig(wrong)


@pytest.mark.long  # five bags
def test_the_column_goes_into_the_bag_and_identify_finds_the_same_coefficient_there(logs, tmp_path, capsys):
    from_logs, _ = identified(logs, 'with.yaml', tmp_path / 'logs.yaml', capsys)
    names = [f'{celsius:.0f}' for celsius in CELSIUS]
    for name in names:
        convert_log(logs / f'{name}.csv', tmp_path / name, read_rig(logs / 'with.yaml'))
    bags = [str(tmp_path / name) for name in names]
    assert main(['identify', *bags, '--seal-chambers', 'a', '--out', str(tmp_path / 'bags.yaml')]) == 0
    capsys.readouterr()
    part, expected = read_yaml(tmp_path / 'bags.yaml')['temperature'], from_logs['temperature']
    for name in ('coefficient', 'reference', 'lowest', 'highest'):
        assert part[name] == pytest.approx(expected[name], rel=0.02)


@pytest.mark.long
def test_a_bag_with_a_seal_file_of_that_kind_replays_at_its_temperature(logs, tmp_path, capsys):
    identified(logs, 'with.yaml', tmp_path / 'seal.yaml', capsys)
    friction = {}
    for name in ('15', '55'):
        convert_log(logs / f'{name}.csv', tmp_path / name, read_rig(logs / 'with.yaml'))
        override = chosen_configuration(None, tmp_path / 'seal.yaml')
        replay(tmp_path / name, override, tmp_path / f'{name}_replayed')
        estimates = [
            decode(ESTIMATE_TYPE, message.data)
            for message in read_messages(tmp_path / f'{name}_replayed')
            if message.type_name == ESTIMATE_TYPE
        ]
        missing = [bool(estimate.status & Status.TEMPERATURE_MISSING) for estimate in estimates]
        assert missing == [True, True] + [False] * (len(estimates) - 2)  # until there are three readings
        friction[name] = estimates[-1].coulomb_friction
        assert replay(tmp_path / f'{name}_replayed').identical
        assert verdict(tmp_path / f'{name}_replayed').identical
    assert friction['15'] / friction['55'] == pytest.approx(math.exp(40.0 * COEFFICIENT), rel=0.03)


def verdict(bag):
    """Compiled replay of a bag."""
    found = replay_in_bulk(bag, find_topics(bag), None, lambda _: None)
    assert found is not None
    return found


def test_of_several_topics_of_the_type_that_with_the_name_is_meant(logs, tmp_path):
    convert_log(logs / '25.csv', tmp_path / 'one', read_rig(logs / 'with.yaml'))
    messages = list(read_messages(tmp_path / 'one'))
    with BagWriter(tmp_path / 'two') as writer, BagWriter(tmp_path / 'foreign') as foreign:
        for message in messages:
            writer.write(*message)
            if message.type_name == TEMPERATURE_TYPE:
                writer.write(*message._replace(topic='/motor'))
                foreign.write(*message._replace(topic='/motor'))
                foreign.write(*message._replace(topic='/battery'))
            else:
                foreign.write(*message)
    assert find_topics(tmp_path / 'two').temperature == '/seal_temperature'
    assert find_topics(tmp_path / 'foreign').temperature == ''
