r"""Velocity from position, causal: the slope of a straight line through the last N samples.

.. math:: v = \frac{\sum (t_i - \bar t)\, x_i}{\sum (t_i - \bar t)^2}

On an even grid of period T the velocity is that of (N - 1) T / 2 before. Rounding to an encoder step q, as white noise
of variance q^2 / 12, gives a velocity noise of

.. math:: \sigma_v = \frac{q}{T \sqrt{N (N^2 - 1)}}

N is the smallest one with which the noise is as small as wanted. N = 2 is the backward difference.

Source: line fit over a window: [Brown1992]_; variance of a fitted slope: any book on regression. The noise is
the mean over all speeds of a moving rod; at one even speed, at rest and at a few steps a window, the velocity has a
ripple of at most `largest_error`, which the estimator learns (`conditioned_velocity`).
"""

import math
from typing import NamedTuple

LONGEST_DELAY = 0.02  # [s] our choice: a control loop of 5 Hz loses 36 degrees by it
MOST_SAMPLES = 64  # our choice
LONGEST_GAP = 4.0  # periods between two samples, after which the window begins anew; our choice


class Differentiator(NamedTuple):
    """A line fit over the last samples."""

    samples: int  # N
    period: float  # [s] T
    step: float  # [m] q

    @property
    def delay(self) -> float:
        """How old the velocity is [s]."""
        return 0.5 * (self.samples - 1) * self.period

    @property
    def noise(self) -> float:
        """Standard deviation of the velocity [m/s] by rounding, while the rod moves."""
        return self.step * self.noise_gain / math.sqrt(12.0)

    @property
    def noise_gain(self) -> float:
        """Standard deviation of the velocity over that of white noise on the position [1/s]."""
        n = self.samples
        return math.sqrt(12.0 / (n * (n * n - 1))) / self.period

    @property
    def largest_error(self) -> float:
        """Largest velocity error [m/s] that rounding can make."""
        middle = 0.5 * (self.samples - 1)
        weights = [i - middle for i in range(self.samples)]
        return 0.5 * self.step * sum(map(abs, weights)) / (sum(w * w for w in weights) * self.period)


class Window(NamedTuple):
    """The last samples of a position, oldest first."""

    stamps: tuple[int, ...] = ()  # [ns]
    positions: tuple[float, ...] = ()  # [m]


NO_WINDOW = Window()


def chosen_differentiator(step: float, rate: float, noise: float) -> Differentiator:
    """The differentiator with the smallest delay whose velocity has a noise of at most ``noise`` [m/s].

    The encoder has steps of ``step`` [m], 0.0: none, and ``rate`` samples per second [Hz]. ValueError: it would be
    older than `LONGEST_DELAY` or need more than `MOST_SAMPLES`.
    """
    best = Differentiator(2, 1.0 / rate, step)
    for samples in range(2, MOST_SAMPLES + 1):
        found = Differentiator(samples, 1.0 / rate, step)
        if found.delay > LONGEST_DELAY and samples > 2:
            break
        if found.noise <= noise:
            return found
        best = found
    what = f'steps of {step:g} m at {rate:g} Hz: a velocity with {noise:g} m/s of noise would be older than'
    possible = f'{best.noise:.2g} m/s is possible: raise noise, or use a finer encoder'
    raise ValueError(f'{what} {LONGEST_DELAY:g} s or need more than {MOST_SAMPLES} samples; {possible}')


def differentiate(
    differentiator: Differentiator, window: Window, stamp: int, position: float
) -> tuple[Window, float | None]:
    """Take a sample of any position [m]; the next window, and the velocity [m/s], None until the window is full.

    A repeated stamp [ns] is no new sample. A position that is not finite, a stamp that goes back, or a pause of more
    than `LONGEST_GAP` periods begins a new window.
    """
    stamps, positions = window
    if not math.isfinite(position):
        return NO_WINDOW, None
    if stamps:
        step = (stamp - stamps[-1]) * 1e-9
        if step == 0.0:
            return window, None
        if not 0.0 < step <= LONGEST_GAP * differentiator.period:
            stamps, positions = (), ()
    count = differentiator.samples
    stamps, positions = (*stamps, stamp)[-count:], (*positions, position)[-count:]
    following = Window(stamps, positions)
    if len(stamps) < count:
        return following, None
    first, origin = stamps[0], positions[0]
    times = [(s - first) * 1e-9 for s in stamps]
    middle = sum(times) / count
    covariance = sum((t - middle) * (x - origin) for t, x in zip(times, positions, strict=True))
    return following, covariance / sum((t - middle) ** 2 for t in times)
