"""Charts of a simulated position servo with and without seal friction: the flat peaks of Figure 25 of the thesis."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.findings import GOOD, LOOK, Verdict, percent
from seal_friction_ros.core.foundation.arrays import BoolArray, FloatArray
from seal_friction_ros.core.foundation.units import BAR, MM, MS, UM
from seal_friction_ros.core.servo.closed_loop import SETTLING_PERIODS
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.position_servo import ServoParameters, Trajectory, init, simulate
from seal_friction_ros.core.servo.tracking import dwell_per_reversal, tracking_peak, tracking_rms
from seal_friction_ros.files import load_seals
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports import page
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.formatting import force_unit, length_text, length_unit, number
from seal_friction_ros.offline.reports.page import ReportSummary

CHART_PERIODS = 6  # of the reference, evaluated after `SETTLING_PERIODS`
SHOWN_PERIODS = 2  # in the figures


@dataclass(frozen=True, kw_only=True)
class ServoTracking:
    """Tracking of one servo."""

    rms: float  # [m] root mean square of the tracking error
    peak: float  # [m] largest tracking error
    reached: float  # [m] amplitude of the rod
    dwell: float  # [s] mean rest per reversal; the simulated rod rests at exactly 0 m/s
    dwell_share: float  # [-] of a period


class FollowedWave(NamedTuple):
    """A settled servo that follows a wave; all arrays of shape (n,)."""

    time: FloatArray  # [s] since the first sample
    reference: FloatArray  # [m]
    trajectory: Trajectory
    tracking: ServoTracking


def follow_wave(parameters: ServoParameters, wave: Sine) -> FollowedWave:
    """Simulate a servo that follows a wave from rest, and evaluate it after `SETTLING_PERIODS`."""
    period = 1.0 / wave.frequency
    step = parameters.control_period
    settling, count = round(SETTLING_PERIODS * period / step), round(CHART_PERIODS * period / step)
    setpoints = [wave.at(i * step) for i in range(settling + count)]
    _, everything = simulate(parameters, init(parameters, wave.offset), setpoints)
    # A row of the trajectory holds the end of its step, so it belongs to the next reference.
    trajectory = Trajectory(*(column[settling - 1 : -1] for column in everything))
    reference = np.array([setpoint.position for setpoint in setpoints[settling:]])
    position = trajectory.position
    dwell = dwell_per_reversal(trajectory.velocity, step)
    rms, peak, reached = tracking_rms(reference, position), tracking_peak(reference, position), np.ptp(position) / 2.0
    tracking = ServoTracking(rms=rms, peak=peak, reached=float(reached), dwell=dwell, dwell_share=dwell / period)
    return FollowedWave(np.linspace(0.0, (count - 1) * step, count), reference, trajectory, tracking)


@house_style()
def write_servo_charts(out: Path, parameters: ServoParameters | None = None, wave: Sine | None = None) -> ReportSummary:
    """Write the charts of a servo that follows a wave, by default those of the simulator; see `page.write_page`.

    ValueError: the servo has no seals, or the page cannot be written.
    """
    servo, wave = parameters or ServoParameters(seals=load_seals(SealSelection())), wave or Sine()
    if not servo.seals:
        raise ValueError('the servo has no seals, so no friction to show')
    names = [one.seal.name for one in servo.seals]
    rubbing, free = follow_wave(servo, wave), follow_wave(replace(servo, seals=()), wave)
    figures = page.write_page(
        out,
        'servo',
        [figure_25(rubbing, free, wave), forces_figure(rubbing, wave)],
        verdict=_verdict(rubbing.tracking, free.tracking),
        head=page.head_of('servo', 'simulated, no measured data', page.seals_text(names)),
        wave=wave,
        seals=len(servo.seals),
        rubbing=rubbing.tracking,
        free=free.tracking,
        tracking_table=_tracking_table(rubbing.tracking, free.tracking),
        parameter_table=_parameter_table(servo, wave),
        SETTLING_PERIODS=SETTLING_PERIODS,
        CHART_PERIODS=CHART_PERIODS,
    )
    numbers: dict[str, Any] = {'amplitude': wave.amplitude, 'frequency': wave.frequency, 'seals': len(servo.seals)}
    numbers |= {'with_friction': rubbing.tracking, 'without_friction': free.tracking}
    return ReportSummary(out, figures, numbers)


def _verdict(rubbing: ServoTracking, free: ServoTracking) -> Verdict:
    if not rubbing.dwell:
        return Verdict(GOOD, 'The rod reverses without a rest.', 'nothing: friction does not flatten the peaks.')
    text = (
        f'Friction flattens the peaks: a rest of {rubbing.dwell / MS:.1f} ms at each reversal, '
        f'{percent(rubbing.dwell_share)} of a period; the tracking error is {length_text(rubbing.rms)} RMS with '
        f'friction, {length_text(free.rms)} without.'
    )
    level = LOOK if rubbing.rms > free.rms + 0.1 * UM else GOOD
    return Verdict(level, text, 'compensate it: seal_friction tune --out feedforward.yaml.')


def _tracking_table(rubbing: ServoTracking, free: ServoTracking) -> page.Table:
    columns: page.Columns = (
        ('', lambda t: 'with friction' if t is rubbing else 'without friction'),
        ('RMS error [µm]', lambda t: number(t.rms, 1, unit=UM)),
        ('peak error [µm]', lambda t: number(t.peak, 1, unit=UM)),
        ('amplitude reached [µm]', lambda t: number(t.reached, 1, unit=UM)),
        ('rest per reversal [ms]', lambda t: number(t.dwell, 1, unit=MS)),
        ('[% of a period]', lambda t: number(t.dwell_share, 1, unit=0.01)),
    )
    return page.table_of((rubbing, free), columns, (0,))


def _parameter_table(parameters: ServoParameters, wave: Sine) -> page.Table:
    rows = page.parameter_rows(wave, 'reference.')
    for name in ('valve', 'cylinder', 'load', 'controller'):
        rows += page.parameter_rows(getattr(parameters, name), f'{name}.')
    return page.Table(page.PARAMETER_HEADS, rows + page.parameter_rows(parameters), (0, 2, 3))


# -- figures ----------------------------------------------------------------------------------------------------------


def _shown_periods(run: FollowedWave, wave: Sine) -> slice:
    return slice(0, round(SHOWN_PERIODS / (wave.frequency * (run.time[1] - run.time[0]))) + 1)


def _prepare_time_axes(axes: Sequence[Axes], time: FloatArray, at_rest: BoolArray, label: str) -> None:
    style.shade(axes[0], time, at_rest, label)
    style.shade(axes[1], time, at_rest)
    axes[1].set(xlabel='time [s]', xlim=(time[0], time[-1]))


def figure_25(rubbing: FollowedWave, free: FollowedWave, wave: Sine) -> Plot:
    """Position with and without friction against the reference (Figure 25), and the tracking errors."""
    dwell, share = rubbing.tracking.dwell, 100.0 * rubbing.tracking.dwell_share
    title = f'Friction flattens the peaks: a rest of {dwell / MS:.1f} ms at each reversal, {share:.0f} % of a period'
    if not dwell:
        title = 'The rod reverses without a rest'
    figure, axes = style.new_figure(title, 5.6, nrows=2, sharex=True, gridspec_kw={'height_ratios': [3.0, 1.6]})
    part = _shown_periods(rubbing, wave)
    time = rubbing.time[part]
    _prepare_time_axes(axes, time, rubbing.trajectory.velocity[part] == 0.0, 'at rest, with friction')
    unit, size = length_unit(max(rubbing.tracking.peak, free.tracking.peak))
    for run, colour, name in ((free, style.ORANGE, 'without friction'), (rubbing, style.BLUE, 'with friction')):
        position, reference = run.trajectory.position[part], run.reference[part]
        style.thin_line(axes[0], time, position / MM, color=colour, lw=1.7, label=name)
        label = f'{name}: {length_text(run.tracking.rms)} RMS'
        style.thin_line(axes[1], time, (reference - position) / size, color=colour, label=label)
    look = {'color': style.BLACK, 'lw': 1.1, 'ls': ':', 'label': 'reference'}
    style.thin_line(axes[0], time, rubbing.reference[part] / MM, **look)
    axes[1].set_ylabel(f'reference less\nposition [{unit}]')
    return finished('fig25_servo_with_and_without_friction', figure, *axes, ylabel='position [mm]')


def forces_figure(rubbing: FollowedWave, wave: Sine) -> Plot:
    """Force sum and friction force against the breakaway force, and the chamber pressures."""
    part = _shown_periods(rubbing, wave)
    time, trajectory = rubbing.time[part], Trajectory(*(column[part] for column in rubbing.trajectory))
    unit, size = force_unit(float(np.abs(trajectory.force_sum).max()))
    title = f'The seals hold the rod up to a force sum of {trajectory.breakaway_force.max() / size:.3g} {unit}'
    figure, axes = style.new_figure(title, 5.2, nrows=2, sharex=True)
    _prepare_time_axes(axes, time, trajectory.velocity == 0.0, 'at rest')
    threshold = {'color': style.VERMILLION, 'lw': 1.1, 'ls': ':'}
    style.thin_line(axes[0], time, trajectory.breakaway_force / size, label='breakaway force', **threshold)
    style.thin_line(axes[0], time, -trajectory.breakaway_force / size, **threshold)
    style.thin_line(axes[0], time, trajectory.force_sum / size, color=style.BLACK, lw=1.2, label='force sum')
    style.thin_line(axes[0], time, trajectory.friction_force / size, color=style.BLUE, lw=1.6, label='friction force')
    style.zero_lines(axes[0])
    style.thin_line(axes[1], time, trajectory.pressure_a / BAR, color=style.BLUE, label='chamber a')
    style.thin_line(axes[1], time, trajectory.pressure_b / BAR, color=style.ORANGE, label='chamber b')
    axes[1].set_ylabel('pressure [bar, gauge]')
    return finished('forces_and_pressures', figure, *axes, ylabel=f'force [{unit}]')
