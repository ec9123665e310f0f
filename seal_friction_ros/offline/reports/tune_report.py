"""Report of a tuning, to check before the parameters go to a machine."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import MM, MS, UM
from seal_friction_ros.core.servo import closed_loop
from seal_friction_ros.core.servo.closed_loop import SETTLED_PERIODS, Performance, Run
from seal_friction_ros.core.tuning.recorded_axis import NEAR_REVERSAL
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.figure_style import Plot, house_style
from seal_friction_ros.offline.reports.formatting import DASH, force_unit, number, relative_change, signed_percent
from seal_friction_ros.offline.reports.page import Table, write_page
from seal_friction_ros.offline.tuning.tune import BagTuning, SimulatorTuning

ZOOM = 0.22  # of the period, on each side of a reversal
SHOWN_PERIODS = 2  # of the sine
SHOWN_REVERSALS = 6  # of a bag
DOTS = 8000  # of a scatter
SHADES = (style.SKY, style.BLUE, style.BLACK)  # delay too small, right, too large
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
    }
    if isinstance(tuning, SimulatorTuning):
        problem = tuning.problem
        performances = [case.performance for case in tuning.found.cases]
        return write_page(
            out,
            'simulator_tuning',
            tuning_figures(tuning),
            case_table=_case_table(tuning),
            worst={name: max(getattr(p, name) for p in performances) for name in ('tracking_rms', 'overshoot')},
            reversals=sum(p.limit_cycle_reversals for p in performances),
            settings=problem.settings,
            whole_delay=closed_loop.whole_delay(problem.axis.servo, problem.settings.delay),
            loop=closed_loop,
            **shared,
        )
    return write_page(
        out,
        'bag_tuning',
        recorded_axis_figures(tuning),
        residual_table=_residual_table(tuning),
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


def _case_table(tuning: SimulatorTuning) -> Table:
    heads = (
        'friction model', 'delay', 'tracking RMS [µm]', 'peak [µm]', 'dwell [ms]', 'overshoot [µm]',
        'reversals at rest', 'largest force [N]', 'largest rate [N/ms]',
    )  # fmt: skip

    def row(friction: str, delay: str, p: Performance) -> tuple[Any, ...]:
        lengths = [number(value / UM, 1) for value in (p.tracking_rms, p.tracking_peak)]
        rest = number(p.dwell / MS), number(p.overshoot / UM, 1), p.limit_cycle_reversals
        return friction, delay, *lengths, *rest, number(p.largest_force, 1), number(p.largest_force_rate * MS, 1)

    rows = [row('without', DASH, tuning.found.without)]
    rows += [
        row(signed_percent(c.friction_error), signed_percent(c.delay_error), c.performance) for c in tuning.found.cases
    ]
    return Table(heads, rows)


def _residual_table(tuning: BagTuning) -> Table:
    cases = [('without', DASH, tuning.found.without)]
    cases += [(signed_percent(c.friction_error), signed_percent(c.delay_error), c.residual) for c in tuning.found.cases]
    rows = [(friction, delay, number(r.sliding), number(r.reversal)) for friction, delay, r in cases]
    return Table(('friction model', 'delay', 'left while sliding [N]', 'left near reversals [N]'), rows)


# -- figures of the simulated servo -----------------------------------------------------------------------------------


def tuning_figures(tuning: SimulatorTuning) -> list[Plot]:
    """Tracking, forces, move and robustness."""
    without = tuning.problem.runs(closed_loop.without_feedforward(tuning.found.feedforward))
    with_it = tuning.problem.runs(tuning.found.feedforward)
    return [
        tuned_tracking_figure(tuning, without[0], with_it[0]),
        tuned_force_figure(tuning, with_it[0]),
        move_figure(tuning, without[1], with_it[1]),
        robustness_figure(tuning),
    ]


def _shown_time(tuning: SimulatorTuning) -> tuple[float, float]:
    """Start and end of the shown periods of the sine [s]."""
    period = 1.0 / tuning.problem.settings.frequency
    return SETTLED_PERIODS * period, (SETTLED_PERIODS + SHOWN_PERIODS) * period


def _line_between(ax: Axes, span: tuple[float, float], time: FloatArray, values: FloatArray, **look: Any) -> None:
    """Line through the samples in a span of time, so that the y axis fits them."""
    inside = (time >= span[0]) & (time <= span[1])
    ax.plot(time[inside], values[inside], **look)
    ax.set_xlim(span)


def tuned_tracking_figure(tuning: SimulatorTuning, without: Run, with_it: Run) -> Plot:
    """Figure 25 of the thesis, with and without feed-forward: two periods, a reversal, the error."""
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


def tuned_force_figure(tuning: SimulatorTuning, run: Run) -> Plot:
    """Friction of the seals and feed-forward, over two periods."""
    figure, ax = style.new_figure('Friction of the seals and feed-forward', 3.4)
    span = _shown_time(tuning)
    _line_between(ax, span, run.time, run.friction_force, color=style.BLACK, lw=1.2, label='friction of the seals')
    _line_between(ax, span, run.time, run.feedforward, color=style.BLUE, label='feed-forward at the controller')
    style.zero_lines(ax)
    ax.set(ylabel='force [N]', xlabel='time [s]')
    style.legend_above(ax)
    return Plot('force', figure)


def move_figure(tuning: SimulatorTuning, without: Run, with_it: Run) -> Plot:
    """Error of the move, with the right model and with one that gives too much friction."""
    error = tuning.problem.settings.friction_error
    worst = tuning.problem.runs(tuning.found.feedforward, friction_error=error)[1]
    over = max(case.performance.overshoot for case in tuning.found.cases)
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


def robustness_figure(tuning: SimulatorTuning) -> Plot:
    """Error and dwell in all cases."""
    was, cases = tuning.found.without, tuning.found.cases
    better = tuning.found.better_in_every_case
    title = 'Better than none with every model and delay tried' if better else 'NOT better in every case'
    figure, axes = style.new_figure(title, 3.8, ncols=2)
    rows = [(c.friction_error, c.delay_error, c.performance.tracking_rms / UM) for c in cases]
    _draw_cases(axes[0], rows, was.tracking_rms / UM, 'tracking RMS [µm]')
    rows = [(c.friction_error, c.delay_error, c.performance.dwell / MS) for c in cases]
    _draw_cases(axes[1], rows, was.dwell / MS, 'dwell per reversal [ms]')
    style.legend_above(axes[1])
    return Plot('robustness', figure)


def _draw_cases(ax: Axes, rows: Sequence[tuple[float, float, float]], without: float, label: str) -> None:
    """Bars in a group for each friction error, one bar for each delay error, and the line without feed-forward."""
    frictions = sorted({friction for friction, _, _ in rows})
    delays = sorted({delay for _, delay, _ in rows})
    width = 0.8 / len(delays)
    for place, delay in enumerate(delays):
        heights = [value for _, other, value in rows if other == delay]
        x = np.arange(len(frictions)) + (place - 0.5 * (len(delays) - 1)) * width
        colour = SHADES[place] if len(delays) == len(SHADES) else style.BLUE
        ax.bar(x, heights, 0.92 * width, color=colour, label=f'delay {signed_percent(delay)}')
    ax.axhline(without, color=style.VERMILLION, ls='--', label='without')
    ax.set_xticks(np.arange(len(frictions)), [signed_percent(friction) for friction in frictions])
    highest = max([without, *(value for _, _, value in rows)])
    ax.set(xlabel='error of the friction model', ylabel=label, ylim=(0.0, 1.12 * highest or 1.0))
    ax.grid(visible=False, axis='x')


# -- figures of a recorded axis ---------------------------------------------------------------------------------------


def recorded_axis_figures(tuning: BagTuning) -> list[Plot]:
    """Friction and feed-forward over time and velocity, robustness, and tracking if it was recorded."""
    plots = [recorded_friction_figure(tuning), recorded_law_figure(tuning), remaining_friction_figure(tuning)]
    if np.isfinite(tuning.track.position).any():
        plots.append(recorded_tracking_figure(tuning))
    return plots


def recorded_friction_figure(tuning: BagTuning) -> Plot:
    """Friction of the axis and the feed-forward that would have compensated it."""
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
    height = settings.coulomb_scale * np.tanh(line * MM / settings.smoothing_velocity)
    ax.plot(line, height, color=style.BLUE, label='feed-forward')
    most = 1.4 * max(float(np.quantile(np.abs(share), 0.99)), settings.coulomb_scale, 0.1)
    ylabel = 'friction / Coulomb friction\nof the model [-]'
    ax.set(xlim=(-reach, reach), ylim=(-most, most), xlabel='rod velocity [mm/s]', ylabel=ylabel)
    style.zero_lines(ax, vertical=True)
    style.legend_above(ax)
    return Plot('law', figure)


def remaining_friction_figure(tuning: BagTuning) -> Plot:
    """Friction left to the controller in all cases."""
    found = tuning.found
    title = 'Less friction left in every case' if found.better_in_every_case else 'NOT better in every case'
    figure, axes = style.new_figure(title, 3.8, ncols=2)
    for ax, name, label in ((axes[0], 'sliding', 'while sliding'), (axes[1], 'reversal', 'near reversals')):
        rows = [(c.friction_error, c.delay_error, getattr(c.residual, name)) for c in found.cases]
        _draw_cases(ax, rows, getattr(found.without, name), f'RMS friction left {label} [N]')
    style.legend_above(axes[1])
    return Plot('robustness', figure)


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
