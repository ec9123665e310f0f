"""Report of a tuning, to check before use of the parameters on a machine."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import MM, MS, UM
from seal_friction_ros.core.servo import closed_loop
from seal_friction_ros.core.servo.closed_loop import SETTLING_PERIODS, AxisRun, Performance
from seal_friction_ros.core.tuning.recorded_axis import NEAR_REVERSAL, Residual
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.figure_style import Plot, house_style
from seal_friction_ros.offline.reports.formatting import DASH, force_unit, number, relative_change, signed_percent
from seal_friction_ros.offline.reports.page import Table, write_page
from seal_friction_ros.offline.tuning.tune import BagTuning, SimulatorTuning

ZOOM = 0.22  # of the period, on each side of a reversal
SHOWN_PERIODS = 2  # of the sine
SHOWN_REVERSALS = 6  # of a bag
DOTS = 8000  # in the scatter
SHADES = (style.SKY, style.BLUE, style.BLACK)  # delay too small, right, too large
RESIDUALS = (('sliding', 'while sliding'), ('reversal', 'near reversals'))
TIME_LABEL = 'time since the first reference [s]'


@house_style()
def write_tuning_page(tuning: SimulatorTuning | BagTuning, out: Path) -> tuple[Path, ...]:
    """Write the page of a tuning; see `write_page`.

    Returns:
        Paths of the figures.

    Raises:
        ValueError: The page cannot be written.
    """
    shared = {
        'tuning': tuning,
        'found': tuning.found,
        'was': tuning.found.without,
        'now': tuning.found.nominal,
        'parameter_table': _parameter_table(tuning),
        'case_table': _case_table(tuning),
    }
    if isinstance(tuning, SimulatorTuning):
        problem = tuning.problem
        performances = [case.outcome for case in tuning.found.cases]
        return write_page(
            out,
            'simulator_tuning',
            tuning_figures(tuning),
            worst={name: max(getattr(p, name) for p in performances) for name in ('tracking_rms', 'overshoot')},
            reversals=sum(p.limit_cycle_reversals for p in performances),
            settings=problem.settings,
            whole_delay=problem.whole_delay,
            loop=closed_loop,
            **shared,
        )
    return write_page(
        out,
        'bag_tuning',
        recorded_axis_figures(tuning),
        recorded=tuning.track.numbers(),
        sliding_samples=int(np.count_nonzero(tuning.found.law.sliding)),
        offset_is_known=bool(np.isfinite(tuning.found.law.offset)),
        NEAR_REVERSAL=NEAR_REVERSAL,
        **shared,
    )


# -- tables -----------------------------------------------------------------------------------------------------------


def _parameter_table(tuning: SimulatorTuning | BagTuning) -> Table:
    before, now = tuning.task.before, tuning.found.feedforward
    rows = [
        (
            name,
            f'{getattr(before, name):g}',
            f'{getattr(now, name):g}',
            meaning.unit,
            'tuned' if name in tuning.task.tuned else '',
            meaning.description,
        )
        for name, meaning in meanings(now).items()
    ]
    return Table(('parameter', 'before', 'now', 'unit', '', 'meaning'), rows, (0, 3, 4, 5))


def _case_table(tuning: SimulatorTuning | BagTuning) -> Table:
    heads: tuple[str, ...] = ('left while sliding [N]', 'left near reversals [N]')
    if isinstance(tuning, SimulatorTuning):
        heads = (
            'tracking RMS [µm]', 'peak [µm]', 'dwell [ms]', 'overshoot [µm]', 'reversals at rest', 'largest force [N]',
            'largest rate [N/ms]',
        )  # fmt: skip

    def cells(outcome: Performance | Residual) -> tuple[Any, ...]:
        if isinstance(outcome, Residual):
            return tuple(number(value) for value in outcome)
        return (
            number(outcome.tracking_rms / UM, 1),
            number(outcome.tracking_peak / UM, 1),
            number(outcome.dwell / MS),
            number(outcome.overshoot / UM, 1),
            outcome.limit_cycle_reversals,
            number(outcome.largest_force, 1),
            number(outcome.largest_force_rate * MS, 1),
        )

    rows = [('without', DASH, *cells(tuning.found.without))]
    for friction_error, delay_error, outcome in tuning.found.cases:
        rows.append((signed_percent(friction_error), signed_percent(delay_error), *cells(outcome)))
    return Table(('friction model', 'delay', *heads), rows)


# -- figures of the simulated servo -----------------------------------------------------------------------------------


def tuning_figures(tuning: SimulatorTuning) -> list[Plot]:
    """Tracking, forces, move and robustness."""
    sine, move, _ = tuning.problem.runs(closed_loop.without_feedforward(tuning.found.feedforward))
    tuned_sine, tuned_move, _ = tuning.problem.runs(tuning.found.feedforward)
    return [
        tuned_tracking_figure(tuning, sine, tuned_sine),
        tuned_force_figure(tuning, tuned_sine),
        move_figure(tuning, move, tuned_move),
        robustness_figure(tuning),
    ]


def _shown_time(tuning: SimulatorTuning) -> tuple[float, float]:
    """Start and end of the shown periods of the sine [s]."""
    period = 1.0 / tuning.problem.settings.frequency
    return SETTLING_PERIODS * period, (SETTLING_PERIODS + SHOWN_PERIODS) * period


def _line_between(ax: Axes, span: tuple[float, float], time: FloatArray, values: FloatArray, **look: Any) -> None:
    """Line through the samples in a span of time only, so the y axis fits them."""
    inside = (time >= span[0]) & (time <= span[1])
    ax.plot(time[inside], values[inside], **look)
    ax.set_xlim(span)


def tuned_tracking_figure(tuning: SimulatorTuning, without: AxisRun, with_it: AxisRun) -> Plot:
    """Figure 25 of the thesis with and without feed-forward: two periods, one reversal, the error."""
    was, now = tuning.found.without, tuning.found.nominal
    title = (
        f'With feed-forward: error {relative_change(was.tracking_rms, now.tracking_rms)}, '
        f'dwell {relative_change(was.dwell, now.dwell)}'
    )
    figure, axes = style.new_figure(title, 7.4, nrows=3, gridspec_kw={'height_ratios': [4.0, 4.0, 2.8]})
    span, period = _shown_time(tuning), 1.0 / tuning.problem.settings.frequency
    peak = span[0] + 0.25 * period
    zoom = (peak - ZOOM * period, peak + ZOOM * period)
    axes[0].axvspan(*zoom, color=style.BLACK, alpha=0.08, lw=0)
    reference = {'color': style.GREY, 'lw': 3.0, 'alpha': 0.5, 'label': 'reference'}
    runs = ((without, style.VERMILLION, 'without feed-forward'), (with_it, style.BLUE, 'with feed-forward'))
    for ax, shown in ((axes[0], span), (axes[1], zoom)):
        _line_between(ax, shown, without.time, without.reference / MM, **reference)
        for run, colour, label in runs:
            _line_between(ax, shown, run.time, run.position / MM, color=colour, label=label)
        ax.set_ylabel('rod position [mm]')
    for run, colour, _ in runs:
        _line_between(axes[2], span, run.time, (run.position - run.reference) / UM, color=colour)
    style.zero_lines(axes[2])
    axes[2].set(ylabel='error [µm]', xlabel='time [s]')
    axes[1].set_title('Shaded part: a reversal')
    style.legend_above(axes[0])
    figure.align_ylabels(axes)
    return Plot('tracking', figure)


def tuned_force_figure(tuning: SimulatorTuning, run: AxisRun) -> Plot:
    """Friction of the seals and feed-forward, over two periods."""
    figure, ax = style.new_figure('Friction of the seals and feed-forward', 3.4)
    span = _shown_time(tuning)
    _line_between(ax, span, run.time, run.friction_force, color=style.BLACK, lw=1.2, label='friction of the seals')
    _line_between(ax, span, run.time, run.feedforward, color=style.BLUE, label='feed-forward at the controller')
    style.zero_lines(ax)
    ax.set(ylabel='force [N]', xlabel='time [s]')
    style.legend_above(ax)
    return Plot('force', figure)


def move_figure(tuning: SimulatorTuning, without: AxisRun, with_it: AxisRun) -> Plot:
    """Position and error of the move, with the right model and with a model of too much friction."""
    error = tuning.problem.settings.friction_error
    worst = tuning.problem.runs(tuning.found.feedforward, friction_error=error)[1]
    over = max(case.outcome.overshoot for case in tuning.found.cases)
    title = f'Largest overshoot of the move in all cases: {over / UM:.3g} µm'
    figure, axes = style.new_figure(title, 4.8, nrows=2, sharex=True)
    reference = {'color': style.GREY, 'lw': 2.2, 'alpha': 0.6, 'label': 'reference'}
    axes[0].plot(without.time, without.reference / MM, **reference)
    for run, colour, label in (
        (without, style.VERMILLION, 'without feed-forward'),
        (with_it, style.BLUE, 'with'),
        (worst, style.ORANGE, f'with a model {100.0 * error:.3g} % too large'),
    ):
        axes[0].plot(run.time, run.position / MM, color=colour, lw=1.0)
        axes[1].plot(run.time, (run.position - run.reference) / UM, color=colour, label=label)
    axes[0].set_ylabel('rod position [mm]')
    axes[1].set(ylabel='error [µm]', xlabel='time [s]', xlim=(0.0, without.time[-1]))
    style.zero_lines(axes[1])
    for ax in axes:
        style.legend_above(ax)
    figure.align_ylabels(axes)
    return Plot('move', figure)


def robustness_figure(tuning: SimulatorTuning | BagTuning) -> Plot:
    """Error and dwell, or the friction left to the controller, in all cases."""
    found, title = tuning.found, 'NOT better in every case'
    panels = tuple((name, 1.0, f'RMS friction left {text} [N]') for name, text in RESIDUALS)
    if isinstance(tuning, SimulatorTuning):
        panels = (('tracking_rms', UM, 'tracking RMS [µm]'), ('dwell', MS, 'dwell per reversal [ms]'))
    if found.better_in_every_case:
        simulated = isinstance(tuning, SimulatorTuning)
        title = 'Better than none with every model and delay tried' if simulated else 'Less friction left in every case'
    figure, axes = style.new_figure(title, 3.8, ncols=2)
    for ax, (name, size, label) in zip(axes, panels, strict=True):
        values = {case[:2]: getattr(case.outcome, name) / size for case in found.cases}
        _draw_cases(ax, values, getattr(found.without, name) / size, label)
    style.legend_above(axes[1])
    return Plot('robustness', figure)


def _draw_cases(ax: Axes, values: dict[tuple[float, float], float], without: float, label: str) -> None:
    """A group of bars for each friction error, a bar for each delay error, and a line without feed-forward."""
    frictions, delays = (sorted(set(errors)) for errors in zip(*values, strict=True))
    width = 0.8 / len(delays)
    for place, delay in enumerate(delays):
        heights = [values[friction, delay] for friction in frictions]
        x = np.arange(len(frictions)) + (place - 0.5 * (len(delays) - 1)) * width
        colour = SHADES[place] if len(delays) == len(SHADES) else style.BLUE
        ax.bar(x, heights, 0.92 * width, color=colour, label=f'delay {signed_percent(delay)}')
    ax.axhline(without, color=style.VERMILLION, ls='--', label='without')
    ax.set_xticks(np.arange(len(frictions)), [signed_percent(friction) for friction in frictions])
    ax.set(xlabel='error of the friction model', ylabel=label, ylim=(0.0, 1.12 * max(without, *values.values()) or 1.0))
    ax.grid(visible=False, axis='x')


# -- figures of a recorded axis ---------------------------------------------------------------------------------------


def recorded_axis_figures(tuning: BagTuning) -> list[Plot]:
    """Friction and feed-forward over time and velocity, robustness, and tracking if it was recorded."""
    plots = [recorded_friction_figure(tuning), recorded_law_figure(tuning), robustness_figure(tuning)]
    if np.isfinite(tuning.track.position).any():
        plots.append(recorded_tracking_figure(tuning))
    return plots


def recorded_friction_figure(tuning: BagTuning) -> Plot:
    """Friction of the axis, and the feed-forward along its recorded reference."""
    found = tuning.found
    change = relative_change(found.without.sliding, found.nominal.sliding)
    figure, axes = style.new_figure(
        f'Friction left to the controller while sliding: {change}', 5.6, nrows=2, sharex=True
    )
    part = _shown_reversals(found.reversal)
    time, friction, force = tuning.recording.time[part], found.law.friction[part], found.force[part]
    unit, size = force_unit(float(np.nanmax(np.abs(friction), initial=0.0)))
    label = 'friction: force sum less inertia'
    style.thin_line(axes[0], time, friction / size, color=style.BLACK, lw=1.0, label=label)
    style.thin_line(axes[0], time, force / size, color=style.BLUE, label='feed-forward')
    style.thin_line(axes[1], time, friction / size, color=style.VERMILLION, lw=1.0, label='without')
    style.thin_line(axes[1], time, (friction - force) / size, color=style.BLUE, lw=1.0, label='with feed-forward')
    for ax in axes:
        style.zero_lines(ax)
        style.legend_above(ax)
        style.shade(ax, time, found.reversal[part])
    axes[0].set_ylabel(f'force [{unit}]')
    axes[1].set(ylabel=f'left to the controller [{unit}]', xlabel=TIME_LABEL, xlim=(time[0], time[-1]))
    return Plot('match', figure)


def recorded_law_figure(tuning: BagTuning) -> Plot:
    """Friction over velocity as a share of the model, and the feed-forward with its smoothing."""
    law, settings = tuning.found.law, tuning.found.feedforward
    figure, ax = style.new_figure(f'The axis has {law.scale:.2f} times the friction of the model', 3.8)
    coulomb = tuning.recording.coulomb_friction
    known = np.flatnonzero(law.sliding & (coulomb > 0.0))
    known = known[:: len(known) // DOTS + 1]
    velocity, share = tuning.recording.velocity[known] / MM, law.friction[known] / coulomb[known]
    ax.scatter(velocity, share, s=5.0, lw=0, color=style.SKY, rasterized=True, label='sliding, measured')
    reach = 1.1 * float(np.abs(velocity).max())
    line = np.linspace(-reach, reach, 1001)
    height = settings.scale * np.tanh(line * MM / settings.smoothing_velocity)
    ax.plot(line, height, color=style.BLUE, label='feed-forward')
    most = 1.4 * max(float(np.quantile(np.abs(share), 0.99)), settings.scale, 0.1)
    ylabel = 'friction / Coulomb friction\nof the model [-]'
    ax.set(xlim=(-reach, reach), ylim=(-most, most), xlabel='rod velocity [mm/s]', ylabel=ylabel)
    style.zero_lines(ax, vertical=True)
    style.legend_above(ax)
    return Plot('law', figure)


def recorded_tracking_figure(tuning: BagTuning) -> Plot:
    """Tracking as recorded."""
    figure, axes = style.new_figure('Tracking as recorded', 4.4, nrows=2, sharex=True)
    part = _shown_reversals(tuning.found.reversal)
    time, reference, position = tuning.recording.time[part], tuning.track.reference[part], tuning.track.position[part]
    style.thin_line(axes[0], time, reference / MM, color=style.GREY, lw=2.2, alpha=0.6, label='reference')
    style.thin_line(axes[0], time, position / MM, color=style.VERMILLION, label='rod')
    style.thin_line(axes[1], time, (position - reference) / UM, color=style.VERMILLION)
    style.zero_lines(axes[1])
    for ax in axes:
        style.shade(ax, time, tuning.found.reversal[part])
    axes[0].set_ylabel('position [mm]')
    axes[1].set(ylabel='error [µm]', xlabel=TIME_LABEL, xlim=(time[0], time[-1]))
    style.legend_above(axes[0])
    return Plot('recorded', figure)


def _shown_reversals(reversal: BoolArray) -> slice:
    """The first `SHOWN_REVERSALS` reversals of the second half of the bag, or of the whole bag."""
    starts = np.flatnonzero(np.diff(reversal.astype(np.int8), prepend=0) == 1)
    later = starts[starts >= len(reversal) // 2]
    chosen = later if len(later) > SHOWN_REVERSALS else starts
    chosen = chosen[: SHOWN_REVERSALS + 1]
    width = int(np.median(np.diff(chosen))) if len(chosen) > 1 else len(reversal)
    return slice(max(int(chosen[0]) - width // 2, 0), min(int(chosen[-1]) + width // 2, len(reversal)))
