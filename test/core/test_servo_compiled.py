"""The servo compiled by numba gives the numbers of the servo in Python, and is fast."""

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RUN = """
import json, sys, time, yaml
from seal_friction_ros.core.compiled import COMPILED
from seal_friction_ros.core.coulomb import MountedSeal
from seal_friction_ros.core.reference import Chirp
from seal_friction_ros.core.seal_file import parse_seal
from seal_friction_ros.core.servo import ServoParameters, init, simulate
seal = parse_seal(yaml.safe_load(open('config/seals/ms28775_114.yaml')))
servo = ServoParameters(seals=(MountedSeal(seal, 'a'), MountedSeal(seal, 'b')))
wave = Chirp(amplitude=0.02, end_frequency=20.0, duration=1.0)  # runs into every limit, and cavitates
loads = [2000.0 if 1000 < i < 1200 else 0.0 for i in range(2400)]
references = [wave.at(i * servo.control_period) for i in range(2400)]
state, rows = simulate(servo, init(servo), references, 5.0, loads)
plant = [v.hex() if isinstance(v, float) else v for v in state.plant]
print(json.dumps([COMPILED, plant, rows.position[::100].tolist()]))
"""

needs_numba = pytest.mark.skipif(find_spec('numba') is None, reason='numba is not installed')


def run(disable_jit):
    environment = os.environ | {'NUMBA_DISABLE_JIT': disable_jit}
    done = subprocess.run([sys.executable, '-c', RUN], cwd=ROOT, env=environment, capture_output=True, check=True)
    return json.loads(done.stdout)


@needs_numba
def test_compiled_and_python_agree_to_the_bit():
    compiled, fast, fast_positions = run('0')
    plain, slow, slow_positions = run('1')
    assert (compiled, plain) == (True, False)
    assert fast == slow
    assert fast_positions == slow_positions
    assert fast[-1] > 3  # stick and slip


@needs_numba
def test_50_times_real_time_at_a_tenth_of_a_millisecond():
    command = [sys.executable, 'bench/servo.py', '--json']
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    factor = {row['inner_step']: row['simulate'] for row in json.loads(done.stdout)['rows']}
    assert factor[1e-4] >= 50.0
