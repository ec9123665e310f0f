"""All that the estimator was told, as one text: published with the estimates and kept in every bag.

So a bag carries what is needed to replay it, also when parameters changed on the way.
"""

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

from seal_friction_ros.core.estimator import EstimatorParameters, EstimatorSettings, EstimatorState
from seal_friction_ros.core.feedforward import FeedForwardSettings, FeedForwardState
from seal_friction_ros.core.pipeline import PipelineParameters, PipelineState, init
from seal_friction_ros.core.records import Force, FrictionEstimate, FrictionState, Pressure
from seal_friction_ros.core.seal_file import mount_seals
from seal_friction_ros.core.validated import check, from_mapping, parameter
from seal_friction_ros.core.wire import ServoReference

Record = TypeVar('Record')


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
    feedforward: FeedForwardSettings

    def parameters(self) -> PipelineParameters:
        """Parameters of estimate and feed-forward.

        Raises:
            ValueError: A seal document makes no sense.
        """
        seals = mount_seals(self.seal_documents, self.selection.seal_chambers)
        return PipelineParameters(EstimatorParameters(self.settings, seals), self.feedforward)


class Snapshot(NamedTuple):
    """All that the next answer depends on besides the messages to come."""

    configuration: Configuration
    state: PipelineState


def first_snapshot(configuration: Configuration) -> Snapshot:
    """Snapshot before the first message."""
    return Snapshot(configuration, init(configuration.parameters()))


def snapshot_text(snapshot: Snapshot) -> str:
    """Snapshot as JSON; equal ones give equal text. Measured values are hexadecimal, so also NaN and infinity pass."""
    configuration, state = snapshot
    estimator, feedforward = state.estimator, state.feedforward
    document = {
        'selection': dataclasses.asdict(configuration.selection),
        'seal_documents': configuration.seal_documents,
        'settings': dataclasses.asdict(configuration.settings),
        'feedforward': dataclasses.asdict(configuration.feedforward),
        'state': {
            'estimator': {
                'stamp': estimator.stamp,
                'at_rest': estimator.at_rest,
                'pressure': _text(estimator.pressure),
                'force': _text(estimator.force),
            },
            'feedforward': {
                'stamp': feedforward.stamp,
                'values': _text((feedforward.force, feedforward.fade, feedforward.velocity)),
                'estimate': _text(feedforward.estimate),
            },
            'pressure': _text(state.pressure),
            'force': _text(state.force),
            'reference': _text(state.reference[:4] if state.reference is not None else None),
        },
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
            from_mapping(FeedForwardSettings, document['feedforward'], 'configuration: feedforward'),
        )
        state = document['state']
        newest = (
            _parse(Pressure, state['pressure']),
            _parse(Force, state['force']),
            _parse(ServoReference, state['reference']),
        )
        parsed = PipelineState(_parse_estimator(state['estimator']), _parse_feedforward(state['feedforward']), *newest)
        return Snapshot(configuration, parsed)
    except (TypeError, LookupError, OverflowError, RecursionError) as error:
        raise ValueError(f'configuration: not the JSON of a snapshot: {type(error).__name__}: {error}') from None


def _parse_estimator(state: Any) -> EstimatorState:
    usable = _parse(Pressure, state['pressure']), _parse(Force, state['force'])
    _check_finite(*usable)
    return EstimatorState(_parse_stamp(state['stamp']), bool(state['at_rest']), *usable)


def _parse_feedforward(state: Any) -> FeedForwardState:
    force, fade, velocity = map(float.fromhex, state['values'])
    estimate = _parse(FrictionEstimate, state['estimate'])
    if estimate is not None:
        kind = FrictionState(int(estimate.state))
        estimate = estimate._replace(state=kind, direction=int(estimate.direction), status=int(estimate.status))
    _check_finite((0, force, fade, velocity), estimate)
    return FeedForwardState(_parse_stamp(state['stamp']), force, fade, estimate, velocity)


def _check_finite(*samples: tuple[float, ...] | None) -> None:
    if not all(math.isfinite(value) for sample in samples if sample is not None for value in sample):
        raise ValueError('configuration: a number in the state is not finite')


def _parse_stamp(stamp: Any) -> int | None:
    return None if stamp is None else int(stamp)


def _text(values: tuple[float, ...] | None) -> list[int | str] | None:
    """Whole numbers as they are, others as hexadecimal text."""
    return None if values is None else [int(v) if isinstance(v, int) else float(v).hex() for v in values]


def _parse(record_type: Callable[..., Record], values: Any) -> Record | None:
    """Named tuple from what `_text` made of it."""
    if values is None:
        return None
    stamp, *rest = values
    return record_type(int(stamp), *(float.fromhex(value) if isinstance(value, str) else int(value) for value in rest))
