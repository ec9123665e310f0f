"""Pages of the lubricated contact: the pictures of the spool-valve paper, the film under the seal, and an animation."""

import dataclasses
from collections.abc import Callable, Iterable
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.ticker import FuncFormatter
from PIL import Image

from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import BAR, MM, MPA, UM
from seal_friction_ros.core.lubrication.case import Case
from seal_friction_ros.core.lubrication.findings import REFERENCE_HALF_WIDTH
from seal_friction_ros.core.lubrication.spool import SpoolResult
from seal_friction_ros.core.lubrication.transient import RunResult, last_cycle
from seal_friction_ros.offline.contact.lubrication_comparison import Comparison
from seal_friction_ros.offline.contact.lubrication_runs import CaseRun, MapRuns, StudyRuns
from seal_friction_ros.offline.reports.bag_report import number, table, tiles, write_page
from seal_friction_ros.offline.reports.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    Plot,
    house_style,
    legend_above,
    new_figure,
)

_FRAMES = 80  # of the animation
_FRAME_RATE = 12  # [1/s]
_ANIMATION_DPI = 80

_MODEL = (
    'One-dimensional transient mixed lubrication of the seal on its wall: Reynolds equation with mass-conserving '
    'cavitation and flow factors of roughness, asperity contact, a grease that yields and thins, an elastic half-plane '
    'for the seal and a spring for its groove. Equations, sources and choices: docs/ehl.md.'
)


def write_run_page(run: CaseRun, out: Path) -> tuple[Path, ...]:
    """Write the page of one run, its figures and an animation; gives the paths of figures and animation.

    Raises:
        ValueError: A file cannot be written.
    """
    result = run.result
    with house_style():
        plots = [friction_figure(result), time_figure(result), film_figure(result)]
        written = write_page(out, f'Seal friction: {result.case.name}', lambda f: _run_sections(run, f), plots)
        animation = written[0].parent / 'film.gif'
        _write_animation(result, animation)
    return (*written, animation)


def write_study_page(case: Case, study: StudyRuns, out: Path) -> tuple[Path, ...]:
    """Write the page of a study of the solid shear stress; see `write_run_page`."""
    with house_style():
        plots = [study_figure(study)]
        return write_page(out, f'Solid shear stress: {case.name}', lambda f: _study_sections(case, study, f), plots)


def write_map_page(computed: MapRuns, out: Path) -> tuple[Path, ...]:
    """Write the page of a friction map; see `write_run_page`."""
    with house_style():
        plots = [map_figure(computed)]
        return write_page(out, f'Friction map: {computed.case.name}', lambda f: _map_sections(computed, f), plots)


def write_comparison_page(comparison: Comparison, out: Path) -> tuple[Path, ...]:
    """Write the page of simulation against measurement; see `write_run_page`."""
    name = comparison.result.case.name
    with house_style():
        plots = [comparison_figure(comparison), friction_figure(comparison.result), film_figure(comparison.result)]
        return write_page(out, f'{name} against {comparison.bag}', lambda f: _comparison_sections(comparison, f), plots)


def write_spool_page(name: str, result: SpoolResult, labels: list[str], out: Path) -> tuple[Path, ...]:
    """Write the page of a spool; see `write_run_page`."""
    with house_style():
        plots = [spool_figure(result, labels)]
        return write_page(out, f'Spool: {name}', lambda f: _spool_sections(name, result, f), plots)


# -- figures ----------------------------------------------------------------------------------------------------------


def friction_figure(result: RunResult) -> Plot:
    """Friction over displacement with its shares (Figure 14)."""
    last = last_cycle(result)
    x = result.position[last] / MM
    has_edge = bool(np.any(result.edge))
    figure, (ax, detail) = new_figure('Friction over the way of the spool', 4.4, ncols=2)
    for axes in (ax, detail):
        if has_edge:
            axes.plot(x, result.edge[last], color=GREEN, label='chamfer')
        axes.plot(x, result.fluid[last], color=SKY, label='fluid')
        axes.plot(x, result.solid[last], color=ORANGE, label='solid')
        axes.plot(x, result.friction[last], color=BLACK, lw=1.8, label='friction')
        axes.axhline(0.0, color=GREY, lw=0.8, zorder=0)
        axes.set_xlabel('position of the spool [mm]')
    ax.set_ylabel('friction [N]')
    detail.set_title('after the reversal on the left')
    left = float(x.min())
    detail.set_xlim(left - 0.01 * np.ptp(x), left + 0.25 * np.ptp(x))
    legend_above(ax)
    _arrows(ax, x, result.friction[last])
    return Plot(
        'friction_over_position',
        figure,
        'Friction of the last cycle with the sign of the motion it resists, and what it is made of (spool-valve paper, '
        'Figure 14). Above zero on the way to the right it resists, below it pushes along.',
    )


def _arrows(ax: Axes, x: FloatArray, friction: FloatArray) -> None:
    """Sense of the loop: an arrow on each branch."""
    n = len(x)
    for i in (n // 4, 3 * n // 4):
        j = i + max(1, n // 50)
        ax.annotate(
            '', (x[j], friction[j]), (x[i], friction[i]), arrowprops={'arrowstyle': '-|>', 'color': BLACK, 'lw': 1.8}
        )


def time_figure(result: RunResult) -> Plot:
    """Speed and friction over time."""
    figure, (upper, lower) = new_figure('Motion and friction over time', 4.6, nrows=2, sharex=True)
    time = result.time * 1e3
    upper.plot(time, result.velocity / MM, color=GREY, label='spool')
    upper.plot(time, result.sliding_velocity / MM, color=BLUE, label='contact')
    upper.set_ylabel('velocity [mm/s]')
    legend_above(upper)
    lower.plot(time, result.friction, color=BLACK, label='friction')
    lower.axhline(0.0, color=GREY, lw=0.8, zorder=0)
    lower.set_ylabel('friction [N]')
    lower.set_xlabel('time [ms]')
    return Plot(
        'over_time',
        figure,
        'The contact stands while the seal is drawn through its groove after each reversal, then slides on.',
    )


def moments(result: RunResult) -> dict[str, int]:
    """Steps of the last cycle at which the film is shown, by what they are."""
    steps = np.flatnonzero(last_cycle(result) & (result.velocity > 0.0))
    if not len(steps):
        steps = np.arange(len(result.time))
    speed = result.sliding_velocity[steps]
    moving = np.flatnonzero(speed > 0.0)
    first = int(moving[0]) if len(moving) else 0
    fast = int(np.argmax(result.velocity[steps]))
    slow = int(np.flatnonzero(result.velocity[steps] >= 0.2 * result.velocity[steps].max())[-1])
    chosen = {'seal begins to slide': first, 'speed is reached': fast, 'slowing down': slow}
    found = {name: int(steps[i]) for name, i in chosen.items()}
    back = np.flatnonzero(last_cycle(result) & (result.velocity < 0.0))
    if result.case.control_edge and len(back):  # slowing down, there is nothing left to see
        del found['slowing down']
        found['pushed up the chamfer'] = int(back[np.argmax(np.abs(result.edge[back]))])
    return found


def film_figure(result: RunResult) -> Plot:
    """Film, pressure and contact along the seal at chosen moments."""
    figure, axes = new_figure('Under the seal', 5.4, nrows=2, ncols=3, sharex=True, sharey='row')
    x = result.place / MM
    for column, (name, step) in enumerate(moments(result).items()):
        upper, lower = axes[0, column], axes[1, column]
        _draw_pressure(upper, x, result, step)
        upper.set_title(f'{name}\n{number(float(result.sliding_velocity[step]) / MM, 1)} mm/s')
        _draw_film(lower, x, result, step)
        lower.set_xlabel('along the seal [mm]')
    axes[0, 0].set_ylabel('pressure [MPa]')
    axes[1, 0].set_ylabel('gap [µm]')
    axes[1, 0].set_ylim(0.0, 1e6 * _gap_limit(result))
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc='upper right', ncols=3)
    return Plot(
        'film',
        figure,
        'Above: pressure of film and asperities, and their sum. Below: gap, filled as far as the film is. A seal at a '
        'positive velocity slides to the right. The edge of the contact is steep: the gap axis is cut.',
    )


def _gap_limit(result: RunResult) -> float:
    """Height of the gap axis [m]: some films high."""
    touching = result.contact_pressure > 0.02 * result.contact_pressure.max()
    return float(3.0 * np.quantile(result.gap[touching], 0.9)) if touching.any() else float(result.gap.max())


def _draw_pressure(ax: Axes, x: FloatArray, result: RunResult, step: int) -> None:
    film, solid = result.film_pressure[step] / MPA, result.contact_pressure[step] / MPA
    ax.plot(x, film + solid, color=BLACK, label='together')
    ax.plot(x, solid, color=ORANGE, label='asperities')
    ax.plot(x, film, color=SKY, label='film')


def _draw_film(ax: Axes, x: FloatArray, result: RunResult, step: int) -> None:
    gap = result.gap[step] / UM
    ax.fill_between(x, 0.0, gap * result.saturation[step], color=SKY, alpha=0.5, lw=0)
    ax.plot(x, gap, color=BLUE)


def study_figure(study: StudyRuns) -> Plot:
    """Friction for each tau_c, and over tau_c (Figure 15)."""
    figure, (left, right) = new_figure(
        f'Friction over solid shear stress agrees within {100 * _largest(study.table.deviation):.0f} %', 4.4, ncols=2
    )
    count = len(study.runs)
    for i, run in enumerate(study.runs):
        last = last_cycle(run)
        stress = run.case.seal.solid_shear_stress
        share = 0.15 + 0.85 * i / max(1, count - 1)
        look = {
            'color': BLUE,
            'alpha': share,
            'lw': 1.2,
            'label': f'{stress / MPA:g} MPa' if i in (0, count - 1) else None,
        }
        left.plot(run.position[last] / MM, run.friction[last], **look)
        right.plot(run.position[last] / MM, run.friction[last] / (stress / MPA), **look)
    for ax in (left, right):
        ax.set_xlabel('position of the spool [mm]')
    left.set_ylabel('friction [N]')
    right.set_ylabel('friction over solid shear stress [N/MPa]')
    legend_above(right)
    return Plot(
        'solid_shear_stress',
        figure,
        'Friction with other solid shear stresses, and divided by them (spool-valve paper, Figure 15); darker is more.',
    )


def _largest(values: Iterable[float]) -> float:
    return max(abs(value) for value in values)


def map_figure(computed: MapRuns) -> Plot:
    """Steady friction over speed, for each pressure."""
    figure, (left, right) = new_figure('Steady friction falls as the film lifts the seal', 4.4, ncols=2)
    speeds = np.array(computed.law.speeds)
    count = len(computed.rows)
    for i, row in enumerate(computed.rows):
        share = 0.25 + 0.75 * i / max(1, count - 1)
        look = {'alpha': share, 'label': f'{row.pressure / BAR:g} bar' if i in (0, count - 1) else None}
        left.semilogx(speeds / MM, row.friction, color=BLUE, **look)
        right.semilogx(speeds / MM, row.solid / row.friction, color=ORANGE, **look)
    left.set_ylabel('friction of the seal [N]')
    right.set_ylabel('solid share')
    for ax in (left, right):
        ax.set_xlabel('speed [mm/s]')
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
        legend_above(ax)
    left.set_ylim(bottom=0.0)
    return Plot('friction_map', figure, 'Friction map: mean of both directions, flooded, elastic, on a plain wall.')


def comparison_figure(comparison: Comparison) -> Plot:
    """Measured and computed friction over displacement (Figure 16)."""
    result = comparison.result
    figure, ax = new_figure(f'Simulation against measurement: {comparison.bag}', 4.6)
    x = comparison.position / MM
    ax.plot(x, comparison.measured, color='#d9d9d9', lw=0.7, label='measured')
    ax.plot(x, comparison.filtered, color=GREY, label=f'measured, mean of {comparison.averaged_samples}')
    ax.plot(result.position / MM, comparison.shown, color=SKY, lw=0.8, label='computed, by the chain')
    ax.plot(x, comparison.computed, color=VERMILLION, lw=1.8, label=f'computed, mean of {comparison.averaged_samples}')
    ax.set_xlabel('position of the spool [mm]')
    ax.set_ylabel('friction [N]')
    legend_above(ax)
    return Plot(
        'simulation_against_measurement',
        figure,
        'Friction on the measured motion (spool-valve paper, Figure 16). From the measured force its middle between '
        f'both directions is taken off, an offset of the transducer, {_resonance(comparison)}',
    )


def _resonance(comparison: Comparison) -> str:
    """What was done about the measuring chain, in words."""
    chain = f'The chain is one oscillator of {comparison.chain.natural_frequency:.3g} Hz'
    if comparison.resonance is None:
        return f'and no resonance was found in it. {chain}, as in the paper.'
    return f'and a resonance of {comparison.resonance:.3g} Hz. {chain}.'


def spool_figure(result: SpoolResult, labels: list[str]) -> Plot:
    """Friction of a spool and of its seals over displacement (Figure 13)."""
    figure, ax = new_figure('Friction of all seals of the spool', 4.6)
    last = result.last_cycle
    x = result.position[last] / MM
    colours = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION)
    shown: set[str] = set()
    for i, (label, friction) in enumerate(zip(labels, result.members, strict=True)):
        if label not in shown:
            ax.plot(x, friction[last], color=colours[i % len(colours)], lw=1.0, label=label)
            shown.add(label)
    ax.plot(x, result.friction[last], color=BLACK, lw=1.8, label='together')
    ax.axhline(0.0, color=GREY, lw=0.8, zorder=0)
    ax.set_xlabel('position of the spool [mm]')
    ax.set_ylabel('friction [N]')
    ax.legend(loc='upper left', bbox_to_anchor=(1.0, 1.0))
    return Plot('spool', figure, 'Each seal alone, alike ones once, and their sum (spool-valve paper, Figure 13).')


def _write_animation(result: RunResult, path: Path) -> None:
    """Film and friction over the last cycle as an animated GIF; the same run gives the same bytes."""
    last = last_cycle(result)
    steps: IntArray = np.flatnonzero(last)
    steps = steps[np.linspace(0, len(steps) - 1, min(_FRAMES, len(steps))).astype(int)]
    x = result.place / MM
    figure, (upper, lower, loop) = new_figure(result.case.name, 5.6, nrows=3)
    _draw_pressure(upper, x, result, int(steps[0]))
    upper.set_ylim(0.0, 1.1 * float((result.contact_pressure[last] + result.film_pressure[last]).max()) / MPA)
    upper.set_ylabel('pressure [MPa]')
    legend_above(upper)
    gap = lower.plot(x, result.gap[steps[0]] / UM, color=BLUE, label='gap')[0]
    film = lower.plot(x, result.gap[steps[0]] / UM, color=SKY, lw=4.0, alpha=0.5, label='filled')[0]
    lower.set_ylim(0.0, 1e6 * _gap_limit(result))
    lower.set_ylabel('gap [µm]')
    lower.set_xlabel('along the seal [mm]')
    legend_above(lower)
    loop.plot(result.position[last] / MM, result.friction[last], color=GREY)
    dot = loop.plot([], [], 'o', color=VERMILLION)[0]
    loop.set_ylabel('friction [N]')
    loop.set_xlabel('position of the spool [mm]')
    moving = [(upper, line) for line in upper.lines] + [(lower, gap), (lower, film), (loop, dot)]
    for _, line in moving:
        line.set_animated(True)
    figure.set_dpi(_ANIMATION_DPI)
    canvas: Any = FigureCanvasAgg(figure)  # its methods have no annotations
    figure.draw_without_rendering()
    figure.set_layout_engine('none')
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    frames = []
    for step in steps:
        pressures = (result.contact_pressure[step] + result.film_pressure[step], result.contact_pressure[step])
        for line, values in zip(upper.lines, (*pressures, result.film_pressure[step]), strict=True):
            line.set_ydata(values / MPA)
        gap.set_ydata(result.gap[step] / UM)
        film.set_ydata(result.gap[step] * result.saturation[step] / UM)
        dot.set_data([result.position[step] / MM], [result.friction[step]])
        canvas.restore_region(still)
        for axes, line in moving:
            axes.draw_artist(line)
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert('RGB'))
    try:
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=1000 // _FRAME_RATE, loop=0)
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror or error}') from None


# -- pages ------------------------------------------------------------------------------------------------------------

_TITLES = {
    'friction': ('mean friction about the middle', 'N', 1.0),
    'solid_share': ('solid share of it', '%', 0.01),
    'solid_slow': ('solid friction, slowing down, at 0.2 of the speed', 'N', 1.0),
    'solid_fast': ('solid friction at full speed', 'N', 1.0),
    'fluid_slow': ('fluid friction, slowing down, at 0.2 of the speed', 'N', 1.0),
    'fluid_fast': ('fluid friction at full speed', 'N', 1.0),
    'rise_on_deceleration': ('rise of friction on slowing down', '%', 0.01),
    'assisted_length': ('way after a reversal on which friction pushes along', 'µm', UM),
    'elastic_length': ('the same by elasticity: friction over stiffness', 'µm', UM),
    'second_lobe': ('position at which friction falls again while the seal sticks', 'mm', MM),
    'edge_peak': ('peak on meeting the control edge over the friction after it', '1', 1.0),
    'edge_assist': ('push of the chamfer on leaving the seat', 'N', 1.0),
    'friction_on_leaving': ('least of all friction meanwhile', 'N', 1.0),
    'after_edge': ('friction in the seat after the control edge', 'N', 1.0),
}


def _run_sections(run: CaseRun, figure: Callable[[str], str]) -> Iterable[str]:
    result = run.result
    yield from _head(result.case)
    yield tiles(
        (
            ('mean friction about the middle', f'{run.found.friction:.3g} N'),
            ('solid share', f'{100.0 * run.found.solid_share:.1f} %'),
            ('steps, of them retried', f'{len(result.time)}, {result.retried_steps}'),
            ('largest error of mass in a step', f'{result.mass_defect:.1g}'),
        )
    )
    yield figure('friction_over_position')
    rows = []
    for name, value in run.found._asdict().items():
        if value is not None:
            title, unit, size = _TITLES[name]
            errors = (run.step_errors.get(name), run.grid_errors.get(name))
            blurred = ('' if e is None else f'{e / size:.1g}' for e in errors)
            rows.append((title, unit, f'{value / size:.4g}', *blurred))
    yield '<h2>Findings</h2>'
    yield table(('finding', 'unit', 'value', 'twice the step moves it by', 'half the cells move it by'), rows, (0, 1))
    yield '<h2>Over time</h2>'
    yield figure('over_time')
    yield '<h2>Under the seal</h2>'
    yield figure('film')
    yield '<p>The last cycle as an animation: film.gif beside the figures.</p>'
    yield from _parameters(result.case)


def _study_sections(case: Case, study: StudyRuns, figure: Callable[[str], str]) -> Iterable[str]:
    yield from _head(case)
    yield figure('solid_shear_stress')
    columns = zip(*study.table, strict=True)
    rows = [
        (
            number(stress / MPA),
            number(friction, 3),
            number(100.0 * share, 1),
            number(100.0 * deviation, 1, signed=True),
            number(100.0 * curve, 1),
        )
        for stress, friction, share, deviation, curve in columns
    ]
    heads = (
        'solid shear stress [MPa]',
        'friction [N]',
        'solid share [%]',
        'friction over stress, off the mean by [%]',
        'curve off the mean curve by [%]',
    )
    yield table(heads, rows, ())
    width = number(REFERENCE_HALF_WIDTH / MM, 1)
    yield f'<p>All within {width} mm of the middle, in the last cycle.</p>'
    yield from _parameters(case)


def _map_sections(computed: MapRuns, figure: Callable[[str], str]) -> Iterable[str]:
    law = computed.law
    yield from _head(computed.case)
    yield figure('friction_map')
    yield tiles(
        (
            ('friction follows a change of speed within', f'{law.memory_length / MM:.2g} mm'),
            ('way before the seal slides', f'{law.presliding_length / MM:.2g} mm'),
        )
    )
    heads = ('speed [mm/s]', *(f'{row.pressure / BAR:.3g} bar' for row in computed.rows))
    rows = [
        (number(speed / MM, 2), *(number(float(row.friction[i]), 3) for row in computed.rows))
        for i, speed in enumerate(law.speeds)
    ]
    yield '<h2>Friction of one seal [N]</h2>'
    yield table(heads, rows, ())
    yield from _parameters(computed.case)


def _comparison_sections(comparison: Comparison, figure: Callable[[str], str]) -> Iterable[str]:
    yield from _head(comparison.result.case)
    yield figure('simulation_against_measurement')
    rows = [(name, f'{v:.3g}' if isinstance(v, float) else v) for name, v in comparison.numbers().items()]
    yield table(('number', 'value'), rows)
    yield figure('friction_over_position')
    yield figure('film')
    yield from _parameters(comparison.result.case)


def _spool_sections(name: str, result: SpoolResult, figure: Callable[[str], str]) -> Iterable[str]:
    yield f'<h1>{escape(name)}</h1>'
    yield f'<p class="lead">{_MODEL}</p>'
    yield figure('spool')
    last = result.last_cycle
    rows = [(i + 1, number(float(np.abs(friction[last]).max()), 3)) for i, friction in enumerate(result.members)]
    rows_of_all = [*rows, ('all', number(float(np.abs(result.friction[last]).max()), 3))]
    yield table(('seal', 'largest friction in the last cycle [N]'), rows_of_all)


def _head(case: Case) -> Iterable[str]:
    yield f'<h1>{escape(case.name)}</h1>'
    yield f'<p class="lead">{_MODEL}</p>'
    if case.source:
        yield f'<p>{escape(case.source)}</p>'


def _parameters(case: Case) -> Iterable[str]:
    yield '<h2>Parameters</h2>'
    rows: list[tuple[Any, ...]] = []
    for part in dataclasses.fields(case):
        record = getattr(case, part.name)
        if dataclasses.is_dataclass(record):
            rows += [
                (f'{part.name}.{name}', getattr(record, name), meaning.unit, meaning.description)
                for name, meaning in meanings(record).items()
            ]
    yield table(('parameter', 'value', 'unit', 'meaning'), rows, (0, 2, 3))
