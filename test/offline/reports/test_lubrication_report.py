"""Pages of the lubricated contact, from results made up by hand: every template, with names that must be escaped."""

from dataclasses import replace

import numpy as np
from harness.report_page import checked_page

from seal_friction_ros.core.foundation.unknowns import Unknown
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.lubrication.friction_map import SteadyFriction, stacked
from seal_friction_ros.core.lubrication.lubrication_case import parse_lubrication_case
from seal_friction_ros.offline.contact.lubrication_runs import MapRuns
from seal_friction_ros.offline.contact.uncertainty import Uncertainty
from seal_friction_ros.offline.reports import lubrication_report as report

EVIL = '<b>case</b> & "1"'
CASE = replace(parse_lubrication_case({'name': 'case'}), name=EVIL, source='<i>source</i>')


def computed_map() -> MapRuns:
    speeds, pressures = (1e-3, 1e-2, 1e-1), (0.0, 1e5)
    law = FrictionMap(speeds, pressures, (0.9, 0.7, 0.4, 1.1, 0.8, 0.4), 1e-2, 2.2e-4, 4.2e-5)
    frictions = np.array(law.frictions).reshape(2, 3)
    rows = [
        SteadyFriction(
            pressure=p,
            friction=f,
            solid=0.9 * f,
            direction_difference=np.full(3, -1e-6 * p),
            stiffness=2e4,
            retried_steps=0,
            real_contact=0.1,
            thinnest=0.8,
        )
        for p, f in zip(pressures, frictions, strict=True)
    ]
    return MapRuns(CASE, law, stacked(rows), 0)


def test_a_map_shows_friction_by_speed_and_pressure(tmp_path):
    report.write_map_page(computed_map(), tmp_path / 'map.html')
    page = checked_page(tmp_path / 'map.html')
    assert page.figures == ['friction_map']
    assert list(page.table('speed [mm/s]')[0].values()) == ['1.00', '0.900', '1.100']
    assert list(page.table('speed [mm/s]')[-2].values()) == ['10.00, towards the pressure', '0.700', '0.750']
    assert list(page.table('speed [mm/s]')[-1].values()) == ['10.00, away from it', '0.700', '0.850']
    assert page.tiles['distance before the seal slides'] == '0.042 mm'


def test_a_map_says_where_no_lubricant_gets_under_the_seal_and_where_the_flow_factors_end(tmp_path):
    computed = computed_map()
    for name, changes, words in (
        ('sealed', {'real_contact': np.array([0.1, 0.9])}, 'above 0.42 no lubricant gets under it'),
        ('thin', {'thinnest': np.array([0.8, 0.3])}, 'the gap is 0.3 of the roughness'),
    ):
        changed = computed._replace(table=computed.table._replace(**changes))
        report.write_map_page(changed, tmp_path / f'{name}.html')
        assert any(words in text for text in checked_page(tmp_path / f'{name}.html').texts['p.note'])
    assert computed.limits == ''


def test_a_map_marks_what_the_mesh_changes_by_more_than_3_percent_and_warns_above_5(tmp_path):
    errors = np.array([[0.001, 0.02, 0.031], [np.inf, 0.012, 0.14]])
    computed = computed_map()._replace(mesh_error=np.where(np.isinf(errors), 0.0, errors))
    report.write_map_page(computed, tmp_path / 'map.html')
    page = checked_page(tmp_path / 'map.html')
    assert [list(row.values())[1:] for row in page.table('speed [mm/s]')[:3]] == [
        ['0.900', '1.100'],
        ['0.700', '0.800'],
        ['0.400 *', '0.400 *'],
    ]
    assert (
        'Mesh: the next one changes the friction by 14 % at most, at 100 mm/s and 1 bar, and by 2 % at most at 10 '
        'mm/s; 2 of 6 by MORE THAN 3 %, at 100 to 100 mm/s; above 5 % a number is not converged.'
    ) in page.texts['p.note']
    assert 'not converged' not in computed._replace(mesh_error=np.full((2, 3), 0.049)).mesh
    unknown = computed._replace(mesh_error=errors)
    assert 'neither the finer nor the coarser one can be computed at 1 mm/s and 1 bar' in unknown.mesh
    assert unknown.numbers()['mesh_error'][1] == [np.inf, 0.012, 0.14]
    assert unknown.numbers()['mesh_marked'] == [[False, False, True], [True, False, True]]


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
