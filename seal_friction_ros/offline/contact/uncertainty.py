"""How far a computed friction may be off: its samples, with what is not known drawn anew for each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.unknowns import Unknown

QUANTILES = (0.05, 0.5, 0.95)
_ONE_STD = (0.1587, 0.8413)  # shares of a normal distribution below minus and plus one standard deviation


def check_unknown(name: str, unknowns: Sequence[Unknown]) -> None:
    """Check that something is unknown in the case of this ``name``; ValueError: nothing is."""
    if not unknowns:
        raise ValueError(f'case {name} does not say what is unknown: give it the key unknown, see docs/ehl.md')


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Samples of a force over pressure and speed; ValueError: fewer than two samples could be computed."""

    seed: int
    names: tuple[str, ...]  # of the unknowns
    drawn: FloatArray  # values of the unknowns, shape (samples, unknowns)
    failed: Mapping[int, str]  # reason by number of the sample, from 0
    pressures: tuple[float, ...]  # [Pa, gauge]
    speeds: tuple[float, ...]  # [m/s]; empty: the force does not depend on it
    nominal: FloatArray  # [N] of the case itself, shape (pressures, speeds) or (pressures,)
    computed: FloatArray  # [N] of the samples that did not fail, shape (k, *nominal.shape)

    def __post_init__(self) -> None:
        if len(self.computed) < 2:
            reason = next(iter(self.failed.values()), 'give more samples')
            raise ValueError(f'{len(self.computed)} of {len(self.drawn)} samples could be computed: {reason}')

    @property
    def quantiles(self) -> FloatArray:
        """Force that a share `QUANTILES` of the samples does not exceed [N], shape (3, *nominal.shape).

        With fewer than ten samples the outer two are the lowest and the highest sample.
        """
        return _quantiles(self.computed, QUANTILES)

    @property
    def relative_stds(self) -> FloatArray:
        r"""Relative standard deviation at each pressure and speed [-], shape as ``nominal``.

        The samples are skew, so a band of one number has to reach to the farther side: with the force F of the case and
        the quantiles q of 15.87 % and 84.13 %

        .. math:: s = \max(|q_{16} - F|, |q_{84} - F|) / F

        which is the relative standard deviation of a normal distribution about F (our choice).
        """
        sides = np.abs(_quantiles(self.computed, _ONE_STD) - self.nominal).max(axis=0)
        return np.asarray(sides / self.nominal)

    @property
    def relative_std(self) -> float:
        """One number for a seal file: the largest of `relative_stds`."""
        return float(self.relative_stds.max())

    @property
    def rank_correlations(self) -> dict[str, float]:
        """Rank correlation of each unknown with the force, mean over the pressures and speeds [-].

        About 1 / sqrt(samples) off: less says nothing.
        """
        kept = np.delete(self.drawn, sorted(self.failed), axis=0)
        forces = _ranks(self.computed.reshape(len(kept), -1))
        return {
            name: fmean(float(np.corrcoef(column, force)[0, 1]) for force in forces.T)
            for name, column in zip(self.names, _ranks(kept).T, strict=True)
        }

    def numbers(self, quantity: str = 'friction_N') -> dict[str, Any]:
        """Numbers for JSON; the force is the ``quantity``."""
        quantiles = {
            f'{quantity}_{100.0 * share:g}_percent': values.tolist()
            for share, values in zip(QUANTILES, self.quantiles, strict=True)
        }
        return {
            'samples': len(self.drawn),
            'seed': self.seed,
            **({'speed_m_s': self.speeds} if self.speeds else {}),
            'pressure_Pa': self.pressures,
            quantity: self.nominal.tolist(),
            **quantiles,
            'relative_std': self.relative_std,
            'rank_correlation': self.rank_correlations,
            'failed': [
                {'values': dict(zip(self.names, self.drawn[number].tolist(), strict=True)), 'reason': reason}
                for number, reason in self.failed.items()
            ],
        }

    def summary(self) -> str:
        """Lines for a person: the spread, what drives it, and samples that failed."""
        low, _, high = self.quantiles / self.nominal
        most = sorted(self.rank_correlations.items(), key=lambda one: -abs(one[1]))[:3]
        lines = [
            f'{len(self.drawn)} samples: 90 % of them at {low.min():.3g} to {high.max():.3g} times the friction, '
            f'relative_std {self.relative_std:.3g}; rank correlation '
            + ', '.join(f'{name} {value:+.2f}' for name, value in most)
        ]
        if self.failed:
            first = next(iter(self.failed.values()))
            lines.append(f'samples left out since they cannot be computed: {len(self.failed)}; the first: {first}')
        return '\n'.join(lines)


def _quantiles(samples: FloatArray, shares: Sequence[float]) -> FloatArray:
    """Quantiles along the first axis; sample k of N stands for the middle of the kth of N equal parts (Hazen)."""
    return np.asarray(np.quantile(samples, shares, axis=0, method='hazen'))


def _ranks(columns: FloatArray) -> FloatArray:
    """Rank of each value in its column."""
    return np.asarray(np.argsort(np.argsort(columns, axis=0), axis=0), dtype=float)
