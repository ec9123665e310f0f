"""Presliding of an identification: from the logs of the sources to the part ``presliding`` of the seal file."""

from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import MM, UM
from seal_friction_ros.core.identification import presliding_fit
from seal_friction_ros.core.identification.readings import RecordedLog
from seal_friction_ros.core.identification.signal_preparation import LONGEST_GAP, Signals
from seal_friction_ros.offline.identification.sources import Sources


class IdentifiedPresliding(NamedTuple):
    """Elasticity of all seals together, and how well it predicts reversals that were kept back."""

    fit: presliding_fit.PreslidingFit
    score: presliding_fit.PreslidingScore
    seals: int


def identify_presliding(sources: Sources) -> IdentifiedPresliding:
    """Fit the elasticity to the reversals of all logs, and score it on every second reversal.

    ValueError: the sources are no logs, or their reversals do not tell the elasticity.
    """
    logs = [reversal_log(source.log) for source in sources.each if source.log is not None]
    if not logs:
        raise presliding_fit.PreslidingRefusedError(
            f'{sources.files[0].name}: manual readings have no reversals: leave out --presliding, or give logs or bags'
        )
    fit = presliding_fit.fit_presliding(logs)
    score = presliding_fit.score_presliding(logs, fit.length, fit.length)
    if not score.elastic < score.rigid:
        raise presliding_fit.PreslidingRefusedError(
            f'{", ".join(log.name for log in logs)}: presliding predicts the reversals kept back with an RMS error of '
            f'{score.elastic:.2g} N, no better than rigid seals with {score.rigid:.2g} N: leave out --presliding'
        )
    return IdentifiedPresliding(fit, score, len(sources.chambers))


def reversal_log(log: RecordedLog) -> presliding_fit.ReversalLog:
    """Signals of a log for the fit; without a position, the integral of the velocity."""
    signals = log.signals
    position = integrated(signals) if log.position is None else log.position
    finite = np.isfinite(position) & np.isfinite(signals.force_sum)
    return presliding_fit.ReversalLog(log.name, signals.time[finite], position[finite], signals.force_sum[finite])


def integrated(signals: Signals) -> FloatArray:
    """Displacement [m] by the trapezoidal rule; a missing velocity and a pause count as rest."""
    velocity, time = np.nan_to_num(signals.velocity), signals.time
    steps = np.minimum(np.diff(time), LONGEST_GAP)
    return np.concatenate(([0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * steps)))


def presliding_part(found: IdentifiedPresliding) -> dict[str, Any]:
    """Part ``presliding`` of the seal file: of one seal of as many equal ones."""
    fit = found.fit
    return asdict(replace(fit.presliding, stiffness=fit.presliding.stiffness / found.seals))


def presliding_numbers(found: IdentifiedPresliding) -> dict[str, Any]:
    """Numbers of the fit for the section ``identification`` and for JSON."""
    fit, score = found.fit, found.score
    return {
        'stiffness_N_per_m': fit.presliding.stiffness,
        'standard_errors': {
            'stiffness_N_per_m': fit.presliding.relative_std * fit.presliding.stiffness,
            'yield_exponent': fit.yield_exponent_std,
            'memory_length_m': fit.relative_memory_length_std * fit.presliding.memory_length,
            'dwell_time_s': fit.relative_dwell_time_std * fit.presliding.dwell_time,
        },
        'breakaway_excess': fit.excess,
        'full_yield_m': fit.full_yield,
        'reversals': fit.reversals,
        'rms_N': fit.rms,
        'kept_back': {
            'reversals': score.reversals,
            'within_m': score.within,
            'rms_N': score.elastic,
            'rigid_rms_N': score.rigid,
            'repeatability_N': score.repeatability,
        },
    }


def presliding_text(found: IdentifiedPresliding) -> str:
    """The result as one line for a person."""
    fit, score = found.fit, found.score
    made = fit.presliding
    lag = f', memory length {made.memory_length / UM:.3g} um' if fit.excess else ''
    lag += f', dwell time {made.dwell_time:.3g} s' if made.dwell_time else ''
    return (
        f'presliding: {made.stiffness:.3g} N/m +-{100.0 * fit.presliding.relative_std:.2g} %, exponent '
        f'{made.yield_exponent:.2g} +-{fit.yield_exponent_std:.2g}, all sliding after '
        f'{fit.full_yield / MM:.2g} mm{lag}; {score.reversals} of {fit.reversals} reversals kept back: '
        f'RMS {score.elastic:.3g} N, rigid seals {score.rigid:.3g} N, their repeatability {score.repeatability:.3g} N'
    )
