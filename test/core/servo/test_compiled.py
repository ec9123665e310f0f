"""The servo compiled by numba gives the numbers of the servo in Python."""

import json
import os
import subprocess
import sys

from paths import ROOT

RUN = """
import json, sys, time, yaml
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.servo.motions import Chirp
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.servo.position_servo import ServoParameters, init, simulate
seal = parse_seal(yaml.safe_load(open('config/seals/ms28775_114.yaml')))
servo = ServoParameters(seals=(MountedSeal(seal, 'a'), MountedSeal(seal, 'b')))
wave = Chirp(amplitude=0.02, end_frequency=20.0, duration=1.0)  # runs into every limit, and cavitates
loads = [2000.0 if 1000 < i < 1200 else 0.0 for i in range(2400)]
references = [wave.at(i * servo.control_period) for i in range(2400)]
state, rows = simulate(servo, init(servo), references, 5.0, loads)
plant = [v.hex() if isinstance(v, float) else v for v in state.plant]
print(json.dumps([plant, rows.position[::100].tolist()]))
"""


def run(disable_jit):
    environment = os.environ | {'NUMBA_DISABLE_JIT': disable_jit}
    done = subprocess.run([sys.executable, '-c', RUN], cwd=ROOT, env=environment, capture_output=True, check=True)
    return json.loads(done.stdout)


def test_compiled_and_python_agree_to_the_bit():
    fast, fast_positions = run('0')
    slow, slow_positions = run('1')
    assert fast == slow
    assert fast_positions == slow_positions
    assert fast[-1] > 3  # stick and slip
