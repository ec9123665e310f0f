"""A rig file from the head of a log: what can be seen is not asked for, and the log imports without editing it."""

import json

import numpy as np
import pytest
import yaml

from seal_friction_ros.offline.bags.import_log import read_samples
from seal_friction_ros.offline.bags.new_rig import new_rig
from seal_friction_ros.offline.bags.rig_file import read_rig
from seal_friction_ros.offline.commands.main import main

TIME = np.arange(400) * 0.01  # [s]
POSITION = 0.1 + 0.02 * np.sin(TIME)  # [m]
PRESSURE, OTHER = 20e5 + 1e5 * np.cos(TIME), 1e5 * (1.0 + np.sin(TIME))  # [Pa, gauge]
FORCE = 100.0 * np.sign(np.cos(TIME))  # [N]


def log_of(head, separator, *columns, comma=False, end=''):
    rows = [separator.join(f'{value:.6f}' for value in row) + end for row in zip(*columns, strict=True)]
    return head + '\n'.join(row.replace('.', ',') if comma else row for row in rows) + '\n'


FORMS = {
    'names with units': log_of('time (s),P_a (bar),P_b (bar),F (kN),x (mm)\n', ',', TIME, PRESSURE / 1e5, OTHER / 1e5,
                               FORCE / 1e3, POSITION * 1e3),
    'a line of units': log_of('Drive 7\nBegin;12\n\nTime;Pressure A;Pressure B;Force;Position\ns;psi;psi;lbf;in\n', ';',
                              TIME, PRESSURE / 6894.757293168, OTHER / 6894.757293168, FORCE / 4.4482216152605,
                              POSITION / 0.0254, comma=True),
    'no units, trailing comma': log_of('t,p_1,p_2,f,x,\n', ',', TIME, PRESSURE / 1e5, OTHER / 1e5, FORCE,
                                       POSITION * 1e3, end=','),
    'comment': log_of('# made by hand\n#time_ms, p_a_Pa, p_b_Pa, force_N, pos_m\n', '  ',
                      TIME * 1e3, PRESSURE, OTHER, FORCE,
                      POSITION),
}  # fmt: skip


@pytest.mark.parametrize('form', FORMS)
def test_a_log_imports_with_its_new_rig_file_as_it_is(tmp_path, form):
    (tmp_path / 'ram.csv').write_text(FORMS[form])
    assert main(['new', 'rig', str(tmp_path / 'ram.csv'), '--out', str(tmp_path / 'rig.yaml')]) == 0
    rig = read_rig(tmp_path / 'rig.yaml')
    found = read_samples(tmp_path / 'ram.csv', rig)
    assert found.samples.stamp == pytest.approx((TIME + 1.0) * 1e9, abs=10)
    assert found.samples.chamber_a == pytest.approx(PRESSURE, rel=1e-4)
    assert found.samples.chamber_b == pytest.approx(OTHER, rel=1e-4, abs=10.0)
    assert found.samples.force_sum == pytest.approx(FORCE, rel=1e-4)
    assert found.position == pytest.approx(POSITION, rel=1e-4)
    assert found.samples.velocity == pytest.approx(0.02 * np.cos(TIME), abs=2e-4)


def test_what_is_missing_or_guessed_is_said_and_wanted_motion_is_no_measurement(tmp_path, capsys):
    text = log_of('x_set,x,v\n', ',', POSITION * 1e3, POSITION * 1e3, 20.0 * np.cos(TIME))
    (tmp_path / 'ram.csv').write_text(text)
    assert main(['new', 'rig', str(tmp_path / 'ram.csv'), '--out', str(tmp_path / 'rig.yaml'), '--json']) == 0
    opened = json.loads(capsys.readouterr().out)['open']
    for words in ('rate', 'no column of a pressure', 'no column of a force', 'guess: the unit'):
        assert any(words in line for line in opened), words
    document = yaml.safe_load((tmp_path / 'rig.yaml').read_text())
    assert document['velocity']['terms'] == [{'column_name': 'v', 'unit': 'mm/s'}]
    assert document['position']['terms'] == [{'column_name': 'x', 'unit': 'mm'}]
    assert 'columns that are not used: 0 x_set' in (tmp_path / 'rig.yaml').read_text()


@pytest.mark.parametrize('name', ['p (psia)', 'p (bar)'])
def test_a_pressure_that_is_absolute_by_name_or_values_is_written_so(tmp_path, name):
    (tmp_path / 'ram.csv').write_text(log_of(f't,{name},f,x\n', ',', TIME, 1.0 + np.abs(np.sin(TIME)), FORCE, POSITION))
    chamber = yaml.safe_load(new_rig(tmp_path / 'ram.csv'))['chamber_a']['terms'][0]
    assert chamber['absolute'] is True


def test_a_text_without_rows_is_refused(tmp_path):
    (tmp_path / 'letter.txt').write_text('Dear Sir,\nno numbers.\n')
    with pytest.raises(ValueError, match=r'letter.txt: no row of numbers in its first 2 lines'):
        new_rig(tmp_path / 'letter.txt')
