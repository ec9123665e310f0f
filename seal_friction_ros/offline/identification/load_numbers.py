"""Numbers and text of a load that was fitted over position."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from seal_friction_ros.core.identification.load_over_position import LoadOverPosition, load_at
from seal_friction_ros.offline.work.seal_writer import rounded_numbers

POINTS = 21  # equally spaced positions at which the load is given (our choice)


def load_numbers(loads: Sequence[tuple[str, LoadOverPosition | None]]) -> dict[str, Any] | None:
    """Loads for JSON: that of the first log that has one, and with several logs those of the others in ``others``.

    ``loads`` are name and load of each source. None if no load was fitted.
    """
    found = [_one(name, load) for name, load in loads if load is not None]
    if not found:
        return None
    return found[0] | ({'others': found[1:]} if len(found) > 1 else {})


def _one(name: str, load: LoadOverPosition) -> dict[str, Any]:
    position = np.linspace(load.knots[0], load.knots[-1], POINTS)
    position[-1] = load.knots[-1]
    numbers: dict[str, Any] = rounded_numbers(
        {
            'source': name,
            'position_m': position,
            'force_N': load_at(load, position),
            'std_N': np.interp(position, load.knots, load.std),
            'mass_kg': load.mass,
            'mass_std_kg': load.mass_std,
            'mass_change_kg_per_m': load.mass_change,
            'noise_N': load.noise,
            'strokes': load.strokes,
            'condition_number': load.condition_number,
            'friction_N': load.friction.mean,
            'friction_standard_error_N': load.friction.standard_error,
            'friction_terms': dict(zip(load.friction.names, load.friction.values.tolist(), strict=True)),
            'warnings': load.warnings,
        }
    )
    return numbers


def load_text(load: LoadOverPosition) -> str:
    """One line about the load."""
    return (
        f'a load of {float(load.forces.min()):.4g} to {float(load.forces.max()):.4g} N over {load.knots[0]:.4g} to '
        f'{load.knots[-1]:.4g} m (standard deviation {float(load.std.mean()):.2g} N) and the inertia of '
        f'{load.mass:.4g} kg were fitted and taken out of the force sum; samples at other positions are not used'
    )
