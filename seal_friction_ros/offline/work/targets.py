"""Files and bags that a command writes: checked before the work, so that no command overwrites what it did not make.

Every file that a command makes has the words ``made by seal_friction COMMAND`` near its beginning. A command overwrites
a file with its own mark, and any other file only with ``--force``. It never overwrites one of its inputs. Bags and data
sheets hold measurements and have no mark. All of it is our choice.
"""

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

_MARK_WITHIN = 1000  # [bytes] from the beginning of a file


class Kind(NamedTuple):
    """Kind of a target."""

    what: str
    suffixes: tuple[str, ...] = ()  # that its name may have; empty: any
    has_page: bool = False  # with a page of the same name, and the folder of its figures
    has_mark: bool = True
    inside: str = ''  # file that each folder of this kind has, with the mark; empty: the target is a file


PAGE = Kind('a page', ('.html', '.htm'), has_page=True)
SEAL_FILE = Kind('a seal file', ('.yaml', '.yml'))
MAPPING_FILE = Kind('a mapping file', ('.yaml', '.yml'))
RIG_FILE = Kind('a rig file', ('.yaml', '.yml'))
POLICY = Kind('a security policy', ('.xml',))
PARAMETER_FILE = Kind('a parameter file, with a page beside it,', ('.yaml', '.yml'), has_page=True)
LIVE_PARAMETERS = Kind('a parameter file', ('.yaml', '.yml'))
DATA_SHEET = Kind('a data sheet, with a page beside it,', ('.csv',), has_page=True, has_mark=False)
TABLE = Kind('a Parquet table', ('.parquet',), has_mark=False)
BAG = Kind('a bag', has_mark=False, inside='metadata.yaml')
C_LIBRARY = Kind('a C library', inside='Makefile')
FMU = Kind('an FMU', ('.fmu',), has_mark=False)


def mark(command: str) -> str:
    """Words near the beginning of a file that ``seal_friction COMMAND`` made."""
    return f'made by seal_friction {command}'


@contextmanager
def checked_targets(
    command: str, targets: Sequence[tuple[Path, Kind]], inputs: Sequence[Path], *, force: bool
) -> Iterator[None]:
    """Run the block if it may write the targets; ValueError, in one line that says why, if it may not.

    With ``force``, it may overwrite what the command did not make; an existing bag or data sheet is set aside, and
    comes back if the block does not write another one. Inputs that do not exist are ignored.
    """
    sources = [path.resolve() for path in inputs if path.exists()]
    for path, kind in targets:
        _check(path, kind, sources, command, force=force)
    unmarked = [path for path, kind in targets if not kind.has_mark and path.exists()]
    aside = {path: path.with_name(f'.{path.name}.replaced') for path in unmarked}
    try:
        for path, hidden in aside.items():
            path.rename(hidden)
        yield
    finally:
        for path, hidden in aside.items():
            if not path.exists() and hidden.exists():
                hidden.rename(path)
            elif hidden.is_dir():
                shutil.rmtree(hidden)
            else:
                hidden.unlink()


def _check(target: Path, kind: Kind, inputs: Sequence[Path], command: str, *, force: bool) -> None:
    """Check a target, its page, and the folder of the figures, which belongs to the page."""
    if kind.suffixes and target.suffix.lower() not in kind.suffixes:
        raise ValueError(f'{target}: {kind.what} is written here: name it {" or ".join(kind.suffixes)}')
    parent = next(parent for parent in target.absolute().parents if parent.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK):
        raise ValueError(f'{target}: cannot write into {parent}')
    page = target.with_suffix('.html') if kind.has_page and kind is not PAGE else target
    written = {target: kind.has_mark and _has_mark(target / kind.inside, command)}
    if kind.has_page:
        written[page] = _has_mark(page, command)
        written[page.with_name(f'{page.stem}_figures')] = written[page]
    for path, is_own in written.items():
        if not path.exists() and not path.is_symlink():
            continue
        resolved, is_folder = path.resolve(), bool(kind.inside) or path not in (target, page)
        part_of = () if is_own else resolved.parents
        if any(each == resolved or each in part_of or resolved in each.parents for each in inputs):
            raise ValueError(f'{path} belongs to an input: not overwriting it: choose another name')
        if path.is_dir() != is_folder or (kind.inside and not (path / kind.inside).is_file()):
            what = f'a folder but {kind.what.replace("a ", "no ", 1)}' if path.is_dir() else 'no folder'
            raise ValueError(f'{path} exists already and is {what}: not overwriting it: choose another name')
        if not is_own and not force:
            what = f'not overwriting it, seal_friction {command} did not make it'
            raise ValueError(f'{path} exists already: {what}: choose another name, or give --force')


def _has_mark(path: Path, command: str) -> bool:
    """Whether a path is a file that a command made."""
    if not path.is_file():
        return False
    with path.open('rb') as file:
        return mark(command) in file.read(_MARK_WITHIN).decode(errors='replace').lower().replace('`', '')
