r"""What the motion teaches about the friction: signals made ready for the filter, and what its innovations say.

While the rod slides evenly, or its inertia is known (`moving_mass`), the force sum less inertia is a reading for the
`friction_filter`. Force sum, friction of the law and velocity are **means over the two intervals before**, as the
acceleration is: by the trapezoidal rule inertia and friction are compared at one and the same time. Nothing is learnt
at rest or with a bad input.

**Consistency.** Each sample of a sliding rod is compared with what the filter expects. What drifts beside that widens
the band: it may be friction. An innovation of more than `IMPLAUSIBLE` standard deviations is not explained by anything
that the filter knows, so the estimate is marked, whatever caused it. So is one whose drift has been larger than half
the friction, and one whose force sum only an offset explains, before both directions have told friction from offset:
the rod may be held. A slow rod that was faster before may be at rest while its sensor has a zero: outliers are not
learnt from there, and mark earlier.

Source: normalised innovations as a check of consistency, [BarShalom2001]_ chapter 5; friction as the half difference of
the two directions, as the thesis evaluates Tables A-1 to A-3. All numbers are our choice.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from seal_friction_ros.core.estimation.friction_filter import (
    COULOMB_PRIOR,
    NOT_BEGUN,
    OUTLIER,
    PROVEN,
    REMAINDER_TIME,
    SCALE_PRIOR,
    USUAL_TIME,
    WRONG_DIRECTION,
    FrictionFilter,
    Reading,
    disregarded,
    doubt_of,
    friction_magnitude,
    updated,
)
from seal_friction_ros.core.estimation.moving_mass import (
    NO_ACCELERATIONS,
    NO_MASS,
    Accelerations,
    Inertia,
    MovingMass,
    followed,
    inertia_of,
    is_inertia_known,
)
from seal_friction_ros.core.foundation.compiled import compilable, replace
from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.friction.actuator import ActuatorFriction
from seal_friction_ros.core.messages.records import BITS, NEVER

MODES = ('off', 'observe', 'on')

TURNED = 1e-3  # [m] of a stroke after which an accelerated sample is a reading, or shows the mass
ONE_SIDED_95 = 1.644854  # [-] 95 % of a normal distribution are below it
LEAST_FRICTION = 1e-3  # [N] of the law, below which there is nothing to learn
SETTLING = 0.01  # [s] time constant of a friction that follows that of the law: seals shear before they slide
SETTLED = 0.99  # [-] of the friction, which that one must have reached after a reversal,
JUMPED = 1.1  # [-] of it that that one must not exceed after a pressure that the law does not know
LARGEST_INERTIA = 0.5  # [-] of the friction, in a reading with a known mass: the mass may be wrong
LONGEST_STEP = 0.1  # [s] after a longer gap the acceleration starts anew
LEARNING_INTERVAL = 9_500_000  # [ns] least time between two samples that are learnt from: all of a log at 100 Hz
LEAST_STD = 0.01  # [-] of the friction, below which no standard deviation is believed
IMPLAUSIBLE = 5.0  # [-] innovation over its standard deviation that is a fault of its own
UNKNOWN_DELAY = 0.01  # [s] standard deviation: inertia that is late is like friction that grows with speed
STRIBECK = 0.2  # [-] of the friction: standard deviation of what it is more when slow,
STRIBECK_SPEED = 0.008  # [m/s] as from this speed
NEW_RUN = math.hypot(SCALE_PRIOR, COULOMB_PRIOR)  # [-] of the friction: standard deviation of another day
REST = 0.1  # [s] after a motion in which the force sum may be that of the motion still
RIPPLE_TIME = 0.1  # [s] over which the ripple of the force sum at rest is a mean
LONGEST_PRESS = 0.1  # [s] for which a rod may rest under the breakaway force
LEAP_AT_REST = 0.3  # [-] sudden change of the force sum at rest over the friction, from which on it may be a load
AT_ONCE = 2.0  # [-] on the noise of the force sum at rest, which nothing averages
LOADED_TIME = 1.0  # [s] of sliding without a reading over which a sudden change at rest is forgotten
MAY_BE_FRICTION = 0.8  # [-] of what readings have added to the offset since the last reversal, in the band of sliding
WAVERING = 0.5  # [-] of the friction: root mean square of a drift from which on a swinging load may leave the band
FEWEST_SAMPLES = 4  # in each of two strokes that are compared
LONGEST_PAUSE = 60.0  # [s] between them


@dataclass(frozen=True)
class AdaptationSettings:
    """Settings of the adaptation, one field per ROS parameter.

    Raises:
        ValueError: A setting is out of bounds, or the mode is unknown.
    """

    mode: str = parameter(
        'observe',
        unit='',
        description='off: the seal file as it is. observe: scale and offset are learnt and published, nothing else '
        'changes but the standard deviation and the status. on: estimate and feed-forward use the scale.',
    )
    moving_mass: float = parameter(
        0.0,
        unit='kg',
        lower=0.0,
        upper=1e6,
        description='m; 0: unknown, then learnt from the accelerations of strokes.',
    )
    acceleration_max: float = parameter(
        0.05,
        unit='m/s^2',
        lower=1e-6,
        upper=1e3,
        description='Largest acceleration that counts as even speed where the inertia is not known.',
    )
    scale_min: float = parameter(0.3, unit='1', lower=0.01, upper=1.0, description='Lowest scale.')
    scale_max: float = parameter(3.0, unit='1', lower=1.0, upper=100.0, description='Highest scale.')

    def __post_init__(self) -> None:
        check(self)
        if self.mode not in MODES:
            raise ValueError(f'AdaptationSettings.mode = {self.mode!r} is not one of {", ".join(MODES)}')


class Signals(NamedTuple):
    """Of one sample, or means of some."""

    velocity: float  # [m/s]
    force_sum: float  # [N]
    friction: float  # [N] f d of the law; 0.0 at rest


class Motion(NamedTuple):
    """What the last samples show: means of the same intervals can be compared."""

    newest: Signals
    once: Signals  # mean over the last interval
    twice: Signals  # mean over the last two
    at_first: float  # [m/s^2] acceleration over the last interval
    acceleration: float  # [m/s^2] over the last two
    settled: float  # [N] friction of the law after `SETTLING`, with its sign


class Stroke(NamedTuple):
    """Means over one direction."""

    direction: int  # -1 or 1; 0: none
    stamp: int  # [ns] of the newest reading in it
    reading: float  # [N] y
    friction: float  # [N] f of the law, >= 0
    samples: int
    is_identified: bool  # whether the law was identified at every pressure and speed in it


NO_STROKE = Stroke(0, NEVER, 0.0, 0.0, 0, True)


class Strokes(NamedTuple):
    """The last two strokes and what they show by themselves, for the diagnosis."""

    present: Stroke = NO_STROKE
    before: Stroke = NO_STROKE
    ratio: float = 1.0  # [-] friction over that of the law, by the last two strokes that could be compared
    reversals: int = 0  # between strokes that could be compared


class Rest(NamedTuple):
    """What the force sum does while the rod rests."""

    slid: int = NEVER  # [ns] stamp of the last sample of a sliding rod
    ripple: float = 0.0  # [N^2] mean square of the force sum against its mean before, over `RIPPLE_TIME`
    pressed: float = 0.0  # [s] of this rest under the breakaway force, in all
    leapt: float = 0.0  # [N] largest sudden change of the force sum in this rest
    leapt_at: int = NEVER  # [ns] its stamp
    loaded: float = 0.0  # [N] a sudden change within a rest, until the next reading: it may be a load
    held: float = 0.0  # [N] most that rests held beyond the sliding friction, which fades over `USUAL_TIME`
    left: float = 0.0  # [N] of the force sum that the end of the motion did not explain: an inertia, or a load


NO_REST = Rest()


ANY = 1e300  # [N] innovation that nothing is beyond, before the first reading


class Outlook(NamedTuple):
    """What the filter says of the samples until the next one is learnt from, as far as they do not change it."""

    is_proven: bool  # whether the motion has told the friction
    status: int  # bit of a drift that nothing explains
    most: float  # [N] innovation of a sample that is explained; negative: none is
    taken_off: float  # [N] of the force sum of a sliding rod: inertia, offset and remainder
    offset: float  # [N] of the force sum where the rod is: its gradient goes on since the last reading
    unsteady_offset: float  # [N] with the remainder
    scale: float  # [-] friction over that of the law at the last reading, mean of both directions
    scale_std: float  # [-] negative: nothing is learnt
    unexplained_square: float  # [N^2] of what readings show beside the friction and may be friction


NO_OUTLOOK = Outlook(
    is_proven=False, status=0, most=ANY, taken_off=0.0, offset=0.0, unsteady_offset=0.0, scale=1.0, scale_std=-1.0,
    unexplained_square=0.0,
)  # fmt: skip


class AdaptationState(NamedTuple):
    """What one sample leaves for the next."""

    stamp: int  # [ns] of the last sample that was taken; `NEVER` before the first
    motion: Motion
    way: float  # [m] since the last reading of the filter
    fastest: float  # [m/s] fastest speed of a reading, which fades over `USUAL_TIME`
    inertia_rate: float  # [N/s] by which inertia falls along the motion: mean over `REMAINDER_TIME` of readings
    filter: FrictionFilter
    by_motion: FrictionFilter  # the filter without readings of a rod that may have rested all the time
    strokes: Strokes
    rest: Rest
    outlook: Outlook
    mass: MovingMass
    since_turn: float  # [m] way since the rod turned or rested
    accelerations: Accelerations  # of the present stroke


NO_SIGNALS = Signals(0.0, 0.0, 0.0)
NOT_ADAPTED = AdaptationState(
    stamp=NEVER,
    motion=Motion(NO_SIGNALS, NO_SIGNALS, NO_SIGNALS, 0.0, 0.0, 0.0),
    way=0.0,
    fastest=0.0,
    inertia_rate=0.0,
    filter=NOT_BEGUN,
    by_motion=NOT_BEGUN,
    strokes=Strokes(),
    rest=NO_REST,
    outlook=NO_OUTLOOK,
    mass=NO_MASS,
    since_turn=0.0,
    accelerations=NO_ACCELERATIONS,
)
"""State before the first sample."""


class Slide(NamedTuple):
    """One sample of the rod."""

    stamp: int  # [ns]
    velocity: float  # [m/s] at which the seals slide, conditioned; 0.0 at rest
    force_sum: float  # [N]
    friction: float  # [N] of the law at this pressure and speed, >= 0
    friction_std: float  # [N] of a new reading, by the seal file
    is_pressed: bool  # whether the rod rests under the breakaway force
    is_usable: bool  # whether every input is good
    is_identified: bool  # whether the law was identified at this pressure and speed
    slow: float  # [m/s] speed below which a rod may be at rest: the velocity may be the zero of its sensor


@compilable
def is_due(state: AdaptationState, stamp: int) -> bool:
    """Whether the sample of this stamp is to be learnt from: the last one is old enough, or the clock went back."""
    return not 0 <= stamp - state.stamp < LEARNING_INTERVAL


@compilable
def adapt(settings: AdaptationSettings, state: AdaptationState, slide: Slide) -> AdaptationState:
    """Learn from one sample.

    Args:
        settings: Settings; the mode does not matter here.
        state: `NOT_ADAPTED` or the state before.
        slide: The sample.

    Returns:
        The next state.
    """
    velocity, friction = slide.velocity, slide.friction
    direction = (1 if velocity > 0.0 else -1) if velocity != 0.0 else 0
    newest = Signals(velocity, slide.force_sum, friction * direction)
    elapsed = (slide.stamp - state.stamp) * 1e-9 if state.stamp != NEVER else 0.0
    if not 0.0 < elapsed <= LONGEST_STEP:
        return _interrupted(settings, state, slide.stamp, newest)
    before, motion = state.motion.twice, _motion_after(state.motion, newest, elapsed)
    twice, acceleration = motion.twice, motion.acceleration
    rest = _rested(settings, state, slide, direction, elapsed)
    known, strokes, rate = state.filter, state.strokes, state.inertia_rate
    speed, fastest = abs(velocity), state.fastest * (1.0 - elapsed / USUAL_TIME)
    has_turned = direction == 0 or before.velocity * twice.velocity <= 0.0
    since_turn = 0.0 if has_turned else state.since_turn + elapsed * abs(twice.velocity)
    mass, sums = state.mass, NO_ACCELERATIONS if has_turned else state.accelerations
    inertia = inertia_of(settings.moving_mass, mass)
    knows_inertia = is_inertia_known(inertia, acceleration, friction)
    of_inertia = inertia.mass * acceleration if knows_inertia else 0.0
    largest = _largest_acceleration(state.motion, motion)
    is_readable = _is_readable(settings, slide, inertia, since_turn, largest) and direction != 0
    fastest = speed if is_readable and speed > fastest else fastest
    may_rest = speed < slide.slow <= fastest  # a rod that is never faster could not be learnt from at all
    way = state.way + 0.5 * elapsed * (before.velocity + twice.velocity)
    by_motion, newest_way = state.by_motion, way - state.way
    if fastest < slide.slow:
        by_motion = _moved(by_motion, newest_way if state.fastest < slide.slow else way)
    elif state.fastest < slide.slow:  # the slow motion before may have been the zero of its sensor
        known, way = by_motion, newest_way
    most = JUMPED if slide.is_identified and not strokes.present.is_identified else math.inf
    is_settled = most * friction >= motion.settled * direction >= SETTLED * friction >= LEAST_FRICTION
    if is_settled and slide.is_usable and slide.is_identified and since_turn > TURNED:
        unexplained = twice.force_sum - twice.friction
        mass, sums = followed(mass, sums, abs(twice.velocity), acceleration, unexplained, elapsed)
    if is_readable and is_settled:
        force, law = twice.force_sum - of_inertia, twice.friction * direction
        reading = Reading(slide.stamp, force, direction, twice.velocity, way, law, slide.friction_std, rest.loaded)
        strokes = _with_reading(strokes, reading, slide.is_identified)
        of_last = state.outlook.taken_off - state.outlook.unsteady_offset
        rate += elapsed / (elapsed + REMAINDER_TIME) * (direction * (of_last - of_inertia) / elapsed - rate)
        if may_rest and slide.is_identified and known.stamp != NEVER and _is_outlier(state, newest):
            known = disregarded(known, reading, elapsed)
        elif slide.is_identified:
            known, way = updated(known, reading), 0.0
            rest = _told(rest) if fastest >= slide.slow else rest
    may_have_inertia = not knows_inertia and abs(acceleration) > settings.acceleration_max
    outlook = outlook_of(settings, known, way, of_inertia, may_have_inertia, speed < slide.slow <= fastest)
    by_motion = known if fastest >= slide.slow else by_motion
    if direction != 0 and slide.is_usable and known.stamp != NEVER:
        found = friction_magnitude(known.terms, float(direction), speed, friction)
        rest = replace(rest, left=twice.force_sum - outlook.taken_off - direction * found)
    return AdaptationState(
        slide.stamp, motion, way, fastest, rate, known, by_motion, strokes, rest, outlook, mass, since_turn, sums,
    )  # fmt: skip


@compilable
def _interrupted(settings: AdaptationSettings, state: AdaptationState, stamp: int, newest: Signals) -> AdaptationState:
    """State after a gap: signals and strokes begin anew."""
    rest = replace(NO_REST, slid=stamp, held=state.rest.held)
    strokes = Strokes(NO_STROKE, NO_STROKE, state.strokes.ratio, state.strokes.reversals)
    outlook = outlook_of(settings, state.filter, state.way, 0.0, False, False)
    return replace(
        state, stamp=stamp, motion=Motion(newest, newest, newest, 0.0, 0.0, newest.friction), strokes=strokes,
        rest=rest, outlook=outlook, since_turn=0.0, accelerations=NO_ACCELERATIONS,
    )  # fmt: skip


@compilable
def _moved(known: FrictionFilter, way: float) -> FrictionFilter:
    """Filter after a way [m] that nothing was learnt from."""
    if way == 0.0 or known.terms.gradient == 0.0:
        return known
    return replace(known, terms=replace(known.terms, offset=known.terms.offset + way * known.terms.gradient))


@compilable
def _rested(settings: AdaptationSettings, state: AdaptationState, slide: Slide, direction: int, elapsed: float) -> Rest:
    """What the force sum has done in this rest, after one more sample."""
    before, outlook, motion = state.rest, state.outlook, state.motion
    change, leap = slide.force_sum - motion.twice.force_sum, slide.force_sum - motion.once.force_sum
    ripple = before.ripple + elapsed / (elapsed + RIPPLE_TIME) * (change * change - before.ripple)
    held = before.held * (1.0 - elapsed / USUAL_TIME)
    if direction != 0:
        loaded = before.loaded * (1.0 - elapsed / LOADED_TIME)
        return Rest(slide.stamp, ripple, 0.0, 0.0, NEVER, loaded, held, before.left)
    beyond = abs(slide.force_sum - outlook.offset) - outlook.scale * slide.friction
    most = (settings.scale_max - outlook.scale) * slide.friction
    if slide.is_usable and outlook.is_proven and beyond > held and (slide.stamp - before.slid) * 1e-9 >= REST:
        held = beyond if beyond < most else most  # more is an end stop
    pressed = before.pressed + elapsed if slide.is_pressed else before.pressed
    leapt, leapt_at, loaded = before.leapt, before.leapt_at, before.loaded
    is_of_motion = leapt_at == NEVER or (leapt_at - before.slid) * 1e-9 < REST  # of the end of the motion before
    if not is_of_motion and (slide.stamp - leapt_at) * 1e-9 >= REST and abs(leapt) > abs(loaded):
        loaded = leapt  # and not of the beginning of the next
    is_larger = abs(leap) > abs(leapt) or (is_of_motion and (slide.stamp - before.slid) * 1e-9 >= REST)
    if slide.is_usable and is_larger and abs(leap) > LEAP_AT_REST * slide.friction:
        leapt, leapt_at = leap, slide.stamp
    return Rest(before.slid, ripple, pressed, leapt, leapt_at, loaded, held, before.left)


@compilable
def _told(rest: Rest) -> Rest:
    """Rest whose load a reading has told."""
    return rest if rest.loaded == 0.0 else replace(rest, loaded=0.0)


@compilable
def _with_reading(strokes: Strokes, reading: Reading, is_identified: bool) -> Strokes:
    """Strokes after one more reading."""
    present, before, ratio, reversals = strokes
    if reading.direction != present.direction:
        if before.is_identified and present.is_identified and can_be_compared(before, present):
            ratio = ratio_of(before, present)
            reversals += 1
        before, present = present, NO_STROKE
    samples = present.samples + 1
    present = Stroke(
        reading.direction,
        reading.stamp,
        present.reading + (reading.force - present.reading) / samples,
        present.friction + (reading.friction - present.friction) / samples,
        samples,
        present.is_identified and is_identified,
    )
    return Strokes(present, before, ratio, reversals)


@compilable
def _motion_after(before: Motion, newest: Signals, elapsed: float) -> Motion:
    """Motion after one more sample."""
    once, at_first = _middle(before.newest, newest), (newest.velocity - before.newest.velocity) / elapsed
    settled = before.settled + elapsed / (elapsed + SETTLING) * (newest.friction - before.settled)
    acceleration = 0.5 * (before.at_first + at_first)
    return Motion(newest, once, _middle(before.once, once), at_first, acceleration, settled)


@compilable
def _largest_acceleration(before: Motion, motion: Motion) -> float:
    """Largest acceleration about the samples of the means [m/s^2]: the first may have that of the interval before."""
    largest, earlier = abs(motion.at_first), abs(before.acceleration)
    largest = largest if largest > earlier else earlier
    return largest if largest > abs(motion.acceleration) else abs(motion.acceleration)


@compilable
def _middle(before: Signals, after: Signals) -> Signals:
    """Means of two."""
    return Signals(
        0.5 * (before.velocity + after.velocity),
        0.5 * (before.force_sum + after.force_sum),
        0.5 * (before.friction + after.friction),
    )


@compilable
def can_be_compared(before: Stroke, after: Stroke) -> bool:
    """Whether two strokes are of opposite directions, close in time and long enough."""
    if before.direction * after.direction >= 0 or (after.stamp - before.stamp) * 1e-9 > LONGEST_PAUSE:
        return False
    return before.samples >= FEWEST_SAMPLES and after.samples >= FEWEST_SAMPLES


@compilable
def ratio_of(before: Stroke, after: Stroke) -> float:
    """Friction over that of the law by two strokes alone: half the difference of their means."""
    return after.direction * (after.reading - before.reading) / (after.friction + before.friction)


@compilable
def _is_readable(
    settings: AdaptationSettings, slide: Slide, inertia: Inertia, since_turn: float, acceleration: float
) -> bool:
    """Whether a sample may be a reading: little acceleration, or little inertia against the friction if it is known.

    Args:
        settings: With the limits.
        slide: The sample.
        inertia: Given or learnt.
        since_turn: Way [m]: elastic seals do not slide at once.
        acceleration: [m/s^2] the largest one (`_largest_acceleration`).
    """
    is_even = acceleration <= settings.acceleration_max
    if is_inertia_known(inertia, acceleration, slide.friction):
        is_even = (is_even or since_turn > TURNED) and inertia.mass * acceleration <= LARGEST_INERTIA * slide.friction
    return is_even and slide.is_usable


@compilable
def outlook_of(
    settings: AdaptationSettings,
    known: FrictionFilter,
    way: float,
    of_inertia: float,
    may_have_inertia: bool,
    may_rest: bool,
) -> Outlook:
    """What the filter says of the next samples.

    An unknown inertia explains less of a stroke that is not even: then only a sample that may have the wrong direction
    contradicts. Each one does while the rod may be held.

    Args:
        settings: With the bounds.
        known: The filter.
        way: Of the rod since the last reading [m].
        of_inertia: Force of a known inertia [N].
        may_have_inertia: Whether the rod accelerates with an inertia that is not known.
        may_rest: Whether the velocity may be the zero of its sensor: then a smaller innovation contradicts.
    """
    if known.stamp == NEVER:
        return replace(NO_OUTLOOK, taken_off=of_inertia)
    friction, terms = known.friction, known.terms
    proven, wavers = known.friction_std <= PROVEN * friction, WAVERING * friction
    most = (OUTLIER if may_rest else IMPLAUSIBLE) * known.innovation_std
    if may_have_inertia:
        wrong_direction = WRONG_DIRECTION * friction
        most = most if most > wrong_direction else wrong_direction
    offset = terms.offset + way * terms.gradient
    explained = BAND_95 * math.sqrt(doubt_of(known))
    may_be_at_rest = not proven and abs(offset + terms.remainder) > explained
    return Outlook(
        proven,
        BITS.MODEL_DISAGREES if known.unexplained.drift_square > wavers * wavers else 0,
        -1.0 if may_be_at_rest else most,
        of_inertia + offset + terms.remainder,
        offset,
        offset + terms.remainder,
        bounded_friction(settings, known, 0.0, known.speed, friction) / friction,
        known.friction_std / friction,
        _unexplained_square(known),
    )


@compilable
def _is_outlier(state: AdaptationState, newest: Signals) -> bool:
    """Whether a sample of a sliding rod is more than `OUTLIER` standard deviations from what was expected."""
    direction = 1.0 if newest.velocity > 0.0 else -1.0
    found = friction_magnitude(state.filter.terms, direction, abs(newest.velocity), newest.friction * direction)
    return abs(newest.force_sum - state.outlook.taken_off - direction * found) > OUTLIER * state.filter.innovation_std


@compilable
def friction_of_sliding(
    settings: AdaptationSettings, state: AdaptationState, friction: ActuatorFriction, velocity: float, uses: bool
) -> tuple[ActuatorFriction, float, bool]:
    r"""Friction of a rod that slides by what is learnt, what the filter finds, and whether that contradicts the other.

    With ``uses`` it is the mean and the standard deviation of the posterior, once the motion has told the friction;
    beyond the bounds of the scale it contradicts.
    Without, the friction is that of the file, and its band holds the posterior (`_about`). More than twice both
    deviations contradict.

    Args:
        settings: With the bounds.
        state: What is learnt.
        friction: By the seal files.
        velocity: [m/s]
        uses: Whether the estimate uses what is learnt.

    Returns:
        Friction of the estimate; friction by the filter with the sign of the velocity, without bounds [N]; whether it
        contradicts.
    """
    coulomb, file_std, added = friction.coulomb_friction, friction.coulomb_friction_std, friction.velocity_friction
    law, known, is_proven = coulomb + added, state.filter, state.outlook.is_proven
    terms, lowest, highest = known.terms, settings.scale_min, settings.scale_max
    direction, speed = (1.0, velocity) if velocity > 0.0 else (-1.0, -velocity)
    slope, constant, misfit = terms.scale + direction * terms.asymmetry, terms.coulomb, terms.misfit
    found = slope * law + constant + misfit + terms.viscous * speed
    found = found if found > 0.0 else 0.0
    sliding = found if lowest * law <= found <= highest * law else between(lowest * law, found, highest * law)
    std = _std_of_sliding(state, speed, law, file_std)
    if uses and is_proven:
        at_no_speed = slope * coulomb + constant + misfit
        if not lowest * coulomb <= at_no_speed <= highest * coulomb:
            at_no_speed = between(lowest * coulomb, at_no_speed, highest * coulomb)
        contradicts = law > 0.0 and sliding != found
        at_no_speed, sliding = believed(at_no_speed, coulomb), believed(sliding, law)
        scale = sliding / law if law > 0.0 else 1.0
        stiction, asymmetry = friction.stiction * scale, friction.breakaway_asymmetry * scale
        adapted = ActuatorFriction(
            at_no_speed, std, stiction, friction.in_identified_range, sliding - at_no_speed, asymmetry
        )
        return adapted, direction * found, contradicts
    missed, doubt = found - law, file_std * file_std + doubt_of(known)
    std = _about(abs(sliding - law), std)
    adapted = ActuatorFriction(
        coulomb, std, friction.stiction, friction.in_identified_range, added, friction.breakaway_asymmetry
    )
    return adapted, direction * found, is_proven and law > 0.0 and missed * missed > 4.0 * doubt


@compilable
def friction_at_rest(
    settings: AdaptationSettings,
    state: AdaptationState,
    friction: ActuatorFriction,
    stamp: int,
    force_sum: float,
    uses: bool,
) -> tuple[ActuatorFriction, float, bool]:
    """Friction of a rod at rest by what is learnt, and whether that, or this rest, contradicts the estimate.

    The standard deviation of the friction that acts is that of the force sum less its offset, at most the breakaway
    force, since friction at rest is no larger; that of Coulomb friction is the one of sliding, or this if wider. A rest
    under the breakaway force contradicts, and as `friction_of_sliding` says; so does an offset of more than half the
    breakaway force where nothing takes it off.

    Args:
        settings: With the bounds.
        state: What is learnt.
        friction: By the seal files.
        stamp: [ns] of the sample.
        force_sum: [N]
        uses: Whether the estimate uses what is learnt.

    Returns:
        Friction of the estimate; standard deviation of the friction that acts [N]; whether something contradicts.
    """
    coulomb, file_std, added = friction.coulomb_friction, friction.coulomb_friction_std, friction.velocity_friction
    stiction, asymmetry, is_in_range = friction.stiction, friction.breakaway_asymmetry, friction.in_identified_range
    law, outlook, known = coulomb + added, state.outlook, state.filter
    found = friction_magnitude(known.terms, 0.0, 0.0, law)
    sliding = between(settings.scale_min * law, found, settings.scale_max * law)
    scale = sliding / law if law > 0.0 else 1.0
    std = _std_at_rest(state, stamp, force_sum, scale * (coulomb + stiction))
    std = std if std > LEAST_STD * law else LEAST_STD * law
    coulomb_std = _std_of_sliding(state, known.speed, law, file_std)
    is_pressed, can_contradict = state.rest.pressed > LONGEST_PRESS, outlook.is_proven and law > 0.0
    if uses and outlook.is_proven:
        contradicts = can_contradict and sliding != found
        at_no_speed = believed(bounded_friction(settings, known, 0.0, 0.0, coulomb), coulomb)
        sliding = believed(sliding, law)
        scale = sliding / law if law > 0.0 else 1.0
        coulomb_std = coulomb_std if coulomb_std > std else std
        adapted = ActuatorFriction(
            at_no_speed, coulomb_std, stiction * scale, is_in_range, sliding - at_no_speed, asymmetry * scale
        )
        return adapted, std, is_pressed or contradicts
    missed, doubt = found - law, file_std * file_std + doubt_of(known)
    std = _about(abs(outlook.offset), std)
    coulomb_std = _about(abs(sliding - law), coulomb_std)
    coulomb_std = coulomb_std if coulomb_std > std else std
    adapted = ActuatorFriction(coulomb, coulomb_std, stiction, is_in_range, added, asymmetry)
    contradicts = abs(outlook.offset) > 0.5 * (coulomb + stiction) or missed * missed > 4.0 * doubt
    return adapted, std, is_pressed or (can_contradict and contradicts)


@compilable
def believed(found: float, law: float) -> float:
    r"""Friction that the estimate uses [N], for what the filter finds and the law of the seal files.

    Of a difference d it takes :math:`d^3 / (d^2 + \varepsilon^2)`, where :math:`\varepsilon` is the smallest deviation
    that is believed, `LEAST_STD` of the law: half of it there, less below, so a seal that has not changed keeps the
    friction of its file.
    """
    difference, least = found - law, LEAST_STD * law
    square = difference * difference
    return law + difference * square / (square + least * least) if square > 0.0 else law


@compilable
def _about(missed: float, std: float) -> float:
    r"""Standard deviation about a value that misses the mean by m: its 95 % hold 95 % of a normal distribution [N].

    It is :math:`(|m| + 1.64 \sigma) / 1.96` where that is wider.
    """
    wider = (missed + ONE_SIDED_95 * std) / BAND_95
    return std if std > wider else wider


@compilable
def bounded_friction(
    settings: AdaptationSettings, known: FrictionFilter, direction: float, speed: float, law: float
) -> float:
    """Friction by the filter [N], within the bounds of its scale; ``law`` [N] is that of the seal files, >= 0."""
    found = friction_magnitude(known.terms, direction, speed, law)
    return between(settings.scale_min * law, found, settings.scale_max * law)


@compilable
def _std_of_sliding(state: AdaptationState, speed: float, law: float, file_std: float) -> float:
    """Standard deviation of the friction of a rod that slides [N].

    Slow friction that nobody has seen may be Stribeck's, or as large as rests have held; what is not explained may be
    friction, too.
    """
    known = state.filter
    if known.stamp == NEVER:
        return math.sqrt(NEW_RUN * law * NEW_RUN * law + file_std * file_std)
    slow, held = STRIBECK * law, state.rest.held / BAND_95
    faster, last, std = speed / STRIBECK_SPEED, known.friction, known.friction_std
    faster *= faster
    stribeck = (held if held > slow else slow) / (1.0 + faster * faster)
    if law > last:
        std *= law / last
    late = UNKNOWN_DELAY * state.inertia_rate
    variance = std * std + stribeck * stribeck + late * late
    if speed > state.fastest:
        faster, viscous = state.fastest / STRIBECK_SPEED, known.terms.viscous
        untold, less = speed - state.fastest, slow / (1.0 + faster * faster)
        variance += (viscous * viscous + known.covariance.kk) * untold * untold + less * less
    least, std = LEAST_STD * law, math.sqrt(variance + state.outlook.unexplained_square)
    return std if std > least else least


@compilable
def _unexplained_square(known: FrictionFilter) -> float:
    """Square of what readings show beside the friction and may be friction, beyond a usual drift [N^2].

    That is most of what the offset took since the last reversal and the drift just now, or what the steps since then
    may have been, or one that has begun, or all that is not explained.
    """
    unexplained = known.unexplained
    newest = unexplained.drift + MAY_BE_FRICTION * known.strayed
    newest = newest * newest if newest * newest > known.stepped else known.stepped
    begun = known.outliers.last * known.outliers.last if known.outliers.number != 0 else 0.0
    newest = newest if newest > begun else begun
    largest = newest if newest > unexplained.square else unexplained.square
    return largest - unexplained.drift_square if largest > unexplained.drift_square else 0.0


@compilable
def _std_at_rest(state: AdaptationState, stamp: int, force_sum: float, most: float) -> float:
    """Standard deviation of the friction of a rod at rest [N], at most the breakaway force ``most`` [N]."""
    known, rest, spread, way = state.filter, state.rest, state.filter.covariance, state.way
    if known.stamp == NEVER or (stamp - rest.slid) * 1e-9 < REST:
        return most
    change = force_sum - state.motion.twice.force_sum
    noise = change * change if change * change > rest.ripple else rest.ripple
    offset = spread.bb + way * (2.0 * spread.bg + way * spread.gg)
    remainder = known.terms.remainder  # at rest nothing tells it from the offset
    step = known.outliers.last if known.outliers.number != 0 else 0.0  # it may have begun
    strayed = known.strayed + way * (known.terms.gradient - known.gradient)
    variance = offset + remainder * remainder + strayed * strayed + rest.leapt * rest.leapt + step * step
    variance += rest.left * rest.left
    variance += AT_ONCE * AT_ONCE * (known.unexplained.square + noise)
    std = math.sqrt(variance) if variance > 0.0 else 0.0
    unseen = known.load_step / ONE_SIDED_95  # the seals would hold it
    std = std if std > unseen else unseen
    return std if std < most else most


class Learnt(NamedTuple):
    """What a person wants to know of it."""

    scale: float  # [-] friction over that of the law, mean of both directions; 1.0 at first
    scale_std: float  # [-] negative: the motion has not told the friction yet
    offset: float  # [N]
    noise: float  # [N] root mean square of what neither friction nor offset explains; negative: not known
    friction: float  # [N] of the law at the last reading
    reversals: int


def learnt(state: AdaptationState) -> Learnt:
    """What is learnt so far."""
    known = state.filter
    if known.stamp == NEVER:
        return Learnt(1.0, -1.0, 0.0, -1.0, 0.0, state.strokes.reversals)
    noise, outlook = math.sqrt(known.unexplained.square), state.outlook
    std = outlook.scale_std if outlook.is_proven else -1.0
    return Learnt(outlook.scale, std, known.terms.offset, noise, known.friction, state.strokes.reversals)
