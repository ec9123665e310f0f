"""Steps along a path of surroundings whose equilibria are easy, hard or impossible; edges of a contact."""

import numpy as np
import pytest

from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.oring_contact import equilibrium as newton
from seal_friction_ros.core.oring_contact.equilibrium import OringState, follow_path
from seal_friction_ros.core.oring_contact.results import WallContact, _edge
from seal_friction_ros.core.oring_contact.surroundings import Surroundings

START = OringState(np.zeros(2), np.zeros(1))


def at(share: float) -> Surroundings:
    return Surroundings(0.0, 1.0, 1.0, share, np.zeros(1, dtype=bool), 1.0, 1.0)


class Equilibrium:
    """Displacements in proportion to the share of the path; ``steps`` Newton steps each, failing if ``fails``."""

    def __init__(self, steps=lambda _: 3, fails=lambda _: False):
        self.steps, self.fails = steps, fails
        self.asked, self.guessed = [], []

    def __call__(self, _model, _assembly, surroundings, start):
        share = surroundings.pressure
        self.asked.append(share)
        self.guessed.append(start.displacement[0])
        if self.fails(len(self.asked)):
            raise NotConvergedError('told to')
        return OringState(np.full(2, 10.0 * share), np.zeros(1)), self.steps(len(self.asked))


@pytest.fixture
def followed(monkeypatch):
    def follow(equilibrium: Equilibrium, stride: float, **more):
        monkeypatch.setattr(newton, 'solve_equilibrium', equilibrium)
        return follow_path(None, None, lambda share, *_: at(share), START, stride, **more)

    return follow


def test_easy_steps_grow_and_the_last_one_ends_the_path(followed):
    easy = Equilibrium()
    end = followed(easy, 0.1)
    assert easy.asked == pytest.approx([0.1, 0.26, 0.516, 0.9256, 1.0])
    assert (end.surroundings.pressure, end.state.displacement[0], end.newton_steps) == (1.0, 10.0, 15)
    assert end.stride == pytest.approx(0.65536)  # of the last whole step, not of the rest after it


def test_steps_that_take_more_than_six_newton_steps_do_not_grow(followed):
    hard = Equilibrium(steps=lambda _: 7)
    end = followed(hard, 0.25)
    assert hard.asked == pytest.approx([0.25, 0.5, 0.75, 1.0])
    assert (end.stride, end.newton_steps) == (0.25, 28)
    just = Equilibrium(steps=lambda _: 6)
    followed(just, 0.25)
    assert just.asked == pytest.approx([0.25, 0.65, 1.0])


def test_rest_of_a_tenth_of_a_step_is_taken_with_it(followed):
    hard = Equilibrium(steps=lambda _: 7)
    followed(hard, 0.48)
    assert hard.asked == pytest.approx([0.48, 1.0])


def test_each_guess_goes_on_from_the_last_two_equilibria(followed):
    easy = Equilibrium()
    followed(easy, 0.1)
    assert easy.guessed == pytest.approx([0.0, *(10.0 * share for share in easy.asked[1:])])


def test_step_that_fails_is_halved_and_begins_at_the_last_equilibrium(followed):
    sometimes = Equilibrium(steps=lambda _: 7, fails=lambda count: count in (2, 3))
    end = followed(sometimes, 0.4)
    assert sometimes.asked == pytest.approx([0.4, 0.8, 0.6, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
    assert sometimes.guessed[2:4] == [4.0, 4.0]
    assert end.newton_steps == 7 * 7


def test_guess_may_be_given(followed):
    hard = Equilibrium(steps=lambda _: 7)
    followed(hard, 0.5, guess=lambda _, done, wanted: OringState(np.full(2, done + 100.0 * wanted), np.zeros(1)))
    assert hard.guessed == [50.0, 100.5]


def test_path_that_goes_nowhere_is_an_error_with_the_share_reached(followed):
    stuck = Equilibrium(steps=lambda _: 7, fails=lambda count: count > 1)
    with pytest.raises(NotConvergedError, match=r'^at 50 % of the path: told to$'):
        followed(stuck, 0.5)
    assert min(stuck.asked[1:]) - 0.5 == pytest.approx(0.5 / 2**12)  # the next half would be below 1e-4


# -- contact edges


def test_edge_lies_where_the_square_of_the_stress_vanishes():
    """Stress with the square root of the distance from 1.5 mm: exact; at most a spacing before the first node."""
    place = np.array([1.6e-3, 1.8e-3, 2.0e-3])
    assert _edge(place, 1e6 * np.sqrt(place - 1.5e-3)) == pytest.approx(1.5e-3, rel=1e-12)
    assert _edge(-place, 1e6 * np.sqrt(place - 1.5e-3)) == pytest.approx(-1.5e-3, rel=1e-12)
    assert _edge(place, np.array([3e5, 3.1e5, 3.2e5])) == pytest.approx(1.4e-3, rel=1e-12)
    assert _edge(place, np.array([3e5, 2e5, 1e5])) == pytest.approx(1.4e-3, rel=1e-12)
    assert _edge(place[:1], np.array([3e5])) == 1.6e-3


def test_width_of_a_contact_is_the_distance_of_its_edges():
    assert WallContact(np.zeros(0), np.zeros(0), 0.0, 0.0, 0.0, (1.0, 3.5)).width == 2.5
