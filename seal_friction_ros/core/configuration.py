"""All that the estimator was told, as one text: published with the estimates and kept in every bag.

So a bag carries what is needed to replay it, also when parameters changed on the way.
"""

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from seal_friction_ros.core.estimator import EstimatorParameters, EstimatorSettings, EstimatorState
from seal_friction_ros.core.held_inputs import HeldInputs
from seal_friction_ros.core.records import Force, Pressure
from seal_friction_ros.core.seal_file import mount_seals
from seal_friction_ros.core.validated import check, from_mapping, parameter


@dataclass(frozen=True)
class SealSelection:
    """Which seals the actuator has, one ROS parameter per field.

    Raises:
        ValueError: There are not as many chambers as seals, or none.
    """

    seals: tuple[str, ...] = parameter(
        ('ms28775_114', 'ms28775_114'),
        unit='',
        live=False,
        description='Seal file of each seal: a path, or the name of one in config/seals.',
    )
    seal_chambers: tuple[str, ...] = parameter(
        ('a', 'b'), unit='', live=False, description='Chamber whose pressure each seal sees: a or b.'
    )

    def __post_init__(self) -> None:
        check(self)
        if not self.seals:
            raise ValueError('SealSelection.seals is empty: name at least one seal')
        if len(self.seals) != len(self.seal_chambers):
            raise ValueError(
                f'SealSelection.seal_chambers = {list(self.seal_chambers)} has {len(self.seal_chambers)} entries '
                f'but there are {len(self.seals)} seals: give one chamber a seal'
            )
        wrong = [chamber for chamber in self.seal_chambers if chamber not in ('a', 'b')]
        if wrong:
            raise ValueError(
                f'SealSelection.seal_chambers = {list(self.seal_chambers)}: {wrong[0]!r} is neither a nor b'
            )


@dataclass(frozen=True)
class Configuration:
    """What the estimator runs with, in the form it came in."""

    selection: SealSelection
    seal_documents: tuple[Mapping[str, Any], ...]
    settings: EstimatorSettings

    def parameters(self) -> EstimatorParameters:
        """Parameters of the estimator.

        Raises:
            ValueError: A seal document makes no sense.
        """
        return EstimatorParameters(self.settings, mount_seals(self.seal_documents, self.selection.seal_chambers))


class Snapshot(NamedTuple):
    """All that the next estimate depends on besides the inputs to come."""

    configuration: Configuration
    state: EstimatorState
    held: HeldInputs


def snapshot_text(snapshot: Snapshot) -> str:
    """Snapshot as JSON; equal ones give equal text. Measured values are hexadecimal, so also NaN and infinity pass."""
    configuration, state, held = snapshot
    document = {
        'selection': dataclasses.asdict(configuration.selection),
        'seal_documents': configuration.seal_documents,
        'settings': dataclasses.asdict(configuration.settings),
        'state': {
            'stamp': state.stamp,
            'at_rest': state.at_rest,
            'pressure': _stamped_text(state.pressure),
            'force': _stamped_text(state.force),
        },
        'held': {'pressure': _stamped_text(held.pressure), 'force': _stamped_text(held.force)},
    }
    return json.dumps(document, sort_keys=True, allow_nan=False)


def parse_snapshot(text: str) -> Snapshot:
    """Snapshot from its JSON text.

    Raises:
        ValueError: The text is not the JSON of a snapshot, or a value in it makes no sense.
    """
    try:
        document = json.loads(text)
        configuration = Configuration(
            from_mapping(SealSelection, document['selection'], 'configuration: selection'),
            tuple(document['seal_documents']),
            from_mapping(EstimatorSettings, document['settings'], 'configuration: settings'),
        )
        state, held = document['state'], document['held']
        stamp = None if state['stamp'] is None else int(state['stamp'])
        usable = _parse_pressure(state['pressure']), _parse_force(state['force'])
        if not all(math.isfinite(x) for sample in usable if sample is not None for x in sample[1:]):
            raise ValueError('configuration: a pressure or force sum in use is not finite')
        newest = _parse_pressure(held['pressure']), _parse_force(held['force'])
        return Snapshot(configuration, EstimatorState(stamp, bool(state['at_rest']), *usable), HeldInputs(*newest))
    except (TypeError, LookupError, OverflowError, RecursionError) as error:
        raise ValueError(f'configuration: not the JSON of a snapshot: {type(error).__name__}: {error}') from None


def _stamped_text(sample: Pressure | Force | None) -> list[int | str] | None:
    return None if sample is None else [sample.stamp, *(float(value).hex() for value in sample[1:])]


def _parse_pressure(values: Any) -> Pressure | None:
    return None if values is None else Pressure(int(values[0]), float.fromhex(values[1]), float.fromhex(values[2]))


def _parse_force(values: Any) -> Force | None:
    return None if values is None else Force(int(values[0]), float.fromhex(values[1]))
