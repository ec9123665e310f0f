"""The friction test of the thesis as a bag: the simulated rig of ``config/programs/pull_test.yaml``, without ROS."""

from pathlib import Path

from paths import ROOT

from harness.compensation import compensating
from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.configuration import Snapshot, snapshot_text
from seal_friction_ros.core.messages.coder import encode, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, INPUTS
from seal_friction_ros.core.messages.records import Force, Position, Pressure, Velocity
from seal_friction_ros.core.servo.motions import PullTest
from seal_friction_ros.core.servo.pull_rig import init_pull_rig, pull_rig, step_pull_rig
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags import bag as b

RATE = 500  # [Hz]
START = 1_700_000_000_000_000_000  # [ns]


def program() -> PullTest:
    """Plan of ``config/programs/pull_test.yaml``."""
    parameters = read_yaml(ROOT / 'config' / 'programs' / 'pull_test.yaml')['/servo_simulator']['ros__parameters']
    assert parameters['wave'] == 'pull_test'
    return PullTest(**parameters['pull_test'])


def write_pull_test(path: Path, plan: PullTest) -> Path:
    """Inputs of the whole plan, with two shipped seals."""
    configuration = compensating(scale=0.0)
    parameters = configuration.parameters()
    rig = pull_rig(plan, parameters.estimator.seals, 1.0 / RATE)
    state, known = init_pull_rig(rig), pipeline.init_running(parameters)
    with b.BagWriter(path) as writer:
        text = encode_text(snapshot_text(Snapshot(configuration, known)))
        writer.write(b.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, START, text)
        for i in range(round(plan.duration * RATE)):
            stamp = START + i * (1_000_000_000 // RATE)
            state, now = step_pull_rig(rig, state, i / RATE)
            for topic, record in (
                (b.PRESSURE_TOPIC, Pressure(stamp, now.pressure_a, now.pressure_b)),
                (b.FORCE_TOPIC, Force(stamp, now.force_sum)),
                (b.POSITION_TOPIC, Position(stamp, now.position)),
                (b.VELOCITY_TOPIC, Velocity(stamp, now.velocity, b'rod')),
            ):
                writer.write(topic, INPUTS[topic.strip('/')], stamp, encode(record))
    return path
