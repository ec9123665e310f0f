"""Late is a fault like any other: no force from late inputs, by a clock that differs, or while time stands still."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import pytest
from harness.answers import NOTHING, Answer, receive_one
from harness.compensation import SCALE, compensating
from hypothesis import given, settings
from hypothesis import strategies as st

from seal_friction_ros.core.estimation.feedforward import newest_force
from seal_friction_ros.core.estimation.pipeline import (
    TICK_INTERVAL,
    PipelineParameters,
    PipelineState,
    acting_since,
    answered,
    init,
    is_tick_due,
)
from seal_friction_ros.core.messages.records import (
    NEVER,
    Clock,
    Force,
    Pressure,
    ServoReference,
    Status,
    Velocity,
    WatchdogTick,
)

MS = 1_000_000  # [ns]
NO_SLEW = {'slew_limit': 1e9}
"""The force turns with the wanted velocity at once, so its sign can be required at every moment."""
PARAMETERS = compensating(**NO_SLEW).parameters()
SETTINGS = PARAMETERS.feedforward
LONGEST = round(SETTINGS.lateness_max * 1e9)  # [ns]
WATCHDOG = 10 * MS  # [ns] between two ticks
TO_ZERO = round((SETTINGS.estimate_timeout + SETTINGS.fade_time) * 1e9) + WATCHDOG  # [ns] from the last input in time
NONE_LEFT = 1e-9  # [N]


class Taken(NamedTuple):
    """A message as a node takes it."""

    message: Any
    sent: int  # [ns]
    received: int  # [ns]

    @property
    def is_late(self) -> bool:
        """Whether it may not act."""
        return abs(self.received - self.sent) > LONGEST


class Made(NamedTuple):
    """A feed-forward, and what made it."""

    moment: int  # [ns]
    force: float  # [N]
    by: Taken


class Player:
    """Takes messages as a node does, with its watchdog."""

    def __init__(self, parameters: PipelineParameters = PARAMETERS, state: PipelineState | None = None) -> None:
        self.parameters, self.state = parameters, state or init(parameters)
        self.made: list[Made] = []
        self.statuses: list[tuple[Taken, Status]] = []
        last = self.state.feedforward.received
        self._next_look = 0 if last == NEVER else last

    def play(self, messages: Iterable[Taken]) -> 'Player':
        """Take messages in order of their receipt."""
        for one in messages:
            self.wait_until(one.received)
            self._take(one)
        return self

    def stop_until(self, moment: int) -> 'Player':
        """Let a stopped process, with its watchdog, go on at a moment [ns]."""
        self._next_look = moment
        return self

    def wait_until(self, moment: int) -> None:
        """Let the watchdog look until a moment [ns]."""
        while self._next_look < moment:
            if is_tick_due(self.state, self._next_look):
                self._take(Taken(WatchdogTick(self._next_look, 0.01), self._next_look, self._next_look))
            self._next_look += WATCHDOG

    def _take(self, one: Taken) -> None:
        answer: Answer = NOTHING
        self.state, answer = receive_one(self.parameters, self.state, one.message, one.received, one.sent)
        if answer.estimate:
            self.statuses.append((one, Status(answer.estimate.status)))
        if answer.feedforward:
            self.made.append(Made(one.received, answer.feedforward.force, one))

    def forces(self, first: int, end: int = 1 << 62) -> list[float]:
        """Forces [N] from a moment on, to before another."""
        return [made.force for made in self.made if first <= made.moment < end]


def moment(at: int, speed: float = 0.05, *, late: int = 0, acceleration: float = 0.0) -> Iterator[Taken]:
    """The messages that were sent at a moment [ns], in the order a servo sends them, and come ``late`` [ns].

    The force sum is the friction, so it turns with the rod.
    """
    for message in (
        Pressure(at, 3e6, 3e6),
        Force(at, math.copysign(40.0, speed)),
        ServoReference(at, 0.0, speed, acceleration),
        Velocity(at, speed, b'rod'),
    ):
        yield Taken(message, at, at + late)


def moments(first: int, end: int, speed: float = 0.05, *, late: int = 0, step: int = 2) -> list[Taken]:
    """A moment every ``step``, from ``first`` to before ``end``; all in [ms]."""
    return [one for ms in range(first, end, step) for one in moment(ms * MS, speed, late=late * MS)]


STARTED = Player().play(moments(0, 600))
FULL = STARTED.made[-1].force  # [N]


def started(**kinds: Any) -> Player:
    """After 0.6 s in time: the force is there. The last input was sent at 598 ms."""
    return Player(state=STARTED.state, **kinds)


def test_in_time_the_force_is_there():
    assert SCALE * 39.0 < FULL < SCALE * 42.0
    assert {status for one, status in STARTED.statuses if one.received > 300 * MS} == {Status(0)}
    player = started().play(moments(600, 1000, late=27))  # and 2 ms to the next ones
    assert min(player.forces(630 * MS)) == pytest.approx(FULL)
    assert not any(status & Status.LATE_INPUT for _, status in player.statuses)


@pytest.mark.parametrize('late', [31, 60, 190, 316, 5000])
@pytest.mark.parametrize('length', [300, 3000])
def test_a_backlog_brings_the_force_to_0_whatever_its_length(late: int, length: int):
    """A standing delay of 190 to 316 ms held the whole force, and made tracking worse than without it."""
    player = started()
    player.play(moments(600, 600 + length, late=late))
    player.wait_until(1500 * MS)
    after = [abs(force) for force in player.forces(598 * MS + TO_ZERO)]
    assert after
    assert max(after) < NONE_LEFT
    late_ones = [status for one, status in player.statuses if one.is_late]
    assert len(late_ones) == length // 2
    assert all(status & Status.LATE_INPUT for status in late_ones)


@pytest.mark.parametrize('kind', [Pressure, Force, ServoReference, Velocity])
def test_one_late_input_among_inputs_in_time_is_enough(kind: type):
    for late, stays in ((0, True), (200 * MS, False)):
        messages = [
            one._replace(sent=one.sent - late) if isinstance(one.message, kind) else one for one in moments(600, 1000)
        ]
        forces = started().play(messages).forces(598 * MS + TO_ZERO)
        assert (min(forces) == pytest.approx(FULL)) is stays
        assert (max(map(abs, forces)) < NONE_LEFT) is not stays


@pytest.mark.parametrize('late', [60, 400])
def test_a_reference_that_turns_back_late_is_never_pushed_against(late: int):
    """It makes no force, but it is the newest that is known of what is wanted."""
    messages = moments(600, 640) + moments(640, 1400, -0.05)
    references = [
        one._replace(sent=one.sent - late * MS) if isinstance(one.message, ServoReference) else one for one in messages
    ]
    player = started().play(references)
    assert all(made.force >= 0.0 for made in player.made if made.moment < 640 * MS)
    assert all(made.force <= 0.0 for made in player.made if made.moment >= 640 * MS)
    assert max(map(abs, player.forces(598 * MS + TO_ZERO))) < NONE_LEFT


def test_late_inputs_make_estimates_for_their_stamps():
    late = started().play(moments(600, 640, late=200))
    in_time = started().play(moments(600, 640))
    assert len(late.statuses) == len(in_time.statuses) == 20
    assert {status & ~Status.LATE_INPUT for _, status in late.statuses} == {Status(0)}


@pytest.mark.parametrize(('early', 'acts'), [(1, True), (29, True), (31, False), (3_600_000, False)])
def test_a_message_that_was_sent_after_its_receipt_is_of_another_clock(early: int, acts: bool):
    player = Player().play(one._replace(sent=one.sent + early * MS) for one in moments(0, 600))
    assert max((made.force for made in player.made), default=0.0) == (pytest.approx(FULL) if acts else 0.0)
    assert all(bool(status & Status.LATE_INPUT) is not acts for _, status in player.statuses)


def test_a_sender_that_is_ahead_makes_no_input_younger():
    """Its inputs count from their receipt, so they fade like others when they stop."""
    ahead = [one._replace(sent=one.sent + 29 * MS) for one in moments(600, 700)]
    player = started().play(ahead)
    player.wait_until(1200 * MS)
    assert player.made[-1].force == 0.0
    assert player.made[-1].moment <= 698 * MS + TO_ZERO


@pytest.mark.parametrize(
    ('received', 'sent', 'since'),
    [
        (100 * MS, 100 * MS, 100 * MS),
        (100 * MS, 99 * MS, 99 * MS),
        (100 * MS, 71 * MS, 71 * MS),
        (100 * MS, 69 * MS, NEVER),
        (100 * MS, 101 * MS, 100 * MS),
        (100 * MS, 129 * MS, 100 * MS),
        (100 * MS, 131 * MS, NEVER),
        (100 * MS, -(1 << 60), NEVER),
    ],
)
def test_an_input_is_as_old_as_its_sending(received: int, sent: int, since: int):
    assert acting_since(SETTINGS, received, sent) == since
    assert acting_since(replace(SETTINGS, lateness_max=0.0), received, sent) == received


def test_without_a_limit_the_time_of_sending_changes_nothing():
    """As in bags from before there was one."""
    parameters = compensating(lateness_max=0.0, **NO_SLEW).parameters()
    state = init(parameters)
    for number, one in enumerate(moments(0, 400)):
        sent = one.sent - number * 7 * MS
        expected = answered(parameters, state, one.message, one.received)
        found = answered(parameters, state, one.message, one.received, sent)
        assert found == expected
        state, _ = found
    assert state.feedforward.force == pytest.approx(FULL)


def test_late_velocities_make_a_feed_forward_as_often_as_the_watchdog():
    """A backlog that is taken in one go would else send hundreds of forces that nobody needs."""
    backlog = [one._replace(received=900 * MS + number * 10_000) for number, one in enumerate(moments(600, 800))]
    player = started().play(backlog)
    assert [made.force for made in player.made if made.by.is_late] == [0.0]
    slow = [one._replace(received=900 * MS + number * MS // 4) for number, one in enumerate(moments(600, 800))]
    player = started().play(slow)
    made = [made.moment for made in player.made if made.moment >= 900 * MS]
    assert 10 <= len(made) <= 12
    assert min(b - a for a, b in pairwise(made)) >= TICK_INTERVAL


QUEUE = 100  # moments that wait in the middleware at most


@pytest.mark.parametrize('gap', [200, 1000, 5000])
@pytest.mark.parametrize('turns', [False, True])
def test_after_a_stopped_process_goes_on_there_is_no_force_from_what_waited(gap: int, turns: bool):
    """After SIGSTOP and SIGCONT 13 N were sent for 251 ms out of samples 3 s old, the machine off meanwhile."""
    speed = -0.05 if turns else 0.05
    goes_on = 600 + gap  # [ms]
    waited = moments(600, goes_on, speed)[-4 * QUEUE :]
    backlog = [one._replace(received=goes_on * MS + number * 50_000) for number, one in enumerate(waited)]
    player = Player(state=STARTED.state)
    player.stop_until(goes_on * MS).play(backlog)
    assert sum(one.is_late for one in backlog) > 100
    assert {made.force for made in player.made if made.by.is_late} <= {0.0}
    player.play(moments(goes_on + 22, goes_on + 400, speed))
    assert all(made.force * speed >= 0.0 for made in player.made)
    assert player.made[-1].force == pytest.approx(math.copysign(FULL, speed))
    back = next(made.moment for made in player.made if abs(made.force) > 0.99 * FULL)
    assert back <= (goes_on + 22) * MS + TO_ZERO


@pytest.mark.parametrize('gap', [1000, 5000])
def test_a_machine_that_went_off_while_the_process_was_stopped_gets_no_force(gap: int):
    waited = moments(600, 800)
    backlog = [one._replace(received=(600 + gap) * MS + number * 50_000) for number, one in enumerate(waited)]
    player = Player(state=STARTED.state)
    player.stop_until((600 + gap) * MS).play(backlog)
    player.wait_until((1000 + gap) * MS)
    assert {made.force for made in player.made} == {0.0}


# --- the reference ---

IMPOSSIBLE = [
    (1e300, 0.0), (-1e300, 0.0), (10.1, 0.0), (math.inf, 0.0), (-math.inf, 0.0), (math.nan, 0.0),
    (0.05, 1e300), (0.05, -1e300), (0.05, 1001.0), (0.05, math.inf), (0.05, -math.inf), (1e300, 1e300),
]  # fmt: skip


@pytest.mark.parametrize(('velocity', 'acceleration'), IMPOSSIBLE)
def test_a_reference_that_no_rod_can_follow_is_none(velocity: float, acceleration: float):
    """1e300 m/s or 1e300 m/s2 made 36 N with status 0 and nothing limited."""
    spoilt = [
        one._replace(message=one.message._replace(velocity=velocity, acceleration=acceleration))
        if isinstance(one.message, ServoReference)
        else one
        for one in moments(600, 1000)
    ]
    player = started().play(spoilt)
    assert max(map(abs, player.forces(598 * MS + TO_ZERO))) < NONE_LEFT
    assert player.state.reference == STARTED.state.reference
    player.play(moments(1000, 1400))
    assert player.made[-1].force == pytest.approx(FULL)


def test_from_the_start_it_makes_no_force_at_all():
    never = [
        one._replace(message=one.message._replace(acceleration=1e300))
        if isinstance(one.message, ServoReference)
        else one
        for one in moments(0, 600)
    ]
    assert not any(made.force for made in Player().play(never).made)


def test_an_acceleration_that_is_not_known_is_no_reason():
    unknown = [
        one._replace(message=one.message._replace(acceleration=math.nan))
        if isinstance(one.message, ServoReference)
        else one
        for one in moments(0, 600)
    ]
    assert Player().play(unknown).made[-1].force == pytest.approx(FULL)


# --- simulated time ---


def with_clock(messages: Iterable[Taken], show: Any = lambda at: at) -> Iterator[Taken]:
    """The messages, with simulated time that shows ``show(at)`` [ns] at each moment, before its other messages."""
    last = None
    for one in messages:
        if one.received != last:
            last = one.received
            yield Taken(Clock(show(last)), last, last)
        yield one


SIMULATED = Player().play(with_clock(moments(0, 600)))


def standing(messages: list[Taken], how: str) -> Iterable[Taken]:
    """The messages while ``/clock`` says nothing, repeats itself, or comes late."""
    if how == 'stops':
        return messages
    if how == 'repeats':
        return with_clock(messages, lambda _: 598 * MS)
    return (one._replace(sent=one.sent - 60 * MS * isinstance(one.message, Clock)) for one in with_clock(messages))


def test_while_simulated_time_goes_on_the_force_is_there():
    assert SIMULATED.made[-1].force == pytest.approx(FULL)
    assert SIMULATED.statuses[-1][1] == Status(0)


@pytest.mark.parametrize('how', ['stops', 'repeats', 'late'])
@pytest.mark.parametrize('reverses_at', [None, 600, 620, 700])
def test_simulated_time_that_stands_still_fades_the_force_while_inputs_go_on(how: str, reverses_at: int | None):
    """36 N stayed for as long as one looked, also against the wanted velocity."""
    turn = reverses_at or 1600
    player = Player(state=SIMULATED.state)
    player.play(standing(moments(600, turn) + moments(turn, 1600, -0.05), how))
    for made in player.made:
        assert made.force * (0.05 if made.moment < turn * MS else -0.05) >= 0.0
    assert max(map(abs, player.forces(598 * MS + TO_ZERO))) < NONE_LEFT
    marked = {bool(status & Status.LATE_INPUT) for one, status in player.statuses if one.received > 628 * MS}
    assert marked == {True}
    assert not any(status & Status.LATE_INPUT for one, status in player.statuses if one.received < 628 * MS)
    side = 0.05 if reverses_at is None else -0.05
    player.play(with_clock(moments(1600, 2000, side)))
    assert player.made[-1].force == pytest.approx(math.copysign(FULL, side))
    assert player.statuses[-1][1] == Status(0)


def test_simulated_time_that_stands_still_with_all_stamps_fades_the_force():
    """As drivers on simulated time do: their stamps stand still with it."""
    frozen = [one._replace(message=one.message._replace(stamp=598 * MS)) for one in moments(600, 1000)]
    player = Player(state=SIMULATED.state).play(frozen)
    assert max(map(abs, player.forces(598 * MS + TO_ZERO))) < NONE_LEFT


@pytest.mark.parametrize('shown', [None, 0])
def test_before_simulated_time_comes_there_is_no_force(shown: int | None):
    """A node with ``use_sim_time`` begins at time 0; a simulator that has not started may send 0, too."""
    player = Player(state=replace(init(PARAMETERS), clock=0))
    messages = moments(0, 600)
    player.play(messages if shown is None else with_clock(messages, lambda _: shown))
    assert not any(made.force for made in player.made)
    assert all(status & Status.LATE_INPUT for _, status in player.statuses)
    player.play(with_clock(moments(600, 1000)))
    assert player.made[-1].force == pytest.approx(FULL)


def test_simulated_time_that_is_reset_goes_on():
    back = [one._replace(message=one.message._replace(stamp=one.sent - 600 * MS)) for one in moments(600, 1000)]
    player = Player(state=SIMULATED.state).play(with_clock(back, lambda at: at - 600 * MS))
    assert min(player.forces(600 * MS)) == pytest.approx(FULL)


def test_simulated_time_at_another_pace_makes_the_same_force():
    """Ages count on the clock of the machine, the stamps on the simulated one, here at half its pace."""
    slow = [one._replace(message=one.message._replace(stamp=one.sent // 2)) for one in moments(0, 1000)]
    player = Player().play(with_clock(slow, lambda at: at // 2))
    assert player.made[-1].force == pytest.approx(FULL)


# --- anything ---

delays = st.lists(
    st.tuples(st.integers(1, 60), st.sampled_from([0, 0, 0, 1, 20, 29, 31, 90, 400, -1, -31])), min_size=1, max_size=8
)
"""How many moments come how late [ms], in turn; negative: the clock of the sender is ahead."""


def on_a_line(kind: type, messages: list[Taken], plan: list[tuple[int, int]]) -> list[Taken]:
    """The messages of one kind with delays by plan; a topic keeps the order of its messages."""
    late = [delay for count, delay in plan for _ in range(count)]
    mine = [one for one in messages if isinstance(one.message, kind)]
    found = []
    for number, one in enumerate(mine):
        delay = late[number % len(late)] * MS
        found.append(one._replace(sent=one.sent - min(delay, 0), received=one.received + max(delay, 0)))
    receipts = accumulate((one.received for one in found), max)
    return [one._replace(received=received) for one, received in zip(found, receipts, strict=True)]


@settings(max_examples=60)
@given(st.tuples(*[delays] * 4), st.floats(0.01, 0.3), st.floats(0.2, 3.0), st.floats(-0.5, 0.5))
def test_any_mixture_of_late_and_timely_inputs_never_pushes_against_the_motion_nor_after_it(
    plans, speed, frequency, share
):
    sent = []
    for ms in range(600, 1200, 3):
        wanted = speed * (math.sin(6.28 * frequency * ms * 1e-3) + share)
        sent += moment(ms * MS, wanted)
    kinds = (Pressure, Force, ServoReference, Velocity)
    lines = [one for kind, plan in zip(kinds, plans, strict=True) for one in on_a_line(kind, sent, plan)]
    lines.sort(key=lambda one: one.received)
    player, wanted = Player(state=STARTED.state), 0.05
    newest = dict.fromkeys(kinds, 598 * MS)  # [ns] when the last input that may act was sent

    def assert_safe() -> None:
        for made in player.made:
            assert made.force * wanted >= 0.0
            assert made.moment <= min(newest.values()) + TO_ZERO or abs(made.force) < NONE_LEFT
        player.made.clear()

    for one in lines:
        player.wait_until(one.received)
        assert_safe()
        player.play([one])
        if not one.is_late:
            newest[type(one.message)] = min(one.sent, one.received)
        if isinstance(one.message, ServoReference):
            wanted = one.message.velocity
        assert_safe()
    player.wait_until(lines[-1].received + 400 * MS)
    assert_safe()
    assert newest_force(player.state.feedforward) == 0.0
