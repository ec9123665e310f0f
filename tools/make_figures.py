"""The figures of README and docs, from the data in this repository: ``make figures``."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from monitor_picture import draw_monitor
from section_picture import draw_sections

from seal_friction_ros.files import config_path
from seal_friction_ros.offline.bags.import_thesis import import_thesis
from seal_friction_ros.offline.commands.main import main as seal_friction
from seal_friction_ros.offline.contact.oring_runs import compute_case
from seal_friction_ros.offline.replay.replay import replay
from seal_friction_ros.offline.reports import figure_style as style
from seal_friction_ros.offline.reports.bag_report import write_report
from seal_friction_ros.offline.reports.oring_report import write_oring_report
from seal_friction_ros.offline.reports.seal_charts import write_seal_charts
from seal_friction_ros.offline.reports.servo_charts import write_servo_charts

FIGURES = Path(__file__).parents[1] / 'docs' / 'figures'

# -- picture of the architecture; places and sizes in inches, from the lower left corner -------------------------------

PICTURE = (4.4, 7.75)  # as wide as a phone shows it with text of 10 pixels
PICTURE_DPI = 220
DATA_BOXES = {  # text: x and y of the middle, width, height, colour
    'input topics\npressure, force sum,\nvelocity, reference': (1.05, 6.87, 1.75, 0.62, style.LIGHT_GREY),
    'bag (MCAP)\ninputs, answers,\nseal files, settings': (3.35, 6.87, 1.75, 0.62, style.LIGHT_GREY),
    'nodes\nfriction_estimator': (1.05, 5.97, 1.75, 0.46, style.ORANGE),
    'offline/replay': (3.35, 5.97, 1.75, 0.46, style.SKY),
    'core/estimation\nreceive(parameters, state, message, emit)': (2.2, 5.07, 4.05, 0.5, style.GREEN),
    'output topics\nfriction_estimate,\nfriction_feedforward': (1.05, 4.09, 1.75, 0.62, style.LIGHT_GREY),
    'replayed bytes\n= recorded bytes?': (3.35, 4.09, 1.75, 0.62, style.LIGHT_GREY),
}
DATA_ARROWS = (  # from, to, colour
    ((1.05, 6.55), (1.05, 6.22), style.VERMILLION),
    ((1.05, 5.73), (1.05, 5.34), style.VERMILLION),
    ((1.05, 4.81), (1.05, 4.42), style.VERMILLION),
    ((1.94, 6.09), (2.46, 6.65), style.VERMILLION),
    ((3.35, 6.55), (3.35, 6.22), style.BLUE),
    ((3.35, 5.73), (3.35, 5.34), style.BLUE),
    ((3.35, 4.81), (3.35, 4.42), style.BLUE),
)
CORE_ROOMS = (
    'tuning', 'servo, machine', 'estimation, identification,\noring_contact, lubrication', 'messages, friction',
    'foundation',
)  # fmt: skip
OFFLINE_ROOMS = ('commands', 'reports', 'identification, tuning,\ncontact, monitor', 'replay', 'bags', 'work')


def draw_architecture(path: Path) -> None:
    """Draw the two ways of data and the rooms of the package as a PNG."""
    with style.house_style():
        figure = Figure(figsize=PICTURE)
        ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        ax.set(xlim=(0.0, PICTURE[0]), ylim=(0.0, PICTURE[1]))
        ax.axis('off')

        def box(text: str, x: float, y: float, width: float, height: float, colour: str) -> None:
            """Draw a box with text around its middle."""
            corner, size = (x - width / 2.0, y - height / 2.0), {'width': width, 'height': height}
            edge = style.GREY if colour == style.LIGHT_GREY else colour
            ax.add_patch(
                FancyBboxPatch(corner, **size, boxstyle='round,pad=0,rounding_size=0.06', fc=f'{colour}40', ec=edge)
            )
            ax.text(x, y, text, ha='center', va='center', fontsize=7.6, linespacing=1.25)

        for text, x, y in (('Data', 0.15, 7.55), ('Rooms: a room imports from below only', 0.15, 3.51)):
            ax.text(x, y, text, fontsize=10, fontweight='bold', va='center')
        for text, x, colour in (('live', 1.05, style.VERMILLION), ('replay', 3.35, style.BLUE)):
            ax.text(x, 7.33, text, color=colour, fontsize=9, fontweight='bold', ha='center', va='center')
        ax.text(2.2, 5.87, 'recorder', color=style.VERMILLION, fontsize=7.2, ha='center', va='center')
        for text, place in DATA_BOXES.items():
            box(text, *place)
        for start, end, colour in DATA_ARROWS:
            ax.annotate('', xy=end, xytext=start, arrowprops={'arrowstyle': '-|>', 'color': colour, 'lw': 1.4})

        for x, top, ring, rooms, colour in (
            (1.05, 2.3, 'core', CORE_ROOMS, style.GREEN),
            (3.35, 2.97, 'offline', OFFLINE_ROOMS, style.SKY),
        ):
            ax.text(x, top + 0.11, ring, ha='center', va='center', fontsize=9, fontweight='bold')
            heights = [0.46 if '\n' in room else 0.33 for room in rooms]
            for i, room in enumerate(rooms):
                above = sum(heights[:i]) + 0.1 * i
                box(room, x, top - above - heights[i] / 2.0, 1.75, heights[i], colour)
        box('nodes', 1.05, 2.97, 1.75, 0.33, style.ORANGE)
        for start, end in (((1.05, 2.79), (1.05, 2.52)), ((2.45, 1.25), (1.95, 1.25))):
            ax.annotate('', xy=end, xytext=start, arrowprops={'arrowstyle': '-|>', 'color': style.GREY, 'lw': 1.4})
        figure.savefig(path, dpi=PICTURE_DPI, metadata={'Software': None})


def main() -> int:
    """Draw architecture, live view, replay of the pull test, charts of its seal, servo and lubricated contact."""
    FIGURES.mkdir(parents=True, exist_ok=True)
    draw_architecture(FIGURES / 'architecture.png')
    draw_monitor(FIGURES / 'monitor.png')
    draw_sections(FIGURES / 'seal_sections.png')
    rings = Path(__file__).parents[1] / 'test' / 'system' / 'oring_map.py'
    subprocess.run([sys.executable, str(rings), '--figure', str(FIGURES / 'ehl_oring.png')], check=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        import_thesis(folder / 'inputs')
        replay(folder / 'inputs', out=folder / 'pull_test')
        write_report(folder / 'pull_test', folder / 'report.html')
        write_seal_charts(config_path('seals', 'ms28775_114'), folder / 'seal.html')
        write_oring_report(compute_case(config_path('oring', 'ms28775_114')), folder / 'oring.html')
        write_servo_charts(folder / 'servo.html')
        for command, case, page in (
            ('run', 'inner_seal', 'inner'),
            ('run', 'inner_seal_groove', 'groove'),
            ('study', 'inner_seal', 'study'),
            ('map', 'inner_seal', 'map'),
        ):
            if seal_friction(['ehl', command, case, '--out', str(folder / f'{page}.html')]):
                raise SystemExit(f'seal_friction ehl {command} {case} failed')
        for source, target in {
            'report_figures/live_estimate.png': 'live_estimate.png',
            'seal_figures/fig23_states_2_and_3.png': 'friction_states.png',
            'oring_figures/contact_stress_profiles.png': 'oring_contact_stress.png',
            'oring_figures/deformed_shape.png': 'oring_shape.png',
            'groove_figures/friction_over_position.png': 'ehl_friction.png',
            'inner_figures/film.png': 'ehl_film.png',
            'study_figures/solid_shear_stress.png': 'ehl_study.png',
            'map_figures/friction_map.png': 'ehl_map.png',
            'servo_figures/fig25_servo_with_and_without_friction.png': 'fig25_servo_with_and_without_friction.png',
        }.items():
            shutil.copy(folder / source, FIGURES / target)
    return 0


if __name__ == '__main__':
    sys.exit(main())
