"""Pages of the lubricated contact, from results made up by hand: every template, with names that must be escaped."""

from dataclasses import replace

import numpy as np
import pytest
from harness.report_page import checked_page

from seal_friction_ros.core.foundation.unknowns import Unknown
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.lubrication.findings import Findings
from seal_friction_ros.core.lubrication.friction_map import SteadyFriction
from seal_friction_ros.core.lubrication.lubrication_case import parse_lubrication_case
from seal_friction_ros.core.lubrication.measuring_chain import MeasuringChain
from seal_friction_ros.core.lubrication.spool import SpoolResult
from seal_friction_ros.core.lubrication.study import StudyTable
from seal_friction_ros.core.lubrication.transient import TransientResult
from seal_friction_ros.offline.contact.lubrication_comparison import Comparison
from seal_friction_ros.offline.contact.lubrication_runs import CaseRun, MapRuns, StudyRuns
from seal_friction_ros.offline.contact.uncertainty import Uncertainty
from seal_friction_ros.offline.reports import lubrication_report as report

EVIL = '<b>case</b> & "1"'
CASE = replace(parse_lubrication_case({'name': 'case', 'motion': {'cycles': 1}}), name=EVIL, source='<i>source</i>')
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


def computed_map() -> MapRuns:
    speeds, pressures = (1e-3, 1e-2, 1e-1), (0.0, 1e5)
    law = FrictionMap(speeds, pressures, (0.9, 0.7, 0.4, 1.1, 0.8, 0.4), 1e-2, 2.2e-4, 4.2e-5)
    frictions = np.array(law.frictions).reshape(2, 3)
    rows = [
        SteadyFriction(**{**dict.fromkeys(SteadyFriction._fields), 'pressure': p, 'friction': f, 'solid': 0.9 * f})
        for p, f in zip(pressures, frictions, strict=True)
    ]
    return MapRuns(CASE, law, rows, 0)


def test_a_map_shows_friction_by_speed_and_pressure(tmp_path):
    report.write_map_page(computed_map(), tmp_path / 'map.html')
    page = checked_page(tmp_path / 'map.html')
    assert page.figures == ['friction_map']
    assert list(page.table('speed [mm/s]')[0].values()) == ['1.00', '0.900', '1.100']
    assert page.tiles['distance before the seal slides'] == '0.042 mm'


def test_a_map_with_samples_shows_what_is_unknown_its_quantiles_and_what_failed(tmp_path):
    nominal = np.array([[0.9, 0.4], [1.1, 0.5]])
    scales = np.array([0.5, 1.0, 2.0])
    samples = Uncertainty(
        seed=7,
        names=('seal.solid_shear_stress',),
        drawn=np.array([[1e6], [1.5e6], [2e6], [3e6]]),
        failed={2: 'no <b>film</b>'},
        pressures=(0.0, 1e5),
        speeds=(1e-3, 1e-1),
        nominal=nominal,
        computed=scales[:, None, None] * nominal,
    )
    case = replace(CASE, unknown=(Unknown('seal.solid_shear_stress', 1.5e6, 'factor', (2.0,)),))
    report.write_map_page(computed_map()._replace(case=case, uncertainty=samples), tmp_path / 'map.html')
    page = checked_page(tmp_path / 'map.html')
    assert page.figures == ['friction_map', 'friction_quantiles']
    assert page.table('unknown') == [
        {
            'unknown': 'seal.solid_shear_stress',
            'in the case': '1.5e+06',
            'spread': 'factor 2',
            'rank correlation with the force': '+1.00',
        }
    ]
    last = list(page.table('pressure [bar]')[-1].values())
    assert last[:3] == ['1.00', '100.00', '0.500']
    assert last[3:6] == ['0.250', '0.500', '1.000']
    assert page.table('sample') == [{'sample': '3', 'reason': 'no <b>film</b>'}]
    assert f'{samples.relative_std:.3g}' in next(text for text in page.texts['p'] if 'Latin hypercube' in text)


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
