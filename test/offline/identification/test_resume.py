"""``identify --work`` resumes: what was found without a group of readings is not computed again."""

from pathlib import Path

from seal_friction_ros.offline.commands.main import main


def write_table(path: Path, friction: float) -> Path:
    rows = [f'{bar},{friction + 0.5 * bar + 0.02 * ((bar * k) % 3)},extend' for bar in (1, 3, 5, 7) for k in range(3)]
    path.write_text('\n'.join(['pressure_bar,friction_N,direction', *rows]))
    return path


def test_an_interrupted_identification_resumes_to_the_same_bytes(tmp_path):
    table, seal, work = write_table(tmp_path / 'table.csv', 2.0), tmp_path / 'seal.yaml', tmp_path / 'work'
    words = ['identify', str(table), '--out', str(seal), '--workers', '1']
    assert main(words) == 0
    plain = seal.read_bytes()
    assert main([*words, '--work', str(work)]) == 0
    parts = sorted(work.iterdir())
    assert (len(parts), seal.read_bytes()) == (4, plain)
    written = {part: part.stat().st_mtime_ns for part in parts}
    parts[2].unlink()
    assert main([*words, '--work', str(work)]) == 0
    assert seal.read_bytes() == plain
    assert sorted(work.iterdir()) == parts
    assert [part for part in parts if part.stat().st_mtime_ns != written[part]] == [parts[2]]
    write_table(table, 2.1)  # other readings are other parts
    assert main([*words, '--work', str(work)]) == 0
    assert len(list(work.iterdir())) == 8
