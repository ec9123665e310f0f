"""Own GMRES."""

import numpy as np
import pytest

from seal_friction_ros.core.lubrication.contact import StalledError
from seal_friction_studies.core.krylov import gmres


def test_gmres_solves_and_says_when_it_cannot():
    matrix = np.diag(np.arange(1.0, 21.0)) + np.triu(np.full((20, 20), 0.1), 1)
    right = np.ones(20)
    assert matrix @ gmres(lambda x: matrix @ x, right, 1e-10, 40) == pytest.approx(right, abs=1e-10)
    with pytest.raises(StalledError, match=r'after 3 iterations'):
        gmres(lambda x: matrix @ x, right, 1e-10, 3)


def test_gmres_needs_as_many_products_as_the_matrix_has_different_eigenvalues():
    products = []

    def product(x):
        products.append(x)
        return np.array([2.0, 2.0, 5.0, 5.0]) * x

    assert gmres(product, np.array([2.0, 4.0, 5.0, 10.0]), 1e-12, 4) == pytest.approx([1.0, 2.0, 1.0, 2.0])
    assert len(products) == 2


def test_gmres_begins_at_zero_and_ends_there_if_that_will_do():
    def never(_):
        raise AssertionError

    assert gmres(never, np.array([3e-7, -4e-7]), 5e-7, 5).tolist() == [0.0, 0.0]


@pytest.mark.parametrize('factor', [np.nan, np.inf])
def test_gmres_gives_up_at_once_on_what_is_not_finite(factor):
    with np.errstate(invalid='ignore'), pytest.raises(StalledError, match='3 of 3 left after 1 iterations'):
        gmres(lambda x: factor * x, np.array([0.0, 3.0]), 1e-9, 5)


@pytest.mark.parametrize(('matrix', 'right'), [([[0, 0], [0, 0]], [0, 3]), ([[0, 1], [0, 0]], [1, 0])])
def test_gmres_says_so_where_the_matrix_is_singular_and_has_no_solution_in_its_reach(matrix, right):
    with pytest.raises(StalledError):
        gmres(lambda x: np.array(matrix, dtype=float) @ x, np.array(right, dtype=float), 1e-9, 5)
