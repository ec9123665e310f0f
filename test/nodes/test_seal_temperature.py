"""The live node takes sensor_msgs/Temperature: the friction follows, diagnostics say if it is missing, bags replay."""

from pathlib import Path

import pytest
import yaml
from harness.live_graph import graph
from paths import ROOT
from seal_friction_msgs.msg import FrictionEstimate
from sensor_msgs.msg import Temperature

from seal_friction_ros.core.friction.temperature import TemperatureScale, scale_at
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags.bag import bag_topics
from seal_friction_ros.offline.replay.replay import replay

SECOND = 10**9  # [ns]
PART = {'reference': 300.0, 'coefficient': 0.012, 'coefficient_std': 0.001, 'lowest': 285.0, 'highest': 335.0}


@pytest.fixture
def seal_file(tmp_path: Path) -> Path:
    """A seal whose friction depends on the temperature."""
    path = tmp_path / 'warm.yaml'
    path.write_text(yaml.safe_dump(read_yaml(ROOT / 'config' / 'seals' / 'ms28775_114.yaml') | {'temperature': PART}))
    return path


def send(g, publisher, stamp: int, celsius: float) -> None:
    """Three readings, the fewest that are believed."""
    for earlier in (2, 1, 0):
        message = Temperature(temperature=celsius)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp - earlier * SECOND // 10, SECOND)
        taken = g.estimator.taken
        publisher.publish(message)
        assert g.spin_until(lambda taken=taken: g.estimator.taken > taken)


def test_the_friction_follows_the_topic_and_the_bag_replays_to_the_byte(seal_file: Path, tmp_path: Path):
    recording = {'record': True, 'record_directory': str(tmp_path), 'record_name': 'bag'}
    with graph({'seals': [f'{seal_file}@a', f'{seal_file}@b'], **recording}) as g:
        publisher = g.probe.create_publisher(Temperature, 'seal_temperature', 10)
        g.connect()
        assert g.spin_until(lambda: publisher.get_subscription_count() == 1)
        missing = g.estimate(SECOND, 0.1)
        assert missing.status == FrictionEstimate.TEMPERATURE_MISSING
        assert g.spin_until(lambda: 'TEMPERATURE_MISSING' in g.probe.values('estimate').get('message', ''))
        scale = TemperatureScale(**PART)
        for number, celsius in enumerate((20.0, 50.0), start=2):
            send(g, publisher, number * SECOND, celsius)
            found = g.estimate(number * SECOND, 0.1)
            assert found.status == 0
            expected = missing.coulomb_friction * scale_at(scale, celsius + 273.15)
            assert found.coulomb_friction == pytest.approx(expected)
        assert g.estimate(14 * SECOND, 0.1).status == FrictionEstimate.TEMPERATURE_MISSING  # 11 s old
        send(g, publisher, 14 * SECOND, 80.0)
        assert g.estimate(15 * SECOND, 0.1).status == FrictionEstimate.OUTSIDE_IDENTIFIED_TEMPERATURE
        g.estimator.finish()
    assert bag_topics(tmp_path / 'bag')['/seal_temperature'].message_count == 9
    assert replay(tmp_path / 'bag').identical
