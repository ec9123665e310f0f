"""The token of the view in a file, so that an open page goes on when the monitor starts again."""

import os
import re
import secrets
import stat
from pathlib import Path

_TOKEN = re.compile(r'[\w-]{32,100}', re.ASCII)


def new_token() -> str:
    """A token that nobody can guess."""
    return secrets.token_urlsafe(24)


def kept_token(path: Path) -> str:
    """The token in a file, which is made for this user alone (0600) if there is none.

    ValueError: others can read or write the file, it holds no token, or it cannot be read or made.
    """
    try:
        try:
            with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), 'w') as file:
                token = new_token()
                file.write(f'{token}\n')
                return token
        except FileExistsError:
            with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), 'rb') as file:
                return _checked(path, os.fstat(file.fileno()), file.read(1000))
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror}') from None


def _checked(path: Path, found: os.stat_result, data: bytes) -> str:
    if found.st_uid != os.geteuid() or found.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ValueError(f'{path}: others can read or write it: its token is none any more; remove it')
    text = data.decode(errors='replace').strip()
    if not stat.S_ISREG(found.st_mode) or not _TOKEN.fullmatch(text):
        raise ValueError(f'{path}: no file with a token: name another one')
    return text
