"""Three sections in their glands with the contact stress below: ``python tools/section_picture.py OUT.png``."""

import sys
from pathlib import Path

import numpy as np
from make_catalogue import OTHERS, other_document, ring_document
from matplotlib.collections import PolyCollection

from seal_friction_ros.core.foundation.units import BAR, MM, MPA
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.core.oring_contact.results import oring_results
from seal_friction_ros.offline.reports import figure_style as style

PRESSURE = 50 * BAR
HIGHEST = 6.0  # [MPa] of the colour scale: peaks at the corners of the cap lie above


@style.house_style()
def draw_sections(out: Path) -> None:
    """X-ring, U-cup and capped ring of the catalogue under 50 bar; the fluid is at the left."""
    documents = [ring_document('x_ring', '214', 'bore'), other_document(OTHERS[0]), other_document(OTHERS[-1])]
    figure, axes = style.new_figure(
        'Three seals under 50 bar', 5.4, nrows=2, ncols=3, sharex='col', height_ratios=(2, 1)
    )
    for (above, below), document in zip(axes.T, documents, strict=True):
        case = parse_oring_case(document).case
        (result,) = oring_results(case, (PRESSURE,))
        slides_on_rod = case.geometry.sliding_wall == 'rod'
        contact = result.rod if slides_on_rod else result.gland
        corners = result.shape.nodes[result.shape.elements][:, :, ::-1] / MM
        stress = result.shape.von_mises / MPA
        cells = PolyCollection(list(corners), array=stress, cmap='viridis', edgecolors='white', linewidths=0.15)
        cells.set_clim(0.0, HIGHEST)
        above.add_collection(cells)
        for radius in (case.geometry.rod_diameter / 2.0 / MM, case.geometry.gland_diameter / 2.0 / MM):
            above.axhline(radius, color=style.GREY, lw=1.5)
        above.axvline(float(result.shape.nodes[:, 1].max()) / MM, color=style.GREY, lw=1.5)
        above.set(title=f'{document["name"]}', aspect='equal', ylabel='radius [mm]')
        above.set_anchor('S')
        above.autoscale()
        above.grid(visible=False)
        place = np.concatenate(([contact.edges[0]], contact.position, [contact.edges[1]])) / MM
        pressure = np.concatenate(([0.0], contact.stress, [0.0])) / MPA
        below.fill_between(place, pressure, color=style.BLUE, alpha=0.3)
        below.plot(place, pressure, color=style.BLUE)
        below.axhline(PRESSURE / MPA, color=style.GREY, ls=':')
        below.set(ylim=(0.0, None), xlabel='axial position [mm]')
    axes[0, 0].set_ylabel('radius [mm]')
    figure.colorbar(cells, ax=axes[0].tolist(), label='von Mises stress [MPa]', extend='max', aspect=30)
    axes[1, 0].set_ylabel('contact stress on the\nsliding wall [MPa]')
    figure.savefig(out, dpi=130)


if __name__ == '__main__':
    draw_sections(Path(sys.argv[1]))
