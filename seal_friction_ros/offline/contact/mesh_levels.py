"""How far computed numbers depend on the mesh: the same computation on the next coarser and the next finer one."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import within_bounds
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.oring_contact.oring_case import OringNumerics
from seal_friction_ros.core.oring_contact.ring_friction import DISCRETISATION

MOST_MESH_ERROR = 0.05  # [-] change on the next mesh above which a number is called not converged (our choice)
COARSER, FINER = 0.7, 1.4  # lines of the other two meshes over those of the case


class MeshLevels(NamedTuple):
    """Numbers on three meshes."""

    lines: tuple[int, int, int]  # of the coarser mesh, the one in use, the finer one
    change: dict[str, tuple[float, ...]]  # [-] as of `change_of`, of each number: at each pressure, or once
    pressures: tuple[float, ...]  # [Pa, gauge]

    @property
    def marked(self) -> list[str]:
        """Numbers that change by more than `DISCRETISATION`, each with its largest change and where that is."""
        said = []
        for name, changes in self.change.items():
            worst = max(changes)
            where = f' at {self.pressures[changes.index(worst)] / BAR:.3g} bar' if len(changes) > 1 else ''
            if worst == np.inf:
                said.append(f'{name}{where} on this mesh only')
            elif worst > DISCRETISATION:
                said.append(f'{name} by {100.0 * worst:.2g} %{where}')
        return said

    @property
    def text(self) -> str:
        """A sentence; what is marked is named."""
        least, used, most = self.lines
        if not self.marked:
            worst = max(max(changes) for changes in self.change.values())
            return f'Mesh: {used} lines; {most} change no number by more than {100.0 * worst:.2g} %.'
        highest = max(max(changes) for changes in self.change.values())
        warning = ' Above 5 % a number is not converged: give more lines.' if highest > MOST_MESH_ERROR else ''
        return f'Mesh: {used} lines; {least} or {most} change by MORE THAN 3 %: {", ".join(self.marked)}.{warning}'

    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON."""
        return {**self._asdict(), 'marked': self.marked}


def other_lines(lines: int, factor: float) -> int:
    """Lines of a mesh with about ``factor`` times as many."""
    return int(within_bounds(OringNumerics, 'lines', round(factor * lines)))


def mesh_levels(
    lines: int, pressures: Sequence[float], found: Mapping[str, Any], compute: Callable[[int], Mapping[str, Any]]
) -> MeshLevels:
    """Change of the numbers that were ``found`` with so many ``lines``; ``compute`` gives those of other lines.

    A number is a value, or one at each of the ``pressures``; None is no number, which does not change. A mesh whose
    computation raises a ValueError has no numbers.
    """
    coarser, finer = other_lines(lines, COARSER), other_lines(lines, FINER)
    levels = []
    for count in (coarser, finer):
        with suppress(ValueError):
            levels.append(compute(count))
            continue
        levels.append({})
    change = {}
    for name, value in found.items():
        here = _values(value)
        if len(here):
            other = [_values(level[name]) if level else np.full(len(here), np.nan) for level in levels]
            change[name] = tuple(np.where(np.isnan(here), 0.0, change_of(other[0], here, other[1])).tolist())
    return MeshLevels((coarser, lines, finer), change, tuple(pressures))


def change_of(coarser: FloatArray, here: FloatArray, finer: FloatArray) -> FloatArray:
    """Relative change of numbers on the next finer mesh [-], each of shape (n,), and at least half that on the coarser.

    Half is what second order leaves, so two meshes that agree by chance hide nothing (our choice). NaN are numbers that
    a mesh has not: without the finer mesh it is the change on the coarser one, without both it is infinite.
    """
    down, up = (np.abs(other / here - 1.0) for other in (coarser, finer))
    change = np.where(np.isnan(up), down, np.fmax(up, 0.5 * down))
    return np.asarray(np.nan_to_num(change, nan=np.inf))


def _values(value: Any) -> FloatArray:
    return np.array([] if value is None else np.atleast_1d(value), dtype=float)
