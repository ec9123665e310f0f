"""The tables of test/studies/seal_bodies.py, on coarse grids."""

import dataclasses
import json

import pytest
import seal_bodies


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(seal_bodies, 'MESHES', (12, 16))
    monkeypatch.setattr(seal_bodies, 'HELD', ('bottom_and_flanks',))
    monkeypatch.setattr(seal_bodies, 'WIDTHS', ())
    monkeypatch.setattr(seal_bodies, 'SQUEEZES', (4e-6,))
    monkeypatch.setattr(seal_bodies, 'COEFFICIENTS', (0.0, 0.15))


def table(name: str, monkeypatch, capsys) -> list[dict]:
    monkeypatch.setattr('sys.argv', ['seal_bodies.py', name, '--cells', '64', '--time-step', '2e-3', '--json'])
    assert seal_bodies.main() == 0
    return json.loads(capsys.readouterr().out)[name]


def test_a_section_is_between_half_plane_and_layer_and_stiffer_in_a_full_groove(monkeypatch, capsys):
    rows = table('bodies', monkeypatch, capsys)
    plane, layer, coarse, fine, full = (row['friction [N]'] for row in rows)
    assert plane < fine < layer < full
    assert coarse == pytest.approx(fine, rel=0.03)
    rises = [rows[k]['rise on slowing down [%]'] for k in (0, 3, 1, 4)]
    assert rises == sorted(rises, reverse=True)


def test_the_table_of_the_edge_has_its_peak(monkeypatch, capsys):
    case = seal_bodies.single_case('inner_seal_control_edge', 'finding')
    motion = dataclasses.replace(case.motion, cycles=1)
    brief = dataclasses.replace(case, numerics=dataclasses.replace(case.numerics, time_step=1e-3), motion=motion)
    monkeypatch.setattr(seal_bodies, 'single_case', lambda *_: brief)
    monkeypatch.setattr(seal_bodies, 'EDGE_BODIES', ('finite_elements',))
    (row,) = table('edge', monkeypatch, capsys)
    assert row['peak over friction after it'] > 1.1
    assert row['push of the chamfer [N]'] > 0.2


@pytest.mark.long  # two seals with steps for the edge
def test_a_peak_of_one_seal_stands_on_the_friction_of_the_whole_valve(monkeypatch, capsys):
    monkeypatch.setattr(seal_bodies, 'EDGE_BODIES', ('finite_elements',))
    (row,) = table('valve', monkeypatch, capsys)
    for direction in ('positive', 'negative'):
        assert 1.05 < row[f'{direction}_peak_over_level'] < 1.5
        assert row[f'{direction}_level_N'] > 3.0


def test_small_displacements_are_right_for_a_small_squeeze(monkeypatch, capsys):
    for row in table('strain', monkeypatch, capsys):
        assert abs(row['more [%]']) < 0.5


def test_the_friction_of_the_paper_holds_the_seal_on_one_seat(monkeypatch, capsys):
    free, held = table('groove', monkeypatch, capsys)
    assert (free['seats'], held['seats']) == (2.0, 1.0)
    assert free['falls again at [mm]'] == pytest.approx(-1.41, abs=0.03)
    assert held['falls again at [mm]'] == '-'


def test_air_chokes_before_the_gap_is_wider_than_the_roughness(monkeypatch, capsys):
    rows = table('air', monkeypatch, capsys)
    choked = [row['narrowest gap [um]'] for row in rows if row['viscous flow [g/(m s)]'] > row['choked flow [g/(m s)]']]
    assert 2.0 < min(choked) < 4.0
    assert rows[-1]['Reynolds number'] > 4000.0
    assert rows[0]['blow-out'] < 0.1
    assert rows[-1]['blow-out'] > 1.0


def test_an_unknown_table_is_refused(monkeypatch, capsys):
    monkeypatch.setattr('sys.argv', ['seal_bodies.py', 'soles'])
    with pytest.raises(SystemExit):
        seal_bodies.main()
    assert 'there is no table soles: there are bodies, edge, valve, strain, groove, air' in capsys.readouterr().err
