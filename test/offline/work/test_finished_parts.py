"""Finished parts are not computed again, and nothing else is taken for one."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from seal_friction_ros.offline.work import finished_parts
from seal_friction_ros.offline.work.finished_parts import Part, content_of, part_key, run_parts
from seal_friction_ros.offline.work.outcome import Outcome

NAMES = ('number', 'array')


def compute(folder: Path, number: float) -> dict:
    with (folder / 'computed').open('a') as file:
        file.write(f'{number}\n')
    if number < 0.0:
        raise ValueError(f'{number} is negative')
    return {'number': number, 'array': np.array([number, np.nan, 0.1 + 0.2])}


def computed(folder: Path) -> list[float]:
    path = folder / 'computed'
    found = [float(line) for line in path.read_text().splitlines()] if path.exists() else []
    path.unlink(missing_ok=True)
    return found


def parts(folder: Path, *numbers: float) -> list[Part]:
    return [Part(part_key('test', number), NAMES, partial(compute, folder, number)) for number in numbers]


def run(folder: Path, *numbers: float, keep: bool = True):
    return run_parts('test', parts(folder, *numbers), 1, folder / 'work' if keep else None)


def test_finished_parts_are_not_computed_again_and_are_the_same_to_the_bit(tmp_path):
    first = run(tmp_path, 1.0, 2.0)
    assert computed(tmp_path) == [1.0, 2.0]
    again = run(tmp_path, 3.0, 2.0, 1.0)
    assert computed(tmp_path) == [3.0]
    for before, after in zip(first, again[:0:-1], strict=True):
        assert before['number'] == after['number']
        np.testing.assert_array_equal(before['array'], after['array'])
    run(tmp_path, 1.0, keep=False)
    assert computed(tmp_path) == [1.0]


def test_parts_finished_before_a_failure_are_kept(tmp_path):
    with pytest.raises(ValueError, match='negative'):
        run(tmp_path, 1.0, 2.0, -1.0, 3.0)
    assert computed(tmp_path) == [1.0, 2.0, -1.0]
    run(tmp_path, 1.0, 2.0, 3.0)
    assert computed(tmp_path) == [3.0]


@pytest.mark.parametrize('content', ['', '{"half": 1}', '[]', '{"number": 1', '\ufffd'])
def test_a_file_that_is_no_finished_part_is_replaced(content, tmp_path):
    run(tmp_path, 1.0)
    computed(tmp_path)
    (file,) = (tmp_path / 'work').iterdir()
    whole = file.read_bytes()
    file.write_text(content)
    run(tmp_path, 1.0)
    assert computed(tmp_path) == [1.0]
    assert file.read_bytes() == whole


def test_the_key_follows_kind_inputs_and_code(monkeypatch):
    keys = [part_key('a', {'x': 1.0, 'y': [2.0]}), part_key('b', {'x': 1.0, 'y': [2.0]}), part_key('a', {'x': 1.5})]
    assert part_key('a', {'y': [2.0], 'x': 1.0}) == keys[0]
    monkeypatch.setattr(finished_parts, 'versions', lambda: {'seal_friction_ros': 'another version'})
    keys.append(part_key('a', {'x': 1.0, 'y': [2.0]}))
    assert len(set(keys)) == len(keys)


def test_the_content_of_records_and_arrays_makes_keys():
    numbers = np.arange(6.0)
    known = content_of(numbers)
    assert known == content_of(numbers[::-1][::-1])
    for other in (numbers + 1e-9, numbers[::2], numbers.reshape(2, 3), numbers.astype(np.float32), -numbers):
        assert content_of(other) != known
    assert content_of([Outcome(numbers), None, 1.5, 'a']) == [[known, ''], None, 1.5, 'a']


def test_what_is_prepared_is_there_for_all_and_only_if_a_part_is_missing(tmp_path):
    prepared = []

    def call() -> dict:
        return {'number': len(prepared), 'array': np.zeros(1)}

    work = [Part(part_key('test', number), NAMES, call) for number in range(3)]
    for _ in range(2):
        found = run_parts('test', work, 2, tmp_path / 'work', lambda: prepared.append(1))
        assert [values['number'] for values in found] == [1, 1, 1]
    assert len(prepared) == 1


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / 'work').write_text('a file')
    with pytest.raises(ValueError, match='work: cannot be the work folder: File exists: name another one'):
        run(tmp_path, 1.0)
