"""The verdict of each page: one line with its reason, and what to do next. Every limit here is our choice.

GOOD: the result can be used. LOOK: it can be used once the reason has been looked at. BAD: not as it is.
"""

from collections.abc import Sequence

from seal_friction_ros.core.estimation import findings
from seal_friction_ros.core.estimation.findings import BAD, GOOD, LOOK, Verdict, between, in_band, percent, worst

SMALL_ERROR, LARGE_ERROR = 0.1, 0.3  # [-] of friction on data left out: GOOD up to, BAD above
SMALL_NUMERICS, LARGE_NUMERICS = 0.05, 0.15  # [-] change of friction with a coarser step or grid: likewise
WIDE_BAND = 0.15  # [-] standard deviation of a seal file: LOOK above


def of_identification(law: str, error: float, largest: float, coverage: float, unsound: str, *remarks: str) -> Verdict:
    """Verdict on an identified law, by readings left out of its fit.

    Their mean ``error`` [-], the ``largest`` of the mean at a pressure [-], their share in the 95 % band [-]; why the
    parameters are not determined, empty if they are; what makes it one to look at.
    """
    told = LOOK if remarks else GOOD
    level = worst([between(error, SMALL_ERROR, LARGE_ERROR), in_band(coverage), BAD if unsound else GOOD, told])
    text = (
        f'{law}, on readings that the fit did not see: single ones are off by {percent(error)} on average, the mean '
        f'at a pressure by {percent(largest)} at most; {percent(coverage)} lie in the 95 % band'
    )
    reasons = [f'the parameters are not determined ({unsound})'] if unsound else []
    after = 'replay a bag with the seal file and compare: seal_friction replay BAG --seal SEAL.yaml --out NEW.'
    if level != GOOD:
        after = 'read the remarks below, then measure what --next proposes: seal_friction identify ... --next next.csv.'
    return Verdict(level, '; '.join([text, *reasons, *remarks]) + '.', after)


def of_tuning(summary: str, *, is_better: bool, has_placeholder: bool, mass: float | None, fitted: bool) -> Verdict:
    """Verdict on a tuned feed-forward, its result in a sentence; ``mass`` of a recorded axis [kg], None of a servo."""
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
        return Verdict(BAD, text, f'{findings.NAME_SEALS}, then tune again.')
    if mass is not None:
        after = 'start with half of feedforward.scale on the machine: docs/tuning.md says how.'
        return Verdict(LOOK, f'{summary} A bag cannot show limit cycles.', after)
    return Verdict(
        GOOD, summary, 'tune on a bag of the machine too (--bag), then start with half of feedforward.scale.'
    )


def of_runs(changes: Sequence[tuple[str, float, float]], names: tuple[str, str]) -> Verdict:
    """Verdict on two runs or seals: each quantity with its relative change [-] and the change that is noise [-]."""
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
    large = any(abs(change) > max(noise, findings.SMALL_CHANGE) for _, change, noise in changes)
    after = (
        'find out what changed: seals, oil, temperature, load; fit again if it stays.'
        if large
        else 'nothing yet; compare the next run.'
    )
    return Verdict(LOOK, f'{text}, from {names[0]} to {names[1]}.', after)
