"""A machine with standard messages: the records it makes are those of the same signals in messages of this project."""

import json
import math
from dataclasses import replace

import pytest
import yaml
from harness.machines import BENCH, EXCAVATOR, made, message, message_class, parsed

from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.machine import machine as m
from seal_friction_ros.core.machine.machine_file import Spring, Weight
from seal_friction_ros.core.machine.outputs import commands
from seal_friction_ros.core.messages.layouts import TICK_TYPE
from seal_friction_ros.core.messages.records import (
    NEVER,
    FeedForward,
    Force,
    FrictionEstimate,
    Position,
    Pressure,
    ServoReference,
    Status,
    Velocity,
    WatchdogTick,
)
from seal_friction_ros.files import machine_configurations

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
        plan = self.machine.plans[topic]
        emits = m.named_emits(self.machine, lambda *answer: self.answers.append(answer))
        m.receive(self.machine, self.state, plan, plan.read(data), received, emits)

    def estimates(self):
        return {name: record for name, record, _ in self.answers if isinstance(record, FrictionEstimate)}

    def forces(self):
        return {name: record.force for name, record, _ in self.answers if isinstance(record, FeedForward)}


def kept_of(run):
    return [(one.pipeline.kept(), one.memory, one.force, one.fault) for one in run.state.actuators]


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


def test_spring_and_load_over_position_are_terms_of_the_force_sum():
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
    in_one_direction = Status.MOTION_UNCERTAIN | Status.MODEL_DISAGREES  # its load is not told from friction yet
    assert (estimate.state, estimate.status & ~in_one_direction) == (FrictionState.SLIDING, 0)
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
    text = "no 'bucket' in name: it has arm, boom, buckett; did you mean buckett?"
    assert [m.missing(machine, number, '/joint_states', data) for number in range(3)] == [[], [], [text]]


def test_an_actuator_whose_arithmetic_fails_leaves_the_others_alone_and_commands_nothing(monkeypatch):
    run, whole = excavator(), excavator()
    receive = m.RECEIVERS[Velocity]

    def fails(parameters, *others):
        if parameters is run.machine.actuators[0].pipeline:
            raise OverflowError('too large')
        return receive(parameters, *others)

    data = message('sensor_msgs/JointState', 700 * MS, name=['boom', 'arm', 'bucket'], velocity=[0.1, 0.0, -0.1])
    whole.take('/joint_states', data, 700 * MS)
    monkeypatch.setitem(m.RECEIVERS, Velocity, fails)
    run.take('/joint_states', data, 700 * MS)
    assert run.answers == [answer for answer in whole.answers if answer[0] != 'boom']
    assert run.state.actuators[0].force == 0.0
    assert 'too large' in run.state.actuators[0].fault


def test_a_message_that_fails_half_way_changes_nothing(monkeypatch):
    run = bench_run(velocity=0.1)
    kept, (known,), receive = run.state.actuators[0].pipeline.kept(), run.state.actuators, m.RECEIVERS[Velocity]
    memory = known.memory

    def fails(*arguments):
        receive(*arguments)
        raise OverflowError('too large')

    monkeypatch.setitem(m.RECEIVERS, Velocity, fails)
    joints = {'name': ['axis'], 'velocity': [0.2], 'position': [0.031]}
    run.take('/joint_states', message('sensor_msgs/JointState', 301 * MS, **joints), 301 * MS)
    assert len(run.answers) > 0
    assert (known.pipeline.kept(), known.memory, known.force) == (kept, memory, 0.0)
    assert known.fault == '/joint_states: OverflowError: too large'


def test_bytes_that_are_no_message_are_refused_and_change_nothing():
    run = Run(made(EXCAVATOR))
    before = kept_of(run)
    with pytest.raises(ValueError, match='JointState'):
        run.take('/joint_states', b'\x00\x01\x00\x00\xff', 5)
    assert kept_of(run) == before


def test_an_answer_that_cannot_be_sent_leaves_no_half_state():
    run = Run(made(EXCAVATOR))
    before = kept_of(run)

    def fails(*arguments):
        raise ConnectionError('gone')

    emits = m.named_emits(run.machine, fails)
    joints = {'name': ['boom', 'arm', 'bucket'], 'velocity': [0.2] * 3, 'position': [0.1] * 3}
    plan = run.machine.plans['/joint_states']
    with pytest.raises(ConnectionError):
        m.receive(run.machine, run.state, plan, plan.read(message('sensor_msgs/JointState', MS, **joints)), MS, emits)
    assert kept_of(run) == before


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
    again.state = m.MachineState((replace(known, memory=m.parse_memory(written), pipeline=known.pipeline.copy()),))
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
            plan, tick = m.record_plan('/watchdog_tick', TICK_TYPE, (number,)), WatchdogTick(now, 0.01)
            m.receive(run.machine, run.state, plan, tick, now, m.named_emits(run.machine, lambda *_: None))
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


# --- the records that messages make, by hand ---


class Taker:
    """The first actuator of a machine and what it remembers."""

    def __init__(self, machine):
        self.machine, self.actuator = machine, machine.actuators[0]
        self.memory = m.first_memory(self.actuator)

    def take(self, topic, stamp, **fields):
        """Records of one message."""
        plan = self.machine.plans[topic]
        kind = self.machine.file.topics[topic]
        has_header = 'header' in message_class(kind).get_fields_and_field_types()
        reading = plan.read(message(kind, stamp if has_header else None, **fields))
        taken = dict(plan.taken)[0]
        self.memory, records = m.records_of(self.actuator, self.memory, taken, reading.numbers, stamp, reading.frame_id)
        return records

    def pressures(self, stamp, a, b):
        return [*self.take('/p_a', stamp, fluid_pressure=a), *self.take('/p_b', stamp, fluid_pressure=b)]

    def joints(self, stamp, **values):
        return self.take('/joint_states', stamp, name=['axis'], **{key: [value] for key, value in values.items()})


def bench(topics=None, ambient=None, **changes):
    """The bench with further topics and another ambient pressure; ``changes`` of its actuator, None removes a key."""
    document = yaml.safe_load(BENCH)
    document['topics'] |= topics or {}
    if ambient is not None:
        document['ambient_pressure'] = ambient
    return Taker(made(yaml.safe_dump(document), **changes))


INPUTS = yaml.safe_load(BENCH)['actuators']['axis']['inputs']
WEATHER = {'topics': {'/weather': 'sensor_msgs/msg/FluidPressure'}, 'ambient': '/weather'}


def test_nothing_is_made_of_a_part_until_the_others_have_come():
    taker = bench()
    assert taker.take('/p_a', 5, fluid_pressure=2e6) == []
    (pressure,) = taker.take('/p_b', 7, fluid_pressure=1e6)
    assert pressure == Pressure(5, pytest.approx(2e6 - AMBIENT), pytest.approx(1e6 - AMBIENT))
    (force,) = taker.take('/load', 9, wrench__force__z=100.0)  # the areas take the pressures of 5 ns
    assert force == Force(5, pytest.approx((2e6 - AMBIENT) * AREA_A - (1e6 - AMBIENT) * AREA_B - 100.0))


def test_a_pair_has_the_stamp_of_its_older_part_and_is_made_once_for_each():
    taker = bench()
    taker.pressures(5, 2e6, 1e6)
    taker.take('/load', 5, wrench__force__z=0.0)
    assert taker.take('/p_a', 8, fluid_pressure=3e6) == []  # the other one is still of 5 ns
    assert [record.stamp for record in taker.take('/p_b', 9, fluid_pressure=3e6)] == [8]  # the load is of 5 ns
    assert [type(record) for record in taker.take('/load', 9, wrench__force__z=0.0)] == [Force]
    assert taker.memory.force_stamp == taker.memory.pressure_stamp == 8


def test_a_load_cell_alone_needs_no_pressure():
    taker = bench(force_sum={'load_force': '/load wrench.force.z'})
    assert taker.take('/load', 5, wrench__force__z=-40.0) == [Force(5, -40.0)]
    assert [type(record) for record in taker.pressures(6, 2e6, 1e6)] == [Pressure]


def test_the_terms_of_the_force_sum_add_up_with_their_signs():
    values = [math.nan] * len(m.QUANTITIES)
    for name, value in {'position': 0.3, 'load_force': 25.0, 'angle': math.radians(30.0)}.items():
        values[m.QUANTITIES.index(name)] = value
    mapping = bench().actuator.mapping
    for terms, force in (
        (m.ForceSum(pressures=True), 2e6 * AREA_A - 3e6 * AREA_B),
        (m.ForceSum(load_force=1.0), 25.0),
        (m.ForceSum(weight=Weight(80.0, 0.0)), -80.0 * 9.80665 * 0.5),
        (m.ForceSum(spring=Spring(200.0, 0.1)), -200.0 * 0.2),
        (m.ForceSum(load_over_position=m.LoadTable((0.0, 0.4), (10.0, 50.0))), -40.0),
        (m.ForceSum(), 0.0),
        (
            m.ForceSum(pressures=True, load_force=1.0, spring=Spring(200.0, 0.1)),
            2e6 * AREA_A - 3e6 * AREA_B + 25.0 - 40.0,
        ),
    ):
        assert m.force_sum(terms, mapping, values, (2e6, 3e6)) == pytest.approx(force)
    values[m.QUANTITIES.index('angle')] = math.inf
    assert math.isnan(m.force_sum(m.ForceSum(weight=Weight(80.0, 0.0)), mapping, values, (0.0, 0.0)))


@pytest.mark.parametrize(
    ('position', 'load'),
    [(0.1, 100.0), (0.15, 200.0), (0.2, 300.0), (0.3, 250.0), (0.4, 200.0), (0.0999, math.nan), (0.4001, math.nan)],
)
def test_the_load_is_straight_between_its_points_ends_included_and_not_known_beyond(position, load):
    table = m.LoadTable((0.1, 0.2, 0.4), (100.0, 300.0, 200.0))
    assert m.load_at(table, position) == pytest.approx(load, nan_ok=True)


def test_constant_parts_are_as_new_as_the_others():
    weight = {'mass': 10.0, 'angle': '90 deg'}
    terms = {'pressures': True, 'weight': weight, 'load_force': '5 N'}
    taker = bench(inputs=INPUTS | {'pressure_b': '2 bar'}, force_sum=terms)
    pressure, force = taker.take('/p_a', 5, fluid_pressure=2e6)
    assert pressure == Pressure(5, pytest.approx(2e6 - AMBIENT), 2e5)  # a constant is gauge
    assert force == Force(5, pytest.approx((2e6 - AMBIENT) * AREA_A - 2e5 * AREA_B - 98.0665 + 5.0))


def test_an_angle_that_comes_in_a_message_turns_the_weight():
    weight = {'mass': 10.0, 'angle': {'topic': '/angle', 'field': 'data', 'unit': 'deg'}}
    taker = bench({'/angle': 'std_msgs/msg/Float64'}, force_sum={'weight': weight})
    assert taker.take('/angle', 5, data=30.0) == [Force(5, pytest.approx(-49.03325))]


@pytest.mark.parametrize('load', [{'spring': {'stiffness': 200.0, 'rest_position': 0.1}}, {'load_over_position': {
    'positions': [0.0, 1.0], 'forces': [-20.0, 180.0]}}])  # fmt: skip
def test_a_load_over_position_is_as_new_as_the_position(load):
    taker = bench(force_sum=load | {'pressures': True, 'load': 'none'})
    assert [type(record) for record in taker.pressures(5, 2e6, 1e6)] == [Pressure]
    force, position = taker.joints(6, position=0.3)
    balance = (2e6 - AMBIENT) * AREA_A - (1e6 - AMBIENT) * AREA_B
    assert (force, position) == (Force(5, pytest.approx(balance - 40.0)), Position(6, 0.3))


def test_gauge_and_absolute_pressures_may_be_mixed():
    inputs = INPUTS | {'pressure_b': {'topic': '/p_b', 'absolute': False}}
    (pressure,) = bench(inputs=inputs, force_sum=None).pressures(5, 2e6, 1e6)
    assert pressure == Pressure(5, pytest.approx(2e6 - AMBIENT), 1e6)
    inputs = INPUTS | {'pressure_a': {'topic': '/p_a', 'absolute': False}}
    (pressure,) = bench(inputs=inputs, force_sum=None).pressures(5, 2e6, 1e6)
    assert pressure == Pressure(5, 2e6, pytest.approx(1e6 - AMBIENT))


SECOND = 1_000_000_000  # [ns]


@pytest.mark.parametrize(
    ('age', 'is_used'),
    [(0, True), (59 * SECOND, True), (61 * SECOND, False), (-59 * SECOND, True), (-61 * SECOND, False)],
)
def test_the_ambient_pressure_of_a_message_is_used_for_a_minute(age, is_used):
    taker, now = bench(**WEATHER), 1000 * SECOND
    assert taker.pressures(now - 5, 2e6, 1e6) == []  # it is not known yet
    assert taker.take('/weather', now - age, fluid_pressure=9e4) == []
    taker.take('/p_b', now - 1, fluid_pressure=1e6)
    found = taker.take('/p_a', now, fluid_pressure=2e6)
    assert found == ([Pressure(now - 1, pytest.approx(1.91e6), pytest.approx(9.1e5))] if is_used else [])
    taker.take('/load', now, wrench__force__z=0.0)
    assert taker.memory.force_stamp == (now - 1 if is_used else NEVER)


@pytest.mark.parametrize(('seconds', 'is_used'), [(59, True), (61, False)])
def test_the_ambient_pressure_must_be_of_the_minute_of_the_newest_pressure(seconds, is_used):
    taker = bench(**WEATHER)
    taker.take('/weather', 0, fluid_pressure=9e4)
    taker.take('/p_a', 10 * SECOND, fluid_pressure=2e6)
    assert bool(taker.take('/p_b', seconds * SECOND, fluid_pressure=1e6)) is is_used


def test_an_ambient_pressure_that_is_no_number_is_not_known_and_gauge_pressures_need_none():
    taker = bench(**WEATHER)
    taker.take('/weather', 5, fluid_pressure=math.nan)
    assert taker.pressures(6, 2e6, 1e6) == []
    gauge = {f'pressure_{c}': {'topic': f'/p_{c}', 'absolute': False} for c in 'ab'}
    taker = bench(**WEATHER, inputs=INPUTS | gauge, force_sum=None)
    assert '/weather' not in taker.machine.plans
    assert taker.pressures(6, 2e6, 1e6) == [Pressure(6, 2e6, 1e6)]


@pytest.mark.parametrize(
    ('difference', 'pair'), [(3e5, (3e5, 0.0)), (-3e5, (0.0, 3e5)), (0.4, (0.4, 0.0)), (0.0, (0.0, 0.0))]
)
def test_a_pressure_difference_is_one_chamber_under_pressure(difference, pair):
    inputs = {'velocity': '/joint_states velocity[axis]', 'pressure_difference': {'topic': '/p_a', 'absolute': False}}
    taker = bench(seals=['ms28775_114@difference'], inputs=inputs, force_sum=None)
    assert taker.take('/p_a', 5, fluid_pressure=difference) == [Pressure(5, *pair)]


# --- position, reference and velocity ---

REFERENCED = {
    name: f'/set {name.removeprefix("reference_")}[axis]' for name in ('reference_position', 'reference_velocity')
}
SET = {'topics': {'/set': 'sensor_msgs/msg/JointState'}}


def test_position_and_velocity_are_passed_on_when_they_come():
    taker = bench()
    assert taker.joints(5, position=0.3) == [Position(5, 0.3)]
    assert taker.joints(6, velocity=0.2) == [Velocity(6, 0.2)]
    assert taker.joints(7, position=0.4, velocity=-0.3) == [Position(7, 0.4), Velocity(7, -0.3)]


def test_a_velocity_from_position_comes_with_the_position_once_there_are_enough():
    inputs = {key: value for key, value in INPUTS.items() if key != 'velocity'}
    taker = bench(inputs=inputs, velocity_from_position={'step': 0.0, 'rate': 1000.0})
    assert taker.joints(5 * MS, position=0.3) == [Position(5 * MS, 0.3)]
    assert taker.joints(6 * MS, position=0.3002) == [Position(6 * MS, 0.3002), Velocity(6 * MS, pytest.approx(0.2))]


def set_point(taker, stamp, **values):
    return taker.take('/set', stamp, name=['axis'], **{key: [value] for key, value in values.items()})


def test_a_reference_has_the_velocity_that_is_given_and_the_newest_position_and_acceleration():
    acceleration = {'reference_acceleration': {'topic': '/set', 'field': 'effort[axis]'}}
    taker = bench(**SET, inputs=INPUTS | REFERENCED | acceleration)
    (first,) = set_point(taker, 5, velocity=0.2)
    assert (first.velocity, first.acceleration, math.isnan(first.position)) == (0.2, 0.0, True)
    assert set_point(taker, 6, position=0.5, effort=3.0) == []  # a velocity makes a reference
    assert set_point(taker, 7, velocity=0.3) == [ServoReference(7, 0.5, 0.3, 3.0)]
    assert taker.joints(8, velocity=0.1) == [Velocity(8, 0.1)]  # the rod makes none


def test_a_reference_of_positions_has_the_velocity_between_the_last_two_up_to_200_ms_apart():
    inputs = INPUTS | {'reference_position': REFERENCED['reference_position']}
    for gap, velocity in ((50 * MS, 0.4), (200 * MS, 0.1), (201 * MS, None)):
        taker = bench(**SET, inputs=inputs)
        assert set_point(taker, MS, position=0.5) == []
        found = set_point(taker, MS + gap, position=0.52)
        expected = [] if velocity is None else [ServoReference(MS + gap, 0.52, pytest.approx(velocity), 0.0)]
        assert found == expected


def test_a_message_without_a_stamp_has_that_of_its_receipt_on_the_clock_of_the_stamps():
    run = Run(made(EXCAVATOR))
    for one in run.state.actuators:
        one.pipeline.clock_offset = 500
    for topic in ('/a', '/b'):
        run.take(topic, message('std_msgs/Float64MultiArray', data=[20.0, 30.0, 40.0]), 7)
    assert run.state.actuators[0].pipeline.pressure == Pressure(507, 2e6, 2e6)


def test_an_actuator_has_taken_nothing_before_its_first_message():
    (known,) = m.init(made(BENCH)).actuators
    assert (known.force, known.fault, known.memory.pressure_stamp, known.memory.force_stamp) == (0.0, '', NEVER, NEVER)
    assert known.memory.stamps == (NEVER,) * len(m.QUANTITIES)
    named = zip(m.QUANTITIES, known.memory.values, strict=True)
    assert [name for name, value in named if not math.isnan(value)] == ['ambient']


def test_a_type_that_is_not_defined_is_named_with_its_topic():
    file = parsed(BENCH)
    with pytest.raises(ValueError, match=r'/joint_states: the type sensor_msgs/JointState is neither installed'):
        m.make_machine(file, machine_configurations(file, 'robot.yaml'), {})


@pytest.mark.parametrize('damage', [
    {'values': ['0x0p+0'] * 5}, {'stamps': [0] * 5}, {'windows': [[[1], []], [[], []]]},
    {'values': ['0x0p+0'] * 10, 'stamps': [0] * 10}, {'force_stamp': None}, {'windows': [[[1], []], [[1], []]]},
])  # fmt: skip
def test_a_damaged_memory_is_refused(damage):
    document = m.memory_document(m.first_memory(made(BENCH).actuators[0])) | damage
    with pytest.raises(ValueError, match='memory of an actuator'):
        m.parse_memory(document)


def test_a_memory_comes_back_with_every_part():
    windows = m.Window((1, 2), (0.1, 0.2)), m.Window((3,), (0.3,))
    memory = m.Memory(tuple(0.5 * i for i in range(12)), tuple(range(12)), 7, 8, *windows)
    assert m.parse_memory(json.loads(json.dumps(m.memory_document(memory)))) == memory
