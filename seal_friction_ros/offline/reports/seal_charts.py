"""Charts of a seal file: the curves of its laws, in the order of the thesis.

The seal of the thesis is shown with the points of the thesis, and for two seals, as in its rig.
"""

from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from seal_friction_ros.core.estimation.configuration import PLACEHOLDER
from seal_friction_ros.core.estimation.findings import BAD, GOOD, LOOK, NAME_SEALS, Verdict, percent
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.units import BAR, INCH, LBF, MM, PSI
from seal_friction_ros.core.friction.actuator import (
    ActuatorFriction,
    MountedSeal,
    Seal,
    actuator_friction,
    breakaway_in,
)
from seal_friction_ros.core.friction.geometry import contact_length, projected_area, squeeze, stretch
from seal_friction_ros.core.friction.laws.physics_based import PhysicsBased
from seal_friction_ros.core.friction.laws.prior_art_chart import PriorArtChart
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import is_at_rest, sign, state_friction
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports import verdicts
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.formatting import force_unit, number
from seal_friction_ros.offline.reports.page import ReportSummary, Table, head_of, write_page
from seal_friction_ros.offline.reports.thesis_data import (
    THESIS_SEAL,
    dynamic_readings,
    mean_dynamic_friction,
    thesis_columns,
)
from seal_friction_ros.offline.work.seal_writer import seal_text

STATE_PRESSURE = 500.0 * PSI  # [Pa] of Figures 22 and 23
STATE_VELOCITY = 5.0 * INCH  # [m/s] at the ends of Figure 22
PRESSURE_LABEL = 'pressure [bar, gauge]'
_SINGLE: dict[str, Any] = {'marker': 'o', 'ls': '', 'ms': 6.5, 'color': style.BLACK}


DIRECTIONS = (('towards the pressure', -1, ':'), ('away from it', 1, '-.'))
"""Motion of a seal in chamber a, the direction of its rod, and the line of its curve"""


@dataclass(frozen=True)
class ChartedSeal:
    """A seal, mounted as the charts show it."""

    seal: Seal
    mounted: tuple[MountedSeal, ...]
    is_thesis_seal: bool

    def friction(self, pressure: float, velocity: float = 0.0) -> ActuatorFriction:
        """Friction of the mounted seals, all under ``pressure`` [Pa, gauge], at ``velocity`` [m/s]."""
        return actuator_friction(self.mounted, pressure, pressure, velocity)

    @property
    def count_text(self) -> str:
        """Number of seals in words."""
        return 'two seals' if len(self.mounted) == 2 else 'one seal'

    @property
    def state_pressure(self) -> float:
        """Pressure of the charts of the friction state [Pa]: that of the thesis if the seal was identified there."""
        inside = self.seal.pressure_min <= STATE_PRESSURE <= self.seal.pressure_max
        return STATE_PRESSURE if inside else (self.seal.pressure_min + self.seal.pressure_max) / 2.0

    @property
    def chart_pressures(self) -> FloatArray:
        """Pressures of the curves [Pa, gauge]."""
        return np.linspace(0.0, self.seal.pressure_max, 201)


def charted_seal(seal: Seal) -> ChartedSeal:
    """Two seals under one pressure for the seal of the thesis, as in its rig; else one."""
    is_thesis_seal = seal.name.startswith(THESIS_SEAL)
    return ChartedSeal(seal, tuple(MountedSeal(seal, c) for c in ('ab' if is_thesis_seal else 'a')), is_thesis_seal)


@house_style()
def write_seal_charts(seal: Path, out: Path) -> ReportSummary:
    """Write the charts of a seal file; see `write_page`. The numbers are the friction of all seals at some pressures.

    ValueError: the seal file cannot be read or is invalid, or the page cannot be written.
    """
    document = read_yaml(seal)
    with named_errors(seal):
        shown = charted_seal(parse_seal(document))
    law, normal, dimensions = shown.seal.coulomb_law, None, None
    if isinstance(law, PhysicsBased):  # normal force of one seal without pressure [N]: of the law, and of Table 4
        of_table = thesis_columns('normal_force', normal_force_lbf=LBF)[0]
        normal = law.normal_force_law.normal_force(0.0, law.projected_area), float(of_table[0])
    if isinstance(law, PhysicsBased | PriorArtChart):
        dimensions = {f.__name__: f(law.geometry) for f in (squeeze, stretch, projected_area, contact_length)}
    figures = write_page(
        out,
        'seal',
        seal_figures(shown),
        verdict=_verdict(shown),
        head=head_of(f'charts {seal}', shown.seal.name),
        shown=shown,
        source=document.get('source', ''),
        is_physics_based=isinstance(law, PhysicsBased),
        dimensions=dimensions,
        normal_without_pressure=normal,
        state_pressure_of_thesis=STATE_PRESSURE,
        friction_table=_friction_table(shown),
        document=seal_text(document),
    )
    pressures, measured = _compared(shown)
    frictions = tuple(shown.friction(pressure).coulomb_friction for pressure in pressures)
    numbers = {'seal': shown.seal.name, 'seal_count': len(shown.mounted), 'pressures': pressures}
    return ReportSummary(out, figures, numbers | {'coulomb_friction': frictions, 'measured': measured})


def _verdict(shown: ChartedSeal) -> Verdict:
    """By the standard deviation at the highest identified pressure; with the largest deviation from the tests."""
    name, pressure = shown.seal.name, shown.seal.pressure_max
    if name == PLACEHOLDER:
        return Verdict(BAD, 'Placeholder: its numbers are those of another seal.', f'{NAME_SEALS}.')
    tested = f', within {percent(max(off))} of the mean of the tests' if (off := _off(shown)) else ''
    at_most = shown.friction(pressure)
    friction, std = at_most.coulomb_friction, at_most.coulomb_friction_std / at_most.coulomb_friction
    where = f'{friction:.3g} N of Coulomb friction at {pressure / BAR:.3g} bar'
    level, after = GOOD, f'use it: seals: [{name}].'
    if std > verdicts.WIDE_BAND:
        level, after = LOOK, 'the band is wide: fit it to readings of your machine (docs/identification.md).'
    return Verdict(level, f'{where}, standard deviation {percent(std)}{tested}.', after)


# -- the data under the figures ---------------------------------------------------------------------------------------


def friction_over_velocity(shown: ChartedSeal, pressure: float, velocities: FloatArray) -> FloatArray:
    """State friction [N] at each velocity [m/s], without force sum and with a stick band of zero (Figure 22)."""
    frictions = []
    for v in velocities.tolist():
        acting = shown.friction(pressure, v)
        coulomb, sliding = acting.coulomb_friction, acting.coulomb_friction + acting.velocity_friction
        frictions.append(state_friction(v, 0.0, is_at_rest(v, False, 0.0, 0.0), sliding, coulomb).friction_force)
    return np.array(frictions)


def friction_over_force_sum(
    shown: ChartedSeal, pressure: float, force_sums: FloatArray, *, use_stiction: bool = False
) -> FloatArray:
    """State friction [N] of a rod at rest at each force sum [N] (Figure 23; with stiction as measured)."""
    friction = shown.friction(pressure)
    held = {ahead: breakaway_in(friction, ahead, with_stiction=use_stiction) for ahead in (-1, 0, 1)}
    states = (state_friction(0.0, f, True, friction.coulomb_friction, held[sign(f)]) for f in force_sums.tolist())
    return np.array([state.friction_force for state in states])


def _compared(shown: ChartedSeal) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Pressures [Pa] of the table, and the mean measured friction [N] at each if there is one."""
    if not shown.is_thesis_seal:
        return tuple(np.linspace(shown.seal.pressure_min, shown.seal.pressure_max, 11).tolist()), ()
    levels, means = mean_dynamic_friction()
    return tuple(levels.tolist()), tuple(means.tolist())


def _off(shown: ChartedSeal) -> list[float]:
    """Deviation of the Coulomb friction from each mean of the tests, if there are some [-]."""
    pairs = zip(*_compared(shown), strict=False)
    return [abs(shown.friction(pressure).coulomb_friction / mean - 1.0) for pressure, mean in pairs]


def _friction_table(shown: ChartedSeal) -> Table:
    pressures, measured = _compared(shown)
    heads = ['pressure [bar]', '[psi]', f'Coulomb friction, {shown.count_text} [N]', 'std [N]', 'breakaway force [N]']
    heads += ['mean of the tests [N]', 'deviation [%]'] if measured else []
    rows = []
    for pressure, mean in zip_longest(pressures, measured):
        found = shown.friction(pressure)
        forces = (found.coulomb_friction, found.coulomb_friction_std, found.coulomb_friction + found.stiction)
        row = [number(pressure / BAR), number(pressure / PSI, 0), *map(number, forces)]
        if mean is not None:
            row += [number(mean), number(100.0 * (found.coulomb_friction / mean - 1.0), 1, signed=True)]
        rows.append(row)
    return Table(heads, rows)


# -- figures ----------------------------------------------------------------------------------------------------------


def seal_figures(shown: ChartedSeal) -> list[Plot]:
    """Every chart that the laws of the seal allow."""
    law = shown.seal.coulomb_law
    plots = [seal_model_figure(shown)]
    if isinstance(law, PhysicsBased):
        plots += [seal_coefficient_figure(shown, law), seal_normal_force_figure(shown, law)]
    plots += [sliding_state_figure(shown), rest_state_figure(shown)]
    if shown.is_thesis_seal:
        plots += [prior_art_tests_figure(), prior_art_table_figure()]
    elif isinstance(law, PriorArtChart):
        plots.append(seal_chart_figure(shown, law))
    return plots


def seal_coefficient_figure(shown: ChartedSeal, law: PhysicsBased) -> Plot:
    """Coefficient of friction over normal force (Figure 18)."""
    forces = np.array([law.normal_force_law.normal_force(p, law.projected_area) for p in shown.chart_pressures])
    mu = np.array([law.friction_coefficient_law.coefficient_of_friction(f) for f in forces])
    unit, size = force_unit(float(forces[-1]))
    verb = 'falls' if mu[-1] < mu[0] else 'does not fall'
    figure, ax = style.new_figure(f'Coefficient of friction {verb} with the normal force', 3.8)
    ax.plot(forces / size, mu, color=style.BLUE, lw=1.8, label='law of the seal file')
    if shown.is_thesis_seal:
        pressures, normal = thesis_columns('normal_force', pressure_psig=PSI, normal_force_lbf=LBF)
        # 250 and 750 psi were not tested: interpolated between the neighbours.
        means = np.interp(pressures, *mean_dynamic_friction()) / 2.0
        ax.plot(normal / size, means / normal, **_SINGLE, label='tests over finite elements (Figure 18)')
    return style.figure_18(figure, ax, unit)


def seal_normal_force_figure(shown: ChartedSeal, law: PhysicsBased) -> Plot:
    """Normal over axial force (Figure 19)."""
    axial = shown.chart_pressures * law.projected_area
    normal = np.array([law.normal_force_law.normal_force(p, law.projected_area) for p in shown.chart_pressures])
    unit, size = force_unit(float(axial[-1]))
    gain = (normal[-1] - normal[0]) / (axial[-1] - axial[0])
    figure, ax = style.new_figure(f'Normal force grows by {gain:.3g} N per newton of axial force', 3.8)
    ax.plot(axial / size, normal / size, color=style.BLUE, lw=1.8, label='law of the seal file')
    if shown.is_thesis_seal:
        x, y = thesis_columns('normal_force', axial_force_lbf=LBF, normal_force_lbf=LBF)
        ax.plot(x / size, y / size, **_SINGLE, label='finite elements (thesis, Table 4)')
    return style.figure_19(figure, ax, unit)


def seal_model_figure(shown: ChartedSeal) -> Plot:
    """Law over pressure with its band, and the readings of the thesis (Figure 24)."""
    pressures = shown.chart_pressures
    frictions = [shown.friction(p) for p in pressures]
    values = np.array([(f.coulomb_friction, f.coulomb_friction_std, f.stiction) for f in frictions])
    coulomb, std, stiction = values.T
    unit, size = force_unit(float(coulomb[-1]))
    title = f'Coulomb friction reaches {coulomb[-1]:.3g} N at {pressures[-1] / BAR:.3g} bar'
    if off := _off(shown):
        title = f'Model and mean of the tests differ by {100.0 * min(off):.1f} to {100.0 * max(off):.1f} %'
    figure, ax = style.new_figure(title, 4.4)
    style.fill_band(ax, pressures / BAR, coulomb / size, BAND_95 * std / size, label=f'95 % band (± {BAND_95:.2f} std)')
    ax.plot(pressures / BAR, coulomb / size, color=style.BLUE, lw=1.8, label='Coulomb friction, model')
    for text, rod, line in DIRECTIONS if shown.seal.pressure_asymmetry else ():
        one_way = [shown.friction(p, rod * STATE_VELOCITY) for p in pressures]
        sliding = np.array([f.coulomb_friction + f.velocity_friction for f in one_way])
        ax.plot(pressures / BAR, sliding / size, color=style.BLUE, ls=line, lw=1.0, label=f'sliding {text}')
    ax.plot(pressures / BAR, (coulomb + stiction) / size, color=style.ORANGE, ls='--', label='breakaway force, model')
    if shown.is_thesis_seal:
        _draw_readings(ax, size)
    ylabel = f'friction of {shown.count_text} [{unit}]'
    ax.set(xlim=(-0.01 * pressures[-1] / BAR, None), ylim=(0.0, None), xlabel=PRESSURE_LABEL, ylabel=ylabel)
    ax.legend(loc='upper left' if coulomb[-1] > coulomb[0] else 'best')
    return Plot('fig24_model_over_pressure', figure)


def _draw_readings(ax: Axes, size: float) -> None:
    pressure, friction = dynamic_readings()
    faint = {**_SINGLE, 'ms': 4.0, 'alpha': 0.3, 'mew': 0.0}
    ax.plot(pressure / BAR, friction / size, **faint, label='readings, running')
    levels, means = mean_dynamic_friction()
    ax.plot(levels / BAR, means / size, **_SINGLE, mec='white', label='mean of the readings')


def sliding_state_figure(shown: ChartedSeal) -> Plot:
    """Friction over velocity at one pressure (Figure 22)."""
    velocity = np.linspace(-STATE_VELOCITY, STATE_VELOCITY, 2001)
    friction = friction_over_velocity(shown, shown.state_pressure, velocity)
    unit, size = force_unit(float(friction[-1]))
    where = f'at {STATE_VELOCITY / MM:.0f} mm/s' if shown.seal.depends_on_velocity else 'at any speed'
    figure, ax = style.new_figure(f'Sliding: {friction[-1] / size:.3g} {unit} against the motion, {where}', 3.6)
    ax.plot(velocity / INCH, friction / size, color=style.BLUE, lw=1.8, drawstyle='steps-mid')
    style.zero_lines(ax, vertical=True)
    ax.set(xlabel='rod velocity [in/s]', ylabel=f'friction of {shown.count_text} [{unit}]')
    ax.secondary_xaxis('top', functions=(lambda inch: inch * 25.4, lambda mm: mm / 25.4)).set_xlabel('[mm/s]')
    return Plot('fig22_state_1', figure)


def rest_state_figure(shown: ChartedSeal) -> Plot:
    """Friction over force sum at rest (Figure 23)."""
    pressure, friction = shown.state_pressure, shown.friction(shown.state_pressure)
    coulomb = friction.coulomb_friction
    swept = np.linspace(-2.0 * coulomb, 2.0 * coulomb, 2001)
    unit, size = force_unit(coulomb)
    figure, ax = style.new_figure(f'At rest: the seals hold up to {coulomb / size:.3g} {unit}', 4.0)
    if friction.stiction > 0.0:
        held = friction_over_force_sum(shown, pressure, swept, use_stiction=True)
        ax.plot(swept / size, held / size, color=style.ORANGE, ls='--', label='with stiction, as measured at breakaway')
    held = friction_over_force_sum(shown, pressure, swept)
    ax.plot(swept / size, held / size, color=style.BLUE, lw=1.8, label='equation of the thesis')
    for threshold in (-coulomb, coulomb):
        ax.axvline(threshold / size, color=style.VERMILLION, lw=0.9, ls=':')
    style.zero_lines(ax, vertical=True)
    labels = {'xlabel': f'force sum [{unit}]', 'ylabel': f'friction of {shown.count_text} [{unit}]'}
    return finished('fig23_states_2_and_3', figure, ax, **labels)


def prior_art_table_figure() -> Plot:
    """Friction of one seal by the prior art (Figure 12)."""
    pressure, friction, part = thesis_columns('prior_art', pressure_psi=PSI, F_lbf=LBF, F_H_lbf=LBF)
    figure, ax = style.new_figure('Prior art: friction of one seal read from charts', 3.6)
    ax.plot(pressure / BAR, friction, 'o-', color=style.VERMILLION, ms=5.0, label='Table 3')
    ax.plot(pressure / BAR, part, 's--', color=style.ORANGE, ms=4.0, label='share due to pressure')
    labels = {'xlabel': PRESSURE_LABEL, 'ylabel': 'friction of one seal [N]'}
    return finished('fig12_prior_art', figure, ax, ylim=(0.0, None), **labels)


def prior_art_tests_figure() -> Plot:
    """Prior art against the tests (Figure 17)."""
    pressure, of_one = thesis_columns('prior_art', pressure_psi=PSI, F_lbf=LBF)
    off = 100.0 * (2.0 * of_one / np.interp(pressure, *mean_dynamic_friction()) - 1.0)
    figure, ax = style.new_figure(f'Prior art is {off.min():.0f} to {off.max():.0f} % above the tests', 4.0)
    ax.plot(pressure / BAR, 2.0 * of_one, 'o-', color=style.VERMILLION, ms=5.0, label='prior art, doubled')
    _draw_readings(ax, 1.0)
    ax.set(ylim=(0.0, None), xlabel=PRESSURE_LABEL, ylabel='friction of two seals [N]')
    ax.legend(loc='upper left')
    return Plot('fig17_prior_art_and_tests', figure)


def seal_chart_figure(shown: ChartedSeal, law: PriorArtChart) -> Plot:
    """Friction of one seal by the charts of the seal file (as Figure 12)."""
    friction = np.array([law.coulomb_friction(p) for p in shown.chart_pressures])
    unit, size = force_unit(float(friction[-1]))
    figure, ax = style.new_figure('Friction of one seal read from charts', 3.6)
    ax.plot(shown.chart_pressures / BAR, friction / size, color=style.VERMILLION, lw=1.8)
    ax.set(ylim=(0.0, None), xlabel=PRESSURE_LABEL, ylabel=f'friction of one seal [{unit}]')
    return Plot('fig12_prior_art', figure)
