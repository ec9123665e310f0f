"""Wall on which the seal slides: its control edge, and its film of lubricant."""

from dataclasses import dataclass

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True)
class ControlEdge(CheckedParameters):
    """Chamfer at the right end of the seat: beyond it the wall falls back and the seal hangs free.

    All values are our choice: the paper names a control edge and gives no shape of it.
    """

    position: float = parameter(
        0.3e-3, unit='m', lower=-1.0, upper=1.0, description='Where the chamfer begins, along the wall.'
    )
    slope: float = parameter(0.36, unit='1', lower=0.01, upper=2.0, description='Of the chamfer; 0.36 is 20 degrees.')
    depth: float = parameter(60e-6, unit='m', lower=1e-6, upper=1e-2, description='How far the wall falls back.')
    rounding: float = parameter(
        20e-6, unit='m', lower=1e-7, upper=1e-3, description='Length over which both corners are rounded.'
    )

    def fall(self, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Depth of the wall below the seat [m] and its slope at each ``place`` [m]; each corner is a hyperbola."""
        length = self.depth / self.slope
        begin, end = place - self.position, place - self.position - length
        root_begin = np.sqrt(begin**2 + self.rounding**2)
        root_end = np.sqrt(end**2 + self.rounding**2)
        fall = 0.5 * self.slope * (length + root_begin - root_end)
        return fall, 0.5 * self.slope * (begin / root_begin - end / root_end)


@dataclass(frozen=True)
class FilmSupply(CheckedParameters):
    """Limited lubricant on the wall outside the seal: the initial film and what the strokes leave.

    Without this part of a case the seal is flooded.

    Source: spool-valve paper, section 7.4; O. Feuchtmueller et al. 2021 for the film that a stroke leaves.
    """

    initial_film: float = parameter(
        0.6e-6, unit='m', lower=1e-9, upper=1e-3, description='Film on the wall before the first stroke (our choice).'
    )


class WallFilm:
    """Lubricant on cells of the wall; its total volume is conserved. Immutable: each move returns a new film.

    The volume of a cell that the seal covers in part lies in the uncovered part.

    Args:
        start: Left end of the first cell [m].
        width: Of a cell [m].
        volume: In each cell per length of circumference [m^2], shape (n,).
    """

    def __init__(self, start: float, width: float, volume: FloatArray) -> None:
        self.start, self.width, self.volume = start, width, volume

    def _overlap(self, left: float, right: float) -> FloatArray:
        edges = self.start + self.width * np.arange(len(self.volume) + 1)
        return np.asarray(np.clip(np.minimum(edges[1:], right) - np.maximum(edges[:-1], left), 0.0, None))

    def ahead(self, left: float, right: float, seal_left: float, seal_right: float) -> FloatArray:
        """Volume [m^2] of each cell that lies between ``left`` and ``right``, both outside the seal [m]."""
        free = self.width - self._overlap(seal_left, seal_right)
        share = np.divide(self._overlap(left, right), free, out=np.zeros_like(free), where=free > 1e-9 * self.width)
        return self.volume * np.minimum(share, 1.0)

    def moved(
        self, taken: FloatArray, given_back: float, back_at: float, left: float, right: float, laid: float
    ) -> 'WallFilm':
        """The film after a step.

        Args:
            taken: Volume taken from each cell [m^2], shape (n,).
            given_back: Part of it that did not fit under the seal and is pushed ahead [m^2].
            back_at: Position of that part [m].
            left: Left end of the wall that the seal has uncovered [m].
            right: Right end of it [m].
            laid: Volume left there [m^2].
        """
        volume = self.volume - taken
        volume[self._cell(back_at)] += given_back
        stretch = self._overlap(left, right)
        total = stretch.sum()
        if total > 0.0:
            volume = volume + laid * stretch / total
        else:
            volume[self._cell(left)] += laid
        return WallFilm(self.start, self.width, volume)

    def _cell(self, place: float) -> int:
        return min(max(int((place - self.start) / self.width), 0), len(self.volume) - 1)
