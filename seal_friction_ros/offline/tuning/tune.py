"""Tuning of the feed-forward for a simulated or a recorded axis, and the ROS parameter file with the result.

The file holds every parameter of the feed-forward and nothing else. It does not depend on time or place, so the same
axis gives the same bytes.
"""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from seal_friction_ros.core.estimation.configuration import PLACEHOLDER_WARNING, Configuration, parse_snapshot
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.node_options import FEEDFORWARD_PREFIX
from seal_friction_ros.core.estimation.pipeline import NO_REFERENCE, condition_reference, is_possible
from seal_friction_ros.core.foundation.arrays import FloatArray, IntArray
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.parameters import meanings
from seal_friction_ros.core.foundation.units import MM, MS, UM
from seal_friction_ros.core.identification import admission
from seal_friction_ros.core.messages import layouts
from seal_friction_ros.core.messages.blocks import Numbers
from seal_friction_ros.core.messages.fields import Reader
from seal_friction_ros.core.messages.records import ServoReference
from seal_friction_ros.core.servo import simulator_options as simulator
from seal_friction_ros.core.servo.closed_loop import IDEAL_SENSORS, Axis, AxisSensors
from seal_friction_ros.core.servo.sensors import SensorSettings
from seal_friction_ros.core.servo.tracking import tracking_peak, tracking_rms
from seal_friction_ros.core.tuning.output_gain import CommandRecord, OutputGain, output_gain
from seal_friction_ros.core.tuning.recorded_axis import RecordedTuning, Recording, tune_recorded_axis
from seal_friction_ros.core.tuning.settings import FORCE_MARGIN, RecordedAxisSettings, TunedFeedForward, TuningSettings
from seal_friction_ros.core.tuning.simulated_axis import (
    MOST_CANDIDATES,
    PlantOutcome,
    Tuning,
    TuningProblem,
    on_plants,
    tune,
)
from seal_friction_ros.files import default_configuration, read_parameters
from seal_friction_ros.offline.bags.actuator_bag import ActuatorBag
from seal_friction_ros.offline.bags.bag import BagError, read_definitions
from seal_friction_ros.offline.bags.columns import Block, Wanted, collected, read_velocity_rows
from seal_friction_ros.offline.bags.recorded_run import RunCollector, wanted_of_run
from seal_friction_ros.offline.replay.replay import answered_anew
from seal_friction_ros.offline.work.atomic_file import write_whole
from seal_friction_ros.offline.work.progress import progress
from seal_friction_ros.offline.work.targets import mark

CONTROL_PERIOD, INNER_STEP = 1e-3, 1e-4  # [s] of the simulated servo, as in servo_simulator
NOISE_LENGTH = 8192  # samples of noise, which then repeats
MADE_BY = f'# Feed-forward of friction_estimator, {mark("tune")}.'
MADE_FOR_MACHINE = f'# Feed-forward of machine_estimator, {mark("tune")}.'
NODE, MACHINE_NODE = '/**/friction_estimator', '/**/machine_estimator'  # in every namespace
TUNED = ('scale', 'lead_time', 'smoothing_velocity', 'slew_limit', 'force_limit')
PERFORMANCE = ('tracking_rms', 'tracking_peak', 'dwell', 'overshoot', 'limit_cycle_reversals')


class TuningTask(NamedTuple):
    """Subject of a tuning."""

    source: str
    motion: str
    seals: str
    before: FeedForwardSettings  # settings before the tuning
    tuned: tuple[str, ...]  # names of the tuned parameters; the others are unchanged
    has_placeholder: bool  # whether a seal is the placeholder of the default configuration

    def remarks(self, found: TunedFeedForward[Any]) -> tuple[str, ...]:
        """Sentences on the force limit and on placeholder seals."""
        now, was = found.feedforward.force_limit, self.before.force_limit
        limit = f'force_limit: {now:g} N (was {was:g} N): {FORCE_MARGIN:g} times the largest friction found.'
        return (limit, f'Warning: {PLACEHOLDER_WARNING}.') if self.has_placeholder else (limit,)

    def numbers(self, found: TunedFeedForward[Any], of_case: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        """Numbers of any tuning for JSON, in SI units; ``of_case`` gives those of the outcome of a case."""
        return {
            'largest_friction': found.largest_friction,
            'placeholder_seals': self.has_placeholder,
            'parameters': asdict(found.feedforward),
            'better_in_every_case': found.better_in_every_case,
            'robustness': [{'friction_error': f, 'delay_error': d} | of_case(outcome) for f, d, outcome in found.cases],
        }


class RecordedTrack(NamedTuple):
    """Reference and position of the rod of a recorded axis [m], shape (n,); NaN where they are unknown."""

    reference: FloatArray
    position: FloatArray

    def numbers(self) -> dict[str, float | None]:
        """Tracking error as recorded [m], with any compensation active at that time; None without positions."""
        known = np.isfinite(self.reference) & np.isfinite(self.position)
        errors = {'recorded_tracking_rms': tracking_rms, 'recorded_tracking_peak': tracking_peak}
        pair = self.reference[known], self.position[known]
        return {name: error(*pair) if known.any() else None for name, error in errors.items()}


def told(tuning: 'SimulatorTuning | BagTuning') -> str:
    """Result and remarks in one line."""
    return ' '.join((tuning.result, *tuning.remarks))


@dataclass(frozen=True)
class SimulatorTuning:
    """Result of a tuning on the simulated servo."""

    task: TuningTask
    problem: TuningProblem
    found: Tuning
    plants: tuple[PlantOutcome, ...] = ()  # rigid, elastic, LuGre; empty if the seal files have no presliding
    actuator: str = ''  # of a machine; the servo is none

    @property
    def result(self) -> str:
        """Result as a sentence."""
        was, now = self.found.without, self.found.nominal
        if not self.found.feedforward.scale:
            return 'No feed-forward is better than none on this plant.'
        worst, better, end = self.found.cases[-1], 'better than none, and at rest,', '.'
        if not self.found.better_in_every_case:
            better, end = 'NOT better than none, or not at rest,', ': see the robustness cases.'
        return (
            f'Tracking RMS {was.tracking_rms / MM:.3g} to {now.tracking_rms / MM:.3g} mm, '
            f'dwell per reversal {was.dwell / MS:.3g} to {now.dwell / MS:.3g} ms; '
            f'{better} in every case with a model error up to {100.0 * worst.friction_error:.3g} % and a delay error '
            f'up to {100.0 * worst.delay_error:.3g} %{end}'
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on the other plants, the force limit and placeholder seals."""
        on_plants = (
            f'With {plant} seals: tracking RMS {was.tracking_rms / UM:.3g} to {now.tracking_rms / UM:.3g} um, near '
            f'reversals {was.reversal_rms / UM:.3g} to {now.reversal_rms / UM:.3g} um.'
            for plant, was, now in self.plants
        )
        return (*on_plants, *self.task.remarks(self.found))

    @property
    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON, in SI units."""
        found = self.found
        return {
            'source': 'simulator',
            **self.task.numbers(found, lambda one: {name: getattr(one, name) for name in PERFORMANCE}),
            'merit': found.merit,
            **{f'{name}_without': getattr(found.without, name) for name in PERFORMANCE},
            **{f'{name}_with': getattr(found.nominal, name) for name in PERFORMANCE},
            'largest_force': found.nominal.largest_force,
            'largest_force_rate': found.nominal.largest_force_rate,
            'plants': [
                {'plant': plant, 'without': was._asdict(), 'with': now._asdict()} for plant, was, now in self.plants
            ],
            'settings': asdict(self.problem.settings),
        }


@dataclass(frozen=True)
class BagTuning:
    """Result of a tuning on a bag of a real axis."""

    bag: str  # name of the bag
    task: TuningTask
    recording: Recording
    track: RecordedTrack
    known: RecordedAxisSettings
    found: RecordedTuning
    actuator: str = ''  # of a machine

    @property
    def result(self) -> str:
        """Result as a sentence."""
        was, now = self.found.without, self.found.nominal
        text = (
            f'RMS friction left to the controller while sliding {was.sliding:.3g} to {now.sliding:.3g} N, '
            f'near reversals {was.reversal:.3g} to {now.reversal:.3g} N'
        )
        if unchanged := [name for name, is_identified in self.found.identified.items() if not is_identified]:
            text += f'; not identifiable from the bag and unchanged: {", ".join(unchanged)}'
        if not self.found.better_in_every_case:
            text += '; NOT better than none in every case: see the robustness cases'
        return f'{text}.'

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on the force limit, placeholder seals and samples."""
        samples = self.found.law.samples
        return (*self.task.remarks(self.found), *(f'{text}.' for text in (samples.text, *samples.warnings)))

    @property
    def numbers(self) -> dict[str, Any]:
        """Numbers for JSON, in SI units; None for the numbers that need a closed loop."""
        found, law = self.found, self.found.law
        return {
            'source': 'bag',
            'bag': self.bag,
            **self.task.numbers(found, lambda left: {'residual': left._asdict()}),
            'told_by_bag': found.identified,
            **{f'{name}_{which}': None for name in PERFORMANCE for which in ('without', 'with')},
            'residual_without': found.without._asdict(),
            'residual_with': found.nominal._asdict(),
            'friction_over_model': law.scale,
            'friction_over_model_std': law.scale_std,
            'mass': law.mass,
            'mass_is_fitted': law.mass_is_fitted,
            'force_offset': law.offset,
            **self.track.numbers(),
            **law.samples.numbers,
            'settings': asdict(self.known),
        }


class SimulatedMachine(NamedTuple):
    """Plant and sensors of a simulated axis, without its seals."""

    name: str
    settings: simulator.SimulatorSettings
    parts: Mapping[type, Any]  # records by type, as `servo_parameters` takes them
    sensors: AxisSensors


DEFAULT_MACHINE = SimulatedMachine(
    'the simulated servo',
    simulator.SimulatorSettings(rate=1.0 / CONTROL_PERIOD, inner_step=INNER_STEP),
    {kind: kind() for kind in simulator.PLANT.values()},
    IDEAL_SENSORS,
)


def load_machine(path: Path) -> SimulatedMachine:
    """The machine of a parameter file of ``servo_simulator``.

    With ``messages: standard``, ``standard.load_cell: false`` is an axis without force sensor, and ``standard.velocity:
    false`` one with an encoder of ``sensors.position_resolution``; ValueError if that is 0, or the file has an error.
    """
    made = read_parameters(path, 'servo_simulator', simulator.SERVO_SIMULATOR_PARAMETERS)
    settings, standard = made[simulator.SimulatorSettings], made[simulator.StandardMessages]
    sensors, step = IDEAL_SENSORS, made[SensorSettings].position_resolution
    if settings.messages == 'standard':
        if not standard.velocity and not step:
            raise ValueError(f'{path}: standard.velocity: false needs a sensors.position_resolution, the encoder step')
        sensors = AxisSensors(standard.load_cell, 0.0 if standard.velocity else step)
    return SimulatedMachine(f'the simulated machine {path.name}', settings, made, sensors)


def tune_simulator(
    settings: TuningSettings, configuration: Configuration | None = None, machine: SimulatedMachine = DEFAULT_MACHINE
) -> SimulatorTuning:
    """Tune on a simulated machine, with the seals of the configuration; ValueError if the servo cannot follow the task.

    The feed-forward of the configuration has the parameters that are not tuned.
    """
    chosen = configuration or default_configuration()
    parameters = chosen.parameters()
    servo = simulator.servo_parameters(machine.settings, machine.parts, parameters.estimator.seals)
    problem = TuningProblem(Axis(servo, parameters, machine.sensors), settings, sensor_noise(settings))
    with progress('tune', MOST_CANDIDATES) as advance:
        found = tune(problem, advance)
    motion = (
        f'sine of {settings.amplitude / MM:g} mm at {settings.frequency:g} Hz, '
        f'{settings.delay / MS:g} ms from velocity sample to controller, seed {settings.seed}'
    )
    task = TuningTask(machine.name, motion, _seals_text(chosen), parameters.feedforward, TUNED, chosen.has_placeholder)
    return SimulatorTuning(task, problem, found, on_plants(problem, found.feedforward))


def tune_bag(
    actuator: ActuatorBag, known: RecordedAxisSettings, configuration: Configuration | None = None
) -> BagTuning:
    """Find the feed-forward that matches the friction in a bag of a real axis; the estimates are computed anew.

    The ``configuration`` has seals, estimator and feed-forward instead of those in the bag. BagError: the bag cannot be
    read, or an input is missing in it.
    """
    recording, track, recorded = read_recording(actuator, configuration)
    with named_errors(actuator.path, raised=BagError):
        found = tune_recorded_axis(recording, recorded.feedforward, known)
        found.law.samples.check()
    tuned = tuple(parameter for parameter, is_identified in found.identified.items() if is_identified)
    motion = f'{len(recording.stamps)} samples, {recording.time[-1]:.3f} s'
    seals, source = _seals_text(recorded), f'bag {actuator.name}'
    task = TuningTask(source, motion, seals, recorded.feedforward, tuned, recorded.has_placeholder)
    return BagTuning(actuator.name, task, recording, track, known, found, actuator.actuator)


def sensor_noise(settings: TuningSettings) -> FloatArray:
    """White noise of the sensors of the estimator, shape (`NOISE_LENGTH`, 4), as `run_closed_loop` takes it."""
    spread = [settings.pressure_noise, settings.pressure_noise, settings.force_noise, settings.velocity_noise]
    return np.random.default_rng(settings.seed).normal(size=(NOISE_LENGTH, 4)) * spread


def _seals_text(configuration: Configuration) -> str:
    mounted = zip(configuration.seal_documents, configuration.selection.seal_chambers, strict=True)
    return ', '.join(f'{seal.get("name", "no name")} on chamber {chamber}' for seal, chamber in mounted)


def read_recording(
    actuator: ActuatorBag, override: Configuration | None = None
) -> tuple[Recording, RecordedTrack, Configuration]:
    """Recording of an axis from the first reference on, its track, and the last configuration in the bag.

    The estimates are computed anew. A velocity sample takes the newest other inputs. A sample whose stamp is not after
    the previous one is left out. BagError: the bag cannot be read, or an input is missing in it.
    """
    topics, bag = actuator.topics, actuator.path
    needed = {
        layouts.REFERENCE_TYPE: (topics.reference, 'the feed-forward is computed from the reference'),
        layouts.FORCE_TYPE: (topics.force, 'the friction is computed from the force sum'),
        layouts.PRESSURE_TYPE: (topics.pressure, 'the friction depends on the pressure'),
    }
    for type_name, (topic, reason) in needed.items():
        if not topic:
            raise BagError(f'{bag}: no message of {type_name} in it, but {reason}: record this topic too')
    source, messages = answered_anew(actuator, override)
    return collected(source, wanted_of_run(source), _AxisCollector, messages=messages).recording(source)


class _AxisCollector(RunCollector):
    """Keeps the references, too."""

    def __init__(self) -> None:
        super().__init__()
        self._references: list[tuple[Numbers, IntArray]] = []  # with the number of estimates before each

    def add(self, block: Block) -> None:
        """Take the references, each with the number of estimates before it, and the estimates."""
        references = block.of('reference')
        before = len(self.stamps) + np.searchsorted(block.of('estimate').places, references.places)
        self._references.append((references, before))
        super().add(block)

    def recording(self, source: ActuatorBag) -> tuple[Recording, RecordedTrack, Configuration]:
        """All samples from the first reference on; BagError if there are fewer than two."""
        own = np.frombuffer(self.stamps, np.int64)
        before = np.concatenate([places for _, places in self._references])
        newest = np.searchsorted(before, np.arange(len(own)), side='right') - 1
        led = np.flatnonzero(newest >= 0)
        chosen = led[np.diff(np.maximum.accumulate(own[led]), prepend=own[led][:1] - 1) > 0]
        if len(chosen) < 2:
            raise BagError(f'{source.path}: fewer than two velocity samples after the first reference')
        run, reference = self.run(source), newest[chosen]
        configuration = parse_snapshot(run.configurations[-1][1]).configuration
        stamps, moved = _conditioned(configuration.settings, [numbers for numbers, _ in self._references])
        recording = Recording(
            stamps=own[chosen],
            **{name: getattr(run, name)[chosen] for name in _OF_RUN},
            reference_velocity=moved[0, reference],
            reference_acceleration=moved[1, reference],
            reference_age=np.asarray((own[chosen] - stamps[reference]) * 1e-9, np.float64),
            dropped={admission.NO_REFERENCE: len(own) - len(led), admission.OLD_STAMP: len(led) - len(chosen)},
        )
        return recording, RecordedTrack(run.reference[chosen], run.position[chosen]), configuration


_OF_RUN = ('state', 'status', 'coulomb_friction', 'velocity', 'force_sum')


def _conditioned(settings: EstimatorSettings, references: Sequence[Numbers]) -> tuple[IntArray, FloatArray]:
    """Stamps of the references [ns], and what the node keeps after each: velocity and acceleration, shape (2, n)."""
    stamps = np.concatenate([part.stamps for part in references])
    numbers = np.concatenate([part.numbers for part in references], axis=1)
    conditioned, moved = NO_REFERENCE, []
    for stamp, values in zip(stamps.tolist(), numbers.T.tolist(), strict=True):
        wanted = ServoReference(stamp, *values)
        if is_possible(settings, wanted):
            conditioned = condition_reference(conditioned, wanted)
        moved.append((conditioned.velocity.velocity, conditioned.acceleration))
    return stamps, np.array(moved).reshape(-1, 2).T


# -- gain from force to command ----------------------------------------------------------------------------------------

_COMMAND_FIELDS = {layouts.NUMBER_TYPE: 'data', layouts.NUMBERS_TYPE: 'data[0]'}


def read_output_gain(source: ActuatorBag, topic: str, known: RecordedAxisSettings) -> OutputGain:
    """Gain from force to the command on a topic, a `std_msgs/Float64` or `Float64MultiArray`.

    The bag has the command, pressures, velocity and, if measured, position; the areas of both chambers are ``known``.
    BagError: the bag lacks something, or cannot tell the gain.
    """
    if not (known.area_a and known.area_b):
        raise BagError(f'{topic}: give --area-a and --area-b [m2]: the gain needs the force of the pressures')
    bag = source.path
    kind = source.infos[topic].type_name if topic in source.infos else ''
    if kind not in _COMMAND_FIELDS:
        what = f'is {kind}' if kind else 'is not in it'
        raise BagError(f'{bag}: the command {topic} {what}: it has to be {" or ".join(_COMMAND_FIELDS)}')
    (definition,) = read_definitions(bag, [kind]).values()
    reader = Reader(definition, kind, [_COMMAND_FIELDS[kind]])

    def number_of(data: bytes) -> float:
        """The command of a message; ValueError if it is malformed or empty."""
        (number,) = reader.read(data).numbers
        if number is None:
            raise ValueError('the array is empty')
        return number

    rows = read_velocity_rows(source, also={'command': (Wanted(topic, kind), number_of)})
    are_told = np.isfinite(rows.columns[[1, 2, -1]]).all(axis=0)
    velocity, a, b, _, position, *_, command = rows.columns[:, are_told]
    time = np.asarray(rows.stamps[are_told] * 1e-9, np.float64)
    with named_errors(f'{bag}: {topic}', raised=BagError):
        return output_gain(CommandRecord(time, command, known.area_a * a - known.area_b * b, position, velocity))


# -- parameter file ---------------------------------------------------------------------------------------------------


def parameter_text(tuning: SimulatorTuning | BagTuning, actuator: str = '') -> str:
    """ROS parameter file of a feed-forward, with task and summary as a comment.

    With the name of an ``actuator`` in the mapping file it is for ``machine_estimator``, else for
    ``friction_estimator``.
    """
    task, settings = tuning.task, tuning.found.feedforward
    comment = f'# Tuned on {task.source}: {task.motion}; seals: {task.seals}. {told(tuning)}'
    comment = ''.join(letter if letter.isprintable() else '?' for letter in comment)  # names come from outside
    wrapped = textwrap.wrap(comment, 110, subsequent_indent='# ', break_on_hyphens=False)
    group = f'{actuator}.{FEEDFORWARD_PREFIX}'.strip('.')
    lines = [MADE_FOR_MACHINE if actuator else MADE_BY, *wrapped]
    lines += [f'{MACHINE_NODE if actuator else NODE}:', '  ros__parameters:', f'    {group}:']
    for name, meaning in meanings(settings).items():
        value = yaml.safe_dump({name: getattr(settings, name)}).strip()
        unit = f'[{meaning.unit}] ' if meaning.unit else ''
        lines.append(f'      {value:<32}  # {unit}{"tuned" if name in task.tuned else "unchanged"}')
    return '\n'.join(lines) + '\n'


def write_parameters(out: Path, tuning: SimulatorTuning | BagTuning, actuator: str = '') -> None:
    """Write the parameter file, completely or not at all; ValueError if it cannot be written."""
    with named_errors(f'{out}: cannot write', OSError):
        write_whole(out, parameter_text(tuning, actuator).encode())
