"""Logs into bags: units, signs, stamps, velocity from position, and what is refused."""

import math
import re
from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import yaml
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from paths import ROOT
from scipy.optimize import least_squares

from seal_friction_ros.core.friction.geometry import projected_area, squeeze
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.identification.signal_preparation import SavitzkyGolay, slope
from seal_friction_ros.core.messages.coder import DECODERS, decode
from seal_friction_ros.core.messages.layouts import VELOCITY_TYPE
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.bags.bag import (
    FORCE_TOPIC,
    POSITION_TOPIC,
    PRESSURE_TOPIC,
    REFERENCE_TOPIC,
    VELOCITY_TOPIC,
    BagError,
    read_messages,
)
from seal_friction_ros.offline.bags.import_log import convert_log
from seal_friction_ros.offline.bags.rig_file import read_rig

DATA = ROOT.parent / 'shared' / 'data'
DELFT_FRICTION = {
    'O-ring257': {1: 4.7, 3: 5.8, 5: 7.1, 7: 7.9},
    'X-ring257': {1: 4.6, 3: 6.5, 5: 8.6, 7: 15.5},
}
"""[N] by [bar]: half the difference of the two directions"""

RIG = {
    'name': 'small',
    'time': {'column': 0, 'unit': 'ms'},
    'chamber_a': {'terms': [{'column': 1, 'unit': 'bar'}]},
    'chamber_b': {'constant': 0.0},
    'force_sum': {
        'terms': [
            {'column': 2, 'unit': 'lbf'},
            {'column': 1, 'unit': 'bar', 'gain': -2.0, 'gain_unit': 'in2'},
        ],
        'constant': 5.0,
    },
    'velocity': {'terms': [{'column': 3, 'unit': 'in/s', 'gain': -1.0}]},
}
ROWS = '1000,2,10,1\n1020,3,20,-2\n1041.5,4,30,0.5\n'


def changed(**parts):
    return {**RIG, **parts}


def imported(tmp_path, log, rig=RIG):
    """Import of a log given as text or bytes; the summary and the path of the bag."""
    log_path, rig_path, out = tmp_path / 'log.csv', tmp_path / 'rig.yaml', tmp_path / 'bag'
    log_path.write_bytes(log if isinstance(log, bytes) else log.encode())
    rig_path.write_text(yaml.safe_dump(rig))
    return convert_log(log_path, out, read_rig(rig_path)), out


def signals(bag):
    """Decoded messages of a bag as arrays: stamp, chamber_a, chamber_b, force_sum, velocity."""
    rows = defaultdict(list)
    for message in read_messages(bag):
        rows[message.topic].append(DECODERS[message.type_name](message.data))
    pressure, force, velocity = rows[PRESSURE_TOPIC], rows[FORCE_TOPIC], rows[VELOCITY_TOPIC]
    assert [p.stamp for p in pressure] == [f.stamp for f in force] == [v.stamp for v in velocity]
    return (
        np.array([v.stamp for v in velocity]),
        np.array([p.chamber_a for p in pressure]),
        np.array([p.chamber_b for p in pressure]),
        np.array([f.force for f in force]),
        np.array([v.velocity for v in velocity]),
    )


def assert_refused(tmp_path, pattern, log=ROWS, rig=RIG):
    """The import ends in one line that matches, and there is no bag."""
    with pytest.raises(ValueError, match=pattern) as caught:
        imported(tmp_path, log, rig)
    assert '\n' not in str(caught.value)
    assert len(str(caught.value)) < 2000
    assert not (tmp_path / 'bag').exists()


# What comes out of a good log


def test_units_signs_and_areas(tmp_path):
    summary, bag = imported(tmp_path, ROWS, changed(start=2.0))
    stamp, chamber_a, chamber_b, force, velocity = signals(bag)
    assert stamp.tolist() == [3_000_000_000, 3_020_000_000, 3_041_500_000]
    assert chamber_a == pytest.approx([2e5, 3e5, 4e5], rel=1e-15)
    assert chamber_b.tolist() == [0.0, 0.0, 0.0]
    assert velocity == pytest.approx([-0.0254, 0.0508, -0.0127], rel=1e-15)
    by_hand = [10 * 4.4482216152605 - 2 * 0.0254**2 * 2e5 + 5, 20 * 4.4482216152605 - 2 * 0.0254**2 * 3e5 + 5]
    assert force[:2] == pytest.approx(by_hand, rel=1e-14)
    assert summary == (3, 0, 3_000_000_000, 3_041_500_000, {}, ())


def test_position_and_wanted_motion_are_in_the_bag(tmp_path):
    time = np.arange(40) * 0.01
    wanted = 0.02 * np.sin(3.0 * time)
    log = ''.join(f'{1000 * t:.6f},2,10,1,{1000 * x!r}\n' for t, x in zip(time.tolist(), wanted.tolist(), strict=True))
    position, reference = ({'terms': [{'column': 4, 'unit': 'mm'}]} for _ in range(2))  # YAML without aliases
    _, bag = imported(tmp_path, log, changed(position=position, reference_position=reference))
    rows = defaultdict(list)
    for message in read_messages(bag):
        rows[message.topic].append(DECODERS[message.type_name](message.data))
    assert [p.position for p in rows[POSITION_TOPIC]] == pytest.approx(wanted)
    assert [r.position for r in rows[REFERENCE_TOPIC]] == pytest.approx(wanted)
    assert [r.velocity for r in rows[REFERENCE_TOPIC]][1:-1] == pytest.approx(0.06 * np.cos(3.0 * time[1:-1]), abs=2e-5)
    last = [message.topic for message in read_messages(bag)][-1]
    assert last == VELOCITY_TOPIC  # it makes the estimate


@pytest.mark.parametrize(
    ('rig', 'pattern'),
    [
        ({'reference_acceleration': {'constant': 0.0}}, 'without reference_position or reference_velocity'),
        ({'reference_velocity': {'terms': [{'column': 1, 'unit': 'mm'}]}}, 'is not a velocity'),
    ],
)
def test_an_invalid_wanted_motion_is_refused(tmp_path, rig, pattern):
    assert_refused(tmp_path, pattern, rig=changed(**rig))


def test_order_topics_stamps_and_frame(tmp_path):
    _, bag = imported(tmp_path, ROWS, changed(frame_id='piston_rod'))
    messages = list(read_messages(bag))
    assert [m.topic for m in messages] == [PRESSURE_TOPIC, FORCE_TOPIC, VELOCITY_TOPIC] * 3
    assert [m.log_time for m in messages[:4]] == [1_000_000_000, 1_000_000_001, 1_000_000_002, 1_020_000_000]
    assert decode(VELOCITY_TYPE, messages[2].data).frame_id == b'piston_rod'


def test_the_same_log_gives_the_same_bytes(tmp_path):
    bags = []
    for name in ('first', 'second'):
        (tmp_path / name).mkdir()
        bags.append(imported(tmp_path / name, ROWS)[1] / 'bag_0.mcap')
    assert bags[0].read_bytes() == bags[1].read_bytes()


NAMED = changed(
    time={'column_name': 't', 'unit': 'ms'},
    chamber_a={'terms': [{'column_name': 'p A', 'unit': 'bar'}]},
)


@pytest.mark.parametrize(
    ('log', 'rig'),
    [
        (ROWS, RIG),
        (ROWS.replace(',', ' '), RIG),
        (ROWS.replace(',', '\t\t').replace('\n', '\r\n'), RIG),
        (ROWS.replace(',', ' ; '), RIG),
        ('# made by hand\n\n' + ROWS.replace('\n', '\n\n# note\n'), RIG),
        ('\ufeff' + ROWS, RIG),
        ('any,thing,at,all\n' + ROWS, changed(header='row')),
        ('"t","p A",F,v\n' + ROWS, {**NAMED, 'header': 'row'}),
        ('#t,p A,F,v\n' + ROWS.replace(',', '  '), {**NAMED, 'header': 'comment'}),
        ('# by hand\n# t, p A, F, v\n' + ROWS, {**NAMED, 'header': 'comment'}),
        ('1,x,y,z\n0,0,0,0\n' + ROWS, changed(skip_rows=2)),
        ('#t,p A,F,v,remark\n' + ROWS.replace('\n', ',ok\n'), {**NAMED, 'header': 'comment'}),
    ],
)
def test_forms_of_a_log(tmp_path, log, rig):
    _, bag = imported(tmp_path, log, rig)
    stamp, chamber_a, _, _, velocity = signals(bag)
    assert stamp.tolist() == [1_000_000_000, 1_020_000_000, 1_041_500_000]
    assert chamber_a == pytest.approx([2e5, 3e5, 4e5])
    assert velocity == pytest.approx([-0.0254, 0.0508, -0.0127])


SCOPE = """Name;Scope project
File;C:\\logs\\press.svdx
Starttime of export;133437412341234567

Name;p A;Name;F;Name;v
SampleTime[ms];1;SampleTime[ms];1;SampleTime[ms];1
"""
SCOPE_ROWS = '1000,0;2,0;1000,0;10,0;1000,0;1,0\n1020,0;3;1020,0;20;1020,0;-2\n1041,5;4,0;1041,5;30,0;1041,5;0,5\n'
BY_NAME = changed(
    header='row',
    time={'column': 0, 'unit': 'ms'},
    chamber_a={'terms': [{'column_name': 'p A', 'unit': 'bar'}]},
    force_sum={'terms': [{'column_name': 'F', 'unit': 'lbf'}]},
    velocity={'terms': [{'column_name': 'v', 'unit': 'in/s', 'gain': -1}]},
)


@pytest.mark.parametrize(
    ('log', 'rig'),
    [
        (SCOPE + SCOPE_ROWS, BY_NAME),
        ('Drive 7, serial 1234\n3 channels\nt,p A,F,v\nms,bar,lbf,in/s\n' + ROWS, BY_NAME),
        ('t,p A,F,v,\n' + ROWS.replace('\n', ',\n'), BY_NAME),
        ('t;p A;F;v\n' + ROWS.replace(',', ';').replace('.', ','), BY_NAME),
        ('t\tp A\tF\tv\n' + ROWS.replace(',', '\t').replace('.', ','), BY_NAME),
        (ROWS.replace(',', ' ').replace('.', ','), RIG),
        (ROWS.replace('\n', ',\n'), RIG),
        ('t,"p A",F,v\n"1000,0","2,0","10,0","1,0"\n1020,3,20,-2\n"1041,5",4,30,"0,5"\n', BY_NAME),
        ('t\tp A\tx\tF\tv\n' + ROWS.replace(',', '\t').replace('\t10\t', '\t\t10\t').replace('\t20\t', '\t\t20\t')
         .replace('\t30\t', '\t\t30\t'), BY_NAME),
    ],
)  # fmt: skip
def test_forms_that_loggers_write(tmp_path, log, rig):
    _, bag = imported(tmp_path, log, rig)
    stamp, chamber_a, _, _, velocity = signals(bag)
    assert stamp.tolist() == [1_000_000_000, 1_020_000_000, 1_041_500_000]
    assert chamber_a == pytest.approx([2e5, 3e5, 4e5])
    assert velocity == pytest.approx([-0.0254, 0.0508, -0.0127])


def test_a_rate_takes_the_place_of_a_time_column(tmp_path):
    _, bag = imported(tmp_path, ROWS, changed(time={'rate': '50 Hz'}, start=1))
    assert signals(bag)[0].tolist() == [1_000_000_000, 1_020_000_000, 1_040_000_000]
    (tmp_path / 'twice').mkdir()
    assert_refused(tmp_path / 'twice', 'give the column of the time, or the rate', rig=changed(time={'rate': 0}))


def test_an_absolute_pressure_loses_the_ambient_one_in_the_chamber_and_in_the_force_sum(tmp_path):
    term = {'column': 1, 'unit': 'bar', 'absolute': True}
    rig = changed(
        chamber_a={'terms': [term]},
        force_sum={'terms': [{**term, 'gain': '-2.0 in2'}], 'constant': '0.1 kN'},
        ambient_pressure='990 mbar',
    )
    _, bag = imported(tmp_path, ROWS, rig)
    _, chamber_a, _, force, _ = signals(bag)
    assert chamber_a == pytest.approx([1.01e5, 2.01e5, 3.01e5])
    assert force == pytest.approx(100.0 - 2.0 * 0.0254**2 * chamber_a)


@pytest.mark.parametrize(
    ('name', 'bars', 'words'),
    [
        ('p', (1.01, 3.0, 4.0), 'never below 1.01e+05 Pa'),
        ('p (psia)', (0.0, 3.0, 4.0), 'called p (psia)'),
        ('p', (0.0, 3.0, 4.0), ''),
        ('p', (2.0, 3.0, 4.0), ''),
    ],
)
def test_an_absolute_pressure_that_is_taken_for_gauge_is_said(tmp_path, name, bars, words):
    log = f't,{name},F,v\n' + ''.join(f'{1000 * i},{bar},1,1\n' for i, bar in enumerate(bars))
    chamber = {'terms': [{'column_name': name, 'unit': 'bar'}]}
    force = {'terms': [{'column_name': 'F', 'unit': 'N'}]}
    summary, _ = imported(tmp_path, log, {**BY_NAME, 'chamber_a': chamber, 'force_sum': force})
    assert [words in text and 'write absolute: true' in text for text in summary.remarks] == ([True] if words else [])


@pytest.mark.parametrize(
    ('log', 'rig', 'pattern'),
    [
        (SCOPE + SCOPE_ROWS.replace('30,0', 'off'), BY_NAME,
         r"line 9: column 3 \(F\) is 'off', not a number: set .*decimal"),
        ('t,p A,F,v\n' + ROWS.replace('1000,2,10,1', '1000,0,2,0,10,0,1,0'), BY_NAME,
         "line 2: 8 columns instead of 4: separator ','; set header, separator or decimal"),
        ('t;p A;F;v\n1;2;3;4\n2;2;3,5;4\n', {**BY_NAME, 'decimal': 'point'},
         r"line 3: column 2 \(F\) is '3,5'.*decimal"),
        (ROWS, changed(separator='pipe'), "separator = 'pipe' is not one of auto, semicolon"),
        (ROWS, changed(separator='semicolon'), 'the log has 0 to 0'),
    ],
)  # fmt: skip
def test_a_wrong_form_is_refused_with_line_column_and_option(tmp_path, log, rig, pattern):
    assert_refused(tmp_path, pattern, log=log, rig=rig)


LONG_ROWS = [f'{10 * i},{2 + i % 3},10,1' for i in range(400)]


@given(
    st.dictionaries(
        st.integers(1, 398),
        st.sampled_from(['short', 'text', 'empty', 'ahead', 'back', 'twice', 'no time']),
        max_size=8,
    )
)
@settings(max_examples=60, deadline=None, phases=[Phase.explicit, Phase.generate])
def test_every_row_of_a_damaged_log_is_in_the_bag_or_counted_with_its_reason(damage):
    rows = LONG_ROWS.copy()
    for place, kind in damage.items():
        time, _, rest = rows[place].partition(',')
        rows[place] = {
            'short': f'{time},2', 'text': f'{time},oops,10,1', 'empty': f'{time},,10,1', 'ahead': f'3600000,{rest}',
            'back': f'0,{rest}', 'twice': f'{10 * place - 10},{rest}', 'no time': f',{rest}',
        }[kind]  # fmt: skip
    with TemporaryDirectory() as folder:
        summary, _ = imported(Path(folder), '\n'.join(rows))
    assert summary.rows + sum(summary.dropped.values()) == len(rows)
    assert summary.not_finite == list(damage.values()).count('empty')
    assert summary.rows >= len(rows) - sum(kind != 'empty' for kind in damage.values())
    assert any('left out' in text for text in summary.remarks) == (sum(summary.dropped.values()) > 4)


def test_a_log_with_too_many_rows_that_cannot_be_used_is_refused_with_their_share(tmp_path):
    rows = [row if i % 20 else 'oops,1' for i, row in enumerate(LONG_ROWS, start=1)]
    assert_refused(
        tmp_path, r'line 20: 2 columns instead of 4.*20 of 400 rows cannot be used, at most 2%', '\n'.join(rows)
    )
    loop = [f'{10 * (i % 100)},2,10,1' for i in range(400)]  # a looped playback
    (tmp_path / 'loop').mkdir()
    assert_refused(tmp_path / 'loop', r'line 101: time 0 s is not after 0.99 s.*300 of 400 rows', '\n'.join(loop))


def test_not_finite_values_pass_and_are_counted(tmp_path):
    summary, bag = imported(tmp_path, '0,nan,1,1\n1,1,inf,1\n2,1,1,-inf\n3,1,1,1\n')
    _, chamber_a, _, force, velocity = signals(bag)
    assert summary.rows == 4
    assert summary.not_finite == 3
    assert math.isnan(chamber_a[0])
    assert math.isnan(force[0])  # the force sum has the pressure in it
    assert force[1] == math.inf
    assert velocity[2] == math.inf  # turned by the gain of -1
    assert np.isfinite([chamber_a[3], force[3], velocity[3]]).all()


# Velocity from position

FILTER = SavitzkyGolay(window=0.2, order=2, largest_gap=0.05)


def jittered(duration, seed=1):
    """Times of about 100 Hz, each up to 2 ms off."""
    return np.arange(0.0, duration, 0.01) + np.random.default_rng(seed).uniform(-2e-3, 2e-3, round(duration / 0.01))


def test_a_quadratic_is_differentiated_exactly_edges_included():
    time = np.arange(0.0, 2.0, 0.01)
    velocity = slope(time, 0.3 + 0.02 * time - 0.05 * time**2, FILTER)
    assert velocity == pytest.approx(0.02 - 0.1 * time, abs=1e-12)


def test_a_sine_is_differentiated_within_the_filters_own_error():
    # A fit of order 2 on 21 points has the slope of x + x''' m^2/6 (3 n^2 + 3 n - 1)/5, n = 10: for a sine the
    # velocity is low by omega^2 dt^2 (3 n^2 + 3 n - 1) / 30.
    omega, amplitude = 2 * np.pi * 0.5, 0.02
    low = omega**2 * 0.01**2 * (3 * 10**2 + 3 * 10 - 1) / 30
    time = np.arange(0.0, 4.0, 0.01)
    velocity = slope(time, amplitude * np.sin(omega * time), FILTER)
    truth = amplitude * omega * np.cos(omega * time)
    inner = slice(10, -10)
    assert velocity[inner] == pytest.approx((1 - low) * truth[inner], abs=1e-2 * low * amplitude * omega)
    assert low == pytest.approx(0.0108, abs=1e-4)


def test_jitter_costs_little():
    time = jittered(4.0)
    omega, amplitude = 2 * np.pi * 0.5, 0.02
    velocity = slope(time, amplitude * np.sin(omega * time), FILTER)
    error = velocity - amplitude * omega * np.cos(omega * time)
    assert np.abs(error[10:-10]).max() < 0.013 * amplitude * omega  # 1.1 % of it is the filter's
    even = slope(np.arange(400) * 0.01, amplitude * np.sin(omega * time), FILTER)
    error_without_grid = even - amplitude * omega * np.cos(omega * time)
    assert np.abs(error_without_grid[10:-10]).max() > 2 * np.abs(error[10:-10]).max()


def test_noise_is_reduced_as_the_filter_says():
    noise = np.random.default_rng(2).normal(0.0, 4e-5, 20000)
    velocity = slope(np.arange(20000) * 0.01, noise, FILTER)
    expected = 4e-5 / 0.01 * math.sqrt(12 / (21 * (21**2 - 1)))  # slope of a line through 21 points
    assert velocity.std() == pytest.approx(expected, rel=0.05)
    assert expected == pytest.approx(1.44e-4, rel=0.01)  # what config/rigs/delft.yaml says


def test_no_fit_reaches_across_a_gap():
    time = np.concatenate([np.arange(0.0, 1.0, 0.01), np.arange(2.0, 3.0, 0.01)])
    position = np.where(time < 1.5, 0.01 * time, 5.0 - 0.02 * time)
    truth = np.where(time < 1.5, 0.01, -0.02)
    assert slope(time, position, FILTER) == pytest.approx(truth, abs=1e-11)
    joined = slope(time, position, SavitzkyGolay(window=0.2, order=2, largest_gap=2.0))
    assert np.abs(joined - truth).max() > 0.1


def test_a_hole_in_the_position_stays_a_hole_and_spreads_not():
    time = np.arange(0.0, 1.0, 0.01)
    position = 0.01 * time
    position[[30, 31]] = np.nan, np.inf
    velocity = slope(time, position, FILTER)
    assert np.flatnonzero(np.isnan(velocity)).tolist() == [30, 31]
    assert np.nanmax(np.abs(velocity - 0.01)) < 1e-11


def test_a_segment_shorter_than_the_window_has_no_velocity():
    time = np.concatenate([np.arange(0.0, 1.0, 0.01), np.arange(2.0, 2.1, 0.01)])
    velocity = slope(time, 0.01 * time, FILTER)
    assert np.isnan(velocity[100:]).all()
    assert np.isfinite(velocity[:100]).all()


POSITION_RIG = changed(
    velocity={
        'terms': [{'column': 3, 'unit': 'mm'}],
        'savitzky_golay': {'window': 0.2, 'order': 2, 'largest_gap': 0.1},
    }
)


def test_a_log_of_positions_gets_its_velocity(tmp_path):
    log = ''.join(f'{10 * i} 1 1 {0.12 * i}\n' for i in range(100))  # 0.12 mm in 10 ms
    _, bag = imported(tmp_path, log, POSITION_RIG)
    assert signals(bag)[4] == pytest.approx(0.012, abs=1e-12)


# What is refused


@pytest.mark.parametrize(
    ('log', 'pattern'),
    [
        ('', 'log.csv: no row of numbers'),
        ('\n\n# nothing\n', 'log.csv: no row of numbers'),
        (bytes(range(256)) * 20, 'log.csv: not a text file'),
        (b'\x89PNG\r\n\x1a\n\x00\x00', 'log.csv: not a text file'),
        (
            b'\x00\x01\x02\x00' * 5000,
            r'log.csv: rig file names chamber_a.terms\[0\].column = 1, but the log has 0 to 0',
        ),
        ('1,2,3\n', r'log.csv: rig file names velocity.terms\[0\].column = 3, but the log has 0 to 2'),
        (ROWS + '1100,2,10\n', 'line 4: 3 columns instead of 4'),
        (ROWS + '1100,2,10,1,7\n', 'line 4: 5 columns instead of 4'),
        (ROWS + '# note\n1100,2,ten,1\n', "line 5: column 2 is 'ten', not a number"),
        (ROWS + '1100,2,' + 'x' * 5000 + ',1\n', 'line 4: column 2 is .{42}, not a number'),
        ('t,p,F,v\n' + ROWS, "line 1: column 0 is 't', not a number"),
        (ROWS + '1030,2,10,1\n', r'line 4: time 1.03 s is not after 1.0415 s'),
        (ROWS + '1041.5,2,10,1\n', r'line 4: time 1.0415 s is not after 1.0415 s'),
        (ROWS + 'nan,2,10,1\n', 'line 4: a stamp of nan s'),
        (ROWS + 'inf,2,10,1\n', 'line 4: a stamp of inf s'),
        ('-1,2,10,1\n' + ROWS, 'line 1: a stamp of -0.001 s'),
        (ROWS + '3e12,2,10,1\n', r'line 4: a stamp of 3e\+09 s'),
    ],
)
def test_garbage_in_the_log_gives_one_line(tmp_path, log, pattern):
    assert_refused(tmp_path, pattern, log=log)


@pytest.mark.parametrize(
    ('rig', 'pattern'),
    [
        ([1, 2], 'rig.yaml: a rig file is a mapping'),
        ({k: v for k, v in RIG.items() if k != 'force_sum'}, 'rig.yaml: rig file lacks force_sum'),
        ({k: v for k, v in RIG.items() if k != 'name'}, 'rig.yaml lacks name'),
        (changed(colour='red'), 'rig.yaml has no colour'),
        (
            changed(time={'column': 0, 'unit': 'fortnight'}),
            "rig.yaml: time: Term.unit = 'fortnight' is not one of",
        ),
        (changed(time={'column': 0, 'unit': 'bar'}), "rig.yaml: time.unit = 'bar' .* is not a time: use one of s, ms"),
        (changed(time={'column': 0}), 'rig.yaml: time lacks unit'),
        (changed(time={'unit': 's'}), 'rig.yaml: time: Term.column = -1'),
        (changed(time={'column': 0, 'column_name': 't', 'unit': 's'}), 'give one of them'),
        (changed(time={'column': 'a', 'unit': 's'}), "rig.yaml: time.column = 'a' is not a whole number"),
        (changed(time={'column': 99999, 'unit': 's'}), 'above its upper bound 9999'),
        (changed(time={'column_name': 't', 'unit': 's'}), 'but header = none'),
        (changed(chamber_a={}), 'rig.yaml: chamber_a has neither terms nor a constant'),
        (changed(chamber_a=7), 'rig.yaml: chamber_a is not a mapping'),
        (changed(chamber_a={'terms': 7}), r'rig.yaml: chamber_a.terms = 7 is not a list'),
        (
            changed(chamber_a={'terms': [{'column': 1, 'unit': 'N'}]}),
            r'chamber_a.terms\[0\].unit = .N. .* not a pressure',
        ),
        (changed(chamber_a={'constant': math.nan}), 'rig.yaml: chamber_a: Combination.constant = nan SI is not finite'),
        (
            changed(force_sum={'terms': [{'column': 1, 'unit': 'bar', 'gain': math.inf, 'gain_unit': 'mm2'}]}),
            r'rig.yaml: force_sum.terms\[0\]: Term.gain = inf',
        ),
        (
            changed(force_sum={'terms': [{'column': 1, 'unit': 'bar'}]}),
            r'force_sum.terms\[0\].unit = .bar. .*not a force',
        ),
        (
            changed(velocity={'terms': [{'column': 3, 'unit': 'mm'}]}),
            r'velocity.terms\[0\].unit = .mm. .* not a velocity',
        ),
        (changed(velocity={**RIG['velocity'], 'savitzky_golay': {'window': 1.0}}), 'lacks largest_gap'),
        (
            changed(velocity={**RIG['velocity'], 'savitzky_golay': {'window': -1.0, 'largest_gap': 1.0}}),
            'rig.yaml: velocity.savitzky_golay: SavitzkyGolay.window = -1.0 s is below its lower bound',
        ),
        (changed(skip_rows=3), 'log.csv: no row of numbers in it after the 3'),
        (changed(skip_rows=-1), 'Rig.skip_rows = -1 rows is below its lower bound 0'),
        (changed(header='yes'), "rig.yaml: Rig.header = 'yes' is not one of none, row, comment"),
        (changed(frame_id='a\nb'), 'Rig.frame_id'),
    ],
)
def test_an_invalid_rig_file_gives_one_line(tmp_path, rig, pattern):
    assert_refused(tmp_path, pattern, rig=rig)


@pytest.mark.parametrize(
    ('header', 'times'),
    [('#t,p,F,v\n', 'found 0 times'), ('#p A,p A,t,v\n', 'found 2 times'), ('', 'found 0 times')],
)
def test_a_name_that_is_not_once_in_the_header(tmp_path, header, times):
    rig = changed(header='comment', chamber_a=NAMED['chamber_a'])
    assert_refused(tmp_path, re.escape("chamber_a.terms[0].column_name = 'p A'") + f'.*{times}', header + ROWS, rig)


def test_a_log_too_short_for_the_filter_is_refused(tmp_path):
    log = ''.join(f'{10 * i} 1 1 1\n' for i in range(20))  # the window holds 21
    assert_refused(tmp_path, r'log.csv: no stretch of rows .* window of 0.2 s', log, POSITION_RIG)


def test_a_window_too_short_for_the_order_is_refused(tmp_path):
    log = ''.join(f'{10 * i} 1 1 1\n' for i in range(100))
    filter_values = {'window': 0.02, 'order': 4, 'largest_gap': 0.1}
    rig = changed(velocity={**POSITION_RIG['velocity'], 'savitzky_golay': filter_values})
    assert_refused(tmp_path, r'log.csv: SavitzkyGolay.window = 0.02 s holds 3 samples, 0.01 s apart', log, rig)


def test_missing_files_and_an_existing_bag(tmp_path):
    _, bag = imported(tmp_path, ROWS)
    before = sorted((p, p.read_bytes()) for p in bag.iterdir())
    with pytest.raises(BagError, match='exists already'):
        imported(tmp_path, ROWS)
    assert sorted((p, p.read_bytes()) for p in bag.iterdir()) == before
    rig, log, out = tmp_path / 'rig.yaml', tmp_path / 'log.csv', tmp_path / 'other'
    for bad_log, bad_rig in ((tmp_path / 'none', rig), (tmp_path, rig), (log, tmp_path / 'none')):
        with pytest.raises(ValueError, match=r'No such file|Is a directory'):
            convert_log(bad_log, out, read_rig(bad_rig))
        assert not out.exists()


# Real rigs


def data(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f'{name} of the shared data is not there')
    return path


def delft_friction(bag):
    """Half the difference [N] of the mean force sum in steady sliding, forward minus backward: our plain evaluation.

    Steady is faster than 5 mm/s (a third of the slower stroke) with less than 0.02 m/s^2.
    """
    stamp, _, _, force, velocity = signals(bag)
    steady = np.abs(np.gradient(velocity, stamp * 1e-9)) < 0.02
    return (force[steady & (velocity > 5e-3)].mean() - force[steady & (velocity < -5e-3)].mean()) / 2.0


@pytest.mark.parametrize(('ring', 'bar'), [(ring, bar) for ring, of_bar in DELFT_FRICTION.items() for bar in of_bar])
def test_delft_half_range_is_the_friction(tmp_path, ring, bar):
    log = data(f'delft/{ring}_{bar}bar.csv')
    summary = convert_log(log, tmp_path / 'bag', read_rig(config_path('rigs', 'delft')))
    lines = len(log.read_text().split('\n')) - 1
    assert summary.rows == lines - 15
    assert summary.not_finite == 0
    stamp, chamber_a, chamber_b, _, velocity = signals(tmp_path / 'bag')
    assert np.median(chamber_a) == pytest.approx(bar * 1e5, abs=0.06e5)
    assert not chamber_b.any()
    assert 0.02 < np.ptp(np.cumsum(velocity[1:] * np.diff(stamp) * 1e-9)) < 0.06  # strokes of 40 mm
    assert delft_friction(tmp_path / 'bag') == pytest.approx(DELFT_FRICTION[ring][bar], abs=0.2)


def test_delft_pressure_extends(tmp_path):
    """The load cell pushes harder while the pressurised chamber gets smaller: its pressure is the one that extends."""
    log = data('delft/O-ring257_7bar.csv')
    convert_log(log, tmp_path / 'bag', read_rig(config_path('rigs', 'delft')))
    table = np.loadtxt(log)[15:]
    velocity = signals(tmp_path / 'bag')[4]
    load = table[:, 6]
    assert load.mean() == pytest.approx(7e5 * math.pi / 4 * 0.0257**2, rel=0.02)  # compressed by all of the pressure
    assert load[velocity < -5e-3].mean() > load[velocity > 5e-3].mean() + 10.0


def test_delft_rig_file_has_the_bore():
    gains = [term.gain for term in read_rig(config_path('rigs', 'delft')).force_sum.terms if term.unit == 'bar']
    assert gains == pytest.approx([math.pi / 4 * 25.7**2], rel=1e-6)


@pytest.mark.parametrize('name', ['FrictionIDMovesWithBiasCurr', '2022.01.28T16.46.31_new'])
def test_mbari_signs(tmp_path, name):
    log = data(f'mbari/{name}.exp')
    summary = convert_log(log, tmp_path / 'bag', read_rig(config_path('rigs', 'mbari')))
    stamp, chamber_a, chamber_b, force, velocity = signals(tmp_path / 'bag')
    table = np.loadtxt(log)
    assert summary.rows == len(table)
    assert velocity == pytest.approx(np.gradient(table[:, 1] * 0.0254, stamp * 1e-9), abs=0.02)  # both on extension
    sliding = np.abs(velocity) > 0.01
    assert force[velocity > 0.01].mean() - force[velocity < -0.01].mean() > 1000.0
    assert np.corrcoef(force[sliding], velocity[sliding])[0, 1] > 0.8
    assert np.corrcoef(chamber_a - chamber_b, velocity)[0, 1] < -0.9  # the fluid works against the motion


def mbari_table(velocity):
    """Friction [N] of the simulator of that project, as the README of the data has it: the force on the ram, turned."""
    speeds = (-5, -0.4, -0.1, -0.05, -0.01, 0, 0.01, 0.05, 0.1, 0.4, 5)  # [m/s]
    forces = (12750, 1200, 700, 400, 160, 0, -550, -750, -1000, -2900, -32033)  # [N]
    return -np.interp(velocity, speeds, forces)


@pytest.mark.parametrize(('name', 'rms'), [('FrictionIDMovesWithBiasCurr', 197), ('2022.01.28T16.46.31_new', 504)])
def test_mbari_force_sum_is_the_friction_known_from_outside(tmp_path, name, rms):
    convert_log(data(f'mbari/{name}.exp'), tmp_path / 'bag', read_rig(config_path('rigs', 'mbari')))
    stamp, _, _, force, velocity = signals(tmp_path / 'bag')
    acceleration = np.gradient(velocity, stamp * 1e-9)
    chosen = (np.abs(velocity) > 0.01) & (np.abs(acceleration) < 0.05)
    left = (force - mbari_table(velocity))[chosen]
    assert left.std() == pytest.approx(rms, rel=0.08)
    turned = (force + mbari_table(velocity))[chosen]
    assert turned.std() > 3 * left.std()


# The seal of the Delft rig


def test_delft_seal_file_is_the_least_squares_fit():
    document = read_yaml(config_path('seals', 'delft_o_ring'))
    law = parse_seal(document).coulomb_law
    assert squeeze(law.geometry) == pytest.approx(0.10, abs=1e-4)
    pressures = np.array(list(DELFT_FRICTION['O-ring257'])) * 1e5
    frictions = np.array(list(DELFT_FRICTION['O-ring257'].values()))
    axial_forces = pressures * projected_area(law.geometry)

    def log_deviation(logs):
        coefficient, radial_force = np.exp(logs)
        return np.log(coefficient * (0.392463 * axial_forces + radial_force) ** (2 / 3) / frictions)

    fit = least_squares(log_deviation, np.log([0.3, 20.0]), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    coefficient, radial_force = np.exp(fit.x)
    assert law.friction_coefficient_law.coefficient == pytest.approx(coefficient, rel=1e-4)
    assert law.normal_force_law.radial_force == pytest.approx(radial_force, rel=1e-4)
    assert law.friction_coefficient_law.exponent == pytest.approx(1 / 3, abs=1e-6)
    # what the file says of it
    deviations = [law.coulomb_friction(p) / f - 1 for p, f in zip(pressures, frictions, strict=True)]
    assert np.abs(deviations).max() == pytest.approx(0.019, abs=5e-4)
    relative_std = 0.12 * np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    assert relative_std == pytest.approx([0.21, 0.54], abs=0.006)


def test_delft_seal_file_covers_the_pressures_of_the_runs(tmp_path):
    seal = parse_seal(read_yaml(config_path('seals', 'delft_o_ring')))
    for bar in DELFT_FRICTION['O-ring257']:
        bag = tmp_path / f'{bar}'
        convert_log(data(f'delft/O-ring257_{bar}bar.csv'), bag, read_rig(config_path('rigs', 'delft')))
        chamber_a = signals(bag)[1]
        assert seal.pressure_min < chamber_a.min()
        assert chamber_a.max() < seal.pressure_max
