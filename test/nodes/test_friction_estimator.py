"""The live node on a real graph: answers, lifecycle, parameters, diagnostics, recording."""

import json
import math
import re
import time
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from harness.compensation import LIVE, REAL_SEALS, SCALE
from harness.live_graph import DEFAULTS, graph
from harness.processes import STOP_TIMEOUT
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from paths import ROOT
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, ListParameters, SetParameters, SetParametersAtomically
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter as RclpyParameter
from seal_friction_msgs.msg import FrictionEstimate
from std_srvs.srv import Trigger

from seal_friction_ros.core.estimation.adaptation import NEW_RUN, NOT_ADAPTED, AdaptationSettings
from seal_friction_ros.core.estimation.configuration import PLACEHOLDER_WARNING, SealSelection, parse_snapshot
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.friction_change import REFERENCE_REVERSALS
from seal_friction_ros.core.estimation.node_options import FRICTION_ESTIMATOR_PARAMETERS, ROS_PARAMETERS
from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.records import Velocity
from seal_friction_ros.files import default_configuration, load_parameter_file
from seal_friction_ros.nodes.friction_estimator import FrictionEstimator
from seal_friction_ros.offline.bags.actuator_bag import find_topics
from seal_friction_ros.offline.bags.bag import bag_topics, read_messages
from seal_friction_ros.offline.replay.replay import replay
from seal_friction_ros.offline.replay.shared_replay import stretches_of, verify_stretches

SECOND = 10**9  # [ns]
INTEGER, DOUBLE, STRING_ARRAY = 2, 3, 9  # rcl_interfaces/ParameterType


def double(name: str, value: float) -> Parameter:
    return Parameter(name=name, value=ParameterValue(type=DOUBLE, double_value=value))


def transition(number: int) -> ChangeState.Request:
    return ChangeState.Request(transition=Transition(id=number))


def test_each_velocity_sample_is_answered_by_an_estimate_with_its_header():
    with graph() as g:
        g.connect()
        friction = actuator_friction(default_configuration().parameters().estimator.seals, 2e6, 2e6)
        estimate = g.estimate(5 * SECOND + 7, 0.1, pressure=2e6, force=friction.coulomb_friction)
        assert (estimate.header.stamp.sec, estimate.header.stamp.nanosec, estimate.header.frame_id) == (5, 7, 'rod')
        assert estimate.coulomb_friction == estimate.friction_force == friction.coulomb_friction
        new_run = math.hypot(NEW_RUN * friction.coulomb_friction, friction.coulomb_friction_std)
        assert estimate.coulomb_friction_std == pytest.approx(new_run)  # nothing is learnt yet
        assert (estimate.state, estimate.direction, estimate.status) == (FrictionEstimate.SLIDING, 1, 0)


def test_stamps_of_1970_are_marked_and_warned_of():
    with graph({'stamp_age_max': EstimatorSettings().stamp_age_max}) as g:
        g.connect()
        assert g.estimate(SECOND, 0.1).status == FrictionEstimate.STAMP_AGE
        assert g.spin_until(lambda: 'STAMP_AGE' in g.probe.values('estimate').get('message', ''))
        assert g.probe.values('estimate')['level'] == '1'
        assert g.estimate(time.time_ns(), 0.1).status == 0


@pytest.mark.parametrize('malformed', [False, True])
def test_timers_for_which_the_executor_has_no_time_are_called_after_a_message(
    malformed: bool, monkeypatch: pytest.MonkeyPatch
):
    """It takes the messages that wait first, so nobody spins here."""
    called: list[str] = []
    with graph() as g:
        g.connect()
        for name in ('publish_diagnostics', 'on_watchdog'):
            monkeypatch.setattr(g.estimator, name, partial(called.append, name))
        end = time.monotonic() + STOP_TIMEOUT
        for number in count(1):
            data = b'' if malformed else encode(Velocity(number * 10**6, 0.0, b'rod'))
            g.estimator.on_input('rod_velocity', data, 0)
            if called.count('publish_diagnostics') >= 2 and called.count('on_watchdog') >= 5:
                break
            assert time.monotonic() < end, called


def test_a_clock_that_is_set_changes_no_time_of_receipt_and_what_was_recorded_verifies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    step = 0
    clocks = {name: getattr(time, name) for name in ('monotonic', 'monotonic_ns', 'perf_counter_ns', 'sleep')}
    set_clock = SimpleNamespace(time_ns=lambda: time.time_ns() + step, **clocks)
    monkeypatch.setattr('seal_friction_ros.nodes.estimator_node.time', set_clock)
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    with graph({'stamp_age_max': EstimatorSettings().stamp_age_max, **recording}) as g:
        g.connect()
        take = g.estimator.on_input
        g.estimator.on_input = lambda name, data, late: take(name, data, late - step)  # senders have the same clock
        assert g.estimate(time.time_ns(), 0.1).status == 0
        for number, step in enumerate((100 * SECOND, -100 * SECOND), 2):
            assert g.spin_until(lambda number=number: len(g.probe.configurations) == number)
            estimate = g.estimate(time.time_ns() + step, 0.1)
            assert estimate.status == (FrictionEstimate.STAMP_NOT_INCREASING if step < 0 else 0)
        g.estimator.finish()
    times = [message.log_time for message in read_messages(tmp_path / 'bag')]
    assert times == sorted(times)
    assert times[-1] - times[0] < 100 * SECOND
    assert replay(tmp_path / 'bag').identical


def test_a_rod_at_rest_is_stuck_or_breaks_away():
    with graph() as g:
        g.connect()
        stuck = g.estimate(SECOND, 0.0, force=-5.0)
        assert (stuck.state, stuck.direction, stuck.friction_force) == (FrictionEstimate.STUCK, -1, -5.0)
        broken = g.estimate(SECOND + 1, 0.0, force=500.0)
        assert (broken.state, broken.friction_force) == (FrictionEstimate.BREAKAWAY, broken.breakaway_force)


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, 1e300])
def test_bad_inputs_give_a_status_bit_a_finite_estimate_and_a_count_in_diagnostics(bad: float):
    with graph() as g:
        g.connect()
        g.estimate(SECOND, 0.1)
        for bits, sent in (
            (FrictionEstimate.PRESSURE_NOT_FINITE | FrictionEstimate.PRESSURE_OUT_OF_RANGE, {'pressure': bad}),
            (FrictionEstimate.FORCE_NOT_FINITE | FrictionEstimate.FORCE_OUT_OF_RANGE, {'force': bad}),
            (FrictionEstimate.VELOCITY_NOT_FINITE | FrictionEstimate.VELOCITY_OUT_OF_RANGE, {'velocity': bad}),
        ):
            estimate = g.estimate(SECOND + 10**6, **{'velocity': 0.1, **sent})
            assert estimate.status & bits
            numbers = (estimate.coulomb_friction, estimate.friction_force, estimate.breakaway_force, estimate.input_age)
            assert all(math.isfinite(number) for number in numbers)
        kind = 'NOT_FINITE' if not math.isfinite(bad) else 'OUT_OF_RANGE'
        assert g.spin_until(lambda: g.probe.values('estimate').get(f'estimates VELOCITY_{kind}') == '1')
        assert g.estimate(SECOND + 2 * 10**6, 0.1).status == 0


def test_diagnostics_come_once_a_second_with_rates_ages_latency_and_recorder_state():
    with graph() as g:
        g.connect()
        force = g.estimate(SECOND, 0.1).coulomb_friction
        for i in range(1, 20):
            g.estimate(SECOND + i * 10**7, 0.1, force=force)
        assert g.spin_until(lambda: g.probe.values('estimate').get('rod_velocity received') == '20')
        values = g.probe.values('estimate')
        assert float(values['rod_velocity rate [Hz]']) > 1.0
        assert 0.0 < float(values['latency p50 [us]']) <= float(values['latency p99 [us]'])
        assert float(values['input age [s]']) >= 0.0
        assert values['estimates all good'] == '10'  # the first ten have MOTION_UNCERTAIN
        assert g.probe.values('recorder')['message'] == 'not recording'
        assert SECOND in [timer.timer_period_ns for timer in g.estimator.timers]
        count = len(g.probe.diagnostics)
        assert g.spin_until(lambda: len(g.probe.diagnostics) > count + 1)


def test_lifecycle_services_start_and_stop_it():
    with graph(autostart=False) as g:
        state = g.call(GetState, 'friction_estimator/get_state', GetState.Request()).current_state
        assert state.label == 'unconfigured'
        for number in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            assert g.call(ChangeState, 'friction_estimator/change_state', transition(number)).success
            g.spin_until(lambda: False, 0.1)  # the watchdog is called while the node is inactive, too
        g.connect()
        assert g.estimate(SECOND, 0.1).state == FrictionEstimate.SLIDING
        assert g.call(
            ChangeState, 'friction_estimator/change_state', transition(Transition.TRANSITION_DEACTIVATE)
        ).success
        before, taken = len(g.probe.estimates), g.estimator.taken
        g.probe.send(2 * SECOND, 0.1)
        assert g.spin_until(lambda: g.estimator.taken == taken + 3)
        assert g.estimator.sent == before
        for number in (
            Transition.TRANSITION_CLEANUP,
            Transition.TRANSITION_CONFIGURE,
            Transition.TRANSITION_ACTIVATE,
        ):
            assert g.call(ChangeState, 'friction_estimator/change_state', transition(number)).success
        g.connect()
        assert g.estimate(3 * SECOND, -0.1).direction == -1


def test_a_timer_that_was_due_before_a_cleanup_does_nothing_after_it():
    with graph() as g:
        due = [timer.callback for timer in g.estimator.timers]
        assert len(due) == 5  # diagnostics, ticks, watchdog with the graph, health, inputs
        g.estimator.trigger_deactivate()
        g.estimator.trigger_cleanup()
        for callback in due:
            callback()


def test_settings_change_while_running_and_the_new_configuration_is_published():
    with graph() as g:
        g.connect()
        assert g.estimate(SECOND, 0.005).state == FrictionEstimate.SLIDING
        request = SetParametersAtomically.Request(
            parameters=[double('slip_velocity', 0.02), double('stick_velocity', 0.01)]
        )
        assert g.call(
            SetParametersAtomically, 'friction_estimator/set_parameters_atomically', request
        ).result.successful
        assert g.estimate(2 * SECOND, 0.005).state == FrictionEstimate.STUCK
        assert g.spin_until(lambda: len(g.probe.configurations) == 2)
        assert json.loads(g.probe.configurations[-1].json)['settings']['stick_velocity'] == 0.01


@pytest.mark.parametrize(
    ('parameters', 'words'),
    [
        ([double('stick_velocity', 0.5)], ['slip_velocity', '0.002', 'stick_velocity', '0.5']),
        ([double('force_max', 2e6), double('pressure_timeout', -1.0)], ['pressure_timeout', '-1.0', '0.001']),
        ([double('force_max', math.nan)], ['force_max', 'nan']),
        (
            [Parameter(name='seals', value=ParameterValue(type=STRING_ARRAY, string_array_value=['x', 'y']))],
            ['seals', 'unconfigured'],
        ),
    ],
)
def test_invalid_changes_are_rejected_as_a_whole_with_the_reason(parameters: list[Parameter], words: list[str]):
    with graph() as g:
        request = SetParametersAtomically.Request(parameters=parameters)
        result = g.call(SetParametersAtomically, 'friction_estimator/set_parameters_atomically', request).result
        assert not result.successful
        assert [word for word in words if word not in result.reason] == []
        assert g.estimator.get_parameter('force_max').value == EstimatorSettings().force_max


def test_parameters_carry_unit_bounds_and_description():
    with graph() as g:
        request = DescribeParameters.Request(names=['pressure_timeout', 'seals'])
        timeout, seals = g.call(DescribeParameters, 'friction_estimator/describe_parameters', request).descriptors
        assert timeout.description.endswith('[s]')
        assert timeout.floating_point_range[0].to_value == 1.0
        assert 'unconfigured' in seals.additional_constraints


@pytest.mark.parametrize(
    ('parameters', 'words'),
    [
        ({'pressure_timeout': -1.0}, ['pressure_timeout', '-1.0', '0.001']),
        ({'pressure_timeout': 'soon'}, ['pressure_timeout', 'soon']),
        ({'pressure_timeout': 2}, ['pressure_timeout', '2.0', '1.0']),
        ({'use_stiction': 1}, ['use_stiction', '1']),
        ({'record_split_size': 1e7}, ['record_split_size', '10000000.0']),
    ],
)
def test_an_invalid_parameter_override_prevents_the_start(parameters: dict[str, object], words: list[str]):
    with pytest.raises(ValueError) as error, graph(parameters):
        pass
    assert [word for word in words if word not in str(error.value)] == []
    assert '\n' not in str(error.value)


def test_a_whole_number_is_a_number_at_the_start_and_while_running():
    """``ros2 param set /friction_estimator feedforward.force_limit 0`` takes the force out."""
    with graph({'force_max': 500}) as g:
        assert g.estimator.get_parameter('force_max').value == 500.0
        whole = ParameterValue(type=INTEGER, integer_value=0)
        changes = [Parameter(name='feedforward.force_limit', value=whole)]
        for kind, name in ((SetParameters, 'set_parameters'), (SetParametersAtomically, 'set_parameters_atomically')):
            assert g.estimator.set_parameters([RclpyParameter('feedforward.force_limit', value=9.0)])[0].successful
            response = g.call(kind, f'friction_estimator/{name}', kind.Request(parameters=changes))
            assert 'successful=True' in str(response)
            found = g.estimator.get_parameter('feedforward.force_limit')
            assert (found.value, found.type_) == (0.0, RclpyParameter.Type.DOUBLE)
        assert g.spin_until(lambda: json.loads(g.probe.configurations[-1].json)['feedforward']['force_limit'] == 0.0)
        refused = g.estimator.set_parameters([RclpyParameter('record_split_size', value=1e7)])[0]
        assert not refused.successful  # a whole number stays one


def test_the_seals_change_by_single_parameters_while_the_node_is_unconfigured():
    with graph(autostart=False) as g:
        for seals, mounted in (
            (['ms28775_114@a'], [('ms28775_114', 'a')]),
            (['delft_o_ring@b', 'ms28775_114@difference'], [('delft_o_ring', 'b'), ('ms28775_114', 'difference')]),
            (['ms28775_114', 'ms28775_114'], [('ms28775_114', 'a'), ('ms28775_114', 'b')]),
        ):
            assert g.estimator.set_parameters([RclpyParameter('seals', value=seals)])[0].successful
            assert g.estimator.trigger_configure() == TransitionCallbackReturn.SUCCESS
            selection = g.estimator.machine.actuators[0].configuration.selection
            assert list(zip(selection.seals, selection.seal_chambers, strict=True)) == mounted
            assert g.estimator.trigger_cleanup() == TransitionCallbackReturn.SUCCESS


def test_an_unknown_parameter_is_logged_with_a_suggestion(capfd):
    with graph({'stick_velocty': 0.5, 'wave': 'sine'}):
        logged = capfd.readouterr().err
        assert 'no parameter stick_velocty (did you mean stick_velocity?), wave (a parameter of servo_sim' in logged


@pytest.mark.parametrize(
    'name', ['feedfoward.scale', 'Feed_Forward.scale', 'feedforward.scal', 'feedforwardscale', 'scale', 'boom.scale']
)
def test_a_mistyped_off_switch_ends_the_start(name: str):
    """Who typed it believes that the force is off."""
    with pytest.raises(ValueError, match=f'no parameter {re.escape(name)}') as error, graph({**LIVE, name: 0.0}):
        pass
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('nested', [False, True])
def test_every_parameter_of_the_node_is_accepted_in_a_parameter_file(nested: bool, tmp_path: Path):
    with graph(DEFAULTS) as g:
        names = g.estimator.list_parameters([], 0).names
        values = {name: g.estimator.get_parameter(name).value for name in names}
    assert {'realtime_priority', 'refuse_second_publisher', 'use_sim_time', 'feedforward.lead_time'} <= values.keys()
    assert any(name.startswith('qos_overrides./rod_velocity.') for name in values)
    tree: dict[str, object] = {}
    for name, value in values.items():
        *branches, leaf = name.split('.') if nested else [name]
        branch = tree
        for key in branches:
            branch = branch.setdefault(key, {})
        branch[leaf] = value
    path = tmp_path / 'parameters.yaml'
    path.write_text(yaml.safe_dump({'/friction_estimator': {'ros__parameters': tree}}))
    assert load_parameter_file(path) == (
        SealSelection(),
        EstimatorSettings(),
        FeedForwardSettings(),
        AdaptationSettings(),
    )


def test_names_are_relative_so_namespaces_and_remapping_work():
    arguments = ('-r', '__ns:=/left', '-r', 'rod_velocity:=piston/speed', '-r', 'friction_estimate:=out')
    with graph(arguments=arguments, namespace='/left') as g:
        names = {name for name, _ in g.estimator.get_publisher_names_and_types_by_node('friction_estimator', '/left')}
        assert {'/left/out', '/left/friction_estimator/configuration', '/diagnostics'} <= names
        inputs = {name for name, _ in g.estimator.get_subscriber_names_and_types_by_node('friction_estimator', '/left')}
        assert {'/left/piston/speed', '/left/cylinder_pressure', '/left/force_sum'} <= inputs


def test_quality_of_service_can_be_overridden():
    with graph({'qos_overrides./rod_velocity.subscription.depth': 7}) as g:
        infos = g.probe.get_subscriptions_info_by_topic('/rod_velocity')
        assert g.spin_until(lambda: g.probe.get_subscriptions_info_by_topic('/rod_velocity')) or infos
        assert g.estimator.get_parameter('qos_overrides./rod_velocity.subscription.depth').value == 7


def test_a_recording_started_by_service_during_motion_replays_bit_for_bit(tmp_path: Path):
    with graph({'record_directory': str(tmp_path)}) as g:
        g.connect()
        for i in range(5):
            g.estimate(SECOND + i * 10**6, 0.0015 if i else 0.1, force=3.0)
        started = g.call(Trigger, 'friction_estimator/start_recording', Trigger.Request())
        assert started.success
        assert not g.call(Trigger, 'friction_estimator/start_recording', Trigger.Request()).success
        for i in range(5, 10):
            g.estimate(SECOND + i * 10**6, 0.0015, force=math.nan if i == 7 else 3.0)
        assert g.call(Trigger, 'friction_estimator/stop_recording', Trigger.Request()).success
        assert not g.call(Trigger, 'friction_estimator/stop_recording', Trigger.Request()).success
        g.estimator.finish()
    assert replay(Path(started.message)).identical


def test_a_parameter_change_during_a_recording_replays_bit_for_bit(tmp_path: Path):
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    with graph(recording) as g:
        g.connect()
        g.estimate(SECOND, 0.003)
        request = SetParametersAtomically.Request(
            parameters=[double('slip_velocity', 0.02), double('stick_velocity', 0.01)]
        )
        assert g.call(
            SetParametersAtomically, 'friction_estimator/set_parameters_atomically', request
        ).result.successful
        assert g.estimate(2 * SECOND, 0.003).state == FrictionEstimate.STUCK
        g.estimator.finish()
    assert bag_topics(tmp_path / 'bag')['/friction_estimator/configuration'].message_count == 2
    assert replay(tmp_path / 'bag').identical


@pytest.mark.long  # two processes compile; `test_shared_replay.py` has bags with states
def test_a_recording_holds_states_between_which_it_verifies_by_itself(tmp_path: Path):
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag', 'record_state_period': 0.5}
    with graph(recording) as g:
        g.connect()
        bag, number = tmp_path / 'bag', 0
        end = time.monotonic() + 1.6  # [s]
        while time.monotonic() < end:
            g.estimate(SECOND + number * 10**6, 0.003 * (1 if number // 50 % 2 else -1), force=3.0)
            number += 1
        g.estimate(SECOND + number * 10**6, 0.003)
        g.estimator.finish()
    states = bag_topics(bag)['/friction_estimator/state'].message_count
    assert states >= 3
    assert len(stretches_of(bag, find_topics(bag), states + 5)) == states + 1
    assert verify_stretches(bag, find_topics(bag), 2) == replay(bag)
    assert replay(bag).identical


def test_a_bag_is_never_overwritten_and_the_estimate_continues(tmp_path: Path, capfd):
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'precious').write_text('data')
    with graph({'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}) as g:
        g.connect()
        assert g.estimate(SECOND, 0.1).state == FrictionEstimate.SLIDING
        assert g.spin_until(lambda: 'exists already' in g.probe.values('recorder').get('message', ''))
        assert g.probe.values('recorder')['level'] == '2'
        assert g.spin_until(lambda: len(g.probe.diagnostics) > 2)
        assert capfd.readouterr().err.count('exists already') == 1  # once in the log, not once a second
    assert [path.name for path in (tmp_path / 'bag').iterdir()] == ['precious']


def test_an_invalid_seal_file_prevents_the_start_and_the_log_names_the_field(tmp_path: Path, capfd):
    seal = tmp_path / 'seal.yaml'
    text = ROOT.joinpath('config/seals/ms28775_114.yaml').read_text()
    seal.write_text(text.replace('exponent: 0.562321', 'exponent: 1.7'))
    with graph({'seals': [str(seal)], 'seal_chambers': ['a']}, autostart=False) as g:
        assert not g.estimator.autostart()
        said = [line for line in capfd.readouterr().err.splitlines() if 'exponent' in line]
        assert len(said) == 1
        assert str(seal) in said[0]
        assert '1.7' in said[0]
        assert '0.99' in said[0]
        assert g.probe.count_publishers('friction_estimate') == 0


@pytest.mark.parametrize(('seals', 'warnings'), [({}, 1), ({'seals': ['ms28775_114'], 'seal_chambers': ['a']}, 0)])
def test_placeholder_seals_are_a_warning_in_the_log(seals: dict[str, object], warnings: int, capfd):
    with graph(seals):
        assert capfd.readouterr().err.count('the seals are the placeholder of the default configuration') == warnings


def test_placeholder_seals_make_no_force_and_a_scale_is_rejected_with_the_reason():
    with graph({'feedforward.scale': SCALE}) as g:
        assert g.estimator.machine.actuators[0].configuration.feedforward.scale == 0.0
        for value, is_accepted in ((0.5, False), (1e-3, False), (0.0, True)):
            (result,) = g.estimator.set_parameters([RclpyParameter('feedforward.scale', value=value)])
            assert result.successful is is_accepted
            assert (PLACEHOLDER_WARNING in result.reason) is not is_accepted
        assert g.estimator.machine.actuators[0].configuration.feedforward.scale == 0.0
        assert g.estimator.trigger_deactivate() == TransitionCallbackReturn.SUCCESS
        assert g.estimator.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
        changes = {'seals': list(REAL_SEALS), 'feedforward.scale': SCALE}
        for name, value in changes.items():
            assert g.estimator.set_parameters([RclpyParameter(name, value=value)])[0].successful
        assert g.estimator.autostart()
        assert g.estimator.machine.actuators[0].configuration.feedforward.scale == SCALE


def test_the_node_declares_the_parameters_of_its_table_and_no_other():
    with graph() as g:
        answer = g.call(ListParameters, 'friction_estimator/list_parameters', ListParameters.Request())
        declared = {name for name in answer.result.names if name.split('.')[0] not in ROS_PARAMETERS}
        assert declared == {name for group in FRICTION_ESTIMATOR_PARAMETERS for name in group.names()}
        assert isinstance(g.estimator, FrictionEstimator)


def test_what_is_learnt_is_in_diagnostics_and_a_reset_forgets_it():
    with graph({'adaptation.mode': 'observe'}) as g:
        g.connect()
        g.estimate(SECOND, 0.005)
        assert g.call(Trigger, 'friction_estimator/reset_adaptation', Trigger.Request()).success
        assert g.spin_until(lambda: len(g.probe.configurations) == 2)
        assert parse_snapshot(g.probe.configurations[-1].json).state.estimator.adaptation == NOT_ADAPTED
        values = {item.key: item.value for item in g.estimator.diagnostics()['estimate'].values}
        assert values['adaptation mode'] == 'observe'
        assert values['adaptation scale std'] == 'not learnt'


def test_the_ends_of_strokes_are_followed_and_a_reset_forgets_them():
    with graph({'adaptation.mode': 'observe', 'stamp_age_max': 0.0}) as g:
        g.connect()
        for i in range(1200):  # 24 strokes of a second, 5 cm/s
            side = 1.0 if i // 50 % 2 else -1.0
            g.estimate(SECOND + 20 * i * 10**6, side * 0.05, force=40.0 * side)
        assert int(reported(g)['reversals learnt from']) >= REFERENCE_REVERSALS
        assert reported(g)['scale over that of the first reversals'] != 'none'
        assert g.call(Trigger, 'friction_estimator/reset_adaptation', Trigger.Request()).success
        assert reported(g)['reversals learnt from'] == '0'
        assert reported(g)['scale over that of the first reversals'] == 'none'


def reported(g) -> dict[str, str]:
    """Values of the diagnostics of the estimate."""
    return {item.key: item.value for item in g.estimator.diagnostics()['estimate'].values}


def test_a_velocity_that_hums_on_a_rod_that_is_held_is_a_warning():
    with graph() as g:
        g.connect()
        for i in range(200):  # 20 mm/s at 10 Hz
            g.estimate(SECOND + 5 * i * 10**6, 0.02 * math.sin(2.0 * math.pi * i / 20.0 + 0.1), force=10.0)
        report = g.estimator.diagnostics()['estimate']
        assert report.level == DiagnosticStatus.WARN
        assert 'the force sum does not show it: hum' in report.message
