"""The figures of README and docs, from the data in this repository: ``make figures``."""

import shutil
import sys
import tempfile
from pathlib import Path

from seal_friction_ros.files import config_path
from seal_friction_ros.offline.bags.import_thesis import import_thesis
from seal_friction_ros.offline.commands.main import main as seal_friction
from seal_friction_ros.offline.contact.oring_runs import compute_case
from seal_friction_ros.offline.replay.replay import replay
from seal_friction_ros.offline.reports.bag_report import write_report
from seal_friction_ros.offline.reports.oring_report import write_oring_report
from seal_friction_ros.offline.reports.seal_charts import write_seal_charts
from seal_friction_ros.offline.reports.servo_charts import write_servo_charts

FIGURES = Path(__file__).parents[1] / 'docs' / 'figures'


def main() -> int:
    """Draw a replay of the pull test, charts of its seal, the servo and the lubricated contact; keep what is shown."""
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
        FIGURES.mkdir(parents=True, exist_ok=True)
        for source, target in {
            'report_figures/live_estimate.png': 'live_estimate.png',
            'report_figures/friction_over_pressure.png': 'friction_over_pressure.png',
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
