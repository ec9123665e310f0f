"""A seal file as one page: the curves of its laws, in the order in which the thesis builds them up.

Where the seal is the thesis's, its measured and computed points are drawn in, and there are two seals, as in its rig.
"""

import csv
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR, INCH, LBF, PSI
from seal_friction_ros.core.friction.actuator import ActuatorFriction, MountedSeal, Seal, actuator_friction
from seal_friction_ros.core.friction.geometry import contact_length, projected_area, squeeze, stretch
from seal_friction_ros.core.friction.laws.physics_based import PhysicsBased
from seal_friction_ros.core.friction.laws.prior_art_chart import PriorArtChart
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import is_at_rest, state_friction
from seal_friction_ros.files import read_yaml, share_directory
from seal_friction_ros.offline.reports.bag_evaluation import BAND_95
from seal_friction_ros.offline.reports.bag_report import number, table, tiles, write_page
from seal_friction_ros.offline.reports.figures import (
    BLACK,
    BLUE,
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

THESIS_SEAL = 'ms28775_114'  # seals whose name starts with this are compared with the data of the thesis
STATE_PRESSURE = 500.0 * PSI  # [Pa] of Figures 22 and 23
STATE_VELOCITY = 5.0 * INCH  # [m/s] at the ends of Figure 22


@dataclass(frozen=True)
class ChartsSummary:
    """What was written, and the numbers in it."""

    page: Path
    figures: tuple[Path, ...]
    seal: str
    seal_count: int
    pressures: tuple[float, ...]
    """[Pa, gauge]"""
    coulomb_friction: tuple[float, ...]
    """[N] of all ``seal_count`` seals, at each of ``pressures``"""
    measured: tuple[float, ...]
    """[N] mean dynamic friction of the thesis's tests at each of ``pressures``; empty for another seal"""


@dataclass(frozen=True)
class Charted:
    """A seal, mounted as the charts show it."""

    seal: Seal
    mounted: tuple[MountedSeal, ...]
    is_thesis_seal: bool

    def friction(self, pressure: float, velocity: float = 0.0) -> ActuatorFriction:
        """Friction of the mounted seals, all under ``pressure`` [Pa, gauge], at ``velocity`` [m/s]."""
        return actuator_friction(self.mounted, pressure, pressure, velocity)

    @property
    def count_text(self) -> str:
        """Number of seals, in words."""
        return 'two seals' if len(self.mounted) == 2 else 'one seal'

    @property
    def state_pressure(self) -> float:
        """Pressure of the charts of the friction state [Pa]: the thesis's if the seal was identified there."""
        inside = self.seal.pressure_min <= STATE_PRESSURE <= self.seal.pressure_max
        return STATE_PRESSURE if inside else (self.seal.pressure_min + self.seal.pressure_max) / 2.0


def charted(seal: Seal) -> Charted:
    """Two seals under one pressure if the seal is the thesis's, as in its rig; else one."""
    is_thesis_seal = seal.name.startswith(THESIS_SEAL)
    mounted = tuple(MountedSeal(seal, chamber) for chamber in ('a', 'b' if is_thesis_seal else 'a'))
    return Charted(seal, mounted if is_thesis_seal else mounted[:1], is_thesis_seal)


def write_seal_charts(seal: Path, out: Path) -> ChartsSummary:
    """Write the charts of a seal file: a page, and each figure as PNG and SVG in ``<stem>_figures`` beside it.

    Args:
        seal: Seal file.
        out: HTML file; replaced if it is there.

    Raises:
        ValueError: The seal file cannot be read or makes no sense, or the page cannot be written.
    """
    try:
        shown = charted(parse_seal(document := read_yaml(seal)))
    except ValueError as error:
        raise ValueError(str(error) if str(error).startswith(str(seal)) else f'{seal}: {error}') from None
    with house_style():
        plots = seal_figures(shown)
        written = write_page(
            out, f'Seal {shown.seal.name}', lambda figure: _sections(shown, document, plots, figure), plots
        )
    pressures, measured = _compared(shown)
    frictions = tuple(shown.friction(pressure).coulomb_friction for pressure in pressures)
    return ChartsSummary(out, written, shown.seal.name, len(shown.mounted), pressures, frictions, measured)


# -- the data under the figures ---------------------------------------------------------------------------------------


def friction_over_velocity(shown: Charted, pressure: float, velocities: FloatArray) -> FloatArray:
    """State friction [N] at each velocity [m/s], with no force sum and a stick band of zero (Figure 22)."""
    frictions = []
    for v in velocities.tolist():
        acting = shown.friction(pressure, v)
        coulomb, sliding = acting.coulomb_friction, acting.coulomb_friction + acting.velocity_friction
        frictions.append(state_friction(v, 0.0, is_at_rest(v, False, 0.0, 0.0), sliding, coulomb).friction_force)
    return np.array(frictions)


def friction_over_force_sum(
    shown: Charted, pressure: float, force_sums: FloatArray, *, use_stiction: bool = False
) -> FloatArray:
    """State friction [N] of a rod at rest at each force sum [N] (Figure 23; with stiction, as measured)."""
    friction = shown.friction(pressure)
    breakaway = friction.coulomb_friction + (friction.stiction if use_stiction else 0.0)
    return np.array(
        [state_friction(0.0, f, True, friction.coulomb_friction, breakaway).friction_force for f in force_sums.tolist()]
    )


def thesis_table(name: str) -> dict[str, list[str]]:
    """Columns of a table in data/thesis."""
    path = share_directory('seal_friction_ros', __file__) / 'data' / 'thesis' / f'{name}.csv'
    with path.open(newline='', encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    return {column: [row[column] for row in rows] for column in rows[0]}


def _column(data: dict[str, list[str]], name: str, unit: float) -> FloatArray:
    return np.array([float(value) for value in data[name]]) * unit


def dynamic_readings() -> tuple[FloatArray, FloatArray]:
    """Pressure [Pa, gauge] and running friction of both seals [N] of the 66 readings of Tables A-1 to A-3."""
    data = thesis_table('friction_tests')
    dynamic = np.array([kind == 'dynamic' for kind in data['kind']])
    return _column(data, 'pressure_psig', PSI)[dynamic], _column(data, 'friction_lbf', LBF)[dynamic]


def _compared(shown: Charted) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Pressures [Pa] of the table, and the mean measured friction [N] at each if there is one."""
    if not shown.is_thesis_seal:
        steps = np.linspace(shown.seal.pressure_min, shown.seal.pressure_max, 11)
        return tuple(float(p) for p in steps), ()
    pressure, friction = dynamic_readings()
    levels = np.unique(pressure)
    return tuple(float(p) for p in levels), tuple(float(friction[pressure == p].mean()) for p in levels)


# -- figures ----------------------------------------------------------------------------------------------------------


def seal_figures(shown: Charted) -> list[Plot]:
    """Every chart that the laws of the seal allow."""
    law = shown.seal.coulomb_law
    plots = [model_figure(shown)]
    if isinstance(law, PhysicsBased):
        plots += [coefficient_figure(shown, law), normal_force_figure(shown, law)]
    plots += [sliding_figure(shown), rest_figure(shown)]
    if shown.is_thesis_seal:
        plots += [prior_art_figure(), prior_art_chart_figure()]
    elif isinstance(law, PriorArtChart):
        plots.append(own_chart_figure(shown, law))
    return plots


def _pressures(shown: Charted) -> FloatArray:
    return np.linspace(0.0, shown.seal.pressure_max, 201)


def coefficient_figure(shown: Charted, law: PhysicsBased) -> Plot:
    """Coefficient of friction over normal force (Figure 18)."""
    forces = np.array([law.normal_force_law.normal_force(p, law.projected_area) for p in _pressures(shown)])
    mu = np.array([law.friction_coefficient_law.coefficient_of_friction(f) for f in forces])
    unit, size = force_unit(float(forces[-1]))
    caption = 'Coefficient of dynamic friction over normal force (thesis, Figure 18), over the identified pressures.'
    verb = 'falls' if mu[-1] < mu[0] else 'does not fall'
    figure, ax = new_figure(f'Coefficient of friction {verb} as the seal is pressed harder', 3.8)
    ax.plot(forces / size, mu, color=BLUE, lw=1.8, label='law of the seal file')
    if shown.is_thesis_seal:
        table_4 = thesis_table('normal_force')
        pressures, normal = _column(table_4, 'pressure_psig', PSI), _column(table_4, 'normal_force_lbf', LBF)
        tested, friction = dynamic_readings()
        levels = np.unique(tested)
        # 250 and 750 psi were not tested: mean of the neighbours, as a straight line between them gives it.
        means = np.interp(pressures, levels, [friction[tested == p].mean() for p in levels]) / 2.0
        ax.plot(normal / size, means / normal, 'o', ms=6.5, color=BLACK, label='tests over finite elements (Figure 18)')
        caption += (
            ' The points are half the mean dynamic friction of Tables A-1 to A-3 of the thesis (one of two seals) over '
            'the normal force of its Table 4.'
        )
        if abs(forces[0] / normal[0] - 1.0) > 0.1:
            caption += (
                f' Without pressure the law has a normal force of {forces[0]:.1f} N and Table 4 one of '
                f'{normal[0]:.1f} N: the first point lies off the curve, but their products, the friction, agree.'
            )
    ax.set_ylim(bottom=0.0)
    ax.set_xlim(left=0.0)
    ax.set_xlabel(f'normal force of one seal [{unit}]')
    ax.set_ylabel('coefficient of dynamic friction [-]')
    legend_above(ax)
    return Plot(
        'fig18_coefficient_of_friction',
        figure,
        caption,
    )


def normal_force_figure(shown: Charted, law: PhysicsBased) -> Plot:
    """Normal over axial force (Figure 19)."""
    pressures = _pressures(shown)
    axial = pressures * law.projected_area
    normal = np.array([law.normal_force_law.normal_force(p, law.projected_area) for p in pressures])
    unit, size = force_unit(float(axial[-1]))
    gain = (normal[-1] - normal[0]) / (axial[-1] - axial[0])
    figure, ax = new_figure(f'Each newton of axial force presses the seal with {gain:.3g} N more', 3.8)
    ax.plot(axial / size, normal / size, color=BLUE, lw=1.8, label='law of the seal file')
    if shown.is_thesis_seal:
        table_4 = thesis_table('normal_force')
        points = _column(table_4, 'axial_force_lbf', LBF), _column(table_4, 'normal_force_lbf', LBF)
        ax.plot(points[0] / size, points[1] / size, 'o', ms=6.5, color=BLACK, label='finite elements (thesis, Table 4)')
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel(f'axial force of one seal, pressure times projected area [{unit}]')
    ax.set_ylabel(f'normal force of one seal [{unit}]')
    legend_above(ax)
    return Plot(
        'fig19_normal_force',
        figure,
        'Normal over axial force (thesis, Figure 19). The slope of a straight line through them is the area '
        'deformation gain; what is left without pressure comes from squeeze and stretch.',
    )


def model_figure(shown: Charted) -> Plot:
    """The model over pressure with the readings (Figure 24)."""
    pressures = _pressures(shown)
    frictions = [shown.friction(p) for p in pressures]
    coulomb = np.array([f.coulomb_friction for f in frictions])
    half = BAND_95 * np.array([f.coulomb_friction_std for f in frictions])
    stiction = frictions[0].stiction
    unit, size = force_unit(float(coulomb[-1]))
    figure, ax = new_figure(_model_title(shown), 4.4)
    band = f'95 % band (± {BAND_95} std)'
    ax.fill_between(
        pressures / BAR, (coulomb - half) / size, (coulomb + half) / size, color=SKY, alpha=0.3, lw=0, label=band
    )
    ax.plot(pressures / BAR, coulomb / size, color=BLUE, lw=1.8, label='Coulomb friction, model')
    ax.plot(pressures / BAR, (coulomb + stiction) / size, color=ORANGE, ls='--', label='breakaway force, model')
    if shown.is_thesis_seal:
        _draw_readings(ax, size)
    ax.set_ylim(bottom=0.0)
    ax.set_xlim(left=-0.01 * pressures[-1] / BAR)
    ax.set_xlabel('pressure [bar, gauge]')
    ax.set_ylabel(f'friction of {shown.count_text} [{unit}]')
    ax.legend(loc='upper left' if coulomb[-1] > coulomb[0] else 'best')
    return Plot(
        'fig24_model_over_pressure',
        figure,
        'Friction over pressure (thesis, Figure 24). '
        + (
            'Small marks are the 66 running readings of Tables A-1 to A-3 (darker where several coincide), large ones '
            'their means.'
            if shown.is_thesis_seal
            else 'The band is where 95 % of new readings are expected.'
        ),
    )


def _draw_readings(ax: Any, size: float) -> None:
    pressure, friction = dynamic_readings()
    levels = np.unique(pressure)
    means = np.array([friction[pressure == p].mean() for p in levels])
    ax.plot(pressure / BAR, friction / size, 'o', ms=4.0, color=BLACK, alpha=0.3, mew=0.0, label='readings, running')
    ax.plot(levels / BAR, means / size, 'o', ms=6.5, color=BLACK, mec='white', label='mean of the readings')


def _model_title(shown: Charted) -> str:
    pressures, measured = _compared(shown)
    if not measured:
        top = shown.seal.pressure_max
        return f'Coulomb friction reaches {shown.friction(top).coulomb_friction:.3g} N at {top / BAR:.3g} bar'
    off = [100.0 * (shown.friction(p).coulomb_friction / m - 1.0) for p, m in zip(pressures, measured, strict=True)]
    return f'Model and mean of the tests differ by {min(map(abs, off)):.1f} to {max(map(abs, off)):.1f} %'


def sliding_figure(shown: Charted) -> Plot:
    """Friction over velocity at one pressure (Figure 22)."""
    pressure = shown.state_pressure
    velocity = np.linspace(-STATE_VELOCITY, STATE_VELOCITY, 2001)
    friction = friction_over_velocity(shown, pressure, velocity)
    unit, size = force_unit(float(friction[-1]))
    where = 'at any speed' if not shown.seal.depends_on_velocity else f'at {STATE_VELOCITY * 1e3:.0f} mm/s'
    figure, ax = new_figure(f'Sliding: {friction[-1] / size:.3g} {unit} against the motion, {where}', 3.6)
    ax.plot(velocity / INCH, friction / size, color=BLUE, lw=1.8, drawstyle='steps-mid')
    _cross(ax)
    ax.set_xlabel('rod velocity [in/s]')
    ax.set_ylabel(f'friction of {shown.count_text} [{unit}]')
    above = ax.secondary_xaxis('top', functions=(_to_mm, _to_inch))
    above.set_xlabel('[mm/s]')
    return Plot(
        'fig22_state_1',
        figure,
        f'Friction state 1 (thesis, Figure 22): up to 5 in/s in both directions at {_pressure_text(pressure)}. '
        'Computed by the function of the live estimate with a stick band of zero, which is the equation of the thesis.',
    )


def _to_mm(inch: Any) -> Any:
    return inch * 25.4


def _to_inch(mm: Any) -> Any:
    return mm / 25.4


def rest_figure(shown: Charted) -> Plot:
    """Friction over force sum at rest (Figure 23)."""
    pressure = shown.state_pressure
    friction = shown.friction(pressure)
    coulomb = friction.coulomb_friction
    swept = np.linspace(-2.0 * coulomb, 2.0 * coulomb, 2001)
    unit, size = force_unit(coulomb)
    figure, ax = new_figure(f'At rest: the seals hold up to {coulomb / size:.3g} {unit}, and no more', 4.0)
    if friction.stiction > 0.0:
        held = friction_over_force_sum(shown, pressure, swept, use_stiction=True)
        ax.plot(swept / size, held / size, color=ORANGE, ls='--', label='with stiction, as measured at breakaway')
    held = friction_over_force_sum(shown, pressure, swept)
    ax.plot(swept / size, held / size, color=BLUE, lw=1.8, label='equation of the thesis')
    for threshold in (-coulomb, coulomb):
        ax.axvline(threshold / size, color=VERMILLION, lw=0.9, ls=':')
    _cross(ax)
    ax.set_xlabel(f'force sum [{unit}]')
    ax.set_ylabel(f'friction of {shown.count_text} [{unit}]')
    legend_above(ax)
    return Plot(
        'fig23_states_2_and_3',
        figure,
        f'Friction states 2 and 3 (thesis, Figure 23): rod at rest at {_pressure_text(pressure)}, force sum swept '
        'through both thresholds (dotted). Between them friction is the force sum and the rod is stuck; beyond, it is '
        'the threshold with the sign of the force sum.',
    )


def _cross(ax: Any) -> None:
    ax.axhline(0.0, color=GREY, lw=0.6, zorder=0)
    ax.axvline(0.0, color=GREY, lw=0.6, zorder=0)


def _pressure_text(pressure: float) -> str:
    return f'{pressure / BAR:.3g} bar ({pressure / PSI:.3g} psi)'


def prior_art_chart_figure() -> Plot:
    """Friction of one seal by the prior art (Figure 12)."""
    data = thesis_table('prior_art')
    pressure, friction = _column(data, 'pressure_psi', PSI), _column(data, 'F_lbf', LBF)
    figure, ax = new_figure('Prior art: friction of one seal read from charts', 3.6)
    ax.plot(pressure / BAR, friction, 'o-', color=VERMILLION, ms=5.0, label='Table 3')
    part = _column(data, 'F_H_lbf', LBF)
    ax.plot(pressure / BAR, part, 's--', color=ORANGE, ms=4.0, label='of it due to pressure')
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel('pressure [bar, gauge]')
    ax.set_ylabel('friction of one seal [N]')
    legend_above(ax)
    return Plot(
        'fig12_prior_art',
        figure,
        'Friction of one MS28775-114 seal by the prior art, f_c L_r + f_h A_r (thesis, Figure 12 and Table 3).',
    )


def prior_art_figure() -> Plot:
    """Prior art against the tests (Figure 17)."""
    data = thesis_table('prior_art')
    pressure, friction = _column(data, 'pressure_psi', PSI), 2.0 * _column(data, 'F_lbf', LBF)
    tested, readings = dynamic_readings()
    means = np.array([readings[tested == p].mean() for p in pressure])
    off = 100.0 * (friction / means - 1.0)
    figure, ax = new_figure(f'Prior art is {off.min():.0f} to {off.max():.0f} % above the tests', 4.0)
    ax.plot(pressure / BAR, friction, 'o-', color=VERMILLION, ms=5.0, label='prior art, doubled')
    _draw_readings(ax, 1.0)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel('pressure [bar, gauge]')
    ax.set_ylabel('friction of two seals [N]')
    ax.legend(loc='upper left')
    return Plot(
        'fig17_prior_art_and_tests',
        figure,
        'Prior art (Table 3, doubled for the two seals of the rig) against the running friction of Tables A-1 to A-3 '
        '(thesis, Figure 17).',
    )


def own_chart_figure(shown: Charted, law: PriorArtChart) -> Plot:
    """Friction of one seal by the charts of the seal file (as Figure 12)."""
    pressures = _pressures(shown)
    friction = np.array([law.coulomb_friction(p) for p in pressures])
    unit, size = force_unit(float(friction[-1]))
    figure, ax = new_figure('Friction of one seal read from charts', 3.6)
    ax.plot(pressures / BAR, friction / size, color=VERMILLION, lw=1.8)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel('pressure [bar, gauge]')
    ax.set_ylabel(f'friction of one seal [{unit}]')
    return Plot('fig12_prior_art', figure, 'Friction of one seal by the prior art, f_c L_r + f_h A_r.')


# -- the page ---------------------------------------------------------------------------------------------------------


def _sections(shown: Charted, document: Any, plots: list[Plot], figure: Callable[[str], str]) -> Iterable[str]:
    seal = shown.seal
    yield f'<h1>Seal {escape(seal.name)}</h1>'
    yield f'<p class="lead">{escape(str(document.get("source", "")))}</p>'
    yield _seal_tiles(seal)
    if not isinstance(seal.coulomb_law, PhysicsBased):
        yield (
            '<p class="note">This seal has the law of the prior art, which knows neither a normal force nor a '
            'coefficient of friction: there are no Figures 18 and 19.</p>'
        )
    if shown.state_pressure != STATE_PRESSURE:
        yield (
            '<p class="note">500 psi is outside the identified range: the friction state is shown at '
            f'{escape(_pressure_text(shown.state_pressure))}.</p>'
        )
    yield from (figure(plot.name) for plot in plots)
    yield '<h2>Numbers</h2>'
    yield _friction_table(shown)
    yield '<h2>Seal file</h2>'
    yield f'<pre>{escape(_as_text(document))}</pre>'


def _seal_tiles(seal: Seal) -> str:
    values = [
        ('identified pressure', f'{seal.pressure_min / BAR:.3g} to {seal.pressure_max / BAR:.3g} bar'),
        ('stiction of one seal', f'{seal.stiction:.3g} N'),
    ]
    law = seal.coulomb_law
    if isinstance(law, PhysicsBased | PriorArtChart):
        values += [
            ('squeeze', f'{100.0 * squeeze(law.geometry):.1f} %'),
            ('stretch', f'{100.0 * stretch(law.geometry):.1f} %'),
            ('projected area', f'{1e6 * projected_area(law.geometry):.4g} mm²'),
            ('contact length', f'{1e3 * contact_length(law.geometry):.4g} mm'),
        ]
    return tiles(values)


def _friction_table(shown: Charted) -> str:
    pressures, measured = _compared(shown)
    heads = ['pressure [bar]', '[psi]', f'Coulomb friction, {shown.count_text} [N]', 'std [N]', 'breakaway force [N]']
    heads += ['mean of the tests [N]', 'deviation [%]'] if measured else []
    rows = []
    for i, pressure in enumerate(pressures):
        friction = shown.friction(pressure)
        row = [
            number(pressure / BAR),
            number(pressure / PSI, 0),
            number(friction.coulomb_friction),
            number(friction.coulomb_friction_std),
            number(friction.coulomb_friction + friction.stiction),
        ]
        if measured:
            off = 100.0 * (friction.coulomb_friction / measured[i] - 1.0)
            row += [number(measured[i]), number(off, 1, signed=True)]
        rows.append(row)
    return table(heads, rows, ())


def _as_text(value: Any, indent: str = '') -> str:
    """Document of a seal file for a reader."""
    if not isinstance(value, dict):
        return str(value)
    lines = []
    for key, item in value.items():
        nested = isinstance(item, dict)
        lines.append(f'{indent}{key}:' + ('\n' if nested else ' ') + _as_text(item, indent + '  '))
    return '\n'.join(lines)
