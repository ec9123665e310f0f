"""Short swings of the velocity that the force sum does not show: hum of a signal, not a motion of the rod.

``swing = swing_on(swing, elapsed, velocity, force_sum, friction)`` for every sample of a sliding rod.

A rod that slides to and fro turns work into heat: over a stroke from one reversal to the next, the mean of the force
sum along the motion is the mean friction, whatever the mass, as the rod has no speed at either end. A constant load or
offset adds to one stroke what it takes from the other. So over two strokes, with means over the way:

    mean force there + mean force back = mean friction there + mean friction back

If the left side is less than half of the right, the rod does not slide as the velocity says, or the friction is far
less than the estimate: either way the estimate is not to be trusted. The doubt lasts until two strokes agree, or a
stroke is four times as long as any in doubt. Long strokes are not judged: hum has none, and a machine may lack a load
in its force sum.

Source: energy balance; all numbers are our choice.
"""

from typing import NamedTuple

from seal_friction_ros.core.foundation.compiled import compilable, replace

LONGEST_SWING = 2.2e-3  # [m] longer strokes are not judged; shorter ones hold a hum of 20 mm/s from 3 Hz on
LONGEST_STEP = 0.02  # [s] a longer time between two samples counts as this one
LEAST_SHARE = 0.5  # [-] of the friction of the estimate that the force sum must show
MUCH_LONGER = 4.0  # [-] a stroke of this multiple of the strokes in doubt is a motion of its own


class Swing(NamedTuple):
    """The present stroke and what is known of the one before."""

    way: float  # [m] since the last reversal, with its sign
    work: float  # [J] of the force sum in this stroke
    heat: float  # [J] of the friction in this stroke
    last_force: float  # [N] mean force sum along the stroke before
    last_friction: float  # [N] mean friction in the stroke before; 0.0: it was long, or none
    doubted: float  # [m] longest stroke that the force sum did not show; 0.0: no doubt


NO_SWING = Swing(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@compilable
def swing_on(swing: Swing, elapsed: float, velocity: float, force_sum: float, friction: float) -> Swing:
    """Take one sample.

    Args:
        swing: `NO_SWING` or the result before.
        elapsed: Since the sample before [s]; negative after a clock was set back.
        velocity: At which the seals slide [m/s], not 0.
        force_sum: Usable [N].
        friction: Of the estimate [N], with the sign of the motion.
    """
    if elapsed == 0.0:  # a repeated stamp is no new sample
        return swing
    if swing.way != 0.0 and (velocity > 0.0) != (swing.way > 0.0):
        swing = _turned(swing)
    step = velocity * (elapsed if 0.0 < elapsed < LONGEST_STEP else LONGEST_STEP)
    way = swing.way + step
    work, heat = swing.work + force_sum * step, swing.heat + friction * step
    doubted = 0.0 if abs(way) > MUCH_LONGER * swing.doubted else swing.doubted
    return Swing(way, work, heat, swing.last_force, swing.last_friction, doubted)


@compilable
def _turned(swing: Swing) -> Swing:
    """Swing at a reversal: the stroke before the next one."""
    stroke = abs(swing.way)
    if stroke > LONGEST_SWING:
        return replace(NO_SWING, doubted=swing.doubted)
    force, friction, doubted = swing.work / stroke, swing.heat / stroke, swing.doubted
    if swing.last_friction > 0.0:
        is_shown = force + swing.last_force >= LEAST_SHARE * (friction + swing.last_friction)
        doubted = 0.0 if is_shown else max(stroke, doubted)
    return Swing(way=0.0, work=0.0, heat=0.0, last_force=force, last_friction=friction, doubted=doubted)
