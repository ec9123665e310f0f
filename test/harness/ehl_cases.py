"""Small cases of the lubricated contact, and a bag of a rod on the motion of the paper."""

import json
from pathlib import Path

import numpy as np
import pytest
from paths import ROOT

from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.layouts import FORCE_TYPE, POSITION_TYPE, PRESSURE_TYPE, VELOCITY_TYPE
from seal_friction_ros.core.messages.records import Force, Position, Pressure, Velocity
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.commands.main import main
from seal_friction_studies.core.kinematics import ConstantAcceleration
from seal_friction_studies.core.measuring_chain import MeasuringChain, transducer_force

SMALL = """name: small
motion: {cycles: 1}
numerics: {cells: 48, time_step: 2.0e-3}
study: {solid_shear_stresses: [1.0e+6, 2.0e+6]}
map: {velocity_min: 1.0e-3, velocity_max: 1.0e-1, velocities: 3, pressure_max: 1.0e+5, pressures: 2}
unknown: {seal.solid_shear_stress: {factor: 2.0}}
"""


@pytest.fixture
def small(tmp_path: Path) -> str:
    path = tmp_path / 'small.yaml'
    path.write_text(SMALL)
    return str(path)


COARSE_RING = """name: ring
oring: coarse
numerics: {cells: 48}
topography: {rms_height: 1.0e-6, rms_slope: 0.3, filling: true}
map: {velocity_min: 1.0e-3, velocity_max: 1.0e-1, velocities: 3, pressure_max: 1.0e+6, pressures: 2}
"""


@pytest.fixture
def ring(tmp_path: Path) -> Path:
    drawing = (ROOT / 'config' / 'oring' / 'ms28775_114_blind.yaml').read_text()
    (tmp_path / 'coarse.yaml').write_text(drawing + 'numerics: {lines: 13}\n')
    path = tmp_path / 'ring.yaml'
    path.write_text(COARSE_RING)
    return path


def answer(capsys, *arguments: str) -> dict:
    assert main(['ehl', *arguments, '--json', '--jobs', '1']) == 0
    return json.loads(capsys.readouterr().out)


def measured_bag(folder: Path, with_position: bool, seal: Path | None = None) -> Path:
    """A rod on the motion of the paper, with estimates; its force is a square wave about an offset that rings."""
    motion, step = ConstantAcceleration(cycles=3), 1e-3
    times = np.arange(round(motion.duration / step)) * step
    way = np.array([motion.position(t + step) - motion.position(t - step) for t in times])
    rung = transducer_force(MeasuringChain(natural_frequency=157.0), times, 0.8 * np.sign(way))
    raw = folder / 'raw'
    with b.BagWriter(raw) as writer:
        for i, time in enumerate(times):
            stamp = 1_000_000_000 + i * 1_000_000
            velocity = way[i] / (2.0 * step) if i else 0.0
            pressure = Pressure(stamp, 0.5e5, 0.0)
            writer.write(b.PRESSURE_TOPIC, PRESSURE_TYPE, stamp, encode(pressure, b'rod'))
            force = Force(stamp, 3.0 + float(rung[i]))
            writer.write(b.FORCE_TOPIC, FORCE_TYPE, stamp, encode(force, b'rod'))
            if with_position:
                position = Position(stamp, 0.1 + motion.position(time))
                writer.write(b.POSITION_TOPIC, POSITION_TYPE, stamp, encode(position, b'rod'))
            data = encode(Velocity(stamp, velocity, b'rod'))
            writer.write(b.VELOCITY_TOPIC, VELOCITY_TYPE, stamp, data)
    seal = seal or ROOT / 'config' / 'seals' / 'ms28775_114.yaml'
    assert main(['replay', str(raw), '--seal', str(seal), '--out', str(folder / 'bag')]) == 0
    return folder / 'bag'
