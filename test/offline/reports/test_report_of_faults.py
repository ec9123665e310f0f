"""A report of a run with sensor faults: the absurd is left out, the page is made."""

from pathlib import Path

import pytest
from harness.report_page import checked_page

from seal_friction_ros.core.messages.coder import encode
from seal_friction_ros.core.messages.layouts import FORCE_TYPE, PRESSURE_TYPE, VELOCITY_TYPE
from seal_friction_ros.core.messages.records import Force, Pressure, Velocity
from seal_friction_ros.offline.bags.bag import FORCE_TOPIC, PRESSURE_TOPIC, VELOCITY_TOPIC, BagWriter
from seal_friction_ros.offline.replay.replay import replay
from seal_friction_ros.offline.reports.bag_report import write_report

ABSURD = 1e308  # [SI] finite, and what it is computed with overflows


@pytest.mark.renders
def test_absurd_velocities_pressures_and_forces_do_not_keep_the_report_from_being_made(tmp_path: Path):
    with BagWriter(tmp_path / 'inputs') as writer:
        for i in range(300):
            stamp = 1_000_000_000 + i * 10_000_000
            pressure = Pressure(stamp, ABSURD if i == 50 else 1e6, 1e6)
            force = Force(stamp, -ABSURD if i == 70 else 10.0)
            velocity = Velocity(stamp, {90: ABSURD, 91: -ABSURD}.get(i, 0.05), b'rod')
            writer.write(PRESSURE_TOPIC, PRESSURE_TYPE, stamp, encode(pressure))
            writer.write(FORCE_TOPIC, FORCE_TYPE, stamp, encode(force))
            writer.write(VELOCITY_TOPIC, VELOCITY_TYPE, stamp, encode(velocity))
    replay(tmp_path / 'inputs', out=tmp_path / 'out')
    summary = write_report(tmp_path / 'out', tmp_path / 'report.html')
    assert 'status' in checked_page(summary.page).figures
    assert summary.numbers['status_counts']['VELOCITY_OUT_OF_RANGE'] == 2
