"""What a record says where nothing was measured."""

from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.estimation.records import NO_TEMPERATURE, RodSample, SealTemperature
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import (
    EXTRAPOLATED,
    NEVER,
    NO_ESTIMATE,
    NO_FORCE,
    NO_PRESSURE,
    FrictionEstimate,
    ServoReference,
    Status,
    Temperature,
    Velocity,
    WatchdogTick,
)


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 10**9 - 1))
def test_no_stamp_of_a_message_is_never_and_it_is_a_64_bit_integer(seconds, nanoseconds):
    assert seconds * 10**9 + nanoseconds > NEVER
    assert NEVER.to_bytes(8, 'little', signed=True)


def test_before_the_first_estimate_there_is_no_force_no_state_and_no_input():
    assert (
        FrictionEstimate(
            stamp=NEVER,
            coulomb_friction=0.0,
            coulomb_friction_std=0.0,
            breakaway_force=0.0,
            friction_force=0.0,
            state=FrictionState.UNKNOWN,
            direction=0,
            status=0,
            input_age=-1.0,
            adaptation_scale=1.0,
            adaptation_scale_std=0.0,
            adaptation_offset=0.0,
            residual=0.0,
            friction_force_std=-1.0,
        )
        == NO_ESTIMATE
    )


def test_what_was_never_measured_is_zero():
    assert NO_PRESSURE == (NEVER, 0.0, 0.0)
    assert NO_FORCE == (NEVER, 0.0)
    assert SealTemperature(NEVER, 0.0, NEVER, 0.0, 0.0) == NO_TEMPERATURE
    assert Temperature(5, 20.0).variance == 0.0


def test_a_sample_is_accepted_and_of_this_moment_unless_it_is_said_otherwise():
    sample = RodSample(5, 0.1, NO_PRESSURE, NO_FORCE)
    assert (sample.refused, sample.stamp_age, sample.temperature) == (False, 0.0, NO_TEMPERATURE)
    assert (
        Velocity(5, 0.1).frame_id == ServoReference(5, 0.1, 0.0, 0.0).frame_id == WatchdogTick(5, 0.1).frame_id == b''
    )


def test_good_inputs_outside_what_the_law_was_identified_with_are_extrapolated():
    extrapolated = {bit for bit in Status if bit in EXTRAPOLATED}
    assert extrapolated == {bit for bit in Status if 'IDENTIFIED' in bit.name}
