"""Parameters of the simulator: what is refused, and the servo that they make."""

import pytest

from seal_friction_ros.core.estimation.node_options import StartOptions
from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.cylinder import Cylinder
from seal_friction_ros.core.servo.hydraulics import ServoValve
from seal_friction_ros.core.servo.plant import Load
from seal_friction_ros.core.servo.pneumatics import PneumaticValve
from seal_friction_ros.core.servo.simulator_options import (
    SERVO_SIMULATOR_PARAMETERS,
    SimulatorSettings,
    StandardMessages,
    servo_parameters,
)

PARTS = {part: part() for part in (ServoValve, PneumaticValve, Load)} | {
    Cylinder: Cylinder(dead_volume=2e-5),
    ServoController: ServoController(position_gain=8e3, velocity_gain=150.0, force_bandwidth=50.0),
}


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'wave': 'square'}, "wave = 'square' is none of sine, step, trapezoid, chirp, topic, pull_test"),
        ({'fluid': 'water'}, "fluid = 'water' is none of hydraulic, pneumatic"),
        ({'seal_elasticity': 'soft'}, "seal_elasticity = 'soft' is none of rigid, elements, lugre"),
        ({'messages': 'other'}, "messages = 'other' is none of own, standard"),
        ({'feedforward_message': 'x'}, "feedforward_message = 'x' is none of own, joint_state, array"),
        ({'messages': 'standard', 'wave': 'topic'}, "wave = 'topic' needs messages: own"),
        ({'messages': 'standard', 'wave': 'pull_test'}, "wave = 'pull_test' needs messages: own"),
        ({'time_factor': 2.0}, r'time_factor = 2.0 needs publish_clock'),
        ({'rate': 9.0}, 'rate = 9.0 Hz is below its lower bound 10.0 Hz'),
    ],
)
def test_invalid_settings_are_refused_with_what_there_is(changes, reason):
    with pytest.raises(ValueError, match=f'^SimulatorSettings.{reason}'):
        SimulatorSettings(**changes)


@pytest.mark.parametrize(
    'changes',
    [
        {},
        {'messages': 'standard', 'wave': 'chirp'},
        {'messages': 'own', 'wave': 'topic'},
        {'time_factor': 2.0, 'publish_clock': True},
    ],
)
def test_settings_that_make_sense_are_taken(changes):
    assert all(getattr(SimulatorSettings(**changes), name) == value for name, value in changes.items())


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [({'joint': ''}, 'joint is empty'), ({'reference': 'x'}, "'x' is none of joint_state, trajectory_point")],
)
def test_standard_messages_need_a_joint_and_a_known_reference(changes, reason):
    with pytest.raises(ValueError, match=reason):
        StandardMessages(**changes)
    assert StandardMessages(reference='trajectory_point').joint == 'rod'


@pytest.mark.parametrize(
    ('rate', 'longest', 'steps'),
    [(1000.0, 1e-4, 10), (1000.0, 0.99e-4, 11), (2000.0, 3e-4, 2), (3000.0, 1.0 / 3e4, 10)],
)
def test_the_inner_step_is_the_longest_that_divides_the_sample_time_and_is_not_above_the_wanted_one(
    rate, longest, steps
):
    servo = servo_parameters(SimulatorSettings(rate=rate, inner_step=longest), PARTS, ())
    assert servo.control_period == pytest.approx(1.0 / rate)
    assert servo.inner_step == pytest.approx(1.0 / rate / steps)


def test_the_fluid_chooses_the_valve():
    for fluid, valve in (('hydraulic', ServoValve), ('pneumatic', PneumaticValve)):
        assert type(servo_parameters(SimulatorSettings(fluid=fluid), PARTS, ()).valve) is valve


def test_waves_sensors_and_what_is_followed_change_while_the_simulator_runs_and_the_machine_does_not():
    changing = {
        prefix
        for group in SERVO_SIMULATOR_PARAMETERS
        for prefix in [group.prefix]
        if group.record_type is not StartOptions and group.names().keys() - group.fixed()
    }
    assert changing == {'', 'sine.', 'step.', 'trapezoid.', 'chirp.', 'sensors.'}
    for group in SERVO_SIMULATOR_PARAMETERS:
        if group.record_type is SimulatorSettings:
            assert group.names().keys() - group.fixed() == {
                'wave', 'reference_resolution', 'use_feedforward', 'feedforward_timeout', 'reference_timeout'
            }  # fmt: skip
        elif group.prefix in changing - {''}:
            assert not group.fixed()
