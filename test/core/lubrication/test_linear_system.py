"""The linear systems of a contact step: derivatives, elimination and stiffness, each against a direct computation."""

import numpy as np
import pytest

from seal_friction_ros.core.lubrication import contact as contact_module
from seal_friction_ros.core.lubrication.elasticity import half_plane
from seal_friction_ros.core.lubrication.reynolds import FilmEnds, complementarity, reynolds_rows

CELLS = 7
WIDTH, RATE = 2e-6, 400.0  # [m], [1/s]
ENDS = FilmEnds(3e5, 1e5, 0.7, 0.9)


def drawn() -> np.random.Generator:
    return np.random.default_rng(3)


def film() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Gap, pressure, saturation and film before, without any order in them."""
    random = drawn()
    shares = random.uniform(0.5, 1.0, (4, CELLS))
    return 2e-6 * shares[0], 2e5 * shares[1], shares[2], 1e-6 * shares[3]


def properties(gap: np.ndarray) -> np.ndarray:
    """A mobility 2 h^3 and a carried height h + 3e5 h^2, with their slopes."""
    return np.array([2.0 * gap**3, 6.0 * gap**2, gap + 3e5 * gap**2, 1.0 + 6e5 * gap])


def rows_of(gap, pressure, saturation, before, velocity, ends=ENDS):
    return reynolds_rows(gap, pressure, saturation, properties(gap), velocity, RATE, before, WIDTH, ends)


@pytest.mark.parametrize('velocity', [0.3, -0.3])
def test_flow_is_that_of_reynolds_and_a_cell_stores_what_does_not_leave_it(velocity):
    gap, pressure, saturation, before = film()
    residual, _, flow = rows_of(gap, pressure, saturation, before, velocity)
    mobility, _, carried, _ = properties(gap)
    for face in range(CELLS + 1):
        left, right = max(face - 1, 0), min(face, CELLS - 1)
        reach = WIDTH if 0 < face < CELLS else 0.5 * WIDTH
        fall = (pressure[left] if face else 3e5) - (pressure[right] if face < CELLS else 1e5)
        filled = saturation[left if velocity > 0.0 else right]
        if (face, velocity) == (0, 0.3):
            filled = 0.7
        if (face, velocity) == (CELLS, -0.3):
            filled = 0.9
        moved = velocity * filled * 0.5 * (carried[left] + carried[right])
        assert flow[face] == pytest.approx(0.5 * (mobility[left] + mobility[right]) * fall / reach + moved, rel=1e-12)
    stored = (saturation * gap - before) * WIDTH * RATE
    assert residual == pytest.approx(stored + np.diff(flow), rel=1e-12, abs=1e-12 * np.abs(flow).max())


@pytest.mark.parametrize('velocity', [0.3, -0.3, 0.0])
def test_rows_of_reynolds_are_the_derivatives_of_the_residual(velocity):
    gap, pressure, saturation, before = film()
    _, rows, _ = rows_of(gap, pressure, saturation, before, velocity)
    for kind, step in enumerate((10.0, 1e-5, 1e-11)):  # pressure, saturation, gap
        for j in range(CELLS):
            sides = []
            for sign in (1.0, -1.0):
                moved = [gap.copy(), pressure.copy(), saturation.copy()]
                moved[(kind + 1) % 3][j] += sign * step
                sides.append(rows_of(*moved, before, velocity)[0])
            slope = (sides[0] - sides[1]) / (2.0 * step)
            exact = np.zeros(CELLS)
            for i in range(max(0, j - 1), min(CELLS, j + 2)):
                exact[i] = rows[kind, j - i + 1, i]
            assert slope == pytest.approx(exact, rel=1e-5, abs=1e-6 * np.abs(rows[kind]).max())


FULL, HALF, VOID, THIN, BELOW, FREE = (2e5, 1.0), (1e5, 0.5), (0.0, 0.4), (1e3, 0.7), (-1e5, 1.0), (0.0, 1.0)


@pytest.mark.parametrize(('pressure', 'saturation'), [FULL, HALF, VOID, THIN, BELOW, FREE])
def test_what_is_left_of_a_cell_solves_the_equation_of_fischer_and_burmeister_to_first_order(pressure, saturation):
    scale = 1e5
    (a, b, c, d), largest = complementarity(np.array([pressure]), np.array([saturation]), scale)
    p, void = pressure / scale, 1.0 - saturation
    size = np.hypot(p, void)
    by_p, by_void = (1.0 - p / size, 1.0 - void / size) if size else (1.0 - np.sqrt(0.5),) * 2
    assert largest == pytest.approx(abs(p + void - size), abs=1e-15)
    for unknown in (0.0, 1.0, -2.0):
        change = by_p * (a[0] + b[0] * unknown) / scale - by_void * (c[0] + d[0] * unknown)
        assert p + void - size + change == pytest.approx(0.0, abs=1e-12)
    assert (b[0], d[0]) != (0.0, 0.0)


def test_of_all_cells_the_largest_residual_counts():
    pressure, saturation = np.array([2e5, -1e5, 1e5]), np.array([1.0, 1.0, 0.5])
    assert complementarity(pressure, saturation, 1e5)[1] == pytest.approx(2.0)


def test_film_keeps_its_pressure_as_unknown_where_it_is_full_and_its_saturation_where_it_is_void():
    (_, by_pressure, _, by_saturation), _ = complementarity(np.array([2e5, 0.0]), np.array([1.0, 0.4]), 1e5)
    assert by_pressure.tolist() == [1e5, 0.0]
    assert by_saturation.tolist() == [0.0, 1.0]


def test_band_of_elastic_film_is_solved_as_the_whole_matrix_is():
    """For dh and x of each cell: (S - p_c') dh - b x = elastic, and the rows of Reynolds with p = b x, theta = d x."""
    n, reach, random = 9, 3, drawn()
    rows, kept = random.normal(size=(3, 3, n)), random.normal(size=(4, n))
    slope, stiffness = -random.uniform(1.0, 2.0, n), np.array([30.0, -4.0, -2.0, -1.0])
    elastic, flow = random.normal(size=(2, n))
    whole = np.zeros((2 * n, 2 * n))
    for i in range(n):
        for j in range(n):
            if abs(i - j) <= reach:
                whole[2 * i, 2 * j] = stiffness[abs(i - j)]
            if abs(i - j) <= 1:
                k = j - i + 1
                whole[2 * i + 1, 2 * j] = rows[2, k, i]
                whole[2 * i + 1, 2 * j + 1] = rows[0, k, i] * kept[1, j] + rows[1, k, i] * kept[3, j]
        whole[2 * i, 2 * i] -= slope[i]
        whole[2 * i, 2 * i + 1] -= kept[1, i]
    band = contact_module._factored_band(rows, kept, slope, stiffness)
    gap, left = contact_module._solve_band(band, elastic, flow)
    exact = np.linalg.solve(whole, np.stack((elastic, flow), axis=1).ravel()).reshape(-1, 2)
    assert gap == pytest.approx(exact[:, 0], rel=1e-8)
    assert left == pytest.approx(exact[:, 1], rel=1e-8)


def test_narrow_stiffness_leaves_the_band_of_the_film_whole():
    """Reach 1: the film, which reaches to the cell beside it, then sets the width of the band."""
    n, random = 6, drawn()
    rows, kept, slope = random.normal(size=(3, 3, n)), random.normal(size=(4, n)), -random.uniform(1.0, 2.0, n)
    band = contact_module._factored_band(rows, kept, slope, np.array([20.0, -3.0]))
    assert band.shape == (12, 7)


def test_flow_left_to_the_unknown_is_the_residual_less_what_the_complementarity_gives():
    n, random = 5, drawn()
    residual, rows, kept = random.normal(size=n), random.normal(size=(3, 3, n)), random.normal(size=(4, n))
    exact = -residual
    for i in range(n):
        for j in range(max(0, i - 1), min(n, i + 2)):
            exact[i] -= rows[0, j - i + 1, i] * kept[0, j] + rows[1, j - i + 1, i] * kept[2, j]
    assert contact_module._flow_right_side(residual, rows, kept) == pytest.approx(exact, rel=1e-12)


def test_banded_stiffness_is_nearly_the_inverse_of_the_compliance_and_carries_an_even_pressure():
    """Beside the cell itself it falls as 1 / r^2; the sum of a row is the modulus over the length of the film."""
    plane = half_plane(64, 5e-6, 1.4e7, 1e-3)
    band = plane.stiffness_band
    assert len(band) == 7
    inverse = np.linalg.inv(plane.matrix)[32, 32:39]
    assert band[1:] == pytest.approx(inverse[1:], rel=0.02)
    assert band[0] == pytest.approx(inverse[0], rel=0.1)
    assert band[0] + 2.0 * band[1:].sum() == pytest.approx(1.4e7 / (64 * 5e-6), rel=1e-12)


def test_an_elimination_that_meets_a_pivot_of_zero_has_no_solution_and_does_not_divide_by_it():
    rows, kept = np.zeros((3, 3, CELLS)), np.zeros((4, CELLS))
    with np.errstate(all='raise'):
        band = contact_module._factored_band(rows, kept, np.ones(CELLS), np.array([1.0, 0.5]))
    assert np.isnan(band).all()
