"""Every command takes every recording, and the same motion gives the same numbers whatever recorded it."""

import json
import subprocess
import sys
import time
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from statistics import median
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
import yaml
from harness.three_recordings import MASS, NAMES, PRESSURES, SAMPLES, SEALS, Recordings, friction, record

from seal_friction_ros import RecordedAxisSettings, read_bag, tune
from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE, FEEDFORWARD_TYPE, VELOCITY_TYPE
from seal_friction_ros.files import load_configuration
from seal_friction_ros.offline.bags.actuator_bag import open_actuator
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.monitor.actuator_view import COLUMNS
from seal_friction_ros.offline.replay.replay import Replay

KINDS = ('own', 'machine', 'foreign')
each_kind = pytest.mark.parametrize('kind', KINDS)
mostly_long = pytest.mark.parametrize(
    'kind', [pytest.param(kind, marks=[] if kind == 'machine' else pytest.mark.long) for kind in KINDS]
)
"""For commands of some seconds; those on own bags have quick tests of their own."""
MEAN = 0.75  # mean pressure at both seals over that of chamber a


def true_scale() -> float:
    """Friction over that of the seal files, mean of the later 15 reversals: 8 at the third pressure."""
    law = load_configuration(SealSelection(SEALS), EstimatorSettings()).parameters().estimator.seals[0].seal.coulomb_law
    third, fourth = (friction(p) / (law.bound(p, 0.0) + law.bound(0.5 * p, 0.0)) for p in PRESSURES[2:])
    return (8 * third + 7 * fourth) / 15


@pytest.fixture(scope='module')
def recordings(tmp_path_factory) -> Recordings:
    return record(tmp_path_factory.mktemp('recordings'))


@pytest.fixture(scope='module', params=['each', 'together'])
def machine(request, recordings, tmp_path_factory) -> Recordings:
    if request.param == 'each':
        return recordings
    return record(tmp_path_factory.mktemp('together'), request.param)


class Command:
    """Runs commands on one recording."""

    def __init__(self, recordings: Recordings, kind: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.bag, self.options = recordings.arguments(kind)
        self.folder, self._capsys = folder, capsys

    def numbers(self, *arguments: object) -> Any:
        """What a command prints as JSON; the options that name the actuator come last."""
        self._capsys.readouterr()
        code = main([*map(str, arguments), *self.options, '--json'])
        printed = self._capsys.readouterr()
        assert code == 0, printed.err
        return json.loads(printed.out)


@pytest.fixture
def command(recordings, kind, tmp_path, capsys) -> Command:
    return Command(recordings, kind, tmp_path, capsys)


@each_kind
def test_a_report_has_the_friction_of_the_axis(command, kind):
    found = command.numbers('report', command.bag, '--out', command.folder / 'page.html')['numbers']
    levels = found['friction']['sliding']
    assert [level['measured'] for level in levels] == pytest.approx([friction(p) for p in PRESSURES], rel=5e-3)
    assert [level['pressure'] for level in levels] == pytest.approx([MEAN * p for p in PRESSURES])
    assert sum(found['state_shares'].values()) == pytest.approx(1.0)
    assert len(found['tracking']) == 1
    title = command.bag.rpartition('/')[2] + ('' if kind == 'own' else ' axis')
    assert f'Seal friction: {title}<' in (command.folder / 'page.html').read_text()


@mostly_long
def test_a_bag_agrees_with_itself_and_a_page_compares_its_friction(command):
    found = command.numbers('compare', command.bag, command.bag)
    assert found['agree']
    assert found['pairs'] == SAMPLES
    page = command.numbers('compare', command.bag, command.bag, '--out', command.folder / 'page.html')
    changes = page['numbers']['sliding']
    assert [change['before'] for change in changes] == pytest.approx([friction(p) for p in PRESSURES], rel=5e-3)


def test_the_estimates_are_those_of_the_own_messages_whatever_recorded_them(recordings, capsys):
    for kind in ('machine', 'foreign'):
        bag, options = recordings.arguments(kind)
        assert main(['compare', str(recordings.own), bag, *options, '--atol', '1e-6', '--json']) == 0
        assert json.loads(capsys.readouterr().out)['pairs'] == SAMPLES


@each_kind
def test_health_follows_the_reversals_of_the_axis(command):
    (found,) = command.numbers('health', command.bag, '--out', command.folder / 'page.html')['bags']
    assert found['reversals'] == 30
    assert found['scale'] == pytest.approx(true_scale(), rel=0.035)  # it follows each new pressure within strokes


@each_kind
def test_a_fleet_has_a_row_for_each_bag(command, kind):
    (command.folder / 'bags.txt').write_text(command.bag)
    (found,) = command.numbers('fleet', command.folder / 'bags.txt', '--out', command.folder / 'page.html')['bags']
    assert found['replay'] == ('no estimates recorded' if kind == 'foreign' else 'identical')
    assert found['scale'] == pytest.approx(true_scale(), rel=0.035)  # it follows each new pressure within strokes


@mostly_long
def test_the_law_of_the_axis_is_identified(command):
    found = command.numbers('identify', command.bag, '--out', command.folder / 'seal.yaml')
    assert found['parameters']['friction_at_no_pressure'] == pytest.approx(friction(0.0) / 2, rel=5e-3)
    assert found['parameters']['friction_at_one_bar'] == pytest.approx(
        (friction(1e5) - friction(0.0)) / 2 / MEAN, rel=5e-3
    )
    assert found['seal_chambers'] == ['a', 'b']


@mostly_long
def test_the_feedforward_is_tuned_for_the_node_of_the_bag(command, kind):
    out = command.folder / 'tuned.yaml'
    found = command.numbers('tune', '--bag', command.bag, '--out', out)
    assert found['friction_over_model'] == pytest.approx(1.098, abs=2e-3)
    (node, section) = next(iter(yaml.safe_load(out.read_text()).items()))
    if kind == 'own':
        assert node == '/**/friction_estimator'
        assert section['ros__parameters']['feedforward']['scale'] == 1.1
    else:
        assert node == '/**/machine_estimator'
        assert section['ros__parameters']['axis.feedforward']['scale'] == 1.1


@mostly_long
def test_the_monitor_shows_every_actuator(command, kind):
    options = [one for one in command.options if one not in ('--namespace', 'axis')]
    words = [sys.executable, '-m', 'seal_friction_ros', 'monitor', command.bag, *options, '--json']
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        url = urlsplit(json.loads(process.stdout.readline())['url'])
        with closing(HTTPConnection(url.netloc, timeout=60.0)) as connection:
            found, deadline = {'time': 0.0}, time.monotonic() + 60.0
            while found['time'] < 4.3:  # the bag is being read
                assert time.monotonic() < deadline, f'read up to {found["time"]} s'
                connection.request('GET', f'/view?since=4&until=4.3&{url.query}')
                found = json.loads(connection.getresponse().read())
        process.terminate()
    labels = [actuator['label'] for actuator in found['actuators']]
    nodes = ['/friction_estimator'] if kind == 'own' else [f'{name} (/machine_estimator)' for name in NAMES]
    assert labels == nodes
    estimates = [abs(one) for row in found['rows'] if (one := row[COLUMNS.index('estimate')]) is not None]
    assert median(estimates) == pytest.approx(23.1, abs=0.05)


@each_kind
def test_info_has_the_states_and_seals_of_every_actuator(command, kind):
    command.options = [one for one in command.options if one not in ('--namespace', 'axis')]
    found = command.numbers('info', command.bag)
    count = 1 if kind == 'own' else len(NAMES)
    assert sum(found['states'].values()) == count * SAMPLES
    own = ['ms28775_114 on chamber a', 'ms28775_114 on chamber b']
    if kind == 'own':
        assert found['seals'] == own
    else:
        assert found['seals'][:4] == [f'{name}: {seal}' for name in NAMES[:2] for seal in own]
        assert [seal.rpartition(' ')[2] for seal in found['seals'][4:]] == ['a', 'difference']


@pytest.mark.parametrize('kind', ['machine', 'foreign'])
@pytest.mark.parametrize(
    'words',
    [
        ['report', 'BAG', '--out', 'page.html'],
        ['compare', 'BAG', 'BAG'],
        ['health', 'BAG'],
        ['identify', 'BAG', '--out', 'seal.yaml'],
        ['tune', '--bag', 'BAG', '--out', 'tuned.yaml'],
    ],
    ids=lambda words: words[0],
)
def test_without_the_name_of_one_of_several_actuators_a_command_lists_them(command, kind, words, monkeypatch, capsys):
    monkeypatch.chdir(command.folder)
    given = [command.bag if word == 'BAG' else word for word in words]
    options = [one for one in command.options if one not in ('--namespace', 'axis')]
    assert main([*given, *options]) == 2
    assert 'several actuators: choose one with --namespace: axis, weak, two_kinds' in capsys.readouterr().err
    assert main([*given, *options, '--namespace', 'boom']) == 2
    assert 'no actuator boom: choose one with --namespace: axis, weak, two_kinds' in capsys.readouterr().err
    assert not list(command.folder.iterdir())


def test_one_actuator_of_a_machine_replays_into_a_bag_of_its_own(recordings, tmp_path, capsys):
    bag, options = recordings.arguments('machine', 'weak')
    assert main(['replay', bag, *options, '--verify', '--out', str(tmp_path / 'weak'), '--json']) == 0
    assert json.loads(capsys.readouterr().out)['recorded_estimates'] == SAMPLES
    assert main(['compare', bag, str(tmp_path / 'weak'), *options, '--json']) == 0
    assert json.loads(capsys.readouterr().out)['identical_bytes']


def test_a_bag_of_standard_messages_without_mapping_file_says_what_to_give(recordings, tmp_path, capsys):
    assert main(['report', str(recordings.foreign), '--out', str(tmp_path / 'page.html')]) == 2
    assert '--mapping' in capsys.readouterr().err


@pytest.mark.parametrize('name', NAMES)
def test_each_actuator_alone_replays_to_the_bytes_that_its_machine_sent(machine, name):
    """With answers as messages of their own, and with those of all actuators in one."""
    bag = open_actuator(machine.machine, name)
    recorded = {kind: [] for kind in (ESTIMATE_TYPE, FEEDFORWARD_TYPE)}
    made = {kind: [] for kind in recorded}
    samples = 0
    for message, answers in Replay(bag).steps():
        samples += message.type_name == VELOCITY_TYPE
        if message.type_name in recorded:
            recorded[message.type_name].append(message.data)
        for answer in answers:
            made[answer.type_name].append(answer.data)
    assert samples == len(made[ESTIMATE_TYPE]) == SAMPLES
    assert made == recorded


@each_kind
def test_the_python_interface_takes_it_too(recordings, kind):
    (bag, given), (own, _) = (options_of(recordings, which) for which in (kind, 'own'))
    run, reference = read_bag(bag, **given), read_bag(own)
    for name in ('velocity', 'pressure_a', 'force_sum', 'friction_force', 'status', 'adaptation_scale'):
        assert np.array_equal(run[name], reference[name]), name
    tuned = tune(bag, settings=RecordedAxisSettings(mass=MASS), **given)
    assert tuned.numbers['friction_over_model'] == pytest.approx(true_scale(), rel=0.1)
    assert tuned.actuator == given.get('namespace', '')


def options_of(recordings: Recordings, kind: str) -> tuple[str, dict[str, str]]:
    """A bag and the options that name its actuator, as arguments of Python."""
    bag, options = recordings.arguments(kind)
    return bag, {name.removeprefix('--'): value for name, value in zip(options[::2], options[1::2], strict=True)}
