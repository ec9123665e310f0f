"""Every row of a damaged log is used, or left out with a reason, in the JSON of ``identify`` and of ``import log``."""

import json

import numpy as np
import pytest
from harness.identify_run import Run

from seal_friction_ros.offline.commands.main import main

RIG = """name: rig
source: simulated
frame_id: rod
header: row
start: 1.0
time: {column_name: t, unit: s}
chamber_a: {terms: [{column_name: p, unit: bar}]}
chamber_b: {constant: 0.0}
force_sum: {terms: [{column_name: f, unit: N}]}
velocity: {terms: [{column_name: v, unit: m/s}]}
"""
DAMAGE = ('word', 'empty', 'nan', 'short', 'same time', 'back in time')


def rows() -> list[list[str]]:
    """Strokes of 2 s out and back, with rests between, at four pressures; 50 Hz."""
    rng, found = np.random.default_rng(0), []
    for bar in (1.0, 3.0, 5.0, 7.0):
        for velocity in (0.02, 0.0, -0.02, 0.0) * 3:
            for _ in range(100 if velocity else 20):
                force = np.sign(velocity) * (4.0 + 0.6 * bar) * (1.0 + 0.01 * rng.normal()) + 1.0
                found.append([f'{0.02 * len(found):.2f}', f'{bar}', f'{velocity}', f'{force:.5g}'])
    return found


def damaged(seed: int) -> list[list[str]]:
    """The rows, with up to one in four hundred of each kind of damage anywhere."""
    rng, found = np.random.default_rng(seed), rows()
    for kind in DAMAGE:
        for i in rng.choice(np.arange(1, len(found)), rng.integers(0, len(found) // 400), replace=False):
            cell = int(rng.integers(0, 4))
            found[i] = {
                'word': [*found[i][:cell], 'broken', *found[i][cell + 1 :]],
                'empty': [*found[i][:3], ''],
                'nan': [*found[i][:3], 'nan'],
                'short': found[i][:2],
                'same time': [found[i - 1][0], *found[i][1:]],
                'back in time': ['0.01', *found[i][1:]],
            }[kind]
    return found


@pytest.mark.parametrize('seed', range(6))
def test_every_row_of_a_damaged_log_is_used_or_left_out_with_a_reason(seed, tmp_path, capsys):
    made = damaged(seed)
    log, rig = tmp_path / 'log.csv', tmp_path / 'rig.yaml'
    log.write_text('\n'.join(['t,p,v,f', *(','.join(row) for row in made)]))
    rig.write_text(RIG)
    assert main(['import', 'log', str(log), '--rig', str(rig), '--out', str(tmp_path / 'bag'), '--json']) == 0
    imported = json.loads(capsys.readouterr().out)
    assert imported['rows'] + sum(imported['dropped'].values()) == len(made)
    for source in ((str(log), '--rig', str(rig)), (str(tmp_path / 'bag'), '--seal-chambers', 'a')):
        figures = Run(tmp_path, *source, name=source[0][-3:]).figures
        (used,), (total,) = figures['samples_used'].values(), figures['samples_total'].values()
        assert used + sum(figures['samples_left_out'].values()) == total
        assert total == (len(made) if source[0] == str(log) else imported['rows'])
