"""All that the estimator was told, as one text: published with the estimates and kept in every bag.

So a bag carries what is needed to replay it, also when parameters changed on the way.
"""

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from seal_friction_ros.core.estimator import EstimatorParameters, EstimatorSettings
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


def configuration_text(configuration: Configuration) -> str:
    """Configuration as JSON; equal configurations give equal text."""
    document = {
        'selection': dataclasses.asdict(configuration.selection),
        'seal_documents': configuration.seal_documents,
        'settings': dataclasses.asdict(configuration.settings),
    }
    return json.dumps(document, sort_keys=True, allow_nan=False)


def parse_configuration(text: str) -> Configuration:
    """Configuration from its JSON text.

    Raises:
        ValueError: The text is not the JSON of a configuration, or a value in it makes no sense.
    """
    document = json.loads(text)
    if not isinstance(document, dict) or set(document) != {'selection', 'seal_documents', 'settings'}:
        raise ValueError('configuration: not the JSON of selection, seal_documents and settings')
    return Configuration(
        from_mapping(SealSelection, document['selection'], 'configuration: selection'),
        tuple(document['seal_documents']),
        from_mapping(EstimatorSettings, document['settings'], 'configuration: settings'),
    )
