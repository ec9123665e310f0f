"""Verdict of every page of the studies; the limits between the levels are our choice."""

import math

from seal_friction_ros.core.estimation.findings import GOOD, LOOK, Verdict, between, percent, worst
from seal_friction_ros.offline.reports.verdicts import (
    LARGE_ERROR,
    LARGE_NUMERICS,
    SMALL_ERROR,
    SMALL_NUMERICS,
)


def of_lubrication(friction: float, solid_share: float, change: float) -> Verdict:
    """Verdict on a run: friction [N], its solid share [-], its largest relative change with a coarser step or grid."""
    level = between(change, SMALL_NUMERICS, LARGE_NUMERICS)
    text = (
        f'Friction {friction:.3g} N about the middle of the stroke, {percent(solid_share)} of it solid; half the '
        f'cells or twice the step change it by {percent(change)} at most.'
    )
    after = (
        'compare with a measurement (--bag).'
        if level == GOOD
        else 'compute with more cells and a smaller step (numerics of the case).'
    )
    return Verdict(level, text, after)


def of_comparison_with_bag(measured: float, computed: float, correlation: float) -> Verdict:
    """Verdict on computed against measured friction, mean magnitudes [N]."""
    off = abs(computed / measured - 1.0) if measured else math.inf
    level = worst([between(off, SMALL_ERROR, LARGE_ERROR), between(1.0 - correlation, 0.1, 0.3)])
    text = (
        f'Computed {computed:.3g} N, measured {measured:.3g} N: off by {percent(off)}; correlation {correlation:.2f}.'
    )
    after = (
        'use the map of this case (ehl map).' if level == GOOD else 'check the solid shear stress first (ehl study).'
    )
    return Verdict(level, text, after)


def of_study(deviation: float) -> Verdict:
    """Verdict on a study: largest deviation of friction over solid shear stress from its mean [-]."""
    level = between(deviation, SMALL_ERROR, LARGE_ERROR)
    text = f'Friction is proportional to the solid shear stress within {percent(deviation)}.'
    after = (
        'fit the shear stress to one measured force.'
        if level == GOOD
        else 'fit the shear stress at the speed that matters.'
    )
    return Verdict(level, text, after)


def of_spool(largest: float) -> Verdict:
    """Verdict on the computed friction of a spool [N]."""
    return Verdict(
        LOOK,
        f'Friction up to {largest:.3g} N in the last cycle; computed, not measured.',
        'compare with a measured force.',
    )


def of_spool_measurement(reference: float, resonance: float | None) -> Verdict:
    """Verdict on an evaluated rig: reference force [N], resonance of the measuring chain [Hz] if one was found."""
    if resonance is None:
        text = (
            f'Reference force {reference:.4g} N; no resonance of the measuring chain stands out, so none was removed.'
        )
        return Verdict(LOOK, text, 'look for ringing after the reversals.')
    text = f'Reference force {reference:.4g} N; the resonance of the measuring chain at {resonance:.0f} Hz is removed.'
    return Verdict(GOOD, text, 'compare it with another ring: --reference.')
