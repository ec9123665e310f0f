"""The page of the servo: Figure 25 as numbers, friction as the estimator has it, and the page itself."""

import dataclasses
import json

import numpy as np
import pytest
from harness.report_page import checked_page

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.friction.states import state_friction
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.position_servo import ServoParameters
from seal_friction_ros.files import load_seals
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.reports.servo_charts import follow_wave, write_servo_charts

SERVO = ServoParameters(seals=load_seals(SealSelection()))
WAVE = Sine()
RUBBING = follow_wave(SERVO, WAVE)
FREE = follow_wave(dataclasses.replace(SERVO, seals=()), WAVE)


def test_figure_25_flat_peaks_with_friction_and_none_without():
    assert RUBBING.tracking.dwell > 0.05 / WAVE.frequency
    assert RUBBING.tracking.dwell_share == pytest.approx(RUBBING.tracking.dwell * WAVE.frequency)
    assert FREE.tracking.dwell == 0.0
    assert RUBBING.tracking.reached < 0.8 * WAVE.amplitude
    assert FREE.tracking.reached == pytest.approx(WAVE.amplitude, rel=0.01)
    assert FREE.tracking.rms < 0.02 * WAVE.amplitude < 0.2 * WAVE.amplitude < RUBBING.tracking.rms


def test_the_peaks_are_flat_to_the_bit():
    position = RUBBING.trajectory.position
    resting = RUBBING.trajectory.velocity == 0.0
    still = resting[1:] & resting[:-1]
    assert still.any()
    assert np.all(np.diff(position)[still] == 0.0)
    high = position[1:][still & (position[1:] > 0.0)]
    assert high.min() > 0.99 * position.max()  # it rests at the peaks and nowhere else


def test_position_and_reference_belong_to_the_same_time():
    error = [np.sum((FREE.reference - np.roll(FREE.trajectory.position, shift)) ** 2) for shift in (-4, -2, 0, 2, 4)]
    assert int(np.argmin(error)) == 2
    assert FREE.reference[0] == pytest.approx(WAVE.at(0.4).position, abs=1e-12)


def test_a_larger_wave_has_shorter_rests():
    larger = follow_wave(SERVO, Sine(amplitude=0.003))
    assert 0.0 < larger.tracking.dwell < RUBBING.tracking.dwell


def test_friction_force_is_that_of_the_estimator():
    trajectory = RUBBING.trajectory
    coulomb = trajectory.coulomb_friction
    breakaway = trajectory.breakaway_force
    expected = [
        state_friction(v, f, v == 0.0, c, b).friction_force
        for v, f, c, b in zip(
            *(column.tolist() for column in (trajectory.velocity, trajectory.force_sum, coulomb, breakaway)),
            strict=True,
        )
    ]
    assert trajectory.friction_force == pytest.approx(np.array(expected))


@pytest.mark.renders
def test_the_page_stands_alone_and_gives_the_same_bytes_again(tmp_path):
    one = write_servo_charts(tmp_path / 'a' / 'servo.html')
    other = write_servo_charts(tmp_path / 'b' / 'servo.html')
    for a, b in zip((one.page, *one.figures), (other.page, *other.figures), strict=True):
        assert a.read_bytes() == b.read_bytes()
    assert {path.stem for path in one.figures} == {'fig25_servo_with_and_without_friction', 'forces_and_pressures'}
    page = checked_page(one.page)
    assert 'http' not in page.prose
    assert [row['rest per reversal [ms]'] for row in page.table('')] == [f'{1e3 * RUBBING.tracking.dwell:.1f}', '0.0']
    (stroke,) = (row for row in page.table('parameter') if row['parameter'] == 'cylinder.stroke')
    assert (stroke['value'], stroke['unit']) == ('0.05', 'm')
    assert one.numbers['with_friction'] == RUBBING.tracking
    assert one.numbers['without_friction'] == FREE.tracking


def test_a_servo_without_seals_has_nothing_to_compare(tmp_path):
    with pytest.raises(ValueError, match='no seals'):
        write_servo_charts(tmp_path / 'out' / 'servo.html', dataclasses.replace(SERVO, seals=()))
    assert not (tmp_path / 'out').exists()


def test_the_command_tells_the_figures(tmp_path, capsys):
    assert main(['servo', '--out', str(tmp_path / 'servo.html'), '--json']) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures['with_friction'] == dataclasses.asdict(RUBBING.tracking)
    assert figures['seals'] == 2
