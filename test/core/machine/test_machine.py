"""A machine with standard messages: the records it makes are those of the same signals in messages of this project."""

import json
import math

import pytest
from harness.machines import BENCH, EXCAVATOR, made, message

from seal_friction_ros.core.estimation.feedforward import FeedForward
from seal_friction_ros.core.estimation.records import FrictionEstimate, Status
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.machine import machine as m
from seal_friction_ros.core.machine.outputs import commands

MS = 1_000_000
AMBIENT = 101_325.0
AREA_A = math.pi * 0.02**2
AREA_B = AREA_A - math.pi * 0.011**2
STUCK = FrictionState.STUCK
UNKNOWN = FrictionState.UNKNOWN


class Run:
    """A machine and what it has answered."""

    def __init__(self, machine):
        self.machine, self.state, self.answers = machine, m.init(machine), []

    def take(self, topic, data, received):
        self.answers = []
        self.state = m.receive(
            self.machine, self.state, topic, data, received, lambda *answer: self.answers.append(answer)
        )

    def estimates(self):
        return {name: record for name, record, _ in self.answers if isinstance(record, FrictionEstimate)}

    def forces(self):
        return {name: record.force for name, record, _ in self.answers if isinstance(record, FeedForward)}


def bench_run(velocity=0.0, samples=300, load=None, p_a=2e6, p_b=1e6, **changes):
    run = Run(made(BENCH, **changes))
    balance = p_a * AREA_A - p_b * AREA_B
    for i in range(1, samples + 1):
        stamp = i * MS
        pressure = {'stamp': stamp, 'fluid_pressure': p_a + AMBIENT}
        run.take('/p_a', message('sensor_msgs/FluidPressure', **pressure), stamp)
        run.take('/p_b', message('sensor_msgs/FluidPressure', **pressure | {'fluid_pressure': p_b + AMBIENT}), stamp)
        if '/load' in run.machine.plans:
            force = {'wrench__force__z': balance if load is None else load}
            run.take('/load', message('geometry_msgs/WrenchStamped', stamp, **force), stamp)
        joints = {'name': ['other', 'axis'], 'velocity': [9.0, velocity], 'position': [9.0, velocity * i * 1e-3]}
        run.take('/joint_states', message('sensor_msgs/JointState', stamp, **joints), stamp)
    return run


def test_pressures_areas_and_load_cell_make_the_force_sum():
    run = bench_run()
    known = run.state.actuators[0].pipeline
    assert (known.pressure.chamber_a, known.pressure.chamber_b) == (pytest.approx(2e6), pytest.approx(1e6))
    assert known.force.force == pytest.approx(0.0, abs=1e-6)  # the load cell holds what the pressures push
    estimate = run.estimates()['axis']
    assert (estimate.status, estimate.state) == (0, STUCK)
    run = bench_run(load=0.0)
    assert run.state.actuators[0].pipeline.force.force == pytest.approx(2e6 * AREA_A - 1e6 * AREA_B)


def test_the_piston_seal_sees_the_difference():
    friction = {}
    for seals in (['ms28775_114@a'], ['ms28775_114@b'], ['ms28775_114@difference'], None):
        changes = {} if seals is None else {'seals': seals}
        friction[str(seals)] = bench_run(samples=2, **changes).estimates()['axis'].coulomb_friction
    assert friction['None'] == pytest.approx(sum(friction.values()) - friction['None'])
    assert friction["['ms28775_114@difference']"] == friction["['ms28775_114@b']"]  # 2 - 1 MPa is 1 MPa


@pytest.mark.parametrize(
    ('force_sum', 'flag'),
    [({'pressures': True}, Status.FORCE_CONTAINS_LOAD), (None, Status.FORCE_MISSING)],
)
def test_without_a_load_friction_at_rest_is_unknown_and_flagged(force_sum, flag):
    at_rest = bench_run(force_sum=force_sum).estimates()['axis']
    assert (at_rest.state, at_rest.friction_force) == (UNKNOWN, 0.0)
    assert at_rest.status & flag
    assert at_rest.coulomb_friction > 0.0  # it stands on the pressures alone


def test_a_declared_weight_makes_friction_at_rest_known():
    load = 80.0 * m.GRAVITY
    terms = {'pressures': True, 'weight': {'mass': '80 kg', 'angle': '90 deg'}}
    run = bench_run(force_sum=terms, p_a=(load + 10.0) / AREA_A, p_b=0.0)
    assert run.state.actuators[0].pipeline.force.force == pytest.approx(10.0, rel=1e-6)
    assert (run.estimates()['axis'].status, run.estimates()['axis'].state) == (0, STUCK)


def test_spring_and_load_over_position():
    table = {'positions': [0.0, 0.1, 0.3], 'forces': [100.0, 200.0, 0.0]}
    loads = [m.load_at(m.LoadTable((0.0, 0.1, 0.3), (100.0, 200.0, 0.0)), x) for x in (0.0, 0.05, 0.2, 0.3)]
    assert loads == pytest.approx([100.0, 150.0, 100.0, 0.0])
    spring = {'stiffness': '1000 N/m', 'rest_position': '10 mm'}
    terms = {'pressures': True, 'spring': spring, 'load_over_position': table}
    run = bench_run(
        force_sum=terms, velocity=0.1, p_a=0.0, p_b=0.0
    )  # the position of the last message but one: 29.9 mm
    position = 0.1 * 300 * 1e-3
    assert run.state.actuators[0].pipeline.force.force == pytest.approx(
        -1000.0 * (position - 0.01) - (100.0 + 1000.0 * position), rel=1e-6
    )


def test_beyond_the_load_table_the_force_is_flagged():
    table = {'positions': [0.0, 0.01], 'forces': [100.0, 200.0]}
    run = bench_run(force_sum={'pressures': True, 'load_over_position': table}, velocity=0.1)
    assert run.estimates()['axis'].status & Status.FORCE_NOT_FINITE


def test_velocity_from_position_is_that_of_the_sensor():
    inputs = {'position': '/joint_states position[axis]', 'pressure_a': '/p_a', 'pressure_b': '/p_b'}
    run = bench_run(velocity=0.05, inputs=inputs, velocity_from_position={'step': '1 um', 'rate': '1000 Hz'})
    estimate = run.estimates()['axis']
    assert (estimate.state, estimate.status & ~Status.MOTION_UNCERTAIN) == (FrictionState.SLIDING, 0)
    assert estimate.direction == 1


def excavator(samples=300, change=None, count=3):
    run, names = Run(made(EXCAVATOR)), ['boom', 'arm', 'bucket']
    for i in range(1, samples + 1):
        stamp = i * 2 * MS
        given = {'velocity': [0.1, 0.0, -0.1], 'a': [20.0, 30.0, 40.0], 'b': [10.0, 10.0, 10.0]}
        if change is not None:
            change(i, given)
        run.take('/a', message('std_msgs/Float64MultiArray', data=given['a'][:count]), stamp)
        run.take('/b', message('std_msgs/Float64MultiArray', data=given['b']), stamp)
        run.take('/set', message('sensor_msgs/JointState', stamp, name=names, velocity=given['velocity']), stamp)
        joints = given.get('names', names)
        run.take(
            '/joint_states', message('sensor_msgs/JointState', stamp, name=joints, velocity=given['velocity']), stamp
        )
    return run


def test_one_joint_state_serves_three_actuators():
    run = excavator()
    found = run.estimates()
    assert list(found) == ['boom', 'arm', 'bucket']
    assert [estimate.direction for estimate in found.values()] == [1, 0, -1]
    assert found['boom'].coulomb_friction < found['arm'].coulomb_friction < found['bucket'].coulomb_friction
    forces = run.forces()
    assert forces['boom'] > 0.0 > forces['bucket']
    (command,) = commands(
        run.machine.file, {a.name: s.force for a, s in zip(run.machine.actuators, run.state.actuators, strict=True)}, 0
    )
    assert command.topic == '/effort'


def test_a_joint_that_goes_missing_or_is_nan_touches_no_other_actuator():
    def without_arm(i, given):
        if i > 150:
            given['names'] = ['boom', 'x', 'bucket']

    def nan_arm(i, given):
        if i > 150:
            given['velocity'] = [0.1, math.nan, -0.1]

    whole = excavator()
    for change in (without_arm, nan_arm):
        run = excavator(change=change)
        for name in ('boom', 'bucket'):
            assert [a for a in run.answers if a[0] == name] == [a for a in whole.answers if a[0] == name]
    assert 'arm' not in excavator(change=without_arm).estimates()
    assert excavator(change=nan_arm).estimates()['arm'].status & Status.VELOCITY_NOT_FINITE


def test_an_array_that_is_too_short_leaves_the_last_actuator_without_pressure():
    found = excavator(count=2).estimates()
    assert [bool(e.status & Status.PRESSURE_MISSING) for e in found.values()] == [False, False, True]


def test_what_a_message_lacks_is_said():
    machine = made(EXCAVATOR)
    data = message('sensor_msgs/JointState', name=['boom', 'arm', 'buckett'], velocity=[1.0, 2.0, 3.0])
    text = "no 'bucket' in name: it has boom, arm, buckett; did you mean buckett?"
    assert [m.missing(machine, number, '/joint_states', data) for number in range(3)] == [[], [], [text]]


def test_an_actuator_whose_arithmetic_fails_leaves_the_others_alone_and_commands_nothing(monkeypatch):
    run, whole = excavator(), excavator()
    real = m.pipeline.receive

    def fails(parameters, *others):
        if parameters is run.machine.actuators[0].pipeline:
            raise OverflowError('too large')
        return real(parameters, *others)

    monkeypatch.setattr(m.pipeline, 'receive', fails)
    data = message('sensor_msgs/JointState', 700 * MS, name=['boom', 'arm', 'bucket'], velocity=[0.1, 0.0, -0.1])
    run.take('/joint_states', data, 700 * MS)
    monkeypatch.undo()
    whole.take('/joint_states', data, 700 * MS)
    assert run.answers == [answer for answer in whole.answers if answer[0] != 'boom']
    assert run.state.actuators[0].force == 0.0
    assert 'too large' in run.state.actuators[0].fault


def test_bytes_that_are_no_message_are_refused_and_change_nothing():
    run = Run(made(EXCAVATOR))
    before = run.state
    with pytest.raises(ValueError, match='JointState'):
        run.take('/joint_states', b'\x00\x01\x00\x00\xff', 5)
    assert run.state is before


def test_a_wrong_field_is_named_with_its_topic():
    text = BENCH.replace('velocity[axis]', 'velocities[axis]')
    with pytest.raises(ValueError, match=r'/joint_states: .*did you mean velocity\?'):
        made(text)


def test_a_pressure_that_stops_makes_the_pair_old_though_the_other_goes_on():
    run = bench_run()
    for i in range(301, 600):
        stamp = i * MS
        run.take('/p_a', message('sensor_msgs/FluidPressure', stamp, fluid_pressure=2e6 + AMBIENT), stamp)
        joints = {'name': ['axis'], 'velocity': [0.0], 'position': [0.0]}
        run.take('/joint_states', message('sensor_msgs/JointState', stamp, **joints), stamp)
    assert run.estimates()['axis'].status & Status.PRESSURE_STALE


def test_a_run_that_goes_on_from_its_written_memory_gives_the_same_answers():
    inputs = {'position': '/joint_states position[axis]', 'pressure_a': '/p_a', 'pressure_b': '/p_b'}
    changes = {'inputs': inputs, 'velocity_from_position': {'step': '1 um', 'rate': '1000 Hz'}}
    run = bench_run(velocity=0.05, **changes)
    (known,) = run.state.actuators
    written = json.loads(json.dumps(m.memory_document(known.memory)))
    again = Run(run.machine)
    again.state = m.MachineState((known._replace(memory=m.parse_memory(written)),))
    joints = {'name': ['axis'], 'position': [0.05 * 0.301], 'velocity': [0.0]}
    data = message('sensor_msgs/JointState', 301 * MS, **joints)
    for one in (run, again):
        one.take('/joint_states', data, 301 * MS)
    assert again.answers == run.answers != []
    for wrong in ({}, written | {'values': []}, None, written | {'stamps': 'x'}):
        with pytest.raises(ValueError, match=r'memory|invalid'):
            m.parse_memory(wrong)


def test_the_watchdog_lets_every_actuator_fade_out():
    run = excavator()
    for i in range(200):
        now = 600 * MS + i * 10 * MS
        for number in m.due(run.state, now):
            tick = m.WatchdogTick(now, 0.01)
            run.state = m.receive_tick(run.machine, run.state, number, tick, now, lambda *_: None)
    assert [state.force for state in run.state.actuators] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ('kind', 'field', 'source', 'value'),
    [
        ('sensor_msgs/msg/Temperature', 'temperature', '/oil', 46.85),
        ('sensor_msgs/msg/Temperature', 'temperature', {'topic': '/oil', 'unit': 'K'}, 320.0),
        ('std_msgs/msg/Float64', 'data', '/oil data', 320.0),
        ('std_msgs/msg/Float64', 'data', {'topic': '/oil', 'unit': 'degC', 'gain': 0.1}, 468.5),
    ],
)
def test_a_temperature_in_kelvin_or_celsius_reaches_the_actuator(kind, field, source, value):
    text = BENCH.replace('/load: geometry', f'/oil: {kind}, /load: geometry')
    inputs = {'velocity': '/joint_states velocity[axis]', 'position': '/joint_states position[axis]'}
    inputs |= {'pressure_a': '/p_a', 'pressure_b': '/p_b', 'temperature': source}
    run = Run(made(text, inputs=inputs))
    has_header = kind.startswith('sensor_msgs')
    for stamp in (3 * MS, 4 * MS, 5 * MS):  # fewer are not believed
        run.take('/oil', message(kind, stamp if has_header else None, **{field: value}), stamp)
    known = run.state.actuators[0]
    assert known.pipeline.temperature[:2] == (5 * MS, pytest.approx(320.0))
    assert m.parse_memory(m.memory_document(known.memory)).values[-1] == pytest.approx(320.0)


def test_a_memory_from_before_there_was_a_temperature_has_none():
    document = m.memory_document(bench_run(samples=3).state.actuators[0].memory)
    document |= {'values': document['values'][:-1], 'stamps': document['stamps'][:-1]}
    back = m.parse_memory(document)
    assert math.isnan(back.values[-1])
    assert m.memory_document(back)['stamps'][:-1] == document['stamps']


def test_a_constant_temperature_is_refused():
    with pytest.raises(ValueError, match=r'inputs\.temperature is constant: name a topic'):
        made(BENCH, inputs={'velocity': '/joint_states velocity[axis]', 'position': '/joint_states position[axis]',
                            'pressure_a': '/p_a', 'pressure_b': '/p_b', 'temperature': 320.0})  # fmt: skip
