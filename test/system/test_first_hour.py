"""Two machines with standard messages, from raw topics to a feed-forward that makes them track, by files and commands.

The test bench runs the page `docs/first_hour.md` as it stands. The pneumatic axis has no force sensor and no velocity.
"""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
from harness.pages import Terminals, blocks_of
from paths import ROOT
from test_docs import link_tree

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.friction.actuator import ActuatorFriction, actuator_friction
from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.core.messages.records import Position, ServoReference
from seal_friction_ros.files import config_path, load_configuration, machine_configurations, read_machine, read_yaml
from seal_friction_ros.offline.bags.bag import read_messages
from seal_friction_ros.offline.replay.replay import replay

PAGE = ROOT / 'docs' / 'first_hour.md'
STROKES_SECONDS, SINE_SECONDS = 10.0, 3.5  # shorter than on the page
CLOSED_LOOP_PACE = 0.25  # [-] slower: on a busy machine the feed-forward comes in time, too
MOST_LINES = 25  # of a mapping file
LARGEST_SHARE = 0.4  # of the tracking error that may be left

SPRINGS = (
    ('weak', '6.0e+6', '8.0e+4', '0.06'),
    ('strong', '1.8e+7', '8.0e+4', '0.06'),
    ('pushing', '1.8e+7', '1.0e+5', '0.0'),
    ('pulling', '1.8e+7', '6.0e+4', '0.14'),
)
"""Recording, supply pressure [Pa], stiffness of the load spring [N/m] and where it is slack [m]."""

PNEUMATIC = """name: pneumatic
topics:
  /joint_states: sensor_msgs/msg/JointState
  /joint_reference: sensor_msgs/msg/JointState
  /pressure_a: sensor_msgs/msg/FluidPressure
  /pressure_b: sensor_msgs/msg/FluidPressure
actuators:
  axis:
    seals: [placeholder@a, placeholder@b]
    bore: 32 mm
    rod: 12 mm
    inputs:
      position: /joint_states position[rod]
      pressure_a: /pressure_a
      pressure_b: /pressure_b
      reference_position: /joint_reference position[rod]
      reference_velocity: /joint_reference velocity[rod]
    velocity_from_position: {step: 10 um, rate: 500 Hz, noise: 1 mm/s}
    force_sum: {pressures: true, load: none}
    output: {topic: /effort_commands, type: std_msgs/msg/Float64MultiArray}
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """The tree as a reader has it, in a folder of its own."""
    link_tree(tmp_path)
    (tmp_path / 'build').mkdir()
    return tmp_path


def tracking_error(bag: Path) -> float:
    """RMS of measured minus wanted position [m] of a typical second, which is a whole number of periods.

    The first seconds have the fade-in, and a busy machine may stall in one of them.
    """
    found: dict[type, list[tuple[float, float]]] = {ServoReference: [], Position: []}
    for message in read_messages(bag):
        if message.topic in ('/servo_reference', '/rod_position'):
            record = decode(message.type_name, message.data)
            found[type(record)].append((record.stamp * 1e-9, record.position))
    wanted, measured = (np.array(found[kind]) for kind in (ServoReference, Position))
    error = measured[:, 1] - np.interp(measured[:, 0], wanted[:, 0], wanted[:, 1])
    second = np.floor(measured[:, 0] - measured[0, 0])
    return float(np.median([np.sqrt(np.mean(error[second == k] ** 2)) for k in range(int(second[-1]))]))


def friction_of(selection: SealSelection, a: float, b: float) -> ActuatorFriction:
    """Friction of seals at two chamber pressures [Pa] and 50 mm/s."""
    seals = load_configuration(selection, EstimatorSettings()).parameters().estimator.seals
    return actuator_friction(seals, a, b, 0.05)


def share_left(folder: Path, terminals: Terminals) -> float:
    """Share of the tracking error that is left, after a check that the mapping is short and recordings replay."""
    lines = (folder / 'build' / 'robot.yaml').read_text().splitlines()
    assert len([line for line in lines if not line.startswith('#')]) <= MOST_LINES
    for bag in ('without', 'with'):
        command = f'import bag build/{bag} --mapping build/robot.yaml --out build/run_{bag}'
        terminals.run(f'.venv/bin/seal_friction {command}')
    without, compensated = (tracking_error(folder / 'build' / f'run_{bag}') for bag in ('without', 'with'))
    for bag in ('without', 'with'):
        result = replay(folder / 'build' / bag)
        assert result.identical, result.first_difference
        assert result.recorded_feedforwards > 500
    return compensated / without


def test_the_mapping_file_of_the_page_finds_the_seal_file_that_identify_writes(tmp_path: Path):
    text = PAGE.read_text()
    (out,) = re.findall(r'seal_friction identify .* --out (\S+)', text)
    (named,) = re.findall(r'^sed -i .*', text, re.MULTILINE)
    seal, robot = read_yaml(config_path('seals', 'ms28775_114')), tmp_path / 'build' / 'robot.yaml'
    robot.parent.mkdir()
    robot.write_text(next(block.text for block in blocks_of(PAGE) if block.kind == 'robot'))
    (tmp_path / out).write_text(yaml.safe_dump(seal | {'mounting': {'chambers': ['b', 'b', 'difference']}}))
    subprocess.run(['bash', '-c', named], cwd=tmp_path, check=True)
    (found,) = machine_configurations(read_machine(str(robot)), 'robot.yaml').values()
    assert [one['name'] for one in found.seal_documents] == [seal['name']] * 3


@pytest.mark.long
def test_the_test_bench_tracks_after_the_first_hour(checkout: Path):
    terminals = Terminals(checkout)
    try:
        for language, kind, text in blocks_of(PAGE):
            if language == 'yaml':
                made = read_machine(str(checkout / 'build' / 'robot.yaml'))  # by `new robot`: it loads as it is
                assert [actuator.name for actuator in made.actuators] == ['boom']
                written = yaml.safe_load(text)
                found = yaml.safe_load((checkout / 'build' / 'robot.yaml').read_text())
                assert found['topics'] == written['topics']
                assert found['actuators']['boom']['inputs'] == written['actuators']['boom']['inputs']
                (checkout / 'build' / 'robot.yaml').write_text(text)
            elif kind == 'machine':
                machine = text.strip()
                terminals.start_machine(machine)
            elif kind == 'node':
                name = text.strip().rpartition('record_name:=')[2]
                if name == 'with':
                    terminals.start_machine(machine, CLOSED_LOOP_PACE)
                terminals.run_node(text.strip(), STROKES_SECONDS if name == 'strokes' else SINE_SECONDS)
            else:
                for command in text.splitlines():
                    terminals.run(command)
    finally:
        terminals.stop_machine()
    assert share_left(checkout, terminals) < LARGEST_SHARE


@pytest.mark.long  # the bench above holds the same chain of files and commands
def test_a_pneumatic_axis_without_force_sensor_and_velocity_tracks(checkout: Path):
    (checkout / 'build' / 'robot.yaml').write_text(PNEUMATIC)
    plant = '.venv/bin/servo_simulator --ros-args --params-file config/simulated_machines/pneumatic_axis.yaml'
    strokes = '-p wave:=trapezoid -p trapezoid.distance:=0.08 -p trapezoid.speed:=0.05 -p trapezoid.frequency:=0.2'
    node = '.venv/bin/machine_estimator --ros-args -p machine:=build/robot.yaml -p record:=true'
    off = '-p axis.feedforward.scale:=0.0 -p record_directory:=build'
    tool = '.venv/bin/seal_friction'
    terminals = Terminals(checkout)
    try:
        terminals.start_machine(f'{plant} {strokes} -p trapezoid.acceleration:=0.5')
        terminals.run_node(f'{node} {off} -p record_name:=strokes', 16.0)
        terminals.run(f'{tool} identify build/strokes --seal-chambers a,b --out build/seal.yaml')
        terminals.run("sed -i 's|seals: .*|seals: [seal.yaml]|' build/robot.yaml")
        terminals.start_machine(plant)
        terminals.run_node(f'{node} {off} -p record_name:=without', SINE_SECONDS)
        terminals.run(f'{tool} tune --bag build/without --out build/feedforward.yaml')
        terminals.start_machine(plant, CLOSED_LOOP_PACE)
        terminals.run_node(
            f'{node} -p record_directory:=build --params-file build/feedforward.yaml -p record_name:=with', SINE_SECONDS
        )
    finally:
        terminals.stop_machine()
    assert share_left(checkout, terminals) < LARGEST_SHARE


@pytest.mark.long  # five recordings
def test_a_bench_with_rod_and_piston_seals_of_different_kinds_tracks(checkout: Path):
    (checkout / 'build' / 'robot.yaml').write_text(
        next(block.text for block in blocks_of(PAGE) if block.kind == 'robot')
    )
    plant = (
        '.venv/bin/servo_simulator --ros-args --params-file config/simulated_machines/single_rod_cylinder.yaml '
        '--params-file config/programs/strokes_against_spring.yaml '
        '-p seals:=[ms28775_114@b,ms28775_114@b,delft_o_ring@difference]'
    )
    sine = '-p wave:=sine -p load.spring_stiffness:=0.0'
    node = (
        '.venv/bin/machine_estimator --ros-args -p machine:=build/robot.yaml -p record:=true -p record_directory:=build'
    )
    off, tool = '-p boom.feedforward.scale:=0.0', '.venv/bin/seal_friction'
    terminals = Terminals(checkout)
    try:
        for name, supply, stiffness, position in SPRINGS:
            spring = f'-p load.spring_stiffness:={stiffness} -p load.spring_position:={position}'
            terminals.start_machine(f'{plant} {spring} -p valve.supply_pressure:={supply}')
            terminals.run_node(f'{node} {off} -p record_name:={name}', 14.0)
        runs = ' '.join(f'build/{name}' for name, *_ in SPRINGS)
        kinds = '--seal-kind rod=b,b --seal-kind piston=difference --largest-kind-error 0.5'
        terminals.run(f'{tool} identify {runs} {kinds} --out build/seal.yaml')
        assert 'cannot be divided between rod and piston' in terminals.said[-1]
        assert 'use the seal files together' in terminals.said[-1]
        terminals.run("sed -i 's|seals: .*|seals: [seal_rod.yaml, seal_piston.yaml]|' build/robot.yaml")
        terminals.start_machine(f'{plant} {sine}')
        terminals.run_node(f'{node} {off} -p record_name:=without', SINE_SECONDS)
        terminals.run(f'{tool} tune --bag build/without --out build/feedforward.yaml')
        terminals.start_machine(f'{plant} {sine}', CLOSED_LOOP_PACE)
        terminals.run_node(f'{node} --params-file build/feedforward.yaml -p record_name:=with', SINE_SECONDS)
    finally:
        terminals.stop_machine()
    assert share_left(checkout, terminals) < LARGEST_SHARE
    bench = {'seals': ('ms28775_114', 'ms28775_114', 'delft_o_ring'), 'seal_chambers': ('b', 'b', 'difference')}
    files = {'seals': tuple(str(checkout / 'build' / f'seal_{kind}.yaml') for kind in ('rod', 'piston'))}
    for a, b in ((3e6, 6e6), (8e6, 4e6), (12e6, 12e6)):  # [Pa]
        truth, found = (friction_of(SealSelection(**chosen), a, b) for chosen in (bench, files))
        assert found.coulomb_friction == pytest.approx(truth.coulomb_friction, rel=0.1)
        assert abs(found.coulomb_friction - truth.coulomb_friction) < found.coulomb_friction_std
