r"""Elasticity of the seals from the reversals of logs: friction over the displacement s since the reversal.

.. math::
    F(s) = d \sum_i \min(k_i s - w_i f_0,\ w_i Y(s)) + o, \qquad
    Y = f_c\,[1 + \varepsilon\,(1 - \mathrm{e}^{-t/\tau})\,\mathrm{e}^{-g/L}], \quad f_0 = f_c \min(1 + \varepsilon, 1)

for a rod that slides in the direction d after it slid in the other one (Masing, see `presliding`). Each log has a
sliding friction f_c and an offset o of its force sum; all logs share the stiffness K and the yield exponent p. Lag and
dwell are fitted where the logs show them: at the reversal the friction differs from that of sliding by the share
epsilon, and follows over the memory length L of sliding, g. A share above 0 is stiction, which grows with the rest t;
below 0 the friction falls as the rod slows down.

Standard errors are those of a jackknife over groups of reversals, since the readings within one reversal are wrong
together. Every second reversal is kept back, to score the fit to the others. A log that does not tell the elasticity is
refused: `PreslidingRefusedError`.

The friction of the log is its force sum: inertia of a fast reversal counts as friction, so the reversals have to be
slow. All constants, the jackknife, and one K and p for all pressures are our choice.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.friction.presliding import SLOTS, Presliding
from seal_friction_ros.core.identification.validation import jackknife_errors

FEWEST_REVERSALS = 4  # of one log, in each half of them
STEPS_PER_LENGTH = 5.0  # [-] steps of the position that the presliding length must have
LARGEST_RELATIVE_STD = 0.5  # [-] of stiffness, memory length and dwell time; larger ones are not told
SLID = 1.5  # [-] of the length of a curve: way before a reversal after which the seals slid
BEYOND = 2.5  # [-] length of a curve over the displacement at which the last element yields
LAGS = 4.0  # [-] of the memory length, that a curve is longer
CURVE_STEPS = 20.0  # [-] shortest curve in steps or standard deviations of the noise of the position
MOST_SMOOTHED = 101  # samples in a mean of the position
NOISES = 8.0  # [-] standard deviations of the noise that make no reversal
GROUPS = 20  # of reversals, for the jackknife
WORTHWHILE = 0.05  # [-] of the squared residuals that lag or dwell has to take away
DWELL_VARIES = 3.0  # [-] long over short rests from which the dwell time is fitted
_STIFFEST, _SOFTEST = 1e9, 1.0  # [N/m]
_ROUNDS = 4  # of fit and choice of the length


class PreslidingRefusedError(ValueError):
    """The reversals of the logs do not tell the elasticity."""


class ReversalLog(NamedTuple):
    """Signals of one log; arrays of shape (n,)."""

    name: str
    time: FloatArray  # [s]
    position: FloatArray  # [m]
    force_sum: FloatArray  # [N]


class ReversalCurve(NamedTuple):
    """Friction after one reversal; arrays of shape (n,)."""

    log: int  # its number
    direction: int  # of the motion after the reversal
    rest: float  # [s] at the reversal
    displacement: FloatArray  # [m] since the reversal, >= 0
    friction: FloatArray  # [N] force sum

    def up_to(self, displacement: float) -> 'ReversalCurve':
        """The readings up to a displacement [m]."""
        inside = self.displacement <= displacement
        return self._replace(displacement=self.displacement[inside], friction=self.friction[inside])


@dataclass(frozen=True)
class PreslidingFit:
    """Fitted elasticity of all seals together, and how well the logs tell it."""

    presliding: Presliding
    friction: tuple[float, ...]  # [N] f_c of each log
    offset: tuple[float, ...]  # [N] o of each log
    excess: float  # [-] epsilon; 0 if the logs show no lag
    yield_exponent_std: float
    relative_memory_length_std: float  # [-] NaN if there is no lag
    relative_dwell_time_std: float  # [-] NaN if the rests do not tell it
    rms: float  # [N] of the residuals
    reversals: int
    length: float  # [m] of the curves

    @property
    def full_yield(self) -> float:
        """Displacement after a reversal at which the last element yields [m], mean over the logs."""
        return _full_yield(self.presliding, float(np.mean(self.friction)))


class PreslidingScore(NamedTuple):
    """RMS errors [N] on reversals that the fit has not seen, over the first ``within`` [m]."""

    elastic: float  # of the fit
    rigid: float  # of the same friction without presliding
    repeatability: float  # of the mean over the seen reversals at equal displacement
    within: float
    reversals: int


def position_noise(position: FloatArray) -> float:
    """Noise or step of a position [m]: robust, from its second differences, as of white noise."""
    if len(position) < 3:
        return 0.0
    places = np.unique(position)
    step = float(np.median(np.diff(places))) if 1 < len(places) < 0.5 * len(position) else 0.0
    return max(step, float(np.median(np.abs(np.diff(position, 2))) / 0.6745 / math.sqrt(6.0)))


def smoothed_position(position: FloatArray, noise: float) -> FloatArray:
    """Mean of a position [m] over the samples in which the rod moves twice its noise; as it is if one is enough."""
    ways = np.abs(np.diff(position))
    way = float(np.mean(ways)) if len(ways) else 0.0
    width = 1 + 2 * round(noise / way) if way > 0.0 else 1
    smooth: FloatArray = uniform_filter1d(position, min(width, MOST_SMOOTHED))
    return smooth


def turning_points(position: FloatArray, threshold: float) -> list[int]:
    """Indices at which a position [m] turns back by more than ``threshold`` [m]; first and last sample included."""
    turns, extreme, direction = [0], 0, 0
    for i, x in enumerate(position.tolist()):
        back = position[extreme] - x
        if direction == 0:
            if abs(back) > threshold:
                direction, extreme = (1 if back < 0.0 else -1), i
        elif back * direction < 0.0:
            extreme = i
        elif back * direction > threshold:
            turns.append(extreme)
            direction, extreme = -direction, i
    turns.append(len(position) - 1)
    return turns


def reversal_curves(logs: Sequence[ReversalLog], length: float) -> list[ReversalCurve]:
    """Curves after the reversals of logs, each from the turning point over ``length`` [m] of displacement.

    Only a reversal after a way of `SLID` lengths counts, since the seals have to slide before it. Of a rest at the
    reversal only the last sample counts.
    """
    curves = []
    for number, log in enumerate(logs):
        noise = position_noise(log.position)
        threshold = max(0.1 * length, NOISES * noise)
        smooth = smoothed_position(log.position, noise)
        turns = turning_points(smooth, threshold)
        for before, turn, after in zip(turns, turns[1:], turns[2:], strict=False):
            way = log.position[turn] - log.position[before]
            displacement = np.abs(smooth[turn : after + 1] - smooth[turn])
            outside = np.flatnonzero(displacement > length)
            if abs(way) < SLID * length or not len(outside):
                continue
            at_turn = displacement[: outside[0]] <= max(noise, 1e-3 * length)
            part = slice(int(np.flatnonzero(at_turn)[-1]), int(outside[0]))
            near = np.abs(smooth[before : after + 1] - smooth[turn]) <= max(4.0 * noise, 1e-3 * length)
            rest = float(np.diff(log.time[before : after + 1])[near[1:]].sum())
            force = log.force_sum[turn : after + 1][part]
            curves.append(ReversalCurve(number, -1 if way > 0.0 else 1, rest, displacement[part], force))
    return curves


class _Samples(NamedTuple):
    """All readings of the curves in one row each; arrays of shape (n,)."""

    log: IntArray
    curve: IntArray
    direction: FloatArray
    rest: FloatArray
    displacement: FloatArray
    friction: FloatArray


def _samples(curves: Sequence[ReversalCurve]) -> _Samples:
    sizes = [len(curve.displacement) for curve in curves]
    each = (np.repeat(column, sizes) for column in zip(*((c.log, c.direction, c.rest) for c in curves), strict=True))
    log, direction, rest = each
    return _Samples(
        log,
        np.repeat(np.arange(len(curves)), sizes),
        direction.astype(float),
        rest,
        np.concatenate([curve.displacement for curve in curves]),
        np.concatenate([curve.friction for curve in curves]),
    )


SHARED = ('stiffness', 'yield_exponent', 'excess', 'memory_length', 'dwell_time')
"""Parameters of all logs: ln K, p, epsilon, ln L, ln tau. After them come f_c and o of each log."""
_START_OF_LOGS = len(SHARED)


def friction_after_reversal(
    parameters: FloatArray, displacement: FloatArray, friction: FloatArray, rest: FloatArray
) -> FloatArray:
    """Friction in the direction of the motion after the reversal [N], shape (n,): the equation at the top.

    Parameters are those `SHARED`, where a ln tau of -inf is no dwell; the displacement [m] since the reversal has the
    shape (n,); friction f_c [N] and rest [s] at the reversal likewise, or they are numbers.
    """
    log_stiffness, exponent, excess, log_length, log_dwell = parameters
    shares = ((np.arange(SLOTS) + 0.5) / SLOTS) ** exponent
    shares = shares / shares.sum()
    each = math.exp(log_stiffness) / SLOTS
    friction = np.broadcast_to(friction, displacement.shape)
    level = start = friction
    if excess != 0.0:
        dwell = math.exp(log_dwell)
        grown = excess * (1.0 - np.exp(-np.asarray(rest) / dwell)) if dwell > 0.0 else excess
        start = friction * min(1.0 + excess, 1.0)
        slid = np.maximum(displacement - shares[-1] * (start + (1.0 + grown) * friction) / each, 0.0)
        level = friction * (1.0 + grown * np.exp(-slid / math.exp(log_length)))
    loaded = each * displacement[:, None] - shares * start[:, None]
    acting: FloatArray = np.minimum(loaded, shares * level[:, None]).sum(axis=1)
    return acting


def _residuals(parameters: FloatArray, samples: _Samples) -> FloatArray:
    """Measured minus modelled friction [N], shape (n,)."""
    friction, offset = parameters[_START_OF_LOGS::2], parameters[_START_OF_LOGS + 1 :: 2]
    acting = friction_after_reversal(
        parameters[:_START_OF_LOGS], samples.displacement, friction[samples.log], samples.rest
    )
    found: FloatArray = samples.friction - samples.direction * acting - offset[samples.log]
    return found


class _Solution(NamedTuple):
    parameters: FloatArray
    free: IntArray  # indices of the fitted ones
    jacobian: FloatArray
    residuals: FloatArray
    cost: float


def _solve(samples: _Samples, start: FloatArray, free: IntArray, length: float) -> _Solution:
    """Least squares over the ``free`` parameters, the others as in ``start``."""
    logs = (len(start) - _START_OF_LOGS) // 2
    lower = np.array([math.log(_SOFTEST), 0.0, -0.95, math.log(1e-3 * length), -7.0] + [1e-9, -1e9] * logs)[free]
    upper = np.array([math.log(_STIFFEST), 10.0, 5.0, math.log(10.0 * length), 9.0] + [1e9, 1e9] * logs)[free]
    size = max(float(np.abs(start[_START_OF_LOGS:]).max()), 1e-9)
    scale = np.array([0.3, 0.5, 0.1, 0.5, 0.5] + [0.1 * size] * (2 * logs))[free]

    def of(values: FloatArray) -> FloatArray:
        parameters = start.copy()
        parameters[free] = values
        return _residuals(parameters, samples)

    found = least_squares(of, np.clip(start[free], lower, upper), bounds=(lower, upper), x_scale=scale)
    parameters = start.copy()
    parameters[free] = found.x
    return _Solution(parameters, free, np.asarray(found.jac), found.fun, 2.0 * float(found.cost))


def _standard_errors(solution: _Solution, samples: _Samples) -> FloatArray:
    """Standard error of every parameter, NaN for one that is not fitted: jackknife over groups of reversals.

    What is left without a group is one Gauss-Newton step from the whole, which is the jackknife to first order.
    """
    curves = int(samples.curve.max()) + 1
    groups = min(GROUPS, curves)
    group = samples.curve % groups
    j, r = solution.jacobian, solution.residuals
    normal, steps = j.T @ j, []
    for number in range(groups):
        inside = group == number
        left = normal - j[inside].T @ j[inside]
        steps.append(np.linalg.lstsq(left, j[inside].T @ r[inside], rcond=None)[0])
    errors = np.full(len(solution.parameters), np.nan)
    errors[solution.free] = jackknife_errors(np.array(steps))
    return errors


def _checked_starts(curves: Sequence[ReversalCurve], names: Sequence[str], fewest: int) -> list[tuple[float, float]]:
    """Sliding friction and offset of each log [N] from the ends of its curves."""
    starts = []
    for number, name in enumerate(names):
        own = [curve for curve in curves if curve.log == number and len(curve.friction)]
        ends = np.array([np.median(c.friction[c.displacement >= 0.8 * c.displacement[-1]]) for c in own])
        directions = np.array([c.direction for c in own])
        plus, minus = ends[directions > 0], ends[directions < 0]
        if len(own) < fewest or not len(plus) or not len(minus):
            raise PreslidingRefusedError(
                f'{name}: {len(plus)} and {len(minus)} reversals out and back after sliding, but {fewest} are needed '
                'for presliding, of both kinds: record more strokes'
            )
        friction, offset = 0.5 * (np.median(plus) - np.median(minus)), 0.5 * (np.median(plus) + np.median(minus))
        if friction <= 0.0:
            raise PreslidingRefusedError(
                f'{name}: the force sum does not oppose the motion after reversals: check signs and areas'
            )
        starts.append((float(friction), float(offset)))
    return starts


def _full_yield(presliding: Presliding, friction: float) -> float:
    shares = ((np.arange(SLOTS) + 0.5) / SLOTS) ** presliding.yield_exponent
    return float(2.0 * shares[-1] / shares.sum() * friction * SLOTS / presliding.stiffness)


def fit_presliding(logs: Sequence[ReversalLog]) -> PreslidingFit:
    """Fit the elasticity of all seals together to all reversals; the length of the curves follows from the fit.

    PreslidingRefusedError: there are too few reversals, the position is too coarse, or the elasticity is not told.
    """
    names, length = [log.name for log in logs], half_stroke(logs)
    fit = fit_curves(reversal_curves(logs, length), names, length)
    for _ in range(_ROUNDS):
        wanted = BEYOND * fit.full_yield + LAGS * fit.presliding.memory_length
        wanted = max(wanted, CURVE_STEPS * max(position_noise(log.position) for log in logs))
        if wanted > 0.8 * length:
            break
        length = wanted
        fit = fit_curves(reversal_curves(logs, length), names, length)
    for log in logs:
        step = position_noise(log.position)
        shortest = _full_yield(fit.presliding, min(fit.friction))
        if step * STEPS_PER_LENGTH > shortest:
            raise PreslidingRefusedError(
                f'{log.name}: steps or noise of the position of {step:.2g} m are too coarse for seals that slide after '
                f'{shortest:.2g} m: use a sensor with less than {shortest / STEPS_PER_LENGTH:.2g} m'
            )
    return fit


def half_stroke(logs: Sequence[ReversalLog]) -> float:
    """Half of the median stroke [m], the least over the logs. PreslidingRefusedError: a log has too few reversals."""
    lengths = []
    for log in logs:
        spread = float(np.ptp(log.position))
        turns = turning_points(log.position, max(0.1 * spread, NOISES * position_noise(log.position)))
        ways = np.abs(np.diff(log.position[turns]))
        if len(ways) < 3 or not ways[1:-1].any():
            raise PreslidingRefusedError(
                f'{log.name}: {max(len(turns) - 2, 0)} reversals, but {2 * FEWEST_REVERSALS} are needed for '
                'presliding: record strokes out and back'
            )
        lengths.append(0.5 * float(np.median(ways[1:-1])))
    return min(lengths)


def fit_curves(curves: Sequence[ReversalCurve], names: Sequence[str], length: float) -> PreslidingFit:
    """Fit the elasticity to some reversals of the logs called ``names``, whose curves are ``length`` [m] long.

    Lag and dwell are taken where the logs tell them. PreslidingRefusedError: there are too few reversals, or the
    elasticity is not told.
    """
    starts = _checked_starts(curves, names, FEWEST_REVERSALS)
    samples = _samples(curves)
    of_logs = np.array(starts).ravel()
    friction = float(np.mean(of_logs[::2]))
    every = np.arange(_START_OF_LOGS, _START_OF_LOGS + len(of_logs))
    rigid = np.concatenate(([0.0, 1.0, 0.0, math.log(length), -math.inf], of_logs))
    tried = []
    for share in (0.002, 0.02, 0.1, 0.5):
        start = rigid.copy()
        start[0] = math.log(friction / (share * length))
        tried.append(_solve(samples, start, np.array([0, 1, *every]), length))
    found = min(tried, key=lambda solution: solution.cost)
    found, errors = _with_lag(samples, found, _standard_errors(found, samples), length)
    if not errors[0] < LARGEST_RELATIVE_STD or not _SOFTEST < 0.99 * math.exp(found.parameters[0]) < 0.98 * _STIFFEST:
        raise PreslidingRefusedError(
            f'{", ".join(names)}: the stiffness by the reversals, {math.exp(found.parameters[0]):.2g} N/m, has a '
            f'relative standard deviation of {errors[0]:.2g}: record slower reversals, more of them, or a finer '
            'position'
        )
    log_stiffness, exponent, excess, log_length, log_dwell = found.parameters[:_START_OF_LOGS].tolist()
    return PreslidingFit(
        presliding=Presliding(
            stiffness=math.exp(log_stiffness),
            yield_exponent=exponent,
            memory_length=math.exp(log_length) if excess else 0.0,
            dwell_time=math.exp(log_dwell) if excess else 0.0,
            relative_std=float(errors[0]),
        ),
        friction=tuple(found.parameters[_START_OF_LOGS::2].tolist()),
        offset=tuple(found.parameters[_START_OF_LOGS + 1 :: 2].tolist()),
        excess=excess,
        yield_exponent_std=float(errors[1]),
        relative_memory_length_std=float(errors[3]),
        relative_dwell_time_std=float(errors[4]),
        rms=float(np.sqrt(np.mean(found.residuals**2))),
        reversals=len(curves),
        length=length,
    )


def _with_lag(samples: _Samples, found: _Solution, errors: FloatArray, length: float) -> tuple[_Solution, FloatArray]:
    """The fit with memory length and, where the rests differ, dwell time, if each is told; else as given."""
    rests = samples.rest[np.flatnonzero(np.diff(samples.curve, prepend=-1))]
    low, high = np.quantile(rests, (0.2, 0.8))
    middle = max(0.5 * (low + high), 1e-3)
    rungs: list[tuple[tuple[int, ...], float, float]] = [
        ((2, 3), 0.1, -math.inf),
        ((2, 3), -0.3, -math.inf),
    ]  # stiction, or friction that rises with speed
    if high > DWELL_VARIES * low:
        rungs.append(((2, 3, 4), 0.1, math.log(middle)))
    best, best_errors = found, errors
    for added, excess, log_dwell in rungs:
        start = found.parameters.copy()
        start[2:_START_OF_LOGS] = excess, math.log(0.2 * length), log_dwell
        richer = _solve(samples, start, np.sort(np.concatenate((found.free, added))), length)
        new_errors = _standard_errors(richer, samples)
        told = abs(richer.parameters[2]) > 2.0 * new_errors[2]
        told = told and (new_errors[[0, *added[1:]]] < LARGEST_RELATIVE_STD).all()
        told = told and LAGS * math.exp(richer.parameters[3]) <= length  # else it is a slope over the whole curve
        if told and richer.cost < (1.0 - WORTHWHILE) * best.cost:
            best, best_errors = richer, new_errors
    return best, best_errors


def _parameters_of(fit: PreslidingFit) -> FloatArray:
    made = fit.presliding
    lag = math.log(made.memory_length) if made.memory_length else 0.0
    dwell = math.log(made.dwell_time) if made.dwell_time else -math.inf
    shared = (math.log(made.stiffness), made.yield_exponent, fit.excess, lag, dwell)
    return np.concatenate((shared, np.column_stack((fit.friction, fit.offset)).ravel()))


def score_presliding(logs: Sequence[ReversalLog], length: float, within: float) -> PreslidingScore:
    """Fit every second reversal of each log and predict the others.

    PreslidingRefusedError: half of the reversals do not tell the elasticity.

    The curves have the ``length`` of `PreslidingFit` [m]; errors count ``within`` a displacement of at most that [m].
    """
    curves = reversal_curves(logs, length)
    seen, unseen = [], []
    for number in range(len(logs)):
        for direction in (-1, 1):
            own = [curve for curve in curves if curve.log == number and curve.direction == direction]
            seen += own[::2]
            unseen += own[1::2]
    fit = fit_curves(seen, [log.name for log in logs], length)
    samples = _samples([curve.up_to(within) for curve in unseen])
    elastic = _residuals(_parameters_of(fit), samples)
    friction, offset = np.array(fit.friction)[samples.log], np.array(fit.offset)[samples.log]
    rigid = samples.friction - samples.direction * friction - offset
    scatter = _deviations_from_mean(seen, unseen, within)
    elastic_rms, rigid_rms, repeatability = (float(np.sqrt(np.mean(r**2))) for r in (elastic, rigid, scatter))
    return PreslidingScore(elastic_rms, rigid_rms, repeatability, within, len(unseen))


def _deviations_from_mean(seen: Sequence[ReversalCurve], unseen: Sequence[ReversalCurve], within: float) -> FloatArray:
    """Unseen friction minus the mean of the seen curves of the same log and direction, at equal displacement [N]."""
    grid = np.linspace(0.0, within, 101)

    def on_grid(curve: ReversalCurve) -> FloatArray:
        order = np.argsort(curve.displacement, kind='stable')
        return np.interp(grid, curve.displacement[order], curve.friction[order])

    means: dict[tuple[int, int], FloatArray] = {}
    for key in {(curve.log, curve.direction) for curve in seen}:
        own = [on_grid(curve) for curve in seen if (curve.log, curve.direction) == key]
        means[key] = np.mean(own, axis=0)
    return np.concatenate(
        [
            (curve.friction - np.interp(curve.displacement, grid, means[curve.log, curve.direction]))[
                curve.displacement <= within
            ]
            for curve in unseen
        ]
    )
