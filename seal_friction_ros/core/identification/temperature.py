r"""Scale of the friction over temperature from readings whose temperature varied.

.. math:: \ln f_i = a_{cell} - k (T_i - T_0) + g\,x_i + e_i

A cell holds the readings at one pressure in one direction, and x what else varied within it: pressure, speed and, in a
run, the way of the rod and its square, which is run-in. Cells and x are taken off T and ln f first (Frisch and Waugh),
so k is the slope of what is left over what is left. Where four runs or more were made, cells reach across runs, and the
line goes through one point a run, since the friction of a seal differs from run to run without any temperature. With
fewer runs, cells end at the run, and the points are parts of a run.

Source: [FrischWaugh1933]_. One point a run, limits and numbers are our choice.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.friction.temperature import TemperatureScale, scale_at
from seal_friction_ros.core.identification.readings import FrictionReadings, contiguous_parts, numbered

FEWEST_RUNS = 4  # for cells that reach across runs
PARTS = 8  # contiguous parts of one run
FEWEST_READINGS = 12
LEAST_SPREAD = 2.0  # [K] standard deviation of what is left of the temperature
LEAST_SPAN = 8.0  # [K] from the lowest to the highest temperature
LARGEST_ERROR = 0.1  # [-] half width of the 95 % band of the friction at the ends of the temperatures
STEADY = 0.02  # [-] a pressure or speed that varies by less within its cell does not count
LARGEST_COEFFICIENT = 0.1  # [1/K] bound of `TemperatureScale`


class TemperatureFit(NamedTuple):
    """Slope of the friction over temperature."""

    reference: float  # [K] median of the readings
    coefficient: float  # [1/K] k
    error: float  # [1/K] standard deviation: half the 95 % band of k over 1.96
    lowest: float  # [K]
    highest: float  # [K]
    why_not: str  # why the readings do not identify k, and what to do; empty if they do

    @property
    def scale(self) -> TemperatureScale:
        """The part of a seal file."""
        return TemperatureScale(
            reference=self.reference,
            coefficient=self.coefficient,
            coefficient_std=self.error,
            lowest=self.lowest,
            highest=self.highest,
        )


def fit_temperature(readings: FrictionReadings) -> TemperatureFit | None:
    """Slope of the friction over temperature; None if the readings have no temperatures."""
    temperature = readings.temperature
    if not len(temperature):
        return None
    reference, low, high = (float(np.quantile(temperature, q)) for q in (0.5, 0.0, 1.0))

    def refused(why: str) -> TemperatureFit:
        return TemperatureFit(reference, 0.0, 0.0, low, high, why)

    if not np.isfinite(temperature).all():
        return refused('some readings have no temperature: record it throughout')
    if high - low < LEAST_SPAN:
        return refused(
            f'temperature varied by {high - low:.3g} K, {LEAST_SPAN:.0f} K are needed: repeat at other temperatures'
        )
    measured = readings.magnitudes(readings.offsets)
    if readings.count < FEWEST_READINGS or float(measured.min()) <= 0.0:
        return refused('too few readings, or friction near zero: record more strokes at each temperature')
    run, part, across = _runs(readings)
    cells = numbered(readings.level, readings.at.direction.astype(np.int64), *(() if across else (run,)))
    others = _others(readings, cells, across=across)
    warmth, friction = (_means(_left(column, cells, others), part) for column in (temperature, np.log(measured)))
    if float(warmth.std()) < LEAST_SPREAD:
        return refused(
            'temperature went with pressure, speed or the way of the rod, so its effect cannot be told from theirs: '
            'repeat the same strokes at other temperatures, while the machine warms up and while it cools'
        )
    slope, error = _line(warmth, friction)
    ends = BAND_95 * error * max(high - reference, reference - low)
    found = TemperatureFit(reference, -slope, error, low, high, '')
    if abs(slope) - BAND_95 * error > LARGEST_COEFFICIENT:
        return found._replace(
            why_not=f'the friction changes by {100.0 * abs(slope):.0f} % a kelvin, more than that of any seal: check '
            'the temperatures and their unit, and whether something else changed with them'
        )
    if ends > LARGEST_ERROR or abs(slope) > LARGEST_COEFFICIENT or error > LARGEST_COEFFICIENT:
        return found._replace(
            why_not=f'the friction at the ends of the temperatures is known to {100.0 * ends:.0f} % only: '
            'repeat more runs, further apart in temperature'
        )
    return found


def at_reference(readings: FrictionReadings, found: TemperatureFit) -> FrictionReadings:
    """Readings as they would have been at the reference temperature; offsets of the force sum stay."""
    law = found.scale
    share = 1.0 / np.array([scale_at(law, one) for one in readings.temperature.tolist()])
    return readings.scaled(share, readings.offsets)


def _runs(readings: FrictionReadings) -> tuple[IntArray, IntArray, bool]:
    """Run of each reading, group of its error, and whether cells reach across runs."""
    run = readings.group if readings.left_out_by == 'test' else readings.source
    if len(np.unique(run)) >= FEWEST_RUNS:
        return run, run, True
    return run, run * PARTS + contiguous_parts(PARTS, run), False


def _others(readings: FrictionReadings, cells: IntArray, *, across: bool) -> list[FloatArray]:
    """What varied besides temperature, one column each."""
    found = [
        column
        for column in (readings.seal_pressure, np.abs(readings.at.velocity))
        if np.isfinite(column).all() and float(_centred(column, cells).std()) > STEADY * float(column.mean())
    ]
    if not across and len(readings.travel):
        for source in np.unique(readings.source):
            here = readings.source == source
            way = np.where(here, readings.travel, 0.0) / max(float(np.ptp(readings.travel[here])), 1e-12)
            found += [way, way**2]
    return found


def _means(column: FloatArray, part: IntArray) -> FloatArray:
    """Mean of each part."""
    return np.array([column[part == one].mean() for one in np.unique(part)])


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Slope of a line and its standard deviation, by which 1.96 of it are the 95 % band of Student's t."""
    x, y = x - x.mean(), y - y.mean()
    square, freedom = float(x @ x), len(x) - 2
    slope = float(x @ y) / square
    error = math.sqrt(float(np.sum((y - slope * x) ** 2)) / freedom / square)
    return slope, error * float(stdtrit(freedom, 0.975)) / BAND_95


def _centred(column: FloatArray, cells: IntArray) -> FloatArray:
    """Column less the mean of each cell."""
    count = np.bincount(cells)
    return np.asarray(column - (np.bincount(cells, column) / np.maximum(count, 1))[cells])


def _left(column: FloatArray, cells: IntArray, others: list[FloatArray]) -> FloatArray:
    """What cells and other columns leave of a column."""
    column = _centred(column, cells)
    if not others:
        return column
    design = np.column_stack([_centred(other, cells) for other in others])
    size = np.linalg.norm(design, axis=0)
    design = design[:, size > 0.0] / size[size > 0.0]
    return np.asarray(column - design @ np.linalg.lstsq(design, column, rcond=1e-9)[0])
