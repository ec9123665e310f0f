"""``seal_friction ehl map``: numbers, pages and seal files from case files; interrupted work resumes."""

from functools import partial

import numpy as np
import pytest
from harness.ehl_cases import COARSE_RING, answer, measured_bag

from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.lubrication.friction_map import SteadyFriction, stacked
from seal_friction_ros.core.lubrication.lubrication_case import LubricationCase, MapGrid
from seal_friction_ros.core.lubrication.seal_section import LubricationNumerics
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.contact import lubrication_runs as runs


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


def test_the_error_of_a_map_is_its_change_on_the_next_finer_mesh_or_on_the_coarser_one(monkeypatch):
    grid = MapGrid(velocity_min=1e-2, velocity_max=0.1, velocities=2, pressure_max=1e5, pressures=2)
    case = LubricationCase(name='seal', numerics=LubricationNumerics(cells=48), map=grid)

    def table(other, finer_fails=False):
        """On the coarser mesh 10 % more, on the finer one 8 % less, if that can be computed."""
        factor = {34: 1.1, 48: 1.0, 67: 0.92}[other.numerics.cells]
        if finer_fails and factor < 1.0:
            raise NotConvergedError('told to')
        rows = [SteadyFriction(p, np.array([2.0, 1.0]), np.ones(2), np.zeros(2), 1e5, 0) for p in (0.0, 1e5)]
        return stacked(row._replace(friction=factor * row.friction) for row in rows)

    monkeypatch.setattr(runs, 'steady_table', table)
    assert runs.run_map(case, 1).mesh_error == pytest.approx(np.full((2, 2), 0.08))
    monkeypatch.setattr(runs, 'steady_table', partial(table, finer_fails=True))
    assert runs.run_map(case, 1).mesh_error == pytest.approx(np.full((2, 2), 0.1))


def test_the_other_meshes_of_a_ring_have_other_elements_and_cells():
    ring = runs.load_case('oring_delft')
    others = [runs.other_mesh(ring, factor) for factor in (0.7, 1.4)]
    assert [(other.oring.numerics.lines, other.numerics.cells) for other in others] == [(23, 448), (46, 896)]


def test_the_other_meshes_of_a_case_have_as_many_cells_as_it_may_have():
    for cells, factor, found in ((32, 0.7, 32), (40, 0.7, 32), (3000, 1.4, 4000)):
        case = LubricationCase(name='seal', numerics=LubricationNumerics(cells=cells))
        assert runs.other_mesh(case, factor).numerics.cells == found


def test_recording_with_a_mapped_seal_replays_to_the_same_bytes_and_rubs_less_the_faster_it_slides(small, tmp_path):
    seal_file = tmp_path / 'mapped.yaml'
    assert main(['ehl', 'map', small, '--seal-file', str(seal_file), '--jobs', '1']) == 0
    bag = measured_bag(tmp_path, with_position=True, seal=seal_file)
    assert main(['replay', str(bag), '--verify']) == 0
    recorded = read_run(bag)
    speed, friction = np.abs(recorded.velocity), np.abs(recorded.friction_force)
    shears = recorded.status & int(Status.PRESLIDING) != 0  # the map tells how far the seal shears before it slides
    assert shears.any()
    for direction in (-1, 1):  # towards the pressure and away from it
        sliding = (recorded.state == FrictionState.SLIDING) & ~shears & (recorded.direction == direction)
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


def test_an_o_ring_becomes_a_seal_file_from_its_drawing_that_the_node_takes(ring, tmp_path, capsys):
    written = tmp_path / 'from_drawing.yaml'
    page = tmp_path / 'map.html'
    found = answer(capsys, 'map', str(ring), '--seal-file', str(written), '--out', str(page))
    assert 'oring.geometry.section_diameter' in page.read_text()
    assert 'seal.interference' not in page.read_text()
    table = np.array(found['friction_N'])
    assert (np.diff(table, axis=0) > 0.0).all()
    seal = parse_seal(read_yaml(written))
    at_reference = seal.coulomb_law.coulomb_friction(1e6)  # 34 mm/s, between the second and the third speed
    assert table[1, 2] < at_reference < table[1, 1]
    assert [seal.coulomb_law.sliding_friction(1e6, speed) for speed in (1e-3, 0.1)] == [at_reference] * 2
    assert not found['speeds_in_seal_file']
    assert max(found['real_contact_at_rest']) > 0.42
    assert 'no lubricant gets under it' in read_yaml(written)['source']
    assert seal.stiction_ratio == 0.13
    assert found['towards_pressure_N'][1] < at_reference < found['away_from_pressure_N'][1]
    assert seal.pressure_asymmetry.full_pressure == 1e6
    half = found['away_from_pressure_N'][1] - found['towards_pressure_N'][1]
    assert seal.pressure_asymmetry.asymmetry == pytest.approx(-0.5 * half / at_reference, abs=1e-3)
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
