"""Continuation: a large change of the surroundings in steps that grow after easy ones and shrink after failed ones."""

from collections.abc import Callable
from typing import NamedTuple

from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.oring_contact.equilibrium import Assembly, OringModel, OringState, solve_equilibrium
from seal_friction_ros.core.oring_contact.surroundings import Surroundings

_EASY = 6  # Newton steps; a step with no more is an easy one
_GROW, _SHRINK = 1.6, 0.5
_SMALLEST = 1e-4  # of the path


class PathEnd(NamedTuple):
    """Equilibrium at the end of a path."""

    state: OringState
    surroundings: Surroundings
    newton_steps: int  # without those of failed steps
    stride: float  # fraction of the path proposed for a next step


def follow_path(
    model: OringModel,
    assembly: Assembly,
    path: Callable[[float, OringState, float], Surroundings],
    start: OringState,
    stride: float = 1.0,
    guess: Callable[[OringState, float, float], OringState] | None = None,
) -> PathEnd:
    """Follow the equilibrium along a path of surroundings.

    ``path`` gives the surroundings at a fraction of the path, 0 to 1, the last equilibrium, from ``start`` at 0, and
    its fraction; the first step is the fraction ``stride``. ``guess`` gives the start of Newton's method from the last
    equilibrium, its fraction and the next one, by default the linear extrapolation of the last two equilibria.
    NotConvergedError: a step fails at the smallest size; the message has the fraction reached.
    """
    done, state, before, total = 0.0, start, (0.0, start), 0
    surroundings = path(0.0, start, 0.0)
    while done < 1.0:
        wanted = done + stride
        wanted = 1.0 if wanted > 1.0 - 0.1 * stride else wanted
        first = guess(state, done, wanted) if guess else _extrapolated(before, (done, state), wanted)
        next_surroundings = path(wanted, state, done)
        try:
            after, steps = solve_equilibrium(model, assembly, next_surroundings, first)
        except NotConvergedError as error:
            stride = _SHRINK * (wanted - done)
            if stride < _SMALLEST:
                raise NotConvergedError(f'at {100.0 * done:.3g} % of the path: {error}') from None
            before = done, state  # start the retry from the last equilibrium
            continue
        if steps <= _EASY:
            stride = max(stride, _GROW * (wanted - done))
        before, done, state = (done, state), wanted, after
        surroundings, total = next_surroundings, total + steps
    return PathEnd(state, surroundings, total, stride)


def _extrapolated(before: tuple[float, OringState], now: tuple[float, OringState], wanted: float) -> OringState:
    if before[0] >= now[0]:
        return now[1]
    ratio = (wanted - now[0]) / (now[0] - before[0])
    change = now[1].displacement - before[1].displacement
    return now[1]._replace(displacement=now[1].displacement + ratio * change)
