"""``identify`` on the log of a boom without load cell, from the rig file on."""

import numpy as np
import pytest
from harness import boom
from harness.boom import Boom
from harness.identify_run import Run, estimates_of

from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import Status
from seal_friction_ros.offline.bags.import_log import read_samples
from seal_friction_ros.offline.bags.rig_file import read_rig

RIG = f"""
name: boom
header: row
start: 1.0
time: {{column_name: t, unit: s}}
chamber_a: {{terms: [{{column_name: p_a, unit: bar}}]}}
chamber_b: {{terms: [{{column_name: p_b, unit: bar}}]}}
force_sum:
  terms:
    - {{column_name: p_a, unit: bar, gain: {1e6 * boom.AREA_A:.2f}, gain_unit: mm2}}
    - {{column_name: p_b, unit: bar, gain: {-1e6 * boom.AREA_B:.2f}, gain_unit: mm2}}
velocity: {{terms: [{{column_name: v, unit: m/s}}]}}
"""
POSITION = 'position: {terms: [{column_name: x, unit: mm}]}\n'
FROM_POSITION = RIG.replace(
    'velocity: {terms: [{column_name: v, unit: m/s}]}',
    'velocity: {terms: [{column_name: x, unit: mm}], savitzky_golay: {window: 0.2, order: 2, largest_gap: 0.1}}',
)


def written(folder, log, rig):
    columns = np.column_stack((log.time, 1e3 * log.position, log.velocity, log.p_a / 1e5, log.p_b / 1e5))
    np.savetxt(folder / 'log.csv', columns, fmt='%.7g', delimiter=',', header='t,x,v,p_a,p_b', comments='')
    (folder / 'rig.yaml').write_text(rig)
    return str(folder / 'log.csv'), '--rig', str(folder / 'rig.yaml')


@pytest.mark.parametrize(
    'rig',
    [
        RIG + POSITION,
        *(pytest.param(rig, marks=pytest.mark.long) for rig in (RIG + POSITION + 'load: position\n', FROM_POSITION)),
    ],
)
def test_identify_gives_friction_and_load_without_a_load_cell(tmp_path, rig):
    machine = Boom()
    simulated = boom.simulate(machine, 'sines')
    run = Run(tmp_path, *written(tmp_path, boom.measured(simulated, 0), rig))
    assert run.code == 0, run.errors
    moving = np.abs(simulated.velocity) > 5e-3
    true = np.abs(simulated.friction[moving]).mean()
    for key in ('measured_N', 'fitted_N'):
        assert np.mean(run.figures[key]) == pytest.approx(true, rel=0.05)
    load = run.figures['load']
    truth = machine.load(np.array(load['position_m']))
    assert np.sqrt(np.mean((np.array(load['force_N']) - truth) ** 2)) < 0.02 * truth.mean()
    assert load['mass_kg'] == pytest.approx(machine.mass(0.45), rel=0.1)
    assert len(load['std_N']) == len(load['position_m'])
    assert not any('asymmetric' in rung['law'] for rung in run.figures['ladder'])
    assert any('were fitted and taken out of the force sum' in remark for remark in run.figures['remarks'])
    assert run.document['identification']['load'] == load
    within, force = float(np.mean(run.figures['pressure_Pa'])), float(simulated.load[0])
    held = estimates_of(run, within, 0.0, force)
    assert (held.state, held.status) == (FrictionState.UNKNOWN, Status.FORCE_CONTAINS_LOAD)
    assert estimates_of(run, within, 0.1, force).state == FrictionState.SLIDING


def test_one_stroke_out_and_back_gives_the_friction_and_one_way_is_refused_with_what_to_drive(tmp_path):
    simulated = boom.simulate(Boom(), 'single')
    log = boom.measured(simulated, 0)
    run = Run(tmp_path, *written(tmp_path, log, RIG + POSITION + 'load: position\n'))
    assert run.code == 0, run.errors
    true = np.abs(simulated.friction[np.abs(simulated.velocity) > 5e-3]).mean()
    assert np.mean(run.figures['fitted_N']) == pytest.approx(true, rel=0.05)
    out = log._replace(**{name: column[: np.argmax(log.position)] for name, column in log._asdict().items()})
    refused = Run(tmp_path, *written(tmp_path, out, RIG + POSITION + 'load: position\n'), name='refused')
    assert refused.code == 2
    assert 'log.csv: 1 strokes out and 0 back do not tell a load' in refused.errors


def test_the_position_of_a_log_is_read_in_metres(tmp_path):
    log = boom.measured(boom.simulate(Boom(), 'single'), 0)
    for rig, known in ((RIG, False), (RIG + POSITION, True), (FROM_POSITION, True)):
        path, _, rig_file = written(tmp_path, log, rig)
        found = read_samples(tmp_path / path, read_rig(tmp_path / rig_file)).position
        assert (found is not None) == known
        if known:
            assert found == pytest.approx(log.position, abs=1e-6)


@pytest.mark.parametrize(
    ('text', 'error'),
    [
        ('load: position\n', 'rig file has no position'),
        (POSITION + 'load: height\n', "Rig.load = 'height' is not one of auto, none, position"),
        (POSITION.replace('mm', 'bar'), r'position.terms\[0\].unit'),
    ],
)
def test_a_wrong_load_or_position_in_the_rig_file_is_refused(tmp_path, text, error):
    (tmp_path / 'rig.yaml').write_text(RIG + text)
    with pytest.raises(ValueError, match=error):
        read_rig(tmp_path / 'rig.yaml')
