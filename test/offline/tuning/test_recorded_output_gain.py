"""The gain from force to command from a bag: the command as one number or as an array, and bags that cannot tell."""

import json
import struct
from pathlib import Path

import pytest
import yaml
from harness.compensation import compensating

from seal_friction_ros.core.estimation.configuration import first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.messages.coder import encode, encode_text
from seal_friction_ros.core.messages.layouts import (
    CONFIGURATION_TYPE,
    FORCE_TYPE,
    NUMBER_TYPE,
    NUMBERS_TYPE,
    POSITION_TYPE,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    TEMPERATURE_TYPE,
    VELOCITY_TYPE,
)
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.core.servo import position_servo as servo
from seal_friction_ros.core.servo.motions import Setpoint, Sine
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.commands.main import main

CONFIGURATION = compensating()
PLANT = servo.ServoParameters(seals=CONFIGURATION.parameters().estimator.seals, control_period=1e-3)
ENCODERS = {
    NUMBER_TYPE: lambda value: struct.pack('<4xd', value).replace(b'\0\0\0\0', b'\0\1\0\0', 1),
    NUMBERS_TYPE: lambda value: b'\0\1\0\0' + struct.pack('<IIIId', 0, 0, 1, 0, value),
}


def write_axis(path: Path, type_name: str, moves: bool = True, last: tuple[str, str, bytes] | None = None) -> Path:
    """Bag of a servo that takes positions only, on /command, and has no other reference in its loop."""
    wave = Sine(0.002, 0.5)
    state = servo.init(PLANT)
    out = servo.outputs(PLANT, state.plant)
    with b.BagWriter(path) as writer:
        text = snapshot_text(first_snapshot(CONFIGURATION))
        writer.write(b.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, 0, encode_text(text))
        for i in range(6000):
            stamp, reference = i * 1_000_000, wave.at(i * 1e-3)
            command = reference.position if moves else 1e-4
            for topic, kind, data in (
                ('/command', type_name, ENCODERS[type_name](command)),
                (b.PRESSURE_TOPIC, PRESSURE_TYPE, encode(Pressure(stamp, out.pressure_a, out.pressure_b))),
                (b.FORCE_TOPIC, FORCE_TYPE, encode(Force(stamp, out.force_sum))),
                (b.REFERENCE_TOPIC, REFERENCE_TYPE, encode(ServoReference(stamp, *reference))),
                (b.POSITION_TOPIC, POSITION_TYPE, encode(Position(stamp, out.position))),
                (b.VELOCITY_TOPIC, VELOCITY_TYPE, encode(Velocity(stamp, out.velocity, b'rod'))),
            ):
                writer.write(topic, kind, stamp, data)
            state, out = servo.step(PLANT, state, Setpoint(reference.position, 0.0, 0.0))
        if last:
            topic, kind, data = last
            writer.write(topic, kind, 6000_000_000, data)
    return path


AREAS = ['--area-a', str(PLANT.cylinder.area_a), '--area-b', str(PLANT.cylinder.area_b)]


@pytest.mark.parametrize('type_name', [NUMBER_TYPE, NUMBERS_TYPE])
def test_tune_says_the_gain_of_the_recorded_command(type_name, tmp_path, capsys):
    bag, out = write_axis(tmp_path / 'bag', type_name), tmp_path / 'f.yaml'
    arguments = ['tune', '--bag', str(bag), '--out', str(out), '--command-topic', '/command', *AREAS, '--json']
    assert main(arguments) in (0, 1)
    numbers = json.loads(capsys.readouterr().out)
    assert numbers['output_gain'] == pytest.approx(1.0 / PLANT.controller.position_gain, rel=0.1)
    assert 0.0 < numbers['output_gain_standard_error'] < 0.1 * numbers['output_gain']


def test_tune_prints_the_line_of_the_mapping_file_and_writes_for_an_actuator_of_a_machine(tmp_path, capsys):
    bag, out = write_axis(tmp_path / 'bag', NUMBER_TYPE), tmp_path / 'f.yaml'
    arguments = ['--command-topic', '/command', *AREAS, '--actuator', 'boom']
    assert main(['tune', '--bag', str(bag), '--out', str(out), *arguments]) in (0, 1)
    (line,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith('gain: '))
    assert yaml.safe_load(line)['gain'] == pytest.approx(1.0 / PLANT.controller.position_gain, rel=0.1)
    parameters = yaml.safe_load(out.read_text())['/**/machine_estimator']['ros__parameters']
    assert set(parameters) == {'boom.feedforward'}
    assert parameters['boom.feedforward'].keys() == meanings(FeedForwardSettings).keys()


@pytest.mark.parametrize(
    ('options', 'reason'),
    [
        (['--command-topic', '/command'], '--area-a'),
        (['--command-topic', '/elsewhere', *AREAS], 'is not in it'),
        (['--command-topic', '/command', *AREAS], 'the command does not change'),
    ],
)
def test_bag_that_cannot_tell_the_gain_is_rejected_and_nothing_is_written(options, reason, tmp_path, capsys):
    bag, out = write_axis(tmp_path / 'bag', NUMBER_TYPE, moves=False), tmp_path / 'f.yaml'
    assert main(['tune', '--bag', str(bag), '--out', str(out), *options]) == 2
    assert reason in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    'data', [b'\0', b'\0\1\0\0', b'\0\0\0\0' + bytes(8), b'\0\1\0\0' + struct.pack('<III', 0, 0, 0)]
)
def test_malformed_command_is_an_error(data, tmp_path, capsys):
    bag = write_axis(tmp_path / 'bag', NUMBERS_TYPE, last=('/command', NUMBERS_TYPE, data))
    options = ['--command-topic', '/command', *AREAS]
    assert main(['tune', '--bag', str(bag), '--out', str(tmp_path / 'f.yaml'), *options]) == 2
    assert 'message on /command at 6000000000 ns: ' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('topic', 'type_name'),
    [
        (b.FORCE_TOPIC, FORCE_TYPE),
        (b.TEMPERATURE_TOPIC, TEMPERATURE_TYPE),
        (b.CONFIGURATION_TOPIC, CONFIGURATION_TYPE),
    ],
)
def test_a_malformed_input_that_the_gain_does_not_need_is_the_same_error_without_a_command(
    topic, type_name, tmp_path, capsys
):
    """The estimates of the tuning are made of this input: no bag gives its gain and no feed-forward."""
    bag = write_axis(tmp_path / 'bag', NUMBER_TYPE, last=(topic, type_name, b'\0'))
    said = []
    for options in ([], ['--command-topic', '/command', *AREAS]):
        assert main(['tune', '--bag', str(bag), '--out', str(tmp_path / 'f.yaml'), *options]) == 2
        said.append(capsys.readouterr().err)
    assert said[0] == said[1]
    assert f'message on {topic} at 6000000000 ns: ' in said[0]
