"""A pneumatic axis without force sensor, with encoder counts and noise: the feed-forward makes it track."""

import json
from dataclasses import replace

import pytest
from harness.compensation import compensating
from paths import ROOT

from seal_friction_ros.core.servo.closed_loop import (
    Axis,
    AxisSensors,
    EvaluationMotions,
    performance_of,
    with_wrong_friction,
)
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.simulator_options import servo_parameters
from seal_friction_ros.core.tuning import simulated_axis
from seal_friction_ros.core.tuning.settings import TuningSettings
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.tuning.tune import load_machine, sensor_noise

MACHINES = ROOT / 'config' / 'simulated_machines'
PIPELINE = compensating().parameters()


def performance(name, motion, scale, friction_error=0.0, pressure_noise=500.0):
    machine = load_machine(MACHINES / f'{name}.yaml')
    servo = servo_parameters(machine.settings, machine.parts, PIPELINE.estimator.seals)
    pipeline = PIPELINE._replace(feedforward=replace(PIPELINE.feedforward, scale=scale))
    axis = Axis(servo, with_wrong_friction(pipeline, friction_error), machine.sensors)
    motions = EvaluationMotions(motion, 0.3)
    noise = sensor_noise(TuningSettings(pressure_noise=pressure_noise))
    return performance_of(servo.control_period, motions, motions.runs(axis, 1e-3, noise))


def test_the_machine_has_no_force_sensor_and_an_encoder():
    assert load_machine(MACHINES / 'pneumatic_axis.yaml').sensors == AxisSensors(False, 1e-5)
    assert load_machine(MACHINES / 'single_rod_cylinder.yaml').sensors == AxisSensors()


@pytest.mark.parametrize('friction_error', [0.0, 0.3, -0.3])
def test_feed_forward_cuts_the_tracking_error_of_a_pneumatic_axis_by_60_percent(friction_error):
    motion = Sine(0.02, 1.0)
    without = performance('pneumatic_axis', motion, 0.0)
    compensated = performance('pneumatic_axis', motion, 0.9, friction_error)
    assert compensated.tracking_rms < 0.4 * without.tracking_rms
    assert compensated.dwell < 0.7 * without.dwell
    assert compensated.limit_cycle_reversals <= without.limit_cycle_reversals


def test_feed_forward_cuts_the_tracking_error_of_a_single_rod_cylinder_by_60_percent():
    motion = Sine(0.01, 1.0)
    without = performance('single_rod_cylinder', motion, 0.0, pressure_noise=2e4)
    compensated = performance('single_rod_cylinder', motion, 0.9, pressure_noise=2e4)
    assert compensated.tracking_rms < 0.4 * without.tracking_rms
    assert compensated.dwell < 0.7 * without.dwell


@pytest.mark.long
def test_tune_finds_a_feed_forward_for_the_pneumatic_axis(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(simulated_axis, 'MOST_CANDIDATES', 15)
    out = tmp_path / 'feedforward.yaml'
    task = [
        '--amplitude',
        '0.02',
        '--frequency',
        '2',
        '--hold-time',
        '0.1',
        '--friction-error',
        '0',
        '--delay-error',
        '0',
    ]
    machine = ['--machine', str(MACHINES / 'pneumatic_axis.yaml')]
    assert main(['tune', '--out', str(out), *machine, *task, '--json']) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers['tracking_rms_with'] < 0.4 * numbers['tracking_rms_without']
    assert 'pneumatic_axis.yaml' in out.read_text()


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('{messages: standard, standard: {velocity: false}}', 'needs a sensors.position_resolution'),
        ('{fluid: steam}', 'hydraulic, pneumatic'),
        ('{stick_velocity: 1.0}', 'stick_velocity'),
    ],
)
def test_machine_that_cannot_be_is_rejected_with_the_reason(text, reason, tmp_path):
    path = tmp_path / 'machine.yaml'
    path.write_text(f'servo_simulator: {{ros__parameters: {text}}}\n')
    with pytest.raises(ValueError, match=reason):
        load_machine(path)


def test_a_machine_is_not_for_a_bag(tmp_path, capsys):
    assert main(['tune', '--bag', 'b', '--machine', 'm.yaml', '--out', str(tmp_path / 'f.yaml')]) == 2
    assert '--machine is not for a --bag' in capsys.readouterr().err
