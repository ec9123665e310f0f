"""The estimator beside simpler ones, on logs of a ram: what was known before, and what was seen then.

``python test/system/compare_estimators.py FOLDER [--figure nis.png]`` with logs of the mbari rig in FOLDER. Each
estimator is given what one log shows (seal file, least squares) and runs over another, causal. Where |v| > 10 mm/s and
|a| < 0.05 m/s2, in N:

- ``1 step``, ``0.5 s``, ``2 s``: RMS of the force sum less what was known that long before;
- ``reversal``: the same in the first 0.3 s of a stroke, known at the end of the stroke before;
- ``friction``: RMS of the force sum less the friction known one sample before, and less one offset for the whole log.

The figure shows the share of innovations whose normalised square (NIS) is above a value, beside chi-square.
"""

import itertools
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[1]))
from harness.campaign import parser_of, run_command, tell_tables

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.estimator import init, step
from seal_friction_ros.core.estimation.records import RodSample
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.actuator import friction_of_seals
from seal_friction_ros.core.friction.force_sum_correction import corrected_force_sum
from seal_friction_ros.core.messages.coder import DECODERS
from seal_friction_ros.core.messages.records import Force, Pressure, Velocity
from seal_friction_ros.offline.bags.bag import read_messages
from seal_friction_ros.offline.replay.replay import chosen_configuration

SLOWEST, LARGEST_ACCELERATION = 0.01, 0.05  # [m/s], [m/s^2]
COLUMNS = ('1 step', '0.5 s', '2 s', 'reversal', 'friction')


class Log(NamedTuple):
    """Signals of a log, of shape (n,)."""

    time: np.ndarray  # [s]
    velocity: np.ndarray  # [m/s]
    pressure_a: np.ndarray  # [Pa]
    pressure_b: np.ndarray  # [Pa]
    force: np.ndarray  # [N]

    @property
    def is_even(self) -> np.ndarray:
        """Where the rod slides evenly."""
        acceleration = np.gradient(self.velocity, self.time)
        return (np.abs(self.velocity) > SLOWEST) & (np.abs(acceleration) < LARGEST_ACCELERATION)


class Known(NamedTuple):
    """A linear model: the force sum is terms times values known after each sample; the last term is no friction."""

    terms: np.ndarray  # (n, k)
    values: np.ndarray  # (n, k) after each sample


def read_log(bag: Path) -> Log:
    """Samples of a bag, with the newest pressure and force sum of each velocity."""
    rows, pressure, force = [], None, None
    for message in read_messages(bag):
        record = DECODERS[message.type_name](message.data) if message.type_name in DECODERS else None
        if isinstance(record, Pressure):
            pressure = record
        elif isinstance(record, Force):
            force = record
        elif isinstance(record, Velocity) and pressure and force:
            rows.append((record.stamp * 1e-9, record.velocity, pressure.chamber_a, pressure.chamber_b, force.force))
    return Log(*np.array(rows).T)


def simple_terms(log: Log) -> np.ndarray:
    """Coulomb friction, viscous friction, Coulomb friction by the pressure difference, offset."""
    sign = np.sign(log.velocity)
    difference = np.abs(log.pressure_a - log.pressure_b) * 1e-5
    return np.c_[sign, log.velocity, sign * difference, np.ones_like(sign)]


def least_squares(log: Log) -> tuple[np.ndarray, np.ndarray, float]:
    """Values, their covariance and the RMS of the misfit."""
    terms, force = simple_terms(log)[log.is_even], log.force[log.is_even]
    values = np.linalg.lstsq(terms, force, rcond=None)[0]
    noise = float(np.std(force - terms @ values))
    return values, np.linalg.inv(terms.T @ terms) * noise**2, noise


def fixed(learnt_on: Log, log: Log) -> Known:
    """Least squares of the other log, and an offset that forgets in half a second."""
    values, terms = least_squares(learnt_on)[0].copy(), simple_terms(log)
    known, share = [], float(np.median(np.diff(log.time))) / 0.5
    for row, force, learns in zip(terms, log.force, log.is_even, strict=True):
        if learns:
            values[3] += share * (force - row @ values)
        known.append(values.copy())
    return Known(terms, np.array(known))


def tuned_recursive(learnt_on: Log, log: Log) -> Known:
    """Recursive least squares with the forgetting that is best one step ahead on the first log."""
    memory = min(
        (2.0, 5.0, 10.0, 20.0), key=lambda each: errors(learnt_on, recursive(learnt_on, learnt_on, each))['1 step']
    )
    return recursive(learnt_on, log, memory)


def recursive(learnt_on: Log, log: Log, memory: float) -> Known:
    """Recursive least squares with forgetting, ``memory`` in [s]."""
    values, covariance, noise = least_squares(learnt_on)
    covariance, terms = covariance * 100.0 / noise**2, simple_terms(log)
    kept, known = float(np.exp(-np.median(np.diff(log.time)) / memory)), []
    for row, force, learns in zip(terms, log.force, log.is_even, strict=True):
        if learns:
            gain = covariance @ row / (kept + row @ covariance @ row)
            values = values + gain * (force - row @ values)
            covariance = (covariance - np.outer(gain, row @ covariance)) / kept
        known.append(values.copy())
    return Known(terms, np.array(known))


def plain_kalman(learnt_on: Log, log: Log) -> Known:
    """A Kalman filter of the same four terms, random walks, noise of the misfit."""
    values, covariance, noise = least_squares(learnt_on)
    covariance, terms = covariance * 100.0, simple_terms(log)
    walk = np.square([0.01, 0.02, 0.001, 0.02]) * np.square([noise, noise, noise, noise])
    walk, known = walk * float(np.median(np.diff(log.time))), []
    for row, force, learns in zip(terms, log.force, log.is_even, strict=True):
        if learns:
            covariance = covariance + np.diag(walk)
            gain = covariance @ row / (row @ covariance @ row + noise**2)
            values = values + gain * (force - row @ values)
            covariance = covariance - np.outer(gain, row @ covariance)
        known.append(values.copy())
    return Known(terms, np.array(known))


def package(seal: Path, log: Log) -> tuple[dict[str, float], list[float]]:
    """Errors of the package, by the state of its filter, shares of good samples and of those in their band; NIS.

    The force sum is that of the seal file, which corrects the areas.
    """
    given = chosen_configuration(None, seal).parameters().estimator
    parameters = replace(given, adaptation=AdaptationSettings('on'))
    state, terms, values, seen, corrected, squares = init(parameters), [], [], [], [], []
    for time, velocity, a, b, force in zip(*(signal.tolist() for signal in log), strict=True):
        stamp = round(time * 1e9)
        sample = RodSample(stamp, velocity, Pressure(stamp, a, b), Force(stamp, force))
        state, estimate = step(parameters, state, sample)
        friction = friction_of_seals(parameters.seal_numbers, a, b, velocity)
        law, sign = friction.coulomb_friction + friction.velocity_friction, float(np.sign(velocity))
        terms.append((sign * law, sign, velocity, law, 1.0))
        corrected.append(corrected_force_sum(parameters.force_sum_correction, force, a, b))
        known = state.adaptation.filter
        if known.stamp == state.adaptation.stamp:
            squares.append((known.outliers.last / known.innovation_std) ** 2)
        scale, coulomb, viscous, asymmetry, offset, _, remainder, misfit = known.terms
        values.append((scale, coulomb + misfit, viscous, asymmetry, offset + remainder))
        seen.append((estimate.status, estimate.residual, estimate.coulomb_friction_std))
    status, residual, std = np.array(seen)[log.is_even].T
    good = status == 0
    quality = {'good': float(good.mean()), 'in_band': float(np.mean(np.abs(residual[good]) < BAND_95 * std[good]))}
    found = errors(log._replace(force=np.array(corrected)), Known(np.array(terms), np.array(values)))
    return found | quality, squares


def errors(log: Log, known: Known) -> dict[str, float]:
    """The columns of the table [N]."""
    even, interval = np.flatnonzero(log.is_even), float(np.median(np.diff(log.time)))

    def missed(before: np.ndarray, now: np.ndarray) -> np.ndarray:
        return log.force[now] - np.einsum('ij,ij->i', known.terms[now], known.values[before])

    def rms(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.square(values))))

    found = {}
    for name, lag in (('1 step', 1), ('0.5 s', round(0.5 / interval)), ('2 s', round(2.0 / interval))):
        now = even[even >= lag]
        found[name] = rms(missed(now - lag, now))
    strokes = [list(group) for _, group in itertools.groupby(even, key=lambda i: log.velocity[i] > 0.0)]
    pairs = [
        (before[-1], i)
        for before, after in itertools.pairwise(strokes)
        for i in after
        if log.time[i] - log.time[after[0]] <= 0.3
    ]
    found['reversal'] = rms(missed(*np.array(pairs).T))
    now = even[even >= 1]
    friction = np.einsum('ij,ij->i', known.terms[now, :-1], known.values[now - 1, :-1])
    found['friction'] = float(np.std(log.force[now] - friction))
    return found


def draw(path: Path, squares: Mapping[str, list[float]]) -> None:
    """Share of innovations whose NIS is above a value, for each pair of logs."""
    figure = Figure(figsize=(6.4, 3.6), layout='constrained')
    axes, levels = figure.subplots(), np.linspace(0.0, 16.0, 400)
    axes.semilogy(levels, chi2.sf(levels, 1), 'k--', label='chi-square, one degree of freedom')
    for name, values in squares.items():
        axes.semilogy(levels, [float(np.mean(np.array(values) > level)) for level in levels], label=name)
    axes.set(xlabel='NIS: squared innovation over its variance [-]', ylabel='share above [-]', ylim=(1e-4, 1.0))
    axes.legend(fontsize='small')
    figure.savefig(path, dpi=150, metadata={'Software': None})


def seals_and_logs(folder: Path, work: Path) -> dict[str, tuple[Path, Log]]:
    """Seal file that each log of a folder gives, and the log, by its name."""
    found = {}
    for path in sorted(folder.glob('*.exp')):
        bag, seal = work / path.stem, work / f'{path.stem}.yaml'
        run_command('import', 'log', path, '--rig', 'mbari', '--out', bag)
        run_command('identify', path, '--rig', 'mbari', '--out', seal)
        found[path.stem] = seal, read_log(bag)
    return found


def compared(folder: Path, work: Path, figure: Path | None = None) -> dict[str, dict[str, dict[str, float]]]:
    """Errors of every estimator for every ordered pair of logs."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    squares: dict[str, list[float]] = {}
    for (one, (seal, learnt_on)), (other, (_, log)) in itertools.permutations(seals_and_logs(folder, work).items(), 2):
        ours, squares[f'{one} -> {other}'] = package(seal, log)
        table[f'{one} -> {other}'] = {
            'least squares, offset of 0.5 s': errors(log, fixed(learnt_on, log)),
            'recursive least squares': errors(log, tuned_recursive(learnt_on, log)),
            'plain Kalman filter': errors(log, plain_kalman(learnt_on, log)),
            'this package': ours,
        }
    if figure:
        draw(figure, squares)
    return table


def main() -> int:
    """Run and print; exit code 1 if recursive least squares is better anywhere."""
    parser = parser_of(__doc__)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--figure', type=Path, help='PNG of the normalised innovations squared')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        table = compared(arguments.folder, Path(work), arguments.figure)
    tell_tables(table, as_json=arguments.json)
    return int(any(r['this package'][c] > r['recursive least squares'][c] for r in table.values() for c in COLUMNS))


if __name__ == '__main__':
    sys.exit(main())
