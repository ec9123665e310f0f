"""What the adaptation learns from a bag: one row a reversal, and what the residuals and starts say between them.

The bag runs through the compiled estimator with ``adaptation.mode`` observe, in blocks, so that memory does not grow
with its length.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.estimation.adaptation import NOT_ADAPTED, AdaptationState
from seal_friction_ros.core.estimation.adaptation import learnt as learnt_of
from seal_friction_ros.core.estimation.compiled_pipeline import Answers
from seal_friction_ros.core.estimation.configuration import Configuration, Snapshot
from seal_friction_ros.core.estimation.findings import GOOD
from seal_friction_ros.core.estimation.friction_filter import PROVEN
from seal_friction_ros.core.estimation.seal_health import START, Starts, with_sample
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.core.friction.states import SLIDING
from seal_friction_ros.core.identification import admission
from seal_friction_ros.core.identification.admission import Account, account, together
from seal_friction_ros.core.messages.blocks import Messages, UnsuitedError, numbers_of
from seal_friction_ros.core.messages.layouts import ESTIMATE_TYPE
from seal_friction_ros.core.messages.records import NEVER, NO_ESTIMATE, FrictionEstimate, Status
from seal_friction_ros.files import config_path, default_configuration, read_yaml
from seal_friction_ros.offline.bags.actuator_bag import open_actuator
from seal_friction_ros.offline.bags.bag import BagError
from seal_friction_ros.offline.bags.mapped_bag import MappingFile
from seal_friction_ros.offline.bags.mcap_reader import ERRORS
from seal_friction_ros.offline.replay.bag_parts import Chosen, try_bags
from seal_friction_ros.offline.replay.compiled_replay import Run, compile_first, kinds_of_topics
from seal_friction_ros.offline.replay.replay import chosen_configuration
from seal_friction_ros.offline.replay.run_findings import verdict_in_words
from seal_friction_ros.offline.work.executor import Workers
from seal_friction_ros.offline.work.finished_parts import NOWHERE, Kept
from seal_friction_ros.offline.work.outcome import Outcome
from seal_friction_ros.offline.work.places import Place
from seal_friction_ros.offline.work.seal_writer import rounded, write_seal


class BagHealth(NamedTuple):
    """What a bag shows; arrays of shape (n,), one value a reversal."""

    time: FloatArray  # [s] stamps
    scale: FloatArray  # [-]
    scale_std: FloatArray  # [-]
    offset: FloatArray  # [N] at the end of a stroke
    friction: FloatArray  # [N] Coulomb friction by the seal file
    noise: float  # [N] standard deviation of the residual at even speed, at the end; NaN if none was seen
    starts: FloatArray  # [-] largest friction of each start after a rest, over the Coulomb friction then
    learnt: AdaptationState | None = None  # at the end; None if the bag has no estimate, or it was not asked for
    level: str = GOOD  # verdict on the run, if it was asked for
    why: str = ''
    next: str = ''
    used: int = 0  # samples that friction is learnt from
    left_out: Mapping[str, int] = {}  # reason -> number of samples


def bag_health(
    bag: Path,
    namespace: str = '',
    override: Configuration | None = None,
    learnt: AdaptationState | None = None,
    on_block: Callable[[Messages, Answers, Any], None] = lambda *_: None,
    mapping: MappingFile | None = None,
) -> BagHealth:
    """Health from one bag; BagError: the bag cannot be read, or not in blocks, or most of its samples are faulty.

    The ``override`` is the configuration instead of the recorded one; its mode counts as observe. ``learnt`` is what
    was learnt from the bags before. ``on_block`` is called with each block of messages, the answers to them, and the
    estimates among these as a structured array with the fields of `FrictionEstimate`. ``namespace`` and ``mapping`` as
    of `open_actuator`.
    """
    rows: list[FloatArray] = []
    starts: list[float] = []
    end, follower, strokes, accounts = learnt, Starts(), _Strokes(), [Account('', 0, {})]
    source = open_actuator(bag, namespace, mapping)
    run = _Observer(_observing(override or default_configuration()), has_override=override is not None)
    if learnt is not None:
        run.state.estimator.adaptation = learnt
    try:
        for messages, answers in run.answered(source.blocks(kinds_of_topics(source.topics))):
            estimates = _estimates(answers)
            on_block(messages, answers, estimates)
            if len(estimates):
                end = run.state.estimator.adaptation
                accounts.append(_account(estimates))
                rows.append(strokes.ends(estimates))
                follower, found = _with_block(follower, estimates)
                starts += found
    except (UnsuitedError, OSError, *ERRORS) as error:
        raise BagError(f'{bag}: {error}: `seal_friction replay` tells more') from None
    samples = together(accounts)._replace(name='')
    with named_errors(bag, raised=BagError):
        samples.check()
    table = np.concatenate(rows, axis=1) if rows else np.zeros((5, 0))
    table = table[:, np.append(True, np.diff(table[1]) != 0.0)] if table.shape[1] else table  # nothing learnt between
    noise = learnt_of(end).noise if end is not None and end.filter.stamp != NEVER else float('nan')
    time, scale, scale_std, offset, friction = table
    seen = BagHealth(time, scale, scale_std, offset, friction, noise, np.array(starts), end)
    return seen._replace(used=samples.used, left_out=samples.left_out)


_REASONS = {
    admission.OLD_STAMP: Status.STAMP_NOT_INCREASING,
    admission.NOT_STARTED: Status.PRESSURE_MISSING | Status.FORCE_MISSING,
    admission.NOT_FINITE: Status.PRESSURE_NOT_FINITE | Status.FORCE_NOT_FINITE | Status.VELOCITY_NOT_FINITE,
    admission.BAD_INPUT: Status.PRESSURE_STALE | Status.FORCE_STALE | Status.PRESSURE_OUT_OF_RANGE
    | Status.FORCE_OUT_OF_RANGE | Status.VELOCITY_OUT_OF_RANGE | Status.PRESSURE_LEAP | Status.FORCE_LEAP
    | Status.VELOCITY_LEAP,
}  # fmt: skip


def _account(estimates: Any) -> Account:
    """Samples that were estimated while the rod slid, and why the others do not tell the friction."""
    reasons = {reason: (estimates['status'] & int(bits)) != 0 for reason, bits in _REASONS.items()}
    return account('', {**reasons, admission.AT_REST: estimates['state'] != SLIDING})


def health_of_bags(
    bags: Sequence[Place], chosen: Chosen, workers: Workers = 1, kept: Kept = NOWHERE
) -> list[Outcome[BagHealth]]:
    """`bag_health` of each bag with its verdict, in their order; arguments and errors as of `try_bags`.

    The estimator is compiled once before the worker processes begin; a cluster compiles once for each of its workers.
    """
    return try_bags('health', bags, BagHealth, _health, chosen, workers, kept, partial(compile_first, bags, chosen))


def _health(bag: Path, chosen: Chosen) -> BagHealth:
    seen = bag_health(bag, chosen.namespace, chosen.override, mapping=chosen.mapping)
    level, why, after = verdict_in_words(bag, chosen)
    return seen._replace(learnt=None, level=level, why=why, next=after)


class _Strokes:
    """Estimates at the ends of strokes, across blocks of estimates."""

    def __init__(self) -> None:
        self._last: Any = None

    def ends(self, estimates: Any) -> FloatArray:
        """Stamp [s], scale, its deviation, offset and Coulomb friction at each reversal, of shape (5, n)."""
        sliding = estimates[estimates['state'] == SLIDING]
        if self._last is not None:
            sliding = np.concatenate([self._last, sliding])
        if not len(sliding):
            return np.zeros((5, 0))
        self._last = sliding[-1:]
        ends = sliding[:-1][np.diff(sliding['direction']) != 0]
        scale_std = ends['adaptation_scale_std']
        ends = ends[(scale_std > 0.0) & (scale_std <= PROVEN)]
        names = ('adaptation_scale', 'adaptation_scale_std', 'adaptation_offset', 'coulomb_friction')
        return np.array([ends['stamp'] * 1e-9, *(ends[name] for name in names)])


def _with_block(starts: Starts, estimates: Any) -> tuple[Starts, list[float]]:
    """Starts after a block of estimates, and the largest friction of each start that ended in it.

    Starts follow from few estimates: around each turn, within `START` after it, and the next one.
    """
    found = []
    stamps, slides = estimates['stamp'], estimates['state'] == SLIDING
    turns = np.flatnonzero(np.append(True, slides[1:] != slides[:-1]))
    ends = (np.searchsorted(stamps, stamps[turns] + START, 'right') + 1).tolist()
    near = [np.arange(max(turn - 1, 0), min(end, len(stamps))) for turn, end in zip(turns.tolist(), ends, strict=True)]
    for i in np.unique(np.concatenate([*near, [len(stamps) - 1]])).tolist():
        after = with_sample(starts, FrictionEstimate(*estimates[i].tolist()))
        found += [starts.largest] if after.number > starts.number else []
        starts = after
    return starts, found


class _Observer(Run):
    """Estimator with ``adaptation.mode`` observe, which keeps what it has learnt when the configuration changes."""

    def configure(self, snapshot: Snapshot) -> None:
        learnt = self.state.estimator.adaptation
        super().configure(snapshot._replace(configuration=_observing(snapshot.configuration)))
        self.state.estimator.adaptation = learnt


def _observing(configuration: Configuration) -> Configuration:
    return dataclasses.replace(configuration, adaptation=dataclasses.replace(configuration.adaptation, mode='observe'))


def _estimates(answers: Answers) -> Any:
    """The estimates of a block as a structured array with the fields of `FrictionEstimate`."""
    places = np.flatnonzero(answers.estimate_sizes)
    offsets, sizes = answers.estimate_offsets[places], answers.estimate_sizes[places]
    made = Messages(answers.data, np.zeros(len(places), np.uint8), offsets, sizes, offsets, offsets)
    _, stamps, numbers = numbers_of(made, 0, ESTIMATE_TYPE)
    kinds = [(name, '<i8' if isinstance(value, int) else '<f8') for name, value in NO_ESTIMATE._asdict().items()]
    found = np.zeros(len(places), kinds)
    for (name, _), column in zip(kinds, (stamps, *numbers), strict=True):
        found[name] = column
    return found


def write_adapted_seal(bags: Sequence[Path], seal: Path, out: Path, namespace: str = '') -> dict[str, Any]:
    """Write ``seal`` with the scale learnt from bags, in order of time, as its ``friction_scale``; the numbers learnt.

    The standard deviation stays that of the file: the scale is that of these days, and the next day differs again.
    ValueError: a bag or the seal file cannot be used, or the last bag has too few reversals to learn from.
    """
    override = chosen_configuration(None, seal)
    state = None
    for bag in bags:
        state = bag_health(bag, namespace, override, state).learnt or state
    found = learnt_of(state or NOT_ADAPTED)
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
