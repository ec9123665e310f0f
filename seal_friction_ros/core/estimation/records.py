"""Inputs of the estimator that no single message holds."""

from typing import NamedTuple

from seal_friction_ros.core.messages.records import NEVER, Force, Pressure


class SealTemperature(NamedTuple):
    """Temperature of the seals in use: the median of the last three readings, so that no single one is believed."""

    stamp: int  # [ns] of the newest reading when there were three; `NEVER` before that
    kelvin: float  # [K]
    newest_stamp: int = NEVER  # [ns] of the newest reading
    newest: float = 0.0  # [K] the newest reading; 0.0: none
    before: float = 0.0  # [K] the one before; 0.0: none


NO_TEMPERATURE = SealTemperature(NEVER, 0.0)


class RodSample(NamedTuple):
    """One rod-velocity sample with the newest pressure and force sum received before it."""

    stamp: int  # [ns]
    velocity: float  # [m/s] positive on extension
    pressure: Pressure
    force: Force
    refused: bool = False  # whether an input has several publishers, so that none may act
    stamp_age: float = 0.0  # [s] time of receipt after the stamp; negative for a stamp in the future
    temperature: SealTemperature = NO_TEMPERATURE
    is_late: bool = False  # whether it came too late to act, or simulated time stands still
