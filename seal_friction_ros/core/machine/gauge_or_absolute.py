"""Gauge or absolute: what the lowest pressures of a machine say about the key ``absolute`` of its mapping file.

A chamber without load is at ambient pressure: 0 Pa gauge, about 1e5 Pa absolute. All bounds are our choice.
"""

import math
from typing import NamedTuple

from seal_friction_ros.core.machine import machine_file
from seal_friction_ros.core.machine.machine_file import Actuator, MachineFile, Signal
from seal_friction_ros.core.messages.records import NEVER, Pressure

LOWEST_GAUGE = -5e4  # [Pa] only a chamber that cavitates is nearer to vacuum
LOWEST_IN_KPA = 80.0  # in a message: an absolute pressure in kPa is not below it
LOWEST_ABSOLUTE = 9e4  # [Pa] a pressure that never falls below it may be absolute ...
HIGHEST_AMBIENT = 1.15e5  # [Pa] ... and is likely to be, if it falls to this


class Lowest(NamedTuple):
    """Lowest pressure of each chamber since the start [Pa], as the estimator gets it; infinite before the first."""

    chamber_a: float = math.inf
    chamber_b: float = math.inf

    def after(self, pressure: Pressure) -> 'Lowest':
        """After one more pressure; NaN and `NO_PRESSURE` change nothing."""
        if pressure.stamp == NEVER:
            return self
        (low_a, low_b), (_, a, b) = self, pressure
        if a >= low_a and b >= low_b:
            return self
        return Lowest(a if a < low_a else low_a, b if b < low_b else low_b)


def pressure_remarks(file: MachineFile, actuator: Actuator, lowest: Lowest) -> list[str]:
    """What the lowest pressures of an actuator say is likely to be wrong with ``absolute``, one line for each chamber.

    A ``sensor_msgs/FluidPressure`` is absolute by its definition, so ``absolute: false`` is doubted until a chamber
    falls below ambient pressure. Other messages are gauge unless the file says otherwise. They are doubted only if they
    fall to ambient pressure and never below it, since a chamber under load stays above.
    """
    signals = [actuator.inputs.get(name) for name in ('pressure_a', 'pressure_b')]
    measured = [low for low, signal in zip(lowest, signals, strict=True) if isinstance(signal, Signal)]
    is_ever_unloaded = any(low <= LOWEST_ABSOLUTE for low in measured)
    remarks = []
    for name, signal, low in zip(('pressure_a', 'pressure_b'), signals, lowest, strict=True):
        if not isinstance(signal, Signal) or not math.isfinite(low):
            continue
        highest = math.inf if file.topics[signal.topic] == machine_file.FLUID_PRESSURE else HIGHEST_AMBIENT
        if signal.absolute and low < LOWEST_GAUGE:
            raw = low + machine_file.STANDARD_ATMOSPHERE
            kpa = f'; if it is in kPa, write unit: kPa ({raw:.4g} in the message)' if raw > LOWEST_IN_KPA else ''
            what = f'{name} falls to {low:.3g} Pa with ambient pressure taken off'
            remarks.append(f'{what}: if it is gauge, write absolute: false{kpa}')
        elif not signal.absolute and not is_ever_unloaded and LOWEST_ABSOLUTE < low <= highest:
            remarks.append(f'{name} is never below {low:.3g} Pa: if it is absolute, write absolute: true')
    return remarks
