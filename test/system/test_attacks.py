"""A short form of `attacks`: what is called good is right, whatever is done to the signals."""

import pytest
from attacks import ATTACKS, CLEAN, Machine, attacked, estimated, random_machine, strokes, with_friction

QUICK = (
    'offset of the friction',
    'friction times 1.6',
    'force of 40 N that nobody measures, on and off every 4 s',
    'friction drifts by 30 % in 5 s',
    'direction: 15% more, 15% less',
    'velocity zero of 3 mm/s on a rod held under 0 of the friction',
    'velocity zero of 3 mm/s',
    'vibration of 50 um at 300 Hz',
)


@pytest.mark.parametrize('mode', ['observe', 'on'])
@pytest.mark.parametrize(
    'name', [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in ATTACKS]
)
def test_at_most_one_good_sample_in_200_is_wrong(name, mode):
    assert attacked(name, mode, 40.0).wrong <= 0.005


@pytest.mark.parametrize('name', CLEAN)
def test_a_clean_machine_is_called_good(name):
    found = attacked(name, 'observe', 12.0)
    assert found.good > 0.9
    assert found.wrong <= 0.001


@pytest.mark.parametrize('mode', ['observe', 'on'])
def test_a_friction_that_doubles_within_strokes_is_in_the_band_and_leaves_most_samples_good(mode):
    """A step may be of load or of friction until the next reversal: the band holds both, and needs no mark."""
    rod = strokes(20.0)
    found = estimated(Machine(with_friction(rod, rod.friction * (1.0 + rod.time // 1.3 % 2))), mode)
    assert found.wrong <= 0.005
    assert found.good > 0.6


def test_a_random_machine_is_that_of_its_number():
    one, again = random_machine(7, 3.0), random_machine(7, 3.0)
    assert one.name == again.name
    assert (one.rod.force_sum == again.rod.force_sum).all()
    assert one.name != random_machine(8, 3.0).name
