"""What is known of a number from other meshes: it is marked where they change it, and where none can be computed."""

import numpy as np
import pytest

from seal_friction_ros.offline.contact.mesh_levels import change_of, mesh_levels

PRESSURES = (0.0, 1e5)


def levels(by_lines: dict[int, dict]):
    """Numbers on 33 lines beside those of 23 and 46 lines."""

    def compute(lines: int) -> dict:
        if lines not in by_lines:
            raise ValueError('told to')
        return by_lines[lines]

    return mesh_levels(33, PRESSURES, by_lines[33], compute)


def test_a_second_order_number_has_the_change_on_the_finer_mesh():
    """N = 10 (1 + 20 / n^2): from 33 to 46 lines it falls by 0.9 %."""
    found = levels({n: {'force': tuple(10.0 * (1.0 + 20.0 / n**2) for _ in PRESSURES)} for n in (23, 33, 46)})
    assert found.lines == (23, 33, 46)
    assert found.change['force'] == pytest.approx((0.0088, 0.0088), rel=0.1)
    assert found.marked == []
    assert found.text == 'Mesh: 33 lines; 46 change no number by more than 0.95 %.'


def test_two_meshes_that_agree_by_chance_do_not_hide_the_third():
    assert change_of(np.array([1.1]), np.array([1.0]), np.array([1.001])) == pytest.approx(0.05)


def test_without_the_finer_mesh_the_coarser_one_counts_in_full_and_without_both_nothing_is_known():
    found = levels({23: {'force': (1.04, 1.0)}, 33: {'force': (1.0, 1.0)}})
    assert found.change['force'] == pytest.approx((0.04, 0.0))
    alone = levels({33: {'force': (1.0, 1.0), 'gain': 0.4}})
    assert alone.change == {'force': (np.inf, np.inf), 'gain': (np.inf,)}
    assert len(alone.marked) == 2


def test_what_changes_by_more_than_3_percent_is_named_with_its_place_and_above_5_not_converged():
    numbers = {'force': (1.0, 1.0), 'gain': 1.0, 'film': (None, 1.0), 'absent': None}
    finer = {'force': (1.01, 1.04), 'gain': 1.02, 'film': (1.0, 1.0), 'absent': None}
    found = levels({23: numbers, 33: numbers, 46: finer})
    assert found.marked == ['force by 4 % at 1 bar']
    assert set(found.change) == {'force', 'gain', 'film'}
    assert found.text == 'Mesh: 33 lines; 23 or 46 change by MORE THAN 3 %: force by 4 % at 1 bar.'
    assert 'not converged' in levels({23: numbers, 33: numbers, 46: finer | {'gain': 1.06}}).text
