"""The token in a file is a secret of one user, or none at all."""

import os
from pathlib import Path

import pytest

from seal_friction_ros.offline.monitor.live_view import LiveView
from seal_friction_ros.offline.monitor.server import MonitorServer
from seal_friction_ros.offline.monitor.token_file import kept_token


def test_the_first_start_makes_it_for_one_user_and_the_next_one_takes_it(tmp_path: Path):
    path, before = tmp_path / 'token', os.umask(0)
    try:
        token = kept_token(path)
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o600
    assert len(token) >= 32
    assert kept_token(path) == token != kept_token(tmp_path / 'other')
    server = MonitorServer(LiveView(0), token=token)
    assert server.url.endswith(f'?token={token}')
    server.stop()


@pytest.mark.parametrize('mode', [0o640, 0o604, 0o620, 0o602, 0o666])
def test_what_others_can_read_or_write_is_refused(tmp_path: Path, mode: int):
    path = tmp_path / 'token'
    kept_token(path)
    path.chmod(mode)
    with pytest.raises(ValueError, match=r'token: others can read or write it'):
        kept_token(path)


@pytest.mark.parametrize('text', ['', 'short', 'x' * 31, 'a' * 40 + ' b', 'y' * 101, 'é' * 40, '\0' * 40])
def test_a_file_that_holds_something_else_is_no_token_and_stays_as_it_is(tmp_path: Path, text: str):
    path = tmp_path / 'notes'
    path.write_text(text)
    path.chmod(0o600)
    with pytest.raises(ValueError, match='no file with a token'):
        kept_token(path)
    assert path.read_text() == text


@pytest.mark.parametrize('make', [os.mkdir, os.mkfifo])
def test_a_folder_or_a_pipe_is_one_line_and_does_not_hang(tmp_path: Path, make):
    make(tmp_path / 'other')
    (tmp_path / 'other').chmod(0o700)
    with pytest.raises(ValueError, match='other: '):
        kept_token(tmp_path / 'other')


def test_a_file_that_cannot_be_made_is_one_line(tmp_path: Path):
    with pytest.raises(ValueError, match='No such file or directory'):
        kept_token(tmp_path / 'none' / 'token')
