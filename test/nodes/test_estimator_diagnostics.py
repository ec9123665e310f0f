"""Counts of the running estimator."""

import numpy as np
import pytest

from seal_friction_ros.nodes.estimator_diagnostics import MissingSamples

PERIOD = 1_000_000  # [ns]


@pytest.mark.parametrize('seed', range(20))
@pytest.mark.parametrize('loss', [0.0, 0.2, 0.5])
def test_samples_lost_in_bursts_are_counted_from_the_first_samples_on(loss, seed):
    chance, missing, lost = np.random.default_rng(seed), MissingSamples(), 0
    number = last = 1
    missing.on_stamp(number * PERIOD)
    for _ in range(500):
        burst = int(chance.exponential(4.0)) if chance.random() < loss / 4.0 else 0
        number += 1 + burst
        missing.on_stamp(number * PERIOD + int(chance.uniform(-0.01, 0.01) * PERIOD))
        lost += number - last - 1
        last = number
    assert missing.count == lost
