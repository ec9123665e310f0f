"""``seal_friction ehl``: numbers, pages and seal files from case files; interrupted work resumes."""

import json
from pathlib import Path

import numpy as np
import pytest
from paths import ROOT

from seal_friction_ros.core.estimation.messages import FORCE_TYPE, POSITION_TYPE, PRESSURE_TYPE, VELOCITY_TYPE, encode
from seal_friction_ros.core.estimation.records import Force, Position, Pressure, Status, Velocity
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.bags.recorded_run import read_run
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


def answer(capsys, *arguments: str) -> dict:
    assert main(['ehl', *arguments, '--json', '--jobs', '1']) == 0
    return json.loads(capsys.readouterr().out)


def test_map_becomes_a_seal_file_that_the_estimator_takes(small, tmp_path, capsys):
    seal_file = tmp_path / 'mapped.yaml'
    work = ('--work', str(tmp_path / 'work'))
    found = answer(capsys, 'map', small, '--seal-file', str(seal_file), *work)
    assert np.array(found['friction_N']).shape == (2, 3)
    assert found['memory_length_m'] > 0.0
    seal = parse_seal(read_yaml(seal_file))
    assert seal.coulomb_law.sliding_friction(0.0, 1e-2) == pytest.approx(found['friction_N'][0][1], rel=1e-5)
    assert seal.coulomb_law.coulomb_friction(1e5) > seal.coulomb_law.coulomb_friction(0.0)
    assert answer(capsys, 'map', small, *work) == found
    assert main(['charts', str(seal_file), '--out', str(tmp_path / 'charts.html')]) == 0


def test_recording_with_a_mapped_seal_replays_to_the_same_bytes_and_rubs_less_the_faster_it_slides(small, tmp_path):
    seal_file = tmp_path / 'mapped.yaml'
    assert main(['ehl', 'map', small, '--seal-file', str(seal_file), '--jobs', '1']) == 0
    bag = measured_bag(tmp_path, with_position=True, seal=seal_file)
    assert main(['replay', str(bag), '--verify']) == 0
    recorded = read_run(bag)
    speed, friction = np.abs(recorded.velocity), np.abs(recorded.friction_force)
    shears = recorded.status & int(Status.PRESLIDING) != 0  # the map tells how far the seal shears before it slides
    assert shears.any()
    sliding = (recorded.state == FrictionState.SLIDING) & ~shears
    slow, fast = sliding & (speed < 15e-3), sliding & (speed > 30e-3)
    assert friction[slow].min() > friction[fast].max()
    assert friction[slow].mean() > 1.1 * friction[fast].mean()  # it follows the speed over a length, by the map
    assert np.ptp(recorded.coulomb_friction) == 0.0  # that of the pressure alone, at the reference speed


def test_map_does_not_overwrite_a_seal_file(small, tmp_path, capsys):
    there = tmp_path / 'there.yaml'
    there.write_text('mine')
    assert main(['ehl', 'map', small, '--seal-file', str(there)]) == 2
    assert 'exists already: not overwriting it' in capsys.readouterr().err
    assert there.read_text() == 'mine'


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


def test_an_o_ring_becomes_a_seal_file_from_its_drawing_that_the_node_takes(ring, tmp_path, capsys):
    written = tmp_path / 'from_drawing.yaml'
    page = tmp_path / 'map.html'
    found = answer(capsys, 'map', str(ring), '--seal-file', str(written), '--out', str(page))
    assert 'oring.geometry.section_diameter' in page.read_text()
    assert 'seal.interference' not in page.read_text()
    table = np.array(found['friction_N'])
    assert (np.diff(table, axis=0) > 0.0).all()
    seal = parse_seal(read_yaml(written))
    assert seal.coulomb_law.sliding_friction(1e6, 1e-3) == pytest.approx(table[1, 0], rel=1e-3)
    assert seal.presliding is not None
    assert main(['charts', str(written), '--out', str(tmp_path / 'charts.html')]) == 0


@pytest.mark.parametrize(
    ('was', 'now', 'message'),
    [
        ('oring: coarse', 'oring: 5', 'oring = 5 is not the name or path of an O-ring case'),
        ('oring: coarse', 'oring: nowhere', 'nowhere'),
        ('numerics:', 'seal: {interference: 1.0e-5}\nnumerics:', 'seal.interference has no meaning for an O-ring'),
        ('numerics:', 'control_edge: {}\nnumerics:', 'control_edge has no meaning for an O-ring'),
    ],
)
def test_what_an_o_ring_cannot_be_is_one_line(ring, capsys, was, now, message):
    ring.write_text(COARSE_RING.replace(was, now))
    assert main(['ehl', 'map', str(ring)]) == 2
    said = capsys.readouterr().err.strip()
    assert message in said
    assert len(said.splitlines()) == 1


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
