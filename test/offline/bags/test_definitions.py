"""Definitions of message types: what the bag says, else what is installed, else what ROS 2 has."""

import sqlite3
import sys
from pathlib import Path

import pytest
from mcap.writer import Writer

from seal_friction_ros.core.messages.definitions import Field
from seal_friction_ros.offline.bags.bag import BagError, read_definitions
from seal_friction_ros.offline.bags.definitions import message_definition

NOT_INSTALLED = 'nav_msgs/Odometry'


@pytest.fixture
def of_humble(tmp_path: Path) -> Path:
    """A file of SQLite as Humble and before write it: no definitions."""
    with sqlite3.connect(tmp_path / 'bag.db3') as database:
        database.execute('CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)')
        database.execute(
            'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)'
        )
        database.execute("INSERT INTO topics VALUES (1, '/odometry', 'nav_msgs/msg/Odometry')")
    database.close()
    return tmp_path / 'bag.db3'


def test_a_type_that_is_neither_in_the_bag_nor_installed_is_that_of_a_distribution(of_humble: Path):
    definition = read_definitions(of_humble, [NOT_INSTALLED])[NOT_INSTALLED]
    assert definition[NOT_INSTALLED] == (
        Field('header', 'std_msgs/Header'),
        Field('child_frame_id', 'string'),
        Field('pose', 'geometry_msgs/PoseWithCovariance'),
        Field('twist', 'geometry_msgs/TwistWithCovariance'),
    )
    assert definition['geometry_msgs/TwistWithCovariance'][1] == Field('covariance', 'float64', 'array', 36)


def test_what_the_bag_says_comes_first(tmp_path: Path):
    with (tmp_path / 'bag.mcap').open('wb') as file:
        writer = Writer(file)
        writer.start()
        for name in ('nav_msgs/msg/Odometry', 'std_msgs/msg/Float64'):
            writer.register_channel(f'/{name[-4:]}', 'cdr', writer.register_schema(name, 'ros2msg', b'int8 own'))
        writer.finish()
    found = read_definitions(tmp_path / 'bag.mcap', [NOT_INSTALLED, 'std_msgs/Float64'])
    assert [definition[name] for name, definition in found.items()] == 2 * [(Field('own', 'int8'),)]


def test_a_type_that_nobody_knows_is_said_in_one_line(of_humble: Path):
    with pytest.raises(BagError, match=r'definition of a/B: a/msg/B is neither installed nor a type of ROS 2$'):
        read_definitions(of_humble, ['a/B'])


def test_without_rosbags_such_a_type_is_refused_with_how_to_install_it(of_humble: Path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'rosbags.typesys', None)
    message_definition.cache_clear()
    with pytest.raises(
        BagError, match=f'definition of {NOT_INSTALLED}: rosbags is not installed: pip install rosbags$'
    ):
        read_definitions(of_humble, [NOT_INSTALLED])
