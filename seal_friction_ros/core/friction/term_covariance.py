"""Covariance of the terms of an identified law: how far off they are together."""

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter

ROUNDING = 1e-4  # [-] smallest eigenvalue of a correlation below 0 that is one of rounded numbers


@dataclass(frozen=True, kw_only=True)
class TermCovariance(CheckedParameters):
    """Standard deviations of the parameters of one seal and their correlation, by the runs that they were fitted to.

    The spread between runs is not in it: that is in the uncertainty of the seal. ValueError: A term is named twice, a
    number is missing or out of bounds, or no numbers can correlate like this.
    """

    terms: tuple[str, ...] = parameter(unit='', description='Parameters of the law and of the velocity terms.')
    std: tuple[float, ...] = parameter(
        unit='', lower=0.0, upper=1e9, description='Standard deviation of each, in the unit of the parameter.'
    )
    correlation: tuple[float, ...] = parameter(
        (), unit='1', lower=-1.0, upper=1.0, description='Of each pair: 1 and 2, 1 and 3, ..., 2 and 3, ...'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.terms)
        if not count or len(set(self.terms)) < count:
            raise ValueError(f'TermCovariance.terms = {list(self.terms)}: name each term once')
        for name, wanted in (('std', count), ('correlation', math.comb(count, 2))):
            given = len(getattr(self, name))
            if given != wanted:
                raise ValueError(f'TermCovariance.{name} has {given} numbers, {count} terms need {wanted}')
        if np.linalg.eigvalsh(self._correlations).min() < -ROUNDING:
            raise ValueError('TermCovariance.correlation: no terms can correlate like this: an eigenvalue is negative')

    @property
    def _correlations(self) -> FloatArray:
        found = np.eye(len(self.terms))
        for (one, other), value in zip(combinations(range(len(self.terms)), 2), self.correlation, strict=True):
            found[one, other] = found[other, one] = value
        return found

    @property
    def matrix(self) -> FloatArray:
        """Covariance of the terms, shape (terms, terms), in the products of their units."""
        return np.asarray(self._correlations * np.outer(self.std, self.std))
