"""The snapshot in a bag: it comes back as it was, and equal ones are equal text."""

import json
import math
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core import wire
from seal_friction_ros.core.configuration import (
    Configuration,
    SealSelection,
    Snapshot,
    parse_snapshot,
    snapshot_text,
)
from seal_friction_ros.core.estimator import EstimatorSettings, EstimatorState, init, step
from seal_friction_ros.core.held_inputs import HeldInputs
from seal_friction_ros.core.records import Force, Pressure
from seal_friction_ros.files import load_configuration, read_yaml

SEALS = Path(__file__).parents[2] / 'config' / 'seals'
CONFIGURATION = load_configuration(SealSelection(), EstimatorSettings())
SNAPSHOT = Snapshot(
    CONFIGURATION,
    EstimatorState(5, True, Pressure(3, 1e6, 2e6), Force(4, -3.5)),
    HeldInputs(Pressure(3, math.nan, -0.0), None),
)

stamps = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
usable = st.floats(allow_nan=False, allow_infinity=False)
states = st.builds(
    EstimatorState,
    st.none() | stamps,
    st.booleans(),
    st.none() | st.builds(Pressure, stamps, usable, usable),
    st.none() | st.builds(Force, stamps, usable),
)
held_inputs = st.builds(
    HeldInputs,
    st.none() | st.builds(Pressure, stamps, st.floats(), st.floats()),
    st.none() | st.builds(Force, stamps, st.floats()),
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


def bits(sample) -> tuple:
    """A sample bit by bit; every NaN counts alike, since nothing computes with its payload."""
    return tuple(
        struct.pack('<d', math.nan if math.isnan(x) else x) if isinstance(x, float) else x for x in sample or ()
    )


@given(states, held_inputs)
def test_a_snapshot_comes_back_to_the_bit_nan_included(state, held):
    back = parse_snapshot(snapshot_text(Snapshot(CONFIGURATION, state, held)))
    assert back.configuration.parameters() == CONFIGURATION.parameters()
    assert back.configuration.selection == CONFIGURATION.selection
    assert back.state == state
    assert [bits(x) for x in back.state[2:]] == [bits(x) for x in state[2:]]
    assert [bits(x) for x in back.held] == [bits(x) for x in held]


@given(states, held_inputs)
def test_the_text_is_a_fixed_point(state, held):
    text = snapshot_text(Snapshot(CONFIGURATION, state, held))
    assert snapshot_text(parse_snapshot(text)) == text


@given(st.builds(EstimatorSettings, use_stiction=st.booleans(), pressure_timeout=st.floats(1e-4, 60.0)))
def test_settings_come_back_exactly(settings):
    snapshot = SNAPSHOT._replace(configuration=Configuration(SealSelection(), CONFIGURATION.seal_documents, settings))
    assert parse_snapshot(snapshot_text(snapshot)).configuration.settings == settings


def test_the_order_of_a_file_does_not_matter_to_the_text():
    def backwards(part):
        return {k: backwards(part[k]) for k in reversed(part)} if isinstance(part, dict) else part

    turned = tuple(backwards(document) for document in CONFIGURATION.seal_documents)
    again = SNAPSHOT._replace(configuration=Configuration(SealSelection(), turned, EstimatorSettings()))
    assert [list(a) for a in turned] != [list(b) for b in CONFIGURATION.seal_documents]
    assert snapshot_text(again) == snapshot_text(SNAPSHOT)


@pytest.mark.parametrize('path', sorted(SEALS.glob('*.yaml')), ids=lambda path: path.stem)
def test_every_shipped_seal_survives_the_text_and_the_wire(path):
    configuration = load_configuration(SealSelection((str(path),), ('b',)), EstimatorSettings())
    data = wire.encode_text(snapshot_text(SNAPSHOT._replace(configuration=configuration)))
    back = parse_snapshot(wire.decode_text(data)).configuration
    assert back.seal_documents == (read_yaml(path),)
    assert back.parameters() == configuration.parameters()


def test_an_estimator_taken_up_from_a_snapshot_goes_on_as_if_never_stopped():
    parameters = CONFIGURATION.parameters()
    held = HeldInputs(Pressure(0, 3e6, 3e6), Force(0, 12.0))
    state, _ = step(parameters, init(parameters), held.rod_sample(1, 5e-4))
    back = parse_snapshot(snapshot_text(Snapshot(CONFIGURATION, state, held)))
    straight = step(parameters, state, held.rod_sample(2, 1.5e-3))
    taken_up = step(back.configuration.parameters(), back.state, back.held.rod_sample(2, 1.5e-3))
    assert taken_up == straight


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
        ('held', ..., "KeyError: 'held'"),
        ('seal_documents', 5, 'not the JSON of a snapshot: TypeError'),
        ('state', [], 'not the JSON of a snapshot: TypeError'),
        ('state.pressure', [1], 'not the JSON of a snapshot: IndexError'),
        ('state.pressure', [1, 2.0, 3.0], 'not the JSON of a snapshot: TypeError'),
        ('held.force', [1, 'x'], 'hexadecimal'),
        ('held.force', ['x', '0x1p0'], 'invalid literal'),
        ('selection.seals', 'ms28775_114', "configuration: selection.seals = 'ms28775_114' is not a list"),
        ('selection.seal_chambers', ['a'], 'has 1 entries but there are 2 seals'),
        ('settings.stick_velocity', -1.0, 'stick_velocity = -1.0 m/s is below its lower bound'),
        ('settings.sticky', 1.0, 'configuration: settings has no sticky'),
    ],
)
def test_a_damaged_snapshot_is_refused_with_what_is_wrong(path, value, complaint):
    with pytest.raises(ValueError, match=complaint):
        parse_snapshot(with_part(path, value))


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        ({'seals': ()}, 'SealSelection.seals is empty: name at least one seal'),
        ({'seals': ('x',)}, 'has 2 entries but there are 1 seals: give one chamber a seal'),
        ({'seal_chambers': ('a', 'c')}, "'c' is neither a nor b"),
    ],
)
def test_a_selection_that_makes_no_sense_is_refused(change, complaint):
    with pytest.raises(ValueError, match=complaint):
        SealSelection(**change)


@pytest.mark.parametrize(
    'text',
    [
        pytest.param('[' * 100_000, id='deep nesting'),
        pytest.param(with_part('held.force', [1, '0x1p+5000']), id='force beyond every float'),
        pytest.param(with_part('held.force', [math.inf, '0x1p0']), id='stamp infinite'),
        pytest.param(with_part('settings.stick_velocity', 10**400), id='setting beyond every float'),
    ],
)
def test_a_hostile_snapshot_is_refused_with_a_value_error(text):
    with pytest.raises(ValueError):
        parse_snapshot(text)


@pytest.mark.parametrize('path', ['state.pressure', 'state.force'])
def test_a_value_in_use_that_is_not_finite_is_refused(path):
    values = [1, 'nan', 'nan'] if path == 'state.pressure' else [1, 'nan']
    with pytest.raises(ValueError):
        parse_snapshot(with_part(path, values))
