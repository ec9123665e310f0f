"""``identify --presliding``: rings of the Delft rig on strokes kept back, a bag, refusals."""

import pytest
from harness.identify_run import Run, data

from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.identification.presliding_fit import fit_presliding, score_presliding
from seal_friction_ros.offline.identification.presliding import reversal_log
from seal_friction_ros.offline.identification.sources import SourceOptions, read_sources

SHORTEST = 0.5e-3  # [m]
FILES = {
    'O-ring257': [f'delft/O-ring257_{bar}bar.csv' for bar in (1, 3, 5, 7)],
    'Stadium_lc': [f'delft/Stadium_lc_{bar}bar.csv' for bar in (1, 2, 3, 4, 5)],
}


@pytest.mark.parametrize('ring', FILES)
def test_strokes_kept_back_are_predicted_nearly_as_well_as_they_repeat(ring):
    paths = [data(name) for name in FILES[ring]]
    sources = read_sources(paths, SourceOptions(rig='delft', chambers=('a',)))
    logs = [reversal_log(source.log) for source in sources.each]
    score = score_presliding(logs, 3.0 * SHORTEST, SHORTEST)
    assert score.reversals >= 7 * len(logs)
    assert score.elastic < 1.5 * score.repeatability
    assert score.elastic < 0.7 * score.rigid


@pytest.mark.long
def test_every_other_pressure_of_a_seal_tells_the_stiffness_that_all_tell():
    logs = [
        reversal_log(source.log)
        for source in read_sources(
            list(map(data, FILES['Stadium_lc'])), SourceOptions(rig='delft', chambers=('a',))
        ).each
    ]
    every, some = (fit_presliding(chosen).presliding for chosen in (logs, logs[::2]))
    assert some.stiffness == pytest.approx(every.stiffness, rel=0.2)  # 42 instead of 160 kN/m with a lag of 37 mm
    assert some.memory_length < 1e-3


def test_a_seal_file_gets_the_elasticity_with_standard_errors(tmp_path):
    run = Run(tmp_path, *map(str, map(data, FILES['O-ring257'])), '--rig', 'delft', '--presliding')
    found = run.figures['presliding']
    seal = parse_seal(run.document)
    assert seal.presliding.stiffness == pytest.approx(found['stiffness_N_per_m'], rel=1e-5)
    assert seal.presliding.relative_std * found['stiffness_N_per_m'] == pytest.approx(
        found['standard_errors']['stiffness_N_per_m'], rel=1e-3
    )
    assert 2e-4 < found['full_yield_m'] < 1e-3
    assert found['kept_back']['rms_N'] < 0.7 * found['kept_back']['rigid_rms_N']
    assert run.document['identification']['presliding'] == found


def test_without_the_option_there_is_no_elasticity(tmp_path):
    run = Run(tmp_path, *map(str, map(data, FILES['O-ring257'][:2])), '--rig', 'delft')
    assert 'presliding' not in run.document
    assert run.figures['presliding'] is None


def test_readings_by_hand_are_refused(tmp_path):
    table = tmp_path / 'table.csv'
    rows = [f'{p},{side},{5.0 + p},{test}' for test in (1, 2) for p in (1, 2, 3) for side in ('extend', 'retract')]
    table.write_text('\n'.join(['pressure_bar,direction,friction_N,test', *rows]))
    run = Run(tmp_path, str(table), '--presliding')
    assert run.code == 2
    assert 'manual readings have no reversals' in run.errors
    assert not run.out.exists()
