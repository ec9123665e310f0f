"""Without optional packages every node starts and estimates; a command that lacks one says which in one line."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from harness.processes import STOP_TIMEOUT, free_domain, graph_environment
from paths import ROOT

from seal_friction_ros.offline.bags.bag import bag_topics
from seal_friction_ros.packages import OPTIONAL, how_to_install

WITHOUT = [sys.executable, str(ROOT / 'test' / 'harness' / 'without.py')]
COMMAND = 'seal_friction_ros.offline.commands.main'
PULL_TEST = 'bags/pull_test'


def command(packages: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
    return subprocess.run(
        [*WITHOUT, packages, '--', COMMAND, *arguments],
        capture_output=True, text=True, check=False, cwd=ROOT, env=environment,
    )  # fmt: skip


EVERYTHING = ','.join(name for name in OPTIONAL if name != 'mcap')


def test_replay_compare_and_info_need_numpy_yaml_and_mcap_alone(tmp_path: Path):
    out = str(tmp_path / 'replayed')
    for arguments in (
        ('info', PULL_TEST),
        ('replay', PULL_TEST, '--verify'),
        ('replay', PULL_TEST, PULL_TEST, '--verify'),
        ('replay', PULL_TEST, '--out', out),
        ('compare', PULL_TEST, out),
        ('recover', PULL_TEST, '--out', str(tmp_path / 'recovered')),
    ):
        result = command(EVERYTHING, *arguments)
        assert (result.returncode, result.stderr) == (0, ''), arguments


@pytest.mark.parametrize(
    ('package', 'arguments'),
    [
        ('mcap', ['info', PULL_TEST]),
        ('mcap', ['replay', PULL_TEST, '--verify']),
        ('numba', ['tune', '--out', '{}.yaml']),
        ('numba', ['servo', '--out', '{}.html']),
        ('numba', ['ehl', 'run', 'inner_seal']),
        ('numba', ['ehl', 'study', 'inner_seal']),
        ('numba', ['ehl', 'map', 'inner_seal']),
        ('matplotlib', ['report', PULL_TEST, '--out', '{}.html']),
        ('jinja2', ['report', PULL_TEST, '--out', '{}.html']),
        ('matplotlib', ['charts', 'ms28775_114', '--out', '{}.html']),
        ('matplotlib', ['servo', '--out', '{}.html']),
        ('matplotlib', ['identify', PULL_TEST, '--out', '{}.yaml', '--report', '{}.html']),
        ('matplotlib', ['oring', 'ms28775_114', '--report', '{}.html']),
        ('matplotlib', ['ehl', 'run', 'inner_seal', '--out', '{}.html']),
        ('matplotlib', ['tune', '--out', '{}.yaml']),
        ('jinja2', ['sheet', 'rod_seal', '--pressures', '1:5:3', '--out', '{}.csv']),
        ('scipy', ['import', 'log', 'test/corpus/log/spaces', '--rig', 'test/corpus/rig/position', '--out', '{}']),
        ('scipy', ['identify', PULL_TEST, '--out', '{}.yaml']),
        ('scipy', ['oring', 'ms28775_114']),
        ('scipy', ['tune', '--out', '{}.yaml']),
        ('zstandard', ['info', 'test/corpus/mcap/zstd']),
        ('lz4', ['info', 'test/corpus/mcap/lz4']),
        ('tornado', ['monitor', PULL_TEST]),
        ('distributed', ['replay', PULL_TEST, '--scheduler', 'tcp://127.0.0.1:1']),
        ('fsspec', ['replay', 'memory://a/bag']),
        ('pyarrow', ['fleet', 'bags', '--out', '{}.html', '--parquet', '{}.parquet']),
        ('ezdxf', ['section', 'seal.dxf', '--rod', '36mm', '--gland', '46mm', '--pressure', '50bar']),
    ],
)
def test_a_command_that_lacks_a_package_says_which_and_how_to_install_it(package, arguments, tmp_path: Path):
    result = command(package, *(argument.format(tmp_path / 'out') for argument in arguments))
    assert result.returncode == 2, result.stderr
    assert result.stderr.count('\n') == 1
    assert f'{package} is {how_to_install(package)}' in result.stderr
    assert OPTIONAL[package] in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_shell_that_completes_without_argcomplete_is_told_so():
    completing = {'_ARGCOMPLETE': '1', 'COMP_LINE': 'seal_friction rep', 'COMP_POINT': '17'}
    environment = {**os.environ, **completing, 'PYTHONPATH': str(ROOT)}
    asked = [*WITHOUT, 'argcomplete', '--', COMMAND]
    result = subprocess.run(asked, capture_output=True, text=True, check=False, cwd=ROOT, env=environment)
    assert 'argcomplete is not installed' in result.stderr
    assert 'Traceback' not in result.stderr


def test_both_nodes_run_and_record_without_any_of_them(tmp_path: Path):
    """The estimator with numpy, PyYAML and mcap alone; the simulator needs scipy, too, and no compiler."""
    recording = ['-p', 'record:=true', '-p', f'record_directory:={tmp_path}', '-p', 'record_name:=bag']
    without_scipy = ','.join(name for name in OPTIONAL if name not in ('mcap', 'scipy'))
    environment = graph_environment(free_domain())
    processes = [
        subprocess.Popen(
            [*WITHOUT, blocked, '--', f'seal_friction_ros.nodes.entry_points:{node}', '--ros-args', *arguments],
            env=environment, cwd=ROOT, stderr=subprocess.PIPE, text=True,
        )
        for node, blocked, arguments in (
            ('friction_estimator', EVERYTHING, recording),
            ('servo_simulator', without_scipy, []),
        )
    ]  # fmt: skip
    try:
        bag = tmp_path / 'bag'
        while not (bag.is_dir() and any(file.stat().st_size > 200_000 for file in bag.glob('*.mcap'))):
            assert all(process.poll() is None for process in processes)
            time.sleep(0.05)
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        said = [process.communicate(timeout=STOP_TIMEOUT)[1] for process in processes]
    assert [process.returncode for process in processes] == [0, 0], said
    assert 'numba is not installed: the simulation is slow; apt-get install python3-numba' in said[1]
    assert bag_topics(bag)['/friction_estimate'].message_count > 10
    result = command(EVERYTHING, 'replay', str(bag), '--verify', '--json')
    assert json.loads(result.stdout)['identical'], result.stderr


@pytest.mark.parametrize(
    ('node', 'package', 'how'),
    [('servo_simulator', 'scipy', 'apt-get install python3-scipy'), ('friction_estimator', 'mcap', 'pip install mcap')],
)
def test_a_node_that_lacks_a_package_says_so(node: str, package: str, how: str):
    environment = graph_environment(free_domain())
    run = [*WITHOUT, package, '--', f'seal_friction_ros.nodes.entry_points:{node}']
    result = subprocess.run(run, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert result.stderr.strip().count('\n') == 0
    assert f'{node}: {package} is not installed: {how}' in result.stderr
