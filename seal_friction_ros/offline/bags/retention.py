"""Deletion of the oldest bags of a recorder."""

import re
from contextlib import suppress
from pathlib import Path

from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags.bag import LARGEST_METADATA, START_IN_NAME

_METADATA = 'metadata.yaml'


def delete_oldest(folder: Path, owner: str, largest: int) -> None:
    """Delete the oldest finished bags of a recorder until the remaining ones have at most ``largest`` [bytes].

    A bag counts if its name ends like that of `timed_name`, its ``metadata.yaml`` says that ``owner`` finished it, and
    its folder contains nothing but that file and its MCAP files. Everything else stays: bags with another name,
    unfinished bags, folders with another file in them, and links. Raises OSError if ``folder`` cannot be read.
    """
    total = 0
    bags = [path for path in folder.iterdir() if START_IN_NAME.search(path.name) and _is_finished_by(path, owner)]
    for bag in sorted(bags, key=lambda path: path.name[-22:], reverse=True):
        with suppress(OSError):  # the other bags count as well
            files = list(bag.glob('*.mcap'))
            total += sum(file.stat().st_size for file in files)
            if total > largest:
                for file in (*files, bag / _METADATA):
                    file.unlink()
                bag.rmdir()


def _is_finished_by(bag: Path, owner: str) -> bool:
    name = re.compile(rf'{re.escape(bag.name)}_[0-9]+\.mcap')
    try:
        if bag.is_symlink() or not all(path.name == _METADATA or name.fullmatch(path.name) for path in bag.iterdir()):
            return False
        about = read_yaml(bag / _METADATA, LARGEST_METADATA)['rosbag2_bagfile_information']['custom_data']
        return bool(about['recorded_by'] == owner and 'dropped_messages' in about)
    except (OSError, ValueError, LookupError, TypeError):
        return False
