"""The campaign of the adaptation, with few seeds."""

import pytest
from system.adaptation_campaign import simulated


@pytest.mark.parametrize('kind', ['load steps', 'inertia', 'offset drift'])
def test_disturbances_move_the_scale_of_a_random_machine_by_less_than_5_percent(kind):
    assert max(simulated(kind, 45.0, seed)['worst'] for seed in range(100, 103)) < 0.05


def test_a_noisy_force_sensor_moves_the_scale_of_the_worst_of_1000_machines_by_less_than_5_percent():
    assert max(simulated('noise', 45.0, seed)['worst'] for seed in (54, *range(100, 103))) < 0.05


@pytest.mark.long  # `core/estimation/test_adaptation.py` has one machine
def test_a_drift_of_20_percent_is_followed_and_found_and_a_steady_friction_is_no_change():
    drifting = simulated('drift', 100.0, 100)
    assert drifting['worst'] < 0.05
    assert drifting['found'][0] <= 50
    assert not simulated('undisturbed', 200.0, 100)['found']
