"""Next readings of an identification: the design, as a data sheet, as numbers for JSON, and in words."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.units import BAR, MM
from seal_friction_ros.core.identification import experiment_design
from seal_friction_ros.core.identification.seal_kinds import moved_together, proposed_conditions
from seal_friction_ros.offline.identification.data_sheet import FrictionTestPlan
from seal_friction_ros.offline.identification.results import Identification
from seal_friction_ros.offline.work.seal_writer import rounded, rounded_numbers

LIMITS = {
    experiment_design.RUN_TO_RUN: 'the spread from run to run',
    experiment_design.LAW: 'the standard error of the law',
    experiment_design.SCATTER: 'the scatter of single readings',
}


def design_for(found: Identification) -> experiment_design.ExperimentDesign:
    """The design of the next readings for those of an identification."""
    used, quality = found.selection.readings, found.quality
    runs_are_left_out = used.left_out_by in ('test', 'file') and not quality.is_stated
    between = None if quality.is_stated or runs_are_left_out else quality.between_runs
    of_band = between.of_band if between is not None else quality.between_runs.std
    return experiment_design.design_experiment(used, between, of_band)


def plan_of(found: Identification, design: experiment_design.ExperimentDesign) -> FrictionTestPlan:
    """Data sheet of the proposed readings, sorted by pressure and speed, in bar, mm/s and N."""
    points = [(rounded(r.pressure / BAR, 6), rounded(r.speed / MM, 6)) for r in design.readings]
    name = str(found.document['name']).replace(',', ' ')
    ring = found.data.ring
    return FrictionTestPlan.at_points(
        name if name.isprintable() and name.strip() else 'seal',
        points,
        tests=1,
        seals=len(found.data.sources.chambers),
        pressure_unit='bar',
        force_unit='N',
        length_unit='mm',
        geometry=ring.geometry if ring else None,
        notes=tuple(texts_of(found, design)),
    )


def numbers_of(design: experiment_design.ExperimentDesign) -> dict[str, Any]:
    """Numbers for JSON: ``next``, the readings in the order of their use, and ``next_effect``."""
    numbers: dict[str, Any] = rounded_numbers(
        {
            'next': [
                {
                    'pressure_Pa': r.pressure,
                    'speed_m_per_s': r.speed,
                    'directions': r.directions,
                    'shrink': r.shrink,
                    'is_repeated': r.is_repeated,
                }
                for r in design.readings
            ],
            'next_effect': {
                'limit': design.limit,
                'parts': design.parts,
                'error_before': design.error_before,
                'error_after': design.error_after,
                'shrink': design.shrink,
                'pressures_Pa': design.pressures,
                'speeds_m_per_s': design.speeds,
                'correlation': design.correlation._asdict(),
            },
        }
    )
    numbers['next_effect']['another_run'] = design.repeated and design.repeated._asdict()
    return numbers


def kinds_sheet(found: Identification) -> str:
    """CSV of the chamber pressures to drive next, one row each, at the mean speed of the readings.

    A log holds the readings of several kinds of seals, so the rows are driven while recording; nothing is filled in.
    """
    readings = found.data.used
    conditions, correlation = proposed_conditions(readings, found.selection.fit.model)
    before = float(moved_together(readings).max())
    speed = float(np.nan_to_num(np.abs(readings.at.velocity)).mean()) / MM
    lines = [
        '# Next runs of a cylinder with several kinds of seals: hold both pressures, drive ten strokes in each',
        '# direction, and record each row; then give these and all earlier logs to identify.',
        f'# Correlation of the pressures of the kinds: {before:.2f} now, {min(correlation, before):.2f} with these.',
    ]
    if not conditions:
        lines.append('# The pressures tell the kinds apart as well as this cylinder can: repeat runs on another day.')
    rows = [f'{c.a / BAR:.6g},{c.b / BAR:.6g},{speed:.3g}' for c in conditions]
    return '\n'.join([*lines, 'pressure_a_bar,pressure_b_bar,speed_mm_per_s', *rows]) + '\n'


def _percent(share: float) -> str:
    """A share with two digits, without an exponent: 0.79 %, 780 %."""
    return f'{float(f"{100.0 * share:.2g}"):g} %'


def texts_of(found: Identification, design: experiment_design.ExperimentDesign) -> Iterator[str]:
    """What limits the band, and what the proposed readings change, one line each."""
    limit = 100.0 * design.parts[design.limit]
    yield f'{LIMITS[design.limit]} limits the band: {limit:.3g} % of the friction'
    run = design.repeated
    if design.limit == experiment_design.RUN_TO_RUN and run is not None:
        yield (
            f'repeat the run on another day, mounted anew: its part of the band shrinks to {100.0 * run.shrink:.0f} % '
            f'if runs differ as expected, and to {100.0 * run.shrink_at_best:.0f} % if they agree'
        )
    elif design.limit == experiment_design.RUN_TO_RUN:
        yield 'the spread between runs is as given with --run-to-run: several runs on other days measure it'
    low, high = (pressure / BAR for pressure in design.pressures)
    slow, fast = (speed / MM for speed in design.speeds)
    yield (
        f'the standard error of the friction over {low:.3g} to {high:.3g} bar and {slow:.3g} to {fast:.3g} mm/s '
        f'is {_percent(design.error_before)}; with the proposed readings {_percent(design.error_after)}'
    )
    pair, before, after = design.correlation
    if abs(before) > abs(after):
        yield f'correlation of {" and ".join(pair)}: {before:+.2f} -> {after:+.2f}'
    if not design.speed_is_measured:
        yield (
            f'the readings have no speed: {experiment_design.ASSUMED_SPEED / MM:g} mm/s is assumed, and the speeds are '
            'factors of it; write down the true speeds, and those of the readings at hand, else the law gets no term '
            'of the speed'
        )
    elif not design.speed_is_varied:
        yield 'the readings have one speed: the effect of the speed is unknown, so other speeds are among the readings'
    if any(source.log is not None for source in found.data.sources.each):
        yield 'logs and noted readings are not fitted together: drive these rows while recording, and give all logs'
    if not {*found.data.sources.chambers} <= {'a', 'b'}:
        yield 'each pressure is that at the seal: set the chambers such that every seal sees it'
