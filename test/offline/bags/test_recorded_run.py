"""A bag as arrays: the inputs of each estimate, and what is missing or cannot be a measurement."""

import numpy as np
import pytest
import yaml
from harness.compensation import compensating
from harness.example_bags import STEP, rewrite, write_inputs, write_recorded

from seal_friction_ros.core.estimation.strokes import LARGEST_INPUT
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.coder import decode, encode, type_of
from seal_friction_ros.core.messages.layouts import FORCE_TYPE, POSITION_TYPE, REFERENCE_TYPE, VELOCITY_TYPE
from seal_friction_ros.core.messages.records import Force, Status, Temperature, WatchdogTick
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.bags.bag import BagError
from seal_friction_ros.offline.bags.recorded_run import read_run
from seal_friction_ros.offline.replay.replay import chosen_configuration, replay


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    return write_recorded(tmp_path_factory.mktemp('bag'), compensating())


def test_each_estimate_has_the_inputs_that_were_held_with_it(recorded):
    run = read_run(recorded)
    assert (run.name, run.frames, run.chambers, run.start) == ('recorded', ('rod',), ('a', 'b'), 1_000_000_000)
    assert len(run.time) == 300
    assert run.time == pytest.approx(np.arange(300) * STEP * 1e-9)
    assert run.topics[b.VELOCITY_TOPIC] == (VELOCITY_TYPE, 300)
    assert run.position == pytest.approx(0.001 * np.arange(300))
    assert np.isnan(run.reference[:100]).all()
    assert run.reference[250] == pytest.approx(0.001 * 199)  # held after the last one
    assert run.pressure_a[57] == run.pressure_a[56]  # sample 57 has none of its own
    assert np.isnan(run.pressure_b[5])
    at_rest = (run.state == 3) & (np.abs(run.force_sum) < run.breakaway_force)
    assert at_rest.any()
    assert np.array_equal(run.friction_force[at_rest], run.force_sum[at_rest])
    (configuration,) = run.configurations
    assert configuration[0] < 0.0
    assert run.configuration_rows == (0,)


def test_ticks_of_the_watchdog_and_temperatures_are_no_configurations(recorded, tmp_path):
    """A bag of a node that stopped ends with ticks; its seals are those of its configuration all the same."""
    messages = list(b.read_messages(recorded))
    end = messages[-1].log_time
    with b.BagWriter(tmp_path / 'bag') as writer:
        for message in messages:
            writer.write(*message)
        for record, topic in (
            (WatchdogTick(end, 0.1), '/watchdog_tick'),
            (Temperature(end, 40.0), '/seal_temperature'),
        ):
            writer.write(topic, type_of(record), end, encode(record, b''))
    run = read_run(tmp_path / 'bag')
    assert run.configurations == read_run(recorded).configurations
    assert [type(text) for _, text in run.configurations] == [str]
    assert run.chambers == ('a', 'b')


def test_feedforward_belongs_to_the_estimate_of_its_stamp(recorded):
    run = read_run(recorded)
    assert np.isnan(run.feedforward_force[:100]).all()
    assert np.isfinite(run.feedforward_force[100:200]).all()


def test_the_pressure_is_the_mean_over_the_seals(recorded, tmp_path):
    run = read_run(recorded)
    good = np.isfinite(run.pressure_b)
    assert run.pressure[good] == pytest.approx((run.pressure_a + run.pressure_b)[good] / 2.0)
    assert np.isnan(run.pressure[~good]).all()


def test_what_cannot_be_a_measurement_is_missing(recorded, tmp_path):
    def absurd(_, message):
        sample_number, stamp = (message.log_time - 1_000_000_000) // STEP, message.log_time // STEP * STEP
        if message.type_name == FORCE_TYPE and sample_number == 20:
            return message._replace(data=encode(Force(stamp, -LARGEST_INPUT)))
        if message.type_name == VELOCITY_TYPE and sample_number == 30:
            sample = decode(VELOCITY_TYPE, message.data)
            return message._replace(data=encode(sample._replace(velocity=1e6)))
        return message if message.type_name not in {POSITION_TYPE, REFERENCE_TYPE} else None

    inputs = rewrite(write_inputs(tmp_path / 'inputs'), tmp_path / 'absurd', absurd)
    replay(inputs, out=tmp_path / 'out')
    run = read_run(tmp_path / 'out')
    assert np.isnan(run.force_sum).nonzero()[0].tolist() == [20]
    assert run.status[30] & int(Status.VELOCITY_OUT_OF_RANGE)
    assert np.isnan(run.velocity).nonzero()[0].tolist() == [30]
    assert np.isnan(run.position).all()


def test_a_bag_without_estimates_says_to_replay_first(tmp_path):
    with pytest.raises(BagError, match=r'no estimates in it.*replay') as error:
        read_run(write_inputs(tmp_path / 'inputs'))
    assert '\n' not in str(error.value)


def test_a_message_that_is_damaged_is_named(recorded, tmp_path):
    def damaged(number, message):
        return message._replace(data=message.data[:10]) if message.type_name == FORCE_TYPE and number > 500 else message

    bag = rewrite(recorded, tmp_path / 'damaged', damaged)
    with pytest.raises(BagError, match=rf'message on {b.FORCE_TOPIC} at \d+ ns'):
        read_run(bag)


def test_the_force_sum_is_corrected_as_by_the_estimator_that_made_the_estimates(recorded, tmp_path):
    seal = tmp_path / 'seal.yaml'
    document = read_yaml(config_path('seals', 'ms28775_114'))
    correction = {'area_a': 2e-6, 'area_b': -1e-6, 'offset': 3.0}
    seal.write_text(yaml.safe_dump(document | {'force_sum_correction': correction}))
    replay(recorded, chosen_configuration(None, seal), tmp_path / 'out')
    assert replay(tmp_path / 'out').identical
    before, after = read_run(recorded), read_run(tmp_path / 'out')
    added = 2e-6 * before.pressure_a - 1e-6 * before.pressure_b + 3.0
    np.testing.assert_allclose(after.force_sum, before.force_sum + added)
    good = np.isfinite(after.force_sum) & (after.status == 0)
    stuck = good & (after.state == FrictionState.STUCK)
    assert stuck.any()
    np.testing.assert_allclose(after.friction_force[stuck], after.force_sum[stuck])


def test_the_pressure_at_a_piston_seal_is_the_difference(recorded, tmp_path):
    params = tmp_path / 'params.yaml'
    params.write_text('/**: {ros__parameters: {seals: [ms28775_114], seal_chambers: [difference]}}\n')
    replay(recorded, chosen_configuration(params, None), tmp_path / 'out')
    run = read_run(tmp_path / 'out')
    assert run.chambers == ('difference',)
    np.testing.assert_array_equal(run.pressure, np.abs(run.pressure_a - run.pressure_b))
