"""The path of every message: what comes in, what is kept of it, what goes out. The same for the node and for replay.

``state = init(parameters)``, then ``receive(parameters, state, message, received, emit)`` for every message, in order
of receipt. The node passes a function that publishes, replay one that collects. The state of an actuator is one mutable
record of small immutable ones; each stage takes and returns its own. Who may have to go back has `PipelineState.kept`.

A velocity sample makes an estimate with the newest pressure and force sum, and, once there has been a reference, a
feed-forward. The estimate is emitted before anything is learnt from its sample, and before the feed-forward is
computed. While no velocity sample comes, the ticks of the watchdog make the feed-forward, so that it fades out.

``received`` is the time of receipt, which a bag holds as log time, on a clock that never jumps nor stands still, also
with simulated time. `PipelineState.clock_offset` leads from it to the clock of the stamps. ``sent`` is when the
publisher sent the message, on the same clock; a bag holds it as publish time. How old an input is for the feed-forward
is counted from there, so that neither a backlog nor a stopped process makes it younger. An input that comes later than
``lateness_max`` does not count at all, nor does a message with the stamp of the one before. While only late velocities
come, the feed-forward is made as often as ticks make it, and fades.

With simulated time, `Clock` is an input like the others: while it stands still, the feed-forward fades.

Inputs with several publishers are refused, since nobody knows which publisher is right: they still make estimates, so
that everybody sees it, but the estimates are marked and the feed-forward fades out.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation import estimator
from seal_friction_ros.core.estimation.adaptation import AdaptationState, believed, bounded_friction
from seal_friction_ros.core.estimation.conditioned_velocity import (
    NOT_CONDITIONED,
    SETTLING,
    ConditionedVelocity,
    condition_velocity,
    confirmed_velocity,
)
from seal_friction_ros.core.estimation.estimator import (
    NO_VELOCITY,
    EstimatorParameters,
    EstimatorSettings,
    EstimatorState,
    estimate_at,
    learn_from,
    temperature_in_use,
)
from seal_friction_ros.core.estimation.feedforward import (
    FADED_IN,
    FADED_OUT,
    FeedForwardSettings,
    FeedForwardState,
    elastic_step,
    led_velocity,
    newest_force,
    usable,
    wanted_velocity,
)
from seal_friction_ros.core.estimation.records import NO_TEMPERATURE, RodSample, SealTemperature
from seal_friction_ros.core.foundation.compiled import compilable
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.foundation.units import ZEROS
from seal_friction_ros.core.friction.actuator import at_temperature, friction_of_seals
from seal_friction_ros.core.friction.temperature import COLDEST, HOTTEST
from seal_friction_ros.core.messages.coder import encode, type_of
from seal_friction_ros.core.messages.records import (
    NEVER,
    NO_FORCE,
    NO_PRESSURE,
    Clock,
    Force,
    Input,
    Output,
    Position,
    Pressure,
    ServoReference,
    Temperature,
    Velocity,
    WatchdogTick,
)

ACCELERATION_SMOOTHING = 4.0  # [-] of the time constant of the velocity; our choice
ZERO_CELSIUS = ZEROS['degC']  # [K]
LATEST = 1 << 61  # [ns] compiled code takes times up to here: their differences fit into 64 bits
TICK_INTERVAL = 9_000_000  # [ns] the watchdog acts if no feed-forward was made for this time

Emit = Callable[[Output, bytes], object]
"""Takes what goes out, and the frame name of the message that it answers."""


class PipelineParameters(NamedTuple):
    """Everything that is known beforehand."""

    estimator: EstimatorParameters
    feedforward: FeedForwardSettings


class Reference(NamedTuple):
    """What is kept of the references."""

    velocity: ConditionedVelocity
    acceleration: float  # [m/s^2] smoothed like the velocity
    last_acceleration: float  # [m/s^2] of the last reference, as given


NO_REFERENCE = Reference(NOT_CONDITIONED, 0.0, 0.0)


@dataclass(slots=True)
class ReceiptTimes:
    """When the last new sample of each input was sent that was in time [ns]; `NEVER` before the first."""

    velocity: int = NEVER
    pressure: int = NEVER
    force: int = NEVER
    reference: int = NEVER
    clock: int = NEVER  # simulated time


class Turn(NamedTuple):
    """The end of a stroke: the estimator before and after the sample with which it ended."""

    before: EstimatorState
    after: EstimatorState


@dataclass(slots=True)
class PipelineState:
    """What one message leaves for the next, the newest inputs among it."""

    estimator: EstimatorState
    feedforward: FeedForwardState = FADED_OUT
    friction: float = -1.0  # [N] of the newest usable estimate; negative: the newest is not usable
    pressure: Pressure = NO_PRESSURE
    force: Force = NO_FORCE
    reference: Reference = NO_REFERENCE
    receipt: ReceiptTimes = field(default_factory=ReceiptTimes)
    refused: bool = False  # whether no input may act: one has several publishers, or the node is stopping
    clock_offset: int = 0  # [ns] what the clock of the stamps shows after the clock of receipt
    temperature: SealTemperature = NO_TEMPERATURE
    clock: int = NEVER  # [ns] newest simulated time

    def kept(self) -> tuple[tuple[Any, ...], ...]:
        """All values, for `restore`."""
        return _VALUES(self), _ESTIMATOR(self.estimator), _TIMES(self.receipt)

    def restore(self, kept: tuple[tuple[Any, ...], ...]) -> None:
        """Go back to what was `kept`."""
        records: tuple[Any, ...] = self, self.estimator, self.receipt
        for record, values in zip(records, kept, strict=True):
            for one, value in zip(fields(record), values, strict=True):
                setattr(record, one.name, value)

    def copy(self) -> 'PipelineState':
        """The same state, which does not change with this one."""
        copied = PipelineState(*_VALUES(self))
        copied.estimator, copied.receipt = self.estimator.copy(), ReceiptTimes(*_TIMES(self.receipt))
        return copied

    def turn_since(self, last: AdaptationState) -> Turn | None:
        """The end of a stroke between what was ``last`` learnt and now, if the adaptation learns from it."""
        before, now = last.strokes, self.estimator.adaptation.strokes
        if now.present.direction == before.present.direction and now.reversals == before.reversals:
            return None
        return Turn(dataclasses.replace(self.estimator, adaptation=last), self.estimator)


_VALUES, _ESTIMATOR, _TIMES = (
    attrgetter(*(one.name for one in fields(kind))) for kind in (PipelineState, EstimatorState, ReceiptTimes)
)


def init(parameters: PipelineParameters) -> PipelineState:
    """State before the first message."""
    return PipelineState(estimator.init(parameters.estimator))


def init_running(parameters: PipelineParameters) -> PipelineState:
    """State of a simulation that shall begin without fade and settling."""
    known = NOT_CONDITIONED._replace(samples=SETTLING)
    running = dataclasses.replace(estimator.init(parameters.estimator), motion=known)
    return PipelineState(running, FADED_IN, reference=NO_REFERENCE._replace(velocity=known))


def receive(
    parameters: PipelineParameters,
    state: PipelineState,
    message: Input,
    received: int,
    emit: Emit,
    sent: int | None = None,
) -> None:
    """Take one message.

    Args:
        parameters: Settings and seals.
        state: From `init` or of the message before; it becomes the next state.
        message: As `messages.decode` makes it; its values may be anything.
        received: When it was received [ns].
        emit: Called with each estimate and feed-forward that the message makes; every number in them is finite.
        sent: When its publisher sent it [ns], on the clock of ``received``; None: just then.
    """
    since = acting_since(parameters.feedforward, received, received if sent is None else sent)
    RECEIVERS[type(message)](parameters, state, message, received, since, emit)


def no_answer(_record: Output, _frame_id: bytes) -> None:
    """For a message that makes no answer."""


def answered(
    parameters: PipelineParameters, state: PipelineState, message: Input, received: int, sent: int | None = None
) -> tuple[PipelineState, list[tuple[str, bytes]]]:
    """The next state, and the answers: message type and bytes of each, in the order they are emitted; see `receive`."""
    answers: list[tuple[str, bytes]] = []

    def collect(record: Output, frame_id: bytes) -> None:
        answers.append((type_of(record), encode(record, frame_id)))

    state = state.copy()
    receive(parameters, state, message, received, collect, sent)
    return state, answers


def send(emit: Any, record: Any, frame_id: Any) -> None:
    """Emit a record. Compiled code writes it into an array instead, see `compiled_pipeline`."""
    emit(record, frame_id)


@compilable
def acting_since(settings: FeedForwardSettings, received: int, sent: int) -> int:
    """Time from which the age of an input counts [ns]; `NEVER` if it came too late to act.

    A message that was sent after its receipt came from another clock, so nobody knows how old it is.
    """
    if settings.lateness_max == 0.0:
        return received
    if abs(received - sent) * 1e-9 > settings.lateness_max:
        return NEVER
    return sent if sent < received else received


@compilable
def receive_velocity(parameters: Any, state: Any, velocity: Any, received: int, since: int, emit: Any) -> None:
    """An estimate, and with a reference a feed-forward."""
    settings, stamp, made = parameters.feedforward, velocity.stamp, state.feedforward.received
    running, receipt = state.estimator, state.receipt
    is_new = running.stamp != stamp
    stamp_age = (received + state.clock_offset - stamp) * 1e-9
    is_late = since == NEVER or _stands_still(state.clock, receipt.clock, received, settings.estimate_timeout)
    sample = RodSample(
        stamp, velocity.velocity, state.pressure, state.force, state.refused, stamp_age, state.temperature, is_late
    )
    estimate, seen, friction = estimate_at(parameters.estimator, running, sample)
    send(emit, estimate, velocity.frame_id)
    running.adaptation = learn_from(parameters.estimator, running.adaptation, estimate, seen, friction)
    if is_new and since != NEVER and not estimate.status & NO_VELOCITY:
        receipt.velocity = since
    state.friction = estimate.coulomb_friction if usable(settings, estimate) else -1.0
    is_guided = receipt.reference != NEVER or settings.use_measured_velocity
    is_soon = since == NEVER and made != NEVER and received - made < TICK_INTERVAL
    if is_guided and not is_soon:
        _feed_forward(parameters, state, stamp, received, velocity.frame_id, emit)


@compilable
def receive_pressure(_parameters: Any, state: Any, pressure: Pressure, _received: int, since: int, _emit: Any) -> None:
    """Keep the pressure for the next velocity sample."""
    if pressure.stamp != state.pressure.stamp and since != NEVER:
        state.receipt.pressure = since
    state.pressure = pressure


@compilable
def receive_force(parameters: Any, state: Any, force: Force, _received: int, since: int, _emit: Any) -> None:
    """Keep the force sum for the next velocity sample."""
    in_range = abs(force.force) <= parameters.estimator.settings.force_max
    if force.stamp != state.force.stamp and since != NEVER and in_range:
        state.receipt.force = since
    state.force = force


@compilable
def receive_reference(parameters: Any, state: Any, wanted: Any, _received: int, since: int, _emit: Any) -> None:
    """Condition the reference and keep it for the next velocity sample; one that is not possible is no new sample."""
    is_new = wanted.stamp != state.reference.velocity.stamp
    if not is_new or not is_possible(parameters.estimator.settings, wanted):
        return
    state.reference = condition_reference(state.reference, wanted)
    if since != NEVER:
        state.receipt.reference = since


@compilable
def is_possible(settings: EstimatorSettings, wanted: Any) -> bool:
    """Whether a rod can follow a reference, by its velocity and acceleration; a NaN acceleration is not known."""
    is_slow = abs(wanted.velocity) <= settings.velocity_max
    return is_slow and not abs(wanted.acceleration) > settings.acceleration_max


def receive_clock(_parameters: Any, state: PipelineState, newest: Clock, received: int, since: int, _emit: Any) -> None:
    """Follow simulated time; one that stands still gets old."""
    if newest.stamp != state.clock and since != NEVER:
        state.receipt.clock = since
    state.clock, state.clock_offset = newest.stamp, newest.stamp - received


@compilable
def receive_temperature(
    parameters: Any, state: Any, newest: Temperature, _received: int, _since: int, _emit: Any
) -> None:
    """Keep the median of three temperatures for the next velocity sample; one that no rubber seal has is no sample."""
    state.temperature = _median(state.temperature, newest, parameters.estimator.settings.temperature_timeout)


@compilable
def _median(known: SealTemperature, newest: Temperature, timeout: float) -> SealTemperature:
    """Median of the last three temperatures.

    After a pause longer than the timeout [s] the three begin anew: the older ones say nothing of now.
    """
    kelvin = newest.temperature + ZERO_CELSIUS
    if not COLDEST <= kelvin <= HOTTEST or newest.stamp == known.newest_stamp:
        return known
    stamp, used, last, before = known.stamp, known.kelvin, known.newest, known.before
    if abs(newest.stamp - known.newest_stamp) * 1e-9 > timeout:
        last, before = 0.0, 0.0
    if before > 0.0:
        lower, higher = (last, before) if last < before else (before, last)
        stamp, used = newest.stamp, between(lower, kelvin, higher)
    return SealTemperature(stamp=stamp, kelvin=used, newest_stamp=newest.stamp, newest=kelvin, before=last)


@compilable
def receive_tick(parameters: Any, state: Any, tick: Any, received: int, _since: int, emit: Any) -> None:
    """A feed-forward without a velocity sample, which fades once an input is too old."""
    _feed_forward(parameters, state, tick.stamp, received, tick.frame_id, emit)


def receive_position(
    _parameters: Any, _state: PipelineState, _position: Position, _received: int, _since: int, _emit: Any
) -> None:
    """Nothing depends on the position; it is recorded to show how the servo tracks."""


RECEIVERS: dict[type, Callable[[Any, PipelineState, Any, int, int, Any], None]] = {
    Velocity: receive_velocity,
    Pressure: receive_pressure,
    Force: receive_force,
    ServoReference: receive_reference,
    Position: receive_position,
    Temperature: receive_temperature,
    Clock: receive_clock,
    WatchdogTick: receive_tick,
}
"""What takes each kind of message, see `receive`; the fifth argument is what `acting_since` gives."""


def is_tick_due(state: PipelineState, now: int) -> bool:
    """Whether the watchdog must act: there is a force, and no feed-forward was made for `TICK_INTERVAL`.

    Args:
        state: Of the last message.
        now: [ns] on the clock of receipt.
    """
    made = state.feedforward
    return made.received != NEVER and newest_force(made) != 0.0 and now - made.received >= TICK_INTERVAL


@compilable
def condition_reference(reference: Reference, wanted: Any) -> Reference:
    """Reference after a new one, with a velocity without ripple and an acceleration that two references agree on.

    Two accelerations in a row of the same sign count with the smaller magnitude, others as 0: the difference of a
    rounded velocity alternates, that of a clean one does not.
    """
    last = reference.last_acceleration
    velocity = condition_velocity(reference.velocity, wanted.stamp, wanted.velocity, 0.0)
    given = 0.0 if math.isnan(wanted.acceleration) else wanted.acceleration
    agreed = 0.0
    if given * last > 0.0:
        agreed = given if abs(given) < abs(last) else last
    acceleration = agreed
    if velocity.half_width > 0.0 and velocity.smoothing > 0.0 and reference.velocity.stamp != NEVER:
        step = abs(wanted.stamp - reference.velocity.stamp) * 1e-9
        share = step / (step + ACCELERATION_SMOOTHING * velocity.smoothing)
        acceleration = reference.acceleration + share * (agreed - reference.acceleration)
    return Reference(velocity=velocity, acceleration=acceleration, last_acceleration=given)


@compilable
def _feed_forward(parameters: Any, state: Any, stamp: int, received: int, frame_id: Any, emit: Any) -> None:
    """Make and emit the feed-forward of this moment."""
    settings, receipt, made = parameters.feedforward, state.receipt, state.feedforward
    present, acceleration = _reference_motion(settings, state.estimator.motion, state.reference)
    is_wanted = settings.use_measured_velocity or _is_younger(receipt.reference, received, settings.reference_timeout)
    turns = present * made.velocity <= 0.0 and made.velocity != 0.0
    if not is_wanted and not turns:
        present = math.nan  # the force fades as it is
    velocity = led = present
    if not settings.use_measured_velocity:
        velocity = wanted_velocity(settings, present, acceleration)
        led = led_velocity(settings, present, acceleration)
    ground, timeout = state.friction, settings.estimate_timeout
    if state.refused or not _is_fresh(receipt, received, timeout):
        ground = -1.0
    if _stands_still(state.clock, receipt.clock, received, timeout):
        ground = -1.0
    if turns and not is_wanted:  # a reference that came late: the force fades on its side
        ground = -1.0
    if ground >= 0.0 and not math.isnan(velocity):
        ground = _friction_at(parameters.estimator, state.estimator, state.temperature, ground, velocity)
    elasticity = parameters.estimator.elasticity
    state.feedforward, newest = elastic_step(
        settings, elasticity, made, stamp, received, ground, velocity, present, led
    )
    send(emit, newest, frame_id)


@compilable
def _friction_at(parameters: Any, known: Any, temperature: SealTemperature, coulomb: float, velocity: float) -> float:
    """Friction at a wanted velocity [N], >= 0, from the Coulomb friction of the newest estimate [N]."""
    learns = parameters.uses_scale and known.adaptation.outlook.is_proven
    if not (learns or parameters.depends_on_velocity):
        return coulomb
    used = known.pressure
    law = friction_of_seals(parameters.seal_numbers, used.chamber_a, used.chamber_b, velocity)
    if parameters.has_temperature_scale:
        scale = parameters.temperature_scale
        law = at_temperature(law, scale, temperature_in_use(scale, temperature))
    if not learns:
        friction = coulomb + law.velocity_friction
        return friction if friction > 0.0 else 0.0
    direction = (1.0 if velocity > 0.0 else -1.0) if velocity != 0.0 else 0.0
    sliding = law.coulomb_friction + law.velocity_friction
    found = bounded_friction(parameters.adaptation, known.adaptation.filter, direction, abs(velocity), sliding)
    return believed(found, sliding)


@compilable
def _reference_motion(
    settings: FeedForwardSettings, motion: ConditionedVelocity, reference: Reference
) -> tuple[float, float]:
    """Conditioned velocity [m/s] and acceleration [m/s^2] of the newest reference, late or not, or of the rod.

    With ``use_measured_velocity`` they are the rod's, its acceleration 0.
    """
    if settings.use_measured_velocity:
        return confirmed_velocity(motion), 0.0
    given = reference.velocity
    velocity, acceleration = confirmed_velocity(given), 0.0
    if given.samples >= SETTLING and (velocity != 0.0 or given.half_width == 0.0):  # noise at rest is no start
        acceleration = reference.acceleration
    return velocity, acceleration


@compilable
def _is_fresh(receipt: Any, received: int, timeout: float) -> bool:
    """Whether every input of the estimator that ever came has come within ``timeout`` [s]."""
    oldest = receipt.velocity if receipt.velocity < receipt.pressure else receipt.pressure
    if receipt.force != NEVER and receipt.force < oldest:
        oldest = receipt.force
    return _is_younger(oldest, received, timeout)


@compilable
def _stands_still(clock: int, receipt: int, received: int, timeout: float) -> bool:
    """Whether there is simulated time and it has not moved for ``timeout`` [s], or never did."""
    return clock != NEVER and not _is_younger(receipt, received, timeout)


@compilable
def _is_younger(receipt: int, received: int, timeout: float) -> bool:
    return receipt != NEVER and (received - receipt) * 1e-9 <= timeout
