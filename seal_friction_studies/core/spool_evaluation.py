"""Friction of a seal in reciprocating motion on a test rig, evaluated after the spool-valve paper.

The rig drives ten cycles; the ninth is evaluated. The force is averaged over samples and normalised by its mean in the
middle of the stroke, where the speed is constant. Before that, a notch filter removes the resonance of the measuring
chain (force transducer, joint, rod; 157 Hz in the paper), which does not depend on speed.

Source: spool-valve paper, chapters 4 (cycles), 6 (normalisation) and 7.3 (moving average). The paper names the
resonance (section 6.2) and averages over it: detection and notch are our choice.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import filtfilt, iirnotch

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter


@dataclass(frozen=True, kw_only=True)
class SpoolEvaluation(CheckedParameters):
    """Evaluation of a measurement of several cycles; the defaults are those of the paper.

    Raises:
        ValueError: A value is out of bounds, or ``evaluated_cycle`` is above ``cycles``.
    """

    cycles: int = parameter(10, unit='', lower=1, upper=10**6, description='Cycles that one measurement has.')
    evaluated_cycle: int = parameter(9, unit='', lower=1, upper=10**6, description='Cycle that is evaluated, from 1.')
    moving_average: int = parameter(50, unit='samples', lower=1, upper=10**6, description='Width of the average.')
    reference_half_width: float = parameter(
        0.5e-3, unit='m', lower=1e-6, upper=1.0, description='The reference force is the mean within +/- this.'
    )
    lowest_resonance: float = parameter(
        50.0, unit='Hz', lower=0.1, upper=1e5, description='Below it an oscillation belongs to the motion.'
    )
    resonance_prominence: float = parameter(
        2.2, unit='1', lower=1.0, upper=1e6, description='Hump over its two sides that makes a resonance.'
    )
    notch_quality: float = parameter(
        5.0, unit='1', lower=0.5, upper=1e3, description='Resonance over width of the notch.'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.evaluated_cycle > self.cycles:
            raise ValueError(
                f'SpoolEvaluation.evaluated_cycle = {self.evaluated_cycle} is above cycles = {self.cycles}'
            )


class SpoolFriction(NamedTuple):
    """Friction of one cycle over displacement."""

    displacement: FloatArray  # [m] from the middle of the stroke, shape (n,)
    velocity: FloatArray  # [m/s] shape (n,)
    force: FloatArray  # [N] as measured, shape (n,)
    filtered: FloatArray  # [N] resonance notched, then averaged, shape (n,)
    normalised: FloatArray  # [-] ``filtered`` over the reference force, shape (n,)
    reference_force: float  # [N]
    resonance: float | None  # [Hz] of the measuring chain; None if there is none


def cycle_starts(displacement: FloatArray) -> IntArray:
    """Index at which each cycle begins, and the end of the last one, shape (cycles + 1,).

    A cycle begins a quarter cycle before the upward crossing of the middle of the stroke. ``displacement`` [m], shape
    (n,), is that of a reciprocating motion.

    Raises:
        ValueError: There are not two crossings, so no cycle.
    """
    above = displacement > (float(displacement.max()) + float(displacement.min())) / 2.0
    rising = np.flatnonzero(~above[:-1] & above[1:]) + 1
    if len(rising) < 2:
        raise ValueError(f'{len(rising)} crossings of the middle of the stroke: no cycle: drive in both directions')
    period = round(float(np.median(np.diff(rising))))
    first = np.maximum(rising - period // 4, 0)
    return np.append(first, min(int(first[-1]) + period, len(displacement)))


def moving_average(values: FloatArray, width: int) -> FloatArray:
    """Mean of ``width`` samples around each one, shape (n,); ends are held (our choice).

    Source: spool-valve paper, section 7.3: "a moving average filter with a step width of 50".
    """
    return np.asarray(uniform_filter1d(values, width, mode='nearest'))


def resonance_frequency(time: FloatArray, force: FloatArray, law: SpoolEvaluation) -> float | None:
    """Resonance frequency of the measuring chain [Hz] in a force; None if there is none.

    The spectrum of a reciprocating motion has lines at all multiples of its frequency, which fall steadily; a resonance
    is a hump among them. The prominence is the ratio of the envelope (highest line within 10 Hz) to the larger of its
    values at two thirds and three halves of the frequency. The resonance is at the largest prominence, if that exceeds
    ``resonance_prominence``; its frequency is the mean of the lines under the hump, weighted by their power.
    ``time`` [s] has even steps, shape (n,).

    Source: spool-valve paper, section 6.2; the detection is our choice.
    """
    step = float(np.median(np.diff(time)))
    amplitude = np.abs(np.fft.rfft((force - force.mean()) * np.hanning(len(force))))
    frequency = np.fft.rfftfreq(len(force), step)
    width = max(round(20.0 / frequency[1]), 3)
    envelope = np.maximum(maximum_filter1d(amplitude, width), 1e-12 * amplitude.max())
    looked_at = np.flatnonzero((frequency > law.lowest_resonance) & (frequency < frequency[-1] / 1.5))
    if len(looked_at) < 10:
        return None
    sides = [np.interp(frequency[looked_at] * ratio, frequency, envelope) for ratio in (1.0 / 1.5, 1.5)]
    prominence = envelope[looked_at] / np.maximum(*sides)
    best = int(np.argmax(prominence))
    if not prominence[best] > law.resonance_prominence:
        return None
    near = np.abs(frequency - frequency[looked_at[best]]) <= 0.15 * frequency[looked_at[best]]
    return float(np.average(frequency[near], weights=amplitude[near] ** 2))


def without_resonance(time: FloatArray, force: FloatArray, resonance: float, law: SpoolEvaluation) -> FloatArray:
    """Force [N] with the resonance notched out, without delay, shape (n,).

    Raises:
        ValueError: The resonance is not below half the sampling rate.
    """
    rate = 1.0 / float(np.median(np.diff(time)))
    if not 0.0 < resonance < rate / 2.0:
        raise ValueError(f'a resonance of {resonance:.6g} Hz is not below half the sampling rate of {rate:.6g} Hz')
    return np.asarray(filtfilt(*iirnotch(resonance, law.notch_quality, fs=rate), force))


def reference_force(displacement: FloatArray, force: FloatArray, half_width: float) -> float:
    """Mean magnitude of the force [N] within +/- ``half_width`` [m] of the middle of the stroke, both directions.

    Source: spool-valve paper, chapter 6: the mean between -0.5 mm and 0.5 mm, where the speed is constant.

    Raises:
        ValueError: The stroke is shorter, or the force there is zero.
    """
    inside, reach = np.abs(displacement) <= half_width, float(np.abs(displacement).max())
    if not inside.any() or reach < half_width:
        raise ValueError(
            f'the stroke of +/- {1e3 * reach:.3g} mm does not reach +/- {1e3 * half_width:.3g} mm: choose a narrower '
            'reference_half_width'
        )
    mean = float(np.abs(force[inside]).mean())
    if not mean > 0.0:
        raise ValueError('the force in the middle of the stroke is zero: it cannot normalise the friction')
    return mean


def evaluate_cycles(
    time: FloatArray, displacement: FloatArray, force: FloatArray, law: SpoolEvaluation, reference: float | None = None
) -> SpoolFriction:
    """Normalised friction over displacement of one cycle out of several.

    ``time`` [s] has even steps; ``force`` [N] is positive with the velocity; all have the shape (n,). ``reference`` is
    the reference force [N] of another measurement (the paper normalises all seals by the outer one without pressure);
    None: that of this cycle.

    Raises:
        ValueError: A sample is not finite, there are too few cycles or samples, or the reference force is zero.
    """
    if not all(np.isfinite(column).all() for column in (time, displacement, force)):
        raise ValueError('time, displacement or force has samples that are not finite: cut them out')
    starts = cycle_starts(displacement)
    count = len(starts) - 1
    if count < law.evaluated_cycle:
        wanted = f'cycle {law.evaluated_cycle} is to be evaluated'
        raise ValueError(f'{count} cycles, but {wanted}: drive {law.cycles} cycles')
    resonance = resonance_frequency(time, force, law)
    quiet = force if resonance is None else without_resonance(time, force, resonance, law)
    smooth = moving_average(quiet, law.moving_average)
    cycle = slice(int(starts[law.evaluated_cycle - 1]), int(starts[law.evaluated_cycle]))
    middle = (float(displacement.max()) + float(displacement.min())) / 2.0
    centred = displacement[cycle] - middle
    own = reference_force(centred, smooth[cycle], law.reference_half_width) if reference is None else reference
    velocity = np.gradient(displacement, time)[cycle]
    return SpoolFriction(centred, velocity, force[cycle], smooth[cycle], smooth[cycle] / own, own, resonance)
