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
            for each in ('run-in', 'viscous', 'noisy', 'pneumatic asymmetric')
        ),
    ],
)
def test_the_friction_of_other_motions_is_as_good_as_by_least_squares(name, tmp_path):
    (machine,) = (each for each in MACHINES if each.name == name)
    found = score(machine, WAYS['several'], 1, tmp_path)
    assert found.identify < max(MOST * found.squares, 0.005)  # half a percent is good enough
    assert found.inside >= 0.9
