"""Report of a tuning, to check before use of the parameters on a machine."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import MM, MS, UM
from seal_friction_ros.core.servo import closed_loop
from seal_friction_ros.core.servo.closed_loop import SETTLING_PERIODS, AxisRun
from seal_friction_ros.core.tuning.recorded_axis import NEAR_REVERSAL
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports import verdicts
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.formatting import DASH, force_unit, number, relative_change, signed_percent
from seal_friction_ros.offline.reports.page import Table, head_of, write_page
from seal_friction_ros.offline.tuning.tune import BagTuning, SimulatorTuning

ZOOM = 0.22  # of the period, on each side of a reversal
SHOWN_PERIODS = 2  # of the sine
SHOWN_REVERSALS = 6  # of a bag
DOTS = 8000  # in the scatter
SHADES = (style.SKY, style.BLUE, style.BLACK)  # delay too small, right, too large
TIME_LABEL = 'time since the first reference [s]'
_REFERENCE: dict[str, Any] = {'color': style.GREY, 'lw': 2.2, 'alpha': 0.6, 'label': 'reference'}


@house_style()
def write_tuning_page(tuning: SimulatorTuning | BagTuning, out: Path) -> tuple[Path, ...]:
    """Write the page of a tuning; result and errors as of `write_page`."""
    found = tuning.found
    law = None if isinstance(tuning, SimulatorTuning) else tuning.found.law
    verdict = verdicts.of_tuning(
        tuning.result,
        is_better=found.better_in_every_case and bool(found.feedforward.scale),
        has_placeholder=tuning.task.has_placeholder,
        mass=None if law is None else law.mass,
        fitted=law is not None and law.mass_is_fitted,
    )
    source = 'simulated servo, no measured data' if law is None else tuning.task.source
    shared: dict[str, Any] = {
        'verdict': verdict,
        'warnings': tuning.remarks if tuning.result in verdict.text else (tuning.result, *tuning.remarks),
        'head': head_of('tune', source, tuning.task.seals),
        'tuning': tuning,
        'found': found,
        'parameter_table': _parameter_table(tuning),
        'case_table': _case_table(tuning),
    }
    if isinstance(tuning, SimulatorTuning):
        outcomes = [case.outcome for case in tuning.found.cases]
        shared |= {
            'worst': {name: max(getattr(o, name) for o in outcomes) for name in ('tracking_rms', 'overshoot')},
            'reversals': sum(o.limit_cycle_reversals for o in outcomes),
            'loop': closed_loop,
        }
        return write_page(out, 'simulator_tuning', tuning_figures(tuning), **shared)
    shared |= {
        'recorded': tuning.track.numbers(),
        'sliding_samples': int(np.count_nonzero(tuning.found.law.sliding)),
        'offset_is_known': bool(np.isfinite(tuning.found.law.offset)),
        'NEAR_REVERSAL': NEAR_REVERSAL,
    }
    return write_page(out, 'bag_tuning', recorded_axis_figures(tuning), **shared)


# -- tables -----------------------------------------------------------------------------------------------------------


def _parameter_table(tuning: SimulatorTuning | BagTuning) -> Table:
    before, now, tuned = tuning.task.before, tuning.found.feedforward, tuning.task.tuned
    rows = []
    for name, meaning in meanings(now).items():
        values = (f'{getattr(settings, name):g}' for settings in (before, now))
        rows.append((name, *values, meaning.unit, 'tuned' if name in tuned else '', meaning.description))
    return Table(('parameter', 'before', 'now', 'unit', '', 'meaning'), rows, (0, 3, 4, 5))


# head of a column -> its value in the result of a case, unit, decimals
_PERFORMANCE_COLUMNS = {
    'tracking RMS [µm]': ('tracking_rms', UM, 1),
    'peak [µm]': ('tracking_peak', UM, 1),
    'dwell [ms]': ('dwell', MS, 2),
    'overshoot [µm]': ('overshoot', UM, 1),
    'reversals at rest': ('limit_cycle_reversals', 1, 0),
    'largest force [N]': ('largest_force', 1.0, 1),
    'largest rate [N/ms]': ('largest_force_rate', 1.0 / MS, 1),
}
_RESIDUAL_COLUMNS = {'left while sliding [N]': ('sliding', 1.0, 2), 'left near reversals [N]': ('reversal', 1.0, 2)}


def _case_table(tuning: SimulatorTuning | BagTuning) -> Table:
    columns = _PERFORMANCE_COLUMNS if isinstance(tuning, SimulatorTuning) else _RESIDUAL_COLUMNS
    rows = [('without', DASH, tuning.found.without)]
    rows += [(signed_percent(case[0]), signed_percent(case[1]), case.outcome) for case in tuning.found.cases]
    cells = [
        (*errors, *(number(getattr(outcome, name) / size, digits) for name, size, digits in columns.values()))
        for *errors, outcome in rows
    ]
    return Table(('friction model', 'delay', *columns), cells)


# -- figures of the simulated servo -----------------------------------------------------------------------------------


def tuning_figures(tuning: SimulatorTuning) -> list[Plot]:
    """Tracking, forces, move and robustness."""
    sine, move, _ = tuning.problem.runs(closed_loop.without_feedforward(tuning.found.feedforward))
    tuned_sine, tuned_move, _ = tuning.problem.runs(tuning.found.feedforward)
    plots = [tuned_tracking_figure(tuning, sine, tuned_sine), tuned_force_figure(tuning, tuned_sine)]
    return [*plots, move_figure(tuning, move, tuned_move), robustness_figure(tuning)]


def _shown_time(tuning: SimulatorTuning) -> tuple[float, float]:
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
    error, dwell = relative_change(was.tracking_rms, now.tracking_rms), relative_change(was.dwell, now.dwell)
    title, heights = f'With feed-forward: error {error}, dwell {dwell}', {'height_ratios': [4.0, 4.0, 2.8]}
    figure, axes = style.new_figure(title, 7.4, nrows=3, gridspec_kw=heights)
    span, period = _shown_time(tuning), 1.0 / tuning.problem.settings.frequency
    peak = span[0] + 0.25 * period
    zoom = (peak - ZOOM * period, peak + ZOOM * period)
    axes[0].axvspan(*zoom, color=style.BLACK, alpha=0.08, lw=0)
    runs = ((without, style.VERMILLION, 'without feed-forward'), (with_it, style.BLUE, 'with feed-forward'))
    for ax, shown in ((axes[0], span), (axes[1], zoom)):
        _line_between(ax, shown, without.time, without.reference / MM, **{**_REFERENCE, 'lw': 3.0, 'alpha': 0.5})
        for run, colour, label in runs:
            _line_between(ax, shown, run.time, run.position / MM, color=colour, label=label)
        ax.set_ylabel('rod position [mm]')
    for run, colour, _ in runs:
        _line_between(axes[2], span, run.time, (run.position - run.reference) / UM, color=colour)
    style.zero_lines(axes[2])
    axes[2].set(ylabel='error [µm]', xlabel='time [s]')
    figure.align_ylabels(axes)
    axes[1].set_title('Shaded part: a reversal')
    return finished('tracking', figure, axes[0])


def tuned_force_figure(tuning: SimulatorTuning, run: AxisRun) -> Plot:
    """Friction of the seals and feed-forward, over two periods."""
    figure, ax = style.new_figure('Friction of the seals and feed-forward', 3.4)
    span = _shown_time(tuning)
    _line_between(ax, span, run.time, run.friction_force, color=style.BLACK, lw=1.2, label='friction of the seals')
    _line_between(ax, span, run.time, run.feedforward, color=style.BLUE, label='feed-forward at the controller')
    style.zero_lines(ax)
    return finished('force', figure, ax, ylabel='force [N]', xlabel='time [s]')


def move_figure(tuning: SimulatorTuning, without: AxisRun, with_it: AxisRun) -> Plot:
    """Position and error of the move, with the right model and with a model of too much friction."""
    error = tuning.problem.settings.friction_error
    worst = tuning.problem.runs(tuning.found.feedforward, friction_error=error)[1]
    over = max(case.outcome.overshoot for case in tuning.found.cases)
    title = f'Largest overshoot of the move in all cases: {over / UM:.3g} µm'
    figure, axes = style.new_figure(title, 4.8, nrows=2, sharex=True)
    axes[0].plot(without.time, without.reference / MM, **_REFERENCE)
    for run, colour, label in (
        (without, style.VERMILLION, 'without feed-forward'),
        (with_it, style.BLUE, 'with'),
        (worst, style.ORANGE, f'with a model {100.0 * error:.3g} % too large'),
    ):
        axes[0].plot(run.time, run.position / MM, color=colour, lw=1.0)
        axes[1].plot(run.time, (run.position - run.reference) / UM, color=colour, label=label)
    axes[1].set(ylabel='error [µm]', xlabel='time [s]', xlim=(0.0, without.time[-1]))
    style.zero_lines(axes[1])
    figure.align_ylabels(axes)
    return finished('move', figure, *axes, ylabel='rod position [mm]')


def robustness_figure(tuning: SimulatorTuning | BagTuning) -> Plot:
    """Error and dwell, or the friction left to the controller, in all cases."""
    found = tuning.found
    if isinstance(tuning, SimulatorTuning):
        better = 'Better than none with every model and delay tried'
        panels = (('tracking_rms', UM, 'tracking RMS [µm]'), ('dwell', MS, 'dwell per reversal [ms]'))
    else:
        better, label = 'Less friction left in every case', 'RMS friction left'
        panels = (('sliding', 1.0, f'{label} while sliding [N]'), ('reversal', 1.0, f'{label} near reversals [N]'))
    figure, axes = style.new_figure(better if found.better_in_every_case else 'NOT better in every case', 3.8, ncols=2)
    for ax, (name, size, label) in zip(axes, panels, strict=True):
        values = {case[:2]: getattr(case.outcome, name) / size for case in found.cases}
        _draw_cases(ax, values, getattr(found.without, name) / size, label)
    return finished('robustness', figure, axes[1])


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


def _prepare_time_axes(tuning: BagTuning, axes: Sequence[Axes]) -> tuple[slice, FloatArray]:
    """Shade the reversals on two time axes; returns the shown samples and their times [s]."""
    part = _shown_reversals(tuning.found.reversal)
    time = tuning.recording.time[part]
    for ax in axes:
        style.shade(ax, time, tuning.found.reversal[part])
    axes[1].set(xlabel=TIME_LABEL, xlim=(time[0], time[-1]))
    return part, time


def recorded_friction_figure(tuning: BagTuning) -> Plot:
    """Friction of the axis, and the feed-forward along its recorded reference."""
    found = tuning.found
    change = relative_change(found.without.sliding, found.nominal.sliding)
    title = f'Friction left to the controller while sliding: {change}'
    figure, axes = style.new_figure(title, 5.6, nrows=2, sharex=True)
    part, time = _prepare_time_axes(tuning, axes)
    friction, force = found.law.friction[part], found.force[part]
    unit, size = force_unit(float(np.nanmax(np.abs(friction), initial=0.0)))
    label = 'friction: force sum less inertia'
    style.thin_line(axes[0], time, friction / size, color=style.BLACK, lw=1.0, label=label)
    style.thin_line(axes[0], time, force / size, color=style.BLUE, label='feed-forward')
    style.thin_line(axes[1], time, friction / size, color=style.VERMILLION, lw=1.0, label='without')
    style.thin_line(axes[1], time, (friction - force) / size, color=style.BLUE, lw=1.0, label='with feed-forward')
    for ax in axes:
        style.zero_lines(ax)
    axes[1].set_ylabel(f'left to the controller [{unit}]')
    return finished('match', figure, *axes, ylabel=f'force [{unit}]')


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
    style.zero_lines(ax, vertical=True)
    limits = {'xlim': (-reach, reach), 'ylim': (-most, most)}
    return finished('law', figure, ax, xlabel='rod velocity [mm/s]', ylabel=ylabel, **limits)


def recorded_tracking_figure(tuning: BagTuning) -> Plot:
    """Tracking as recorded."""
    figure, axes = style.new_figure('Tracking as recorded', 4.4, nrows=2, sharex=True)
    part, time = _prepare_time_axes(tuning, axes)
    reference, position = tuning.track.reference[part], tuning.track.position[part]
    style.thin_line(axes[0], time, reference / MM, **_REFERENCE)
    style.thin_line(axes[0], time, position / MM, color=style.VERMILLION, label='rod')
    style.thin_line(axes[1], time, (position - reference) / UM, color=style.VERMILLION)
    style.zero_lines(axes[1])
    axes[1].set_ylabel('error [µm]')
    return finished('recorded', figure, axes[0], ylabel='position [mm]')


def _shown_reversals(reversal: BoolArray) -> slice:
    """The first `SHOWN_REVERSALS` reversals of the second half of the bag, or of the whole bag."""
    starts = np.flatnonzero(np.diff(reversal.astype(np.int8), prepend=0) == 1)
    later = starts[starts >= len(reversal) // 2]
    chosen = later if len(later) > SHOWN_REVERSALS else starts
    chosen = chosen[: SHOWN_REVERSALS + 1]
    width = int(np.median(np.diff(chosen))) if len(chosen) > 1 else len(reversal)
    return slice(max(int(chosen[0]) - width // 2, 0), min(int(chosen[-1]) + width // 2, len(reversal)))
