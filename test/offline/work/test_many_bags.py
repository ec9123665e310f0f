"""The bags of a folder or of a list, each once; what is no list is one line."""

import os
from pathlib import Path

import pytest
from harness.example_bags import write_inputs

from seal_friction_ros.offline.work.places import find_bags


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    for name in ('b/zwölf', 'a/one', 'a/deep/er/two'):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        write_inputs(tmp_path / name, 3)
    (tmp_path / 'loose.mcap').write_bytes(b'')
    (tmp_path / 'a' / 'notes.txt').write_text('no bag')
    (tmp_path / 'again').symlink_to(tmp_path / 'a')
    return tmp_path


def test_every_bag_below_a_folder_is_found_once_also_a_damaged_one(fleet):
    names = [str(bag.relative_to(fleet)) for bag in find_bags(fleet)]
    assert names == ['a/deep/er/two', 'a/one', 'b/zwölf', 'loose.mcap']


def test_a_list_has_a_path_a_line_relative_to_its_folder_and_the_same_bag_counts_once(fleet):
    listed = fleet / 'list.txt'
    listed.write_text(f'# a comment\n\nb/zwölf\r\na/one\n{fleet / "a" / "one"}\na/../a/one\nagain/one\nmissing\n')
    assert find_bags(listed) == [fleet / 'b/zwölf', fleet / 'a/one', fleet / 'missing']


@pytest.mark.parametrize(
    'content', [b'', b'\n# nothing\n', b'\x89MCAP0\r\n\x00\xff', b'a\x00b\n', b'\xff\xfe', b'a\x1b[2J']
)
def test_what_is_no_list_is_one_line(content, tmp_path):
    (tmp_path / 'list').write_bytes(content)
    with pytest.raises(ValueError, match='list') as caught:
        find_bags(tmp_path / 'list')
    assert '\n' not in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.skipif(os.geteuid() == 0, reason='root reads everything')
def test_a_folder_that_cannot_be_read_is_not_left_out(fleet):
    (fleet / 'b').chmod(0)
    assert fleet / 'b' in find_bags(fleet)
    (fleet / 'b').chmod(0o755)


def test_an_empty_folder_is_one_line(tmp_path):
    with pytest.raises(ValueError, match='no bag in it'):
        find_bags(tmp_path)


def test_a_place_that_does_not_exist_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        find_bags(tmp_path / 'nowhere')
