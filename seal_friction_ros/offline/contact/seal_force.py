"""Friction of a seal file or an O-ring case at given pressures and a speed: the calculator ``seal_friction force``."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.normal_distribution import BAND_95
from seal_friction_ros.core.foundation.units import BAR
from seal_friction_ros.core.friction.actuator import MountedSeal, Seal, actuator_friction
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import read_yaml


@dataclass(frozen=True)
class SealForces:
    """Friction of some equal seals, one number per pressure."""

    seal: str
    seals: int
    speed_m_s: float
    pressure_Pa: tuple[float, ...]
    friction_N: tuple[float, ...]  # sliding on extension
    friction_on_retraction_N: tuple[float, ...]
    breakaway_N: tuple[float, ...]
    friction_std_N: tuple[float, ...]
    friction_low_N: tuple[float, ...]  # ends of the band with 95 % of new readings, not below 0
    friction_high_N: tuple[float, ...]
    in_identified_range: tuple[bool, ...]  # pressure and speed

    def text(self) -> str:
        """Lines for a person."""
        columns = (
            self.pressure_Pa, self.friction_N, self.friction_low_N, self.friction_high_N, self.breakaway_N,
            self.in_identified_range,
        )  # fmt: skip
        lines = [f'{self.seal}, {self.seals} seal{"s" if self.seals > 1 else ""}, {self.speed_m_s * 1e3:g} mm/s']
        for pressure, friction, low, high, breakaway, inside in zip(*columns, strict=True):
            beyond = '' if inside else '; outside the identified range'
            lines.append(
                f'  {pressure / BAR:8.2f} bar: friction {friction:.3g} N, 95 % band {low:.3g} to {high:.3g} N, '
                f'breakaway {breakaway:.3g} N{beyond}'
            )
        return '\n'.join(lines)


def seal_of(path: Path) -> Seal:
    """Seal of a seal file, or of an O-ring case, which is computed.

    ValueError: the file is neither, or the case cannot be computed.
    """
    document = read_yaml(path)
    if isinstance(document, dict) and 'groove' in document:
        from seal_friction_ros.offline.contact.oring_runs import (  # noqa: PLC0415  loads scipy
            Task,
            compute_case,
            seal_document,
        )

        document = seal_document(compute_case(path, Task(for_seal_file=True)))
    with named_errors(path):
        return parse_seal(document)


def seal_forces(path: Path, pressures: Sequence[float], speed: float, seals: int) -> SealForces:
    """Friction of ``seals`` equal seals at each pressure [Pa, gauge] and ``speed`` [m/s, 0: Coulomb friction].

    ValueError: as of `seal_of`.
    """
    seal = seal_of(path)
    mounted = seals * (MountedSeal(seal, 'a'),)
    out = [actuator_friction(mounted, pressure, 0.0, speed) for pressure in pressures]
    back = [actuator_friction(mounted, pressure, 0.0, -speed) for pressure in pressures]
    friction = tuple(found.coulomb_friction + found.velocity_friction for found in out)
    std = tuple(found.coulomb_friction_std for found in out)
    motion = seal.identified_motion
    knows_speed = speed == 0.0 or motion.slowest <= speed <= motion.fastest
    return SealForces(
        seal=seal.name,
        seals=seals,
        speed_m_s=speed,
        pressure_Pa=tuple(pressures),
        friction_N=friction,
        friction_on_retraction_N=tuple(found.coulomb_friction + found.velocity_friction for found in back),
        breakaway_N=tuple(found.coulomb_friction + found.stiction for found in out),
        friction_std_N=std,
        friction_low_N=tuple(max(f - BAND_95 * s, 0.0) for f, s in zip(friction, std, strict=True)),
        friction_high_N=tuple(f + BAND_95 * s for f, s in zip(friction, std, strict=True)),
        in_identified_range=tuple(found.in_identified_range and knows_speed for found in out),
    )
