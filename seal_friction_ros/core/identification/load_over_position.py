r"""Load that follows position, fitted together with friction: identification without a load cell.

On a machine without a load cell the force sum is that of the chamber pressures alone. It holds the load (gravity, a
linkage), which is often ten times the friction:

.. math:: F_{sum} = p_a A_a - p_b A_b = F_L(x) + m(x)\,a + \tfrac{1}{2} m'(x)\,v^2 + \mathrm{sgn}(v)\,f(p, |v|)

Load and inertia are the same in both directions, friction changes sign: at equal position, half the difference of the
directions is friction. The load is a cubic spline over position. The friction of this fit is linear in its terms and
only separates the load; the laws of the ladder are fitted afterwards, to the force sum without load and inertia.

What the data cannot show: a load that differs between all strokes out and all strokes back, and friction of the
linkage, both count as friction of the seals. A friction larger in one direction counts as load.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray, IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.mounting import pressures_at_seals
from seal_friction_ros.core.identification.signal_preparation import (
    LONGEST_GAP,
    Signals,
    Sliding,
    even_sliding,
    longest_stretch,
    motions,
)
from seal_friction_ros.core.identification.validation import jackknife_errors

MEAN_OVER = 0.2  # [s] samples are averaged over this time before the fit (our choice)
SHORTEST_STROKE = 0.05  # of the travel; a shorter motion is part of no stroke (our choice)
MOST_GROUPS = 20  # pairs of strokes, or parts of the way, each left out in turn (our choice)
CELLS = 25  # of the travel, in which the directions are compared (our choice)
LOADED = 2.0  # times the friction: a load that is told without being named (our choice)
SMALLEST_SHARE = 0.5  # of the travel that both directions must share (our choice)
LARGEST_LOAD_CHANGE = 0.02  # of the mean load, between strokes (our choice)
SURE_CHANGE = 4.0  # standard errors, from which a load change is no noise (our choice)
LARGEST_FRICTION_ERROR = 0.2  # of the friction: standard error above which it is lost in the noise (our choice)
KNOWN_INERTIA = 0.02  # of the friction: standard error of an inertia force that is known (our choice)
COLLINEAR_INERTIA = 0.98  # share of the acceleration that is a function of position (our choice)
NOTICED_INERTIA = 0.04  # [m/s2] RMS: 2 % of a load on a lever of 5 to 1 (our choice)
ILL_CONDITIONED = 30.0  # condition number of a model that the log does not determine; after [Belsley1980]_
NEGLIGIBLE_LOSS = 0.01  # of the loss: for less, no term is added (our choice)
INTERVALS = (1, 2, 3, 4, 6, 8, 12)  # of the spline
ROWS_PER_KNOT = 8  # means of `MEAN_OVER`; our choice
EXPONENTS = (2.0 / 3.0, 1.0, 1.5, 2.0)  # of the pressure
STRIBECK_SPEEDS = (0.05, 0.15, 0.4)  # of the fastest speed
_RIDGE = 1e-10  # of the squared length of a column: keeps a collinear fit finite


@dataclass(frozen=True, eq=False)
class FrictionTerms:
    """Terms of the friction with which the load was fitted; they separate the load, and are no result."""

    names: tuple[str, ...]
    values: FloatArray  # [N, N/bar^m, N s/m] as the names say, shape (terms,)
    mean: float  # [N] over the samples of the fit
    standard_error: float  # of the mean [N]


@dataclass(frozen=True, eq=False)
class LoadOverPosition:
    """Load and inertia of one log, as functions of position."""

    knots: FloatArray  # [m] increasing, shape (k >= 4,); a cubic spline (not-a-knot) runs through them
    forces: FloatArray  # [N] load at the knots, positive if it pushes the rod in, shape (k,)
    std: FloatArray
    """[N] standard deviation of the load at the knots, by the jackknife over pairs of strokes, or parts of one"""
    mass: float  # [kg] equivalent mass in the middle of the knots; 0 if the log shows none
    mass_change: tuple[float, float]  # [kg/m, kg/m^2] of the equivalent mass over position from the middle
    mass_std: float  # [kg]
    friction: FrictionTerms
    noise: float  # [N] residual of a mean over `MEAN_OVER`
    condition_number: float  # of the fit, columns of unit length
    strokes: int
    warnings: tuple[str, ...] = ()

    @property
    def middle(self) -> float:
        """Position at which `mass` holds [m]."""
        return float(self.knots[0] + self.knots[-1]) / 2.0


def load_at(load: LoadOverPosition, position: FloatArray) -> FloatArray:
    """Load [N] at a position [m], shape (n,); NaN beyond the knots, where it was not measured in both directions."""
    inside = (position >= load.knots[0]) & (position <= load.knots[-1])
    spline = CubicSpline(load.knots, load.forces, bc_type='not-a-knot')
    return np.where(inside, spline(np.where(inside, position, load.middle)), np.nan)


def inertia_at(
    load: LoadOverPosition, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Inertia force m(x) a + m'(x) v^2 / 2 [N], shape (n,), from position [m], velocity [m/s], acceleration [m/s2].

    Source: Lagrange's equation of one degree of freedom with mass m(x); a parabola for m(x) is our choice.
    """
    terms = _inertia_terms(position - load.middle, velocity, acceleration)
    return np.asarray(terms @ np.array([load.mass, *load.mass_change]))


def _inertia_terms(place: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Inertia force of the masses 1, x and x^2, shape (n, 3)."""
    of_slope = place * acceleration + 0.5 * velocity**2
    return np.column_stack((acceleration, of_slope, place * (place * acceleration + velocity**2)))


def follows_position(signals: Signals, position: FloatArray, sliding: Sliding) -> bool:
    """Whether a force sum holds a load that follows position: the middle of both directions changes with it.

    The samples of even sliding are put into `CELLS` of the travel. Half the sum of the two directions in a cell holds
    load and offset, half their difference friction. A middle that changes over the travel by more than `LOADED` times
    the friction is a load (our choice).
    """
    even = even_sliding(signals, sliding) & np.isfinite(position)
    if not even.any() or np.ptp(position[even]) <= 0.0:
        return False
    x, force, side = position[even], signals.force_sum[even], signals.velocity[even] > 0.0
    cell = np.minimum((x - x.min()) / np.ptp(x) * CELLS, CELLS - 1).astype(np.int64)
    both = [c for c in range(CELLS) if (side & (cell == c)).any() and (~side & (cell == c)).any()]
    if len(both) < 2:
        return False
    means = np.array([[force[(cell == c) & (side == s)].mean() for s in (True, False)] for c in both])
    middle, friction = means.mean(axis=1), np.abs(means[:, 0] - means[:, 1]) / 2.0
    return bool(np.ptp(middle) > LOADED * float(np.median(friction)))


def fit_load(signals: Signals, position: FloatArray, chambers: Sequence[str], sliding: Sliding) -> LoadOverPosition:
    """Fit load and inertia over position, together with friction, to a log without load cell.

    The samples of each motion are averaged over `MEAN_OVER` (all terms alike, so nothing is blurred; a mean of the
    acceleration is a difference of velocities). The number of intervals of the spline and the terms of inertia and
    friction are those with which left-out pairs of strokes are predicted best; of models within one standard error and
    `NEGLIGIBLE_LOSS` of the best, the one with the fewest terms is taken, after [Breiman1984]_; the second bound and
    the limit `ILL_CONDITIONED` are our choice. ValueError: the load cannot be told from friction; one line with the
    reason and what to drive.

    The force sum is p_a A_a - p_b A_b; the position of the rod [m], shape (n,), is positive on extension.
    """
    motion = _strokes(signals, position, sliding)
    low, high = _shared_positions(motion)
    means = _means(signals, position, motion, low, high)
    model = _choose(means, chambers, low, high)
    load = _fitted(model, means)
    _check_friction(load)
    _check_same_load(model, means, load)
    return load


def without_load(signals: Signals, position: FloatArray, load: LoadOverPosition, sliding: Sliding) -> Signals:
    """Signals whose force sum is without load and inertia: what is left while the rod slides is friction.

    Samples beyond the positions of the load are left out. While the rod moves, velocity, pressures and the force that
    is left are centred means over `MEAN_OVER` within one motion: the noise of two pressures times their areas is
    often as large as the friction (our choice).
    """
    inertia = inertia_at(load, position, signals.velocity, np.gradient(signals.velocity, signals.time))
    force = signals.force_sum - load_at(load, position) - inertia
    cleaned = Signals(signals.time, *(column.copy() for column in (*signals[1:4], force)))
    usable: BoolArray = np.logical_and.reduce([np.isfinite(column) for column in cleaned])
    for direction, run in motions(signals, sliding):
        inside = run[usable[run]]
        if direction == 0 or len(inside) < 3:
            continue
        step = float(np.median(np.diff(signals.time[inside])))
        for part in np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1):
            for column in cleaned[1:]:
                column[part] = _centred_mean(column[part], max(round(MEAN_OVER / 2.0 / step), 1))
    return cleaned.taken(np.isfinite(load_at(load, position)) | ~np.isfinite(position))


def known_acceleration(load: LoadOverPosition) -> float:
    """Acceleration [m/s2] up to which the inertia is known to `KNOWN_INERTIA` of the friction; 0 without a mass."""
    return KNOWN_INERTIA * load.friction.mean / load.mass_std if load.mass_std > 0.0 else 0.0


def _centred_mean(values: FloatArray, half: int) -> FloatArray:
    """Mean over ``half`` samples on either side; fewer towards the ends, on both sides alike."""
    place = np.arange(len(values))
    reach = np.minimum(half, np.minimum(place, place[::-1]))
    total = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray((total[place + reach + 1] - total[place - reach]) / (2 * reach + 1))


class _Motion(NamedTuple):
    """Samples of each stroke."""

    runs: list[IntArray]  # samples of each motion without a pause, in order of time
    stroke: IntArray  # number of the stroke of each run
    direction: IntArray  # of each run
    places: tuple[FloatArray, FloatArray]  # [m] where the rod moved out, and where back


def _strokes(signals: Signals, position: FloatArray, sliding: Sliding) -> _Motion:
    """Motions of the log, joined to strokes: motions in one direction, one after the other, are one stroke."""
    has_position = np.isfinite(position)
    if has_position.mean() < 0.99:
        raise ValueError(
            f'{int((~has_position).sum())} of {len(position)} samples have no position: the load follows it: '
            'record the position'
        )
    usable = has_position & np.isfinite(signals).all(axis=0)
    moved = [(side, run[usable[run]]) for side, run in motions(signals, sliding) if side]
    moved = [(side, run) for side, run in moved if len(run) > 2]
    places = [np.concatenate([np.empty(0), *(position[run] for side, run in moved if side == s)]) for s in (1, -1)]
    travel = float(np.ptp(np.concatenate(places))) if moved else 0.0
    if travel <= 0.0:
        raise ValueError('the position does not change: record that of the rod, or drive strokes in both directions')
    joined: list[tuple[int, list[IntArray]]] = []
    for side, run in moved:
        if joined and joined[-1][0] == side:
            joined[-1][1].append(run)
        else:
            joined.append((side, [run]))
    long = [(s, runs) for s, runs in joined if np.ptp(position[np.concatenate(runs)]) > SHORTEST_STROKE * travel]
    counts = [sum(side == s for side, _ in long) for s in (1, -1)]
    if not all(counts):
        raise ValueError(
            f'{counts[0]} strokes out and {counts[1]} back do not tell a load that follows position from friction: '
            'drive the same way out and back, better three times, at two speeds'
        )
    flat = [(number, side, run) for number, (side, runs) in enumerate(long) for run in runs]
    return _Motion(
        [run for _, _, run in flat],
        np.array([number for number, _, _ in flat]),
        np.array([side for _, side, _ in flat]),
        (places[0], places[1]),
    )


def _shared_positions(motion: _Motion) -> tuple[float, float]:
    """Lowest and highest position [m] of the longest part of the travel that the rod passed in both directions."""
    lowest, highest = (float(f(np.concatenate(motion.places))) for f in (np.min, np.max))
    edges = np.linspace(lowest, highest, CELLS + 1)
    out, back = (np.histogram(places, edges)[0] >= 3 for places in motion.places)
    first, length = longest_stretch(out & back)
    share = length / max(int((out | back).sum()), 1)
    if share < SMALLEST_SHARE:
        ranges = [f'{p.min():.3g} to {p.max():.3g} m' for p in motion.places]
        raise ValueError(
            f'the two directions share {100.0 * share:.0f} % of the positions (out {ranges[0]}, back {ranges[1]}), so '
            'a load that follows position cannot be told from friction: drive the same way out and back'
        )
    return float(edges[first]), float(edges[first + length])


class _Means(NamedTuple):
    """Means over `MEAN_OVER`, one row each, and the samples that they are made from."""

    starts: IntArray  # first sample of each row
    counts: FloatArray  # samples of each row, shape (rows,)
    stroke: IntArray  # shape (rows,)
    direction: FloatArray  # shape (rows,)
    group: IntArray  # strokes out and back are left out together, of one pair parts of the way, shape (rows,)
    position: FloatArray  # [m] of the samples, shape (samples,)
    acceleration: FloatArray  # [m/s2] shape (rows,)
    speed: FloatArray  # [m/s] shape (rows,)
    pressures: FloatArray  # [Pa] of chambers a and b, not below 0, shape (rows, 2)
    force: FloatArray  # [N] shape (rows,)
    velocity: FloatArray  # [m/s] of the samples
    sample_acceleration: FloatArray  # [m/s2] of the samples

    def of(self, values: FloatArray) -> FloatArray:
        """Mean of ``values``, shape (samples, ...), in each row."""
        count = self.counts.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray(np.add.reduceat(values, self.starts, axis=0) / count)


def _means(signals: Signals, position: FloatArray, motion: _Motion, low: float, high: float) -> _Means:
    acceleration = np.gradient(signals.velocity, signals.time)
    samples: list[IntArray] = []
    starts: list[int] = []
    rows: list[tuple[int, int, int]] = []  # count, stroke, direction
    total = 0
    for run, stroke, side in zip(motion.runs, motion.stroke, motion.direction, strict=True):
        inside = run[(position[run] >= low) & (position[run] <= high) & np.isfinite(acceleration[run])]
        for part in np.split(inside, np.flatnonzero(np.diff(signals.time[inside]) > LONGEST_GAP) + 1):
            if len(part) < 2:
                continue
            duration = float(signals.time[part[-1]] - signals.time[part[0]])
            pieces = np.array_split(part, min(max(round(duration / MEAN_OVER), 1), len(part) // 2))
            for piece in pieces:
                starts.append(total)
                rows.append((len(piece), int(stroke), int(side)))
                samples.append(piece)
                total += len(piece)
    index = np.concatenate(samples)
    count, stroke, direction = (np.array(column) for column in zip(*rows, strict=True))
    number = np.unique(stroke, return_inverse=True)[1]
    pairs = max((int(number.max()) + 1) // 2, 1)
    group = np.minimum(number // 2, pairs - 1) * min(pairs, MOST_GROUPS) // pairs
    if pairs == 1:
        place = np.add.reduceat(position[index], np.array(starts)) / count
        group = np.minimum((place - low) / (high - low) * MOST_GROUPS, MOST_GROUPS - 1).astype(np.int64)
    empty = np.empty(0)
    means = _Means(
        np.array(starts), count.astype(np.float64), number, direction.astype(np.float64), group,
        position[index], empty, empty, empty, empty, signals.velocity[index], acceleration[index],
    )  # fmt: skip
    both = np.column_stack((signals.pressure_a[index], signals.pressure_b[index]))
    return means._replace(
        acceleration=means.of(acceleration[index]),
        speed=means.of(np.abs(signals.velocity[index])),
        pressures=np.maximum(means.of(both), 0.0),  # the power of the mean: that of each sample would add its noise
        force=means.of(signals.force_sum[index]),
    )


class _Model(NamedTuple):
    """One choice of terms: columns of the linear fit."""

    knots: FloatArray  # [m]
    columns: FloatArray  # shape (rows, terms): load at the knots, inertia, friction
    inertia: int  # number of its terms
    names: tuple[str, ...]  # of the terms of the friction


def _spline_knots(low: float, high: float, intervals: int) -> FloatArray:
    """Points of a not-a-knot spline that has ``intervals`` equal polynomials, shape (intervals + 3,).

    All points but the second and the last but one are ends of intervals.
    """
    if intervals == 1:
        return np.linspace(low, high, 4)
    ends = np.linspace(low, high, intervals + 1)
    width = ends[1] - ends[0]
    return np.concatenate(([low, low + width / 2.0], ends[1:-1], [high - width / 2.0, high]))


_Terms = list[tuple[str, FloatArray]]  # name and column of each
_Choices = list[tuple[int, ...]]  # numbers of the terms of each choice


def _pressure_terms(means: _Means, chambers: Sequence[str]) -> tuple[_Terms, _Choices]:
    """Friction over pressure: none, P^m summed over what the seals see, or of one chamber; one exponent at a time."""
    bar = means.pressures / BAR
    seals = pressures_at_seals(chambers, *bar.T)
    seen = {'seals': seals} | {name: bar[:, [i]] for i, name in enumerate('ab') if [*chambers] != [name]}
    terms = [
        (f'P_{name}^{m:.3g}', (pressure**m).sum(axis=1))
        for name, pressure in seen.items()
        for m in EXPONENTS
        if np.ptp(pressure) > 0.0
    ]
    return terms, [(), *((i,) for i in range(len(terms)))]


def _speed_terms(means: _Means) -> tuple[_Terms, _Choices]:
    """Friction over speed: none, viscous, viscous and Stribeck."""
    fastest = float(np.quantile(means.speed, 0.95))
    scales = [share * fastest for share in STRIBECK_SPEEDS]
    falling = [(f'Stribeck {scale:.3g} m/s', np.exp(-means.speed / scale)) for scale in scales]
    return [('viscous', means.speed), *falling], [(), (0,), *((0, i + 1) for i in range(len(falling)))]


def _choose(means: _Means, chambers: Sequence[str], low: float, high: float) -> _Model:
    """The simplest model within one standard error of the best on left-out pairs of strokes."""
    inertia = means.of(_inertia_terms(means.position - (low + high) / 2.0, means.velocity, means.sample_acceleration))
    (over_pressure, pressures), (over_speed, speeds) = _pressure_terms(means, chambers), _speed_terms(means)
    terms = [('constant', np.ones(len(inertia))), *over_pressure, *over_speed]
    friction = means.direction[:, np.newaxis] * np.column_stack([column for _, column in terms])
    frictions = [
        (0, *(1 + i for i in p), *(1 + len(over_pressure) + i for i in v)) for p, v in product(pressures, speeds)
    ]
    needed = ROWS_PER_KNOT * (INTERVALS[0] + 3)
    if len(means.force) < needed:
        raise ValueError(
            f'{len(means.force) * MEAN_OVER:.1f} s of motion over the same positions are too few to tell a load that '
            f'follows position from friction, {needed * MEAN_OVER:.1f} s are needed: drive more strokes out and back'
        )
    choices: list[tuple[FloatArray, FloatArray, int, tuple[int, ...]]] = []
    losses: list[FloatArray] = []
    for intervals in INTERVALS:
        if intervals + 3 > len(means.force) // ROWS_PER_KNOT:
            break
        knots = _spline_knots(low, high, intervals)
        of_load = means.of(CubicSpline(knots, np.eye(len(knots)), bc_type='not-a-knot')(means.position))
        k, everything = len(knots), np.column_stack((of_load, inertia, friction))
        normal = _normal(everything, means)
        for masses, chosen in product(range(4), frictions):
            index = np.array([*range(k + masses), *(k + 3 + i for i in chosen)])
            if not choices or _condition_number(normal, index) <= ILL_CONDITIONED:
                choices.append((knots, everything, masses, chosen))
                losses.append(_left_out_losses(normal, index))
    excess = np.array(losses) - min(losses, key=np.mean)
    error = excess.std(axis=1, ddof=1) / np.sqrt(excess.shape[1])
    count = np.array([len(knots) + masses + len(chosen) for knots, _, masses, chosen in choices])
    least = max(min(float(loss.mean()) for loss in losses), 0.0)  # of exact data it is rounding, of either sign
    near = np.flatnonzero(excess.mean(axis=1) <= np.minimum(error, NEGLIGIBLE_LOSS * least))
    knots, everything, masses, chosen = choices[min(near, key=lambda i: (count[i], excess[i].mean()))]
    k = len(knots)
    columns = everything[:, [*range(k + masses), *(k + 3 + i for i in chosen)]]
    return _Model(knots, columns, masses, tuple(terms[i][0] for i in chosen))


class _Normal(NamedTuple):
    """Normal equations of each group of strokes, columns of unit length."""

    size: FloatArray  # length of the columns, shape (terms,)
    matrices: FloatArray  # shape (groups, terms, terms)
    sides: FloatArray  # shape (groups, terms)
    squares: FloatArray  # [N2] of the force, shape (groups,)
    counts: FloatArray  # samples, shape (groups,)


def _normal(columns: FloatArray, means: _Means) -> _Normal:
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    weight = np.sqrt(means.counts)
    x, y = columns / size * weight[:, np.newaxis], means.force * weight
    parts = [means.group == group for group in np.unique(means.group)]
    return _Normal(
        size,
        np.array([x[part].T @ x[part] for part in parts]),
        np.array([x[part].T @ y[part] for part in parts]),
        np.array([float(y[part] @ y[part]) for part in parts]),
        np.array([means.counts[part].sum() for part in parts]),
    )


def _solved(matrices: FloatArray, sides: FloatArray) -> FloatArray:
    """Solution of each system, shape (..., terms), with a ridge far below the noise."""
    ridge = _RIDGE * np.trace(matrices, axis1=-2, axis2=-1)[..., np.newaxis, np.newaxis] * np.eye(matrices.shape[-1])
    return np.asarray(np.linalg.solve(matrices + ridge, sides[..., np.newaxis])[..., 0])


def _condition_number(normal: _Normal, index: IntArray) -> float:
    """Condition number of the columns ``index``, each of unit length."""
    values = np.linalg.eigvalsh(normal.matrices.sum(axis=0)[index[:, np.newaxis], index])
    return float(np.sqrt(values[-1] / max(values[0], 1e-300)))


def _left_out_losses(normal: _Normal, index: IntArray) -> FloatArray:
    """Mean squared deviation [N2] of each group, predicted from the others by the terms ``index``, shape (groups,)."""
    matrices, sides = normal.matrices[:, index[:, np.newaxis], index], normal.sides[:, index]
    found = _solved(matrices.sum(axis=0) - matrices, sides.sum(axis=0) - sides)
    fitted = np.einsum('gi,gij,gj->g', found, matrices, found)
    return np.asarray((normal.squares - 2.0 * np.einsum('gi,gi->g', found, sides) + fitted) / normal.counts)


def _fitted(model: _Model, means: _Means) -> LoadOverPosition:
    size, matrices, sides, *_ = _normal(model.columns, means)
    values = _solved(matrices.sum(axis=0), sides.sum(axis=0)) / size
    estimates = _solved(matrices.sum(axis=0) - matrices, sides.sum(axis=0) - sides) / size
    k, m = len(model.knots), model.inertia
    masses = np.concatenate((values[k : k + m], np.zeros(3 - m)))
    weights = means.counts / means.counts.sum()
    friction_columns = means.direction[:, np.newaxis] * model.columns[:, k + m :]
    at_mean = weights @ friction_columns
    errors = jackknife_errors(np.column_stack((estimates, estimates[:, k + m :] @ at_mean)))
    scaled = model.columns / np.maximum(np.linalg.norm(model.columns, axis=0), 1e-300)
    residual = means.force - model.columns @ values
    return LoadOverPosition(
        knots=model.knots,
        forces=values[:k],
        std=errors[:k],
        mass=float(masses[0]),
        mass_change=(float(masses[1]), float(masses[2])),
        mass_std=float(errors[k]) if m else 0.0,
        friction=FrictionTerms(model.names, values[k + m :], float(values[k + m :] @ at_mean), float(errors[-1])),
        noise=float(np.sqrt(weights @ residual**2)),
        condition_number=float(np.linalg.cond(scaled)),
        strokes=int(means.stroke.max()) + 1,
        warnings=tuple(_inertia_warning(model, means)),
    )


def _inertia_warning(model: _Model, means: _Means) -> list[str]:
    """A warning if the acceleration follows the position, as with one sine: then inertia counts as load."""
    k = len(model.knots)
    acceleration = means.acceleration
    size = float(np.sqrt(np.average(acceleration**2, weights=means.counts)))
    if size < NOTICED_INERTIA:
        return []
    of_position = model.columns[:, :k]
    left = acceleration - of_position @ np.linalg.lstsq(of_position, acceleration, rcond=1e-10)[0]
    share = 1.0 - float(np.average(left**2, weights=means.counts)) / size**2
    if share < COLLINEAR_INERTIA:
        return []
    text = f'the acceleration is {100.0 * share:.0f} % a function of position, so load and inertia cannot be told apart'
    return [f'{text} (the friction can): drive strokes at two speeds']


def _check_friction(load: LoadOverPosition) -> None:
    friction = load.friction
    if friction.mean <= 0.0:
        raise ValueError(
            f'half the difference of the directions is {friction.mean:.4g} N, so friction would drive the rod: the '
            'sign of force sum, position or velocity is wrong (all are positive on extension), or an area'
        )
    if friction.standard_error > LARGEST_FRICTION_ERROR * friction.mean:
        raise ValueError(
            f'friction of {friction.mean:.4g} N has a standard error of {friction.standard_error:.2g} N over the '
            'strokes, so load and noise hide it: drive more strokes out and back, with the same load'
        )


def _check_same_load(model: _Model, means: _Means, load: LoadOverPosition) -> None:
    """Check that the load did not change between strokes.

    What is left of a stroke out and the next stroke back holds the change of the load in its mean, while an error of
    the friction cancels. The offset of each pair is compared with the median of all pairs.
    """
    k = len(model.knots)
    of_load = model.columns[:, :k] @ load.forces
    masses = np.array([load.mass, *load.mass_change])[: model.inertia]
    residual = means.force - of_load - model.columns[:, k:] @ np.concatenate((masses, load.friction.values))
    of_strokes = [means.stroke == stroke for stroke in np.unique(means.stroke)]
    direction = np.array([means.direction[inside][0] for inside in of_strokes])
    mean = np.array([np.average(residual[inside], weights=means.counts[inside]) for inside in of_strokes])
    scatter = np.array([residual[inside].std() / np.sqrt(inside.sum()) for inside in of_strokes])
    next_is_back = np.flatnonzero(direction[:-1] != direction[1:])
    offsets = (mean[next_is_back] + mean[next_is_back + 1]) / 2.0
    errors = np.hypot(scatter[next_is_back], scatter[next_is_back + 1])  # twice that of white noise: rows correlate
    change = np.abs(offsets - np.median(offsets))
    size = float(np.average(np.abs(of_load), weights=means.counts))
    worst = int(np.argmax(change - SURE_CHANGE * errors))
    if change[worst] > max(LARGEST_LOAD_CHANGE * size, SURE_CHANGE * errors[worst]):
        span = float(np.ptp(offsets))
        raise ValueError(
            f'the load changes between strokes by {span:.3g} N (mean load {size:.3g} N), so it is no function of '
            'position: drive all strokes with one load, and put logs with another load in files of their own'
        )
