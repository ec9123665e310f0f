"""``seal_friction ehl run`` and ``study``: numbers and pages from case files; interrupted work resumes."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from harness.ehl_cases import SMALL, answer, measured_bag
from lubrication_findings import OUR_CHOICES, all_findings, influence
from paths import ROOT

from seal_friction_ros.offline.commands.main import main
from seal_friction_studies.core.study_case import Spool, StudyCase
from seal_friction_studies.core.transient import run_transient
from seal_friction_studies.offline.study_runs import load_case


@pytest.mark.parametrize('path', sorted((ROOT / 'config' / 'ehl').glob('*.yaml')), ids=lambda path: path.stem)
def test_every_case_of_the_repository_is_one_and_says_what_is_ours(path: Path):
    case = load_case(path.stem)
    assert isinstance(case, StudyCase | Spool)
    assert case.name == path.stem
    assert case.source
    if isinstance(case, Spool):
        assert all(isinstance(load_case(member.case), StudyCase) for member in case.members)


def test_run_gives_its_findings_with_their_errors(small, capsys):
    found = answer(capsys, 'run', small)
    assert found['friction_N'] > 0.0
    assert 0.9 < found['solid_share'] < 1.0
    assert found['step_errors'].keys() == found['grid_errors'].keys() >= {'friction_N', 'rise_on_deceleration'}
    assert found['mass_defect'] < 1e-12
    assert found['retried_steps'] == 0


@pytest.mark.long
def test_study_has_the_keys_of_the_paper_as_one_json_object_and_two_processes_find_what_one_does(tmp_path, capsys):
    """The processes do not compile, which would take them longer than the work."""
    tiny = tmp_path / 'tiny.yaml'
    tiny.write_text(SMALL.replace('cells: 48, time_step: 2.0e-3', 'cells: 32, time_step: 8.0e-3'))
    words = ['ehl', 'study', str(tiny), '--json', '--jobs', '2']
    command = [sys.executable, '-m', 'seal_friction_ros.offline.commands.main', *words]
    environment = {**os.environ, 'NUMBA_DISABLE_JIT': '1'}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found['solid_shear_stress_Pa'] == [1e6, 2e6]
    assert found['friction_N'][1] == pytest.approx(2.0 * found['friction_N'][0], rel=0.1)
    assert len(found['solid_share']) == 2
    alone = answer(capsys, 'study', str(tiny))
    assert found.keys() == alone.keys()
    assert found['friction_N'] == pytest.approx(alone['friction_N'], rel=1e-9)


def test_an_interrupted_study_resumes_from_its_finished_runs(small, tmp_path, capsys):
    work = tmp_path / 'work'
    first = answer(capsys, 'study', small, '--work', str(work))
    missing, kept = sorted(work.glob('*.json'))
    missing.unlink()
    written = kept.stat().st_mtime_ns
    assert answer(capsys, 'study', small, '--work', str(work)) == first
    assert missing.exists()
    assert kept.stat().st_mtime_ns == written  # not computed again
    for path in (missing, kept):
        path.write_text('{"half": 1}')
    assert answer(capsys, 'study', small, '--work', str(work)) == first


@pytest.mark.long
@pytest.mark.renders
def test_every_command_of_the_page_is_one(small, ring, tmp_path, capsys, monkeypatch):
    """With a small case instead of those of the page, so that it takes no longer than it must."""
    monkeypatch.chdir(tmp_path)
    Path('build').mkdir()
    Path('spool.yaml').write_text('name: spool\nmotion: {distance: 1.8e-3, cycles: 1}\nseals: [{case: small}]\n')
    swapped = {
        'oring_ms28775_114': str(ring),
        'inner_seal': small,
        'spool': 'spool.yaml',
        'BAG': str(measured_bag(tmp_path, with_position=True)),
        '100': '2',  # samples
    }
    blocks = re.findall(r'```bash\n(.*?)```', (ROOT / 'docs' / 'ehl.md').read_text(), re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    assert len(lines) == 7
    for line in lines:
        program, *words = line.split()
        assert program == '.venv/bin/seal_friction'
        assert main([*(swapped.get(word, word) for word in words), '--jobs', '1']) == 0, line
    pages = {path.stem: path.read_text() for path in Path('build').glob('*.html')}
    assert pages.keys() == {'inner_seal', 'spool', 'study', 'map', 'uncertain', 'compared', 'from_drawing'}
    assert 'Findings' in pages['inner_seal']
    assert 'grease.flow_index' in pages['inner_seal']
    assert 'simulation_against_measurement' in pages['compared']
    figures = [path for path in Path('build').glob('*_figures/*') if path.stat().st_size > 1000]
    assert {path.name for path in figures} >= {
        'film.gif', 'film.svg', 'friction_over_position.png', 'spool.png', 'solid_shear_stress.png', 'friction_map.png',
    }  # fmt: skip


def test_every_script_of_the_page_is_one():
    scripts = set(re.findall(r'`python ([^` ]*)', (ROOT / 'docs' / 'ehl.md').read_text()))
    assert scripts == {
        'test/studies/lubrication_findings.py',
        'test/system/oring_map.py',
        'test/system/speed_on_logs.py',
        'test/studies/seal_bodies.py',
        'test/system/uncertain_grid.py',
    }
    assert all((ROOT / script).is_file() for script in scripts)


@pytest.mark.long  # twelve runs
def test_findings_and_influence_of_our_choices_come_as_numbers(small, monkeypatch):
    monkeypatch.setitem(OUR_CHOICES, 'small', ('topography.rms_height', 'seal.crown_radius'))
    found = {row.name: row for row in all_findings([small])}
    assert {'friction', 'deviation', 'mass_defect', 'retried_steps'} <= set(found)
    assert 0.0 <= found['friction'].by_grid < 0.5 * found['friction'].value
    changes = influence([small])
    assert list(changes) == ['topography.rms_height', 'seal.crown_radius']
    down, up = changes['topography.rms_height']['friction']
    assert down < 0.0 < up


def test_a_run_of_an_o_ring_is_refused_in_one_line(ring, capsys):
    assert main(['ehl', 'run', str(ring)]) == 2
    assert 'an O-ring has a friction map only: seal_friction ehl map' in capsys.readouterr().err


def test_spool_adds_up_its_seals(small, tmp_path, capsys):
    spool = tmp_path / 'spool.yaml'
    spool.write_text(
        'name: pair\nmotion: {distance: 1.8e-3, cycles: 1}\n'
        'seals: [{case: small}, {case: small}, {case: small, mirrored: true}]\n'
    )
    found = answer(capsys, 'run', str(spool))
    single = np.abs(run_transient(load_case(small)).friction).max()
    assert found['largest_friction_N'] == pytest.approx(3.0 * single, rel=0.01)
    assert found['seals'] == ['small', 'small', 'small, mirrored']
    for direction in ('positive', 'negative'):
        level, peak = found[f'{direction}_level_N'], found[f'{direction}_peak_N']
        assert 0.0 < level < peak <= found['largest_friction_N']
        assert found[f'{direction}_peak_over_level'] == pytest.approx(peak / level)


def test_seals_of_a_spool_with_different_time_steps_all_take_the_shortest(small, tmp_path, capsys):
    coarser = SMALL.replace('name: small', 'name: coarser').replace('time_step: 2.0e-3', 'time_step: 3.0e-3')
    (tmp_path / 'coarser.yaml').write_text(coarser)
    spool = tmp_path / 'spool.yaml'
    spool.write_text('name: pair\nmotion: {cycles: 1}\nseals: [{case: small}, {case: coarser}]\n')
    single = np.abs(run_transient(load_case(small)).friction).max()
    assert answer(capsys, 'run', str(spool))['largest_friction_N'] == pytest.approx(2.0 * single, rel=0.05)


@pytest.mark.parametrize('with_position', [True, False])
def test_measured_motion_of_a_bag_is_run_and_its_force_compared(small, tmp_path, capsys, with_position):
    bag = measured_bag(tmp_path, with_position)
    capsys.readouterr()
    found = answer(capsys, 'run', small, '--bag', str(bag), '--average', '10')
    assert found['correlation'] > 0.85
    assert found['measured_mean_N'] == pytest.approx(0.75, abs=0.05)
    assert found['resonance_Hz'] == pytest.approx(157.0, rel=0.05)  # three cycles do not tell it closer


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['run', 'nowhere'], 'config/ehl has no nowhere: there are'),
        (['study', 'spool'], 'a spool has no study'),
        (['map', 'spool'], 'a spool has no friction map'),
        (['run', 'spool', '--bag', 'x'], 'a spool cannot be compared with a bag'),
        (['run', 'inner_seal', '--window', '0', '1'], '--window is only for a --bag'),
        (['run', 'inner_seal', '--average', '9'], '--average is only for a --bag'),
        (['map', 'inner_seal', '--seal-file', 'setup.py/x.yaml'], 'setup.py/x.yaml: cannot write into'),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(arguments, words, capsys):
    assert main(['ehl', *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count('\n') == 1


def test_run_that_does_not_converge_is_an_error_and_no_curve(tmp_path, capsys):
    """Roughness that the load crushes."""
    path = tmp_path / 'crushed.yaml'
    path.write_text(SMALL.replace('small', 'crushed') + 'topography: {rms_height: 0.2e-6, rms_slope: 0.1}\n')
    page = tmp_path / 'page.html'
    assert main(['ehl', 'run', str(path), '--out', str(page)]) == 2
    said = capsys.readouterr()
    assert said.out == ''
    assert 'case crushed at' in said.err
    assert not page.exists()


def test_case_of_the_paper_stands_in_full_in_its_file_and_is_what_the_others_build_on():
    case = load_case('inner_seal')
    assert case.unknown
    assert replace(case, name='x', source='', unknown=()) == StudyCase(name='x')
