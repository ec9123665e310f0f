"""Motions in which an actuator was measured: those of every seal, up to a tenth beyond the speeds."""

import math

import pytest

from seal_friction_ros.core.friction.identified_motion import ANY_MOTION, IdentifiedMotion, motion_limits


def test_a_motion_that_one_seal_was_not_measured_in_is_marked_for_the_actuator():
    both = motion_limits([IdentifiedMotion(0.02, 0.5), IdentifiedMotion(0.01, 0.2, (1,))])
    assert both == (pytest.approx(0.018), pytest.approx(0.22), True, False)
    other = motion_limits([IdentifiedMotion(0.0, 0.2, (-1,)), IdentifiedMotion(0.01, 0.5)])
    assert other == (pytest.approx(0.009), pytest.approx(0.22), False, True)
    neither = motion_limits([IdentifiedMotion(directions=(-1,)), IdentifiedMotion(directions=(1,))])
    assert (neither.extends, neither.retracts) == (False, False)


def test_a_seal_that_tells_nothing_was_measured_in_any_motion_up_to_a_kilometre_a_second():
    assert motion_limits([ANY_MOTION]) == (0.0, pytest.approx(1100.0), True, True)
    assert motion_limits([ANY_MOTION, IdentifiedMotion(0.1, 0.1)]) == (
        pytest.approx(0.09),
        pytest.approx(0.11),
        True,
        True,
    )


@pytest.mark.parametrize(
    ('motion', 'complaint'),
    [
        ({'slowest': -5e-324}, 'slowest = -5e-324 m/s is below its lower bound 0.0 m/s'),
        ({'slowest': math.nextafter(1e3, 2e3)}, 'slowest = 1000.0000000000001 m/s is above its upper bound 1000.0'),
        ({'fastest': math.nextafter(1e-9, 0.0)}, 'm/s is below its lower bound 1e-09 m/s'),
        ({'fastest': math.nextafter(1e3, 2e3)}, 'fastest = 1000.0000000000001 m/s is above its upper bound 1000.0'),
        ({'slowest': 0.2, 'fastest': 0.1}, 'fastest = 0.1 m/s is below slowest = 0.2 m/s'),
        ({'directions': (1, -1, 1)}, r'directions = \[1, -1, 1\] is not \[-1\], \[1\] or \[-1, 1\]'),
    ],
)
def test_a_motion_that_cannot_be_is_refused(motion, complaint):
    with pytest.raises(ValueError, match=complaint):
        IdentifiedMotion(**motion)


def test_the_slowest_and_the_fastest_motion_there_can_be():
    assert IdentifiedMotion(slowest=0.0, fastest=1e-9, directions=(-1,)).fastest == 1e-9
    assert IdentifiedMotion(slowest=1e3, fastest=1e3, directions=(1, -1)).slowest == 1e3
