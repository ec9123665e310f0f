"""The feed-forward never acts against the wanted velocity: 500 of the cases of the campaign."""

from system.feedforward_sign import violations


def test_force_times_wanted_velocity_is_never_negative_and_scale_0_is_0_newton():
    assert [line for seed in range(500) for line in violations(seed)] == []
