"""``rosdep install`` resolves every dependency of both packages, on the systems that ROS 2 distributions are made for.

All are system packages but two libraries of bags, which no distribution packages: pip installs these.

test/rosdep holds copies of the needed parts of the rosdep database.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from paths import ROOT

COPIES = ROOT / 'test' / 'rosdep'
FROM_PYPI = {'mcap-ros2-support', 'rosbags'}
FOR_COMMANDS = {
    f'python3-{name}' for name in ('scipy', 'numba', 'matplotlib', 'jinja2', 'argcomplete', 'rich', 'tornado')
}


def rosdep(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    home = {
        'ROS_HOME': str(folder),
        'ROSDEP_SOURCE_PATH': str(folder / 'sources.list.d'),
        'ROSDISTRO_INDEX_URL': (COPIES / 'index-v4.yaml').as_uri(),
        'ROS_PYTHON_VERSION': '3',
    }
    call = 'import sys; from rosdep2.main import rosdep_main; sys.exit(rosdep_main())'
    return subprocess.run(
        [sys.executable, '-c', call, *arguments],
        cwd=ROOT, env={**os.environ, **home, **environment}, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.fixture(scope='module')
def database(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp('rosdep')
    (folder / 'sources.list.d').mkdir()
    (folder / 'sources.list.d' / 'copies.list').write_text(f'yaml {(COPIES / "python.yaml").as_uri()}\n')
    assert rosdep(folder, 'update').returncode == 0
    return folder


def installed(database: Path, system: str, distribution: str, **environment: str) -> set[str]:
    result = rosdep(
        database, 'install', '--from-paths', '.', 'msg_defs', '--ignore-src', '--simulate', '--reinstall',
        f'--os={system}', f'--rosdistro={distribution}', **environment,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    commands = [line.split() for line in result.stdout.splitlines() if not line.startswith('#')]
    by_apt = {command[-1] for command in commands if command[:2] == ['apt-get', 'install']}
    assert {command[-1] for command in commands} - by_apt <= FROM_PYPI
    return {command[-1] for command in commands}


@pytest.mark.parametrize(
    ('system', 'distribution'),
    [
        pytest.param('ubuntu:noble', 'kilted', marks=pytest.mark.long),  # Jazzy is of the same system
        ('debian:trixie', 'rolling'),
    ],
)
def test_every_dependency_is_a_system_package_or_one_of_two_from_pypi(database: Path, system: str, distribution: str):
    found = installed(database, system, distribution)
    assert found >= {f'ros-{distribution}-rclpy', 'python3-numpy', 'python3-yaml', *FOR_COMMANDS, *FROM_PYPI}


def test_a_machine_with_the_live_node_alone_gets_no_numerics_but_numpy(database: Path):
    everything = installed(database, 'ubuntu:noble', 'jazzy')
    assert everything >= {'ros-jazzy-rclpy', 'python3-numpy', 'python3-yaml', *FOR_COMMANDS, *FROM_PYPI}
    live = installed(database, 'ubuntu:noble', 'jazzy', SEAL_FRICTION_LIVE_ONLY='1')
    assert everything - live == {*FOR_COMMANDS, 'rosbags'}


@pytest.mark.long
def test_an_unknown_key_is_noticed(database: Path, tmp_path: Path):
    text = (ROOT / 'package.xml').read_text().replace('python3-numba', 'python3-mcap-pip')
    (tmp_path / 'package.xml').write_text(text)
    result = rosdep(
        database, 'check', '--from-paths', str(tmp_path), '--ignore-src', '--os=ubuntu:noble', '--rosdistro=jazzy'
    )
    assert 'python3-mcap-pip' in result.stdout + result.stderr
    assert result.returncode
