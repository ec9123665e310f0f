"""``seal_friction force``: the friction of a seal file, or of an O-ring from its geometry."""

import json
from pathlib import Path

import pytest
import yaml
from paths import ROOT

from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.commands.main import main

TERMS = {'viscous_friction': 100.0, 'asymmetry': 0.1}


def answer(capsys, *words: str) -> dict:
    capsys.readouterr()
    assert main(['force', *words, '--json']) == 0
    return json.loads(capsys.readouterr().out)


def test_friction_breakaway_and_band_are_those_of_the_seal_times_the_seals(capsys):
    seal = parse_seal(read_yaml(config_path('seals', 'ms28775_114')))
    found = answer(capsys, 'ms28775_114', '--pressure', '0', '500 psi', '100bar', '--seals', '2')
    for pressure, friction, breakaway, low, high in zip(
        *(found[key] for key in ('pressure_Pa', 'friction_N', 'breakaway_N', 'friction_low_N', 'friction_high_N')),
        strict=True,
    ):
        one = seal.coulomb_law.coulomb_friction(pressure)
        assert friction == pytest.approx(2.0 * one)
        assert breakaway == pytest.approx(2.0 * ((1.0 + seal.stiction_ratio) * one + seal.stiction))
        assert high - friction == pytest.approx(2.0 * 1.96 * seal.uncertainty.std(one), rel=1e-3)
        assert friction - low == pytest.approx(high - friction)
    assert found['in_identified_range'] == [True, True, False]


def test_speed_and_direction_count_where_the_seal_knows_them(tmp_path: Path, capsys):
    document = read_yaml(config_path('seals', 'ms28775_114')) | {
        'velocity_terms': TERMS, 'identified_speed': [0.001, 0.05],
    }  # fmt: skip
    path = tmp_path / 'seal.yaml'
    path.write_text(yaml.safe_dump(document))
    coulomb = answer(capsys, str(path), '--pressure', '1e6')['friction_N'][0]
    found = answer(capsys, str(path), '--pressure', '1e6', '--speed', '20mm/s')
    assert found['friction_N'] == pytest.approx([1.1 * (coulomb + 2.0)])
    assert found['friction_on_retraction_N'] == pytest.approx([0.9 * (coulomb + 2.0)])
    assert found['in_identified_range'] == [True]
    assert main(['force', str(path), '--pressure', '1e6', '--speed', '0.2']) == 0
    assert 'outside the identified range' in capsys.readouterr().out


def test_a_case_is_computed_and_has_its_prior(tmp_path: Path, capsys):
    case = yaml.safe_load((ROOT / 'config' / 'oring' / 'ms28775_114.yaml').read_text())
    case |= {'numerics': {'lines': 9}, 'pressures': [0.0, 1e6]}
    path = tmp_path / 'case.yaml'
    path.write_text(yaml.safe_dump({key: value for key, value in case.items() if key not in ('friction', 'unknown')}))
    found = answer(capsys, str(path), '--pressure', '10bar')
    assert 8.0 < found['friction_N'][0] < 16.0
    assert found['friction_std_N'][0] == pytest.approx(2.0 * found['friction_N'][0])
    assert found['friction_low_N'] == [0.0]


def test_a_file_that_is_neither_is_said_in_one_line(tmp_path: Path, capsys):
    path = tmp_path / 'other.yaml'
    path.write_text('name: x\n')
    assert main(['force', str(path), '--pressure', '1e6']) == 2
    said = capsys.readouterr().err
    assert str(path) in said
    assert len(said.splitlines()) == 1
