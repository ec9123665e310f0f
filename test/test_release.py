"""What a release needs: one version, a changelog entry, and a launch file that fits the node."""

import re
from pathlib import Path

import pytest
from paths import ROOT

from seal_friction_ros.core.messages.layouts import INPUTS


def manifest(path: Path) -> str:
    return re.search(r'<version>(.*)</version>', path.read_text()).group(1)


def test_both_packages_have_one_version_which_the_changelog_has():
    version = manifest(ROOT / 'package.xml')
    assert re.fullmatch(r'\d+\.\d+\.\d+', version)
    assert manifest(ROOT / 'msg_defs' / 'package.xml') == version
    assert f"version='{version}'" in (ROOT / 'setup.py').read_text()
    headings = re.findall(r'^(\S+)\n-+$', (ROOT / 'CHANGELOG.rst').read_text(), re.MULTILINE)
    assert version in headings
    assert headings == sorted(headings, key=lambda heading: [1] if heading == 'Forthcoming' else [0], reverse=True)


def test_the_lowest_versions_in_the_docs_are_those_that_are_tested():
    listed = (ROOT / 'requirements' / 'lowest.txt').read_text().partition('# What the tests')[0]
    page = (ROOT / 'docs' / 'installation.md').read_text()
    for name, version in re.findall(
        r'^(numpy|scipy|matplotlib|numba|Jinja2|PyYAML|mcap|rosbags|rich|tornado)==([\d.]+)', listed, re.MULTILINE
    ):
        assert f'{version}' in page, name


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
