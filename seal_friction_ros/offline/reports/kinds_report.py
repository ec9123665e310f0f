"""Report of an identification of several kinds of seals: what each rubs, and what the cylinder cannot tell apart."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.offline.identification.kinds import SeveralKinds, kinds_numbers
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports import verdicts
from seal_friction_ros.offline.reports.figure_style import Plot, finished, house_style
from seal_friction_ros.offline.reports.formatting import number
from seal_friction_ros.offline.reports.page import Columns, Table, head_of, table_of, write_page

_POINTS = 60  # of a curve


@house_style()
def write_kinds_report(result: SeveralKinds, files: Mapping[str, Path], out: Path) -> tuple[Path, ...]:
    """Write the report; result and errors as of `write_page`.

    Args:
        result: The identification.
        files: Kind -> its seal file.
        out: HTML file.
    """
    numbers = kinds_numbers(result)
    kinds, error = numbers['kinds'], float(numbers['cross_validation_error'])
    shares = [(kind['name'], kind['share'], kind['share_std']) for kind in kinds]
    return write_page(
        out,
        'kinds',
        [_left_out_figure(numbers), _kinds_figure(result, numbers)],
        verdict=verdicts.of_kinds(error, shares, [path.name for path in files.values()]),
        head=head_of('identify', ', '.join(file['name'] for file in numbers['data'][:3]), 'the data have no date'),
        warnings=numbers['warnings'],
        numbers=numbers,
        files=files,
        inside=_share_inside(numbers),
        kinds_table=_kinds_table(numbers),
        level_table=_level_table(numbers),
    )


def _share_inside(numbers: Mapping[str, Any]) -> float:
    """Share of the pressure levels whose mean is in the 95 % band of the prediction without them."""
    measured, left_out, std = (np.array(numbers[name]) for name in ('measured_N', 'left_out_N', 'std_N'))
    return float(np.mean(np.abs(measured - left_out) <= BAND_95 * std))


def _kinds_table(numbers: Mapping[str, Any]) -> Table:
    columns: Columns = (
        ('kind', lambda kind: kind['name']),
        ('seals on', lambda kind: ', '.join(kind['seal_chambers'])),
        ('law', lambda kind: kind['law'].partition(': ')[2]),
        ('friction [N]', lambda kind: number(kind['friction_N'])),
        ('of it rising with pressure [N]', lambda kind: number(kind['rising_N'])),
        ('standard error of that [N]', lambda kind: number(kind['rising_standard_error_N'])),
        ('share [%]', lambda kind: number(100.0 * kind['share'], 1)),
        ('std of the share [%]', lambda kind: number(100.0 * kind['share_std'], 1)),
    )
    return table_of(numbers['kinds'], columns, (0, 1, 2))


def _level_table(numbers: Mapping[str, Any]) -> Table:
    names = ('pressure_a_Pa', 'pressure_b_Pa', 'measured_N', 'fitted_N', 'std_N', 'left_out_N')
    columns: Columns = (
        ('chamber a [bar]', lambda row: number(row[0] / BAR)),
        ('chamber b [bar]', lambda row: number(row[1] / BAR)),
        ('measured [N]', lambda row: number(row[2])),
        ('laws [N]', lambda row: number(row[3])),
        ('std [N]', lambda row: number(row[4])),
        ('predicted unseen [N]', lambda row: number(row[5])),
        ('off [%]', lambda row: number(100.0 * (row[5] / row[2] - 1.0), 1, signed=True)),
    )
    return table_of(zip(*(numbers[name] for name in names), strict=True), columns)


def _left_out_figure(numbers: Mapping[str, Any]) -> Plot:
    """Measured friction over the prediction without it, at each level."""
    measured, left_out, std = (np.array(numbers[name]) for name in ('measured_N', 'left_out_N', 'std_N'))
    figure, ax = style.new_figure('Friction of all seals at pressures left out', 4.2)
    ends = np.array([0.0, 1.05 * max(measured.max(), left_out.max())])
    order = np.argsort(left_out)
    style.fill_band(ax, left_out[order], left_out[order], BAND_95 * std[order], label='95 % band')
    ax.plot(ends, ends, color=style.GREY, lw=1.0, label='equal')
    ax.plot(left_out, measured, 'o', color=style.BLUE, label='pressure level')
    return finished(
        'measured_over_left_out', figure, ax, xlabel='predicted without it [N]', ylabel='measured [N]', xlim=ends
    )


def _kinds_figure(result: SeveralKinds, numbers: Mapping[str, Any]) -> Plot:
    """Friction of each kind over the pressure that its seals see, as its seal file has it, with the 95 % band."""
    kinds = numbers['kinds']
    figure, axes = style.panels('Friction of each kind by its seal file', len(kinds), 3.2)
    for ax, kind in zip(axes, kinds, strict=True):
        seal = parse_seal(result.documents[kind['name']])
        lowest, highest = seal.pressure_min, seal.pressure_max
        pressure = np.linspace(lowest, highest, _POINTS)
        mounted = tuple(MountedSeal(seal, 'a') for _ in kind['seal_chambers'])
        found = [actuator_friction(mounted, float(p), 0.0, 0.0) for p in pressure]
        friction = np.array([one.coulomb_friction for one in found])
        std = np.array([one.coulomb_friction_std for one in found])
        style.fill_band(ax, pressure / BAR, friction, BAND_95 * std, label='95 % band')
        ax.plot(pressure / BAR, friction, color=style.BLUE, label='seal file')
        seen = np.array(kind['pressure_Pa'])
        ax.plot(seen / BAR, np.zeros_like(seen), 'o', color=style.ORANGE, ms=5.0, label='pressures driven')
        ax.set_title(f'{kind["name"]}: {", ".join(kind["seal_chambers"])}', pad=18.0)
    style.label_panels(axes, 'pressure at the seals [bar]', 'friction [N]')
    axes[0].set_ylim(bottom=-0.04 * axes[0].get_ylim()[1])
    return finished('friction_of_kinds', figure, axes[0])
