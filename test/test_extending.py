"""A friction law is one new module and one registry line: the recipe of docs/extending.md works everywhere.

The toy law of the recipe runs in the live node, in replay message by message and compiled, in the servo simulator and
in `identify`, and goes through a seal file and back. One seal, since the time to compile grows with each.
"""

import csv
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from harness.identify_run import Run
from harness.live_graph import graph
from paths import ROOT

from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.core.friction.laws import FRICTION_LAWS
from seal_friction_ros.core.friction.seal_file import law_document, mount_seals, parse_seal
from seal_friction_ros.core.servo import position_servo
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.core.servo.position_servo import ServoParameters
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.bags.bag import bag_topics
from seal_friction_ros.offline.replay.parallel_replay import verify

RECIPE = (ROOT / 'docs' / 'extending.md').read_text()
TOY_LAW = (ROOT / 'test' / 'harness' / 'tanh_law.py').read_text()
SECOND = 10**9  # [ns]
NAMED = ('test_every_law_is_on_an_actuator', 'test_tables_are_those_of_the_code')
"""Tests that fail until the last steps of the recipe."""


@pytest.fixture(scope='module')
def toy_law(tmp_path_factory):
    """Module of the law of the recipe, and the registry line."""
    name = re.search(r'`seal_friction_ros/(core/friction/laws/\w+)\.py`', RECIPE)[1].replace('/', '.')
    path = tmp_path_factory.mktemp('laws') / f'{name.rpartition(".")[2]}.py'
    path.write_text(TOY_LAW)
    spec = importlib.util.spec_from_file_location(f'seal_friction_ros.{name}', path)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    FRICTION_LAWS.append(module.TanhLaw)
    with pytest.MonkeyPatch.context() as patch:  # other processes cannot load compiled code of a law they do not have
        patch.setattr('numba.core.caching.IndexDataCacheFile.save', lambda *_: None)
        yield module.TanhLaw
    FRICTION_LAWS.pop()
    del sys.modules[spec.name]


@pytest.fixture
def seal_file(toy_law, tmp_path) -> Path:
    """Seal file with the parameters of the recipe."""
    document = yaml.safe_load(re.search(r'```yaml\n(coulomb_law: tanh_law.*?)```', RECIPE, re.DOTALL)[1])
    document |= {
        'name': 'toy',
        'source': 'docs/extending.md',
        'stiction': 2.0,
        'uncertainty': {'relative_std': 0.1},
        'identified_pressure': [0.0, 7e6],
    }
    path = tmp_path / 'toy.yaml'
    path.write_text(yaml.safe_dump(document))
    return path


def friction(pressure: float, speed: float) -> float:
    """Equation of the recipe with its parameters [N]."""
    return (6.0 + 20.0 * np.tanh(pressure / 4e6)) * np.exp(-speed / 0.5)


def test_the_seal_file_is_read_and_written_back_unchanged(toy_law, seal_file):
    document = read_yaml(seal_file)
    seal = parse_seal(document)
    assert isinstance(seal.coulomb_law, toy_law)
    again = parse_seal({**document, **law_document(seal.coulomb_law)})
    assert again == seal
    assert law_document(again.coulomb_law)['tanh_law'] == {**document['tanh_law'], 'reference_speed': 0.0}
    estimate = actuator_friction(mount_seals((document, document), ('a', 'b')), 1e6, 3e6, 0.2)
    expected = friction(1e6, 0.2) + friction(3e6, 0.2)
    assert estimate.coulomb_friction + estimate.velocity_friction == pytest.approx(expected, rel=1e-12)
    assert estimate.coulomb_friction == pytest.approx(friction(1e6, 0.0) + friction(3e6, 0.0), rel=1e-12)


@pytest.fixture
def live_bag(seal_file, tmp_path) -> Path:
    """Recording of the live node, whose estimates were those of the law."""
    parameters = {
        'record': True,
        'record_directory': str(tmp_path),
        'record_name': 'bag',
        'seals': [str(seal_file)],
        'seal_chambers': ['a'],
    }
    with graph(parameters) as g:
        g.connect()
        for i in range(40):
            velocity, pressure = 0.3 * np.sin(0.3 * i), 1e6 + 1e5 * i
            estimate = g.estimate(SECOND + i * 10**7, velocity, pressure=pressure)
            if abs(velocity) > 0.01:
                expected = friction(pressure, abs(velocity)) * np.sign(velocity)
                assert estimate.friction_force == pytest.approx(expected, rel=1e-12)
    return tmp_path / 'bag'


def test_the_live_node_runs_it_and_its_recording_verifies(live_bag):
    assert verify(live_bag, bulk_from=10**9).identical
    assert '/friction_estimate' in bag_topics(live_bag)


@pytest.mark.long  # compiles the replay anew
def test_compiled_replay_runs_it_and_gives_the_same_bytes(live_bag):
    one_by_one, compiled = (verify(live_bag, bulk_from=count) for count in (10**9, 0))
    assert one_by_one == compiled
    assert compiled.identical


@pytest.mark.long  # compiles the plant anew
def test_the_servo_simulator_runs_it(seal_file):
    servo = ServoParameters(seals=mount_seals((read_yaml(seal_file),), ('a',)))
    wave, period = Sine(amplitude=0.002, frequency=5.0), servo.control_period
    references = (wave.at(i * period) for i in range(round(0.4 / period)))
    _, run = position_servo.simulate(servo, position_servo.init(servo), references)
    acceleration = np.gradient(run.velocity, period)
    by_momentum = run.force_sum - servo.load.mass * acceleration  # m a = force_sum - friction
    expected = friction(np.maximum(run.pressure_a, 0.0), np.abs(run.velocity))
    sliding = np.abs(run.velocity) > 0.01  # [m/s]
    assert sliding.mean() > 0.5
    error = by_momentum[sliding] - np.sign(run.velocity[sliding]) * expected[sliding]
    assert np.sqrt(np.mean(error**2)) < 0.02 * np.mean(expected[sliding])


@pytest.mark.long  # runs the tests of three rooms
def test_only_the_tests_that_the_recipe_names_turn_red(tmp_path):
    tree = shutil.copytree(ROOT, tmp_path / 'tree', ignore=shutil.ignore_patterns('.*', 'build', '__pycache__'))
    laws = tree / 'seal_friction_ros' / 'core' / 'friction' / 'laws'
    (laws / 'tanh_law.py').write_text(TOY_LAW)
    registry = (laws / '__init__.py').read_text().replace('FrictionMap]', 'FrictionMap, TanhLaw]')
    module = 'seal_friction_ros.core.friction.laws.tanh_law'
    (laws / '__init__.py').write_text(registry.replace('\n\n', f'\n\nfrom {module} import TanhLaw\n', 1))
    places = ('core/friction', 'core/identification', 'core/estimation/test_compiled_pipeline.py::' + NAMED[0],
              'test_docs.py::' + NAMED[1])  # fmt: skip
    run = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-m', 'not long', *(f'test/{place}' for place in places)],
        cwd=tree, env=os.environ | {'PYTHONPATH': str(tree)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    red = re.findall(r'^(?:FAILED|ERROR) \S+::(\w+)', run.stdout, re.MULTILINE)
    assert sorted(set(red)) == sorted(NAMED), run.stdout
    assert all(f'`{name}`' in RECIPE for name in NAMED)


def test_identify_finds_its_parameters_again(toy_law, tmp_path):
    random = np.random.default_rng(7)
    table, fields = tmp_path / 'table.csv', ('pressure_bar', 'friction_N', 'direction', 'velocity_m_per_s', 'test')
    with table.open('w', newline='') as file:
        rows = csv.writer(file)
        rows.writerow(fields)
        for test in range(1, 4):
            for bar in (5, 10, 20, 30, 40, 50, 60, 70):
                for speed in (0.02, 0.1, 0.3):
                    measured = friction(bar * BAR, speed) * random.normal(1.0, 0.01)
                    rows.writerow((bar, f'{measured:.3f}', 'extend', speed, test))
    run = Run(tmp_path, str(table), '--law', toy_law.NAME)
    assert run.code == 0, run.errors
    errors = {rung['law']: rung['error'] for rung in run.figures['ladder'] if 'error' in rung}
    assert min(errors, key=errors.get) == toy_law.NAME
    found = run.document['tanh_law']
    assert found['friction_at_no_pressure'] == pytest.approx(6.0, rel=0.05)
    assert found['pressure_friction'] == pytest.approx(20.0, rel=0.05)
    assert found['decay_speed'] == pytest.approx(0.5, rel=0.1)
    assert isinstance(parse_seal(run.document).coulomb_law, toy_law)
