"""Compiled code, of many messages at once, gives the bytes and the state of plain Python."""

import dataclasses
import json
import math
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from itertools import cycle, pairwise

import numpy as np
import pytest
from harness.compensation import COMPENSATING, compensating
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.estimation.compiled_pipeline import receive_all
from seal_friction_ros.core.estimation.estimator import EstimatorParameters
from seal_friction_ros.core.estimation.feedforward import FADED_IN
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, PipelineState, init, receive
from seal_friction_ros.core.foundation.compiled import compiled, for_compiler
from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.friction.actuator import MountedSeal, friction_of_seals
from seal_friction_ros.core.friction.force_sum_correction import ForceSumCorrection
from seal_friction_ros.core.friction.identified_motion import IdentifiedMotion
from seal_friction_ros.core.friction.laws import FRICTION_LAWS
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.laws.law import FrictionLaw
from seal_friction_ros.core.friction.laws.pressure_power_law import PressurePowerLaw
from seal_friction_ros.core.friction.laws.velocity_terms import VelocityTerms
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.friction.pressure_asymmetry import PressureAsymmetry
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.temperature import TemperatureScale
from seal_friction_ros.core.messages.blocks import Kind, Messages, UnsuitedError
from seal_friction_ros.core.messages.coder import decode, encode, type_of
from seal_friction_ros.core.messages.layouts import (
    ESTIMATE_TYPE,
    FEEDFORWARD_TYPE,
    FORCE_TYPE,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    TEMPERATURE_TYPE,
    TICK_TYPE,
    VELOCITY_TYPE,
)
from seal_friction_ros.core.messages.records import (
    NEVER,
    Force,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
    WatchdogTick,
)
from seal_friction_ros.files import read_yaml

SEALS = {path.stem: parse_seal(read_yaml(path)) for path in sorted((ROOT / 'config' / 'seals').glob('*.yaml'))}
DEFAULT = compensating().parameters()
MS = 1_000_000  # [ns]


def rising(scale: float, pressure: float, _speed: float) -> float:
    """A law that is in no registry."""
    return 5.0 + scale * math.atan(pressure / 1e6)


@dataclasses.dataclass(frozen=True)
class FromElsewhere(FrictionLaw):
    NAME = 'from_elsewhere'
    function = staticmethod(rising)
    scale: float = parameter(unit='N', lower=0.0, upper=10.0, description='Rise.')


ONE = SEALS['ms28775_114']
SEALS |= {
    'power': dataclasses.replace(
        ONE,
        coulomb_law=PressurePowerLaw(3.0, 0.4, 2.0 / 3.0),
        velocity_terms=VelocityTerms(120.0, asymmetry=-0.2),
        stiction_ratio=0.3,
        force_sum_correction=ForceSumCorrection(3e-6, -2e-5, 4.0, contains_load=True),
        identified_motion=IdentifiedMotion(0.01, 0.03, (1,)),
    ),
    'constant': dataclasses.replace(ONE, coulomb_law=ConstantCoulomb(7.0)),
    'from_elsewhere': dataclasses.replace(ONE, coulomb_law=FromElsewhere(1.0)),
    'mapped': dataclasses.replace(
        ONE,
        coulomb_law=FrictionMap(
            speeds=(1e-3, 1e-2, 1e-1),
            pressures=(0.0, 5e6),
            frictions=(9.0, 7.0, 6.0, 22.0, 18.0, 15.0),
            reference_speed=0.02,
        ),
    ),
    'uneven': dataclasses.replace(
        ONE,
        coulomb_law=FrictionMap(speeds=(0.01,), pressures=(0.0, 5e6), frictions=(9.0, 22.0), reference_speed=0.01),
        pressure_asymmetry=PressureAsymmetry(asymmetry=-0.4, full_pressure=3e6),
        stiction_ratio=0.2,
    ),
    'stribeck': dataclasses.replace(SEALS['ms28775_114_table'], velocity_terms=VelocityTerms(30.0, 4.0, 0.003, 0.1)),
}


OTHERS = (
    'power', 'uneven', 'from_elsewhere', 'constant', 'mapped', 'stribeck', 'ms28775_114_prior_art',
    'ms28775_114_stress',
)  # fmt: skip
WARM = TemperatureScale(reference=310.0, coefficient=0.013, coefficient_std=0.001, lowest=290.0, highest=340.0)
ELASTIC = Presliding(stiffness=2e5, yield_exponent=1.5)
SEALS |= {name: dataclasses.replace(SEALS[name], temperature=WARM, presliding=ELASTIC) for name in OTHERS}

MOUNTED_ON = {'from_elsewhere': 'difference', 'constant': 'ambient'}


def with_seals(names: Sequence[str], **changes: object) -> PipelineParameters:
    """The default settings, changed, with these seals on `MOUNTED_ON` or else in chambers a, b, a, ..."""
    seals = tuple(MountedSeal(SEALS[name], MOUNTED_ON.get(name, 'ab'[i % 2])) for i, name in enumerate(names))
    known = {f.name for f in dataclasses.fields(COMPENSATING)}
    guiding = {name: value for name, value in changes.items() if name in known}
    rest = {name: value for name, value in changes.items() if name not in known}
    settings = dataclasses.replace(DEFAULT.estimator.settings, **rest)
    return PipelineParameters(EstimatorParameters(settings, seals), dataclasses.replace(COMPENSATING, **guiding))


def serialised(record: object, frame: bytes) -> tuple[Kind, bytes]:
    match record:
        case Pressure():
            return Kind.PRESSURE, encode(record, frame)
        case Force():
            return Kind.FORCE, encode(record, frame)
        case Velocity():
            return Kind.VELOCITY, encode(record._replace(frame_id=frame))
        case ServoReference():
            return Kind.REFERENCE, encode(record._replace(frame_id=frame))
        case Temperature():
            return Kind.TEMPERATURE, encode(record, frame)
        case WatchdogTick():
            return Kind.TICK, encode(record._replace(frame_id=frame))
    return Kind.OTHER, b'something'


def receipts(pieces: Sequence[tuple[Kind, bytes]]) -> list[int]:
    """Times of receipt [ns]: the newest stamp so far, a little later, as far as the pieces have stamps."""
    newest, times = 0, []
    for kind, data in pieces:
        if kind in TYPES:
            with suppress(ValueError):
                newest = max(newest, decode(TYPES[kind], data).stamp)
        times.append(newest + 20_000)
    return times


def in_memory(
    pieces: Sequence[tuple[Kind, bytes]], times: Sequence[int] | None = None, sent: Sequence[int] | None = None
) -> Messages:
    """A block; ``times`` of receipt and ``sent`` [ns], by default a little after the stamps and just then."""
    received = np.array(times or receipts(pieces), np.int64)
    sizes = np.array([len(data) for _, data in pieces], np.int64)
    data = np.frombuffer(b''.join(data for _, data in pieces), np.uint8)
    kinds = np.array([kind for kind, _ in pieces], np.uint8)
    return Messages(
        data, kinds, np.cumsum(sizes) - sizes, sizes, received, received if sent is None else np.array(sent, np.int64)
    )


TYPES = {
    Kind.PRESSURE: PRESSURE_TYPE,
    Kind.FORCE: FORCE_TYPE,
    Kind.VELOCITY: VELOCITY_TYPE,
    Kind.REFERENCE: REFERENCE_TYPE,
    Kind.TEMPERATURE: TEMPERATURE_TYPE,
    Kind.TICK: TICK_TYPE,
}


def _collect(answers: dict[str, bytes], record: object, frame_id: bytes) -> None:
    answers[type_of(record)] = encode(record, frame_id)


def one_by_one(parameters: PipelineParameters, state: PipelineState, pieces, times, sent=None):
    state, answers = state.copy(), []
    for (kind, data), received, left in zip(pieces, times, sent or times, strict=True):
        given_back: dict[str, bytes] = {}
        if kind in TYPES:
            collect = partial(_collect, given_back)
            receive(parameters, state, decode(TYPES[kind], data), received, collect, left)
        answers.append((given_back.get(ESTIMATE_TYPE, b''), given_back.get(FEEDFORWARD_TYPE, b'')))
    return state, answers


def all_at_once(parameters: PipelineParameters, state: PipelineState, pieces, times, sent=None):
    state, found = receive_all(parameters, state, in_memory(pieces, times, sent))
    places = zip(*(column.tolist() for column in found[1:]), strict=True)
    return state, [(found.data[a : a + b].tobytes(), found.data[c : c + d].tobytes()) for a, b, c, d in places]


def assert_same(
    parameters: PipelineParameters,
    state: PipelineState,
    pieces: Sequence[tuple[Kind, bytes]],
    cuts: Sequence[int] = (),
    lateness: Sequence[int] = (0,),
):
    """Both ways give the same; ``lateness`` [ns] of the messages in turn."""
    times = receipts(pieces)
    sent = [max(received - late, 0) for received, late in zip(times, cycle(lateness), strict=False)]
    expected_state, expected = one_by_one(parameters, state, pieces, times, sent)
    answers = []
    for first, end in pairwise([0, *sorted(cuts), len(pieces)]):
        state, some = all_at_once(parameters, state, pieces[first:end], times[first:end], sent[first:end])
        answers += some
    assert answers == expected
    assert repr(state) == repr(expected_state)  # NaN is not equal to itself


odd = st.sampled_from([math.nan, math.inf, -math.inf, -0.0, 0.0, 1e300, 5e-324])
frames = st.sampled_from([b'', b'rod', b'x' * 11, 'zylinder_ü'.encode(), b'y' * 300])
pressures = st.floats(-1e4, 8e6) | st.floats(-2e5, 5e7) | odd
small = st.floats(-0.004, 0.004) | st.floats(-0.3, 0.3) | odd
forces = st.floats(-80.0, 80.0) | st.floats(-2e6, 2e6) | odd
later = st.sampled_from([0, MS, MS, MS, MS, 40 * MS, 150 * MS, 3_000 * MS, -MS, -900 * MS, 2**31 * 10**9])


@st.composite
def runs(draw) -> list[tuple[Kind, bytes]]:
    """Messages in any order, their stamps mostly a millisecond apart, with what sensors do when they fail."""
    stamp, pieces = draw(st.sampled_from([0, 10**18, 1])), []
    for _ in range(draw(st.integers(1, 30))):
        stamp += draw(later)
        stamp = max(min(stamp, (2**31 - 1) * 10**9), -(2**31) * 10**9)
        what = draw(st.integers(0, 9))
        at = stamp + draw(st.sampled_from([0, 0, 0, -200 * MS if stamp > 0 else 0]))
        if what in (0, 1):
            record: object = Pressure(at, draw(pressures), draw(pressures))
        elif what == 2:
            record = Force(at, draw(forces))
        elif what in (3, 4):
            record = ServoReference(at, 0.0, draw(small), draw(st.floats(-2.0, 2.0) | odd))
        elif what == 5:
            record = None
        elif what == 9:
            record = Temperature(at, draw(st.floats(-20.0, 120.0) | odd), draw(odd))
        elif what == 6:
            record = WatchdogTick(stamp, draw(odd))
        else:
            record = Velocity(at, draw(small), b'')
        kind, data = serialised(record, draw(frames))
        pieces.append((kind, data + b'\x00' * draw(st.integers(0, 3))))
    return pieces


ACTUATORS = {
    'default': ('ms28775_114', 'ms28775_114'),
    'others': OTHERS,
}
"""Every kind of law in two actuators: each is compiled for itself, for a quarter of a minute or more."""
changes = st.fixed_dictionaries(
    {},
    optional={
        'use_measured_velocity': st.booleans(),
        'scale': st.floats(0.0, 2.0),
        'velocity_resolution': st.floats(0.0, 0.1),
        'fade_time': st.floats(1e-3, 1.0),
        'force_limit': st.floats(0.0, 200.0),
        'slew_limit': st.floats(1e-3, 1e6),
        'use_stiction': st.booleans(),
        'presliding': st.booleans(),
        'presliding_against_motion': st.booleans(),
        'stick_velocity': st.just(0.0),
        'pressure_rate_max': st.floats(1e6, 1e10),
        'force_rate_max': st.floats(1e2, 1e8),
        'acceleration_max': st.floats(1.0, 1e3),
        'lateness_max': st.sampled_from([0.0, 0.03, 0.3]),
    },
).filter(lambda changed: not (changed.get('use_measured_velocity') and changed.get('presliding_against_motion')))


lateness = st.lists(st.sampled_from([0, 0, MS, 30 * MS, 30 * MS + 1, 400 * MS, -MS, -31 * MS]), min_size=1)


@hypothesis_settings(max_examples=60)
@given(runs(), lateness, st.sampled_from(sorted(ACTUATORS)), changes, st.booleans(), st.integers(0, 30))
def test_any_run_of_messages_gives_the_same_bytes_and_the_same_state(pieces, late, actuator, changed, refused, cut):
    parameters = with_seals(ACTUATORS[actuator], **changed)
    state = dataclasses.replace(init(parameters), refused=refused)
    assert_same(parameters, state, pieces, cuts=[min(cut, len(pieces))], lateness=late)


def noisy(samples: int, seed: int) -> list[tuple[Kind, bytes]]:
    """A rod that goes to and fro at changing pressure with noise on all, and now and then a sensor that fails."""
    random = np.random.default_rng(seed)
    pieces = []
    for i in range(samples):
        stamp = 10**18 + i * MS
        a, b, f, v = random.normal(size=4)
        speed = max(abs(math.sin(i / 300)) - 0.3, 0.0) * math.copysign(0.05, math.sin(i / 300)) + 1e-4 * v
        records = [
            Pressure(stamp, 2e6 + 2.2e6 * math.sin(i / 700) + 1e4 * a, 5e5 + 1e4 * b),
            Force(stamp, 60.0 * math.sin(i / 300 + 0.3) + f),
            ServoReference(stamp, 0.0, speed, 0.1 * a),
            Velocity(stamp, math.nan if i % 997 == 5 else speed, b''),
        ]
        pieces += [serialised(record, b'rod') for record in records if random.random() > 0.02]
    return pieces


def test_every_law_is_on_an_actuator():
    mounted = [SEALS[name] for names in ACTUATORS.values() for name in names]
    assert {type(seal.coulomb_law) for seal in mounted} >= {*FRICTION_LAWS, FromElsewhere}
    assert {type(seal.coulomb_law) for seal in SEALS.values()} <= {type(seal.coulomb_law) for seal in mounted}


@pytest.mark.parametrize('actuator', sorted(ACTUATORS))
def test_twenty_seconds_with_every_law_are_the_same_to_the_byte(actuator):
    assert_same(with_seals(ACTUATORS[actuator]), init(DEFAULT), noisy(1500, len(actuator)))


def test_inputs_in_time_and_too_late_in_turn_are_the_same_to_the_byte_and_lateness_counts():
    parameters, pieces = with_seals(ACTUATORS['default']), noisy(600, 5)
    late = [0] * 900 + [200 * MS] * 600 + [-200 * MS] * 300  # a backlog, then the clock of the publisher is ahead
    assert_same(parameters, init(DEFAULT), pieces, lateness=late)
    times = receipts(pieces)
    sent = [received - one for received, one in zip(times, cycle(late), strict=False)]
    in_time, too_late = (all_at_once(parameters, init(DEFAULT), pieces, times, when)[1] for when in (times, sent))
    assert in_time[:900] == too_late[:900]
    assert in_time[900:] != too_late[900:]


def test_elastic_seals_are_the_same_to_the_byte_and_change_the_feed_forward():
    pieces = noisy(1500, 3)
    elastic, rigid = (with_seals(ACTUATORS['others'], presliding=chosen) for chosen in (True, False))
    assert_same(elastic, init(DEFAULT), pieces)
    state, other = (
        one_by_one(parameters, init(DEFAULT), pieces, receipts(pieces))[0] for parameters in (elastic, rigid)
    )
    assert state.feedforward.elements != other.feedforward.elements


@compiled
def compiled_frictions(seals, a, b, v, out):
    for i in range(len(a)):
        friction = friction_of_seals(seals, a[i], b[i], v[i])
        out[i, 0], out[i, 1], out[i, 2] = friction.coulomb_friction, friction.coulomb_friction_std, friction.stiction
        out[i, 3], out[i, 4] = friction.in_identified_range, friction.velocity_friction
        out[i, 5] = friction.breakaway_asymmetry


@pytest.mark.parametrize('actuator', sorted(ACTUATORS))
def test_the_friction_of_many_moments_is_that_of_each(actuator):
    random = np.random.default_rng(1)
    seals = with_seals(ACTUATORS[actuator]).estimator.seal_numbers
    edges = [0.0, -0.0, -1e4, 6894757.2931783, 4.5e7, *(SEALS[name].pressure_max for name in ACTUATORS[actuator])]
    a = np.concatenate([edges, random.uniform(-1e4, 9e6, 3000), random.uniform(0.0, 4.5e7, 500)])
    b, v = random.permutation(a), random.choice([0.0, -0.0, 0.001, -0.3, 9.0], len(a)) * random.random(len(a))
    found = np.empty((len(a), 6))
    compiled_frictions(for_compiler(seals), a, b, v, found)
    moments = zip(a.tolist(), b.tolist(), v.tolist(), strict=True)
    assert found.tobytes() == np.array([friction_of_seals(seals, *moment) for moment in moments], float).tobytes()


@pytest.mark.parametrize('kind', TYPES)
def test_what_the_decoder_refuses_is_refused_and_what_it_takes_is_taken(kind):
    records = (
        Pressure(1, 2.0, 3.0),
        Force(1, 2.0),
        Velocity(1, 2.0),
        ServoReference(1, 2.0, 3.0, 4.0),
        Temperature(1, 2.0, 3.0),
        WatchdogTick(1, 2.0),
    )
    good = dict(serialised(record, b'rod') for record in records)[kind]
    bad = [good[:n] for n in range(len(good))] + [good + bytes(n) for n in range(6)]
    for place in range(16):
        bad += [good[:place] + bytes([value]) + good[place + 1 :] for value in (0, 1, 4, 5, 127, 128, 255)]
    bad += [good[:8] + nanoseconds.to_bytes(4, 'little') + good[12:] for nanoseconds in (999_999_999, 1_000_000_000)]
    bad += [serialised(decode(TYPES[kind], good), b'x' * length)[1] for length in (1023, 1024)]
    refused = 0
    for data in bad:
        try:
            decode(TYPES[kind], data)
        except ValueError:
            refused += 1
            with pytest.raises(UnsuitedError):
                receive_all(DEFAULT, init(DEFAULT), in_memory([(kind, data)]))
        else:
            assert_same(DEFAULT, init(DEFAULT), [(kind, data)])
    assert refused > 40


def test_a_stamp_in_the_state_that_64_bits_do_not_hold_is_refused():
    for stamp in (2**62, -(2**62), 2**70):
        state = dataclasses.replace(init(DEFAULT), force=Force(stamp, 1.0))
        with pytest.raises(UnsuitedError):
            receive_all(DEFAULT, state, in_memory([serialised(Velocity(1, 0.0, b''), b'rod')]))
    for stamp in (NEVER, 2**61, -(2**61)):
        state = dataclasses.replace(init(DEFAULT), force=Force(stamp, 1.0))
        assert_same(DEFAULT, state, [serialised(Velocity(1, 0.0, b''), b'rod')])


def test_the_live_node_does_not_load_the_compiler():
    program = (
        'import json, sys; import seal_friction_ros.core.estimation.pipeline; print(json.dumps(sorted(sys.modules)))'
    )
    found = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=True)
    assert 'numba' not in json.loads(found.stdout)


# -- blocks of messages


def test_kinds_count_up_from_zero_and_each_has_a_number_of_its_own():
    """Compiled code finds the size of an input by its kind, and bags hold kinds as numbers."""
    assert [kind.value for kind in Kind.__members__.values()] == list(range(12))


def test_part_of_a_block_has_its_messages_and_its_times():
    pieces = [serialised(Force(stamp, 2.0), b'x' * stamp) for stamp in (1, 2, 3, 4)]
    block = in_memory(pieces, [10, 20, 30, 40], [9, 18, 27, 36])
    assert [block.message(number) for number in range(4)] == [data for _, data in pieces]
    part = block.taken(1, 3)
    assert [part.message(number) for number in range(2)] == [data for _, data in pieces[1:3]]
    assert (part.received.tolist(), part.kinds.tolist()) == ([20, 30], [Kind.FORCE, Kind.FORCE])
    assert part.sent.tolist() == [18, 27]
    turned = block.in_order(np.array([3, 0]))
    assert [turned.message(number) for number in range(2)] == [pieces[3][1], pieces[0][1]]
    assert (turned.received.tolist(), turned.sent.tolist()) == ([40, 10], [36, 9])


@pytest.mark.parametrize('received', [0, 1, 2**61])
def test_time_of_receipt_may_be_any_that_fits(received):
    pieces = [serialised(Velocity(1, 0.01), b'rod')]
    state, answers = one_by_one(DEFAULT, init(DEFAULT), pieces, [received])
    found = all_at_once(DEFAULT, init(DEFAULT), pieces, [received])
    assert (repr(found[0]), found[1]) == (repr(state), answers)


@pytest.mark.parametrize('received', [-1, 2**61 + 1])
def test_time_of_receipt_out_of_bounds_is_refused_with_the_number_of_its_message(received):
    pieces = [serialised(Force(1, 2.0), b'rod'), serialised(Force(2, 2.0), b'rod')]
    with pytest.raises(UnsuitedError, match=r'^message 1$'):
        receive_all(DEFAULT, init(DEFAULT), in_memory(pieces, [5, received], [5, 6]))


@pytest.mark.parametrize('sent', [-1, 2**61 + 1])
def test_time_of_sending_out_of_bounds_is_refused_with_the_number_of_its_message(sent):
    pieces = [serialised(Force(1, 2.0), b'rod'), serialised(Force(2, 2.0), b'rod')]
    with pytest.raises(UnsuitedError, match=r'^message 1$'):
        receive_all(DEFAULT, init(DEFAULT), in_memory(pieces, [5, 6], [5, sent]))


@pytest.mark.parametrize('frame', [b'', b'rod', b'frame', b'y' * 300])
def test_answers_lie_one_after_the_other_and_fill_their_room(frame):
    """Each begins after 4 bytes, so that its numbers are aligned to 8; less than 8 bytes are free after it."""
    parameters = with_seals(ACTUATORS['default'], use_measured_velocity=True)
    records = [Pressure(1, 2e6, 0.0), Velocity(2, 0.01), WatchdogTick(3, 0.0), Velocity(4, 0.01)]
    pieces = [serialised(record, frame) for record in records]
    _, found = receive_all(parameters, init(parameters), in_memory(pieces))
    places = [(found.estimate_offsets[i], found.estimate_sizes[i]) for i in (1, 3)]
    places += [(found.feedforward_offsets[i], found.feedforward_sizes[i]) for i in (1, 2, 3)]
    end = 0
    for offset, size in sorted(places):
        assert offset == end + 4
        end = (offset + size + 7) // 8 * 8
    assert end == len(found.data)


@pytest.mark.parametrize('frame', [b'', b'rod', b'frame'])
def test_bytes_that_mean_nothing_are_not_passed_on(frame):
    """The end of the name, and what is between the name and the numbers."""
    kind, good = serialised(Velocity(1, 0.01), frame)
    begin, end = 16 + len(frame), len(good) - 8
    junk = good[:begin] + b'z' * (end - begin) + good[end:]
    (expected,), (found,) = (all_at_once(DEFAULT, init(DEFAULT), [(kind, data)], [1])[1] for data in (good, junk))
    assert found == expected
    assert_same(DEFAULT, init(DEFAULT), [(kind, junk)])


@pytest.mark.parametrize('before', [0, 2])
@pytest.mark.parametrize('force', [math.inf, -math.inf])
def test_answer_that_is_not_finite_is_refused_with_the_number_of_its_message(force, before):
    """No settings make one; a state that somebody else wrote may."""
    parameters = with_seals(ACTUATORS['default'], scale=1.0)
    state = dataclasses.replace(init(parameters), feedforward=FADED_IN._replace(force=force))
    pieces = [serialised(Force(1, 2.0), b'rod')] * before + [serialised(WatchdogTick(2, 0.0), b'rod')] * 2
    with pytest.raises(UnsuitedError, match=f'^an answer to message {before} is not finite$'):
        receive_all(parameters, state, in_memory(pieces))
