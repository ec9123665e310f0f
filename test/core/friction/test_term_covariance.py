"""The covariance of the terms of a law in its seal file."""

import numpy as np
import pytest

from seal_friction_ros.core.friction.seal_file import parse_seal

SEAL = {
    'name': 'rod',
    'source': 'test',
    'coulomb_law': 'pressure_power_law',
    'pressure_power_law': {'friction_at_no_pressure': 4.0, 'friction_at_one_bar': 1.2, 'pressure_exponent': 0.7},
    'velocity_terms': {'viscous_friction': 20.0},
    'uncertainty': {'relative_std': 0.1},
    'identified_pressure': [0.0, 1e6],
}
TERMS = ['friction_at_no_pressure', 'friction_at_one_bar', 'viscous_friction']


def with_covariance(**changes):
    found = {'terms': TERMS, 'std': [0.5, 0.1, 3.0], 'correlation': [-0.8, 0.1, 0.2]}
    return parse_seal({**SEAL, 'covariance': found | changes}).covariance


def test_a_seal_file_tells_the_covariance_of_its_terms_and_need_not():
    covariance = with_covariance()
    assert covariance.terms == tuple(TERMS)
    assert covariance.matrix == pytest.approx(np.array([[0.25, -0.04, 0.15], [-0.04, 0.01, 0.06], [0.15, 0.06, 9.0]]))
    assert parse_seal(SEAL).covariance is None


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'std': [0.5, 0.1]}, 'std has 2 numbers, 3 terms need 3'),
        ({'std': [0.5, -0.1, 1.0]}, 'std'),
        ({'correlation': [0.1]}, 'correlation has 1 numbers, 3 terms need 3'),
        ({'correlation': [1.1, 0.0, 0.0]}, 'correlation'),
        ({'correlation': [0.9, 0.9, -0.9]}, 'no terms can correlate like this'),
        ({'terms': [TERMS[0], TERMS[0], TERMS[1]]}, 'name each term once'),
        ({'terms': [*TERMS[:2], 'coefficient']}, 'coefficient is no parameter of pressure_power_law'),
    ],
)
def test_a_covariance_that_cannot_be_is_refused_with_the_reason(changes, reason):
    with pytest.raises(ValueError, match=reason):
        with_covariance(**changes)
