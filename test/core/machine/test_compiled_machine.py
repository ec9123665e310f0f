"""A machine whose states are in compiled memory answers as one of plain Python."""

import math

from harness.machines import EXCAVATOR, made, message

from seal_friction_ros.core.estimation.compiled_state import CompiledState, receive
from seal_friction_ros.core.machine import machine as m

MS = 1_000_000  # [ns]


def test_states_in_compiled_memory_give_the_same_answers_and_the_same_states():
    machine = made(EXCAVATOR)
    plain = m.init(machine)
    pairs = zip(machine.actuators, plain.actuators, strict=True)
    held = m.MachineState(
        tuple(known._replace(pipeline=CompiledState(one.pipeline, known.pipeline)) for one, known in pairs)
    )
    names = ['boom', 'arm', 'bucket']
    for i in range(1, 1000):
        stamp, side = i * 2 * MS, 1.0 if i // 150 % 2 else -1.0
        speeds = [0.1 * side, math.nan if i % 97 == 0 else 0.0, -0.05 * side]
        for topic, data in (
            ('/a', message('std_msgs/Float64MultiArray', data=[20.0 + side, 30.0, 40.0])),
            ('/b', message('std_msgs/Float64MultiArray', data=[10.0, 10.0, 10.0])),
            ('/set', message('sensor_msgs/JointState', stamp, name=names, velocity=speeds)),
            ('/joint_states', message('sensor_msgs/JointState', stamp, name=names, velocity=speeds)),
        ):
            before, expected, found = plain, [], []
            plain = m.receive(machine, plain, topic, data, stamp, lambda *answer, to=expected: to.append(answer))
            held = m.receive(machine, held, topic, data, stamp, lambda *answer, to=found: to.append(answer), receive)
            assert found == expected
            for known, one, other in zip(before.actuators, plain.actuators, held.actuators, strict=True):
                assert other.pipeline.turn_since(None) == one.pipeline.turn_since(known.pipeline)
                assert repr(other.pipeline.pressure) == repr(one.pipeline.pressure)
    records = [known._replace(pipeline=known.pipeline.records) for known in held.actuators]
    assert repr(records) == repr(list(plain.actuators))
    assert plain.actuators[0].pipeline.estimator.adaptation.learnt.reversals > 1
