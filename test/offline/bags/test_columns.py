"""Velocity samples of a bag as rows: what was newest before each, one by one and in bulk alike."""

import math
from pathlib import Path

import numpy as np
import pytest
from harness.closed_loop_bags import write_closed_loop
from harness.compensation import compensating
from harness.example_bags import TOPICS, rewrite, write_recorded
from paths import ROOT

from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.messages.blocks import MOST_MESSAGES
from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.layouts import PRESSURE_TYPE, VELOCITY_TYPE
from seal_friction_ros.core.messages.records import Force, Position, Pressure, Temperature, Velocity
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.bags.actuator_bag import open_actuator
from seal_friction_ros.offline.bags.columns import VelocityRows, read_velocity_rows

TEMPERATURE = 'sensor_msgs/msg/Temperature'


def both(bag: Path) -> VelocityRows:
    """Rows read one by one, which are those in bulk to the bit."""
    rows, bulk = (read_velocity_rows(open_actuator(bag), bulk_from=count) for count in (10**9, 0))
    assert np.array_equal(rows.stamps, bulk.stamps)
    assert rows.columns.tobytes() == bulk.columns.tobytes()
    assert rows.configuration == bulk.configuration
    return rows


def test_a_row_holds_what_came_newest_before_its_velocity(tmp_path: Path):
    with b.BagWriter(tmp_path / 'bag') as writer:
        written = [
            (VELOCITY_TYPE, Velocity(1, 0.1, b'rod')),
            (PRESSURE_TYPE, Pressure(2, 1e6, 2e6)),
            (VELOCITY_TYPE, Velocity(3, 0.2, b'')),
            ('seal_friction_msgs/msg/ForceSum', Force(3, 5.0)),
            (PRESSURE_TYPE, Pressure(4, 3e6, math.nan)),
            (TEMPERATURE, Temperature(4, 21.5, 0.25)),
            ('seal_friction_msgs/msg/RodPosition', Position(4, 0.5)),
            (VELOCITY_TYPE, Velocity(-5, 0.3, b'a longer frame name')),
        ]
        for time, (kind, record) in enumerate(written):
            writer.write(TOPICS.get(kind, '/seal_temperature'), kind, time, encode(record))
    rows = both(tmp_path / 'bag')
    nan = math.nan
    expected = [
        [0.1, nan, nan, nan, nan, nan, nan],
        [0.2, 1e6, 2e6, nan, nan, nan, nan],
        [0.3, 3e6, nan, 5.0, 0.5, 21.5, 0.25],
    ]
    assert np.array_equal(rows.columns.T, expected, equal_nan=True)
    assert rows.stamps.tolist() == [1, 3, -5]
    assert rows.configuration is None


def test_recorded_bags_give_the_same_rows_in_bulk(tmp_path: Path):
    assert len(both(ROOT / 'bags' / 'pull_test').stamps) == 900
    assert both(ROOT / 'bags' / 'faults').configuration is not None
    configuration = compensating(EstimatorSettings(stick_velocity=2e-3, slip_velocity=5e-3))
    assert both(write_recorded(tmp_path, configuration)).configuration == configuration
    closed_loop = write_closed_loop(tmp_path / 'closed_loop', scales=(0.0, 0.9), seconds=6.0)
    rows = both(closed_loop)
    assert len(rows.stamps) == 12_000
    assert sum(topic.message_count for topic in b.bag_topics(closed_loop).values()) > MOST_MESSAGES  # several blocks
    assert np.isfinite(rows.columns[:5, -1]).all()


@pytest.mark.parametrize(
    'damage',
    [
        lambda data: data[:15],
        lambda data: data[:-9],
        lambda data: data + bytes(4),
        lambda data: b'\x00\x00' + data[2:],
        lambda data: data[:8] + b'\xff' * 4 + data[12:],
        lambda data: data[:12] + b'\xff' * 4 + data[16:],
    ],
)
def test_a_malformed_message_is_named_whoever_reads(tmp_path: Path, damage):
    def change(number: int, message: b.BagMessage) -> b.BagMessage:
        return message._replace(data=damage(message.data)) if number == 501 else message

    bag = rewrite(ROOT / 'bags' / 'pull_test', tmp_path / 'bag', change)
    bad = list(b.read_messages(bag))[501]
    assert bad.type_name in TOPICS
    for bulk_from in (0, 10**9):
        with pytest.raises(ValueError, match=f'message on {bad.topic} at {bad.log_time} ns'):
            read_velocity_rows(open_actuator(bag), bulk_from=bulk_from)
