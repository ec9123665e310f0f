r"""Gain from force to command of a controller that takes a position, a velocity or a valve opening.

.. math:: u = g F + c_x x + c_v v + u_0, \qquad F = A_a p_a - A_b p_b

u is the command, F the force of the pressures, x and v position and velocity of the rod. A position servo has c_x = 1
and g = 1 / K_p; a velocity servo c_v = 1; a valve at even speed has c_v = A / K_q, and g from its droop with load
pressure. To add a force, add g times this force to the command.

All signals are averaged over `AVERAGE`, which keeps the linear relation and removes noise and the delay of the force
loop. Huber's weights limit outliers [Huber1981]_. The standard error is that of a jackknife over blocks of time, since
neighbouring samples are not independent [Kunsch1989]_. The model and all limits are our choice.
"""

from typing import NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.identification.validation import jackknife_errors

AVERAGE = 0.02  # [s] of the moving average
FEWEST_SAMPLES = 500  # of a fit
BLOCKS = 20  # of the jackknife
HUBER = 1.345  # [-] residual over its robust standard deviation from which on the weight falls
ITERATIONS = 30  # of the weights, at most
LARGEST_ERROR = 0.1  # standard error over the gain above which the data cannot tell
LEAST_COMMAND = 1e-6  # variation of the command over its size below which it is constant
WHAT_TO_RECORD = (
    'record the command, both pressures, position and velocity while the command changes to and fro by more than the '
    'friction takes, slowly, with rests'
)


class CommandRecord(NamedTuple):
    """Recorded command and its effect; arrays of shape (n,), evenly sampled."""

    time: FloatArray  # [s]
    command: FloatArray  # [unit of the command]
    force: FloatArray  # [N] A_a p_a - A_b p_b
    position: FloatArray  # [m]; NaN where it is not measured
    velocity: FloatArray  # [m/s]


class OutputGain(NamedTuple):
    """Gain from force to command."""

    gain: float  # [unit of the command / N]
    standard_error: float  # [unit of the command / N]
    position_share: float  # c_x [unit of the command / m]; 0 without position
    velocity_share: float  # c_v [unit of the command / (m/s)]
    samples: int  # that the fit uses


def output_gain(record: CommandRecord) -> OutputGain:
    """Gain from force to command, by robust regression.

    ValueError: there are too few samples, the command does not change, the gain cannot be told from the data, or it is
    negative.
    """
    size = max(round(AVERAGE / float(np.median(np.diff(record.time)))), 1) if len(record.time) > 1 else 1
    has_position = bool(np.isfinite(record.position).all())
    columns = [record.force, record.velocity] + ([record.position] if has_position else [])
    signals = np.column_stack([record.command, *columns])
    signals = signals[np.isfinite(signals).all(axis=1)]
    if len(signals) < max(FEWEST_SAMPLES, 4 * size):
        few = f'{len(signals)} usable samples of the command, the gain needs {FEWEST_SAMPLES}'
        raise ValueError(f'{few}: {WHAT_TO_RECORD}')
    kernel = np.ones(size) / size
    smooth = np.column_stack([np.convolve(signal, kernel, mode='valid') for signal in signals.T])
    command, inputs = smooth[:, 0], np.column_stack([smooth[:, 1:], np.ones(len(smooth))])
    if np.ptp(command) <= LEAST_COMMAND * max(float(np.abs(command).max()), 1e-300):
        raise ValueError(f'the command does not change: {WHAT_TO_RECORD}')
    found = _robust_fit(inputs, command, np.ones(len(command), dtype=bool))
    blocks = np.arange(len(command)) * BLOCKS // len(command)
    left_out = np.array([_robust_fit(inputs, command, blocks != block)[0] for block in range(BLOCKS)])
    error = float(jackknife_errors(left_out[:, np.newaxis])[0])
    gain = float(found[0])
    said = f'the gain is {gain:.3g} per N'
    if not error <= LARGEST_ERROR * abs(gain):
        said = f'{said} with a standard error of {error:.2g}, more than {LARGEST_ERROR:.0%}'
        raise ValueError(f'{said}: {WHAT_TO_RECORD}')
    if gain < 0.0:
        raise ValueError(f'{said}: a larger command pushes less; check the sign of command and pressures')
    return OutputGain(gain, error, float(found[2]) if has_position else 0.0, float(found[1]), len(command))


def _robust_fit(inputs: FloatArray, command: FloatArray, used: BoolArray) -> FloatArray:
    """Coefficients with Huber's weights over the samples ``used``; ValueError if the inputs cannot be separated."""
    matrix, wanted = inputs[used], command[used]
    spread = matrix.std(axis=0)
    spread[-1] = 1.0
    deviations = (matrix - matrix.mean(axis=0))[:, :-1]
    rounding = 1e-12 * np.abs(matrix[:, :-1]).max(axis=0)  # a constant deviates from its mean by as much
    deviations = np.where(spread[:-1] > rounding, deviations / np.maximum(spread[:-1], 1e-300), 0.0)
    if np.linalg.matrix_rank(deviations, 1e-6 * np.sqrt(len(wanted))) < deviations.shape[1]:
        raise ValueError(f'force, velocity and position do not change independently: {WHAT_TO_RECORD}')
    scaled = matrix / spread
    weights = np.ones(len(wanted))
    found = np.zeros(len(spread))
    for _ in range(ITERATIONS):
        root = np.sqrt(weights)
        new, *_ = np.linalg.lstsq(scaled * root[:, None], wanted * root, rcond=None)
        residual = np.abs(wanted - scaled @ new)
        typical = 1.4826 * float(np.median(residual))
        done = np.allclose(new, found, rtol=1e-9, atol=0.0)
        found = new
        if done or typical == 0.0:
            break
        weights = np.minimum(1.0, HUBER * typical / np.maximum(residual, 1e-300))
    return np.asarray(found / spread)
