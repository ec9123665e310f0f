"""One run has one verdict: the right one, the same on every page, for every command and in the live view."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from harness.closed_loop_bags import write_closed_loop
from harness.example_bags import as_recorded, read_whole, rewrite
from harness.report_page import checked_page
from harness.simulated_day import Day, write_day
from paths import ROOT

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.friction.actuator import actuator_friction
from seal_friction_ros.core.messages.coder import decode, encode
from seal_friction_ros.core.messages.layouts import FORCE_TYPE, PRESSURE_TYPE
from seal_friction_ros.core.servo.motions import Sine
from seal_friction_ros.files import load_configuration
from seal_friction_ros.offline.bags.bag import BagError, BagWriter
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.monitor.recorded_view import RecordedView
from seal_friction_ros.offline.replay.replay import chosen_configuration, replay

SEAL = ROOT / 'config' / 'seals' / 'ms28775_114.yaml'
OWN, PLACEHOLDER = chosen_configuration(None, SEAL), load_configuration(SealSelection(), EstimatorSettings())
FRICTION = actuator_friction(OWN.parameters().estimator.seals, 3e6, 3e6).coulomb_friction
SECONDS = 60.0
HOUR = 3600.0
TOO_MUCH = 2.0  # [-] scale of a feed-forward
SMALL = Sine(amplitude=0.0005)  # that a rod without feed-forward does not follow: with twice the friction it overshoots
DAY = replace(Day(FRICTION), dip=0.0, presliding=1e-6)


def record(folder: Path, name: str, day: Day = DAY, seconds: float = SECONDS, change=None, configuration=OWN) -> Path:
    """A day as a live node records it; ``change`` is made to each input."""
    inputs = write_day(folder / 'inputs' / name, day, seconds)
    if change is not None:
        inputs = rewrite(inputs, folder / 'changed' / name, change)
    replayed = folder / 'replayed' / name
    replay(inputs, configuration, out=replayed)
    return rewrite(replayed, folder / name, lambda _, message: as_recorded(message))


def without_pressure(number: int, message):
    """A fifth of the pressures is not a number, in stretches of three seconds."""
    if message.type_name != PRESSURE_TYPE or number // 900 % 5:
        return message
    return message._replace(data=encode(decode(PRESSURE_TYPE, message.data)._replace(chamber_a=float('nan')), b'rod'))


def against(_, message):
    """The force sum with the other sign."""
    if message.type_name != FORCE_TYPE:
        return message
    record = decode(FORCE_TYPE, message.data)
    return message._replace(data=encode(record._replace(force=-record.force), b'rod'))


@pytest.fixture(scope='module')
def bags(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp('bags')
    drifting = replace(DAY, scale=lambda time: 0.93 + 0.15 * time / SECONDS)
    record(folder, 'good')
    record(folder, 'placeholder', configuration=PLACEHOLDER)
    record(folder, 'drifting', drifting)
    record(folder, 'weaker', replace(DAY, scale=lambda _: 0.83))
    record(folder, 'faults', change=without_pressure)
    record(folder, 'wrong_sign', change=against)
    record(folder, 'short', seconds=2.5)
    with BagWriter(folder / 'empty'):
        pass
    write_closed_loop(folder / 'raised', (0.0, TOO_MUCH), waves=(SMALL,))
    replay(folder / 'raised', None, folder / 'replayed_raised')
    return folder


RUNS = {
    'good': ('good', 'measured strokes lie in the 95 % band'),
    'placeholder': ('bad', 'placeholder'),
    'drifting': ('look', 'the friction drifts by +1'),
    'weaker': ('look', 'the friction is 0.83 times that of the seal file (-17 %)'),
    'faults': ('bad', 'the pressure is not a finite number'),
    'wrong_sign': ('bad', 'the force sum is against the motion'),
    'short': ('look', 'a verdict takes 4'),
    'empty': ('bad', 'nothing to estimate from'),
    'raised': ('bad', 'the feed-forward raises the tracking error by'),
    'replayed_raised': ('bad', 'the feed-forward raises the tracking error by'),
}
"""Name of a run -> its verdict, and words of the reason that decides."""
CHANGES = {'good': 'no change beyond the noise', 'weaker': 'sliding friction -17.0 %'}
"""What decides between a run and the good one, where the change does."""


def told(capsys, *words) -> dict:
    code = main([*map(str, words), '--json'])
    said = capsys.readouterr()
    found = json.loads(said.out or '{"errors": [""]}')
    if found.get('errors'):  # refused
        assert code == 2
        assert '\n' not in said.err.strip()
        raise BagError(said.err)
    return found


def by_report(bags, name, tmp_path, capsys):
    found = told(capsys, 'report', bags / name, '--out', tmp_path / 'page.html')['numbers']
    said = checked_page(tmp_path / 'page.html').texts['p.said'][0]
    assert found['verdict'] in said
    return found['level'], found['verdict']


def by_fleet(bags, name, tmp_path, capsys):
    (tmp_path / 'bags.txt').write_text(str(bags / name))
    words = ('--out', tmp_path / 'page.html', '--workers', '1')
    found = told(capsys, 'fleet', tmp_path / 'bags.txt', *words)
    (bag,) = found['bags']
    assert found['level'] == bag['level']
    return bag['level'], bag['why']


def by_health(bags, name, tmp_path, capsys):
    found = told(capsys, 'health', bags / name, '--out', tmp_path / 'page.html', '--workers', '1')
    return found['level'], found['verdict']


def by_compare(bags, name, tmp_path, capsys):
    found = told(capsys, 'compare', bags / 'good', bags / name, '--out', tmp_path / 'page.html')['numbers']
    return found['level'], found['verdict']


def by_live_view(bags, name, tmp_path, capsys):
    now = read_whole(RecordedView(bags / name)).view('', -1.0)['now']
    return now['verdict'], now['reason']


@pytest.mark.parametrize('ask', [by_report, by_fleet, by_health, by_compare, by_live_view])
@pytest.mark.parametrize('name', RUNS)
def test_a_run_has_one_verdict_with_the_reason_that_decides(ask, name, bags, tmp_path, capsys):
    try:
        level, reason = ask(bags, name, tmp_path, capsys)
    except BagError as error:
        assert name == 'empty'
        level, reason = 'bad', str(error)
    wanted, words = RUNS[name]
    words = CHANGES.get(name, words) if ask is by_compare else words
    assert (level, words.lower() in reason.lower()) == (wanted, True), reason


def test_a_first_bag_without_a_message_is_refused_too(bags, tmp_path, capsys):
    with pytest.raises(BagError, match='nothing to estimate from'):
        told(capsys, 'compare', bags / 'empty', bags / 'good', '--out', tmp_path / 'page.html')


@pytest.fixture(scope='module')
def hour(bags, tmp_path_factory) -> Path:
    """An hour at 50 Hz whose friction drifts by 15 %, beside the good minute."""
    folder = tmp_path_factory.mktemp('hour')
    slow = replace(DAY, period=0.02, stroke_time=2.0, scale=lambda time: 0.93 + 0.15 * time / HOUR)
    record(folder, 'hour', slow, HOUR)
    (folder / 'good').symlink_to(bags / 'good')
    return folder


@pytest.mark.long
@pytest.mark.parametrize('ask', [by_report, by_fleet, by_health, by_compare, by_live_view])
def test_a_drift_of_15_percent_within_an_hour_is_named(ask, hour, tmp_path, capsys):
    level, reason = ask(hour, 'hour', tmp_path, capsys)
    assert level == 'look'
    (drift,) = map(float, re.findall(r'the friction drifts by \+(\d+) % within 3[56]\d\d s', reason.lower()))
    assert drift == pytest.approx(15.0, abs=2.0)


def test_the_terminal_says_the_verdict_first(bags, tmp_path, capsys):
    assert main(['report', str(bags / 'drifting'), '--out', str(tmp_path / 'page.html')]) == 0
    assert capsys.readouterr().out.startswith('look: The friction drifts by +1')
    assert main(['compare', str(bags / 'good'), str(bags / 'weaker'), '--out', str(tmp_path / 'change.html')]) == 0
    assert capsys.readouterr().out.startswith('look: Sliding friction -17.0 %')
