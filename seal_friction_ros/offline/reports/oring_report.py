"""Report of a computed O-ring: deformed shape, contact stress, normal force and friction.

Cases of the seal of the thesis are compared with its Appendix B.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.patches import Rectangle

from seal_friction_ros.core.estimation.findings import GOOD, Verdict, between, percent, worst
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.units import BAR, INCH, LBF, MM, MPA, PSI, UM
from seal_friction_ros.core.friction.geometry import projected_area, squeeze, stretch
from seal_friction_ros.core.oring_contact.oring_case import gland_fill
from seal_friction_ros.core.oring_contact.oring_case_file import MeasuredFriction
from seal_friction_ros.core.oring_contact.results import OringResult, WallContact
from seal_friction_ros.core.oring_contact.ring_friction import DISCRETISATION
from seal_friction_ros.offline.contact.oring_runs import Computed, sliding_contact
from seal_friction_ros.offline.contact.uncertainty import Uncertainty
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.formatting import force_unit, number, pressure_text
from seal_friction_ros.offline.reports.page import Columns, Table, head_of, table_of, write_page
from seal_friction_ros.offline.reports.thesis_data import THESIS_SEAL, ThesisContact, appendix_b
from seal_friction_ros.offline.reports.uncertainty_tables import uncertainty_values


def thesis_case(computed: Computed, result: OringResult) -> ThesisContact | None:
    """Contact of the same seal at the same pressure in the thesis, if there is one."""
    if not computed.file.case.name.startswith(THESIS_SEAL):
        return None
    psi = result.pressure / PSI
    return next((case for pressure, case in appendix_b().items() if abs(pressure - psi) < 0.5), None)


def numbers_text(computed: Computed) -> str:
    """The numbers of a case, for a terminal."""
    summary = computed.summary
    lines = [f'{summary.case}: on the {summary.sliding_wall}']
    lines += [
        f'  {one.pressure / BAR:8.2f} bar: normal force {wall.force:8.2f} N, axial force {one.axial_force:8.2f} N, '
        f'peak contact stress {wall.peak_stress / MPA:6.3f} MPa, contact width {wall.width / MM:5.3f} mm'
        for one in computed.results
        for wall in [sliding_contact(computed.file.case, one)]
    ]
    if summary.area_deformation_gain is not None and summary.radial_force_N is not None:
        lines.append(
            f'  area deformation gain {summary.area_deformation_gain:.4g}, F_rad of the line '
            f'{summary.radial_force_N:.4g} N'
        )
    if summary.friction_N is not None:
        lines.append(_friction_text(computed, summary.friction_N))
    films = zip(summary.pressure_Pa, summary.film_out_m, summary.film_back_m, summary.leakage_m3_per_m, strict=False)
    lines += [_film_text(*film) for film in films]
    if computed.mesh is not None:
        lines.append(f'  {computed.mesh.text}')
    return '\n'.join(lines)


def _friction_text(computed: Computed, frictions: Sequence[float]) -> str:
    """Friction of one seal in one line, and how far it may be off."""
    summary = computed.summary
    text = f'  friction of one seal {", ".join(f"{friction:.3g}" for friction in frictions)} N'
    if summary.shear_stress_Pa is not None and summary.knee_stress_Pa is not None:
        text += f', shear stress {summary.shear_stress_Pa / MPA:.3g} MPa, knee {summary.knee_stress_Pa / MPA:.3g} MPa'
    text += f', relative_std {summary.friction_relative_std:.2g}'
    if computed.task.readings:
        largest = max(map(abs, summary.reading_deviations))
        return f'{text}; {len(computed.task.readings)} readings, within {100.0 * largest:.1f} %'
    return f'{text}; a --reading makes it your seal'


def _film_text(pressure: float, out: float | None, back: float | None, leakage: float | None) -> str:
    text = f'  {pressure / BAR:8.2f} bar: film of a smooth seal'
    if out is None or back is None or leakage is None:
        return f'{text}: unknown, a lip ends at a corner or has too few nodes for its edge: more --lines'
    return f'{text} {out / UM:.3g} um out, {back / UM:.3g} um back, leakage {leakage / MM**3:.3g} mm3 per m of stroke'


@house_style()
def write_oring_report(computed: Computed, out: Path, uncertainty: Uncertainty | None = None) -> tuple[Path, ...]:
    """Write the report of a computed case, with the ``uncertainty`` of its force from samples; see `write_page`."""
    case, readings = computed.file.case, len(computed.task.readings)
    measured = f'computed, readings: {readings}' if readings else 'computed, no measured data'
    return write_page(
        out,
        'oring',
        oring_figures(computed),
        verdict=_verdict(computed),
        head=head_of(f'{"oring" if case.section is None else "section"} {case.name}', measured, case.name),
        mesh_text=computed.mesh.text if computed.mesh else '',
        mesh_table=_mesh_table(computed),
        file=computed.file,
        case=case,
        summary=computed.summary,
        squeeze=squeeze(case.geometry),
        stretch=stretch(case.geometry),
        gland_fill=gland_fill(case.geometry, case.groove, case.section),
        number_table=_number_table(computed),
        thesis_table=_thesis_table(computed),
        friction_table=_friction_table(computed),
        film_table=_film_table(computed),
        **uncertainty_values(uncertainty, computed.file.unknown),
    )


def _verdict(computed: Computed) -> Verdict:
    """By the largest deviation of the axial force from pressure times area, and the largest loss of volume [-]."""
    summary = computed.summary
    balance = max((abs(_unbalanced(computed, result) or 0.0) for result in computed.results), default=0.0)
    lost = max(abs(1.0 - result.volume_ratio) for result in computed.results)
    pairs = zip(summary.normal_force_N, summary.pressure_Pa, strict=True)
    first, *others = (f'{force:.3g} N at {pressure / BAR:.3g} bar' for force, pressure in pairs)
    span = ' to '.join([first, *others[-1:]])
    text = f'Normal force {span}; forces balance within {percent(balance)}, volume within {percent(lost)}.'
    level = worst([between(balance, 0.02, 0.1), between(lost, 0.01, 0.03)])
    if level != GOOD:
        return Verdict(level, text, 'compute with more lines (numerics.lines of the case) and compare.')
    if not summary.friction_N:
        return Verdict(level, text, 'add a coefficient of friction to the case for friction.')
    if computed.task.readings:
        return Verdict(level, text, 'compare a reading at another pressure.')
    return Verdict(level, text, 'measure a few readings and compare: the modulus decides.')


_ON_OTHER_MESHES = {
    'normal_force_N': 'normal force',
    'wall_force_N': 'all wall stress',
    'peak_contact_stress_Pa': 'peak contact stress',
    'contact_width_m': 'contact width',
    'friction_N': 'friction',
    'film_out_m': 'film out',
    'film_back_m': 'film back',
}


# -- tables -----------------------------------------------------------------------------------------------------------


def _unbalanced(computed: Computed, result: OringResult) -> float | None:
    """Axial force over pressure times area, less 1; None without pressure."""
    area = projected_area(computed.file.case.geometry)
    return result.axial_force / (result.pressure * area) - 1.0 if result.pressure else None


def _number_table(computed: Computed) -> Table:
    def slides(result: OringResult) -> WallContact:
        return sliding_contact(computed.file.case, result)

    columns: Columns = (
        ('pressure [bar]', lambda one: number(one.pressure, unit=BAR)),
        ('[psi]', lambda one: number(one.pressure, 0, unit=PSI)),
        ('normal force [N]', lambda one: number(slides(one).force)),
        ('all wall stress [N]', lambda one: number(slides(one).wall_force)),
        ('other wall [N]', lambda one: number((one.gland if slides(one) is one.rod else one.rod).force)),
        ('axial force [N]', lambda one: number(one.axial_force)),
        ('off pressure times area [%]', lambda one: number(_unbalanced(computed, one), 3, unit=0.01, signed=True)),
        ('peak contact stress [MPa]', lambda one: number(slides(one).peak_stress, 3, unit=MPA)),
        ('contact width [mm]', lambda one: number(slides(one).width, 3, unit=MM)),
        ('volume lost [%]', lambda one: number(1.0 - one.volume_ratio, 3, unit=0.01)),
        ('Newton steps', lambda one: one.newton_steps),
    )
    return table_of(computed.results, columns)


def _mesh_table(computed: Computed) -> Table:
    """Change of the numbers on other meshes, marked where it is large; no rows for one mesh."""
    if computed.mesh is None:
        return Table((), [])
    changes = computed.mesh.change
    heads = {name: text for name, text in _ON_OTHER_MESHES.items() if name in changes}
    rows = [
        (number(pressure, unit=BAR), *(_changed(changes[name][i]) for name in heads))
        for i, pressure in enumerate(computed.summary.pressure_Pa)
    ]
    return Table(('pressure [bar]', *(f'{text} [%]' for text in heads.values())), rows)


def _changed(change: float) -> str:
    return number(change, 2, unit=0.01) + (' *' if change > DISCRETISATION else '')


def _thesis_table(computed: Computed) -> Table:
    """Comparison with Appendix B of the thesis; no rows if there is nothing to compare."""
    heads = ['pressure [psi]']
    for name in ('normal force [lbf]', 'peak contact stress [psi]', 'contact width [in]'):
        heads += [name, 'thesis', 'off [%]']
    rows = []
    for result in computed.results:
        thesis = thesis_case(computed, result)
        if thesis is not None:
            contact = sliding_contact(computed.file.case, result)
            row = [number(result.pressure / PSI, 0)]
            for own, expected, size, digits in (
                (contact.force, thesis.normal_force, LBF, 2),
                (contact.peak_stress, thesis.peak_stress, PSI, 1),
                (contact.width, thesis.width, INCH, 4),
            ):
                off = 100.0 * (own / expected - 1.0)
                row += [number(own / size, digits), number(expected / size, digits), number(off, 1, signed=True)]
            rows.append(row)
    return Table(heads, rows)


def _friction_table(computed: Computed) -> Table:
    """Friction of one seal, measured and from geometry; no rows without a measurement or a law."""
    heads = ('pressure [bar]', 'measured [N]', 'from geometry [N]', 'off [%]')
    measured = computed.file.measured
    if measured is None or not computed.summary.friction_N:
        return Table(heads, ())
    each, off = np.array(measured.frictions) / measured.seals, friction_deviation(computed, measured)
    columns = (measured.pressures, each.tolist(), (each * (1.0 + off / 100.0)).tolist(), off.tolist())
    rows = zip(*columns, strict=True)
    return Table(heads, [(number(p / BAR), number(m), number(own), number(o, 1, signed=True)) for p, m, own, o in rows])


def _film_table(computed: Computed) -> Table:
    """Film of each direction; no rows without a fluid."""
    summary = computed.summary
    films = zip(summary.pressure_Pa, summary.film_out_m, summary.film_back_m, summary.leakage_m3_per_m, strict=False)
    columns: Columns = (
        ('pressure [bar]', lambda row: number(row[0], unit=BAR)),
        ('film out [um]', lambda row: number(row[1], 3, unit=UM)),
        ('film back [um]', lambda row: number(row[2], 3, unit=UM)),
        ('leakage [mm3 per m of stroke]', lambda row: number(row[3], 2, unit=MM**3)),
    )
    return table_of(list(films), columns)


def geometry_friction(computed: Computed, pressures: FloatArray) -> FloatArray:
    """Sliding friction of one seal [N] at pressures [Pa, gauge], shape (n,); NaN outside the computed ones."""
    summary, law = computed.summary, computed.friction_law
    if summary.friction_N is None:
        return np.full(len(pressures), np.nan)
    slack = 1e-6 * summary.pressure_Pa[-1]  # rounding of the file does not count
    inside = (pressures >= summary.pressure_Pa[0] - slack) & (pressures <= summary.pressure_Pa[-1] + slack)
    found = summary.friction_N if law is None else [law.coulomb_friction(p) for p in pressures.clip(0.0).tolist()]
    return np.where(inside, found, np.nan)


def friction_deviation(computed: Computed, measured: MeasuredFriction) -> FloatArray:
    """Computed over measured friction at the measured pressures [%]; NaN outside the computed pressures."""
    each = np.array(measured.frictions) / measured.seals
    off: FloatArray = 100.0 * (geometry_friction(computed, np.array(measured.pressures)) / each - 1.0)
    return off


# -- figures ----------------------------------------------------------------------------------------------------------


def oring_figures(computed: Computed) -> list[Plot]:
    """Every figure that the case allows."""
    plots = [section_figure(computed), profile_figure(computed), walls_figure(computed)]
    if len(computed.results) > 1:
        plots.append(axial_force_figure(computed))
    if computed.summary.friction_N and (len(computed.results) > 1 or computed.file.measured):
        plots.append(geometry_friction_figure(computed))
    return plots


def section_figure(computed: Computed) -> Plot:
    """Deformed section at each pressure, coloured by stress (as Figures B-2 to B-6)."""
    results, geometry = computed.results, computed.file.case.geometry
    highest = max(float(result.shape.von_mises.max()) for result in results) / MPA
    figure, axes = style.panels('The ring in its gland: von Mises stress', len(results), 2.5)
    rod, gland = geometry.rod_diameter / 2.0 / MM, geometry.gland_diameter / 2.0 / MM
    thick = 0.12 * (gland - rod)
    along = np.concatenate([result.shape.nodes[:, 1] for result in results]) / MM
    first, last = float(along.min()) - 2.0 * thick, float(along.max()) + 2.0 * thick
    for ax, result in zip(axes, results, strict=True):
        corners = result.shape.nodes[result.shape.elements][:, :, ::-1] / MM  # z to the right, r up
        look: dict[str, Any] = {'cmap': 'viridis', 'edgecolors': 'face', 'linewidths': 0.2}
        cells = PolyCollection(list(corners), array=result.shape.von_mises / MPA, **look)
        cells.set_clim(0.0, highest)
        ax.add_collection(cells)
        walls = [(first, rod - thick, last - first, thick), (first, gland, last - first, thick)]
        if result.wall.force > 0.0:
            wall = float(result.shape.nodes[:, 1].max()) / MM
            walls.append((wall, rod, last - wall, gland - rod))
        for left, bottom, width, height in walls:
            steel: dict[str, Any] = {'facecolor': style.LIGHT_GREY, 'edgecolor': style.GREY, 'lw': 0.8, 'zorder': 0}
            ax.add_patch(Rectangle((left, bottom), width, height, **steel))
        ax.set_aspect('equal')
        ax.set(xlim=(first, last), ylim=(rod - thick, gland + thick), title=pressure_text(result.pressure))
        ax.grid(visible=False)
    style.label_panels(axes, 'axial position [mm]', 'radius [mm]')
    figure.colorbar(cells, ax=axes, shrink=0.6, pad=0.02, label='von Mises stress [MPa]')
    return Plot('deformed_shape', figure)


def _closed_profile(contact: WallContact) -> tuple[FloatArray, FloatArray]:
    """Positions from the first point of contact [m] and stresses [Pa], with the zeros at both ends."""
    first, last = contact.edges
    position = np.concatenate(([first], contact.position, [last])) - first
    return position, np.concatenate(([0.0], contact.stress, [0.0]))


def profile_figure(computed: Computed) -> Plot:
    """Contact stress along the sliding wall (as Figures B-7 to B-11)."""
    results, peaks = computed.results, computed.summary.peak_contact_stress_Pa
    rise = f'is {peaks[0] / MPA:.2f} MPa'
    if len(results) > 1:
        rise = f'rises from {peaks[0] / MPA:.2f} to {peaks[-1] / MPA:.2f} MPa'
    title = f'Peak contact stress on the {computed.file.case.geometry.sliding_wall} {rise}'
    figure, axes = style.panels(title, len(results), 2.2)
    for ax, result in zip(axes, results, strict=True):
        position, stress = _closed_profile(sliding_contact(computed.file.case, result))
        ax.fill_between(position / MM, stress / MPA, color=style.BLUE, alpha=0.15, lw=0)
        ax.plot(position / MM, stress / MPA, color=style.BLUE, lw=1.8, label='this computation')
        if result.pressure > 0.0:
            ax.axhline(result.pressure / MPA, color=style.GREY, lw=0.9, ls=':', label='fluid pressure')
        thesis = thesis_case(computed, result)
        if thesis is not None:
            x, y = thesis.position / MM, thesis.stress / MPA
            ax.plot(x, y, 'o', ms=4.5, color=style.BLACK, label='thesis, cells')
        ax.set_title(pressure_text(result.pressure))
    axes[0].set(xlim=(0.0, None), ylim=(0.0, None))  # the others share these axes
    style.label_panels(axes, 'from the upstream end [mm]', 'contact stress [MPa]')
    style.legend_below(figure, axes[-1], 3)
    return Plot('contact_stress_profiles', figure)


def walls_figure(computed: Computed) -> Plot:
    """Contact stress along rod, gland and downstream wall."""
    results = computed.results
    figure, axes = style.new_figure('Contact stress on all three walls', 3.2, ncols=3, sharey=True)
    looks = style.shades([f'{result.pressure / BAR:.3g} bar' for result in results])
    for result, look in zip(results, looks, strict=True):
        for ax, contact in zip(axes, (result.rod, result.gland, result.wall), strict=True):
            if len(contact.position):
                position, stress = _closed_profile(contact)
                ax.plot((contact.edges[0] + position) / MM, stress / MPA, **look)
    is_rod = computed.file.case.geometry.sliding_wall == 'rod'
    names = ('rod', 'gland') if is_rod else ('groove (inner wall)', 'bore (outer wall)')
    for ax, name in zip(axes, (*names, 'downstream wall'), strict=True):
        ax.set(title=name, xlabel='axial position [mm]', ylim=(0.0, None))
    axes[2].set_xlabel('radius [mm]')
    axes[0].set_ylabel('contact stress [MPa]')
    style.legend_below(figure, axes[0], len(results))
    return Plot('contact_stress_walls', figure)


def axial_force_figure(computed: Computed) -> Plot:
    """Normal against axial force (as Figure 19)."""
    summary = computed.summary
    axial, normal = np.array(summary.axial_force_N), np.array(summary.normal_force_N)
    gain, radial = summary.area_deformation_gain or 0.0, summary.radial_force_N or 0.0
    unit, size = force_unit(float(axial.max()))
    figure, ax = style.new_figure(f'Area deformation gain: {gain:.3g} N of normal per N of axial force', 3.8)
    ends = np.array([0.0, axial.max()])
    ax.plot(ends / size, (gain * ends + radial) / size, color=style.BLUE, label='least-squares line')
    ax.plot(axial / size, normal / size, 'o', ms=6.5, color=style.BLUE, label='this computation')
    area = projected_area(computed.file.case.geometry)
    pairs = [(result.pressure * area, thesis_case(computed, result)) for result in computed.results]
    thesis = [(force, case.normal_force) for force, case in pairs if case is not None]
    if thesis:
        x, y = np.array(thesis).T
        ax.plot(x / size, y / size, 's', ms=6.0, mfc='none', color=style.BLACK, label='thesis (Appendix B)')
    labels = {'xlabel': f'axial force [{unit}]', 'ylabel': f'normal force [{unit}]'}
    return finished('normal_over_axial_force', figure, ax, ylim=(0.0, None), **labels)


def geometry_friction_figure(computed: Computed) -> Plot:
    """Friction from geometry and a law, beside the measured friction."""
    summary, measured = computed.summary, computed.file.measured
    pressure, friction = np.array(summary.pressure_Pa), np.array(summary.friction_N or ())
    title = 'Friction from geometry'
    off = friction_deviation(computed, measured) if measured else np.zeros(0)
    if np.isfinite(off).any():
        title += f': {np.nanmin(off):+.0f} to {np.nanmax(off):+.0f} % off the measured friction'
    figure, ax = style.new_figure(title, 3.8)
    between = np.linspace(pressure[0], pressure[-1], 201)
    ax.plot(between / BAR, geometry_friction(computed, between), color=style.BLUE)
    ax.plot(pressure / BAR, friction, 'o', color=style.BLUE, label='from geometry')
    if measured:
        each = np.array(measured.frictions) / measured.seals
        ax.plot(np.array(measured.pressures) / BAR, each, 's', color=style.BLACK, ms=5.5, label='measured')
    labels = {'xlabel': 'pressure [bar, gauge]', 'ylabel': 'sliding friction of one seal [N]'}
    return finished('friction', figure, ax, ylim=(0.0, None), **labels)
