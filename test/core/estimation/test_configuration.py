"""The snapshot in a bag: it comes back as it was, and equal ones are equal text."""

import dataclasses
import json
import math
import struct
from typing import get_type_hints

import pytest
from harness.answers import receive_one
from harness.compensation import REAL_SEALS, compensating
from hypothesis import given
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.estimation.adaptation import NOT_ADAPTED, AdaptationSettings, AdaptationState
from seal_friction_ros.core.estimation.conditioned_velocity import NOT_CONDITIONED, ConditionedVelocity
from seal_friction_ros.core.estimation.configuration import (
    ALGORITHM_VERSION,
    MOUNTING,
    Configuration,
    Recorded,
    SealSelection,
    Snapshot,
    mounted,
    parse_snapshot,
    snapshot_text,
)
from seal_friction_ros.core.estimation.estimator import NO_SPEED, EstimatorSettings, EstimatorState, Speed
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings, FeedForwardState
from seal_friction_ros.core.estimation.hidden_motion import NO_HIDDEN_MOTION, HiddenMotion
from seal_friction_ros.core.estimation.pipeline import NO_REFERENCE, PipelineState, ReceiptTimes, Reference, init
from seal_friction_ros.core.estimation.records import NO_TEMPERATURE, SealTemperature
from seal_friction_ros.core.estimation.sheared_seals import NOT_FOLLOWED, FollowedShear
from seal_friction_ros.core.estimation.swings import NO_SWING, Swing
from seal_friction_ros.core.friction.presliding import NO_ELEMENTS, SLOTS, Elements
from seal_friction_ros.core.messages.coder import decode_text, encode_text
from seal_friction_ros.core.messages.records import (
    NEVER,
    NO_FORCE,
    NO_PRESSURE,
    Force,
    Pressure,
    ServoReference,
    Velocity,
    field_names,
)
from seal_friction_ros.files import load_configuration, read_yaml

MS = 1_000_000  # [ns]
SEALS = ROOT / 'config' / 'seals'
CONFIGURATION = load_configuration(SealSelection(), EstimatorSettings())
CONDITIONED = ConditionedVelocity(5, 0.1, 1e-6, 1e-3, 0.01, True, 0.11, -0.01, 2e-6, -5e-7, 4, 0.02, 10)
SNAPSHOT = Snapshot(
    CONFIGURATION,
    PipelineState(
        EstimatorState(
            5,
            True,
            Pressure(3, 1e6, 2e6),
            Force(4, -3.5),
            Speed(5, 0.1),
            NO_PRESSURE,
            Force(5, 9e5),
            NO_SPEED,
            CONDITIONED,
        ),
        FeedForwardState(5, 12.5, 0.75, 40.0, -0.02),
        40.0,
        Pressure(3, math.nan, -0.0),
        NO_FORCE,
        Reference(CONDITIONED, -0.02, 0.5),
        ReceiptTimes(6, 4, NEVER, 5, 3),
        refused=True,
        clock_offset=-7,
        temperature=SealTemperature(2, 313.15),
        clock=2,
    ),
)

stamps = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
usable = st.floats(allow_nan=False, allow_infinity=False)
anything = st.floats()
stamps_or_never = st.just(NEVER) | stamps
usable_pressures = st.just(NO_PRESSURE) | st.builds(Pressure, stamps, usable, usable)
usable_forces = st.just(NO_FORCE) | st.builds(Force, stamps, usable)
usable_speeds = st.just(NO_SPEED) | st.builds(Speed, stamps, usable)
conditioned = st.just(NOT_CONDITIONED) | st.builds(
    ConditionedVelocity,
    stamps,
    *[usable] * 4,
    st.booleans(),
    *[usable] * 4,
    stamps_or_never,
    usable,
    st.integers(0, 10),
)


def records(kind: type) -> st.SearchStrategy:
    """A record of numbers and of such records, every number of it usable."""
    of_type = {float: usable, int: st.integers(-(2**62), 2**62), bool: st.booleans()}
    return st.builds(
        kind, *(of_type[hint] if hint in of_type else records(hint) for hint in get_type_hints(kind).values())
    )


states = st.builds(
    PipelineState,
    st.builds(
        EstimatorState,
        stamps_or_never,
        st.booleans(),
        *[usable_pressures, usable_forces, usable_speeds] * 2,
        conditioned,
        st.just(NOT_ADAPTED) | records(AdaptationState),
        st.just(NOT_FOLLOWED) | records(FollowedShear),
        st.just(NO_SWING) | records(Swing),
        st.just(NO_HIDDEN_MOTION) | records(HiddenMotion),
    ),
    st.builds(
        FeedForwardState,
        stamps_or_never,
        *[usable] * 4,
        st.just(NO_ELEMENTS) | st.builds(Elements, *[usable] * SLOTS),
        usable,
    ),
    usable,
    st.just(NO_PRESSURE) | st.builds(Pressure, stamps, anything, anything),
    st.just(NO_FORCE) | st.builds(Force, stamps, anything),
    st.just(NO_REFERENCE) | st.builds(Reference, conditioned, usable, usable),
    st.builds(ReceiptTimes, *[stamps_or_never] * 5),
    st.booleans(),
    stamps,
    st.just(NO_TEMPERATURE) | records(SealTemperature),
    stamps_or_never,
)


def with_part(path: str, value) -> str:
    """Text of a snapshot with another value (or, for ..., none) at a dotted path."""
    document = json.loads(snapshot_text(SNAPSHOT))
    *parents, key = path.split('.')
    part = document
    for parent in parents:
        part = part[parent]
    if value is ...:
        del part[key]
    else:
        part[key] = value
    return json.dumps(document)


def bits(value):
    """A state bit by bit; every NaN counts alike, since nothing computes with its payload."""
    if field_names(value):
        return [type(value), *(bits(getattr(value, name)) for name in field_names(value))]
    return struct.pack('<d', math.nan if math.isnan(value) else value) if isinstance(value, float) else value


@given(states)
def test_a_snapshot_comes_back_to_the_bit_nan_included(state):
    back = parse_snapshot(snapshot_text(Snapshot(CONFIGURATION, state)))
    assert back.configuration.parameters() == CONFIGURATION.parameters()
    assert back.configuration.selection == CONFIGURATION.selection
    assert bits(back.state) == bits(state)


@given(states)
def test_the_text_is_a_fixed_point(state):
    text = snapshot_text(Snapshot(CONFIGURATION, state))
    assert snapshot_text(parse_snapshot(text)) == text


@given(
    st.builds(EstimatorSettings, use_stiction=st.booleans(), pressure_timeout=st.floats(1e-3, 1.0)),
    st.builds(
        FeedForwardSettings,
        use_measured_velocity=st.booleans(),
        scale=st.floats(0.0, 2.0),
        lateness_max=st.floats(0.0, 10.0),
    ),
)
def test_settings_come_back_exactly(settings, feedforward):
    configuration = Configuration(CONFIGURATION.selection, CONFIGURATION.seal_documents, settings, feedforward)
    back = parse_snapshot(snapshot_text(SNAPSHOT._replace(configuration=configuration))).configuration
    assert (back.settings, back.feedforward) == (settings, feedforward)


def test_the_order_of_a_file_does_not_matter_to_the_text():
    def backwards(part):
        return {k: backwards(part[k]) for k in reversed(part)} if isinstance(part, dict) else part

    turned = tuple(backwards(document) for document in CONFIGURATION.seal_documents)
    again = SNAPSHOT._replace(configuration=dataclasses.replace(CONFIGURATION, seal_documents=turned))
    assert [list(a) for a in turned] != [list(b) for b in CONFIGURATION.seal_documents]
    assert snapshot_text(again) == snapshot_text(SNAPSHOT)


@pytest.mark.parametrize('path', sorted(SEALS.glob('*.yaml')), ids=lambda path: path.stem)
def test_every_shipped_seal_survives_the_text_and_the_wire(path):
    configuration = load_configuration(SealSelection((str(path),), ('b',)), EstimatorSettings())
    data = encode_text(snapshot_text(SNAPSHOT._replace(configuration=configuration)))
    back = parse_snapshot(decode_text(data)).configuration
    assert back.seal_documents == (read_yaml(path),)
    assert back.parameters() == configuration.parameters()


def test_an_estimator_taken_up_from_a_snapshot_goes_on_as_if_never_stopped():
    configuration = compensating()
    parameters = configuration.parameters()
    before = []
    for stamp in range(0, 200 * MS, MS):
        before += [Pressure(stamp, 3e6, 3e6), Force(stamp, 12.0), ServoReference(stamp, 0.0, 0.02, 0.0)]
        before += [Velocity(stamp, 5e-4, b'')]
    state = init(parameters)
    for message in before:
        state, _ = receive_one(parameters, state, message)
    back = parse_snapshot(snapshot_text(Snapshot(configuration, state)))
    straight = receive_one(parameters, state, Velocity(200 * MS, 1.5e-3, b'rod'))
    taken_up = receive_one(back.configuration.parameters(), back.state, Velocity(200 * MS, 1.5e-3, b'rod'))
    assert straight[1].feedforward.force > 0.0
    assert taken_up == straight


@pytest.mark.parametrize('recorded', [None, Recorded(None), Recorded(FeedForwardSettings(scale=0.5))])
def test_the_force_that_acted_in_the_recording_is_read_back(recorded):
    snapshot = Snapshot(CONFIGURATION, init(CONFIGURATION.parameters()), recorded=recorded)
    assert parse_snapshot(snapshot_text(snapshot)).recorded == recorded


@pytest.mark.parametrize('text', ['', '{', 'null', '5', '[]', '{}', '"text"', '{"selection": {}}'])
def test_what_is_no_snapshot_is_refused_with_a_value_error(text):
    with pytest.raises(ValueError):
        parse_snapshot(text)


@pytest.mark.parametrize(
    ('path', 'value', 'complaint'),
    [
        ('selection', ..., "not the JSON of a snapshot: KeyError: 'selection'"),
        ('settings', ..., "KeyError: 'settings'"),
        ('state', ..., "KeyError: 'state'"),
        ('feedforward', ..., "KeyError: 'feedforward'"),
        ('state.reference', ..., "KeyError: 'reference'"),
        ('seal_documents', 5, 'not the JSON of a snapshot: TypeError'),
        ('state', [], 'not the JSON of a snapshot: TypeError'),
        ('state.refused', ..., "KeyError: 'refused'"),
        ('state.pressure', [1], 'not the JSON of a snapshot: TypeError'),
        ('state.pressure.chamber_a', [], 'not the JSON of a snapshot: TypeError'),
        ('state.pressure.chamber_b', ..., "KeyError: 'chamber_b'"),
        ('state.force.force', 'x', 'hexadecimal'),
        ('state.force.stamp', 'x', 'invalid literal'),
        ('state.estimator.velocity.velocity', 'nan', 'a number in the state is not finite'),
        ('version', 'new', 'invalid literal'),
        ('selection.seals', 'ms28775_114', "configuration: selection.seals = 'ms28775_114' is not a list"),
        ('selection.seal_chambers', ['a'], 'has 1 entries but there are 2 seals'),
        ('selection.seal_chambers', ['mounting'], 'does not have the chamber of each seal'),
        ('settings.stick_velocity', -1.0, 'stick_velocity = -1.0 m/s is below its lower bound'),
        ('settings.sticky', 1.0, 'configuration: settings has no sticky'),
    ],
)
def test_a_damaged_snapshot_is_refused_with_what_is_wrong(path, value, complaint):
    with pytest.raises(ValueError, match=complaint):
        parse_snapshot(with_part(path, value))


def test_one_parameter_holds_seals_and_chambers_and_the_earlier_two_mean_the_same():
    for seals, chambers in ((('x',), ('a',)), (('x', '/p@q/y.yaml', 'x'), ('ambient', 'difference', 'b'))):
        assert SealSelection(tuple(map('@'.join, zip(seals, chambers, strict=True)))) == SealSelection(seals, chambers)
    for path in ('/p@q/y.yaml', '/p/y@a.yaml', 'x@'):  # an @ in a path names no chamber
        assert SealSelection((path,)).seals == (path,)


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        ({'seals': ()}, 'SealSelection.seals is empty: name at least one seal'),
        (
            {'seals': ('x',), 'seal_chambers': ('a', 'b')},
            'has 2 entries but there are 1 seals: give one chamber a seal',
        ),
        ({'seal_chambers': ('a', 'c')}, "'c' is not a, b, difference or ambient"),
        ({'seals': ('x@a', 'y')}, 'give every seal its chamber'),
        ({'seals': ('x@a', 'y@c')}, "'c' is not a, b, difference or ambient"),
    ],
)
def test_an_invalid_selection_is_refused(change, complaint):
    with pytest.raises(ValueError, match=complaint):
        SealSelection(**change)


@pytest.mark.parametrize(
    'text',
    [
        pytest.param('[' * 100_000, id='deep nesting'),
        pytest.param(with_part('state.force.force', '0x1p+5000'), id='force beyond every float'),
        pytest.param(with_part('state.force.stamp', math.inf), id='stamp infinite'),
        pytest.param(with_part('settings.stick_velocity', 10**400), id='setting beyond every float'),
    ],
)
def test_a_hostile_snapshot_is_refused_with_a_value_error(text):
    with pytest.raises(ValueError):
        parse_snapshot(text)


@pytest.mark.parametrize(
    'path',
    [
        'state.estimator.pressure.chamber_b',
        'state.estimator.force.force',
        'state.estimator.velocity.velocity',
        'state.estimator.leapt_force.force',
        'state.feedforward.fade',
        'state.friction',
        'state.reference.velocity.half_width',
    ],
)
@pytest.mark.parametrize('value', ['nan', '-inf'])
def test_a_value_in_use_that_is_not_finite_is_refused(path, value):
    with pytest.raises(ValueError, match='a number in the state is not finite'):
        parse_snapshot(with_part(path, value))


def test_a_snapshot_of_the_version_before_is_taken_as_far_as_it_goes():
    document = json.loads(snapshot_text(SNAPSHOT))
    del document['version']
    document['feedforward'] |= {'coulomb_scale': 0.4, 'viscous_scale': 0.2, 'estimate_timeout': 60.0}
    del document['feedforward']['scale']
    back = parse_snapshot(json.dumps(document))
    assert back.version == 1
    feedforward = back.configuration.feedforward
    assert (feedforward.scale, feedforward.estimate_timeout) == (0.4, 1.0)
    assert back.state.pressure.stamp == SNAPSHOT.state.pressure.stamp
    assert back.state.refused
    assert back.state.feedforward == init(CONFIGURATION.parameters()).feedforward


@pytest.mark.parametrize('version', [None, 1, 2])
def test_the_state_of_an_older_version_begins_anew_with_its_newest_inputs(version):
    document = json.loads(snapshot_text(SNAPSHOT)) | {'version': version}
    if version is None:
        del document['version']
    newest = ('pressure', 'force', 'refused')
    document['state'] = {name: document['state'][name] for name in newest} | {'estimator': 'unknown'}
    back = parse_snapshot(json.dumps(document))
    newest_inputs = {name: getattr(SNAPSHOT.state, name) for name in newest}
    expected = dataclasses.replace(init(CONFIGURATION.parameters()), **newest_inputs)
    assert bits(back.state) == bits(expected)
    assert back.version == (version or 1)


def test_settings_that_an_older_bag_has_not_are_without_effect():
    document = json.loads(snapshot_text(SNAPSHOT)) | {'version': 2}
    del document['adaptation'], document['settings']['temperature_timeout'], document['settings']['use_presliding']
    del document['feedforward']['lateness_max'], document['feedforward']['presliding']
    back = parse_snapshot(json.dumps(document)).configuration
    assert back == dataclasses.replace(
        CONFIGURATION,
        settings=EstimatorSettings(use_presliding=False),
        feedforward=dataclasses.replace(CONFIGURATION.feedforward, lateness_max=0.0),
        adaptation=AdaptationSettings('off'),
    )
    assert not back.feedforward.presliding
    assert CONFIGURATION.tells_sending
    assert not back.tells_sending


# --- the mounting ---


def test_a_file_that_is_named_once_stands_for_every_seal_of_its_mounting():
    rods, piston = (
        {'name': name, 'mounting': {'chambers': on}} for name, on in (('rod', ['a', 'a']), ('piston', ['difference']))
    )
    selection = SealSelection(('rod.yaml', 'piston.yaml'), MOUNTING)
    found, documents = mounted(selection, (rods, piston))
    assert found.seals == ('rod.yaml', 'rod.yaml', 'piston.yaml')
    assert found.seal_chambers == ('a', 'a', 'difference')
    assert documents == (rods, rods, piston)


ROD = {'name': 'rod', 'mounting': {'chambers': ['a', 'a']}}
BARE = {'name': 'bare'}


def test_chambers_that_are_named_are_taken_as_they_are_and_two_files_that_tell_none_are_on_a_and_b():
    named = SealSelection(('x', 'y'), ('b', 'ambient'))
    assert mounted(named, (BARE, ROD)) == (named, (BARE, ROD))
    found, documents = mounted(SealSelection(('x', 'y')), (BARE, BARE))
    assert (found.seals, found.seal_chambers, documents) == (('x', 'y'), ('a', 'b'), (BARE, BARE))
    twice, documents = mounted(SealSelection(('rod', 'rod')), (ROD, ROD))
    assert (twice.seals, twice.seal_chambers, documents) == (('rod', 'rod'), ('a', 'a'), (ROD, ROD))


@pytest.mark.parametrize(
    ('seals', 'documents', 'complaint'),
    [
        (('x',), (BARE,), 'x has no mounting: give every entry its chamber'),
        (('x', 'y', 'z'), (BARE, BARE, BARE), 'x has no mounting'),
        (('rod', 'x'), (ROD, BARE), 'x has no mounting'),
        (('rod', 'rod', 'rod'), (ROD, ROD, ROD), 'seals has rod 3 times but its mounting has 2 chambers: name it once'),
    ],
)
def test_seals_whose_chambers_are_not_known_are_refused(seals, documents, complaint):
    with pytest.raises(ValueError, match=complaint):
        mounted(SealSelection(seals), documents)


def test_a_configuration_needs_the_chamber_of_each_seal_and_knows_the_placeholder():
    with pytest.raises(ValueError, match='does not have the chamber of each seal'):
        dataclasses.replace(CONFIGURATION, selection=SealSelection())
    assert CONFIGURATION.has_placeholder
    mixed = dataclasses.replace(CONFIGURATION, selection=SealSelection(('x', 'placeholder'), ('a', 'b')))
    assert mixed.has_placeholder
    assert not dataclasses.replace(CONFIGURATION, selection=SealSelection(('x', 'y'), ('a', 'b'))).has_placeholder


def test_placeholder_seals_make_no_force_and_others_the_one_that_was_asked_for():
    placeholder = compensating()
    silent = placeholder.without_placeholder_force()
    assert silent == dataclasses.replace(placeholder, feedforward=compensating(scale=0.0).feedforward)
    real = load_configuration(SealSelection(REAL_SEALS), EstimatorSettings(), placeholder.feedforward)
    assert real.without_placeholder_force() == real
    one_of_two = load_configuration(
        SealSelection(('placeholder', REAL_SEALS[1])), EstimatorSettings(), placeholder.feedforward
    )
    assert one_of_two.without_placeholder_force().feedforward.scale == 0.0


def of_version_1(**parts) -> str:
    """Text of a snapshot before there was a version; ``parts`` are merged."""
    document = json.loads(snapshot_text(SNAPSHOT))
    del document['version']
    for name, values in parts.items():
        document[name] |= values
    return json.dumps(document)


def test_the_default_seals_of_version_1_count_as_placeholder_and_no_others_do():
    chambers = {'seal_chambers': ['a', 'b']}
    default = {'selection': {'seals': ['ms28775_114', 'ms28775_114'], **chambers}}
    assert parse_snapshot(of_version_1(**default)).configuration.has_placeholder
    other = {'selection': {'seals': ['ms28775_114', 'x'], **chambers}}
    assert parse_snapshot(of_version_1(**other)).configuration.selection.seals == ('ms28775_114', 'x')
    now = json.loads(of_version_1(**default)) | {'version': 2}
    assert not parse_snapshot(json.dumps(now)).configuration.has_placeholder


def test_settings_of_version_1_are_taken_within_the_present_bounds():
    text = of_version_1(
        settings={'pressure_timeout': 5.0, 'force_timeout': 1e-9, 'velocity_max': 2.0, 'no_longer': 3.0},
        feedforward={'use_measured_velocity': True},
    )
    back = parse_snapshot(text).configuration
    settings = back.settings
    assert (settings.pressure_timeout, settings.force_timeout, settings.velocity_max) == (1.0, 1e-3, 2.0)
    assert back.feedforward.use_measured_velocity
    without = json.loads(text)
    del without['settings']['stamp_age_max']
    assert parse_snapshot(json.dumps(without)).configuration.settings.stamp_age_max == 0.0  # it had no such check
    assert parse_snapshot(text).version == 1
    assert parse_snapshot(snapshot_text(SNAPSHOT)).version == SNAPSHOT.version == ALGORITHM_VERSION
