"""README and docs are true: tables follow from the code, commands run, figures are there and made by a command."""

import os
import re
import subprocess
import time
from pathlib import Path

import demo
import make_docs
import pytest
from harness.processes import free_domain, graph_environment
from paths import ROOT

from seal_friction_ros.offline.replay.replay import replay

PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]
README = (ROOT / 'README.md').read_text()


def commands(kind: str) -> list[str]:
    """Lines of the blocks of one kind in the README."""
    blocks = re.findall(rf'```bash{kind}\n(.*?)```', README, re.DOTALL)
    return [line for block in blocks for line in block.splitlines()]


PLAIN = [line for line in commands('') if not line.startswith(('make ', 'colcon ', 'source '))]


@pytest.fixture(scope='module')
def checkout(tmp_path_factory) -> Path:
    """The tree as a reader has it, in a folder of its own, so that commands may write."""
    folder = tmp_path_factory.mktemp('checkout')
    for name in ('.venv', 'bags', 'bench', 'config', 'data', 'msg_defs', 'resource', 'seal_friction_ros', 'test'):
        (folder / name).symlink_to(ROOT / name)
    for name in ('package.xml', 'setup.py', 'setup.cfg'):
        (folder / name).write_bytes((ROOT / name).read_bytes())
    (folder / 'build').mkdir()
    return folder


def run(command: str, folder: Path, timeout: float = 120.0) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ['bash', '-c', command],
        cwd=folder,
        env=graph_environment(free_domain()),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def test_every_command_of_the_readme_runs(checkout: Path):
    assert len(PLAIN) >= 8
    for command in PLAIN:
        result = run(command, checkout)
        expected = (0, 1) if ' compare ' in command else (0,)
        assert result.returncode in expected, f'{command}: {result.stderr}'


def test_the_node_runs_as_the_readme_says_and_records(checkout: Path):
    *settings, command = commands(' live')
    environment = graph_environment(free_domain())
    environment |= dict(setting.removeprefix('export ').split('=') for setting in settings)
    command = command.replace('.venv/bin', str(ROOT / '.venv' / 'bin'))
    process = subprocess.Popen(command.split(), cwd=checkout, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        deadline = time.monotonic() + 20.0
        while not list(checkout.glob('build/bags/*/metadata.yaml')):
            assert time.monotonic() < deadline
            time.sleep(0.1)
        time.sleep(1.0)
    finally:
        process.terminate()
        _, errors = process.communicate(timeout=20.0)
    assert process.returncode == 0
    assert 'estimating' in errors


def test_the_servo_on_the_desk_runs_as_the_readme_says_and_gets_its_feed_forward(checkout: Path):
    environment = graph_environment(free_domain())
    logs = [checkout / f'build/desk_{i}.log' for i in range(2)]
    processes = []
    try:
        for command, log in zip(commands(' desk'), logs, strict=True):
            words = (
                command.replace('.venv/bin', str(ROOT / '.venv' / 'bin')).replace('build/bags', 'build/desk').split()
            )
            with log.open('w') as said:
                processes.append(subprocess.Popen(words, cwd=checkout, env=environment, stderr=said))
        deadline = time.monotonic() + 60.0
        while 'simulating' not in logs[0].read_text():  # it compiles first
            assert time.monotonic() < deadline
            time.sleep(0.1)
        time.sleep(5.0)
    finally:
        for process in processes:
            process.terminate()
        codes = [process.wait(20.0) for process in processes]
    assert codes == [0, 0]
    (bag,) = (path.parent for path in checkout.glob('build/desk/*/metadata.yaml'))
    verdict = replay(bag)
    assert verdict.identical
    assert verdict.recorded_feedforwards > 500


def test_the_workspace_builds_and_runs_as_the_readme_says(checkout: Path):
    build, source = (line for line in commands('') if line.startswith(('colcon ', 'source ')))
    (ros_run,) = (line for line in commands(' ros') if line.startswith('ros2 run'))
    prefix = os.environ.get('AMENT_PREFIX_PATH', str(ROOT / '.venv'))
    exports = f'export PATH={ROOT}/.venv/bin:$PATH AMENT_PREFIX_PATH={prefix} CMAKE_PREFIX_PATH={prefix}'
    cmake = f'--cmake-args -DPython3_EXECUTABLE={ROOT}/.venv/bin/python -DBUILD_TESTING=OFF'
    result = run(f'{exports}; rm -rf build; {build} {cmake}', checkout, 300.0)
    assert result.returncode == 0, result.stderr
    node = ros_run.replace('ros2 run seal_friction_ros ', 'install/seal_friction_ros/lib/seal_friction_ros/')
    stopped = f'{exports}; {source}; timeout -s INT 4 {node}'
    result = run(stopped, checkout)
    assert '[left_actuator.friction_estimator]: estimating' in result.stderr, result.stderr


def test_services_named_in_the_readme_are_those_of_the_node():
    (call,) = (line for line in commands(' ros') if line.startswith('ros2 service call'))
    source = (ROOT / 'seal_friction_ros' / 'nodes' / 'friction_estimator.py').read_text()
    assert call.split()[3] == '/left_actuator/friction_estimator/start_recording'
    assert "Trigger, '~/start_recording'" in source
    assert call.split()[4] == 'std_srvs/srv/Trigger'


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_tables_are_those_of_the_code(page: Path):
    assert make_docs.filled(page.read_text()) == page.read_text()


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_links_and_figures_are_there(page: Path):
    for target in re.findall(r'\]\((?!http)([^)#]+)\)', page.read_text()):
        assert (page.parent / target).exists(), target


def test_every_figure_is_made_by_a_command():
    source = (ROOT / 'tools' / 'make_figures.py').read_text()
    for figure in (ROOT / 'docs' / 'figures').iterdir():
        assert f"'{figure.name}'" in source


def test_the_units_are_in_the_table_of_the_demo():
    headings = [str(column.header) for column in (*demo.friction_table([]).columns, *demo.run_table([]).columns)]
    assert {'pressure [bar]', 'measured [N]', 'p99 [us]'} <= set(headings)
