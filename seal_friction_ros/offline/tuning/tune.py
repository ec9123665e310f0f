"""Parameters of the feed-forward for a plant, simulated or recorded, as a ROS parameter file with a report beside it.

The file holds every parameter of the feed-forward and nothing else. Nothing in it or in the report depends on when or
where they were made, so the same plant gives the same bytes.
"""

import os
import textwrap
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from seal_friction_ros.core.estimation.configuration import Configuration, parse_snapshot
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings, Motion
from seal_friction_ros.core.estimation.messages import (
    CONFIGURATION_TYPE,
    DECODERS,
    ESTIMATE_TYPE,
    FORCE_TYPE,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    decode,
    decode_text,
)
from seal_friction_ros.core.estimation.node_options import FEEDFORWARD_PREFIX
from seal_friction_ros.core.estimation.records import Force, FrictionEstimate, Position, ServoReference, Velocity
from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.servo.closed_loop import Axis
from seal_friction_ros.core.servo.position_servo import ServoParameters
from seal_friction_ros.core.tuning.recorded_axis import Match, Recording, match
from seal_friction_ros.core.tuning.settings import MatchSettings, TuningSettings
from seal_friction_ros.core.tuning.simulated_axis import MOST_CANDIDATES, Problem, Tuning, tune
from seal_friction_ros.files import default_configuration
from seal_friction_ros.offline.bags.bag import BagError, bag_topics, read_messages
from seal_friction_ros.offline.bags.topics import Topics, find_topics
from seal_friction_ros.offline.replay.replay import Step, steps
from seal_friction_ros.offline.reports.bag_report import write_page
from seal_friction_ros.offline.reports.figures import house_style
from seal_friction_ros.offline.reports.tune_report import (
    Task,
    Track,
    match_figures,
    match_sections,
    tuning_figures,
    tuning_sections,
)
from seal_friction_ros.offline.work.atomic_file import write_whole
from seal_friction_ros.offline.work.progress import progress

CONTROL_PERIOD, INNER_STEP = 1e-3, 1e-4  # [s] of the simulated servo, as servo_simulator runs it
NOISE_LENGTH = 8192  # samples of noise, which then repeats
MADE_BY = '# Feed-forward of friction_estimator, made by seal_friction tune.'
NODE = '/**/friction_estimator'  # in every namespace
TUNED = ('coulomb_scale', 'lead_time', 'smoothing_velocity', 'slew_limit')


@dataclass(frozen=True)
class TuneSummary:
    """What was written, and the numbers in it."""

    file: Path
    page: Path
    figures: tuple[Path, ...]
    better_in_every_case: bool
    """whether the feed-forward is better than none, also with a model and a delay that are wrong"""
    verdict: str
    """in words"""
    numbers: dict[str, Any]
    """in SI units; None where there is no number"""


def tune_simulator(out: Path, settings: TuningSettings, configuration: Configuration | None = None) -> TuneSummary:
    """Tune on the simulated servo, with the seals of the configuration, and write what was found.

    Args:
        out: Parameter file to write; the report goes beside it, with the end ``.html``.
        settings: What the axis shall do, and how well it is known.
        configuration: Seals and estimator; its feed-forward has the parameters that are not tuned.

    Raises:
        ValueError: The servo cannot follow, or a file cannot be written; nothing is written then.
    """
    check_target(out)
    chosen = configuration or default_configuration()
    parameters = chosen.parameters()
    servo = ServoParameters(seals=parameters.estimator.seals, control_period=CONTROL_PERIOD, inner_step=INNER_STEP)
    problem = Problem(Axis(servo, parameters), settings, sensor_noise(settings))
    with progress('tune', MOST_CANDIDATES) as advance:
        found = tune(problem, advance)
    task = Task('the simulated servo', _motion_text(settings), _seals_text(chosen), parameters.feedforward, TUNED)
    verdict = tuning_verdict(found)
    with house_style():
        plots = tuning_figures(problem, found)
        page = _page(out)
        figures = write_page(
            page, 'Feed-forward: tuning', lambda figure: tuning_sections(task, problem, found, verdict, figure), plots
        )
    write_parameters(out, found.feedforward, task, verdict)
    numbers = {'source': 'simulator', **_tuning_numbers(found), 'settings': asdict(settings)}
    return TuneSummary(out, page, figures, found.better_in_every_case, verdict, numbers)


def tune_bag(
    bag: Path, out: Path, known: MatchSettings, configuration: Configuration | None = None, namespace: str = ''
) -> TuneSummary:
    """Find the feed-forward that would have matched the friction in a bag of a real axis, and write it.

    Args:
        bag: Pressure, velocity, force sum and reference; estimates are made anew.
        out: As of `tune_simulator`.
        known: What else is known of the axis.
        configuration: Seals, estimator and feed-forward instead of what the bag says.
        namespace: Only topics below it count.

    Raises:
        ValueError: The bag cannot be read or has not what is needed, or a file cannot be written; then none is.
    """
    check_target(out)
    read = read_recording(bag, configuration, namespace)
    name = bag.resolve().name
    try:
        found = match(read.recording, read.configuration.feedforward, known)
    except ValueError as error:
        raise BagError(f'{bag}: {error}') from None
    told = tuple(parameter for parameter, is_told in found.told.items() if is_told)
    seals = _seals_text(read.configuration)
    seconds = f'{len(read.recording.estimates)} samples, {read.recording.time[-1]:.3f} s'
    task = Task(f'bag {name}', seconds, seals, read.configuration.feedforward, told)
    verdict = match_verdict(found)
    with house_style():
        plots = match_figures(read.recording, read.track, found)
        page = _page(out)
        figures = write_page(
            page,
            f'Feed-forward: {name}',
            lambda figure: match_sections(task, read.recording, read.track, found, verdict, figure),
            plots,
        )
    write_parameters(out, found.feedforward, task, verdict)
    numbers = {'source': 'bag', 'bag': name, **_match_numbers(found), **read.track.figures(), 'settings': asdict(known)}
    return TuneSummary(out, page, figures, found.better_in_every_case, verdict, numbers)


# -- what goes in -----------------------------------------------------------------------------------------------------


def sensor_noise(settings: TuningSettings) -> FloatArray:
    """White noise of the sensors of the estimator, shape (`NOISE_LENGTH`, 4), as `closed_loop` takes it."""
    spread = [settings.pressure_noise, settings.pressure_noise, settings.force_noise, settings.velocity_noise]
    return np.random.default_rng(settings.seed).normal(size=(NOISE_LENGTH, 4)) * spread


class ReadBag(NamedTuple):
    """A bag as the tuning needs it."""

    recording: Recording
    track: Track
    configuration: Configuration
    """the last one"""


def read_recording(bag: Path, override: Configuration | None = None, namespace: str = '') -> ReadBag:
    """What an axis did, its estimates made anew; samples whose stamp is not after the last one are left out.

    Raises:
        BagError: The bag cannot be read, or something that is needed is not in it.
    """
    topics = find_topics(bag, namespace)
    needed = {
        REFERENCE_TYPE: (topics.reference, 'the feed-forward is made from the reference'),
        FORCE_TYPE: (topics.force, 'the friction is seen in the force sum'),
        PRESSURE_TYPE: (topics.pressure, 'the friction follows the pressure'),
    }
    for type_name, (topic, reason) in needed.items():
        if not topic:
            raise BagError(f'{bag}: no message of {type_name} in it, and {reason}: record that topic too')
    collector = _Collector(topics, override or default_configuration())
    total = sum(info.message_count for info in bag_topics(bag).values())
    with progress(f'read {bag.name}', total) as advance:
        for count, step in enumerate(steps(read_messages(bag), topics, override), start=1):
            collector.take(step)
            if count % 1000 == 0:
                advance(1000)
    if len(collector.estimates) < 2:
        raise BagError(f'{bag}: no velocity sample after a first reference in it')
    return collector.result()


class _Collector:
    """Follows the messages of a bag and keeps what was known at each velocity sample, from the first reference on."""

    def __init__(self, topics: Topics, configuration: Configuration) -> None:
        self.estimates: list[FrictionEstimate] = []
        self._topics = topics
        self._configuration = configuration
        self._motions: list[Motion] = []
        self._rows: list[tuple[float, float, float]] = []
        self._reference: ServoReference | None = None
        self._position = self._force = np.nan

    def take(self, step: Step) -> None:
        """Take one message with the answers to it."""
        message = step.message
        if message.type_name == CONFIGURATION_TYPE:
            self._configuration = parse_snapshot(decode_text(message.data)).configuration
        elif message.topic in self._topics:
            record = DECODERS[message.type_name](message.data)
            if isinstance(record, ServoReference):
                self._reference = record
            elif isinstance(record, Position):
                self._position = record.position
            elif isinstance(record, Force):
                self._force = record.force
            elif isinstance(record, Velocity):
                self._take_velocity(record, step)

    def _take_velocity(self, sample: Velocity, step: Step) -> None:
        if self._reference is None or (self.estimates and sample.stamp <= self.estimates[-1].stamp):
            return
        (data,) = (data for type_name, data in step.answers if type_name == ESTIMATE_TYPE)
        reference = self._reference
        age = (sample.stamp - reference.stamp) * 1e-9
        self.estimates.append(decode(ESTIMATE_TYPE, data))
        self._motions.append(Motion(reference.velocity, reference.acceleration, sample.velocity, age))
        self._rows.append((self._force, reference.position, self._position))

    def result(self) -> ReadBag:
        """What was read."""
        force, reference, position = np.array(self._rows).T
        recording = Recording(tuple(self.estimates), tuple(self._motions), force)
        return ReadBag(recording, Track(reference, position), self._configuration)


def check_target(out: Path) -> None:
    """Find out before the work whether its result can be written.

    Raises:
        ValueError: ``out`` is something that must not be replaced, or its folder cannot be written to.
    """
    if out.suffix in ('.html', '.htm'):
        raise ValueError(f'{out}: FILE is the parameter file (.yaml); the report gets the end .html by itself')
    parent = next(parent for parent in out.absolute().parents if parent.exists())
    if out.is_dir() or not parent.is_dir() or not os.access(parent, os.W_OK):
        raise ValueError(f'{out}: cannot write a file there')
    if out.exists() and not out.read_text(encoding='utf-8', errors='replace').startswith(MADE_BY):
        raise ValueError(f'{out} exists already and is not from tune: not overwriting')
    if _page(out).exists() and not out.exists():
        raise ValueError(f'{_page(out)} exists already and is not from tune: not overwriting')


def _page(out: Path) -> Path:
    return out.with_suffix('.html')


# -- what comes out ---------------------------------------------------------------------------------------------------


def parameter_text(settings: FeedForwardSettings, task: Task, verdict: str) -> str:
    """ROS parameter file of a feed-forward, with what it was tuned on as a comment."""
    comment = f'# Tuned on {task.source}: {task.motion}; seals: {task.seals}. {verdict}'
    comment = ''.join(letter if letter.isprintable() else '?' for letter in comment)  # names that came from outside
    lines = [MADE_BY, *textwrap.wrap(comment, 110, subsequent_indent='# ', break_on_hyphens=False)]
    lines += [f'{NODE}:', '  ros__parameters:', f'    {FEEDFORWARD_PREFIX.rstrip(".")}:']
    for name, meaning in meanings(settings).items():
        value = yaml.safe_dump({name: getattr(settings, name)}).strip()
        unit = f'[{meaning.unit}] ' if meaning.unit else ''
        lines.append(f'      {value:<32}# {unit}{"tuned" if name in task.tuned else "as it was"}')
    return '\n'.join(lines) + '\n'


def write_parameters(out: Path, settings: FeedForwardSettings, task: Task, verdict: str) -> None:
    """Write the parameter file, whole or not at all.

    Raises:
        ValueError: It cannot be written.
    """
    try:
        write_whole(out, parameter_text(settings, task, verdict).encode())
    except OSError as error:
        raise ValueError(f'{out}: cannot write: {error.strerror or error}') from None


def tuning_verdict(found: Tuning) -> str:
    """What the tuning found, in words."""
    was, now = found.without, found.nominal
    if not found.feedforward.coulomb_scale:
        return 'No feed-forward does better than none on this plant.'
    words = (
        f'Tracking RMS {1e3 * was.tracking_rms:.3g} to {1e3 * now.tracking_rms:.3g} mm, '
        f'dwell per reversal {1e3 * was.dwell:.3g} to {1e3 * now.dwell:.3g} ms'
    )
    wrong = (
        f'with model {_percent(found.cases[-1].friction_error)} and delay {_percent(found.cases[-1].delay_error)} wrong'
    )
    if found.better_in_every_case:
        return f'{words}; better than none, and at rest, in every case {wrong}.'
    return f'{words}; NOT better than none, or not at rest, in every case {wrong}: look at the robustness runs.'


def match_verdict(found: Match) -> str:
    """What the bag told, in words."""
    was, now = found.without, found.nominal
    words = (
        f'RMS friction left to the controller while sliding {was.sliding:.3g} to {now.sliding:.3g} N, '
        f'near reversals {was.reversal:.3g} to {now.reversal:.3g} N'
    )
    untold = [name for name, is_told in found.told.items() if not is_told]
    kept = f'; not told by the bag and left as it was: {", ".join(untold)}' if untold else ''
    wrong = '' if found.better_in_every_case else '; NOT better than none in every case: look at the robustness runs'
    return f'{words}{kept}{wrong}.'


def _percent(share: float) -> str:
    return f'{100.0 * share:.3g} %'


def _motion_text(settings: TuningSettings) -> str:
    return (
        f'sine of {1e3 * settings.amplitude:g} mm at {settings.frequency:g} Hz, '
        f'{1e3 * settings.delay:g} ms from velocity sample to controller, seed {settings.seed}'
    )


def _seals_text(configuration: Configuration) -> str:
    names = [str(document.get('name', 'no name')) for document in configuration.seal_documents]
    chambers = configuration.selection.seal_chambers
    return ', '.join(f'{name} on chamber {chamber}' for name, chamber in zip(names, chambers, strict=True))


def _tuning_numbers(found: Tuning) -> dict[str, Any]:
    was, now = found.without, found.nominal
    compared = {
        f'{name}_{which}': getattr(figures, name)
        for name in ('tracking_rms', 'tracking_peak', 'dwell', 'overshoot', 'limit_cycle_reversals')
        for which, figures in (('without', was), ('with', now))
    }
    robustness = [
        {
            'friction_error': case.friction_error,
            'delay_error': case.delay_error,
            **{
                name: getattr(case.performance, name)
                for name in ('tracking_rms', 'tracking_peak', 'dwell', 'overshoot', 'limit_cycle_reversals')
            },
        }
        for case in found.cases
    ]
    return {
        'parameters': asdict(found.feedforward),
        'merit': found.merit,
        **compared,
        'largest_force': now.largest_force,
        'largest_force_rate': now.largest_force_rate,
        'better_in_every_case': found.better_in_every_case,
        'robustness': robustness,
    }


def _match_numbers(found: Match) -> dict[str, Any]:
    """Figures of a bag; what only a closed loop can tell is None."""
    law = found.law
    unknown = dict.fromkeys(
        f'{name}_{which}'
        for name in ('tracking_rms', 'tracking_peak', 'dwell', 'overshoot', 'limit_cycle_reversals')
        for which in ('without', 'with')
    )
    return {
        'parameters': asdict(found.feedforward),
        'told_by_bag': found.told,
        **unknown,
        'residual_without': found.without._asdict(),
        'residual_with': found.nominal._asdict(),
        'friction_over_model': law.scale,
        'friction_over_model_std': law.scale_std,
        'mass': law.mass,
        'mass_is_fitted': law.mass_is_fitted,
        'force_offset': law.offset,
        'better_in_every_case': found.better_in_every_case,
        'robustness': [
            {
                'friction_error': case.friction_error,
                'delay_error': case.delay_error,
                'residual': case.residual._asdict(),
            }
            for case in found.cases
        ],
    }
