"""What a release needs: one version, a changelog, a launch file that fits the node, a wheel that works without ROS."""

import os
import re
import subprocess
from pathlib import Path

import pytest
from catkin_pkg.changelog import get_changelog_from_path
from harness.installed_wheel import build, install, unpacked_sdist
from paths import ROOT

from seal_friction_ros.core.messages.layouts import INPUTS


def manifest(path: Path) -> str:
    return re.search(r'<version>(.*)</version>', path.read_text()).group(1)


@pytest.mark.filterwarnings('ignore:nodes.Node.traverse:DeprecationWarning')  # catkin_pkg with docutils
def test_both_packages_have_one_version_which_the_changelog_has():
    version = manifest(ROOT / 'package.xml')
    assert re.fullmatch(r'\d+\.\d+\.\d+', version)
    assert manifest(ROOT / 'msg_defs' / 'package.xml') == version
    assert f"version='{version}'" in (ROOT / 'setup.py').read_text()
    changelog = get_changelog_from_path(ROOT / 'CHANGELOG.rst')  # as the tools of a release read it
    versions = [number for number, _, _ in changelog.foreach_version(reverse=True)]
    assert versions[0] == version
    headings = re.findall(r'^(\d[.\d]+) \(', (ROOT / 'CHANGELOG.rst').read_text(), re.MULTILINE)
    assert versions == headings


def test_the_lowest_versions_in_the_docs_are_those_that_are_tested():
    listed = (ROOT / 'requirements' / 'lowest.txt').read_text().partition('# What the tests')[0]
    page = (ROOT / 'docs' / 'installation.md').read_text()
    for name, version in re.findall(
        r'^(numpy|scipy|matplotlib|numba|Jinja2|PyYAML|mcap|rosbags|rich|tornado)==([\d.]+)', listed, re.MULTILINE
    ):
        assert f'{version}' in page, name
    needed = re.findall(r"'([\w]+)>=([\d.]+)'", (ROOT / 'setup.py').read_text())
    assert len(needed) > 8
    assert [one for one in needed if '=='.join(one) not in re.findall(r'^[\w.=]+', listed, re.MULTILINE)] == []


def test_the_launch_file_starts_the_node_with_an_argument_for_every_input():
    """Runs with a ROS distribution, whose package launch the wheels do not have."""
    pytest.importorskip('launch')
    pytest.importorskip('launch_ros')
    source = ROOT / 'launch' / 'friction_estimator.launch.py'
    scope: dict = {}
    exec(compile(source.read_text(), str(source), 'exec'), scope)  # noqa: S102  a launch file is no module
    entities = scope['generate_launch_description']().entities
    arguments = {entity.name for entity in entities if hasattr(entity, 'default_value')}
    assert arguments >= {
        'namespace',
        'params_file',
        'cylinder_pressure',
        'rod_velocity',
        'force_sum',
        'servo_reference',
    }
    (node,) = (entity for entity in entities if hasattr(entity, 'node_executable'))
    assert node.node_executable == 'friction_estimator'
    assert set(scope['INPUTS']) <= set(INPUTS)


@pytest.fixture(scope='module')
def source(tmp_path_factory) -> Path:
    """Tree of the source distribution."""
    return unpacked_sdist(tmp_path_factory.mktemp('release'))


@pytest.fixture(scope='module')
def python(source: Path) -> Path:
    """Python of an environment with nothing but the wheel of the source distribution and what it requires."""
    return install(build('wheel', source, source.parent / 'dist'), source.parent / 'environment', ('cluster',))


def run(*command: str | Path, folder: Path) -> str:
    """Standard output of a command that must succeed, without anything of this tree on its paths."""
    outside = {name: value for name, value in os.environ.items() if name not in ('PYTHONPATH', 'AMENT_PREFIX_PATH')}
    environment = outside | {'MPLBACKEND': 'agg', 'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f'{command}: {done.stderr}'
    return done.stdout


def test_the_wheel_installs_commands_and_data_that_work_without_ros(source: Path, python: Path, tmp_path: Path):
    command = python.with_name('seal_friction')
    assert run(command, '--version', folder=tmp_path) == f'seal_friction {manifest(ROOT / "package.xml")}\n'
    assert 'ms28775_114: physics_based' in run(command, 'seals', folder=tmp_path)
    bag = source / 'bags' / 'pull_test'
    assert 'identical to the byte' in run(command, 'replay', bag, '--verify', folder=tmp_path)
    run(command, 'replay', bag, '--out', 'again', folder=tmp_path)
    assert 'agree' in run(command, 'compare', bag, 'again', folder=tmp_path)
    run(command, 'report', bag, '--out', 'page.html', folder=tmp_path)
    run(command, 'ehl', 'run', '--help', folder=tmp_path)
    run(python, '-c', 'import importlib.util as u, sys; sys.exit(bool(u.find_spec("rclpy")))', folder=tmp_path)


QUICK = ('estimator_in_my_loop', 'friction_of_a_seal', 'replay_in_ci')


@pytest.mark.parametrize(
    'example',
    [
        pytest.param(path.stem, marks=() if path.stem in QUICK else pytest.mark.long)
        for path in sorted((ROOT / 'examples').glob('*.py'))
        if 'rclpy' not in path.read_text() and 'launch' not in path.name
    ],
)
def test_the_examples_run_with_the_wheel(source: Path, python: Path, example: str, tmp_path: Path):
    assert run(python, source / 'examples' / f'{example}.py', folder=tmp_path)  # it asserts its numbers, and says some
