"""Report of an identification: measured friction, fitted law, and the out-of-sample error of each law."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binom

from seal_friction_ros.core.estimation.findings import GOOD, LOOK, Verdict, between, percent, worst
from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.units import BAR, MM
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.geometry import projected_area
from seal_friction_ros.core.friction.laws.normal_force import AreaDeformationGain
from seal_friction_ros.core.friction.laws.prior_art_chart import PriorArtChart
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.identification import diagnostics
from seal_friction_ros.core.identification.calibration import Calibration
from seal_friction_ros.core.identification.candidate_laws import columns_of, normal_forces
from seal_friction_ros.core.identification.fitting import offsets_of
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.selection import NotScored, scored
from seal_friction_ros.core.identification.validation import CrossValidation
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.identification.pipeline import fitted_readings, mounted_seals
from seal_friction_ros.offline.identification.results import Identification, Ring, kinds_numbers, worst_left_out
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports import verdicts
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.formatting import DASH, force_unit, number
from seal_friction_ros.offline.reports.page import Columns, Table, head_of, table_of, write_page
from seal_friction_ros.offline.work.seal_writer import seal_text

PRIOR_ART_SEAL = 'ms28775_114_prior_art'  # the only ring with known charts
ONE_RUN = 'one run: a prior stands in'
PRESSURE_LABEL = 'pressure of the seals [bar, gauge]'
_FORMULA_WIDTH = 34  # characters on a line of the ladder
_LINE = 0.19  # [inch] height of a line of the ladder
_DOTS = 1500  # in a scatter; more hide each other
_DIRECTIONS = ((1.0, style.BLUE, 'extending'), (-1.0, style.ORANGE, 'retracting'))


@house_style()
def write_identification_report(
    found: Identification, out: Path, files: Mapping[str, Path] | None = None
) -> tuple[Path, ...]:
    """Write the report of an identification; ``files`` are those of several kinds of seals; else as `write_page`."""
    plots, kinds = identification_figures(found), kinds_numbers(found)
    names = {kind: path.name for kind, path in (files or {}).items() if kind}
    return write_page(
        out,
        'identification',
        plots,
        verdict=_verdict(found, list(names.values())),
        head=head_of('identify', ', '.join(one.name for one in found.data.sources.files[:3]), 'the data have no date'),
        warnings=found.warnings,
        worst=worst_left_out(found.levels),
        found=found,
        has_repeatability=bool(np.isfinite(found.quality.repeatability)),
        thesis_figures=[plot.name for plot in plots if plot.name[3:5] in {'16', '17', '18', '19'}],
        level_table=_level_table(found),
        ladder_table=_ladder_table(found),
        parameter_table=_parameter_table(found),
        correlation_table=_correlation_table(found),
        data_table=_data_table(found),
        kinds=kinds,
        kinds_table=_kinds_table(kinds.get('kinds', ())),
        kinds_files=names,
        documents=[seal_text(document) for document in found.documents.values()],
    )


def _verdict(found: Identification, files: Sequence[str]) -> Verdict:
    quality, selection, told = found.quality, found.selection, found.quality.kinds
    if told is not None:
        total = float(told.friction.sum())
        parts = zip(found.data.kinds, told.friction.tolist(), told.apart_std.tolist(), strict=True)
        shares = [(kind.name, friction / total, std / total) for kind, friction, std in parts]
        return _verdict_on_kinds(selection.validation.error, shares, files)
    remarks = {
        'one pressure is an outlier and was left out': found.data.outlier is not None,
        'friction differs between the runs': any(change.is_changed for change in quality.changes),
        'friction drifted during the runs': any(
            level.is_used and abs(level.drift) > diagnostics.SETTLED for level in found.levels
        ),
    }
    numbers = selection.validation.error, worst_left_out(found.levels), quality.coverage, selection.fit.why_unsound
    return verdicts.of_identification(selection.law.name, *numbers, *filter(remarks.get, remarks))


def _verdict_on_kinds(error: float, shares: Sequence[tuple[str, float, float]], files: Sequence[str]) -> Verdict:
    """By the error on left-out readings, and name, share in the friction and its deviation of each kind [-]."""
    apart = LOOK if max(std for _, _, std in shares) > verdicts.WIDE_BAND else GOOD
    level = worst([between(error, verdicts.SMALL_ERROR, verdicts.LARGE_ERROR), apart])
    each = ', '.join(f'{name} {percent(share)} (standard deviation {percent(std)})' for name, share, std in shares)
    text = f'Shares of the friction: {each}. Readings that the fit did not see are off by {percent(error)} on average.'
    after = f'use the seal files together: seals: [{", ".join(files)}].'
    return Verdict(
        level, text, after if level == GOOD else f'drive the pressures that are proposed below; until then {after}'
    )


# -- tables -----------------------------------------------------------------------------------------------------------


def _level_table(found: Identification) -> Table:
    columns: Columns = (
        ('pressure [bar]', lambda level: number(level.pressure / BAR) + ('' if level.is_used else ' *')),
        ('speed [mm/s]', lambda level: number(level.speed / MM, 1)),
        ('measured [N]', lambda level: number(level.measured)),
        ('law [N]', lambda level: number(level.fitted)),
        ('residual [N]', lambda level: number(level.measured - level.fitted, signed=True)),
        ('residual [%]', lambda level: number(100.0 * (1.0 - level.fitted / level.measured), 1, signed=True)),
        ('std [N]', lambda level: number(level.std)),
        ('predicted unseen [N]', lambda level: number(level.left_out)),
        ('off [%]', lambda level: number(100.0 * (level.left_out / level.measured - 1.0), 1, signed=True)),
        ('force offset [N]', lambda level: number(level.offset, signed=True)),
        ('drift [%]', lambda level: number(100.0 * level.drift, 1, signed=True)),
        ('readings', lambda level: level.readings),
    )
    return table_of(found.levels, columns)


def _kinds_table(kinds: Sequence[Mapping[str, Any]]) -> Table:
    columns: Columns = (
        ('kind', lambda kind: kind['name']),
        ('seals on', lambda kind: ', '.join(kind['seal_chambers'])),
        ('law', lambda kind: kind['law'].partition(': ')[2]),
        ('friction [N]', lambda kind: number(kind['friction_N'])),
        ('of it rising with pressure [N]', lambda kind: number(kind['rising_N'])),
        ('standard error of that [N]', lambda kind: number(kind['rising_standard_error_N'])),
        ('share [%]', lambda kind: number(100.0 * kind['share'], 1)),
        ('std of the share [%]', lambda kind: number(100.0 * kind['share_std'], 1)),
    )
    return table_of(kinds, columns, (0, 1, 2))


def _ladder_table(found: Identification) -> Table:
    def errors(validation: CrossValidation) -> list[str]:
        return [number(validation.rms), number(validation.mean_deviation), number(100.0 * validation.error, 1)]

    selection, rows = found.selection, []
    for score in selection.scores:
        cells = [f'{score.law.name} ({score.law.formula})', len(score.law.parameters)]
        if isinstance(score, NotScored):
            rows.append((*cells, *4 * [DASH], score.why_not))
            continue
        marks = {'recommended': score is selection.best, 'saved': score.law is selection.law}
        mark = ', '.join(name for name, holds in marks.items() if holds)
        rows.append((*cells, *errors(score.validation), number(score.fit.condition_number, 1), mark))
    if selection.reference is not None:
        text = 'no law: mean of the other readings at the same pressure'
        rows.append((text, DASH, *errors(selection.reference), DASH, ''))
    return Table(('law', 'parameters', 'RMS [N]', 'mean deviation [N]', 'off [%]', 'condition', ''), rows, (0, 6))


def _parameter_table(found: Identification) -> Table:
    selection, errors, breakaway = found.selection, found.quality.standard_errors, found.quality.breakaway
    (_, first), *others = selection.fits_by_name.items()
    rows = []
    for name, fit in selection.fits_by_name.items():
        for p in selection.law.parameters:
            spread = f'{errors[p.name]:.2g}' if fit is first else DASH
            shown = f'{p.name}, {name}' if others else p.name
            rows.append((shown, p.symbol, f'{fit.values[p.name]:.5g}', spread, p.unit))
    rows += [(name, '', f'{value:.5g}', 'not fitted', '') for name, value in selection.law.fixed.items()]
    if breakaway is not None:
        values = zip(('constant', 'share'), breakaway[1:3], breakaway.standard_errors, ('N', '1'), strict=True)
        for part, value, error, unit in values:
            if value:
                rows.append((f'breakaway above Coulomb, {part}', '', f'{value:.5g}', f'{error:.2g}', unit))
    return Table(('parameter of one seal', 'symbol', 'value', 'standard error', 'unit'), rows, (0, 1, 4))


def _correlation_table(found: Identification) -> Table:
    names, correlation = [p.name for p in found.selection.law.parameters], found.selection.fit.correlation
    if found.quality.kinds is not None:
        names, correlation = [kind.name for kind in found.data.kinds], found.quality.kinds.correlation
    pairs = zip(names, correlation.tolist(), strict=True)
    rows = [(name, *(number(value, 3, signed=True) for value in values)) for name, values in pairs]
    return Table(('correlation', *names), rows, (0,))


def _data_table(found: Identification) -> Table:
    used = {one.name: f'{one.used} of {one.total}' for one in found.data.prepared.accounts}
    files = found.data.sources.files
    rows = [(file.name, used.get(file.name, 'not used: see the warnings'), file.sha256) for file in files]
    return Table(('source', 'samples used', 'SHA-256'), rows, (0, 1, 2))


# -- figures ----------------------------------------------------------------------------------------------------------


class _FittedReadings:
    """Readings of an identification beside the law fitted to them as measured, sum over all seals."""

    def __init__(self, found: Identification) -> None:
        self.found = found
        self.readings = found.data.prepared.readings
        self.pressure = self.readings.seal_pressure / BAR
        self.mounted = mounted_seals(found.as_measured)
        self.seal = self.mounted[0].seal
        self.fitted, _ = fitted_readings(self.mounted, self.readings.chamber_pressures, self.readings.at.velocity)
        self.measured = self.readings.magnitudes(offsets_of(self.readings, self.fitted))
        self.unit, self.size = force_unit(float(self.measured.max()))
        self.is_used = self.readings.level != (-1 if found.data.outlier is None else found.data.outlier.level)

    @property
    def dots(self) -> IntArray:
        """Indices of the readings to draw."""
        return np.arange(0, self.readings.count, max(-(-self.readings.count // _DOTS), 1))

    def curve(self, pressure: FloatArray, mounted: tuple[MountedSeal, ...]) -> tuple[FloatArray, FloatArray]:
        """Friction of all seals and its standard deviation [N], each at this pressure [Pa], at `curve_speed`."""
        at_pressure = tuple(MountedSeal(one.seal, 'a') for one in mounted)
        speed = np.full(len(pressure), self.curve_speed)
        return fitted_readings(at_pressure, np.column_stack((pressure, pressure)), speed)

    @property
    def curve_speed(self) -> float:
        """Speed [m/s] of the curves over pressure: the median of the readings; NaN if the law does not depend on it."""
        speeds = np.abs(self.readings.at.velocity)
        known = speeds[np.isfinite(speeds)]
        return float(np.median(known)) if self.seal.depends_on_velocity and len(known) else float('nan')


def identification_figures(found: Identification) -> list[Plot]:
    """Every figure that the data allow."""
    shown = _FittedReadings(found)
    ring, breakaway = found.data.ring, found.data.prepared.breakaway
    plots = [agreement_figure(shown), calibration_figure(found), out_of_sample_figure(found)]
    if found.data.used.kinds:
        return [kinds_figure(found), left_out_figure(found), *plots]
    plots = [fitted_law_figure(shown), *plots, ladder_figure(found)]
    if shown.readings.are_samples:
        plots.append(velocity_cloud_figure(shown))
    if breakaway is not None:
        plots.append(static_figure(shown, breakaway))
    if ring is not None:
        plots += [fitted_coefficient_figure(shown, ring), computed_normal_force_figure(shown, ring)]
        plots += prior_art_readings_figure(shown, ring)
    return plots


def left_out_figure(found: Identification) -> Plot:
    """Measured friction over the prediction without it, at each level."""
    levels = [(level.measured, level.left_out, level.std) for level in found.levels]
    measured, left_out, std = np.array(levels).T
    figure, ax = style.new_figure('Friction of all seals at pressures left out', 4.2)
    ends = np.array([0.0, 1.05 * max(measured.max(), left_out.max())])
    order = np.argsort(left_out)
    style.fill_band(ax, left_out[order], left_out[order], BAND_95 * std[order], label='95 % band')
    ax.plot(ends, ends, color=style.GREY, lw=1.0, label='equal')
    ax.plot(left_out, measured, 'o', color=style.BLUE, label='pressure level')
    labels = {'xlabel': 'predicted without it [N]', 'ylabel': 'measured [N]', 'xlim': ends}
    return finished('measured_over_left_out', figure, ax, **labels)


def kinds_figure(found: Identification) -> Plot:
    """Friction of each kind over the pressure that its seals see, as its seal file has it, with the 95 % band."""
    kinds, used = found.data.kinds, found.data.used
    figure, axes = style.panels('Friction of each kind by its seal file', len(kinds), 3.2)
    for index, (ax, kind) in enumerate(zip(axes, kinds, strict=True)):
        seal = parse_seal(found.documents[kind.name])
        pressure = np.linspace(seal.pressure_min, seal.pressure_max, 60)
        mounted = tuple(MountedSeal(seal, 'a') for _ in kind.chambers)
        friction, std = fitted_readings(mounted, np.column_stack((pressure, 0.0 * pressure)), 0.0 * pressure)
        style.fill_band(ax, pressure / BAR, friction, BAND_95 * std, label='95 % band')
        ax.plot(pressure / BAR, friction, color=style.BLUE, label='seal file')
        of_kind = used.at.pressure[:, columns_of(kinds, index)].mean(axis=1) / BAR
        seen = np.array([of_kind[inside].mean() for inside in used.levels.values()])
        ax.plot(seen, np.zeros_like(seen), 'o', color=style.ORANGE, ms=5.0, label='pressures driven')
        ax.set_title(f'{kind.name}: {", ".join(kind.chambers)}', pad=18.0)
    style.label_panels(axes, 'pressure at the seals [bar]', 'friction [N]')
    axes[0].set_ylim(bottom=-0.04 * axes[0].get_ylim()[1])
    return finished('friction_of_kinds', figure, axes[0])


def _draw_readings(ax: Axes, shown: _FittedReadings, x: FloatArray, y: FloatArray) -> None:
    """Readings as dots: extension, retraction, and outliers."""
    chosen = shown.dots
    direction, used = shown.readings.at.direction[chosen], shown.is_used[chosen]
    size, alpha = (3.0, 0.25) if shown.readings.are_samples else (5.0, 0.6)
    for side, colour, name in _DIRECTIONS:
        at = chosen[(direction == side) & used]
        ax.plot(x[at], y[at], 'o', ms=size, color=colour, alpha=alpha, mew=0.0, label=f'readings, {name}')
    at = chosen[~used]
    if len(at):
        ax.plot(x[at], y[at], 'x', ms=size + 1.0, color=style.VERMILLION, alpha=0.8, label='outlier, not fitted')


def fitted_law_figure(shown: _FittedReadings) -> Plot:
    """Law over pressure with its band, and the readings (as Figure 24)."""
    levels, size, are_samples = shown.found.levels, shown.size, shown.readings.are_samples
    title = 'Friction over pressure, law and readings'
    if shown.readings.left_out_by == 'pressure':
        most = 100.0 * worst_left_out(levels)
        title = f'At a pressure left out of the fit, the law is off the mean reading by {most:.1f} % at most'
    figure, ax = style.new_figure(title, 4.4)
    at_levels = [(level.pressure / BAR, level.measured, level.fitted, level.std) for level in levels]
    x, measured, fitted, std = np.array(at_levels).T
    if are_samples:
        look = {'fmt': 's', 'color': style.BLACK, 'ms': 5.0, 'capsize': 3.0, 'zorder': 4}
        ax.errorbar(x, fitted / size, BAND_95 * std / size, **look, label='law at the mean, and 95 % band')
    else:
        highest = max(shown.seal.pressure_max, float(shown.readings.seal_pressure.max()))
        pressure = np.linspace(min(shown.seal.pressure_min, highest), highest, 201)
        fitted, std = shown.curve(pressure, shown.mounted)
        style.fill_band(ax, pressure / BAR, fitted / size, BAND_95 * std / size, label='95 % band')
        at_speed = f' at {shown.curve_speed / MM:.3g} mm/s' if np.isfinite(shown.curve_speed) else ''
        ax.plot(pressure / BAR, fitted / size, color=style.BLACK, lw=1.8, label=f'law{at_speed}')
        if shown.found.selection.settled is not None:
            settled = tuple(MountedSeal(parse_seal(shown.found.document), one.chamber) for one in shown.mounted)
            look = {'color': style.BLACK, 'lw': 1.2, 'ls': '--', 'label': 'law of the settled seal'}
            ax.plot(pressure / BAR, shown.curve(pressure, settled)[0] / size, **look)
    _draw_readings(ax, shown, shown.pressure, shown.measured / size)
    if not are_samples:
        ax.plot(x, measured / size, 'D', ms=6.0, color=style.BLACK, mec='white', label='measured')
    return _over_pressure('fig24_model_over_pressure', figure, ax, shown.unit)


def _over_pressure(name: str, figure: Figure, ax: Axes, unit: str) -> Plot:
    labels = {'xlabel': PRESSURE_LABEL, 'ylabel': f'friction of all seals [{unit}]'}
    return finished(name, figure, ax, ylim=(0.0, None), **labels)


def agreement_figure(shown: _FittedReadings) -> Plot:
    """Measured against fitted friction, with the band."""
    quality, size = shown.found.quality, shown.size
    title = f'Measured against law: {100.0 * quality.coverage:.0f} % of the readings left out are in the band'
    figure, ax = style.new_figure(title, 4.6)
    line = np.linspace(0.0, max(float(shown.fitted.max()), float(shown.measured.max())), 101)
    style.fill_band(ax, line / size, line / size, BAND_95 * quality.uncertainty.std(line) / size, label='95 % band')
    ax.plot(line / size, line / size, color=style.BLACK, lw=1.2, label='equal')
    _draw_readings(ax, shown, shown.fitted / size, shown.measured / size)
    labels = {'xlabel': f'law [{shown.unit}]', 'ylabel': f'measured, all seals [{shown.unit}]'}
    return finished('measured_against_model', figure, ax, xlim=(0.0, None), **labels)


def calibration_figure(found: Identification) -> Plot:
    """Share of the readings inside a band that was made without them, over its nominal share: a reliability diagram.

    The grey region holds 95 % of the shares that groups of a calibrated band show at each nominal share, if the
    readings of a group are inside or outside together (our choice): binomial quantiles over the number of groups.
    """
    curves = found.quality.calibration
    nominal = 100.0 * curves.nominal
    at_95 = int(np.searchsorted(curves.nominal, 0.95 - 1e-9))
    figure, axes = style.new_figure(_calibration_title(curves, at_95), 4.4, ncols=2, sharex=True, sharey=True)
    for ax, share, groups, colour, name, missing in (
        (axes[0], curves.within_runs, curves.groups, style.BLUE, 'within runs', 'too few readings in a run'),
        (axes[1], curves.between_runs, curves.runs, style.ORANGE, 'between runs', ONE_RUN),
    ):
        ax.plot([0.0, 100.0], [0.0, 100.0], color=style.BLACK, lw=1.0, label='calibrated')
        ax.set(xlabel=f'nominal share {name} [%]', aspect='equal', xlim=(0.0, 100.0), ylim=(0.0, 101.0))
        if np.isfinite(share).all():
            low, high = (100.0 * binom.ppf(tail, groups, curves.nominal) / groups for tail in (0.025, 0.975))
            band = {'color': style.LIGHT_GREY, 'alpha': 0.6, 'lw': 0, 'zorder': 0.5}
            ax.fill_between(nominal, low, high, **band, label=f'chance, {groups} groups')
            ax.plot(nominal, 100.0 * share, color=colour, lw=2.0, label='readings')
        else:
            ax.text(50.0, 20.0, missing, ha='center', va='center', color=style.GREY, backgroundcolor='white')
    axes[0].set_ylabel('share of the readings inside [%]')
    return finished('calibration', figure, *axes)


def _calibration_title(curves: Calibration, at: int) -> str:
    """Shares of the readings inside the 95 % band, where they are known."""
    known = (('within', curves.within_runs[at]), ('between', curves.between_runs[at]))
    parts = [f'{100.0 * share:.0f} % {name} runs' for name, share in known if np.isfinite(share)]
    return f'95 % band holds {", ".join(parts)}' if parts else 'Calibration of the band is unknown'


def out_of_sample_figure(found: Identification) -> Plot:
    """Residuals out of sample, over pressure and in the order of the readings."""
    used, validation = found.data.used, found.selection.validation
    unit, size = force_unit(float(np.abs(validation.deviation).max()))
    title = f'Residuals out of sample: {validation.rms / size:.3g} {unit} RMS'
    figure, axes = style.new_figure(title, 3.6, ncols=2, sharey=True, width_ratios=(2, 3))
    step = max(-(-used.count // _DOTS), 1)
    look = {'ms': 2.5, 'alpha': 0.35} if used.are_samples else {'ms': 4.5, 'alpha': 0.8}
    order = np.arange(used.count)
    for ax, x, label in ((axes[0], used.seal_pressure / BAR, PRESSURE_LABEL), (axes[1], order, 'reading')):
        for side, colour, name in _DIRECTIONS:
            chosen = np.flatnonzero(used.at.direction == side)[::step]
            ax.plot(x[chosen], validation.deviation[chosen] / size, 'o', color=colour, mew=0.0, label=name, **look)
        ax.axhline(0.0, color=style.GREY, lw=0.8)
        ax.set_xlabel(label)
    half = BAND_95 * found.quality.uncertainty.std(validation.predicted) / size
    style.fill_band(axes[1], order.astype(float), np.zeros(used.count), half, alpha=0.25, label='95 % band', step='mid')
    axes[0].set_ylabel(f'measured - predicted [{unit}]')
    return finished('residuals', figure, axes[1])


def ladder_figure(found: Identification) -> Plot:
    """Out-of-sample error of each law."""
    each = [(score, 100.0 * score.validation.error) for score in scored(found.selection.scores)]
    errors = [error for _, error in each]
    labels = ['\n'.join(wrap(score.law.formula, _FORMULA_WIDTH)) for score, _ in each]
    heights = np.array([label.count('\n') + 1.6 for label in labels])  # in lines, with a gap
    place = (np.cumsum(heights) - 0.5 * heights).tolist()
    title = 'Error of each law on readings left out of its fit'
    figure, ax = style.new_figure(title, 1.3 + _LINE * float(heights.sum()))
    figure.set_layout_engine('constrained', rect=(0.012, 0.0, 0.98, 1.0))  # the widest label is not cut off
    colours = [style.GREEN if score is found.selection.best else style.SKY for score, _ in each]
    bars = ax.barh(place, errors, color=colours, height=1.0)
    ax.bar_label(bars, labels=[f'{error:.1f} %' for error in errors], padding=4)
    ax.set_yticks(place, labels)
    ax.grid(visible=False, axis='y')
    ax.set(ylim=(float(heights.sum()), 0.0), xlim=(None, 1.12 * max(errors)))
    ax.set_xlabel('sum of the deviations over sum of the measured friction [%]')
    if found.selection.reference is None:
        return Plot('ladder', figure)
    reference = 100.0 * found.selection.reference.error
    ax.axvline(reference, color=style.VERMILLION, ls='--', label=f'mean of the other tests, no law: {reference:.1f} %')
    return finished('ladder', figure, ax)


def velocity_cloud_figure(shown: _FittedReadings) -> Plot:
    """Friction over velocity of a swept log."""
    figure, ax = style.new_figure('Friction over velocity', 4.2)
    chosen = shown.dots
    velocity, direction = shown.readings.at.velocity[chosen], shown.readings.at.direction[chosen] / shown.size
    for friction, look in (
        (shown.measured, {'color': style.BLUE, 'ms': 2.5, 'alpha': 0.25, 'label': 'measured, offset removed'}),
        (shown.fitted, {'color': style.BLACK, 'ms': 2.0, 'alpha': 0.35, 'label': 'law'}),
    ):
        ax.plot(velocity, direction * friction[chosen], 'o', mew=0.0, **look)
    style.zero_lines(ax, vertical=True)
    labels = {'xlabel': 'rod velocity [m/s]', 'ylabel': f'friction of all seals [{shown.unit}]'}
    return finished('friction_over_velocity', figure, ax, **labels)


def static_figure(shown: _FittedReadings, breakaway: FrictionReadings) -> Plot:
    """Static and dynamic friction with curves of second order (as Figure 16)."""
    static = breakaway.at.direction * (breakaway.force - shown.found.selection.fit.offsets[breakaway.source])
    unit, size = force_unit(float(static.max()))
    dynamic = {level: float(shown.measured[inside].mean()) for level, inside in shown.readings.levels.items()}
    pairs = zip(static, breakaway.level.tolist(), strict=True)
    stiction = float(np.mean([force - dynamic[level] for force, level in pairs if level in dynamic]))
    side = 'above' if stiction >= 0.0 else 'below'
    title = f'Static friction is {abs(stiction):.3g} N {side} dynamic friction at the same pressure, on average'
    figure, ax = style.new_figure(title, 4.2)
    for name, pressure, friction, colour, mark in (
        ('static', breakaway.seal_pressure, static, style.ORANGE, 's'),
        ('dynamic', shown.readings.seal_pressure, shown.measured, style.BLUE, 'o'),
    ):
        look = {'ms': 4.5, 'color': colour, 'alpha': 0.45, 'mew': 0.0}
        ax.plot(pressure / BAR, friction / size, mark, label=f'{name} friction', **look)
        if len(np.unique(np.round(pressure, -3))) >= 3:
            line = np.linspace(float(pressure.min()), float(pressure.max()), 101) / BAR
            curve = np.polyval(np.polyfit(pressure / BAR, friction, 2), line)
            ax.plot(line, curve / size, color=colour, lw=1.8, label=f'{name}, second order')
    return _over_pressure('fig16_static_and_dynamic', figure, ax, unit)


def fitted_coefficient_figure(shown: _FittedReadings, ring: Ring) -> Plot:
    """Coefficient of friction over normal force (as Figure 18)."""
    normal = normal_forces(shown.readings.at.pressure, *ring)
    total, seals = normal.sum(axis=1), normal.shape[1]
    unit, size = force_unit(float(total.max()) / seals)
    figure, ax = style.new_figure('Coefficient of friction over normal force', 4.0)
    pressure = np.linspace(float(shown.readings.seal_pressure.min()), float(shown.readings.seal_pressure.max()), 201)
    of_one = normal_forces(pressure, *ring)
    coulomb = np.array([shown.seal.coulomb_law.coulomb_friction(float(p)) for p in pressure])
    ax.plot(of_one / size, coulomb / of_one, color=style.BLACK, lw=1.8, label='law')
    _draw_readings(ax, shown, total / seals / size, shown.measured / total)
    return style.figure_18(figure, ax, unit)


def computed_normal_force_figure(shown: _FittedReadings, ring: Ring) -> Plot:
    """Normal over axial force (as Figure 19)."""
    normal, area, law = normal_forces(shown.readings.at.pressure, *ring), projected_area(ring.geometry), ring[1]
    axial = (shown.readings.at.pressure * area).ravel()
    order = np.argsort(axial, kind='stable')
    x, y = axial[order], normal.ravel()[order]
    unit, size = force_unit(float(max(x.max(), y.max())))
    title = 'Normal over axial force'
    if isinstance(law, AreaDeformationGain):
        title = f'Normal force: {law.area_deformation_gain:.3g} of the axial force, plus {law.radial_force:.3g} N'
    figure, ax = style.new_figure(title, 3.6)
    ax.plot(x / size, y / size, color=style.BLUE, lw=1.8, label='law of the normal force')
    levels = np.array([level.pressure * area for level in shown.found.levels])
    look = {'color': style.BLACK, 'ms': 5.0, 'label': 'pressures measured'}
    ax.plot(levels / size, np.interp(levels, x, y) / size, 'o', **look)
    return style.figure_19(figure, ax, unit)


def prior_art_readings_figure(shown: _FittedReadings, ring: Ring) -> list[Plot]:
    """Prior art against the readings (as Figure 17), for the only ring with known charts; else nothing."""
    chart = parse_seal(read_yaml(config_path('seals', PRIOR_ART_SEAL)))
    law = chart.coulomb_law
    if not isinstance(law, PriorArtChart) or not _same_ring(law, ring):
        return []
    mounted = tuple(MountedSeal(chart, chamber) for chamber in shown.found.data.sources.chambers)
    pressure = np.linspace(0.0, float(shown.readings.seal_pressure.max()), 101)
    prior, _ = shown.curve(pressure, mounted)
    at_levels, measured = np.array([(level.pressure, level.measured) for level in shown.found.levels]).T
    off = 100.0 * (np.interp(at_levels, pressure, prior) / measured - 1.0)
    unit, size = force_unit(float(prior.max()))
    figure, ax = style.new_figure(f'Prior art is {off.min():.0f} to {off.max():.0f} % above the readings', 4.0)
    ax.plot(pressure / BAR, prior / size, color=style.VERMILLION, lw=1.8, label='prior art, from charts')
    _draw_readings(ax, shown, shown.pressure, shown.measured / size)
    return [_over_pressure('fig17_prior_art_and_tests', figure, ax, unit)]


def _same_ring(law: PriorArtChart, ring: Ring) -> bool:
    names = ('section_diameter', 'ring_inner_diameter', 'rod_diameter', 'gland_diameter')
    return all(abs(getattr(law.geometry, name) / getattr(ring.geometry, name) - 1.0) < 1e-3 for name in names)
