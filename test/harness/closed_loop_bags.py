"""Bags of a closed servo loop: the servo of the simulator, estimate and feed-forward in one loop, without ROS."""

from pathlib import Path

from harness.compensation import SCALE, compensating
from seal_friction_ros.core.estimation import pipeline
from seal_friction_ros.core.estimation.configuration import Snapshot, snapshot_text
from seal_friction_ros.core.messages.coder import decode, encode, encode_text
from seal_friction_ros.core.messages.layouts import CONFIGURATION_TYPE, FEEDFORWARD_TYPE, INPUTS
from seal_friction_ros.core.messages.records import Force, Position, Pressure, ServoReference, Velocity
from seal_friction_ros.core.servo.motions import Sine, Wave
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, outputs, step
from seal_friction_ros.offline.bags import bag as b
from seal_friction_ros.offline.bags.actuator_bag import ANSWER_TOPICS

RATE = 1000  # [Hz]
START = 1_700_000_000_000_000_000  # [ns]


def write_closed_loop(
    path: Path, scales: tuple[float, ...] = (0.0, SCALE), seconds: float = 2.0, waves: tuple[Wave, ...] = (Sine(),)
) -> Path:
    """A servo that follows a wave, ``seconds`` with each Coulomb scale, changed live (and the wave with it)."""
    servo = ServoParameters(
        seals=compensating().parameters().estimator.seals, control_period=1.0 / RATE, inner_step=1e-4
    )
    state = init(servo)
    now = outputs(servo, state.plant)
    known = pipeline.init_running(compensating(scale=scales[0]).parameters())
    samples = round(seconds * RATE)
    with b.BagWriter(path) as writer:
        for stretch, scale in enumerate(scales):
            configuration = compensating(scale=scale)
            parameters, wave = configuration.parameters(), waves[stretch % len(waves)]
            text = encode_text(snapshot_text(Snapshot(configuration, known)))
            stamp = START + stretch * samples * (1_000_000_000 // RATE)
            writer.write(b.CONFIGURATION_TOPIC, CONFIGURATION_TYPE, stamp, text)
            for i in range(stretch * samples, (stretch + 1) * samples):
                stamp, wanted, force = START + i * (1_000_000_000 // RATE), wave.at(i / RATE), 0.0
                inputs = (
                    (b.REFERENCE_TOPIC, ServoReference(stamp, *wanted, b'rod')),
                    (b.PRESSURE_TOPIC, Pressure(stamp, now.pressure_a, now.pressure_b)),
                    (b.FORCE_TOPIC, Force(stamp, now.force_sum)),
                    (b.POSITION_TOPIC, Position(stamp, now.position)),
                    (b.VELOCITY_TOPIC, Velocity(stamp, now.velocity, b'rod')),
                )
                for topic, record in inputs:
                    writer.write(topic, INPUTS[topic.strip('/')], stamp, encode(record))
                    known, answers = pipeline.answered(parameters, known, record, stamp)
                    for kind, data in answers:
                        writer.write(ANSWER_TOPICS[kind], kind, stamp, data)
                        force = decode(kind, data).force if kind == FEEDFORWARD_TYPE else force
                state, now = step(servo, state, wanted, force)
    return path
