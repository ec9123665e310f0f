"""The spool-valve paper's evaluation as a command, on a rig that rings at 157 Hz."""

import json
from pathlib import Path

import numpy as np
import pytest
from harness.closed_loop_bags import write_closed_loop
from harness.compensation import SCALE
from harness.report_page import checked_page
from harness.spool_program import spool_cycles

from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.commands.main import main

RATE, FRICTION = 5000.0, 2.5  # [Hz], [N]


def table(path: Path, cycles=10, ringing=157.0, jitter=0.0) -> Path:
    """Ten cycles of 1.8 mm at 3 Hz with a constant friction, and a measuring chain that rings after each reversal."""
    time = np.arange(int(cycles / 3.0 * RATE)) / RATE
    phase = (3.0 * time) % 1.0
    displacement = 0.9 * np.clip(8.0 * (np.abs(phase - 0.5) - 0.25), -1.0, 1.0)  # [mm]
    velocity = np.gradient(displacement, time)
    force = FRICTION * np.tanh(velocity / 0.5)
    since = (time + 0.125 / 3.0) % (0.5 / 3.0)
    force = force + 2.0 * np.exp(-since / 0.05) * np.sin(2.0 * np.pi * ringing * since)
    shaken = time + jitter * np.sin(1e4 * time) / RATE
    rows = [f'{t:.7f},{x:.6f},{f:.5f}' for t, x, f in zip(shaken, displacement, force, strict=True)]
    path.write_text('\n'.join(['time_s,displacement_mm,force_N', *rows]))
    return path


def run(tmp_path, capsys, log: Path, *more: str):
    capsys.readouterr()
    code = main(['spool', str(log), '--out', str(tmp_path / 'page.html'), '--json', *more])
    said = capsys.readouterr()
    return code, json.loads(said.out)['numbers'] if code == 0 else said.err


def test_reference_force_and_resonance_are_those_of_the_simulated_log(tmp_path, capsys):
    code, numbers = run(tmp_path, capsys, table(tmp_path / 'log.csv'))
    assert code == 0, numbers
    assert numbers['reference_force_N'] == pytest.approx(FRICTION, rel=0.05)
    assert numbers['resonance_Hz'] == pytest.approx(157.0, rel=0.03)
    assert numbers['stroke_m'] == pytest.approx(1.8e-3, rel=0.01)
    assert numbers['highest_normalised'] == pytest.approx(1.0, abs=0.3)
    page = checked_page(tmp_path / 'page.html')
    assert page.figures == ['friction_over_displacement']
    assert page.tiles['stroke'] == '1.8 mm'


def test_another_reference_scales_the_result(tmp_path, capsys):
    _, own = run(tmp_path, capsys, table(tmp_path / 'log.csv'))
    _, given = run(tmp_path, capsys, tmp_path / 'log.csv', '--reference', '5.0')
    assert given['highest_normalised'] == pytest.approx(own['highest_normalised'] * own['reference_force_N'] / 5.0)


def test_a_bag_of_the_cycles_is_evaluated_as_their_table(tmp_path, capsys):
    wave = spool_cycles(1.8e-3)
    bag = write_closed_loop(tmp_path / 'bag', scales=(SCALE,), seconds=wave.duration, waves=(wave,))
    code, numbers = run(tmp_path, capsys, bag)
    assert code == 0, numbers
    assert numbers['stroke_m'] == pytest.approx(1.8e-3, rel=0.05)
    recorded = read_run(bag)
    slides = np.abs(recorded.velocity) > 0.03
    assert numbers['reference_force_N'] == pytest.approx(recorded.coulomb_friction[slides].mean(), rel=0.15)
    page = checked_page(tmp_path / 'page.html')
    assert page.figures == ['friction_over_displacement']


@pytest.mark.parametrize(
    ('made', 'words'),
    [
        ({'cycles': 4}, 'but cycle 9 is to be evaluated'),
        ({'jitter': 0.9}, 'time does not go in even steps'),
    ],
)
def test_what_cannot_be_evaluated_is_refused(made, words, tmp_path, capsys):
    code, errors = run(tmp_path, capsys, table(tmp_path / 'log.csv', **made))
    assert code == 2
    assert words in errors
    assert not (tmp_path / 'page.html').exists()


def test_a_table_without_the_columns_is_refused(tmp_path, capsys):
    (tmp_path / 'log.csv').write_text('a,b\n' + '1,2\n' * 200)
    code, errors = run(tmp_path, capsys, tmp_path / 'log.csv')
    assert code == 2
    assert 'time_s or time_ms' in errors
