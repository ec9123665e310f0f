"""The table of node parameters is complete and documented; options of the node are checked."""

import pytest
from paths import ROOT

from seal_friction_ros.core.estimation.node_options import (
    ADAPTATION_PREFIX,
    FEEDFORWARD_PREFIX,
    FRICTION_ESTIMATOR_PARAMETERS,
    MACHINE_ESTIMATOR_PARAMETERS,
    REMOVED_PARAMETERS,
    RecordingOptions,
    StartOptions,
)
from seal_friction_ros.core.servo.simulator_options import SERVO_SIMULATOR_PARAMETERS

NODES = [
    (FRICTION_ESTIMATOR_PARAMETERS, 'docs/interfaces.md', '| `{}`'),
    (SERVO_SIMULATOR_PARAMETERS, 'config/servo_simulator.yaml', '# {}: '),
]
"""Parameters of a node, where they are listed, and how a row begins."""


@pytest.mark.parametrize(('groups', 'file', 'row'), NODES, ids=['friction_estimator', 'servo_simulator'])
def test_every_parameter_belongs_to_one_group_and_is_listed(groups, file: str, row: str):
    names = [name for group in groups for name in group.names()]
    assert len(names) == len(set(names))
    text = (ROOT / file).read_text()
    assert [name for name in names if row.format(name) not in text] == []


def test_the_feed_forward_has_a_prefix_and_seals_are_fixed():
    names = [name for group in FRICTION_ESTIMATOR_PARAMETERS for name in group.names()]
    assert f'{FEEDFORWARD_PREFIX}scale' in names
    fixed = {name for group in FRICTION_ESTIMATOR_PARAMETERS for name in group.fixed()}
    assert fixed == {'autostart', 'realtime_priority', 'seals', 'seal_chambers', 'record'}


def test_the_mapping_file_of_a_machine_is_fixed_and_what_can_be_recorded_is_not():
    fixed = {name for group in MACHINE_ESTIMATOR_PARAMETERS for name in group.fixed()}
    assert fixed == {'autostart', 'realtime_priority', 'machine', 'record'}


def test_what_replaces_a_removed_parameter_is_one():
    names = {name for group in FRICTION_ESTIMATOR_PARAMETERS for name in group.names()}
    assert f'{ADAPTATION_PREFIX}mode' in names
    assert not names & REMOVED_PARAMETERS.keys()
    assert set(REMOVED_PARAMETERS.values()) - names == {'velocity_terms of the seal file'}


@pytest.mark.parametrize(
    ('name', 'least', 'below'),
    [
        ('record_state_period', 0.5, 0.49),
        ('record_split_size', 1_000_000, 999_999),
        ('record_split_duration', 10.0, 9.9),
        ('record_keep_size', 10_000_000, 9_999_999),
    ],
)
def test_a_split_into_thousands_of_files_is_rejected(name: str, least: float, below: float):
    for good in (0, least):
        assert getattr(RecordingOptions(**{name: type(least)(good)}), name) == good
    for bad in {below, min(below, type(least)(1))}:
        with pytest.raises(ValueError, match=f'{name} = {bad} is too small: 0 or at least {least}'):
            RecordingOptions(**{name: bad})


@pytest.mark.parametrize('name', ['../escaped', '/absolute', '..', '.', 'two\nlines'])
def test_a_bag_name_outside_the_folder_is_rejected(name: str):
    with pytest.raises(ValueError, match='record_name'):
        RecordingOptions(record_name=name)


@pytest.mark.parametrize('priority', [-1, 100])
def test_a_priority_out_of_bounds_is_rejected(priority: int):
    with pytest.raises(ValueError, match='realtime_priority'):
        StartOptions(realtime_priority=priority)
