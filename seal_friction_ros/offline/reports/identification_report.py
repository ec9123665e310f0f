"""An identification as one page: what was measured, what the law says, and what each law is worth out of sample."""

from collections.abc import Callable, Iterable, Sequence
from html import escape
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.geometry import projected_area
from seal_friction_ros.core.friction.laws.normal_force import AreaDeformationGain
from seal_friction_ros.core.friction.laws.prior_art_chart import PriorArtChart
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.identification.fitting import BAND_95, Score, offsets_of
from seal_friction_ros.core.identification.ladder import normal_forces
from seal_friction_ros.core.identification.readings import Readings
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.identification.document import worst_left_out
from seal_friction_ros.offline.identification.pipeline import fitted_readings, normal_force_law
from seal_friction_ros.offline.identification.results import Identification, Ring
from seal_friction_ros.offline.reports.bag_report import number, table, tiles, write_page
from seal_friction_ros.offline.reports.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    SKY,
    VERMILLION,
    Plot,
    force_unit,
    house_style,
    legend_above,
    new_figure,
)
from seal_friction_ros.offline.work.seal_writer import seal_text

PRIOR_ART_SEAL = 'ms28775_114_prior_art'  # the one ring whose charts are known
DOTS = 1500  # in a scatter; more hide each other


def write_identification_report(found: Identification, out: Path) -> tuple[Path, ...]:
    """Write the page, and each figure as PNG and SVG in ``<stem>_figures`` beside it; returns the figures.

    Raises:
        ValueError: The page cannot be written.
    """
    name = str(found.document['name'])
    with house_style():
        plots = identification_figures(found)
        return write_page(out, f'Identified seal {name}', lambda figure: _sections(found, plots, figure), plots)


# -- figures ----------------------------------------------------------------------------------------------------------


class _Shown:
    """Readings of an identification beside its law, all seals together."""

    def __init__(self, found: Identification) -> None:
        self.found = found
        self.readings = found.data.prepared.readings
        seal = parse_seal(found.document)
        self.seal = seal
        self.mounted = tuple(MountedSeal(seal, chamber) for chamber in found.data.sources.chambers)
        self.fitted, self.std = fitted_readings(
            self.mounted, found.data.prepared.chamber_pressures, self.readings.at.velocity
        )
        self.measured = magnitudes(self.readings, self.fitted)
        self.is_used = np.ones(self.readings.count, dtype=bool)
        if found.data.outlier is not None:
            self.is_used = self.readings.level != found.data.outlier.level

    @property
    def dots(self) -> IntArray:
        """Indices of the readings that are drawn."""
        step = max(-(-self.readings.count // DOTS), 1)
        return np.arange(0, self.readings.count, step)


def magnitudes(readings: Readings, friction: FloatArray) -> FloatArray:
    """Measured friction, offset of each source removed [N], shape (n,); ``friction`` [N] is a law's at the readings."""
    offsets = offsets_of(readings, friction)
    return np.asarray(readings.at.direction * (readings.force - offsets[readings.source]))


def identification_figures(found: Identification) -> list[Plot]:
    """Every figure that the data allow."""
    shown = _Shown(found)
    plots = [model_figure(shown), agreement_figure(shown), residual_figure(shown), ladder_figure(found)]
    if shown.readings.are_samples:
        plots.append(velocity_figure(shown))
    if found.data.prepared.breakaway is not None:
        plots.append(static_figure(shown, found.data.prepared.breakaway))
    if found.data.ring is not None:
        plots += [coefficient_figure(shown, found.data.ring), normal_force_figure(shown, found.data.ring)]
        plots += prior_art_figure(shown, found.data.ring)
    return plots


def _side_dots(ax: Axes, shown: _Shown, x: FloatArray, y: FloatArray) -> None:
    """Readings as dots: extension, retraction, and what the law was not fitted to."""
    chosen = shown.dots
    direction, used = shown.readings.at.direction[chosen], shown.is_used[chosen]
    size = 3.0 if shown.readings.are_samples else 5.0
    alpha = 0.25 if shown.readings.are_samples else 0.6
    looks = ((1.0, BLUE, 'extending'), (-1.0, ORANGE, 'retracting'))
    for side, colour, label in looks:
        inside = chosen[(direction == side) & used]
        ax.plot(x[inside], y[inside], 'o', ms=size, color=colour, alpha=alpha, mew=0.0, label=f'readings, {label}')
    left = chosen[~used]
    if len(left):
        ax.plot(x[left], y[left], 'x', ms=size + 1.0, color=VERMILLION, alpha=0.8, label='outlier, not fitted')


def _legend(ax: Axes) -> None:
    """Legend with full marks, however faint the dots are."""
    legend_above(ax)
    legend = ax.get_legend()
    for handle in legend.legend_handles if legend is not None else ():
        if handle is not None and handle.get_alpha() is not None and not isinstance(handle, Patch):
            handle.set_alpha(1.0)


def model_figure(shown: _Shown) -> Plot:
    """The law over pressure with its band and the readings (Figure 24)."""
    unit, size = force_unit(float(shown.measured.max()))
    levels = shown.found.levels
    title = 'Friction over pressure, law and readings'
    if shown.readings.left_out_by == 'pressure':
        title = f'A pressure that the law has not seen is off by {100.0 * worst_left_out(levels):.1f} % at most'
    figure, ax = new_figure(title, 4.4)
    if shown.readings.are_samples:
        pressure = np.array([level.pressure for level in levels])
        fitted = np.array([level.fitted for level in levels])
        half = BAND_95 * np.array([level.std for level in levels])
        ax.errorbar(
            pressure / BAR, fitted / size, half / size, fmt='s', color=BLACK, ms=5.0, capsize=3.0, zorder=4,
            label='law at the mean, and 95 % band',
        )  # fmt: skip
    else:
        highest = max(shown.seal.pressure_max, float(shown.readings.seal_pressure.max()))
        pressure = np.linspace(min(shown.seal.pressure_min, highest), highest, 201)
        fitted, std = fitted_readings(shown.mounted, np.column_stack((pressure, pressure)), np.full(201, np.nan))
        half = BAND_95 * std
        ax.fill_between(
            pressure / BAR,
            (fitted - half) / size,
            (fitted + half) / size,
            color=SKY,
            alpha=0.3,
            lw=0,
            label='95 % band',
        )
        ax.plot(pressure / BAR, fitted / size, color=BLACK, lw=1.8, label='law')
    _side_dots(ax, shown, shown.readings.seal_pressure / BAR, shown.measured / size)
    if not shown.readings.are_samples:
        ax.plot(
            [level.pressure / BAR for level in levels], [level.measured / size for level in levels], 'D', ms=6.0,
            color=BLACK, mec='white', label='measured',
        )  # fmt: skip
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel('pressure of the seals [bar, gauge]')
    ax.set_ylabel(f'friction of all seals [{unit}]')
    _legend(ax)
    return Plot(
        'fig24_model_over_pressure',
        figure,
        'Law and readings over pressure (as Figure 24 of the thesis). The band is where 95 % of new readings are '
        'expected. '
        + (
            'Speeds differ from sample to sample, so the law is shown at the mean conditions of each tenth.'
            if shown.readings.are_samples
            else 'Offsets of the force sum are removed; diamonds are half the difference of the two directions.'
        ),
    )


def agreement_figure(shown: _Shown) -> Plot:
    """Measured against fitted, with the band."""
    unit, size = force_unit(float(shown.measured.max()))
    coverage = 100.0 * shown.found.quality.coverage
    figure, ax = new_figure(f'Measured against law: {coverage:.0f} % of the readings left out are in the band', 4.6)
    line = np.linspace(0.0, max(float(shown.fitted.max()), float(shown.measured.max())), 101)
    worth = shown.found.quality
    half = BAND_95 * worth.spread.std(line)
    ax.fill_between(
        line / size, (line - half) / size, (line + half) / size, color=SKY, alpha=0.3, lw=0, label='95 % band'
    )
    ax.plot(line / size, line / size, color=BLACK, lw=1.2, label='equal')
    _side_dots(ax, shown, shown.fitted / size, shown.measured / size)
    ax.set_xlim(left=0.0)
    ax.set_xlabel(f'law [{unit}]')
    ax.set_ylabel(f'measured, all seals [{unit}]')
    _legend(ax)
    return Plot(
        'measured_against_model',
        figure,
        'Each reading against the law of the file, offset of the force sum removed. The share in the title is of '
        'readings that neither the law nor the band had seen.',
    )


def residual_figure(shown: _Shown) -> Plot:
    """What is left, out of sample, over pressure and in the order of the readings."""
    used = shown.found.data.used
    left = shown.found.selection.validation.deviation
    predicted = shown.found.selection.validation.predicted
    unit, size = force_unit(float(np.abs(left).max()))
    half = BAND_95 * shown.found.quality.spread.std(predicted)
    step = max(-(-used.count // DOTS), 1)
    figure, axes = new_figure(
        f'Residuals out of sample: {shown.found.selection.validation.rms / size:.3g} {unit} RMS',
        3.6,
        ncols=2,
        sharey=True,
        width_ratios=(2, 3),
    )
    x = ((used.seal_pressure / BAR, 'pressure of the seals [bar, gauge]'), (np.arange(used.count), 'reading'))
    for ax, (column, label) in zip(axes, x, strict=True):
        for side, colour in ((1.0, BLUE), (-1.0, ORANGE)):
            chosen = np.flatnonzero(used.at.direction == side)[::step]
            name = 'extending' if side > 0.0 else 'retracting'
            look = {'ms': 2.5, 'alpha': 0.35} if used.are_samples else {'ms': 4.5, 'alpha': 0.8}
            ax.plot(column[chosen], left[chosen] / size, 'o', color=colour, mew=0.0, label=name, **look)
        ax.axhline(0.0, color=GREY, lw=0.8)
        ax.set_xlabel(label)
    order = np.arange(used.count)
    axes[1].fill_between(order, -half / size, half / size, color=SKY, alpha=0.25, lw=0, label='95 % band', step='mid')
    axes[0].set_ylabel(f'measured - predicted [{unit}]')
    _legend(axes[1])
    return Plot(
        'residuals',
        figure,
        f'Each reading less the prediction of the law that was fitted without it (left out by {used.left_out_by}). '
        'Neighbours on the same side are what the law does not know.',
    )


def ladder_figure(found: Identification) -> Plot:
    """Out-of-sample error of each law."""
    scored = [score for score in found.selection.scores if score.validation is not None]
    errors = [100.0 * score.validation.error for score in scored if score.validation is not None]
    names = [score.rung.words.replace(' + ', '\n+ ') for score in scored]
    figure, ax = new_figure('What each law is off by, on readings it has not seen', 1.5 + 0.33 * len(scored))
    colours = [GREEN if score is found.selection.best else SKY for score in scored]
    bars = ax.barh(range(len(scored)), errors, color=colours, height=0.65)
    ax.bar_label(bars, labels=[f'{error:.1f} %' for error in errors], padding=4)
    ax.set_yticks(range(len(scored)), names)
    ax.invert_yaxis()
    ax.grid(visible=False, axis='y')
    ax.set_xlim(right=1.12 * max(errors))
    if found.selection.reference is not None:
        reference = 100.0 * found.selection.reference.error
        ax.axvline(reference, color=VERMILLION, ls='--', label=f'mean of the other tests, no law: {reference:.1f} %')
        _legend(ax)
    ax.set_xlabel('sum of the deviations over sum of the measured friction [%]')
    return Plot(
        'ladder',
        figure,
        f'Every law fitted to all groups but one and scored on that one (by {found.data.used.left_out_by}). Green: the '
        'lowest law that no other beats beyond the noise.',
    )


def velocity_figure(shown: _Shown) -> Plot:
    """Friction over velocity for a swept log."""
    unit, size = force_unit(float(shown.measured.max()))
    figure, ax = new_figure('Friction over velocity', 4.2)
    chosen = shown.dots
    velocity = shown.readings.at.velocity
    direction = shown.readings.at.direction
    ax.plot(
        velocity[chosen], (direction * shown.measured)[chosen] / size, 'o', ms=2.5, color=BLUE, alpha=0.25, mew=0.0,
        label='measured, offset removed',
    )  # fmt: skip
    ax.plot(
        velocity[chosen], (direction * shown.fitted)[chosen] / size, 'o', ms=2.0, color=BLACK, alpha=0.35, mew=0.0,
        label='law',
    )  # fmt: skip
    ax.axhline(0.0, color=GREY, lw=0.6)
    ax.axvline(0.0, color=GREY, lw=0.6)
    ax.set_xlabel('rod velocity [m/s]')
    ax.set_ylabel(f'friction of all seals [{unit}]')
    _legend(ax)
    return Plot(
        'friction_over_velocity',
        figure,
        'Samples of even sliding, and the law at the same samples: it is a cloud and not a line, since the pressure '
        'differs at the same velocity.',
    )


def static_figure(shown: _Shown, breakaway: Readings) -> Plot:
    """Static and dynamic friction with curves of second order (Figure 16)."""
    static = breakaway.at.direction * (breakaway.force - shown.found.selection.fit.offsets[breakaway.source])
    unit, size = force_unit(float(static.max()))
    stiction = float(static.mean() - shown.measured.mean())
    figure, ax = new_figure(f'Breaking out takes {stiction:.3g} N more than running, on average', 4.2)
    parts = (
        ('static', breakaway.seal_pressure, static, ORANGE, 's'),
        ('dynamic', shown.readings.seal_pressure, shown.measured, BLUE, 'o'),
    )
    for name, pressure, friction, colour, mark in parts:
        ax.plot(
            pressure / BAR, friction / size, mark, ms=4.5, color=colour, alpha=0.45, mew=0.0, label=f'{name} friction'
        )
        if len(np.unique(np.round(pressure, -3))) >= 3:
            line = np.linspace(float(pressure.min()), float(pressure.max()), 101)
            curve = np.polyval(np.polyfit(pressure / BAR, friction, 2), line / BAR)
            ax.plot(line / BAR, curve / size, color=colour, lw=1.8, label=f'{name}, second order')
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel('pressure of the seals [bar, gauge]')
    ax.set_ylabel(f'friction of all seals [{unit}]')
    _legend(ax)
    return Plot(
        'fig16_static_and_dynamic',
        figure,
        'Breakout and running friction with curves of second order (as Figure 16 of the thesis). The curves are for '
        'the eye only; the law of the file is another.',
    )


def coefficient_figure(shown: _Shown, ring: Ring) -> Plot:
    """Coefficient of friction over normal force (Figure 18)."""
    normal = shown.readings.at.normal_force
    assert normal is not None  # noqa: S101
    total = normal.sum(axis=1)
    seals = normal.shape[1]
    unit, size = force_unit(float(total.max()) / seals)
    figure, ax = new_figure('Coefficient of friction over normal force', 4.0)
    pressure = np.linspace(float(shown.readings.seal_pressure.min()), float(shown.readings.seal_pressure.max()), 201)
    of_one = normal_forces(pressure[:, np.newaxis], ring.geometry, normal_force_law(ring.normal_force))[:, 0]
    coulomb = np.array([shown.seal.coulomb_law.coulomb_friction(float(p)) for p in pressure])
    ax.plot(of_one / size, coulomb / of_one, color=BLACK, lw=1.8, label='law')
    _side_dots(ax, shown, total / seals / size, shown.measured / total)
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel(f'normal force of one seal [{unit}]')
    ax.set_ylabel('coefficient of dynamic friction [-]')
    _legend(ax)
    return Plot(
        'fig18_coefficient_of_friction',
        figure,
        'Measured friction over normal force (as Figure 18 of the thesis). The normal force is computed from the '
        'geometry and the pressure, not measured.',
    )


def normal_force_figure(shown: _Shown, ring: Ring) -> Plot:
    """Normal over axial force (Figure 19)."""
    normal = shown.readings.at.normal_force
    assert normal is not None  # noqa: S101
    area = projected_area(ring.geometry)
    axial = shown.readings.at.pressure * area
    order = np.argsort(axial.ravel(), kind='stable')
    x, y = axial.ravel()[order], normal.ravel()[order]
    unit, size = force_unit(float(max(x.max(), y.max())))
    values = {key: value for key, value in ring.normal_force.items() if key != 'law'}
    is_line = ring.normal_force.get('law') == 'area_deformation_gain'
    title = 'Normal over axial force'
    if is_line:
        law = AreaDeformationGain(**values)
        title = f'Normal force: {law.area_deformation_gain:.3g} of the axial force, and {law.radial_force:.3g} N'
    figure, ax = new_figure(title, 3.6)
    ax.plot(x / size, y / size, color=BLUE, lw=1.8, label='law of the normal force')
    levels = [level.pressure * area / size for level in shown.found.levels]
    ax.plot(
        levels, np.interp(np.array(levels) * size, x, y) / size, 'o', color=BLACK, ms=5.0, label='pressures measured'
    )
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel(f'axial force of one seal, pressure times projected area [{unit}]')
    ax.set_ylabel(f'normal force of one seal [{unit}]')
    _legend(ax)
    return Plot(
        'fig19_normal_force',
        figure,
        'Normal over axial force (as Figure 19 of the thesis): computed, since friction alone does not tell it from '
        'the coefficient of friction.',
    )


def prior_art_figure(shown: _Shown, ring: Ring) -> list[Plot]:
    """Prior art against the readings (Figure 17), for the one ring whose charts are known; else nothing."""
    chart = parse_seal(read_yaml(config_path('seals', PRIOR_ART_SEAL)))
    law = chart.coulomb_law
    if not isinstance(law, PriorArtChart) or not _same_ring(law, ring):
        return []
    mounted = tuple(MountedSeal(chart, chamber) for chamber in shown.found.data.sources.chambers)
    pressure = np.linspace(0.0, float(shown.readings.seal_pressure.max()), 101)
    prior, _ = fitted_readings(mounted, np.column_stack((pressure, pressure)), np.full(101, np.nan))
    at_levels = np.array([level.pressure for level in shown.found.levels])
    measured = np.array([level.measured for level in shown.found.levels])
    off = 100.0 * (np.interp(at_levels, pressure, prior) / measured - 1.0)
    unit, size = force_unit(float(prior.max()))
    figure, ax = new_figure(f'Prior art is {off.min():.0f} to {off.max():.0f} % above the readings', 4.0)
    ax.plot(pressure / BAR, prior / size, color=VERMILLION, lw=1.8, label='prior art, from charts')
    _side_dots(ax, shown, shown.readings.seal_pressure / BAR, shown.measured / size)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel('pressure of the seals [bar, gauge]')
    ax.set_ylabel(f'friction of all seals [{unit}]')
    _legend(ax)
    return [
        Plot(
            'fig17_prior_art_and_tests',
            figure,
            'Friction by the charts of the prior art against the readings (as Figure 17 of the thesis).',
        )
    ]


def _same_ring(law: PriorArtChart, ring: Ring) -> bool:
    names = ('section_diameter', 'ring_inner_diameter', 'rod_diameter', 'gland_diameter')
    return all(abs(getattr(law.geometry, name) / getattr(ring.geometry, name) - 1.0) < 1e-3 for name in names)


# -- the page ---------------------------------------------------------------------------------------------------------


def _sections(found: Identification, plots: Sequence[Plot], figure: Callable[[str], str]) -> Iterable[str]:
    choice = found.selection
    yield f'<h1>Seal {escape(str(found.document["name"]))}, identified</h1>'
    yield f'<p class="lead">{escape(str(found.document["source"]))}</p>'
    yield _tiles(found)
    yield from (f'<p class="note">{escape(warning)}</p>' for warning in found.warnings)
    yield '<h2>Measured against law</h2>'
    yield from (figure(name) for name in ('fig24_model_over_pressure', 'measured_against_model'))
    yield _level_table(found)
    yield figure('friction_over_velocity')
    yield figure('residuals')
    yield '<h2>Which law</h2>'
    yield figure('ladder')
    yield _ladder_table(found)
    yield '<h2>Parameters</h2>'
    yield _parameter_table(found)
    yield _correlation_table(found)
    rest = [plot.name for plot in plots if plot.name.startswith(('fig16', 'fig17', 'fig18', 'fig19'))]
    if rest:
        yield '<h2>As in the thesis</h2>'
        yield from (figure(name) for name in rest)
    if 'fig17_prior_art_and_tests' not in rest:
        yield '<p>Figure 17 (prior art) needs charts for the ring, which are known for the MS28775-114 only.</p>'
    if found.data.ring is None:
        yield '<p>Figures 18 and 19 need the geometry of the ring: name a seal with --seal.</p>'
    if found.data.prepared.breakaway is None:
        yield '<p>Figure 16 (static friction) needs starts from rest.</p>'
    yield '<h2>Data</h2>'
    yield _data_table(found)
    yield '<ul>' + ''.join(f'<li>{escape(remark)}</li>' for remark in found.remarks) + '</ul>'
    yield '<h2>How the numbers are made</h2>'
    yield _explanations(choice.fit.rung.name)
    yield '<h2>Seal file</h2>'
    yield f'<pre>{escape(seal_text(found.document))}</pre>'


def _tiles(found: Identification) -> str:
    validation, worth = found.selection.validation, found.quality
    values = [
        ('law', found.selection.rung.name),
        ('off on readings not seen', f'{100.0 * validation.error:.1f} %'),
        ('readings left out that are in the 95 % band', f'{100.0 * worth.coverage:.0f} %'),
    ]
    if np.isfinite(worth.repeatability):
        values.append(('readings repeat within (1 std)', f'{100.0 * worth.repeatability:.1f} %'))
    low, high = found.document['identified_pressure']
    values.append(('identified pressure', f'{low / BAR:.3g} to {high / BAR:.3g} bar'))
    return tiles(values)


def _level_table(found: Identification) -> str:
    heads = (
        'pressure [bar]', 'speed [mm/s]', 'measured [N]', 'law [N]', 'residual [N]', 'residual [%]', 'std [N]',
        'predicted unseen [N]', 'off [%]', 'offset of the force sum [N]', 'drift in the run [%]', 'readings',
    )  # fmt: skip
    rows = []
    for level in found.levels:
        residual = level.measured - level.fitted
        rows.append(
            (
                number(level.pressure / BAR) + ('' if level.is_used else ' *'),
                number(_or_none(1e3 * level.speed), 1),
                number(level.measured),
                number(level.fitted),
                number(residual, signed=True),
                number(100.0 * residual / level.measured, 1, signed=True),
                number(level.std),
                number(level.left_out),
                number(100.0 * (level.left_out / level.measured - 1.0), 1, signed=True),
                number(_or_none(level.offset), signed=True),
                number(_or_none(100.0 * level.drift), 1, signed=True),
                level.readings,
            )
        )
    starred = any(not level.is_used for level in found.levels)
    return table(heads, rows, ()) + ('<p>* outlier: the law was not fitted to it.</p>' if starred else '')


def _or_none(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _ladder_table(found: Identification) -> str:
    heads = ('law', 'parameters', 'RMS [N]', 'mean deviation [N]', 'off [%]', 'condition', '')
    rows = [_ladder_row(score, found) for score in found.selection.scores]
    reference = found.selection.reference
    if reference is not None:
        rows.append(
            ('no law: mean of the other readings at the same pressure', number(None), number(reference.rms),
             number(reference.mean_deviation), number(100.0 * reference.error, 1), number(None), '')
        )  # fmt: skip
    return table(heads, rows, (0, 6))


def _ladder_row(score: Score, found: Identification) -> tuple[str, ...]:
    name = f'{score.rung.name} ({score.rung.words})'
    parameters = str(len(score.rung.parameters))
    if score.validation is None or score.fit is None:
        none = number(None)
        return name, parameters, none, none, none, none, score.why_not
    marks = ['recommended'] if score is found.selection.best else []
    marks += ['saved'] if score.fit is found.selection.fit else []
    validation = score.validation
    return (
        name,
        parameters,
        number(validation.rms),
        number(validation.mean_deviation),
        number(100.0 * validation.error, 1),
        number(_or_none(score.fit.condition_number), 1),
        ', '.join(marks),
    )


def _parameter_table(found: Identification) -> str:
    choice = found.selection
    rows = [
        (p.name, p.symbol, f'{choice.fit.values[p.name]:.5g}', f'{found.quality.standard_errors[p.name]:.2g}', p.unit)
        for p in choice.rung.parameters
    ]
    rows += [(name, '', f'{value:.5g}', 'not fitted', '') for name, value in choice.rung.fixed.items()]
    stiction = found.quality.stiction
    if stiction is not None:
        value, unit = (stiction.ratio, '1') if stiction.law == 'load_dependent' else (stiction.stiction, 'N')
        rows.append(
            (f'breakaway above Coulomb, {stiction.law}', '', f'{value:.5g}', f'{stiction.standard_error:.2g}', unit)
        )
    return table(('parameter of one seal', 'symbol', 'value', 'standard error', 'unit'), rows, (0, 1, 4))


def _correlation_table(found: Identification) -> str:
    names = [p.name for p in found.selection.rung.parameters]
    if len(names) < 2:
        return ''
    correlation = found.selection.fit.correlation
    rows = [
        (name, *(number(_or_none(float(x)), 3, signed=True) for x in row))
        for name, row in zip(names, correlation, strict=True)
    ]
    condition = found.selection.fit.condition_number
    return table(('correlation', *names), rows) + f'<p>Condition number of the scaled fit: {condition:.1f}.</p>'


def _data_table(found: Identification) -> str:
    sources, prepared = found.data.sources, found.data.prepared
    rows = []
    for file in sources.files:
        total, used = prepared.total.get(file.name), prepared.used.get(file.name)
        share = 'not used: see the warnings' if total is None or used is None else f'{used} of {total}'
        rows.append((file.name, share, file.sha256))
    return table(('source', 'samples used', 'SHA-256'), rows, (0, 1, 2))


def _explanations(law: str) -> str:
    return f"""<dl>
<dt>Readings</dt>
<dd>Where speed and pressure are held, each stroke is a reading: the median force of its even samples. Where they are
swept, each sample of even sliding is one. Noted readings are taken as they are.</dd>
<dt>Fit</dt>
<dd>Least squares of {escape(law)}, together with one offset of the force sum for each source. Readings count relative
to the friction at their pressure, samples of swept logs absolutely.</dd>
<dt>Out of sample</dt>
<dd>Each group (test, pressure, file, or one of ten contiguous blocks) is predicted by the law that was fitted to the
others. A law is recommended if no law above it is better by a one-sided paired t-test at 95 % and by a tenth.</dd>
<dt>Standard errors</dt>
<dd>Jackknife over the groups, so what the readings of a group have in common counts once.</dd>
<dt>Standard deviation</dt>
<dd>For a new reading of all seals: its size is such that 95 % of the readings left out are within 1.96 of it, for one
group more. Where no run was repeated, the drift of the runs is added in square.</dd>
</dl>"""
