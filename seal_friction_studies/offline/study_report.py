"""Reports of the studies: friction, film under the seal, and an animation."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from PIL import Image

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.units import MM, MPA, MS, UM
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.figure_style import Plot, house_style
from seal_friction_ros.offline.reports.formatting import number
from seal_friction_ros.offline.reports.lubrication_report import write_case_page
from seal_friction_ros.offline.reports.page import Table, head_of, write_page
from seal_friction_studies.core.findings import REFERENCE_HALF_WIDTH
from seal_friction_studies.core.spool import SpoolResult
from seal_friction_studies.core.study_case import StudyCase
from seal_friction_studies.core.transient import TransientResult, last_cycle
from seal_friction_studies.offline import verdicts
from seal_friction_studies.offline.bag_comparison import Comparison
from seal_friction_studies.offline.study_runs import CaseRun, StudyRuns

TEMPLATES = Path(__file__).with_name('templates')
POSITION_LABEL, FRICTION_LABEL = 'position of the spool [mm]', 'friction [N]'
_FRAMES = 80  # of the animation
_FRAME_RATE = 12  # [1/s]
_ANIMATION_DPI = 80

_FINDINGS = {
    'friction': ('mean friction about the middle', 'N', 1.0),
    'solid_share': ('solid share of it', '%', 0.01),
    'solid_slow': ('solid friction while slowing down, at 0.2 of the top speed', 'N', 1.0),
    'solid_fast': ('solid friction at full speed', 'N', 1.0),
    'fluid_slow': ('fluid friction while slowing down, at 0.2 of the top speed', 'N', 1.0),
    'fluid_fast': ('fluid friction at full speed', 'N', 1.0),
    'rise_on_deceleration': ('rise of the friction while slowing down', '%', 0.01),
    'assisted_length': ('distance after a reversal over which the friction assists the motion', 'µm', UM),
    'elastic_length': ('the same from elasticity: friction over stiffness', 'µm', UM),
    'second_lobe': ('position at which the friction falls again while the seal sticks', 'mm', MM),
    'edge_peak': ('peak at the control edge over the friction after it', '1', 1.0),
    'edge_assist': ('force of the chamfer that assists leaving the seat', 'N', 1.0),
    'friction_on_leaving': ('lowest total friction during this', 'N', 1.0),
    'after_edge': ('friction in the seat after the control edge', 'N', 1.0),
}
"""Field of `Findings` -> description, unit and its size in SI."""


@house_style()
def write_run_page(run: CaseRun, out: Path) -> tuple[Path, ...]:
    """Write the page of one run, its figures and an animation; see `write_page`.

    Returns:
        Paths of the figures and the animation.

    Raises:
        ValueError: A file cannot be written.
    """
    result = run.result
    plots = [friction_loop_figure(result), motion_figure(result), film_figure(result)]
    verdict = verdicts.of_lubrication(run.found.friction, run.found.solid_share, _largest_change(run))
    tables = {'found': run.found, 'finding_table': _finding_table(run)}
    figures = write_case_page(
        out, TEMPLATES / 'lubrication_run', plots, result.case, verdict=verdict, result=result, **tables
    )
    animation = figures[0].parent / 'film.gif'
    _write_animation(result, animation)
    return (*figures, animation)


@house_style()
def write_study_page(case: StudyCase, study: StudyRuns, out: Path) -> tuple[Path, ...]:
    """Write the page of a study of the solid shear stress; see `write_page`."""
    heads = (
        'solid shear stress [MPa]', 'friction [N]', 'solid share [%]', 'friction over stress, off the mean by [%]',
        'curve off the mean curve by [%]',
    )  # fmt: skip
    rows = [
        (
            number(stress / MPA),
            number(friction, 3),
            number(100.0 * share, 1),
            number(100.0 * deviation, 1, signed=True),
            number(100.0 * curve, 1),
        )
        for stress, friction, share, deviation, curve in zip(*study.table, strict=True)
    ]
    table = Table(heads, rows)
    plots = [study_figure(study)]
    verdict = verdicts.of_study(max(abs(deviation) for deviation in study.table.deviation))
    values = {'verdict': verdict, 'study_table': table, 'half_width': REFERENCE_HALF_WIDTH}
    return write_case_page(out, TEMPLATES / 'lubrication_study', plots, case, **values)


@house_style()
def write_comparison_page(comparison: Comparison, out: Path) -> tuple[Path, ...]:
    """Write the page of simulation against measurement; see `write_page`."""
    result = comparison.result
    rows = [(name, f'{v:.3g}' if isinstance(v, float) else v) for name, v in comparison.numbers().items()]
    table = Table(('number', 'value'), rows, (0,))
    plots = [comparison_figure(comparison), friction_loop_figure(result), film_figure(result)]
    numbers = comparison.numbers()
    verdict = verdicts.of_comparison_with_bag(
        *(numbers[name] for name in ('measured_mean_N', 'computed_mean_N', 'correlation'))
    )
    values = {'verdict': verdict, 'comparison': comparison, 'number_table': table}
    return write_case_page(out, TEMPLATES / 'lubrication_comparison', plots, result.case, **values)


@house_style()
def write_spool_page(name: str, result: SpoolResult, labels: list[str], out: Path) -> tuple[Path, ...]:
    """Write the page of a spool; see `write_page`."""
    frictions = dict[Any, FloatArray](enumerate(result.members, start=1)) | {'all': result.friction}
    rows = [(seal, number(float(np.abs(f[result.last_cycle]).max()), 3)) for seal, f in frictions.items()]
    table = Table(('seal', 'largest friction in the last cycle [N]'), rows, (0,))
    verdict = verdicts.of_spool(float(np.abs(result.friction[result.last_cycle]).max()))
    head = head_of(f'ehl run {name}', 'computed, no measured data')
    values: dict[str, Any] = {'verdict': verdict, 'head': head, 'name': name, 'seal_table': table}
    return write_page(out, TEMPLATES / 'lubrication_spool', [spool_members_figure(result, labels)], **values)


def _largest_change(run: CaseRun) -> float:
    """Largest relative change of the friction with a coarser step or grid [-]."""
    changes = [abs(errors.get('friction', 0.0)) for errors in (run.step_errors, run.grid_errors)]
    return max(changes) / abs(run.found.friction) if run.found.friction else float('inf')


def _finding_table(run: CaseRun) -> Table:
    rows = []
    for name, value in run.found._asdict().items():
        if value is not None:
            text, unit, size = _FINDINGS[name]
            errors = (run.step_errors.get(name), run.grid_errors.get(name))
            rows.append((text, unit, f'{value / size:.4g}', *('' if e is None else f'{e / size:.1g}' for e in errors)))
    heads = ('finding', 'unit', 'value', 'change with twice the step', 'change with half the cells')
    return Table(heads, rows, (0, 1))


# -- figures ----------------------------------------------------------------------------------------------------------


def friction_loop_figure(result: TransientResult) -> Plot:
    """Friction over displacement with its shares (as Figure 14 of the spool-valve paper)."""
    last = last_cycle(result)
    x, friction = result.position[last] / MM, result.friction[last]
    figure, (ax, detail) = style.new_figure('Friction over the position of the spool', 4.4, ncols=2)
    for axes in (ax, detail):
        if np.any(result.edge):
            axes.plot(x, result.edge[last], color=style.GREEN, label='chamfer')
        axes.plot(x, result.fluid[last], color=style.SKY, label='fluid')
        axes.plot(x, result.solid[last], color=style.ORANGE, label='solid')
        axes.plot(x, friction, color=style.BLACK, lw=1.8, label='friction')
        style.zero_lines(axes)
        axes.set_xlabel(POSITION_LABEL)
    left = float(x.min())
    detail.set(title='after the reversal on the left', xlim=(left - 0.01 * np.ptp(x), left + 0.25 * np.ptp(x)))
    ax.set_ylabel(FRICTION_LABEL)
    style.legend_above(ax)
    for i in (len(x) // 4, 3 * len(x) // 4):  # an arrow on each branch shows the sense of the loop
        j = i + max(1, len(x) // 50)
        arrow = {'arrowstyle': '-|>', 'color': style.BLACK, 'lw': 1.8}
        ax.annotate('', (x[j], friction[j]), (x[i], friction[i]), arrowprops=arrow)
    return Plot('friction_over_position', figure)


def motion_figure(result: TransientResult) -> Plot:
    """Speed and friction over time."""
    figure, (upper, lower) = style.new_figure('Motion and friction over time', 4.6, nrows=2, sharex=True)
    time = result.time / MS
    upper.plot(time, result.velocity / MM, color=style.GREY, label='spool')
    upper.plot(time, result.sliding_velocity / MM, color=style.BLUE, label='contact')
    upper.set_ylabel('velocity [mm/s]')
    style.legend_above(upper)
    lower.plot(time, result.friction, color=style.BLACK)
    style.zero_lines(lower)
    lower.set(ylabel=FRICTION_LABEL, xlabel='time [ms]')
    return Plot('over_time', figure)


def moments(result: TransientResult) -> dict[str, int]:
    """Steps of the last cycle at which the film is shown, by name."""
    steps = np.flatnonzero(last_cycle(result) & (result.velocity > 0.0))
    if not len(steps):
        steps = np.arange(len(result.time))
    speed = result.sliding_velocity[steps]
    moving = np.flatnonzero(speed > 0.0)
    first = int(moving[0]) if len(moving) else 0
    fast = int(np.argmax(result.velocity[steps]))
    slow = int(np.flatnonzero(result.velocity[steps] >= 0.2 * result.velocity[steps].max())[-1])
    chosen = {'seal begins to slide': first, 'top speed is reached': fast, 'slowing down': slow}
    found = {name: int(steps[i]) for name, i in chosen.items()}
    back = np.flatnonzero(last_cycle(result) & (result.velocity < 0.0))
    if result.case.control_edge and len(back):  # no contact is left while slowing down
        del found['slowing down']
        found['pushed up the chamfer'] = int(back[np.argmax(np.abs(result.edge[back]))])
    return found


def film_figure(result: TransientResult) -> Plot:
    """Film, pressure and contact along the seal at chosen moments."""
    figure, axes = style.new_figure('Under the seal', 5.4, nrows=2, ncols=3, sharex=True, sharey='row')
    x = result.place / MM
    for (upper, lower), (name, step) in zip(axes.T, moments(result).items(), strict=False):
        _draw_pressure(upper, x, result, step)
        upper.set_title(f'{name}\n{number(float(result.sliding_velocity[step]) / MM, 1)} mm/s')
        gap = result.gap[step] / UM
        lower.fill_between(x, 0.0, gap * result.saturation[step], color=style.SKY, alpha=0.5, lw=0)
        lower.plot(x, gap, color=style.BLUE)
        lower.set_xlabel('along the seal [mm]')
    axes[0, 0].set_ylabel('pressure [MPa]')
    axes[1, 0].set(ylabel='gap [µm]', ylim=(0.0, _gap_limit(result) / UM))
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc='upper right', ncols=3)
    return Plot('film', figure)


def _gap_limit(result: TransientResult) -> float:
    """Height of the gap axis [m]: some films high."""
    touching = result.contact_pressure > 0.02 * result.contact_pressure.max()
    return float(3.0 * np.quantile(result.gap[touching], 0.9)) if touching.any() else float(result.gap.max())


def _pressures(result: TransientResult, step: int) -> dict[str, FloatArray]:
    """Pressures along the seal at one step [MPa]."""
    film, asperities = result.film_pressure[step] / MPA, result.contact_pressure[step] / MPA
    return {'together': film + asperities, 'asperities': asperities, 'film': film}


def _draw_pressure(ax: Axes, x: FloatArray, result: TransientResult, step: int) -> list[Line2D]:
    colours = {'together': style.BLACK, 'asperities': style.ORANGE, 'film': style.SKY}
    values = _pressures(result, step)
    return [ax.plot(x, values[name], color=colour, label=name)[0] for name, colour in colours.items()]


def study_figure(study: StudyRuns) -> Plot:
    """Friction at each solid shear stress, and over it (as Figure 15 of the spool-valve paper)."""
    agreement = 100.0 * max(abs(deviation) for deviation in study.table.deviation)
    title = f'Friction over solid shear stress agrees within {agreement:.0f} %'
    figure, (left, right) = style.new_figure(title, 4.4, ncols=2)
    stresses = [run.case.seal.solid_shear_stress / MPA for run in study.runs]
    looks = style.shades([f'{stress:g} MPa' for stress in stresses])
    for run, stress, look in zip(study.runs, stresses, looks, strict=True):
        last = last_cycle(run)
        x, friction = run.position[last] / MM, run.friction[last]
        left.plot(x, friction, lw=1.2, **look)
        right.plot(x, friction / stress, lw=1.2, **look)
    left.set(xlabel=POSITION_LABEL, ylabel=FRICTION_LABEL)
    right.set(xlabel=POSITION_LABEL, ylabel='friction over solid shear stress [N/MPa]')
    style.legend_below(figure, left, len(study.runs), columnspacing=1.0, handlelength=1.2)
    return Plot('solid_shear_stress', figure)


def comparison_figure(comparison: Comparison) -> Plot:
    """Measured and computed friction over displacement (as Figure 16 of the spool-valve paper)."""
    result = comparison.result
    figure, ax = style.new_figure(f'Simulation against measurement: {comparison.bag}', 4.6)
    x, mean = comparison.position / MM, f'mean of {comparison.averaged_samples}'
    ax.plot(x, comparison.measured, color=style.LIGHT_GREY, lw=0.7, label='measured')
    ax.plot(x, comparison.filtered, color=style.GREY, label=f'measured, {mean}')
    ax.plot(result.position / MM, comparison.shown, color=style.SKY, lw=0.8, label='computed, by the chain')
    ax.plot(x, comparison.computed, color=style.VERMILLION, lw=1.8, label=f'computed, {mean}')
    ax.set(xlabel=POSITION_LABEL, ylabel=FRICTION_LABEL)
    style.legend_above(ax)
    return Plot('simulation_against_measurement', figure)


def spool_members_figure(result: SpoolResult, labels: list[str]) -> Plot:
    """Friction of a spool and of its seals over displacement (as Figure 13 of the spool-valve paper)."""
    figure, ax = style.new_figure('Friction of all seals of the spool', 4.6)
    last = result.last_cycle
    x = result.position[last] / MM
    colours = (style.BLUE, style.ORANGE, style.GREEN, style.PURPLE, style.SKY, style.VERMILLION)
    for i, label in enumerate(labels):
        if label not in labels[:i]:
            ax.plot(x, result.members[i][last], color=colours[i % len(colours)], lw=1.0, label=label)
    ax.plot(x, result.friction[last], color=style.BLACK, lw=1.8, label='together')
    style.zero_lines(ax)
    ax.set(xlabel=POSITION_LABEL, ylabel=FRICTION_LABEL)
    ax.legend(loc='upper left', bbox_to_anchor=(1.0, 1.0))
    return Plot('spool', figure)


def _write_animation(result: TransientResult, path: Path) -> None:
    """Film and friction over the last cycle as an animated GIF; the same run gives the same bytes."""
    last = last_cycle(result)
    steps: IntArray = np.flatnonzero(last)
    steps = steps[np.linspace(0, len(steps) - 1, min(_FRAMES, len(steps))).astype(int)]
    x = result.place / MM
    figure, (upper, lower, loop) = style.new_figure(result.case.name, 5.6, nrows=3)
    pressures = _draw_pressure(upper, x, result, int(steps[0]))
    highest = float((result.contact_pressure[last] + result.film_pressure[last]).max()) / MPA
    upper.set(ylabel='pressure [MPa]', ylim=(0.0, 1.1 * highest))
    gap = lower.plot(x, result.gap[steps[0]] / UM, color=style.BLUE, label='gap')[0]
    film = lower.plot(x, result.gap[steps[0]] / UM, color=style.SKY, lw=4.0, alpha=0.5, label='filled')[0]
    lower.set(xlabel='along the seal [mm]', ylabel='gap [µm]', ylim=(0.0, _gap_limit(result) / UM))
    for ax in (upper, lower):
        style.legend_above(ax)
    loop.plot(result.position[last] / MM, result.friction[last], color=style.GREY)
    dot = loop.plot([], [], 'o', color=style.VERMILLION)[0]
    loop.set(xlabel=POSITION_LABEL, ylabel=FRICTION_LABEL)
    moving = [*pressures, gap, film, dot]
    for line in moving:
        line.set_animated(True)
    figure.set_dpi(_ANIMATION_DPI)
    canvas: Any = FigureCanvasAgg(figure)  # its methods have no annotations
    figure.draw_without_rendering()
    figure.set_layout_engine('none')
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    frames = []
    for step in steps.tolist():
        for line, values in zip(pressures, _pressures(result, step).values(), strict=True):
            line.set_ydata(values)
        gap.set_ydata(result.gap[step] / UM)
        film.set_ydata(result.gap[step] * result.saturation[step] / UM)
        dot.set_data([result.position[step] / MM], [result.friction[step]])
        canvas.restore_region(still)
        for line in moving:
            line.axes.draw_artist(line)
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert('RGB'))
    try:
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=1000 // _FRAME_RATE, loop=0)
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror or error}') from None
