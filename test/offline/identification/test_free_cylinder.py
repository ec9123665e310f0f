"""A cylinder that nothing but friction loads: Coulomb and viscous friction, and no pressure in the law."""

import subprocess
import sys

import pytest
from harness.identify_run import Run
from paths import ROOT

CIRCULAR = ROOT.parent / 'shared' / 'checks' / 'field' / 'circular'


@pytest.mark.parametrize('spread', ['0', '0.03'])
def test_a_free_cylinder_gives_coulomb_and_viscous_friction_within_three_percent(spread, tmp_path):
    if not CIRCULAR.exists():
        pytest.skip('the free cylinder of the shared checks is not there')
    subprocess.run([sys.executable, CIRCULAR / 'make.py', '1', spread], cwd=tmp_path, check=True)
    run = Run(tmp_path, str(tmp_path / 'free.csv'), '--rig', str(CIRCULAR / 'rig.yaml'))
    assert run.code == 0, run.errors
    assert run.figures['law'] == 'coulomb_viscous'
    values = run.figures['parameters']
    assert 2.0 * values['coulomb_friction_at_any_pressure'] == pytest.approx(600.0, rel=0.03)
    assert 2.0 * values['viscous_friction'] == pytest.approx(2e4, rel=0.03)
    assert run.has_warning('pressure dependence: unknown', 'load the rod')
