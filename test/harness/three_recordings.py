"""One axis, recorded by ``friction_estimator``, by ``machine_estimator`` beside two others, and by a stranger."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from paths import ROOT

from harness import example_bags
from harness.machines import installed
from harness.standard_bags import MAPPING, write_standard
from seal_friction_ros.core.estimation.configuration import Configuration, SealSelection, first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.machine.machine import init, make_machine
from seal_friction_ros.core.machine.machine_file import parse_machine
from seal_friction_ros.core.machine.machine_snapshot import machine_text, snapshot_of
from seal_friction_ros.core.messages.coder import encode, encode_text, type_of
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.files import load_configuration, machine_configurations, read_yaml
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.replay.replay import replay

START = 1_700_000_000_000_000_000  # [ns]
PERIOD = 0.02  # [s]
STROKE, RAMP = 1.0, 0.1  # [s]
SPEEDS, PRESSURES = (0.02, 0.05), (1e6, 2e6, 3e6, 4e6)  # [m/s], [Pa]
SAMPLES = round(len(SPEEDS) * len(PRESSURES) * 4 * STROKE / PERIOD)
MASS = 3.0  # [kg]
SEALS = ('ms28775_114@a', 'ms28775_114@b')
NAMES = ('axis', 'weak', 'two_kinds')


def friction(pressure: float) -> float:
    """Friction of the axis [N] at a pressure [Pa]."""
    return 12.0 + 9e-6 * pressure


def samples() -> Iterator[tuple[Any, ...]]:
    """Two strokes out and back at each speed and pressure: what comes in with each sample."""
    position, number, noise = 0.0, 0, np.random.default_rng(3)
    for pressure in PRESSURES:
        for speed in SPEEDS:
            for side in (1.0, -1.0, 1.0, -1.0):
                for into in np.arange(0.0, STROKE, PERIOD):
                    slope = ((into < RAMP) - float(into >= STROKE - RAMP)) * side * speed / RAMP
                    velocity = side * speed * min(into / RAMP, (STROKE - into) / RAMP, 1.0)
                    position += velocity * PERIOD
                    stamp = START + round(number * PERIOD * 1e9)
                    force = np.sign(velocity) * friction(pressure) + MASS * slope + 0.2 * noise.standard_normal()
                    number += 1
                    yield (
                        ServoReference(stamp, position, velocity, slope, b'rod'),
                        Pressure(stamp, pressure, 0.5 * pressure),
                        Force(stamp, float(force)),
                        Position(stamp, position),
                        Velocity(stamp, velocity, b'rod'),
                    )


def mapping(folder: Path, answers: str) -> dict[str, Any]:
    """Mapping file of the axis, of another with half its force, and of one with two kinds of seals and no force sum."""
    document = yaml.safe_load(MAPPING)
    axis = document['actuators']['axis']
    weak = json.loads(json.dumps(axis))
    weak['force_sum']['load_force']['gain'] = -0.5
    piston = {**read_yaml(ROOT / 'config' / 'seals' / 'delft_o_ring.yaml'), 'mounting': {'chambers': ['difference']}}
    (folder / 'piston.yaml').write_text(yaml.safe_dump(piston))
    two_kinds = {**axis, 'seals': ['delft_o_ring', str(folder / 'piston.yaml')]}
    del two_kinds['force_sum']
    return {**document, 'answers': answers, 'actuators': dict(zip(NAMES, (axis, weak, two_kinds), strict=True))}


class Recordings(NamedTuple):
    """Three recordings of the same motion, and the mapping file of the second and the third."""

    own: Path
    machine: Path
    foreign: Path
    mapping: Path

    def arguments(self, kind: str, actuator: str = 'axis') -> tuple[str, list[str]]:
        """Bag and the options that choose the actuator in it."""
        options = {
            'own': [],
            'machine': ['--namespace', actuator],
            'foreign': ['--mapping', str(self.mapping), '--namespace', actuator],
        }
        return str(getattr(self, kind)), options[kind]


def record(folder: Path, answers: str = 'each') -> Recordings:
    """Make all three."""
    document = mapping(folder, answers)
    (folder / 'robot.yaml').write_text(json.dumps(document))
    foreign = write_standard(_inputs(folder / 'inputs'), folder / 'foreign')
    replay(folder / 'inputs', out=folder / 'replayed')
    own = example_bags.rewrite(folder / 'replayed', folder / 'own', lambda _, one: example_bags.as_recorded(one))
    replay(_of_machine(foreign, folder / 'machine_inputs', document), out=folder / 'machine')
    return Recordings(own, folder / 'machine', foreign, folder / 'robot.yaml')


def _configuration() -> Configuration:
    return load_configuration(SealSelection(SEALS), EstimatorSettings())


def _inputs(path: Path) -> Path:
    with b.BagWriter(path) as writer:
        text = encode_text(snapshot_text(first_snapshot(_configuration())))
        writer.write(b.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, START, text)
        for records in samples():
            for one in records:
                kind = type_of(one)
                writer.write(example_bags.TOPICS[kind], kind, one.stamp, encode(one, b'rod'))
    return path


def _of_machine(foreign: Path, path: Path, document: dict[str, Any]) -> Path:
    """The foreign messages as ``machine_estimator`` records them: after its configuration."""
    file = parse_machine(document, 'robot.yaml')
    machine = make_machine(
        file, machine_configurations(file, 'robot.yaml'), {kind: installed(kind) for kind in file.topics.values()}
    )
    with b.BagWriter(path) as writer:
        text = encode_text(machine_text(snapshot_of(machine, init(machine))))
        writer.write('/machine_estimator/configuration', CONFIGURATION_TYPE, START, text)
        for message in b.read_messages(foreign):
            writer.write(*message)
    return path
