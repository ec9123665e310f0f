"""A computed O-ring as one page: deformed shape, contact stress, normal over axial force, friction, and the thesis's.

Cases whose name starts with that of the thesis's seal are compared with its Appendix B.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import PolyCollection
from matplotlib.patches import Rectangle

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR, INCH, LBF, MM, MPA, PSI
from seal_friction_ros.core.friction.geometry import projected_area, squeeze, stretch
from seal_friction_ros.core.oring_contact.case import gland_fill
from seal_friction_ros.core.oring_contact.case_file import Measured
from seal_friction_ros.core.oring_contact.results import Contact, ContactResult
from seal_friction_ros.offline.contact.oring_runs import Computed, sliding_contact
from seal_friction_ros.offline.reports.bag_report import number, table, tiles, write_page
from seal_friction_ros.offline.reports.figures import (
    BLACK,
    BLUE,
    GREY,
    LIGHT_GREY,
    Plot,
    force_unit,
    house_style,
    legend_above,
    new_figure,
)
from seal_friction_ros.offline.reports.seal_charts import THESIS_SEAL, thesis_table

_COLUMNS = 3  # of panels


@dataclass(frozen=True)
class OringReport:
    """What was written."""

    page: Path
    figures: tuple[Path, ...]


class ThesisCase(NamedTuple):
    """One of Figures B-7 to B-11 of the thesis, in SI."""

    normal_force: float
    """sum over the cells [N]"""
    peak_stress: float
    """[Pa]"""
    width: float
    """[m]"""
    position: FloatArray
    """of the cells, from the upstream end of the contact [m]"""
    stress: FloatArray
    """[Pa]"""


def appendix_b() -> dict[float, ThesisCase]:
    """The thesis's cases by pressure [psi]."""
    cells, heads = thesis_table('fea_contact_stress'), thesis_table('normal_force')
    widths = dict(zip(heads['pressure_psig'], heads['contact_length_in'], strict=True))
    cases = {}
    for pressure, width in widths.items():
        rows = [i for i, value in enumerate(cells['pressure_psig']) if value == pressure]
        position, stress, force = (
            np.array([float(cells[name][i]) for i in rows])
            for name in ('node_position_in', 'contact_stress_psi', 'cell_force_lbf')
        )
        cases[float(pressure)] = ThesisCase(
            float(force.sum()) * LBF, float(stress.max()) * PSI, float(width) * INCH, position * INCH, stress * PSI
        )
    return cases


def thesis_case(computed: Computed, result: ContactResult) -> ThesisCase | None:
    """The thesis's case of the same seal and pressure, if there is one."""
    if not computed.file.case.name.startswith(THESIS_SEAL):
        return None
    psi = result.pressure / PSI
    return next((case for pressure, case in appendix_b().items() if abs(pressure - psi) < 0.5), None)


def numbers_text(computed: Computed) -> str:
    """The numbers of a case, for a terminal."""
    summary = computed.summary
    columns = (
        summary.pressure_Pa,
        summary.normal_force_N,
        summary.axial_force_N,
        summary.peak_contact_stress_Pa,
        summary.contact_width_m,
    )
    lines = [f'{summary.case}: on the {summary.sliding_wall}']
    lines += [
        f'  {pressure / BAR:8.2f} bar: normal force {normal:8.2f} N, axial force {axial:8.2f} N, '
        f'peak contact stress {peak / MPA:6.3f} MPa, contact width {width / MM:5.3f} mm'
        for pressure, normal, axial, peak, width in zip(*columns, strict=True)
    ]
    if summary.area_deformation_gain is not None and summary.radial_force_N is not None:
        lines.append(
            f'  area deformation gain {summary.area_deformation_gain:.4g}, F_rad of the line '
            f'{summary.radial_force_N:.4g} N'
        )
    return '\n'.join(lines)


def write_oring_report(computed: Computed, out: Path) -> OringReport:
    """Write the page of a computed case, and each figure as PNG and SVG in ``<stem>_figures`` beside it.

    Raises:
        ValueError: The page or a figure cannot be written.
    """
    with house_style():
        plots = oring_figures(computed)
        figures = write_page(
            out, f'O-ring: {computed.file.case.name}', lambda figure: _sections(computed, plots, figure), plots
        )
    return OringReport(out, figures)


# -- figures ----------------------------------------------------------------------------------------------------------


def oring_figures(computed: Computed) -> list[Plot]:
    """Every figure that the case allows."""
    plots = [shape_figure(computed), profile_figure(computed), walls_figure(computed)]
    if len(computed.results) > 1:
        plots.append(force_figure(computed))
    if computed.summary.friction_N and (len(computed.results) > 1 or computed.file.measured):
        plots.append(friction_figure(computed))
    return plots


def _panels(title: str, count: int, height: float, **layout: Any) -> tuple[Any, list[Any]]:
    columns = min(count, _COLUMNS)
    rows = -(-count // columns)
    figure, axes = new_figure(title, 0.6 + height * rows, nrows=rows, ncols=columns, squeeze=False, **layout)
    flat = list(axes.ravel())
    for ax in flat[count:]:
        ax.set_visible(False)
    return figure, flat[:count]


def shape_figure(computed: Computed) -> Plot:
    """Deformed section at each pressure, coloured by stress."""
    results = computed.results
    geometry = computed.file.case.geometry
    highest = max(float(result.shape.von_mises.max()) for result in results) / MPA
    figure, axes = _panels('The ring in its gland: von Mises stress', len(results), 2.5, sharex=True, sharey=True)
    rod, gland = geometry.rod_diameter / 2.0 / MM, geometry.gland_diameter / 2.0 / MM
    thick = 0.12 * (gland - rod)
    lowest_z = min(float(result.shape.nodes[:, 1].min()) for result in results) / MM - 2.0 * thick
    highest_z = max(float(result.shape.nodes[:, 1].max()) for result in results) / MM + 2.0 * thick
    for ax, result in zip(axes, results, strict=True):
        corners = result.shape.nodes[result.shape.elements][:, :, ::-1] / MM  # z to the right, r up
        cells = PolyCollection(
            list(corners), array=result.shape.von_mises / MPA, cmap='viridis', edgecolors='face', linewidths=0.2
        )
        cells.set_clim(0.0, highest)
        ax.add_collection(cells)
        steel: dict[str, Any] = {'facecolor': LIGHT_GREY, 'edgecolor': GREY, 'lw': 0.8, 'zorder': 0}
        ax.add_patch(Rectangle((lowest_z, rod - thick), highest_z - lowest_z, thick, **steel))
        ax.add_patch(Rectangle((lowest_z, gland), highest_z - lowest_z, thick, **steel))
        if result.wall.force > 0.0:
            wall = float(result.shape.nodes[:, 1].max()) / MM
            ax.add_patch(Rectangle((wall, rod), highest_z - wall, gland - rod, **steel))
        ax.set_aspect('equal')
        ax.set_xlim(lowest_z, highest_z)
        ax.set_ylim(rod - thick, gland + thick)
        ax.grid(visible=False)
        ax.set_title(_pressure_text(result.pressure))
    for ax in axes[-_COLUMNS:]:
        ax.set_xlabel('axial position [mm]')
        ax.tick_params(labelbottom=True)
    axes[0].set_ylabel('radius [mm]')
    if len(axes) > _COLUMNS:
        axes[_COLUMNS].set_ylabel('radius [mm]')
    bar = figure.colorbar(cells, ax=axes, shrink=0.6, pad=0.02)
    bar.set_label('von Mises stress [MPa]')
    return Plot(
        'deformed_shape',
        figure,
        'Half section of ring, rod (below), gland (above) and downstream wall (right), to scale; the fluid comes from '
        'the left. Colour: von Mises stress, mean of each element (thesis, Figures B-2 to B-6). Without pressure the '
        'ring is squeezed only and touches no wall.',
    )


def _line(contact: Contact) -> tuple[FloatArray, FloatArray]:
    """Positions from the first point of contact [m] and stresses [Pa], down to nothing at both ends."""
    first, last = contact.edges
    position = np.concatenate(([first], contact.position, [last])) - first
    return position, np.concatenate(([0.0], contact.stress, [0.0]))


def profile_figure(computed: Computed) -> Plot:
    """Contact stress along the wall the ring slides on (Figures B-7 to B-11)."""
    results = computed.results
    wall = computed.file.case.geometry.sliding_wall
    low, high = (sliding_contact(computed.file, result).peak_stress / MPA for result in (results[0], results[-1]))
    rise = f'rises from {low:.2f} to {high:.2f} MPa' if len(results) > 1 else f'is {low:.2f} MPa'
    title = f'The highest contact stress on the {wall} {rise}'
    figure, axes = _panels(title, len(results), 2.2, sharex=True, sharey=True)
    compared = False
    for ax, result in zip(axes, results, strict=True):
        position, stress = _line(sliding_contact(computed.file, result))
        ax.fill_between(position / MM, stress / MPA, color=BLUE, alpha=0.15, lw=0)
        ax.plot(position / MM, stress / MPA, color=BLUE, lw=1.8, label='this computation')
        if result.pressure > 0.0:
            ax.axhline(result.pressure / MPA, color=GREY, lw=0.9, ls=':', label='fluid pressure')
        thesis = thesis_case(computed, result)
        if thesis:
            compared = True
            ax.plot(thesis.position / MM, thesis.stress / MPA, 'o', ms=4.5, color=BLACK, label='thesis, cells')
        ax.set_title(_pressure_text(result.pressure))
    axes[0].set(xlim=(0.0, None), ylim=(0.0, None))  # of all: they share them
    for ax in axes[-_COLUMNS:]:
        ax.set_xlabel('from the upstream end [mm]')
        ax.tick_params(labelbottom=True)
    axes[0].set_ylabel('contact stress [MPa]')
    if len(axes) > _COLUMNS:
        axes[_COLUMNS].set_ylabel('contact stress [MPa]')
    handles, labels = axes[-1].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside lower right', ncols=3)
    return Plot(
        'contact_stress_profiles',
        figure,
        f'Contact stress between ring and {wall}, from the upstream end of the contact (thesis, Figures B-7 to B-11). '
        'Where it falls below the pressure of the fluid (dotted), the fluid enters: with a smooth transition, so that '
        'the fluid has a small share up to the crest and the line a small step there.'
        + (' Points: cells of the finite-element results of the thesis.' if compared else ''),
    )


def walls_figure(computed: Computed) -> Plot:
    """Contact stress along rod, gland and downstream wall."""
    results = computed.results
    figure, axes = new_figure('Contact stress on all three walls', 3.2, ncols=3, sharey=True)
    colours = colormaps['viridis'](np.linspace(0.0, 0.85, len(results)))
    for result, colour in zip(results, colours, strict=True):
        for ax, contact in zip(axes, (result.rod, result.gland, result.wall), strict=True):
            if len(contact.position):
                position, stress = _line(contact)
                ax.plot(
                    (contact.edges[0] + position) / MM,
                    stress / MPA,
                    color=colour,
                    label=f'{result.pressure / BAR:.3g} bar',
                )
    names = ('rod', 'gland', 'downstream wall') if computed.file.case.geometry.sliding_wall == 'rod' else (
        'groove (inner wall)', 'bore (outer wall)', 'downstream wall',
    )  # fmt: skip
    for ax, name, along in zip(axes, names, ('axial position', 'axial position', 'radius'), strict=True):
        ax.set_title(name)
        ax.set_xlabel(f'{along} [mm]')
        ax.set_ylim(bottom=0.0)
    axes[0].set_ylabel('contact stress [MPa]')
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside lower right', ncols=len(results))
    return Plot(
        'contact_stress_walls',
        figure,
        'Contact stress along each wall; downstream is to the right, in the last panel the axis '
        'of the rod to the left.',
    )


def force_figure(computed: Computed) -> Plot:
    """Normal against axial force (Figure 19)."""
    summary = computed.summary
    axial, normal = np.array(summary.axial_force_N), np.array(summary.normal_force_N)
    gain, radial = summary.area_deformation_gain or 0.0, summary.radial_force_N or 0.0
    unit, size = force_unit(float(axial.max()))
    figure, ax = new_figure(f'Area deformation gain: {gain:.3g} N of normal per N of axial force', 3.8)
    ends = np.array([0.0, axial.max()])
    ax.plot(ends / size, (gain * ends + radial) / size, color=BLUE, label='least-squares line')
    ax.plot(axial / size, normal / size, 'o', ms=6.5, color=BLUE, label='this computation')
    points = [(result, thesis_case(computed, result)) for result in computed.results]
    area = projected_area(computed.file.case.geometry)
    thesis = [(result.pressure * area, case.normal_force) for result, case in points if case]
    if thesis:
        x, y = np.array(thesis).T
        ax.plot(x / size, y / size, 's', ms=6.0, mfc='none', color=BLACK, label='thesis (Appendix B)')
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel(f'axial force [{unit}]')
    ax.set_ylabel(f'normal force [{unit}]')
    legend_above(ax)
    return Plot(
        'normal_over_axial_force',
        figure,
        'Normal force of one seal over axial force (thesis, Figure 19). The line is '
        f'F_n = {gain:.4g} F_ax + {radial:.4g} N.',
    )


def friction_figure(computed: Computed) -> Plot:
    """Friction from geometry and a coefficient of friction, beside the measured one."""
    summary, file = computed.summary, computed.file
    pressure, friction = np.array(summary.pressure_Pa), np.array(summary.friction_N or ())
    between = np.linspace(pressure[0], pressure[-1], 201)
    measured = file.measured
    title = 'Friction from geometry'
    if measured:
        off = friction_deviation(computed, measured)
        inside = off[np.isfinite(off)]
        if len(inside):
            title += f': {inside.min():+.0f} to {inside.max():+.0f} % off the measured one'
    figure, ax = new_figure(title, 3.8)
    ax.plot(between / BAR, _friction(computed, between), color=BLUE)
    ax.plot(pressure / BAR, friction, 'o', color=BLUE, label='from geometry')
    if measured:
        each = np.array(measured.frictions) / measured.seals
        ax.plot(np.array(measured.pressures) / BAR, each, 's', color=BLACK, ms=5.5, label='measured')
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel('pressure [bar, gauge]')
    ax.set_ylabel('sliding friction of one seal [N]')
    legend_above(ax)
    return Plot(
        'friction',
        figure,
        'Sliding friction mu(F_n) F_n of one seal from the computed normal force and the coefficient of friction of '
        'the case file' + (f', and measured ({measured.source}).' if measured else '.'),
    )


def _friction(computed: Computed, pressures: FloatArray) -> FloatArray:
    """Sliding friction [N] of one seal with the normal force straight between the computed ones; NaN outside them."""
    summary, friction = computed.summary, computed.file.friction
    if friction is None:
        return np.full(len(pressures), np.nan)
    slack = 1e-6 * summary.pressure_Pa[-1]  # rounding of the file does not count
    inside = (pressures >= summary.pressure_Pa[0] - slack) & (pressures <= summary.pressure_Pa[-1] + slack)
    normal = np.interp(pressures, summary.pressure_Pa, summary.normal_force_N)
    return np.where(inside, [friction.law.coefficient_of_friction(force) * force for force in normal], np.nan)


def friction_deviation(computed: Computed, measured: Measured) -> FloatArray:
    """Computed over measured friction at the measured pressures [%]; NaN outside the computed ones."""
    each = np.array(measured.frictions) / measured.seals
    off: FloatArray = 100.0 * (_friction(computed, np.array(measured.pressures)) / each - 1.0)
    return off


def _pressure_text(pressure: float) -> str:
    return f'{pressure / BAR:.3g} bar ({pressure / PSI:.0f} psi)'


# -- the page ---------------------------------------------------------------------------------------------------------


def _sections(computed: Computed, plots: Sequence[Plot], figure: Callable[[str], str]) -> Iterable[str]:
    case = computed.file.case
    yield f'<h1>O-ring {escape(case.name)}</h1>'
    yield f'<p class="lead">{escape(computed.file.source)}</p>'
    yield _tiles(computed)
    if case.wall_friction:
        yield f'<p class="note">Rod and gland hold the ring back with a friction of {case.wall_friction:g}.</p>'
    yield from (figure(plot.name) for plot in plots)
    yield '<h2>Numbers</h2>'
    yield _numbers_table(computed)
    yield from _comparison(computed)
    yield from _friction_table(computed)
    yield '<h2>How the numbers are made</h2>'
    yield _EXPLANATIONS


def _tiles(computed: Computed) -> str:
    case, summary = computed.file.case, computed.summary
    values = [
        ('squeeze of the free section', f'{100.0 * squeeze(case.geometry):.1f} %'),
        ('stretch', f'{100.0 * stretch(case.geometry):.1f} %'),
        ('fill of the gland', f'{100.0 * gland_fill(case.geometry, case.groove):.0f} %'),
        ('Young modulus', f'{case.rubber.elastic_modulus / MPA:.3g} MPa'),
    ]
    if summary.area_deformation_gain is not None and summary.radial_force_N is not None:
        values += [
            ('area deformation gain', f'{summary.area_deformation_gain:.4g}'),
            ('F_rad of the line', f'{summary.radial_force_N:.3g} N'),
        ]
    return tiles(values)


def _numbers_table(computed: Computed) -> str:
    area = projected_area(computed.file.case.geometry)
    heads = (
        'pressure [bar]', '[psi]', 'normal force [N]', 'on the other wall [N]', 'axial force [N]',
        'off pressure times area [%]', 'peak contact stress [MPa]', 'contact width [mm]', 'volume lost [%]',
        'Newton steps',
    )  # fmt: skip
    rows = []
    for result in computed.results:
        contact = sliding_contact(computed.file, result)
        other = result.gland if contact is result.rod else result.rod
        off = 100.0 * (result.axial_force / (result.pressure * area) - 1.0) if result.pressure else None
        rows.append(
            (
                number(result.pressure / BAR),
                number(result.pressure / PSI, 0),
                number(contact.force),
                number(other.force),
                number(result.axial_force),
                number(off, 3, signed=True),
                number(contact.peak_stress / MPA, 3),
                number(contact.width / MM, 3),
                number(100.0 * (1.0 - result.volume_ratio), 3),
                result.newton_steps,
            )
        )
    return table(heads, rows, ())


def _comparison(computed: Computed) -> Iterable[str]:
    pairs = [(result, thesis_case(computed, result)) for result in computed.results]
    rows = []
    for result, thesis in pairs:
        if thesis:
            contact = sliding_contact(computed.file, result)
            rows.append(
                [number(result.pressure / PSI, 0)]
                + [
                    cell
                    for own, its, size, digits in (
                        (contact.force, thesis.normal_force, LBF, 2),
                        (contact.peak_stress, thesis.peak_stress, PSI, 1),
                        (contact.width, thesis.width, INCH, 4),
                    )
                    for cell in (
                        number(own / size, digits),
                        number(its / size, digits),
                        number(100.0 * (own / its - 1.0), 1, signed=True),
                    )
                ]
            )
    if rows:
        heads = ['pressure [psi]']
        for name in ('normal force [lbf]', 'peak contact stress [psi]', 'contact width [in]'):
            heads += [name, 'thesis', 'off [%]']
        yield '<h2>Against Appendix B of the thesis</h2>'
        yield table(heads, rows, ())
        yield (
            '<p>The 0 psi case of the thesis does not agree with itself: its peak and width with the profile of Hertz '
            'would carry 5.5 lbf, not 4.1.</p>'
        )


def _friction_table(computed: Computed) -> Iterable[str]:
    measured = computed.file.measured
    if measured is None or not computed.summary.friction_N:
        return
    off = friction_deviation(computed, measured)
    rows = []
    for pressure, friction, deviation in zip(measured.pressures, measured.frictions, off, strict=True):
        each = friction / measured.seals
        percent = float(deviation) if np.isfinite(deviation) else None
        own = None if percent is None else each * (1.0 + percent / 100.0)
        rows.append((number(pressure / BAR), number(each), number(own), number(percent, 1, signed=True)))
    yield '<h2>Friction of one seal</h2>'
    yield table(('pressure [bar]', 'measured [N]', 'from geometry [N]', 'off [%]'), rows, ())


_EXPLANATIONS = """<dl>
<dt>Model</dt>
<dd>Axisymmetric finite elements (bilinear, mean dilatation), nearly incompressible Mooney-Rivlin rubber, large
deformations; rod, gland and downstream wall rigid and, unless the case says otherwise, frictionless. The ring is
squeezed from its free shape, put against the wall, and the pressure raised in steps; each is an equilibrium to 1e-9, or
an error.</dd>
<dt>Contact and fluid</dt>
<dd>The surface bears the larger of fluid pressure (upstream side) and contact stress, so the fluid enters wherever the
contact stress falls below its pressure; the transition is smooth, its width the share "transition" of the Young
modulus. Contact stress is what the wall bears beyond the fluid's share.</dd>
<dt>Normal force</dt>
<dd>Contact stress over the area of the wall the ring slides on, all around the rod (thesis, chapter 4.2).</dd>
<dt>Axial force</dt>
<dd>Axial component of everything that presses on the downstream side of the ring, less what tilted facets of the mesh
on rod and gland add: as a check beside pressure times projected area.</dd>
<dt>Contact width</dt>
<dd>From the outermost nodes in contact, carried on by the root law of the edge of Hertz, one node spacing at most.</dd>
<dt>Area deformation gain and F_rad</dt>
<dd>Slope and intercept of the least-squares line through normal over axial force (thesis, chapter 6.2 and Figure 19).
The normal force without pressure stands in the table, it is not F_rad of the line.</dd>
<dt>What it leaves out</dt>
<dd>Friction in the contact (unless given), creep, swelling and temperature of the rubber, the clearance behind the
downstream wall, and rounded edges of the groove.</dd>
</dl>"""
