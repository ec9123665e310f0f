"""The friction test that the README rehearses on the simulator is one that ``identify`` takes."""

from pathlib import Path

import pytest
from harness.pull_test_bag import program, write_pull_test

from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.commands.main import main


def test_the_rehearsed_test_gives_the_sliding_friction_of_the_simulated_seals(tmp_path: Path):
    plan, out = program(), tmp_path / 'found.yaml'
    assert main(['identify', str(write_pull_test(tmp_path / 'bag', plan)), '--out', str(out)]) == 0
    law = parse_seal(read_yaml(out)).coulomb_law
    truth = parse_seal(read_yaml(config_path('seals', 'ms28775_114'))).coulomb_law
    for i in range(plan.intervals + 1):
        pressure = plan.pressure_max * i / plan.intervals
        assert law.coulomb_friction(pressure) == pytest.approx(truth.coulomb_friction(pressure), rel=0.06)
