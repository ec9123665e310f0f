"""Text of an identification for people: warnings, remarks and the summary on the terminal."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from seal_friction_ros.core.foundation.units import BAR, ZEROS
from seal_friction_ros.core.identification import diagnostics
from seal_friction_ros.core.identification.admission import together
from seal_friction_ros.core.identification.breakaway import BreakawayFit
from seal_friction_ros.core.identification.candidate_laws import FittedParameter
from seal_friction_ros.core.identification.force_correction import ForceCorrection
from seal_friction_ros.core.identification.readings import has_pressures
from seal_friction_ros.core.identification.run_in import SettledLaw
from seal_friction_ros.core.identification.runs import BetweenRuns
from seal_friction_ros.core.identification.seal_kinds import poorly_told_apart, proposed_conditions
from seal_friction_ros.core.identification.selection import LawScore, scored
from seal_friction_ros.core.identification.temperature import TemperatureFit
from seal_friction_ros.core.identification.validation import CrossValidation
from seal_friction_ros.core.identification.what_a_log_tells import FreeRod
from seal_friction_ros.offline.identification.presliding import presliding_text
from seal_friction_ros.offline.identification.results import (
    Identification,
    IdentificationData,
    LawQuality,
    LawSelection,
    PressureLevel,
)

TOLD_APART = 0.05  # [-] spread of laws from which it is told (our choice)


def warnings_of(
    data: IdentificationData, selection: LawSelection, quality: LawQuality, levels: Sequence[PressureLevel]
) -> Iterator[str]:
    """Limits of the law that its user has to know, one line each."""
    readings = data.prepared.readings
    yield from together(data.prepared.accounts).warnings
    yield from _change_texts(quality)
    one_way = [name for name, index in zip(readings.names, readings.two_sided, strict=True) if not len(index)]
    if one_way:
        yield (
            f'{", ".join(one_way)}: readings in one direction only, so an offset of the force counts as friction: '
            'measure the other direction too'
        )
    if readings.free_rod is not None:
        yield _free_rod_text(readings.free_rod)
    elif not has_pressures(readings):
        low, high = (float(end) / BAR for end in (readings.seal_pressure.min(), readings.seal_pressure.max()))
        yield (
            f'measured at {low:.4g} to {high:.4g} bar only: there the law holds; how friction rises beyond comes from '
            'a prior, not from these data: measure at three pressures to know it'
        )
    if data.correction is not None and data.correction.is_significant:
        yield _correction_text(data.correction, data.sources.pressure_area)
    if data.outlier is not None:
        yield _outlier_text(data.outlier, levels)
    yield from _collinearity_texts(data, selection)
    gain = _pressure_gain(selection)
    if gain is not None and not gain[1]:
        yield f'no gain is claimed for pressure: {gain[0]}: the difference is within the noise'
    yield from _scatter_texts(selection, quality, levels)
    if quality.breakaway is not None and quality.breakaway.dwell is not None:
        yield _dwell_text(quality.breakaway)
    if quality.breakaway is None and not readings.are_samples:
        yield 'no stroke starts from rest, so breakaway is not identified: let the rod rest 30 s before some strokes'


def _free_rod_text(found: FreeRod) -> str:
    return (
        'pressure dependence: unknown. Nothing but friction loads the rod, so the pressures are the effect of the '
        f'friction: the force sum is a function of them alone, friction takes {found.paid / BAR:.3g} bar, and the '
        f'emptied chamber moved by {found.moved / BAR:.2g} bar on its own. The law has no pressure in it: load the rod '
        'and record the load, or drive with several supply or return pressures'
    )


def _change_texts(quality: LawQuality) -> Iterator[str]:
    for change in quality.changes:
        if not change.is_changed:
            continue
        percent = 100.0 * (change.other_friction / change.friction - 1.0)
        where = 'of the same law' if change.pressure is None else f'at {change.pressure / BAR:.3g} bar'
        yield (
            f'friction differs between runs: {where} {change.friction:.3g} N in '
            f'{change.name} and {change.other_friction:.3g} N in {change.other_name} ({percent:+.0f} %); they are '
            'fitted together, and the band holds both: if they are two seals, identify each separately'
        )


def _correction_text(correction: ForceCorrection, area: float | None) -> str:
    if not correction.chamber:
        change = ' and '.join(
            f'{1e6 * x:+.3g} mm2 for chamber {c}' for c, x in zip('ab', correction.areas, strict=True)
        )
        return f'the areas in the force sum are off: {change}; the laws are fitted with the corrected areas'
    change = f'{1e6 * correction.area:+.3g} mm2 (standard error {1e6 * correction.standard_error:.2g} mm2)'
    text = (
        f'the area of chamber {correction.chamber} in the force sum is off: its offset follows the pressure, by '
        f'{change}; the law is fitted with the corrected area, and the seal file carries the correction for the node'
    )
    twice = 'identify anew, or it is corrected twice'
    if area is None:
        return f'{text}; if you correct the area where the force sum is made, {twice}'
    old, new = (1e3 * math.sqrt(4.0 * max(value, 0.0) / math.pi) for value in (area, area + correction.area))
    return (
        f'{text}: {1e6 * (area + correction.area):.4g} mm2 in place of {1e6 * area:.4g} mm2, the bore is nearer to '
        f'{new:.3g} than {old:.3g} mm; if you correct the rig file, {twice}'
    )


def _outlier_text(outlier: diagnostics.Outlier, levels: Sequence[PressureLevel]) -> str:
    level = next(level for level in levels if not level.is_used)
    others = [abs(other.drift) for other in levels if other.is_used and math.isfinite(other.drift)]
    largest = max(others, default=0.0)
    percent = 100.0 * (outlier.measured / outlier.expected - 1.0)
    text = (
        f'outlier: at {level.pressure / BAR:.3g} bar the friction is {outlier.measured:.3g} N where the law of the '
        f'other pressures expects {outlier.expected:.3g} N ({percent:+.0f} %, {outlier.standard_deviations:.1f} '
        'standard deviations); the law was not fitted to it'
    )
    if math.isfinite(level.drift) and abs(level.drift) > diagnostics.SETTLED and abs(level.drift) > 2.0 * largest:
        return (
            f'{text}. A reason to look: its friction changed by {100.0 * level.drift:+.0f} % during the run, that of '
            f'the other runs by {100.0 * largest:.0f} % at most: the seal had not settled (lubricant pushed out, twist '
            'or extrusion into the gap): inspect the ring and repeat that run until its friction stays constant'
        )
    return (
        f'{text}. A reason to look: repeat that run; if it gives the same friction, the law changes there: measure more'
    )


def _collinearity_texts(data: IdentificationData, selection: LawSelection) -> Iterator[str]:
    for pair in diagnostics.collinear_regressors(data.prepared.readings):
        yield (
            f'{pair.one} and {pair.other} are collinear: they changed together (correlation {pair.correlation:+.2f}), '
            'so their effects can hardly be separated: drive several speeds at each pressure'
        )
    for pair in diagnostics.traded_off(selection.fit):
        yield (
            f'{pair.one} and {pair.other} trade off (correlation {pair.correlation:+.3f}): the data determine the '
            'friction that they give together, but neither of them alone'
        )
    if selection.fit.why_unsound:
        yield f'the parameters are not determined: {selection.fit.why_unsound}'


def kinds_warnings(data: IdentificationData, selection: LawSelection, quality: LawQuality) -> Iterator[str]:
    """What the cylinder does not tell of several kinds of seals, one line each; nothing for one kind."""
    told, values = quality.kinds, selection.fit.values
    if told is None:
        return
    kinds, total = data.kinds, float(told.friction.sum())
    constant, viscous = values['friction_at_no_pressure'], values.get('viscous_friction', 0.0)
    if constant > 0.0 or viscous > 0.0:
        yield (
            f'the friction at no pressure, {constant:.3g} N of all seals ({100.0 * constant / total:.0f} % of the '
            f'friction),{" and the viscous friction" * (viscous > 0.0)} cannot be divided between '
            f'{" and ".join(kind.name for kind in kinds)} by any pressure of this cylinder: it is divided as the rest '
            'is: use the seal files together'
        )
    for name, friction, error in poorly_told_apart(told, kinds):
        yield (
            f'{name}: {friction:.3g} N with a standard error of {error:.2g} N, which --largest-kind-error lets pass: '
            'the sum of all kinds is better known than each: use the seal files in this cylinder only'
        )
    if float(told.together.max()) > diagnostics.COLLINEAR:
        yield (
            f'the pressures of the kinds moved nearly together (correlation {float(told.together.max()):.2f}), so the '
            'kinds are told apart by little'
        )


def _pressure_gain(selection: LawSelection) -> tuple[str, bool] | None:
    """Best law with against best law without pressure-dependent Coulomb friction: text, and whether pressure pays."""
    ordered = sorted(scored(selection.scores), key=lambda score: float(score.validation.losses.mean()), reverse=True)
    best = {score.law.depends_on_pressure: (score.law.name, score.validation) for score in ordered}
    if len(best) < 2:
        return None
    (name, validation), (other_name, other) = best[True], best[False]
    text = f'out of sample {validation.rms:.3g} N RMS remain with pressure ({name}) and {other.rms:.3g} N without'
    return f'{text} ({other_name})', selection.best.law.depends_on_pressure


def one_run_text(between: BetweenRuns) -> str:
    """That data of one run do not show how runs differ, and what stands for it."""
    return (
        'this is one run, so the data do not show how runs differ (mounted anew, another day): a prior of '
        f'{100.0 * between.std:.0f} % is in the standard deviation; repeat runs, or give a known value with '
        '--run-to-run'
    )


def _scatter_texts(selection: LawSelection, quality: LawQuality, levels: Sequence[PressureLevel]) -> Iterator[str]:
    for parameter in selection.law.parameters:
        if selection.fit.values[parameter.name] == parameter.lower == 0.0:
            yield f'{parameter.name} is 0: these data show no such effect'
    between = quality.between_runs
    if between.std > 0.0 and not between.freedom and not quality.is_stated:
        yield one_run_text(between)
    if quality.told_apart > TOLD_APART:
        yield (
            f'laws that fit these data nearly as well differ by {100.0 * quality.told_apart:.0f} % where speed and '
            'pressure do not go together as here: that is in the standard deviation'
        )
    if selection.settled is not None:
        yield _settled_text(selection.settled, selection)
    elif selection.is_no_run_in:
        yield (
            'run-in: the friction drifts over the runs beyond the scatter of the strokes, but corrected for that the '
            'pressures agree less: the seal file holds the law of the readings as measured; let the seal settle first'
        )
    drifted = [level for level in levels if level.is_used and abs(level.drift) > diagnostics.SETTLED]
    if drifted:
        at = ', '.join(f'{100.0 * level.drift:+.0f} % at {level.pressure / BAR:.3g} bar' for level in drifted)
        yield f'the friction drifted during the runs ({at}): let the seal settle until its friction stays constant'
    floor = quality.repeatability
    error = selection.validation.rms / float(np.abs(selection.validation.predicted).mean())
    if math.isfinite(floor) and error > 2.0 * floor:
        yield (
            f'the law is off by {100.0 * error:.0f} % (RMS) on left-out readings, while readings repeat within '
            f'{100.0 * floor:.0f} %: the friction depends on something that is not in the law'
        )


def _dwell_text(law: BreakawayFit) -> str:
    parts = ((law.stiction_per_decade, ' N'), (100.0 * law.ratio_per_decade, ' % of the Coulomb friction'))
    growth = ' and '.join(f'{value:.2g}{unit}' for value, unit in parts if value)
    shortest, longest = law.dwells or (math.nan, math.nan)
    return (
        f'breakaway grows with the time at rest, by {growth} of one seal for a rest ten times as long (rests of '
        f'{shortest:.2g} to {longest:.3g} s); the seal file holds that after {law.dwell:.3g} s'
    )


def _valued(parameter: FittedParameter, value: float) -> str:
    unit = '' if parameter.unit == '1' else f' {parameter.unit}'
    return f'{parameter.name} = {value:.4g}{unit}'


def _settled_text(settled: SettledLaw, selection: LawSelection) -> str:
    at = settled.readings.at
    change = float(settled.fit.friction(at).mean() / selection.fit.friction(at).mean()) - 1.0
    values = ', '.join(_valued(p, selection.fit.values[p.name]) for p in selection.law.parameters)
    return (
        f'run-in: the friction drifts over the runs beyond the scatter of the strokes; the seal file holds the law of '
        f'the settled seal, {100.0 * change:+.0f} % against the readings, with a standard deviation of '
        f'{100.0 * settled.relative_std:.2g} % since it is extrapolated; as measured: {values}'
    )


def remarks_on(data: IdentificationData, selection: LawSelection) -> Iterator[str]:
    """Assumptions and how to change them, one line each."""
    prepared, samples = data.prepared, together(data.prepared.accounts)
    if samples.left_out:
        yield samples.text
    if data.temperature is not None:
        yield _temperature_text(data.temperature)
    gain = _pressure_gain(selection)
    if gain is not None and gain[1]:
        yield f'pressure pays: {gain[0]}'
    if data.ring is None and not data.used.kinds:
        yield 'the geometry of the ring is unknown, so the physics-based law was not tried: name a seal with --seal'
    if selection.law.name != selection.best.law.name:
        yield f'{selection.law.name} is saved as asked for with --law; recommended is {selection.best.law.name}'
    chambers = data.sources.chambers
    if not data.used.kinds:
        yield (
            f'the law is that of one seal of {len(chambers)}, on chambers {",".join(chambers)}, as the file says: for '
            'the node name it once, seals: [FILE]'
        )
    if prepared.breakaway is None and prepared.readings.are_samples:
        yield 'breakaway is not identified from logs without held pressures'


def _temperature_text(found: TemperatureFit) -> str:
    low, high, reference = (one - ZEROS['degC'] for one in (found.lowest, found.highest, found.reference))
    if found.why_not:
        return f'no effect of temperature is identified at {low:.4g} to {high:.4g} degC: {found.why_not}'
    return (
        f'friction changes by {-100.0 * found.coefficient:+.2g} % per kelvin (standard error '
        f'{100.0 * found.error:.1g} %) from {low:.4g} to {high:.4g} degC; the law, and every number here, is for '
        f'{reference:.4g} degC'
    )


def _kinds_lines(found: Identification) -> Iterator[str]:
    """Share of each kind of seals, and the pressures that tell them apart; nothing for one kind."""
    told, readings = found.quality.kinds, found.data.used
    if told is None:
        return
    total = float(told.friction.sum())
    yield '  kind              seals on         friction [N]   share [%]   std of the share [%]'
    rows = zip(found.data.kinds, told.friction.tolist(), told.apart_std.tolist(), strict=True)
    for kind, friction, std in rows:
        numbers = f'{friction:12.4g}  {100.0 * friction / total:10.3g}  {100.0 * std / total:21.2g}'
        yield f'  {kind.name:16}  {",".join(kind.chambers):16} {numbers}'
    conditions, correlation = proposed_conditions(readings, found.selection.fit.model)
    if conditions:
        pairs = ', '.join(f'{c.a / BAR:.3g} and {c.b / BAR:.3g}' for c in conditions)
        change = f'correlation of the pressures {float(told.together.max()):.2f} -> {correlation:.2f}'
        yield f'next: chambers a and b at {pairs} bar, both directions: {change}'


def summary(found: Identification) -> str:
    """The result for a person: law, numbers at each pressure, ladder, remarks and warnings."""
    selection, quality = found.selection, found.quality
    lines = [*_kinds_lines(found), f'law: {selection.law.name} ({selection.law.formula})']
    (first, fit), *others = selection.fits_by_name.items()
    for p in selection.law.parameters:
        also = ''.join(f' ({first}; {other.values[p.name]:.4g} {name})' for name, other in others)
        error = quality.standard_errors[p.name]
        lines.append(f'  {_valued(p, fit.values[p.name])}, standard error {error:.2g}{also}')
    lines += ['  pressure [bar]  measured [N]  fitted [N]  std [N]']
    for level in found.levels:
        numbers = f'{level.pressure / BAR:14.4g}  {level.measured:12.4g}  {level.fitted:10.4g}  {level.std:7.4g}'
        lines.append(f'  {numbers}{"" if level.is_used else "  outlier, not used"}')
    of_settled = 'of the settled seal, ' if selection.is_chosen_on_settled_seal else ''
    lines += [f'laws on left-out readings ({of_settled}left out by {found.data.used.left_out_by}):']
    rows: list[tuple[str, CrossValidation | str | None]] = [
        (score.law.name, score.validation if isinstance(score, LawScore) else score.why_not)
        for score in selection.scores
    ]
    for name, result in [*rows, ('mean of the other readings', selection.reference)]:
        if isinstance(result, CrossValidation):
            mark = ' <- recommended' if name == selection.best.law.name else ''
            lines.append(f'  {name:32} {result.rms:9.4g} N RMS  {100.0 * result.error:5.1f} %{mark}')
        elif result:
            lines.append(f'  {name:32} not fitted: {result}')
    if found.presliding is not None:
        lines += [presliding_text(found.presliding)]
    lines += [f'95 % band: holds {100.0 * quality.coverage:.0f} % of the left-out readings']
    lines += [f'note: {remark}' for remark in found.remarks]
    lines += [f'warning: {warning}' for warning in found.warnings]
    return '\n'.join(lines)
