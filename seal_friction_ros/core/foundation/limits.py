"""Limits of a number, the same interpreted and compiled."""

from seal_friction_ros.core.foundation.compiled import compilable


@compilable
def between(lowest: float, value: float, highest: float) -> float:
    """The value, or the limit that it is beyond."""
    if value < lowest:
        return lowest
    return highest if value > highest else value
