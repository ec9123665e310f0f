"""Files written atomically: complete or absent."""

from pathlib import Path


def write_whole(path: Path, content: bytes) -> None:
    """Write a file, and its folder if necessary, in one step: a reader never sees half of it; replace an existing file.

    OSError: the file cannot be written; the previous one is left unchanged.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f'.{path.name}.partial')
    try:
        partial.write_bytes(content)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
