"""Encoders and rounded set points, shorter than the campaign; and a clean reference, which goes through unchanged."""

import numpy as np
import pytest
from system.encoders import ANGULAR_RATE, PARAMETERS, SCALE, SMOOTHING, all_cases, answers_of


@pytest.mark.parametrize('case', range(len(list(all_cases(6.0)))))
def test_no_reversal_and_no_wrong_friction_that_is_called_good(case):
    found = list(all_cases(6.0))[case]()
    assert found.holds, found


@pytest.mark.parametrize('amplitude', [2e-3, 5e-2])
def test_a_clean_sine_is_delayed_by_two_samples_at_most(amplitude):
    time = np.arange(0.0, 3.0, 1e-3)
    reference = amplitude * ANGULAR_RATE * np.cos(ANGULAR_RATE * time)
    acceleration = -amplitude * ANGULAR_RATE**2 * np.sin(ANGULAR_RATE * time)
    found = answers_of(PARAMETERS, 1000.0, np.zeros_like(time), np.zeros_like(time), reference, acceleration)
    led = reference + PARAMETERS.feedforward.lead_time * acceleration
    expected = SCALE * found.coulomb * np.tanh(led / SMOOTHING)
    expected[led * reference <= 0.0] = 0.0  # the lead takes force away before a reversal, it never reverses it
    settled = time > 0.5
    steepest = np.abs(np.diff(SCALE * found.coulomb * np.tanh(reference / SMOOTHING))).max()
    assert np.abs(found.force - expected)[settled].max() < 2.0 * steepest + 1e-6
