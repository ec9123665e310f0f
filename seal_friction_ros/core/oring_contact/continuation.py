"""Large changes of the surroundings in small ones: steps that grow while they are easy and shrink where they fail."""

from collections.abc import Callable
from typing import NamedTuple

from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.oring_contact.equilibrium import Assembly, OringModel, OringState, solve_equilibrium
from seal_friction_ros.core.oring_contact.surroundings import Surroundings

_EASY = 6  # Newton steps of an easy step
_GROW, _SHRINK = 1.6, 0.5
_SMALLEST = 1e-4  # part of the way


class PathEnd(NamedTuple):
    """The end of a path."""

    state: OringState
    surroundings: Surroundings
    newton_steps: int
    """those of failed attempts are not counted"""
    stride: float
    """part of the way that the next step would have taken"""


def follow_path(
    model: OringModel,
    assembly: Assembly,
    path: Callable[[float, OringState], Surroundings],
    start: OringState,
    stride: float = 1.0,
    guess: Callable[[OringState, float, float], OringState] | None = None,
) -> PathEnd:
    """Follow an equilibrium along a path.

    Args:
        model: The ring.
        assembly: Its free displacements.
        path: Surroundings at a part of the way, 0 to 1, given the last equilibrium.
        start: Equilibrium at 0.
        stride: Part of the way to try first.
        guess: State to start Newton's method from, given the last equilibrium and the parts of the way it is at and
            shall be at; by default the straight line through the last two.

    Raises:
        NotConvergedError: The way ends before 1; the message says where.
    """
    done, state, before, total = 0.0, start, (0.0, start), 0
    surroundings = path(0.0, start)
    while done < 1.0:
        wanted = done + stride
        wanted = 1.0 if wanted > 1.0 - 0.1 * stride else wanted
        first = guess(state, done, wanted) if guess else _ahead(before, (done, state), wanted)
        around = path(wanted, state)
        try:
            after, steps = solve_equilibrium(model, assembly, around, first)
        except NotConvergedError as error:
            stride = _SHRINK * (wanted - done)
            if stride < _SMALLEST:
                raise NotConvergedError(f'{100.0 * done:.3g} % of the way: {error}') from None
            before = done, state  # next time from where it is
            continue
        if steps <= _EASY:
            stride = max(stride, _GROW * (wanted - done))
        before, done, state = (done, state), wanted, after
        surroundings, total = around, total + steps
    return PathEnd(state, surroundings, total, stride)


def _ahead(before: tuple[float, OringState], now: tuple[float, OringState], wanted: float) -> OringState:
    if before[0] >= now[0]:
        return now[1]
    ratio = (wanted - now[0]) / (now[0] - before[0])
    change = now[1].displacement - before[1].displacement
    return now[1]._replace(displacement=now[1].displacement + ratio * change)
