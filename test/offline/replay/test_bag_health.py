"""``health`` and ``adapt`` tell of days what was put into them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from harness.simulated_day import SECOND, Day, write_day
from numba.core import event
from paths import ROOT

from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.core.friction.mounting import CHAMBERS
from seal_friction_ros.core.friction.seal_file import mount_seals
from seal_friction_ros.files import read_yaml
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay.bag_health import bag_health, health_of_bags
from seal_friction_ros.offline.replay.bag_parts import Chosen
from seal_friction_ros.offline.replay.compiled_replay import compile_first
from seal_friction_ros.offline.replay.parallel_replay import verify
from seal_friction_ros.offline.replay.replay import chosen_configuration

SEAL = ROOT / 'config' / 'seals' / 'ms28775_114.yaml'
SEALS = mount_seals([read_yaml(SEAL)] * 2, CHAMBERS[:2])
FRICTION = actuator_friction(SEALS, 3e6, 3e6).coulomb_friction
DAY = Day(FRICTION)
MONDAY = 1_700_000_000 * SECOND
HOUR = 3600 * SECOND


@pytest.fixture(scope='module')
def week(tmp_path_factory):
    """Four days on which the friction rises by 10 % each."""
    folder = tmp_path_factory.mktemp('week')
    return [
        write_day(folder / f'day{i}', replace(DAY, scale=lambda _, i=i: 1.0 + 0.1 * i), 40.0, i, MONDAY + i * HOUR)
        for i in range(4)
    ]


def health(capsys, *arguments):
    code = main(['health', '--json', '--seal', str(SEAL), *map(str, arguments)])
    return code, json.loads(capsys.readouterr().out)


def test_health_tells_the_friction_of_each_day_and_its_trend(week, capsys, tmp_path):
    code, told = health(capsys, *reversed(week), '--out', tmp_path / 'week.html')
    assert code == 0
    assert [bag['bag'] for bag in told['bags']] == [str(bag) for bag in week]  # in order of time
    for i, bag in enumerate(told['bags']):
        assert bag['scale'] == pytest.approx(1.0 + 0.1 * i, rel=0.04)
        assert bag['reversals'] > 30
        assert abs(bag['offset']) < 0.05 * FRICTION
    slope, std = told['trends_per_hour']['scale']['value'], told['trends_per_hour']['scale']['std']
    assert slope == pytest.approx(0.1, abs=3.0 * std + 0.01)
    assert '<h1' in (tmp_path / 'week.html').read_text()


def test_health_finds_the_time_of_a_change(capsys, tmp_path):
    bag = write_day(tmp_path / 'bag', replace(DAY, scale=lambda time: 1.3 if time > 300.0 else 1.0), 600.0)
    _, told = health(capsys, bag)
    (change,) = told['changes']
    assert change['time_s'] - MONDAY / SECOND == pytest.approx(300.0, abs=30.0)
    assert change['scale_before'] == pytest.approx(1.0, abs=0.05)


def test_a_day_beyond_its_limits_is_an_alarm(week, capsys):
    _, told = health(capsys, week[3], '--scale-high', '1.05')
    assert told['bags'][0]['alarms']
    assert not health(capsys, week[0])[1]['bags'][0]['alarms']


def test_adapt_saves_a_seal_file_with_the_friction_of_the_day(week, tmp_path, capsys):
    out = tmp_path / 'today.yaml'
    assert main(['adapt', str(week[3]), '--seal', str(SEAL), '--out', str(out)]) == 0
    assert 'friction_scale' in capsys.readouterr().out
    seals = mount_seals([read_yaml(out)] * 2, CHAMBERS[:2])
    assert actuator_friction(seals, 3e6, 3e6).coulomb_friction == pytest.approx(1.3 * FRICTION, rel=0.04)
    again = tmp_path / 'again.yaml'
    assert main(['adapt', str(week[3]), '--seal', str(out), '--out', str(again)]) == 0
    assert read_yaml(again)['friction_scale'] == pytest.approx(read_yaml(out)['friction_scale'], rel=0.01)


def test_adapt_refuses_a_bag_without_reversals(tmp_path, capsys):
    bag = write_day(tmp_path / 'bag', replace(DAY, one_direction=True), 5.0)
    assert main(['adapt', str(bag), '--seal', str(SEAL), '--out', str(tmp_path / 'seal.yaml')]) == 2
    assert 'too few reversals' in capsys.readouterr().err
    assert not (tmp_path / 'seal.yaml').exists()


@pytest.mark.parametrize('mode', ['observe', 'on'])
def test_what_is_learnt_replays_to_the_same_bytes_one_by_one_and_compiled(mode, tmp_path):
    load = replace(DAY, scale=lambda _: 1.4, load=lambda time: 3.0 * FRICTION * (time > 11.3))
    bag, parameters = write_day(tmp_path / 'bag', load, 30.0), tmp_path / 'parameters.yaml'
    parameters.write_text(f"/**: {{ros__parameters: {{adaptation.mode: '{mode}', stamp_age_max: 0.0}}}}\n")
    out = tmp_path / 'out'
    options = ['--seal', str(SEAL), '--params', str(parameters), '--out', str(out)]
    assert main(['replay', str(bag), *options]) == 0
    for bulk_from in (10**9, 0):
        verdict = verify(out, bulk_from=bulk_from)
        assert verdict.identical
        assert verdict.recorded_estimates == 3000


def test_bags_are_followed_in_parallel_as_one_by_one_by_code_that_is_compiled_before(week):
    override = chosen_configuration(None, SEAL)
    alone = [bag_health(bag, '', override) for bag in week]
    together = [outcome.result for outcome in health_of_bags(week, Chosen(override=override), workers=2)]
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_equal(one[:7], other[:7])
    with event.install_recorder('numba:compile') as compilations:
        compile_first(week, Chosen(override=override))
        bag_health(week[0], '', override)
    assert not compilations.buffer
