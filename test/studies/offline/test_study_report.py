"""Pages of the studies, from results made up by hand: every template, with names that must be escaped."""

from dataclasses import replace

import numpy as np
import pytest
from harness.report_page import checked_page

from seal_friction_studies.core.findings import Findings
from seal_friction_studies.core.measuring_chain import MeasuringChain
from seal_friction_studies.core.spool import SpoolResult
from seal_friction_studies.core.study import StudyTable
from seal_friction_studies.core.study_case import parse_study_case
from seal_friction_studies.core.transient import TransientResult
from seal_friction_studies.offline import study_report as report
from seal_friction_studies.offline.bag_comparison import Comparison
from seal_friction_studies.offline.study_runs import CaseRun, StudyRuns

EVIL = '<b>case</b> & "1"'
CASE = replace(parse_study_case({'name': 'case', 'motion': {'cycles': 1}}), name=EVIL, source='<i>source</i>')
STEPS, CELLS = 20, 24
FINDINGS = Findings(0.6, 0.96, None, 0.5, None, 0.02, None, 31e-6, 30e-6, None, None, None, None, None)


def result(case=CASE) -> TransientResult:
    """One cycle of a cosine with a friction of 0.6 N, of which the film bears a hundredth."""
    phase = np.linspace(0.0, 2.0 * np.pi, STEPS + 1)[1:]
    friction = 0.6 * np.sign(np.sin(phase))
    shape = np.ones((STEPS, CELLS)) * np.hanning(CELLS)
    return TransientResult(
        case=case,
        time=0.2 * phase / (2.0 * np.pi),
        position=-0.9e-3 * np.cos(phase),
        velocity=0.03 * np.sin(phase),
        sliding_velocity=0.03 * np.sin(phase),
        friction=friction,
        solid=0.99 * friction,
        fluid=0.01 * friction,
        edge=np.zeros(STEPS),
        lag=np.zeros(STEPS),
        place=np.linspace(-3e-4, 3e-4, CELLS),
        gap=2e-6 + 1e-6 * shape,
        film_pressure=1e5 * shape,
        contact_pressure=1e6 * shape,
        saturation=np.ones((STEPS, CELLS)),
        retried_steps=1,
        newton_iterations=9,
        mass_defect=4e-14,
    )


def comparison(resonance) -> Comparison:
    run = result()
    return Comparison(
        bag='<u>bag</u>',
        chain=MeasuringChain(natural_frequency=157.0),
        result=run,
        time=run.time,
        position=run.position,
        measured=run.friction,
        filtered=run.friction,
        computed=0.9 * run.friction,
        averaged_samples=50,
        resonance=resonance,
        shown=run.friction,
    )


def parameters(page) -> dict[str, str]:
    return {row['parameter']: row['value'] for row in page.table('parameter')}


def test_a_run_shows_its_findings_with_their_errors_and_its_parameters(tmp_path):
    run = CaseRun(result(), FINDINGS, {'friction': 0.007, 'solid_share': 0.0005}, {'friction': 0.004})
    *_, animation = report.write_run_page(run, tmp_path / 'run.html')
    assert animation.read_bytes().startswith(b'GIF89a')
    page = checked_page(tmp_path / 'run.html')
    assert page.texts['h1'] == [f'Seal friction: {EVIL}']
    assert '<i>source</i>' in page.texts['p']
    assert page.figures == ['friction_over_position', 'over_time', 'film']
    found = page.table('finding')
    assert [row['unit'] for row in found] == ['N', '%', 'N', 'N', 'µm', 'µm']
    assert list(found[1].values()) == ['solid share of it', '%', '96', '0.05', '']
    assert page.tiles['steps, retried steps'] == f'{STEPS}, 1'
    assert parameters(page)['motion.distance'] == '0.0018'
    first = (tmp_path / 'run.html').read_bytes(), animation.read_bytes()
    report.write_run_page(run, tmp_path / 'run.html')
    assert ((tmp_path / 'run.html').read_bytes(), animation.read_bytes()) == first


def test_a_study_shows_each_solid_shear_stress(tmp_path):
    table = StudyTable((1e6, 2e6), (0.4, 0.8), (0.94, 0.97), (0.014, -0.014), (0.018, 0.018))
    report.write_study_page(CASE, StudyRuns(table, [result(), result()]), tmp_path / 'study.html')
    page = checked_page(tmp_path / 'study.html')
    assert [list(row.values())[:3] for row in page.table('solid shear stress [MPa]')] == [
        ['1.00', '0.400', '94.0'],
        ['2.00', '0.800', '97.0'],
    ]
    assert 'All within 0.5 mm of the middle, in the last cycle.' in page.texts['p']


@pytest.mark.parametrize('resonance', [None, 153.0])
def test_a_comparison_says_what_was_done_about_the_measuring_chain(tmp_path, resonance):
    report.write_comparison_page(comparison(resonance), tmp_path / 'page.html')
    page = checked_page(tmp_path / 'page.html')
    assert page.texts['h1'] == [f'{EVIL} against <u>bag</u>']
    assert page.figures == ['simulation_against_measurement', 'friction_over_position', 'film']
    caption = page.texts['figcaption'][0]
    assert ('no resonance' in caption) == (resonance is None)
    assert ('153 Hz' in caption) == (resonance is not None)
    assert 'oscillator of 157 Hz' in caption
    assert {row['number']: row['value'] for row in page.table('number')}['measured_mean_N'] == '0.6'


def test_a_spool_shows_each_seal_and_all(tmp_path):
    run = result()
    spool = SpoolResult(
        run.time, run.position, 3.0 * run.friction, np.array([run.friction, 2.0 * run.friction]), run.time > 0.0
    )
    report.write_spool_page(EVIL, spool, ['<b>a</b>', 'b'], tmp_path / 'spool.html')
    page = checked_page(tmp_path / 'spool.html')
    assert page.texts['h1'] == [f'Spool: {EVIL}']
    rows = page.table('seal')
    assert [row['seal'] for row in rows] == ['1', '2', 'all']
    assert [row['largest friction in the last cycle [N]'] for row in rows] == ['0.600', '1.200', '1.800']
