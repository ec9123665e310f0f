"""Sliding velocity at which the spring of the groove and the friction of the wall balance."""

import pytest

from seal_friction_studies.core.balance import sliding_velocity


@pytest.mark.parametrize('direction', [1.0, -1.0])
@pytest.mark.parametrize('fastest', [1e-3, 0.1, 10.0])
def test_seal_slides_at_the_speed_that_balances_spring_and_friction(direction, fastest):
    """10 N less 4 N of solid friction, over 20 Ns/m of the film and 40 Ns/m of the spring: 0.1 m/s."""
    velocity = sliding_velocity(
        10.0 * direction, 4.0, lambda v: 20.0 * v, lambda v: 10.0 * direction - 40.0 * v, fastest
    )
    assert velocity == pytest.approx(0.1 * direction, rel=1e-6)


def test_seal_that_nothing_holds_has_no_sliding_velocity():
    with pytest.raises(ValueError, match=r'no sliding velocity below .* m/s balances 10 N: is the seal held at all\?'):
        sliding_velocity(10.0, 4.0, lambda _: 0.0, lambda _: 10.0, 1e-3)


@pytest.mark.parametrize(('balance', 'is_found'), [(9.9e5, True), (1.01e6, False)])
def test_balance_is_sought_up_to_a_million_times_the_first_speed(balance, is_found):
    """6 N over the film, from 1 m/s on."""
    sought = (10.0, 4.0, lambda v: 6.0 * v / balance, lambda _: 10.0, 1.0)
    if is_found:
        assert sliding_velocity(*sought) == pytest.approx(balance)
    else:
        with pytest.raises(ValueError, match=r'no sliding velocity below 1e\+06'):
            sliding_velocity(*sought)
