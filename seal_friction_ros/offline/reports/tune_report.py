"""The report of a tuning: what a person looks at before the parameters go to a machine."""

import math
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import MM, MS, UM
from seal_friction_ros.core.servo.closed_loop import (
    JUDGED_PERIODS,
    SETTLED_PERIODS,
    Performance,
    Run,
    whole_delay,
    without_feedforward,
)
from seal_friction_ros.core.servo.tracking import tracking_peak, tracking_rms
from seal_friction_ros.core.tuning.recorded_axis import NEAR_REVERSAL, Match, Recording
from seal_friction_ros.core.tuning.simulated_axis import Problem, Tuning
from seal_friction_ros.offline.reports.bag_report import number, table, tiles
from seal_friction_ros.offline.reports.figures import (
    BLACK,
    BLUE,
    GREY,
    LIGHT_GREY,
    ORANGE,
    SKY,
    VERMILLION,
    Plot,
    force_unit,
    legend_above,
    new_figure,
    thinned,
)

ZOOM = 0.22  # of the period, on each side of a reversal
SHOWN_REVERSALS = 6  # of a bag
DOTS = 8000  # of a scatter
SHADES = (SKY, BLUE, BLACK)  # delay too small, right, too large


class Task(NamedTuple):
    """What was tuned on."""

    source: str
    motion: str
    seals: str
    before: FeedForwardSettings
    """the settings until then"""
    tuned: tuple[str, ...]
    """names of the parameters that were found; the others stayed as they were"""


class Track(NamedTuple):
    """Where the rod of a recorded axis should have been and was, shape (n,); NaN where it is not known."""

    reference: FloatArray
    """[m]"""
    position: FloatArray
    """[m]"""

    def figures(self) -> dict[str, float | None]:
        """Tracking as it was recorded, whatever compensated then; None without positions."""
        known = np.isfinite(self.reference) & np.isfinite(self.position)
        if not known.any():
            return {'recorded_tracking_rms': None, 'recorded_tracking_peak': None}
        reference, position = self.reference[known], self.position[known]
        return {
            'recorded_tracking_rms': tracking_rms(reference, position),
            'recorded_tracking_peak': tracking_peak(reference, position),
        }


# -- figures of the simulated servo -----------------------------------------------------------------------------------


def tuning_figures(problem: Problem, found: Tuning) -> list[Plot]:
    """Tracking, forces, move and robustness."""
    without = problem.runs(without_feedforward(found.feedforward))
    with_it = problem.runs(found.feedforward)
    return [
        tracking_figure(problem, found, without[0], with_it[0]),
        force_figure(problem, with_it[0]),
        move_figure(problem, found, without[1], with_it[1]),
        robustness_figure(problem, found),
    ]


def tracking_figure(problem: Problem, found: Tuning, without: Run, with_it: Run) -> Plot:
    """Figure 25 of the thesis, with and without feed-forward: two periods, a reversal, the error."""
    was, now = found.without, found.nominal
    title = f'Error {_cut(was.tracking_rms, now.tracking_rms)}, dwell {_cut(was.dwell, now.dwell)} with feed-forward'
    figure, axes = new_figure(title, 7.4, nrows=3, gridspec_kw={'height_ratios': [4.0, 4.0, 2.8]})
    period = 1.0 / problem.settings.frequency
    first, last = SETTLED_PERIODS * period, (SETTLED_PERIODS + 2) * period
    middle = first + 0.25 * period
    for ax, start, end in (
        (axes[0], first, last),
        (axes[1], middle - ZOOM * period, middle + ZOOM * period),
        (axes[2], first, last),
    ):
        ax.set_xlim(start, end)
    axes[0].axvspan(middle - ZOOM * period, middle + ZOOM * period, color=BLACK, alpha=0.08, lw=0)
    for ax in axes[:2]:
        _part(ax, without.time, without.reference / MM, color=GREY, lw=3.0, alpha=0.5, label='reference')
        _part(ax, without.time, without.position / MM, color=VERMILLION, label='without feed-forward')
        _part(ax, with_it.time, with_it.position / MM, color=BLUE, label='with feed-forward')
        ax.set_ylabel('rod position [mm]')
    for run, colour in ((without, VERMILLION), (with_it, BLUE)):
        _part(axes[2], run.time, (run.position - run.reference) / UM, color=colour)
    axes[2].axhline(0.0, color=GREY, lw=0.6)
    axes[2].set_ylabel('error [µm]')
    axes[2].set_xlabel('time [s]')
    axes[1].set_title('Shaded part: a reversal')
    legend_above(axes[0])
    figure.align_ylabels(axes)
    return Plot(
        'tracking',
        figure,
        'Rod position over time, with and without feed-forward, model and delay as they are known. Seal friction '
        'flattens the peaks (thesis, Figure 25): the rod stops before each reversal until the controller has built up '
        'the force to break away the other way.',
    )


def force_figure(problem: Problem, run: Run) -> Plot:
    """What the seals do and what the feed-forward does, over two periods."""
    figure, ax = new_figure('The feed-forward carries most of the friction', 3.4)
    period = 1.0 / problem.settings.frequency
    _part(ax, run.time, run.friction_force, color=BLACK, lw=1.2, label='friction of the seals')
    _part(ax, run.time, run.feedforward, color=BLUE, label='feed-forward at the controller')
    ax.axhline(0.0, color=GREY, lw=0.6)
    ax.set_xlim(SETTLED_PERIODS * period, (SETTLED_PERIODS + 2) * period)
    ax.set_ylabel('force [N]')
    ax.set_xlabel('time [s]')
    legend_above(ax)
    return Plot(
        'force',
        figure,
        'Friction that the seals really have and the force that is added to the command of the controller. What lies '
        'between the lines is left to the controller.',
    )


def move_figure(problem: Problem, found: Tuning, without: Run, with_it: Run) -> Plot:
    """Error of the move, with the model right and too large."""
    worst = problem.runs(found.feedforward, friction_error=problem.settings.friction_error)[1]
    over = max(case.performance.overshoot for case in found.cases)
    title = f'Largest overshoot of the move: {over / UM:.3g} µm, with a model that is wrong'
    figure, axes = new_figure(title, 4.8, nrows=2, sharex=True)
    percent = f'{100.0 * problem.settings.friction_error:.3g} %'
    axes[0].plot(without.time, without.reference / MM, color=GREY, lw=2.2, alpha=0.6, label='reference')
    for run, colour, name in (
        (without, VERMILLION, 'without feed-forward'),
        (with_it, BLUE, 'with'),
        (worst, ORANGE, f'with a model {percent} too large'),
    ):
        axes[0].plot(run.time, run.position / MM, color=colour, lw=1.0)
        axes[1].plot(run.time, (run.position - run.reference) / UM, color=colour, label=name)
    axes[0].set_ylabel('rod position [mm]')
    axes[1].set_ylabel('error [µm]')
    axes[1].set_xlabel('time [s]')
    axes[1].axhline(0.0, color=GREY, lw=0.6)
    axes[1].set_xlim(0.0, without.time[-1])
    legend_above(axes[0])
    legend_above(axes[1])
    figure.align_ylabels(axes)
    return Plot(
        'move',
        figure,
        'Out and back between the ends of the sine, with rests. A feed-forward larger than the friction pushes the rod '
        'ahead of its reference and past the end. At rest no motion is asked for, and the feed-forward is 0 N.',
    )


def robustness_figure(problem: Problem, found: Tuning) -> Plot:
    """Error and dwell of all cases."""
    was = found.without
    title = (
        'Better than none with every model and delay tried'
        if found.better_in_every_case
        else 'NOT better in every case'
    )
    figure, axes = new_figure(title, 3.8, ncols=2)
    rows = [(c.friction_error, c.delay_error, c.performance) for c in found.cases]
    _bars(axes[0], [(f, d, p.tracking_rms / UM) for f, d, p in rows], was.tracking_rms / UM)
    axes[0].set_ylabel('tracking RMS [µm]')
    _bars(axes[1], [(f, d, p.dwell / MS) for f, d, p in rows], was.dwell / MS)
    axes[1].set_ylabel('dwell per reversal [ms]')
    legend_above(axes[1])
    del problem
    return Plot(
        'robustness',
        figure,
        'The same plant with a model that gives too little or too much friction and a delay that is shorter or longer '
        'than was tuned for. The dashed line is the plant without feed-forward.',
    )


def _bars(ax: Axes, rows: Sequence[tuple[float, float, float]], without: float) -> None:
    """Bars by friction error, one for each delay error in each group, and the line to be below of."""
    frictions = sorted({friction for friction, _, _ in rows})
    delays = sorted({delay for _, delay, _ in rows})
    width = 0.8 / len(delays)
    for place, delay in enumerate(delays):
        heights = [value for _, other, value in rows if other == delay]
        x = np.arange(len(frictions)) + (place - 0.5 * (len(delays) - 1)) * width
        colour = SHADES[place] if len(delays) == len(SHADES) else BLUE
        ax.bar(x, heights, 0.92 * width, color=colour, label=f'delay {_signed(delay)}')
    ax.axhline(without, color=VERMILLION, ls='--', label='without')
    ax.set_xticks(np.arange(len(frictions)), [_signed(friction) for friction in frictions])
    ax.set_xlabel('error of the friction model')
    ax.set_ylim(0.0, 1.12 * max([without, *(value for _, _, value in rows)]) or 1.0)
    ax.grid(visible=False, axis='x')


def _signed(share: float) -> str:
    percent = round(100.0 * share, 1)
    return f'{percent:+g} %'.replace('-', '\N{MINUS SIGN}') if percent else '0 %'


def _cut(was: float, now: float) -> str:
    change = 100.0 * (now / was - 1.0) if was > 0.0 else 0.0
    return f'{change:+.0f} %'.replace('-', '\N{MINUS SIGN}')


def _part(ax: Axes, time: FloatArray, values: FloatArray, **look: Any) -> None:
    """Line through the samples that the axes show, limits set before, y limits from them."""
    low, high = ax.get_xlim()
    inside = (time >= low) & (time <= high)
    ax.plot(time[inside], values[inside], **look)


# -- figures of a bag -------------------------------------------------------------------------------------------------


def match_figures(recording: Recording, track: Track, found: Match) -> list[Plot]:
    """Friction and feed-forward over time and velocity, robustness, and tracking if it was recorded."""
    plots = [
        match_figure(recording, found),
        law_figure(recording, found),
        residual_figure(found),
    ]
    if np.isfinite(track.position).any():
        plots.append(recorded_figure(recording, track, found))
    return plots


def match_figure(recording: Recording, found: Match) -> Plot:
    """Friction that the axis showed and the force that would have compensated it."""
    was, now = found.without.sliding, found.nominal.sliding
    figure, axes = new_figure(
        f'Friction left to the controller while sliding: {_cut(was, now)}', 5.6, nrows=2, sharex=True
    )
    time, part = recording.time, _shown(found.reversal)
    unit, size = force_unit(float(np.nanmax(np.abs(found.law.friction[part]), initial=0.0)))
    name = 'friction: force sum less inertia'
    _thin(axes[0], time[part], found.law.friction[part] / size, color=BLACK, lw=1.0, label=name)
    _thin(axes[0], time[part], found.force[part] / size, color=BLUE, label='feed-forward')
    left = found.law.friction - found.force
    _thin(axes[1], time[part], found.law.friction[part] / size, color=VERMILLION, lw=1.0, label='without')
    _thin(axes[1], time[part], left[part] / size, color=BLUE, lw=1.0, label='with feed-forward')
    for ax in axes:
        ax.axhline(0.0, color=GREY, lw=0.6)
        legend_above(ax)
        _shade(ax, time[part], found.reversal[part])
    axes[0].set_ylabel(f'force [{unit}]')
    axes[1].set_ylabel(f'left to the controller [{unit}]')
    axes[1].set_xlabel('time since the first reference [s]')
    axes[1].set_xlim(time[part][0], time[part][-1])
    return Plot(
        'match',
        figure,
        'Part of the bag. Friction is the force sum less inertia and offset; the feed-forward is what would have been '
        'commanded from the recorded reference, after its delay. Shaded: near a reversal of the reference. A rod that '
        'was not compensated rests there until the controller has built up its force, so the two cannot meet.',
    )


def law_figure(recording: Recording, found: Match) -> Plot:
    """Friction over velocity as a share of what the model says, and the law with its smoothing."""
    law = found.law
    title = f'The axis shows {law.scale:.2f} times the friction of the model'
    figure, ax = new_figure(title, 3.8)
    coulomb = recording.coulomb_friction
    known = np.flatnonzero(law.sliding & (coulomb > 0.0))
    known = known[:: len(known) // DOTS + 1]
    velocity = recording.velocity[known] / MM
    share = law.friction[known] / coulomb[known]
    ax.scatter(velocity, share, s=5.0, lw=0, color=SKY, rasterized=True, label='sliding, measured')
    reach = 1.1 * float(np.abs(velocity).max())
    line = np.linspace(-reach, reach, 1001)
    settings = found.feedforward
    height = settings.coulomb_scale * np.tanh(line * MM / settings.smoothing_velocity)
    ax.plot(line, height, color=BLUE, label='feed-forward')
    most = 1.4 * max(float(np.quantile(np.abs(share), 0.99)), settings.coulomb_scale, 0.1)
    ax.set_ylim(-most, most)
    ax.set_xlim(-reach, reach)
    ax.set_xlabel('rod velocity [mm/s]')
    ax.set_ylabel('friction / Coulomb friction\nof the model [-]')
    ax.axhline(0.0, color=GREY, lw=0.6, zorder=0)
    ax.axvline(0.0, color=GREY, lw=0.6, zorder=0)
    legend_above(ax)
    return Plot(
        'law',
        figure,
        'Each dot is a sample in which the rod slides. Dots that lean show friction that grows with speed; branches '
        'that lie apart are inertia or offset that were not taken off rightly.',
    )


def residual_figure(found: Match) -> Plot:
    """What is left in all cases."""
    title = 'Less left than without, in every case' if found.better_in_every_case else 'NOT better in every case'
    figure, axes = new_figure(title, 3.8, ncols=2)
    for ax, name, label in ((axes[0], 'sliding', 'while sliding'), (axes[1], 'reversal', 'near reversals')):
        rows = [(c.friction_error, c.delay_error, getattr(c.residual, name)) for c in found.cases]
        _bars(ax, rows, getattr(found.without, name))
        ax.set_ylabel(f'RMS friction left {label} [N]')
    legend_above(axes[1])
    return Plot(
        'robustness',
        figure,
        'Friction that the feed-forward would have left to the controller, with a model of the friction and a delay '
        'that are wrong. The dashed line is all of the friction.',
    )


def recorded_figure(recording: Recording, track: Track, found: Match) -> Plot:
    """Tracking as it was recorded."""
    figure, axes = new_figure('Tracking as it was recorded', 4.4, nrows=2, sharex=True)
    time, part = recording.time, _shown(found.reversal)
    _thin(axes[0], time[part], track.reference[part] / MM, color=GREY, lw=2.2, alpha=0.6, label='reference')
    _thin(axes[0], time[part], track.position[part] / MM, color=VERMILLION, label='rod')
    error = (track.position - track.reference) / UM
    _thin(axes[1], time[part], error[part], color=VERMILLION)
    axes[1].axhline(0.0, color=GREY, lw=0.6)
    for ax in axes:
        _shade(ax, time[part], found.reversal[part])
    axes[0].set_ylabel('position [mm]')
    axes[1].set_ylabel('error [µm]')
    axes[1].set_xlabel('time since the first reference [s]')
    axes[1].set_xlim(time[part][0], time[part][-1])
    legend_above(axes[0])
    return Plot(
        'recorded',
        figure,
        'Reference and rod in the same part of the bag, whatever compensated then. Flat peaks are the rod at rest '
        'before it breaks away. Shaded: near a reversal of the reference.',
    )


def _shown(reversal: BoolArray) -> slice:
    """The first `SHOWN_REVERSALS` reversals of the second half of the bag, or of all of it."""
    starts = np.flatnonzero(np.diff(reversal.astype(np.int8), prepend=0) == 1)
    later = starts[starts >= len(reversal) // 2]
    chosen = later if len(later) > SHOWN_REVERSALS else starts
    chosen = chosen[: SHOWN_REVERSALS + 1]
    width = int(np.median(np.diff(chosen))) if len(chosen) > 1 else len(reversal)
    return slice(max(int(chosen[0]) - width // 2, 0), min(int(chosen[-1]) + width // 2, len(reversal)))


def _shade(ax: Axes, time: FloatArray, chosen: BoolArray) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], chosen, [False])).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        ax.axvspan(time[first], time[last - 1], color=LIGHT_GREY, alpha=0.5, lw=0, zorder=0)


def _thin(ax: Axes, time: FloatArray, values: FloatArray, **look: Any) -> None:
    kept = thinned(values)
    ax.plot(time[kept], values[kept], **look)


# -- the pages --------------------------------------------------------------------------------------------------------


def tuning_sections(
    task: Task, problem: Problem, found: Tuning, verdict: str, figure: Callable[[str], str]
) -> Iterable[str]:
    """The page of a tuning on the simulated servo."""
    was, now = found.without, found.nominal
    yield '<h1>Feed-forward, tuned on the simulated servo</h1>'
    yield f'<p class="lead">{escape(verdict)}</p>'
    yield tiles(
        [
            (f'{was.tracking_rms / UM:.3g} to {now.tracking_rms / UM:.3g} µm', 'tracking RMS'),
            (f'{was.dwell / MS:.3g} to {now.dwell / MS:.3g} ms', 'dwell per reversal'),
            (f'{_worst(found, "tracking_rms") / UM:.3g} µm', 'worst tracking RMS of all cases'),
            (f'{_worst(found, "overshoot") / UM:.3g} µm', 'worst overshoot of all cases'),
            (f'{sum(case.performance.limit_cycle_reversals for case in found.cases)}', 'reversals at rest, all cases'),
        ]
    )
    yield f'<p>{escape(task.motion)}; seals: {escape(task.seals)}.</p>'
    if not found.better_in_every_case:
        yield f'<p class="note">{escape(verdict)}</p>'
    yield '<h2>Tracking</h2>'
    yield figure('tracking')
    yield figure('force')
    yield '<h2>Overshoot and rest</h2>'
    yield figure('move')
    yield '<h2>Robustness</h2>'
    yield figure('robustness')
    yield _case_table(found)
    yield '<h2>Parameters</h2>'
    yield parameter_table(task, found.feedforward)
    yield '<h2>How the numbers are made</h2>'
    yield _tuning_explanations(problem, found)


def _worst(found: Tuning, name: str) -> float:
    return max(float(getattr(case.performance, name)) for case in found.cases)


def _case_table(found: Tuning) -> str:
    heads = (
        'friction model',
        'delay',
        'tracking RMS [µm]',
        'peak [µm]',
        'dwell [ms]',
        'overshoot [µm]',
        'reversals at rest',
        'largest force [N]',
        'largest rate [N/ms]',
    )

    def row(friction: str, delay: str, p: Performance) -> tuple[Any, ...]:
        lengths = [number(value / UM, 1) for value in (p.tracking_rms, p.tracking_peak)]
        rest = number(p.dwell / MS, 2), number(p.overshoot / UM, 1), p.limit_cycle_reversals
        return friction, delay, *lengths, *rest, number(p.largest_force, 1), number(p.largest_force_rate * MS, 1)

    rows = [row('without', number(None), found.without)]
    rows += [row(_signed(c.friction_error), _signed(c.delay_error), c.performance) for c in found.cases]
    return table(heads, rows, ())


def parameter_table(task: Task, settings: FeedForwardSettings) -> str:
    """Parameters of the feed-forward, before and now."""
    rows = [
        (
            name,
            f'{getattr(task.before, name):g}',
            f'{getattr(settings, name):g}',
            meaning.unit,
            'tuned' if name in task.tuned else '',
            meaning.description,
        )
        for name, meaning in meanings(settings).items()
    ]
    return table(('parameter', 'before', 'now', 'unit', '', 'meaning'), rows, (0, 3, 4, 5))


def _tuning_explanations(problem: Problem, found: Tuning) -> str:
    settings = problem.settings
    delay = whole_delay(problem.axis.servo, settings.delay)
    most = 200.0 * settings.amplitude * settings.overshoot_limit * 10.0
    return f"""<dl>
<dt>Plant</dt>
<dd>Servo, seals, sensors with noise, estimator and feed-forward in one loop, message by message through the
code that the node runs. The feed-forward force is in the controller {settings.delay / MS:.3g} ms after its
velocity sample; with force loop and valve it is force on the rod after {delay / MS:.3g} ms, the whole
delay.</dd>
<dt>Tracking RMS and peak</dt>
<dd>Error between reference and rod over {JUDGED_PERIODS} periods of the sine, after {SETTLED_PERIODS} in which
the start is forgotten.</dd>
<dt>Dwell</dt>
<dd>Time in those periods in which the rod rests, per reversal of the reference.</dd>
<dt>Overshoot</dt>
<dd>How far the rod goes past the ends of a move out and back at the top speed of the sine. Settings with which
it is more than {most:.3g} µm ({100.0 * settings.overshoot_limit:.3g} % of the way) in any case are not
taken.</dd>
<dt>Reversals at rest</dt>
<dd>Reversals of the rod while the reference rests, {settings.hold_time:g} s after each of sine, move and step:
a limit cycle. Settings with any are not taken.</dd>
<dt>Cases</dt>
<dd>The model of the seals gives so much more or less friction than they have; the whole delay is so much longer
or shorter. The plant stays as it is.</dd>
<dt>Search</dt>
<dd>{found.candidates} settings were tried. The merit is the mean of error and dwell, each as a share of what it
is without feed-forward, half for the case in which all is as known and half for the worst: {found.merit:.3f}
here, 1 being no better than without. Of settings that are nearly as good, the widest smoothing and the lowest
slew limit were taken.</dd>
</dl>"""


def match_sections(
    task: Task, recording: Recording, track: Track, found: Match, verdict: str, figure: Callable[[str], str]
) -> Iterable[str]:
    """The page of a match with a bag."""
    was, now, law = found.without, found.nominal, found.law
    yield f'<h1>Feed-forward for {escape(task.source)}</h1>'
    yield f'<p class="lead">{escape(verdict)}</p>'
    yield tiles(
        [
            (f'{was.sliding:.3g} to {now.sliding:.3g} N', 'friction left while sliding, RMS'),
            (f'{was.reversal:.3g} to {now.reversal:.3g} N', 'friction left near reversals, RMS'),
            (f'{law.scale:.3f} ± {law.scale_std:.2g}', 'friction of the axis over that of the model'),
            (f'{law.mass:.3g} kg', 'moving mass, fitted' if law.mass_is_fitted else 'moving mass, given'),
        ]
    )
    yield f'<p>{escape(task.motion)}; seals: {escape(task.seals)}.</p>'
    yield (
        '<p class="note">A bag shows what friction there was, not how the axis would have moved with less of it. Delay '
        'and limit cycles of the compensated axis are not in it: start with half the scale, see docs/tuning.md.</p>'
    )
    yield figure('match')
    yield figure('law')
    yield '<h2>Robustness</h2>'
    yield figure('robustness')
    rows = [('without', number(None), number(was.sliding), number(was.reversal))]
    rows += [
        (_signed(c.friction_error), _signed(c.delay_error), number(c.residual.sliding), number(c.residual.reversal))
        for c in found.cases
    ]
    yield table(('friction model', 'delay', 'left while sliding [N]', 'left near reversals [N]'), rows, ())
    yield '<h2>Tracking</h2>'
    recorded = track.figures()
    if recorded['recorded_tracking_rms'] is None:
        yield '<p>No rod position in the bag, so nothing to show.</p>'
    else:
        rms, peak = (number((value or 0.0) / UM, 1) for value in recorded.values())
        yield f'<p>Recorded error: RMS {rms} µm, peak {peak} µm.</p>'
        yield figure('recorded')
    yield '<h2>Parameters</h2>'
    yield parameter_table(task, found.feedforward)
    yield '<h2>How the numbers are made</h2>'
    yield _match_explanations(recording, found)


def _match_explanations(recording: Recording, found: Match) -> str:
    law = found.law
    sliding = int(np.count_nonzero(law.sliding))
    mass = 'fitted with it' if law.mass_is_fitted else 'given'
    late = found.feedforward.lead_time / MS
    offset = f'{law.offset:.3g} N' if math.isfinite(law.offset) else 'not known'
    return f"""<dl>
<dt>Friction of the axis</dt>
<dd>Force sum less mass times acceleration less a constant offset ({offset}). The mass was {mass}; acceleration
is the slope of a parabola through neighbouring velocity samples.</dd>
<dt>Friction over model, coulomb_scale</dt>
<dd>Least squares over {sliding} of {len(recording.estimates)} samples, those in which the rod slides and the
estimate is good.</dd>
<dt>smoothing_velocity</dt>
<dd>The widest with which the law, along the rod's own motion, is nearly as good as with the best.</dd>
<dt>slew_limit</dt>
<dd>The lowest with which the force along the recorded reference is nearly the same as without a limit.</dd>
<dt>lead_time</dt>
<dd>How late the force of an axis follows its command cannot be seen in a bag. It is what was given, or what it
was.</dd>
<dt>Friction left</dt>
<dd>RMS of the friction less the force that the feed-forward would have had from the recorded reference,
{late:.3g} ms after it was commanded; over the sliding samples, and over those nearer to a reversal of the
reference than {100.0 * NEAR_REVERSAL:.0f} % of the time between two. At rest friction is whatever the rod is
pushed with, so rest does not count.</dd>
<dt>Tracking and dwell with the feed-forward</dt>
<dd>A bag cannot tell them. Tune on the simulated servo for that, or record the axis with these parameters.</dd>
</dl>"""
