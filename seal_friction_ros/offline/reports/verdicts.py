"""The verdict of each page: one line with its reason, and what to do next. Every limit here is our choice.

GOOD: the result can be used. LOOK: it can be used once the reason has been looked at. BAD: not as it is.
"""

from collections.abc import Sequence
from typing import NamedTuple

from seal_friction_ros.core.estimation.findings import (
    BAD,
    GOOD,
    LOOK,
    NAME_SEALS,
    SMALL_CHANGE,
    Verdict,
    between,
    in_band,
    percent,
    worst,
)

SMALL_ERROR, LARGE_ERROR = 0.1, 0.3  # [-] of friction on data left out: GOOD up to, BAD above
SMALL_NUMERICS, LARGE_NUMERICS = 0.05, 0.15  # [-] change of friction with a coarser step or grid: likewise
WIDE_BAND = 0.15  # [-] standard deviation of a seal file: LOOK above


class IdentificationNumbers(NamedTuple):
    """What the verdict on an identification depends on."""

    law: str
    error: float  # [-] mean over single readings left out
    worst: float  # [-] of the mean at a pressure left out
    coverage: float  # [-] of readings left out in the 95 % band
    unsound: str  # why the parameters are not determined; empty if they are
    outlier: bool
    changed: bool  # whether friction differs between the runs
    drifted: bool  # whether friction changed during a run


def of_identification(found: IdentificationNumbers) -> Verdict:
    """Verdict on an identified law."""
    error = between(found.error, SMALL_ERROR, LARGE_ERROR)
    level = worst(
        [
            error,
            in_band(found.coverage),
            BAD if found.unsound else GOOD,
            LOOK if found.outlier or found.changed or found.drifted else GOOD,
        ]
    )
    text = (
        f'{found.law}, on readings that the fit did not see: single ones are off by {percent(found.error)} on '
        f'average, the mean at a pressure by {percent(found.worst)} at most; {percent(found.coverage)} lie in the '
        '95 % band'
    )
    reasons = [f'the parameters are not determined ({found.unsound})'] if found.unsound else []
    reasons += ['one pressure is an outlier and was left out'] if found.outlier else []
    reasons += ['friction differs between the runs'] if found.changed else []
    reasons += ['friction drifted during the runs'] if found.drifted else []
    after = 'replay a bag with the seal file and compare: seal_friction replay BAG --seal SEAL.yaml --out NEW.'
    if level != GOOD:
        after = 'read the remarks below, then measure what --next proposes: seal_friction identify ... --next next.csv.'
    return Verdict(level, '; '.join([text, *reasons]) + '.', after)


def of_tuning(summary: str, *, is_better: bool, has_placeholder: bool, mass: float | None, fitted: bool) -> Verdict:
    """Verdict on a tuned feed-forward.

    Args:
        summary: Result as a sentence.
        is_better: Whether it is better than none in every case.
        has_placeholder: Whether a seal is the placeholder.
        mass: Moving mass of a recorded axis [kg]; None for the simulated servo.
        fitted: Whether the mass was fitted.
    """
    if mass is not None and mass <= 0.0:
        given = 'fitted' if fitted else 'given'
        return Verdict(
            BAD,
            f'The {given} moving mass is {mass:.3g} kg, which no machine has: the force sum lacks the inertia, or '
            'has another sign or delay. Friction and feed-forward are wrong near reversals.',
            'give the mass (--mass) and check sign and delay of the force sum.',
        )
    if not is_better:
        return Verdict(BAD, summary, 'do not use the file; see the robustness cases, and check seal file and delay.')
    if has_placeholder:
        text = 'The seals are the placeholder of the default configuration, not those of your machine.'
        return Verdict(BAD, text, f'{NAME_SEALS}, then tune again.')
    if mass is not None:
        after = 'start with half of feedforward.scale on the machine: docs/tuning.md says how.'
        return Verdict(LOOK, f'{summary} A bag cannot show limit cycles.', after)
    return Verdict(
        GOOD, summary, 'tune on a bag of the machine too (--bag), then start with half of feedforward.scale.'
    )


def of_runs(changes: Sequence[tuple[str, float, float]], names: tuple[str, str]) -> Verdict:
    """Verdict on two runs or seals.

    Args:
        changes: Name of a quantity, its relative change [-], and the change that is noise [-].
        names: Of both.
    """
    if not changes:
        return Verdict(
            LOOK, f'{names[0]} and {names[1]} have no pressure in common to compare at.', 'record the same pressures.'
        )
    text = '; '.join(f'{what} {100.0 * change:+.1f} % (noise {100.0 * noise:.1f} %)' for what, change, noise in changes)
    told = [abs(change) > noise for _, change, noise in changes]
    if not any(told) and any(noise > LARGE_ERROR for _, _, noise in changes):
        reason = f'{text}, from {names[0]} to {names[1]}: too uncertain to tell a change'
        return Verdict(LOOK, f'{reason}.', 'measure both over several strokes at the same pressures.')
    if not any(told):
        return Verdict(GOOD, f'No change beyond the noise: {text}, from {names[0]} to {names[1]}.', 'nothing.')
    large = any(abs(change) > max(noise, SMALL_CHANGE) for _, change, noise in changes)
    after = (
        'find out what changed: seals, oil, temperature, load; fit again if it stays.'
        if large
        else 'nothing yet; compare the next run.'
    )
    return Verdict(LOOK, f'{text}, from {names[0]} to {names[1]}.', after)
