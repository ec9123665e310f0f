"""A simulated position servo with and without seal friction as one page: the flat peaks of the thesis's Figure 25."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import BAR, MM
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.position_servo import ServoParameters, Trajectory, init, simulate
from seal_friction_ros.core.servo.tracking import dwell_per_reversal, tracking_peak, tracking_rms
from seal_friction_ros.files import load_seals
from seal_friction_ros.offline.reports.bag_report import number, table, tiles, write_page
from seal_friction_ros.offline.reports.figures import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    VERMILLION,
    Plot,
    force_unit,
    house_style,
    legend_above,
    line,
    new_figure,
)
from seal_friction_ros.offline.reports.tracking_figures import length, shade

SETTLING_PERIODS = 2  # of the reference, until the start is forgotten; 0.4 s at 5 Hz
PERIODS = 6  # of the reference that count
SHOWN_PERIODS = 2  # of them in the figures


@dataclass(frozen=True, kw_only=True)
class ServoTracking:
    """How one servo follows the wave."""

    rms: float
    """[m] root mean square of the tracking error"""
    peak: float
    """[m] largest tracking error"""
    reached: float
    """[m] amplitude of the rod"""
    dwell: float
    """[s] mean rest per reversal; the simulated rod rests exactly, so any speed but 0 m/s is motion"""
    dwell_share: float
    """[-] of a period"""


@dataclass(frozen=True, kw_only=True)
class ServoChartsSummary:
    """What was written, and the numbers in it."""

    page: Path
    figures: tuple[Path, ...]
    amplitude: float
    """[m] of the reference"""
    frequency: float
    """[Hz] of the reference"""
    seals: int
    with_friction: ServoTracking
    without_friction: ServoTracking


class Simulated(NamedTuple):
    """A servo that follows a wave, once settled; all arrays of shape (n,)."""

    time: FloatArray
    """[s] since the first sample shown"""
    reference: FloatArray
    """[m]"""
    trajectory: Trajectory
    tracking: ServoTracking


def default_servo() -> ServoParameters:
    """The servo of the simulator with the seals that it has by default."""
    return ServoParameters(seals=load_seals(SealSelection()))


def without_seals(parameters: ServoParameters) -> ServoParameters:
    """The same servo without friction of seals."""
    return replace(parameters, seals=())


def follow(parameters: ServoParameters, wave: Sine) -> Simulated:
    """Let a servo follow a wave from rest, and evaluate it once it has settled."""
    period = 1.0 / wave.frequency
    step = parameters.control_period
    settling, count = round(SETTLING_PERIODS * period / step), round(PERIODS * period / step)
    wanted = [wave.at(i * step) for i in range(settling + count)]
    _, everything = simulate(parameters, init(parameters, wave.offset), wanted)
    # A row of the trajectory is the end of its step, so it belongs to the reference of the next.
    trajectory = Trajectory(*(column[settling - 1 : -1] for column in everything))
    reference = np.array([r.position for r in wanted[settling:]])
    position = trajectory.position
    dwell = dwell_per_reversal(trajectory.velocity, step)
    tracking = ServoTracking(
        rms=tracking_rms(reference, position),
        peak=tracking_peak(reference, position),
        reached=float(np.ptp(position)) / 2.0,
        dwell=dwell,
        dwell_share=dwell / period,
    )
    return Simulated(np.linspace(0.0, (count - 1) * step, count), reference, trajectory, tracking)


def friction_force(trajectory: Trajectory) -> FloatArray:
    """Friction force of the seals [N]: Coulomb friction in motion, at rest what holds the rod.

    Source: `seal_friction_ros.core.friction.states.state_friction`, for arrays.
    """
    breakaway = trajectory.breakaway_force
    held = np.clip(trajectory.force_sum, -breakaway, breakaway)
    sliding = np.sign(trajectory.velocity) * trajectory.coulomb_friction
    return np.where(trajectory.velocity == 0.0, held, sliding)


def write_servo_charts(
    out: Path, parameters: ServoParameters | None = None, wave: Sine | None = None
) -> ServoChartsSummary:
    """Write the charts of a servo: a page, and each figure as PNG and SVG in ``<stem>_figures`` beside it.

    Args:
        out: HTML file; replaced if it is there.
        parameters: The servo with its seals; default: that of the simulator.
        wave: What it shall follow; default: that of the simulator.

    Raises:
        ValueError: The servo has no seals, or the page cannot be written.
    """
    servo, wave = parameters or default_servo(), wave or Sine()
    if not servo.seals:
        raise ValueError('the servo has no seals: there is no friction to compare with none')
    rubbing, free = follow(servo, wave), follow(without_seals(servo), wave)
    with house_style():
        plots = [figure_25(wave, rubbing, free), forces_figure(wave, rubbing)]
        written = write_page(
            out,
            'Position servo with and without seal friction',
            lambda figure: _sections(servo, wave, rubbing, free, figure),
            plots,
        )
    return ServoChartsSummary(
        page=out,
        figures=written,
        amplitude=wave.amplitude,
        frequency=wave.frequency,
        seals=len(servo.seals),
        with_friction=rubbing.tracking,
        without_friction=free.tracking,
    )


# -- figures ----------------------------------------------------------------------------------------------------------


def _shown(run: Simulated, wave: Sine) -> slice:
    step = run.time[1] - run.time[0]
    return slice(0, round(SHOWN_PERIODS / (wave.frequency * step)) + 1)


def _figure_25_title(tracking: ServoTracking) -> str:
    if tracking.dwell == 0.0:
        return 'The rod turns round without a rest'
    share = f'{100.0 * tracking.dwell_share:.0f} % of a period'
    return f'Friction flattens the peaks: a rest of {1e3 * tracking.dwell:.1f} ms at each reversal, {share}'


def figure_25(wave: Sine, rubbing: Simulated, free: Simulated) -> Plot:
    """Position with and without friction against the reference (Figure 25), and the tracking errors."""
    part = _shown(rubbing, wave)
    time = rubbing.time[part]
    title = _figure_25_title(rubbing.tracking)
    figure, axes = new_figure(title, 5.6, nrows=2, sharex=True, gridspec_kw={'height_ratios': [3.0, 1.6]})
    for ax in axes:
        shade(ax, time, rubbing.trajectory.velocity[part] == 0.0, 'at rest, with friction')
    unit, size = ('mm', MM) if max(rubbing.tracking.peak, free.tracking.peak) >= MM else ('µm', 1e-6)
    runs = ((free, ORANGE, 'without friction'), (rubbing, BLUE, 'with friction'))
    for run, colour, name in runs:
        position = run.trajectory.position[part]
        line(axes[0], time, position / MM, color=colour, lw=1.7, label=name)
        label = f'{name}: {length(run.tracking.rms)} RMS'
        line(axes[1], time, (run.reference[part] - position) / size, color=colour, label=label)
    line(axes[0], time, rubbing.reference[part] / MM, color=BLACK, lw=1.1, ls=':', label='reference')
    axes[0].set_ylabel('position [mm]')
    axes[1].set_ylabel(f'reference less\nposition [{unit}]')
    axes[1].set_xlabel('time [s]')
    axes[1].set_xlim(time[0], time[-1])
    legend_above(axes[0])
    handles, labels = axes[1].get_legend_handles_labels()
    legend_above(axes[1], handles=handles[-2:], labels=labels[-2:])
    return Plot(
        'fig25_servo_with_and_without_friction',
        figure,
        f'Position servo on a sine of ± {length(wave.amplitude)} and {wave.frequency:.3g} Hz with and without the '
        'friction of the seals (thesis, Figure 25). Near the reversal of the direction the seals hold more than the '
        'forces on the rod: it stands still until they have grown to the breakaway force.',
    )


def forces_figure(wave: Sine, rubbing: Simulated) -> Plot:
    """Why it rests: force sum and friction force against what the seals hold, and the chamber pressures."""
    part = _shown(rubbing, wave)
    time, trajectory = rubbing.time[part], Trajectory(*(column[part] for column in rubbing.trajectory))
    friction = friction_force(trajectory)
    breakaway = trajectory.breakaway_force
    unit, size = force_unit(float(np.abs(trajectory.force_sum).max()))
    figure, axes = new_figure(
        f'The seals hold the rod until {breakaway.max() / size:.3g} {unit} act on it', 5.2, nrows=2, sharex=True
    )
    for ax in axes:
        shade(ax, time, trajectory.velocity == 0.0, 'at rest')
    for side, label in ((1.0, 'breakaway force'), (-1.0, None)):
        line(axes[0], time, side * breakaway / size, color=VERMILLION, lw=1.1, ls=':', label=label)
    line(axes[0], time, trajectory.force_sum / size, color=BLACK, lw=1.2, label='force sum')
    line(axes[0], time, friction / size, color=BLUE, lw=1.6, label='friction force')
    axes[0].axhline(0.0, color=GREY, lw=0.6, zorder=1.0)
    axes[0].set_ylabel(f'force [{unit}]')
    legend_above(axes[0])
    line(axes[1], time, trajectory.pressure_a / BAR, color=BLUE, label='chamber a')
    line(axes[1], time, trajectory.pressure_b / BAR, color=ORANGE, label='chamber b')
    axes[1].set_ylabel('pressure [bar, gauge]')
    axes[1].set_xlabel('time [s]')
    axes[1].set_xlim(time[0], time[-1])
    handles, labels = axes[1].get_legend_handles_labels()
    legend_above(axes[1], handles=handles[-2:], labels=labels[-2:])
    return Plot(
        'forces_and_pressures',
        figure,
        'The servo with friction over the same periods. In motion the friction force is the Coulomb friction; at rest '
        'it is the force sum, up to the breakaway force.',
    )


# -- the page ---------------------------------------------------------------------------------------------------------


def _sections(
    parameters: ServoParameters, wave: Sine, rubbing: Simulated, free: Simulated, figure: Callable[[str], str]
) -> Iterable[str]:
    yield '<h1>Position servo with and without seal friction</h1>'
    seals = len(parameters.seals)
    lead = (
        f'A simulated servo follows a sine of ± {length(wave.amplitude)} and {wave.frequency:.3g} Hz: with '
        f'{seals} seal{"s" if seals != 1 else ""} on its rod, and with none'
    )
    yield f'<p class="lead">{escape(lead)}.</p>'
    yield tiles(
        [
            ('rest per reversal with friction', f'{1e3 * rubbing.tracking.dwell:.1f} ms'),
            ('of a period', f'{100.0 * rubbing.tracking.dwell_share:.0f} %'),
            ('rest per reversal without friction', f'{1e3 * free.tracking.dwell:.1f} ms'),
            ('tracking error with friction, RMS', length(rubbing.tracking.rms)),
            ('without friction', length(free.tracking.rms)),
        ]
    )
    yield figure('fig25_servo_with_and_without_friction')
    yield figure('forces_and_pressures')
    yield '<h2>Numbers</h2>'
    heads = (
        '',
        'RMS error [µm]',
        'peak error [µm]',
        'amplitude reached [µm]',
        'rest per reversal [ms]',
        '[% of a period]',
    )
    named = (('with friction', rubbing.tracking), ('without friction', free.tracking))
    yield table(heads, [_row(name, tracking) for name, tracking in named])
    yield (
        f'<p>The first {SETTLING_PERIODS} periods, in which the start is forgotten, are left out; the next {PERIODS} '
        'count. No noise, no delay; no friction but that of the seals.</p>'
    )
    yield '<h2>Parameters</h2>'
    for name, record in _records(parameters, wave):
        yield f'<h3>{escape(name)}</h3>'
        yield _parameter_table(record)


def _row(name: str, tracking: ServoTracking) -> tuple[str, ...]:
    lengths = (tracking.rms, tracking.peak, tracking.reached)
    shares = (1e3 * tracking.dwell, 100.0 * tracking.dwell_share)
    return (name, *(number(value * 1e6, 1) for value in lengths), *(number(value, 1) for value in shares))


def _records(parameters: ServoParameters, wave: Sine) -> Iterable[tuple[str, Any]]:
    yield 'Reference', wave
    for name in ('valve', 'cylinder', 'load', 'controller'):
        yield name.capitalize(), getattr(parameters, name)
    yield 'Time', parameters


def _parameter_table(record: Any) -> str:
    rows = [
        (name, f'{getattr(record, name):.6g}', meaning.unit, meaning.description)
        for name, meaning in meanings(record).items()
    ]
    return table(('parameter', 'value', 'unit', 'meaning'), rows, (0, 2, 3))
