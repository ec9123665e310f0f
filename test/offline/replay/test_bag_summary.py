"""A bag in a row of numbers: what was put into it, and friction at each pressure."""

from dataclasses import replace

import numpy as np
import pytest
from harness.example_bags import rewrite
from harness.simulated_day import SECOND, Day, write_day
from paths import ROOT

from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.core.friction.mounting import CHAMBERS
from seal_friction_ros.core.friction.seal_file import mount_seals
from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.layouts import PRESSURE_TYPE
from seal_friction_ros.core.messages.records import Pressure
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags.bag import BagError
from seal_friction_ros.offline.replay.bag_parts import Chosen
from seal_friction_ros.offline.replay.bag_summary import (
    IDENTICAL,
    LEVEL_COLUMNS,
    NOTHING_RECORDED,
    bag_summary,
)
from seal_friction_ros.offline.replay.replay import chosen_configuration

SEAL = ROOT / 'config' / 'seals' / 'ms28775_114.yaml'
SEALS = mount_seals([read_yaml(SEAL)] * 2, CHAMBERS[:2])
FRICTION = actuator_friction(SEALS, 3e6, 3e6).coulomb_friction


def test_scale_drift_and_residual_of_a_day_are_those_of_its_machine(tmp_path):
    worn = replace(Day(FRICTION), scale=lambda time: 1.0 + 0.4 * time / 80.0)
    found = bag_summary(write_day(tmp_path / 'bag', worn, 80.0), Chosen(override=chosen_configuration(None, SEAL)))
    assert found.replay == NOTHING_RECORDED
    assert found.duration == pytest.approx(80.0, abs=0.1)
    assert found.messages == 3 * 8000
    assert found.scale == pytest.approx(1.3, abs=0.05)
    assert found.drift == pytest.approx(1.35 / 1.05 - 1.0, abs=0.1)
    assert abs(found.drift) > 1.96 * found.drift_std
    assert 0.1 < found.residual < 0.4
    assert found.health == ''


def test_levels_are_by_the_larger_pressure_of_the_time_and_no_nonsense_makes_one(tmp_path):
    source = write_day(tmp_path / 'source', Day(FRICTION), 6.0)
    first = []

    def changed(_, message):
        if message.type_name != PRESSURE_TYPE:
            return message
        first.append(message.log_time)
        time = (message.log_time - first[0]) / SECOND
        high = 2.5e6 if time < 3.0 else 7.25e6 if time < 4.5 else 1e300
        return message._replace(data=encode(Pressure(message.log_time, 1.0e6, high), b'rod'))

    bag = rewrite(source, tmp_path / 'bag', changed)
    levels = bag_summary(bag, Chosen(override=chosen_configuration(None, SEAL))).levels
    table = dict(zip(LEVEL_COLUMNS, levels.T, strict=True))
    np.testing.assert_array_equal(table['pressure'], [2.5e6, 7.5e6])
    assert table['samples'][0] == pytest.approx(2.0 * table['samples'][1], rel=0.2)
    for pressure, friction in zip((2.5e6, 7.25e6), table['coulomb_friction'], strict=True):
        assert friction == pytest.approx(actuator_friction(SEALS, 1e6, pressure).coulomb_friction, rel=1e-6)


def test_a_recorded_bag_is_identical_and_a_folder_without_a_bag_is_an_error(tmp_path):
    assert bag_summary(ROOT / 'bags' / 'pull_test').replay == IDENTICAL
    with pytest.raises(BagError, match='not a rosbag2 bag'):
        bag_summary(tmp_path)
