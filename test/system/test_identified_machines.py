"""A few machines of `identified_machines`: as good as least squares, and inside the band."""

import pytest
from identified_machines import MACHINES, MOST, WAYS, score


@pytest.mark.parametrize(
    'name',
    [
        'asymmetric',
        'pneumatic lip seals',
        *(
            pytest.param(each, marks=pytest.mark.long)
            for each in ('viscous', 'noisy', 'linear', 'pneumatic asymmetric')
        ),
    ],
)
def test_the_friction_of_other_motions_is_as_good_as_by_least_squares(name, tmp_path):
    (machine,) = (each for each in MACHINES if each.name == name)
    found = score(machine, WAYS['several'], 1, tmp_path)
    assert found.identify < max(MOST * found.squares, 0.005)  # half a percent is good enough
    assert found.inside >= 0.9


@pytest.mark.parametrize('name', ['run-in', pytest.param('stribeck', marks=pytest.mark.long)])
def test_what_a_line_over_speed_and_pressure_misses_is_found(name, tmp_path):
    """A drift over the log, and friction whose fall over the speed grows with the pressure."""
    (machine,) = (each for each in MACHINES if each.name == name)
    found = score(machine, WAYS['several'], 1, tmp_path)
    assert found.identify < min(0.02, 0.3 * found.squares)
    assert found.inside >= 0.9
