"""Configuration and state of the estimator as one text, published with the estimates and recorded in every bag.

A bag therefore carries everything needed to replay it, also when parameters changed during the recording.
"""

import dataclasses
import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, get_type_hints

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.estimator import DEFAULT_ADAPTATION, EstimatorParameters, EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, PipelineState, init
from seal_friction_ros.core.foundation.documents import parse_json
from seal_friction_ros.core.foundation.parameters import check, from_mapping, meanings, parameter
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.mounting import CHAMBERS_TEXT, check_chambers
from seal_friction_ros.core.friction.seal_file import mount_seals, mounting_of
from seal_friction_ros.core.messages.records import Force, Pressure, field_names, numbers_in

PLACEHOLDER = 'placeholder'
"""Seal file of the default configuration."""
PLACEHOLDER_WARNING = (
    'the seals are the placeholder of the default configuration, not those of your machine, so they make no force: '
    'set seals to their seal files'
)
MOUNTING = ('mounting',)
"""Value of `SealSelection.seal_chambers`: the chambers are those in ``seals``, or else of the seal files."""
_USUAL_CHAMBERS = ('a', 'b')  # of two seals whose files do not tell: one at each end of the cylinder (our choice)
_DEFAULT_OF_VERSION_1 = ('ms28775_114', 'ms28775_114')


@dataclass(frozen=True)
class SealSelection:
    """Which seals the actuator has, one ROS parameter per field.

    ``NAME@CHAMBER`` in ``seals`` is split: the record has the names in ``seals`` and the chambers in ``seal_chambers``.

    Raises:
        ValueError: There are not as many chambers as seals, or none, or a chamber is not known, or only some of the
            seals have one.
    """

    seals: tuple[str, ...] = parameter(
        (PLACEHOLDER, PLACEHOLDER),
        unit='',
        live=False,
        description='Seal file of each seal: a path, or the name of one in config/seals. NAME@CHAMBER names the '
        f'chamber that it sees, too: {CHAMBERS_TEXT}. Without @CHAMBER: as the seal file says.',
    )
    seal_chambers: tuple[str, ...] = parameter(
        MOUNTING,
        unit='',
        live=False,
        description='Earlier form of NAME@CHAMBER: the chamber of each seal. [mounting]: not used.',
    )

    def __post_init__(self) -> None:
        check(self)
        if not self.seals:
            raise ValueError('SealSelection.seals is empty: name at least one seal')
        if self.seal_chambers == MOUNTING:
            if not any(map(names_chamber, self.seals)):
                return
            names, _, chambers = zip(*(seal.rpartition('@') for seal in self.seals), strict=True)
            if not all(map(names_chamber, self.seals)):
                raise ValueError(
                    f'SealSelection.seals = {list(self.seals)}: give every seal its chamber (NAME@CHAMBER), or none'
                )
            check_chambers('SealSelection.seals', chambers)
            object.__setattr__(self, 'seals', names)
            object.__setattr__(self, 'seal_chambers', chambers)
        if len(self.seals) != len(self.seal_chambers):
            raise ValueError(
                f'SealSelection.seal_chambers = {list(self.seal_chambers)} has {len(self.seal_chambers)} entries '
                f'but there are {len(self.seals)} seals: give one chamber a seal, or set it to [mounting] and write '
                'the chambers in seals: NAME@CHAMBER'
            )
        check_chambers('SealSelection.seal_chambers', self.seal_chambers)


def names_chamber(seal: str) -> bool:
    """Whether an entry of ``seals`` ends in ``@CHAMBER``, known or not; a path may have an @ in its folders or name."""
    name, _, chamber = seal.rpartition('@')
    return bool(name) and chamber.isidentifier()


def mounted(
    selection: SealSelection, documents: Sequence[Mapping[str, Any]]
) -> tuple[SealSelection, tuple[Mapping[str, Any], ...]]:
    """Selection and documents with one entry for each seal, and its chamber.

    With `MOUNTING`, a seal file that is named once stands for as many seals as its ``mounting`` has chambers. Two seals
    whose files have no mounting are on chambers a and b.

    Args:
        selection: As the parameters have it.
        documents: Seal file of each of its entries.

    Raises:
        ValueError: Only some of the files have a mounting, a file is named another number of times, or the chambers of
            other than two seals are not known.
    """
    if selection.seal_chambers != MOUNTING:
        return selection, tuple(documents)
    named = Counter(selection.seals)
    files = dict(zip(selection.seals, documents, strict=True))
    mountings = {name: mounting_of(document) for name, document in files.items()}
    if not any(mountings.values()) and len(documents) == len(_USUAL_CHAMBERS):
        return dataclasses.replace(selection, seal_chambers=_USUAL_CHAMBERS), tuple(documents)
    seals: list[tuple[str, str]] = []
    for name, mounting in mountings.items():
        if mounting is None:
            raise ValueError(f'{name} has no mounting: give every entry its chamber (NAME@CHAMBER)')
        if named[name] not in (1, len(mounting.chambers)):
            raise ValueError(
                f'seals has {name} {named[name]} times but its mounting has {len(mounting.chambers)} chambers: name it '
                'once, or give every entry its chamber (NAME@CHAMBER)'
            )
        seals += [(name, chamber) for chamber in mounting.chambers]
    names, chambers = zip(*seals, strict=True)
    return SealSelection(names, chambers), tuple(files[name] for name in names)


@dataclass(frozen=True)
class Configuration:
    """Seals and settings of the estimator, the seals as the documents of their files.

    Raises:
        ValueError: The selection does not have the chamber of each seal, see `mounted`.
    """

    selection: SealSelection
    seal_documents: tuple[Mapping[str, Any], ...]
    settings: EstimatorSettings
    feedforward: FeedForwardSettings
    adaptation: AdaptationSettings = DEFAULT_ADAPTATION

    def __post_init__(self) -> None:
        if self.selection.seal_chambers == MOUNTING:
            raise ValueError('Configuration.selection does not have the chamber of each seal')

    @property
    def has_placeholder(self) -> bool:
        """Whether a seal is the placeholder of the default configuration."""
        return PLACEHOLDER in self.selection.seals

    def without_placeholder_force(self) -> 'Configuration':
        """The same, but without feed-forward if a seal is the placeholder."""
        if not self.has_placeholder:
            return self
        return dataclasses.replace(self, feedforward=dataclasses.replace(self.feedforward, scale=0.0))

    @property
    def tells_sending(self) -> bool:
        """Whether a bag with this configuration has as publish time when a message was sent, on the clock of receipt.

        Older bags have another time there.
        """
        return self.feedforward.lateness_max > 0.0

    def parameters(self, mounted_seals: tuple[MountedSeal, ...] | None = None) -> PipelineParameters:
        """Parameters of estimate and feed-forward.

        Args:
            mounted_seals: The seals, if they are made already, which takes a millisecond.

        Raises:
            ValueError: A seal document is not valid.
        """
        seals = mounted_seals or mount_seals(self.seal_documents, self.selection.seal_chambers)
        return PipelineParameters(EstimatorParameters(self.settings, seals, self.adaptation), self.feedforward)


ALGORITHM_VERSION = 15
"""Version of estimator and feed-forward: it changes when the same messages give other bytes.

1: until the feed-forward had one gain, and time was the stamps of the messages. 2: until one filter learnt the
friction. 3: until its noise was a share of the usual friction. 5: until it told the law's misfit at a pressure from the
scale. 6: until the band held what a direction shows beside the friction, and `friction_force` had one of its own. 7:
until a slow rod might be one at rest whose velocity has a zero. 8: until a rod that creeps was good. 9:
until a sudden change of the force sum at rest might be a load at the next reversal. 10: until the work of a stroke was
a reading, and the band just after a turn held both directions. 11: until even samples counted by their way in a stroke,
a step widened the band without a bit, and the prior of the asymmetry was 0.1. 12: until a drift below half the friction
widened the band without a bit. 13: until the moving mass was learnt from accelerations in place of the work of strokes,
and a friction that differs from that of the file by less than 1 % kept it. 14: until a step was one of the load unless
the next stroke showed friction, and the signals of a reading were means over two intervals.
"""

_RENAMED = {'coulomb_scale': 'scale'}  # settings of version 1
_WITHOUT = {'use_presliding': False}  # settings that older bags have not: without effect
_WITHOUT_LATENESS = {'lateness_max': 0.0}  # likewise of the feed-forward; the publish times of older bags tell nothing
_NOT_YET = {'stamp_age_max': 0.0}  # settings that version 1 had not: without effect


class Recorded(NamedTuple):
    """What acted when the bag was recorded that a bag of `replay` is made from."""

    feedforward: FeedForwardSettings | None  # None: not known


class Snapshot(NamedTuple):
    """Everything that the next answer depends on besides the messages to come."""

    configuration: Configuration
    state: PipelineState
    version: int = ALGORITHM_VERSION  # of the algorithm that recorded it
    recorded: Recorded | None = None  # None: recorded live; else the answers in the bag are replayed and did not act


def first_snapshot(configuration: Configuration) -> Snapshot:
    """Snapshot before the first message."""
    return Snapshot(configuration, init(configuration.parameters()))


def snapshot_text(snapshot: Snapshot) -> str:
    """Snapshot as JSON; equal snapshots give equal text. Numbers of the state are hexadecimal, NaN included."""
    return json.dumps(snapshot_document(snapshot), sort_keys=True, allow_nan=False)


def snapshot_document(snapshot: Snapshot) -> dict[str, Any]:
    """Snapshot for JSON, see `snapshot_text`."""
    configuration, state, version, recorded = snapshot
    document = {
        'version': version,
        'selection': vars(configuration.selection),
        'seal_documents': configuration.seal_documents,
        'settings': vars(configuration.settings),
        'feedforward': vars(configuration.feedforward),
        'adaptation': vars(configuration.adaptation),
        'state': _encoded_record(state),
    }
    if recorded is not None:
        acted = recorded.feedforward
        document['recorded'] = {'feedforward': vars(acted) if acted is not None else None}
    return document


def parse_snapshot(text: str) -> Snapshot:
    """Snapshot from its JSON text.

    Raises:
        ValueError: The text is not the JSON of a snapshot, a value in it is not valid, or a later version made it.
    """
    return parse_snapshot_document(parse_json(text, 'configuration'))


def parse_snapshot_document(document: Any) -> Snapshot:
    """Snapshot from its JSON document: inverse of `snapshot_document`.

    The default seals of version 1 had no mark: they count as `PLACEHOLDER`.

    Raises:
        ValueError: The document is not a snapshot, a value in it is not valid, or a later version made it.
    """
    try:
        version = int(document.get('version', 1))
        if version > ALGORITHM_VERSION:
            raise ValueError(
                f'configuration: made by version {version} of the algorithm, this is version {ALGORITHM_VERSION}: '
                'update seal_friction_ros'
            )
        selection = from_mapping(SealSelection, document['selection'], 'configuration: selection')
        if version == 1 and selection.seals == _DEFAULT_OF_VERSION_1:
            selection = dataclasses.replace(selection, seals=(PLACEHOLDER, PLACEHOLDER))
        configuration = Configuration(
            selection,
            tuple(document['seal_documents']),
            _settings(EstimatorSettings, _WITHOUT | document['settings'], version, 'configuration: settings'),
            _feedforward(document['feedforward'], version, 'configuration: feedforward'),
            from_mapping(AdaptationSettings, document.get('adaptation', {'mode': 'off'}), 'configuration: adaptation'),
        )
        state = _state(configuration, document['state'], version)
        return Snapshot(configuration, state, version, _recorded(document.get('recorded'), version))
    except (TypeError, AttributeError, LookupError, OverflowError) as error:
        raise ValueError(f'configuration: not the JSON of a snapshot: {type(error).__name__}: {error}') from None


def _recorded(document: Any, version: int) -> Recorded | None:
    if document is None:
        return None
    acted, where = document['feedforward'], 'configuration: recorded.feedforward'
    return Recorded(None if acted is None else _feedforward(acted, version, where))


def _feedforward(document: Any, version: int, where: str) -> FeedForwardSettings:
    """Settings of the feed-forward of a snapshot."""
    made: FeedForwardSettings = _settings(FeedForwardSettings, _WITHOUT_LATENESS | document, version, where)
    return made


def _settings(record_type: Any, document: Any, version: int, where: str) -> Any:
    """Settings of a snapshot; those of another version as far as they are settings still, within the present bounds."""
    if version == ALGORITHM_VERSION:
        return from_mapping(record_type, document, where)
    known = meanings(record_type)
    kept = {name: value for name, value in _NOT_YET.items() if name in known}
    for old_name, value in document.items():
        name = _RENAMED.get(old_name, old_name)
        if name in known:
            lower, upper = known[name].lower, known[name].upper
            kept[name] = value if lower is None or upper is None else min(max(value, lower), upper)
    return from_mapping(record_type, kept, where)


def _state(configuration: Configuration, document: Any, version: int) -> PipelineState:
    """State of the pipeline: inverse of `_encoded_record`; of another version only the newest inputs.

    Raises:
        ValueError: A computed number or a usable sample is not finite.
    """
    if version != ALGORITHM_VERSION:
        pressure, force = _parsed(Pressure, document['pressure']), _parsed(Force, document['force'])
        first = init(configuration.parameters())
        return dataclasses.replace(first, pressure=pressure, force=force, refused=bool(document['refused']))
    state: PipelineState = _parsed(PipelineState, document)
    computed = state.estimator, state.feedforward, state.friction, state.reference, state.temperature
    if not all(math.isfinite(number) for record in computed for number in numbers_in(record)):
        raise ValueError('configuration: a number in the state is not finite')
    return state


def _encoded_record(value: Any) -> Any:
    """Records as mappings, whole numbers as they are, others as hexadecimal text."""
    names = field_names(value)
    if names:
        return {name: _encoded_record(getattr(value, name)) for name in names}
    return value.hex() if isinstance(value, float) else int(value)


def _parsed(kind: Any, value: Any) -> Any:
    """Record or number: inverse of `_encoded_record`, with the declared type of each field."""
    if kind in (int, bool):
        return kind(int(value))
    if kind is float:
        return float.fromhex(value)
    return kind(**{name: _parsed(hint, value[name]) for name, hint in get_type_hints(kind).items()})
