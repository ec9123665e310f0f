"""The faults of a signal, one row each: what is sent, and the requirements for estimate, feed-forward and diagnostics.

``faults.py`` tries them on the live node; docs/degradation.md lists them.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import Force, Pressure, ServoReference, Velocity

MS = 1_000_000  # [ns] between two ticks: 1 kHz
TIMEOUT = 0.02  # [s] of pressure, force sum, estimate and reference
FADE_TIME = 0.04  # [s]
SLEW_LIMIT = 3e4  # [N/s]
BEFORE, FAULT, AFTER = 160, 80, 60  # ticks until the force is there, with the fault until it has faded, and after it
SPEED, PRESSURE, FORCE = 0.05, 3e6, 60.0  # [m/s], [Pa], [N]

Message = Pressure | Force | ServoReference | Velocity | bytes
Tick = dict[str, list[Message]]
"""Messages of one moment: topic -> messages, the velocity last."""


def good(stamp: int) -> Tick:
    """The messages of a moment without fault; ``stamp`` in [ns]."""
    return {
        'cylinder_pressure': [Pressure(stamp, PRESSURE, PRESSURE)],
        'force_sum': [Force(stamp, FORCE)],
        'servo_reference': [ServoReference(stamp, 0.0, SPEED, 0.0)],
        'rod_velocity': [Velocity(stamp, SPEED, b'')],
    }


@dataclass(frozen=True)
class Row:
    """One fault and its requirements."""

    fault: str
    spoil: Callable[[Tick, int], Tick]
    """changes a tick, given the number of ticks since the fault began"""
    status: str = ''
    """exactly the bits that are set during the fault"""
    state: tuple[FrictionState, ...] = (FrictionState.SLIDING,)
    """exactly the states that are published during the fault"""
    feedforward: str = 'as usual'
    """``as usual``, ``fades`` (to 0 within the fade time) or ``dips`` (by less than a third)"""
    level: str = 'WARN'
    """level of the diagnostics"""
    estimate: str = ''
    """requirement as text, for the documentation"""


def without(topic: str) -> Callable[[Tick, int], Tick]:
    """No message on a topic."""
    return lambda tick, _: {**tick, topic: []}


def with_value(topic: str, *values: float) -> Callable[[Tick, int], Tick]:
    """Other values on all ticks."""
    return lambda tick, _: {**tick, topic: [_changed(tick[topic][0], *values)]}


def spike(topic: str, *values: float) -> Callable[[Tick, int], Tick]:
    """Other values on each tenth tick."""
    return lambda tick, n: {**tick, topic: [_changed(tick[topic][0], *values)]} if n % 10 == 5 else tick


def _changed(message: Message, *values: float) -> Message:
    if isinstance(message, Velocity):
        return message._replace(velocity=values[0])
    if isinstance(message, ServoReference):
        return message._replace(velocity=values[0])
    if isinstance(message, Force):
        return message._replace(force=values[0])
    return Pressure(message.stamp, values[0], values[-1])


def delayed(topic: str, delay: int) -> Callable[[Tick, int], Tick]:
    """Stamps of one topic, or of ``all``, shifted by ``delay`` [ns]."""

    def spoil(tick: Tick, _: int) -> Tick:
        """Shift the stamps."""
        return {
            name: [m._replace(stamp=m.stamp + delay) for m in messages] if topic in (name, 'all') else messages
            for name, messages in tick.items()
        }

    return spoil


def frozen(topic: str) -> Callable[[Tick, int], Tick]:
    """The same message again and again."""
    return lambda tick, n: {**tick, topic: [m._replace(stamp=m.stamp - (n + 1) * MS) for m in tick[topic]]}


def doubled(topic: str) -> Callable[[Tick, int], Tick]:
    """Each message twice."""
    return lambda tick, _: {**tick, topic: tick[topic] * 2}


def swapped(topic: str) -> Callable[[Tick, int], Tick]:
    """Pairs of messages in the wrong order."""
    return lambda tick, n: {
        **tick,
        topic: [m._replace(stamp=m.stamp + (MS if n % 2 == 0 else -MS)) for m in tick[topic]],
    }


def alternating(topic: str) -> Callable[[Tick, int], Tick]:
    """Every second stamp 5 ms ahead."""
    return lambda tick, n: {**tick, topic: [m._replace(stamp=m.stamp + 5 * MS * (n % 2)) for m in tick[topic]]}


def ahead_once(topic: str) -> Callable[[Tick, int], Tick]:
    """The first stamp 15 ms ahead."""
    return lambda tick, n: delayed(topic, 15 * MS)(tick, n) if n == 0 else tick


def garbage(topic: str) -> Callable[[Tick, int], Tick]:
    """Bytes that are no message, before each good one."""
    return lambda tick, n: {**tick, topic: [bytes(range(n % 40)), *tick[topic]]}


def everything(tick: Tick, n: int) -> Tick:
    """All topics at once."""
    bad = (math.nan, -math.inf, 1e308)[n % 3]
    spoilt = tick
    for topic in tick:
        spoilt = with_value(topic, bad)(spoilt, n)
    return spoilt


UNKNOWN = (FrictionState.UNKNOWN,)
BOTH = (FrictionState.UNKNOWN, FrictionState.SLIDING)
LAST = 'with the last valid {}'


def _unusable() -> Iterator[Row]:
    """NaN, infinite and out of range for each input, on all ticks."""
    for words, value in (('NaN', math.nan), ('infinite', math.inf), ('-infinite', -math.inf), ('1e300', 1e300)):
        bit = 'OUT_OF_RANGE' if math.isfinite(value) else 'NOT_FINITE'
        yield Row(
            f'pressure {words}',
            with_value('cylinder_pressure', PRESSURE, value),
            f'PRESSURE_{bit} PRESSURE_STALE',
            feedforward='fades',
            estimate=LAST.format('pressure'),
        )
        yield Row(
            f'force sum {words}',
            with_value('force_sum', value),
            f'FORCE_{bit} FORCE_STALE',
            feedforward='fades',
            estimate='as usual while sliding',
        )
        yield Row(
            f'velocity {words}',
            with_value('rod_velocity', value),
            f'VELOCITY_{bit}',
            UNKNOWN,
            feedforward='fades',
            estimate='UNKNOWN, Coulomb friction as usual',
        )
        yield Row(
            f'reference {words}',
            with_value('servo_reference', value),
            feedforward='fades',
            estimate='as usual',
        )


def _spikes() -> Iterator[Row]:
    """One sample in ten far off, but inside its range."""
    yield Row(
        'pressure spikes',
        spike('cylinder_pressure', 2e7),
        'PRESSURE_LEAP',
        feedforward='dips',
        estimate=LAST.format('pressure'),
    )
    yield Row('force sum spikes', spike('force_sum', -4e5), 'FORCE_LEAP', estimate=LAST.format('force sum'))
    yield Row('velocity spikes', spike('rod_velocity', -5.0), 'VELOCITY_LEAP', BOTH, estimate='UNKNOWN for that sample')


SIGNAL_ROWS: tuple[Row, ...] = (
    Row(
        'pressure stops',
        without('cylinder_pressure'),
        'PRESSURE_STALE',
        feedforward='fades',
        estimate=LAST.format('pressure'),
    ),
    Row(
        'force sum stops',
        without('force_sum'),
        'FORCE_STALE',
        feedforward='fades',
        estimate='as usual while sliding',
    ),
    Row(
        'force sum stops, the rod rests',
        lambda tick, n: {**with_value('rod_velocity', 0.0)(tick, n), 'force_sum': []},
        'FORCE_STALE',
        (FrictionState.BREAKAWAY, FrictionState.UNKNOWN),
        feedforward='fades',
        estimate='UNKNOWN once stale, Coulomb friction as usual',
    ),
    Row(
        'velocity stops',
        without('rod_velocity'),
        state=(),
        feedforward='fades',
        level='STALE',
        estimate='none',
    ),
    Row('reference stops', without('servo_reference'), feedforward='fades', estimate='as usual'),
    Row(
        'everything stops',
        lambda tick, _: {name: [] for name in tick},
        state=(),
        feedforward='fades',
        level='STALE',
        estimate='none',
    ),
    Row(
        'pressure frozen, its stamp too',
        frozen('cylinder_pressure'),
        'PRESSURE_STALE',
        feedforward='fades',
        estimate=LAST.format('pressure'),
    ),
    Row(
        'pressure frozen with new stamps',
        with_value('cylinder_pressure', PRESSURE),
        level='OK',
        estimate='as usual',
    ),
    Row(
        'pressure jumps to another level',
        with_value('cylinder_pressure', 1.5e7),
        'PRESSURE_LEAP OUTSIDE_IDENTIFIED_RANGE MODEL_DISAGREES',
        feedforward='dips',
        estimate='one sample with the old pressure, then with the new one; a jump back likewise',
    ),
    *_unusable(),
    *_spikes(),
    Row(
        'denormal pressure',
        with_value('cylinder_pressure', 5e-324),
        'MODEL_DISAGREES',
        estimate='as usual',
    ),
    Row(
        'everything at once: NaN, infinite, 1e308', everything, 'any', UNKNOWN, feedforward='fades', estimate='UNKNOWN'
    ),
    Row(
        'velocity duplicated',
        doubled('rod_velocity'),
        'STAMP_NOT_INCREASING',
        estimate='one for each, the second marked',
    ),
    Row('pressure duplicated', doubled('cylinder_pressure'), level='OK', estimate='as usual'),
    Row('velocity out of order', swapped('rod_velocity'), 'STAMP_NOT_INCREASING', estimate='as usual, marked'),
    Row('pressure out of order', swapped('cylinder_pressure'), level='OK', estimate='with the last one received'),
    Row(
        'pressure stamped 1 s in the past',
        delayed('cylinder_pressure', -1000 * MS),
        'PRESSURE_STALE',
        feedforward='fades',
        estimate='with that pressure, marked',
    ),
    Row(
        'pressure stamped 1 s in the future',
        delayed('cylinder_pressure', 1000 * MS),
        'PRESSURE_STALE',
        feedforward='fades',
        estimate='with that pressure, marked',
    ),
    Row(
        'velocity stamped 0.5 s in the past',
        delayed('rod_velocity', -500 * MS),
        'PRESSURE_STALE FORCE_STALE STAMP_NOT_INCREASING',
        feedforward='fades',
        estimate='with the last valid inputs, marked',
    ),
    Row(
        'velocity stamped 0.5 s in the future',
        delayed('rod_velocity', 500 * MS),
        'PRESSURE_STALE FORCE_STALE',
        feedforward='fades',
        estimate='with the last valid inputs, marked',
    ),
    Row(
        'all stamps jump back by 5 s',
        delayed('all', -5000 * MS),
        'STAMP_NOT_INCREASING STAMP_AGE',
        feedforward='fades',
        estimate='as usual, marked',
    ),
    Row(
        'all stamps jump ahead by 5 s',
        delayed('all', 5000 * MS),
        'STAMP_AGE',
        feedforward='fades',
        estimate='as usual, marked',
    ),
    Row(
        'velocity frozen, its stamp too',
        frozen('rod_velocity'),
        'PRESSURE_STALE FORCE_STALE STAMP_NOT_INCREASING',
        feedforward='fades',
        estimate='with the last valid inputs, marked',
    ),
    Row(
        'force sum frozen, its stamp too',
        frozen('force_sum'),
        'FORCE_STALE',
        feedforward='fades',
        estimate='as usual while sliding',
    ),
    Row('reference frozen, its stamp too', frozen('servo_reference'), feedforward='fades', estimate='as usual'),
    Row(
        'velocity stamps alternate by 5 ms',
        alternating('rod_velocity'),
        'STAMP_NOT_INCREASING',
        estimate='as usual, marked',
    ),
    Row(
        'velocity stamp 15 ms ahead once',
        ahead_once('rod_velocity'),
        'STAMP_NOT_INCREASING',
        estimate='as usual, marked',
    ),
    Row('reference stamps alternate by 5 ms', alternating('servo_reference'), level='OK', estimate='as usual'),
    Row('reference stamp 15 ms ahead once', ahead_once('servo_reference'), level='OK', estimate='as usual'),
    Row('bytes that are no message', garbage('cylinder_pressure'), estimate='as usual; WARN: counted and logged'),
)
