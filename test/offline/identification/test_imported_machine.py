"""From standard messages of a boom without load cell to its friction: another plant, rounded and noisy signals."""

import numpy as np
import pytest
from harness import boom
from harness.boom import AREA_A, AREA_B, Boom
from harness.foreign_messages import foreign_store
from harness.identify_run import Run
from rosbags.rosbag2 import StoragePlugin, Writer

from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.offline.bags.import_bag import convert_bag
from seal_friction_ros.offline.bags.mapped_bag import read_mapping
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.commands.main import main

JOINT_STATE, ARRAY = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'
START = 1_700_000_000_000_000_000  # [ns]
MAPPING = f"""\
name: boom
topics: {{/joint_states: sensor_msgs/msg/JointState, /pressures: std_msgs/msg/Float64MultiArray}}
actuators:
  boom:
    seals: [placeholder@a, placeholder@b]
    area_a: {AREA_A}
    area_b: {AREA_B}
    inputs:
      position: /joint_states position[boom]
      velocity: /joint_states velocity[boom]
      pressure_a: {{topic: /pressures, field: 'data[0]', unit: bar, absolute: true}}
      pressure_b: {{topic: /pressures, field: 'data[1]', unit: bar, absolute: true}}
    force_sum: {{pressures: true}}
"""
WITHOUT_VELOCITY = MAPPING.replace('      velocity: /joint_states velocity[boom]\n', '').replace(
    '    force_sum:', '    velocity_from_position: {step: 50 um, rate: 100 Hz}\n    force_sum:'
)


def write_boom(path, log):
    """The log of a boom as standard messages."""
    store = foreign_store()
    types = store.types
    layout = types['std_msgs/msg/MultiArrayLayout']([], 0)
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        joints = writer.add_connection('/joint_states', JOINT_STATE, typestore=store)
        pressures = writer.add_connection('/pressures', ARRAY, typestore=store)
        for time, position, velocity, p_a, p_b in zip(*log, strict=True):
            now = START + round(time * 1e9)
            absolute = np.array([p_a + 101_325.0, p_b + 101_325.0]) / 1e5
            writer.write(pressures, now, bytes(store.serialize_cdr(types[ARRAY](layout, absolute), ARRAY)))
            header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](*divmod(now, 10**9)), '')
            columns = (np.array([value]) for value in (position, velocity))
            state = types[JOINT_STATE](header, ['boom'], *columns, np.array([]))
            writer.write(joints, now, bytes(store.serialize_cdr(state, JOINT_STATE)))
    return path


@pytest.mark.parametrize(
    'mapping', [pytest.param(MAPPING, marks=pytest.mark.long), WITHOUT_VELOCITY], ids=['velocity', 'position']
)
def test_friction_and_load_are_those_of_the_machine(tmp_path, mapping):
    simulated = boom.simulate(Boom(), 'sines')
    foreign = write_boom(tmp_path / 'foreign', boom.measured(simulated, 0))
    (tmp_path / 'robot.yaml').write_text(mapping)
    convert_bag(foreign, tmp_path / 'boom', read_mapping(str(tmp_path / 'robot.yaml')))
    run = Run(tmp_path, str(tmp_path / 'boom'))
    assert run.code == 0, run.errors
    true = np.abs(simulated.friction[np.abs(simulated.velocity) > 5e-3]).mean()
    assert np.mean(run.figures['fitted_N']) == pytest.approx(true, rel=0.05)
    load = run.figures['load']
    truth = Boom().load(np.array(load['position_m']))
    assert np.sqrt(np.mean((np.array(load['force_N']) - truth) ** 2)) < 0.02 * truth.mean()


def test_at_rest_the_unknown_load_is_flagged_and_never_called_friction(tmp_path):
    foreign = write_boom(tmp_path / 'foreign', boom.measured(boom.simulate(Boom(), 'single'), 0))
    (tmp_path / 'robot.yaml').write_text(MAPPING)
    convert_bag(foreign, tmp_path / 'boom', read_mapping(str(tmp_path / 'robot.yaml')))
    assert main(['replay', str(tmp_path / 'boom'), '--out', str(tmp_path / 'replayed')]) == 0
    run = read_run(tmp_path / 'replayed')
    rest = run.direction == 0
    assert rest.sum() > 50
    assert np.all(run.friction_force[rest] == 0.0)
    assert np.all(run.status[rest] != 0)
    assert np.any(run.status[rest] & int(Status.FORCE_CONTAINS_LOAD))
