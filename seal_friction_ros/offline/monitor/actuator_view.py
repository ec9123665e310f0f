"""What a person sees of one actuator: messages in, a row of numbers for the curves and the situation in words out.

``held = take(held, record, received)`` for every message, then at the pace of the view ``row(known, held, time)`` and
``situation(known, held, now)``. The same functions serve the live view and that of a bag.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import reduce
from itertools import takewhile
from operator import or_
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.core.estimation.findings import BAD, LOOK, PLACEHOLDER, STATUS_WORDS, USUAL, Finding, deciding
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.units import BAR, UM
from seal_friction_ros.core.friction.force_sum_correction import NO_CORRECTION, ForceSumCorrection, corrected_force_sum
from seal_friction_ros.core.friction.mounting import CHAMBERS, pressure_at_seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import (
    NEVER,
    NO_ESTIMATE,
    FeedForward,
    Force,
    FrictionEstimate,
    Limited,
    Position,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
)

OFF = 'off'  # mode of the adaptation
PAIRED = 0.03  # [s] our choice, as reference_timeout: longest time between the stamps of a reference and a position
RECENT = 0.5  # [s] our choice: a lamp stays lit for this time
TOO_OLD = 0.5  # [s] our choice: an estimate or an input without a message for this time is called missing
GONE = 2.5  # [s] our choice: a node of which nothing comes for so long is gone; its diagnostics come every second
_MOST_FRAME = 80  # characters of a frame name that are shown

COLUMNS = (
    'time',  # [s]
    'measured',  # [N] friction by the force sum; with adaptation while sliding less inertia and offset
    'estimate',  # [N] friction that acts now
    'low',  # [N] band of 95 % about the estimate
    'high',  # [N]
    'feedforward',  # [N]
    'limit',  # [N] force_limit
    'below',  # [N] minus force_limit
    'error',  # [um] reference less position
    'pressure_a',  # [bar, gauge]
    'pressure_b',  # [bar, gauge]
    'scale',  # [-] adaptation
    'scale_low',  # [-] band of 95 %
    'scale_high',  # [-]
    'residual',  # [N]
    'status',  # bits of every estimate since the row before
    'limited',  # bits of every feed-forward since the row before
)
"""Numbers of a row; None where none came since the row before: a curve ends where its data end."""
Row = tuple[Any, ...]

INPUT_NAMES: dict[type, str] = {
    Velocity: 'velocity',
    Pressure: 'pressures',
    Force: 'force sum',
    ServoReference: 'reference',
    Position: 'position',
    Temperature: 'temperature',
}
"""Record of an input -> its name in words, in the order in which they are listed."""
NEEDED = (Velocity, Pressure)
"""Inputs without which there is no estimate."""

STATE_WORDS = {
    (FrictionState.SLIDING, 1): 'sliding out',
    (FrictionState.SLIDING, -1): 'sliding in',
    (FrictionState.SLIDING, 0): 'sliding',
    (FrictionState.BREAKAWAY, 1): 'breaking away, outwards',
    (FrictionState.BREAKAWAY, -1): 'breaking away, inwards',
    (FrictionState.STUCK, 1): 'at rest: the seals hold it against an outward force',
    (FrictionState.STUCK, -1): 'at rest: the seals hold it against an inward force',
    (FrictionState.STUCK, 0): 'at rest',
}
"""State and direction -> words; others are unknown."""


def serious_words(status: int) -> list[str]:
    """What the bits of a status mean that not every reversal has."""
    return [words for bit, words in STATUS_WORDS.items() if status & bit and not USUAL & bit]


class Known(NamedTuple):
    """What the configuration tells of an actuator."""

    seals: tuple[str, ...] = ()  # NAME@CHAMBER
    scale: float = math.nan  # [-] feedforward.scale
    lead_time: float = math.nan  # [s]
    force_limit: float = math.nan  # [N]
    pressure_low: float = -math.inf  # [Pa] identified by every seal
    pressure_high: float = math.inf  # [Pa]
    adaptation: str = OFF
    correction: ForceSumCorrection = NO_CORRECTION
    has_placeholder: bool = False
    chambers: tuple[str, ...] = ('a', 'b')  # of the seals


UNKNOWN_CONFIGURATION = Known()


class Held(NamedTuple):
    """Newest record of each kind."""

    records: Mapping[type, Any] = {}
    receipts: Mapping[type, int] = {}  # [ns] when each was received
    status: int = 0  # bits of every estimate since the last row
    limited: int = 0  # bits of every feed-forward since the last row

    @property
    def estimate(self) -> FrictionEstimate:
        """The newest estimate, or `NO_ESTIMATE`."""
        found: FrictionEstimate = self.records.get(FrictionEstimate, NO_ESTIMATE)
        return found


NOTHING_HELD = Held()


def known_of(configuration: Configuration) -> Known:
    """What a view needs of a configuration."""
    estimator, feedforward = configuration.parameters()
    places = zip(configuration.selection.seals, configuration.selection.seal_chambers, strict=True)
    seals = [mounted.seal for mounted in estimator.seals]
    return Known(
        seals=tuple(f'{name}@{chamber}' for name, chamber in places),
        scale=feedforward.scale,
        lead_time=feedforward.lead_time,
        force_limit=feedforward.force_limit,
        pressure_low=max(seal.pressure_min for seal in seals),
        pressure_high=min(seal.pressure_max for seal in seals),
        adaptation=configuration.adaptation.mode,
        correction=estimator.force_sum_correction,
        has_placeholder=configuration.has_placeholder,
        chambers=tuple(mounted.chamber for mounted in estimator.seals),
    )


def take(held: Held, record: Any, received: int) -> Held:
    """Held records after one more, received at ``received`` [ns]."""
    kind = type(record)
    status, limited = held.status, held.limited
    if kind is FrictionEstimate:
        status |= record.status
    elif kind is FeedForward:
        limited |= record.limited
    return Held({**held.records, kind: record}, {**held.receipts, kind: received}, status, limited)


def next_interval(held: Held) -> Held:
    """Held records after a row was made of them: the bits are those of the newest answers again."""
    newest = held.records.get(FeedForward)
    return held._replace(status=held.estimate.status, limited=newest.limited if newest else 0)


def row(known: Known, held: Held, time: float, since: int = -1) -> Row:
    """Numbers of one moment, at a time [s] on the axis of the view.

    The band is that of the next reading while the rod slides: friction force plus and minus `BAND_95` standard
    deviations. What was received until the row before, ``since`` [ns], is in no row again.
    """
    estimate = held.estimate
    new = {kind: record for kind, record in held.records.items() if held.receipts[kind] > since}
    pressure, feedforward = new.get(Pressure), new.get(FeedForward)
    source, measured = measured_friction(known, held)
    friction = low = high = scale = spread = residual = math.nan
    if FrictionEstimate in new and estimate.stamp != NEVER:
        friction = estimate.friction_force
        if estimate.state == FrictionState.SLIDING:
            half = BAND_95 * estimate.coulomb_friction_std
            low, high = friction - half, friction + half
        if known.adaptation != OFF:
            scale, residual = estimate.adaptation_scale, estimate.residual
            spread = BAND_95 * estimate.adaptation_scale_std
    forces = (feedforward.force, known.force_limit, -known.force_limit) if feedforward else (None, None, None)
    error = tracking_error(held) if Position in new else None
    pressures = (pressure.chamber_a / BAR, pressure.chamber_b / BAR) if pressure else (None, None)
    learnt = (scale, scale - spread, scale + spread, residual)
    values = (measured if source in new else None, friction, low, high, *forces, error, *pressures, *learnt)
    return (round(time, 3), *map(finite, values), held.status, held.limited)


def finite(value: float | None, digits: int = 6) -> float | None:
    """A number with at most ``digits`` digits for a page; None instead of NaN and infinity."""
    if value is None or not math.isfinite(value):
        return None
    return float(f'{value:.{digits}g}')


def tracking_error(held: Held) -> float | None:
    """Reference less position [um] at the stamp of the position; None if their stamps are further apart than `PAIRED`.

    The newest reference and the newest position are some milliseconds apart, in which a fast rod moves by more than its
    error: the reference is taken along by its velocity.
    """
    position, reference = held.records.get(Position), held.records.get(ServoReference)
    if position is None or reference is None:
        return None
    apart = (position.stamp - reference.stamp) * 1e-9
    if not abs(apart) <= PAIRED:
        return None
    velocity = reference.velocity if math.isfinite(reference.velocity) else 0.0
    return float(reference.position + velocity * apart - position.position) / UM


def sample_of(known: Known, held: Held) -> tuple[float, ...]:
    """Newest estimate and its inputs as a row of `Samples`, its time [s] by its stamp; NaN for a missing input."""
    one, velocity, pressure = held.estimate, held.records.get(Velocity), held.records.get(Pressure)
    speed = velocity.velocity if velocity is not None and velocity.stamp == one.stamp else math.nan
    seen = math.nan
    if pressure is not None:
        chambers = pressure.chamber_a, pressure.chamber_b
        seen = sum(pressure_at_seal(CHAMBERS.index(name), *chambers) for name in known.chambers) / len(known.chambers)
    _, force = _force_sum(known, held)
    answers = (one.coulomb_friction, one.coulomb_friction_std, one.breakaway_force, one.friction_force)
    ends = (one.adaptation_scale, one.state, one.direction, one.status)
    return (one.stamp * 1e-9, speed, seen, math.nan if force is None else force, *answers, *ends)


def tracked_of(held: Held) -> tuple[float, ...]:
    """Newest estimate and motion as a row of a `TrackingFollower`; NaN for a missing input."""
    one, records = held.estimate, held.records
    kinds = ((Velocity, 'velocity'), (Position, 'position'), (ServoReference, 'position'), (FeedForward, 'force'))
    *motion, force = (getattr(records.get(kind), name, math.nan) for kind, name in kinds)
    return (one.stamp * 1e-9, *motion, one.state, force)


def measured_friction(known: Known, held: Held) -> tuple[type, float | None]:
    """Friction [N] that the measurements show: the force sum, which is the friction at even speed; and its record.

    Once adaptation has learnt a scale, inertia and offset are known while the rod slides: the friction is estimate plus
    residual. Before, the offset would hide what the law misses.
    """
    estimate = held.estimate
    has_learnt = known.adaptation != OFF and estimate.adaptation_scale != 1.0
    if has_learnt and estimate.state == FrictionState.SLIDING and estimate.residual != 0.0:
        return FrictionEstimate, estimate.friction_force + estimate.residual
    return _force_sum(known, held)


def _force_sum(known: Known, held: Held) -> tuple[type, float | None]:
    """Newest force sum [N], corrected as by the estimator, with the record that it is of."""
    force = held.records.get(Force)
    if force is None:
        return Force, None
    pressure = held.records.get(Pressure)
    if known.correction == NO_CORRECTION or pressure is None:
        return Force, float(force.force)
    return Force, float(corrected_force_sum(known.correction, force.force, pressure.chamber_a, pressure.chamber_b))


class Said(NamedTuple):
    """Worst status of the diagnostics of a node that concerns an actuator."""

    level: int  # of diagnostic_msgs/DiagnosticStatus: 0 OK, 1 WARN, 2 ERROR, 3 STALE
    message: str


WARN = 1
INACTIVE = 'inactive'
"""message of a node that is not to estimate"""
NOTHING_SAID = Said(0, '')


class Bits(NamedTuple):
    """Bits of all answers of the last `RECENT` seconds."""

    status: int = 0
    limited: int = 0


def recent_bits(rows: Iterable[Row], until: float) -> Bits:
    """Bits of the rows of the last `RECENT` seconds before ``until`` [s]; ``rows`` from the newest on."""
    recent = list(takewhile(lambda one: one[0] > until - RECENT, rows))
    status, limited = (reduce(or_, (one[place] for one in recent), 0) for place in (-2, -1))
    return Bits(status, limited)


class Presence(NamedTuple):
    """Whether a node is there."""

    heard: int = 0  # [ns] when anything came from it
    has_left: bool = False  # the graph

    def is_gone(self, now: int) -> bool:
        """Whether it has left the graph, or nothing came for `GONE`."""
        return self.has_left or self.silence(now) > GONE

    def silence(self, now: int) -> float:
        """Time since anything came from it [s]."""
        return (now - self.heard) * 1e-9


def situation(
    known: Known,
    held: Held,
    bits: Bits,
    now: int,
    said: Said = NOTHING_SAID,
    presence: Presence | None = None,
    findings: Sequence[Finding] = (),
) -> dict[str, Any]:
    """The situation in words and numbers at ``now`` [ns] on the clock of receipt, ready for JSON.

    ``said`` is what the diagnostics of the node say of the actuator; in a bag nothing is known of its ``presence``;
    ``findings`` are on the run so far.
    """
    estimate, feedforward = held.estimate, held.records.get(FeedForward)
    cause, why = _cause(held, now, said, presence)
    present = [Finding(BAD, why, 'bring it back')] if cause else list(_present(held, bits.status, now, said))
    seals = [PLACEHOLDER] if known.has_placeholder else []
    decides = deciding([*present, *findings, *seals, _ESTIMATING])
    frame = getattr(held.records.get(Velocity), 'frame_id', b'')
    std = max(estimate.friction_force_std, 0.0) or estimate.coulomb_friction_std  # an older bag has one for both
    return {
        'verdict': decides.level,
        'reason': decides.text,
        'next': decides.next,
        'cause': cause,
        'state': STATE_WORDS.get((FrictionState(estimate.state), estimate.direction), 'unknown'),
        'faults': [why] if cause else _faults(bits.status),
        'friction': finite(estimate.friction_force),
        'coulomb': finite(estimate.coulomb_friction),
        'band': finite(BAND_95 * std),
        'measured': finite(measured_friction(known, held)[1]),
        'breakaway': finite(estimate.breakaway_force),
        'feedforward': None if feedforward is None else finite(feedforward.force),
        'lamps': {bit.name: bool(bits.limited & bit) for bit in Limited},
        'ages': {INPUT_NAMES[kind]: _age(held, kind, now) for kind in _listed(held)},
        'answer_age': _age(held, FrictionEstimate, now),
        'feedforward_age': _age(held, FeedForward, now),
        'error_age': _age(held, Position, now),
        'frame': frame.decode(errors='replace')[:_MOST_FRAME],
        'adaptation': known.adaptation,
        'adaptation_scale': finite(estimate.adaptation_scale),
        'adaptation_scale_std': finite(estimate.adaptation_scale_std),
        'residual': finite(estimate.residual),
        'offset': finite(estimate.adaptation_offset),
        'seals': list(known.seals),
        'range': [finite(known.pressure_low / BAR), finite(known.pressure_high / BAR)],
        'settings': {name: finite(getattr(known, name)) for name in ('scale', 'lead_time', 'force_limit')},
    }


def frame(
    label: str, time: float, rows: Sequence[Row], every: Mapping[str, dict[str, Any]], **more: Any
) -> dict[str, Any]:
    """What a page gets at a time [s]: rows of the actuator ``label``, and of ``every`` actuator what its tab shows."""
    tabs = [{'label': name} | {key: one[key] for key in ('verdict', 'feedforward')} for name, one in every.items()]
    return {'label': label, 'time': round(time, 3), 'rows': rows, 'now': every[label], 'actuators': tabs, **more}


def _listed(held: Held) -> list[type]:
    """Kinds of inputs that came, and those that have to."""
    return [kind for kind in INPUT_NAMES if kind in held.records or kind in NEEDED]


def _silent(held: Held, now: int) -> dict[str, float | None]:
    """Name and age [s] of each input that is missing; a temperature may come seldom."""
    ages = {INPUT_NAMES[kind]: _age(held, kind, now) for kind in _listed(held) if kind is not Temperature}
    return {name: age for name, age in ages.items() if age is None or age > TOO_OLD}


def _faults(status: int) -> list[str]:
    usual = ' (usual at a reversal)'
    return [words + (usual if USUAL & bit else '') for bit, words in STATUS_WORDS.items() if status & bit]


def _age(held: Held, kind: type, now: int) -> float | None:
    """Time since the last record of a kind [s]; None if there was none."""
    received = held.receipts.get(kind)
    return None if received is None else round(max(now - received, 0) * 1e-9, 3)


def _cause(held: Held, now: int, said: Said, presence: Presence | None) -> tuple[str, str]:
    """Why there is no estimate: ``node`` or ``inputs`` that are gone, or only that there is no ``estimate``; in words.

    Both are empty while there is one. Inputs come by the node, too: it has to be heard after its last estimate, before
    they can be told to be gone.
    """
    age = _age(held, FrictionEstimate, now)
    if age is not None and age <= TOO_OLD:
        return '', ''
    since = 'no estimate yet' if age is None else f'no estimate for {age:.1f} s'
    if presence is not None and presence.is_gone(now):
        how = 'it has left the graph' if presence.has_left else f'nothing from it for {presence.silence(now):.1f} s'
        return 'node', f'the node is gone or stopped: {how}; what is shown is old'
    if said.message == INACTIVE:
        return 'estimate', f'{since}: the node is inactive'
    missing = _silent(held, now)
    is_heard = presence is None or age is None or (presence.heard - held.receipts[FrictionEstimate]) * 1e-9 > TOO_OLD
    if missing and is_heard:
        there = '' if presence is None else '; the node is there'
        return 'inputs', f'{since}: no {", no ".join(missing)}{there}'
    return 'estimate', since + ('' if age is None else ': what is shown is old')


_ESTIMATING = Finding('good', 'estimating, no fault', 'nothing')


def _present(held: Held, status: int, now: int, said: Said) -> Iterator[Finding]:
    """What is not good at this moment, while there is an estimate."""
    if said.level >= WARN:
        yield Finding(BAD if said.level > WARN else LOOK, f'the node says: {said.message}', 'see the diagnostics')
    serious = serious_words(status)
    if serious:
        more = f', and {len(serious) - 1} more' if serious[1:] else ''
        yield Finding(LOOK, f'now: {serious[0]}{more}', 'see the faults')
    if old := [f'{name} for {age:.1f} s' for name, age in _silent(held, now).items() if age is not None]:
        yield Finding(LOOK, f'no {", no ".join(old)}', 'see what publishes it')
