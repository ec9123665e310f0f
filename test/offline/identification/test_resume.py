"""``identify --work`` resumes: what was found without a group of readings is not computed again."""

from pathlib import Path

import numpy as np

from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.identification import pipeline


def write_table(path: Path, friction: float) -> Path:
    rows = [f'{bar},{friction + 0.5 * bar + 0.02 * ((bar * k) % 3)},extend' for bar in (1, 3, 5, 7) for k in range(3)]
    path.write_text('\n'.join(['pressure_bar,friction_N,direction', *rows]))
    return path


def test_an_interrupted_identification_resumes_to_the_same_bytes(tmp_path, monkeypatch):
    table, seal, work = write_table(tmp_path / 'table.csv', 2.0), tmp_path / 'seal.yaml', tmp_path / 'work'
    words = ['identify', str(table), '--out', str(seal), '--workers', '1']
    assert main(words) == 0
    plain = seal.read_bytes()
    assert main([*words, '--work', str(work)]) == 0
    parts = sorted(work.iterdir())
    assert (len(parts), seal.read_bytes()) == (4, plain)
    recommended, noted = pipeline._recommended, tmp_path / 'noted'

    def note(readings, **settings):
        with noted.open('a') as file:
            file.write(f'{np.unique(readings.level).size}\n')
        return recommended(readings, **settings)

    monkeypatch.setattr(pipeline, '_recommended', note)
    parts[2].unlink()
    assert main([*words, '--work', str(work)]) == 0
    assert (noted.read_text(), seal.read_bytes()) == ('3\n', plain)
    assert sorted(work.iterdir()) == parts
    write_table(table, 2.1)  # other readings are other parts
    assert main([*words, '--work', str(work)]) == 0
    assert len(noted.read_text().split()) == 5
