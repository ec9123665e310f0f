"""A seal file with the friction that the adaptation has learnt."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from seal_friction_ros.core.estimation.adaptation import NOT_ADAPTED, learnt
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.files import config_path, read_yaml
from seal_friction_ros.offline.replay.bag_health import bag_health
from seal_friction_ros.offline.replay.replay import chosen_configuration
from seal_friction_ros.offline.work.seal_writer import rounded, write_seal


def write_adapted_seal(bags: Sequence[Path], seal: Path, out: Path, namespace: str = '') -> dict[str, Any]:
    """Write ``seal`` with the scale learnt from bags, in order of time, as its ``friction_scale``; the numbers learnt.

    The standard deviation stays that of the file: the scale is that of these days, and the next day differs again.
    ValueError: a bag or the seal file cannot be used, or the last bag has too few reversals to learn from.
    """
    override = chosen_configuration(None, seal)
    state = None
    for bag in bags:
        state = bag_health(bag, namespace, override, state).learnt or state
    found = learnt(state or NOT_ADAPTED)
    if found.scale_std < 0.0:
        hint = 'move the rod to and fro at least four times, or give adaptation.moving_mass'
        raise ValueError(f'{bags[-1]}: too few reversals at even speed to learn a scale: {hint}')
    document = dict(read_yaml(config_path('seals', str(seal))))
    before = parse_seal(document).friction_scale
    document['friction_scale'] = rounded(before * found.scale, 6)
    document['source'] = (
        f'{document.get("source", "")} Friction scaled by {found.scale:.4g} by seal_friction adapt, standard deviation '
        f'{found.scale_std:.2g}, {found.reversals} reversals of {", ".join(bag.name for bag in bags)}.'
    ).strip()
    write_seal(document, out, 'Seal file, made by seal_friction adapt.')
    return {
        'scale': found.scale,
        'scale_std': found.scale_std,
        'offset_N': found.offset,
        'noise_N': found.noise if math.isfinite(found.noise) else None,
        'reversals': found.reversals,
        'friction_scale': document['friction_scale'],
    }
