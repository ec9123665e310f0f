"""The Python interface: what the commands of ``seal_friction`` do, as functions of Python.

``from seal_friction_ros import load_seal, Estimator, ...`` gives these names; other modules are not public. A name or
argument changes as semantic versions promise: in a minor version until 1.0.0, from then on in a major one only.

Units are SI, pressures gauge, velocity and force positive on extension. A file is named by its path or, as in the
commands, by its name in ``config``. Bad input ends in a ValueError of one line; so does a package that is not
installed (`MissingPackageError`). What has to be compiled is kept on disk, as by the commands.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seal_friction_ros.compiled_code import keep_compiled_code
from seal_friction_ros.core.estimation.configuration import Configuration, parse_snapshot
from seal_friction_ros.core.estimation.loop import LoopSample, receive_sample
from seal_friction_ros.core.estimation.pipeline import Emit, init, receive
from seal_friction_ros.core.friction.actuator import Seal
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.records import FeedForward, FrictionEstimate, Input, Output, Status
from seal_friction_ros.core.tuning.settings import RecordedAxisSettings, TuningSettings
from seal_friction_ros.files import config_path
from seal_friction_ros.offline.work.outcome import error_text
from seal_friction_ros.packages import MissingPackageError, as_missing, needed

if TYPE_CHECKING:
    from seal_friction_ros.offline.bags.mapped_bag import MappingFile
    from seal_friction_ros.offline.identification.results import Identification
    from seal_friction_ros.offline.replay.answer_comparison import ReplayResult
    from seal_friction_ros.offline.replay.compare import BagComparison
    from seal_friction_ros.offline.tuning.tune import BagTuning, SimulatorTuning
    from seal_friction_ros.offline.work.executor import Workers

__all__ = [
    'Columns', 'Estimator', 'FrictionState', 'MissingPackageError', 'RecordedAxisSettings', 'Seal', 'Status',
    'TuningSettings', 'compare', 'identify', 'load_seal', 'read_bag', 'replay', 'report', 'tune',
]  # fmt: skip

Name = str | Path
"""Path of a file or bag, or the name of a file in ``config``."""
_P = ParamSpec('_P')
_R = TypeVar('_R')


def _one_line(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Errors of files and packages as a ValueError of one line; code that the function compiles is kept."""

    @wraps(function)
    def called(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        """The function, with errors of one line."""
        keep_compiled_code()
        try:
            return function(*args, **kwargs)
        except ModuleNotFoundError as error:
            raise as_missing(error) from None
        except OSError as error:
            raise ValueError(error_text(error)) from None

    return called


@_one_line
def load_seal(name: Name) -> Seal:
    """Seal of a seal file, or of an O-ring case (``config/oring``), which is computed in seconds.

    Its methods `Seal.friction`, `Seal.friction_std` and `Seal.breakaway` take numbers and arrays.

    Args:
        name: Path, or the name of a file in ``config/seals``.
    """
    from seal_friction_ros.offline.contact.seal_force import seal_of

    return seal_of(config_path('seals', str(name)))


class Columns(dict[str, NDArray[Any]]):
    """Samples as columns of equal length, each an array of numpy by its name: ``columns['friction_force']``."""

    start: int = 0
    """[ns] stamp at which ``time`` is 0"""
    configuration: Configuration | None = None
    """seals and settings of the estimates, the last ones of a bag; None: not known"""

    def __repr__(self) -> str:
        return f'Columns of {len(self["time"])} samples: {", ".join(self)}'

    def to_pandas(self) -> Any:
        """``pandas.DataFrame`` with ``time`` [s] as index; MissingPackageError without pandas."""
        return needed('pandas').DataFrame(dict(self)).set_index('time')

    def to_xarray(self) -> Any:
        """``xarray.Dataset`` over ``time`` [s]; MissingPackageError without xarray."""
        return needed('xarray').Dataset({name: ('time', values) for name, values in self.items()})


@_one_line
def read_bag(
    bag: Name,
    *,
    namespace: str = '',
    mapping: Name | None = None,
    seals: Name | Sequence[Name] = (),
    params: Name | None = None,
) -> Columns:
    """Inputs and estimates of one actuator in a bag, a row for each estimate, with the inputs that it was made from.

    Columns: ``time`` since the first estimate, ``velocity``, ``pressure_a``, ``pressure_b``, ``force_sum``,
    ``position``, ``reference``, the fields of ``FrictionEstimate.msg``, ``feedforward_force``. NaN: not in the bag.

    Args:
        bag: Any rosbag2 bag or MCAP file.
        namespace: Only topics below it; the name of the actuator in a bag of several.
        mapping: Mapping file of the machine, for a bag that ``machine_estimator`` did not record.
        seals: As of `Estimator`. With ``seals`` or ``params``, and of a bag without estimates, they are made anew.
        params: ROS parameter file of the estimator.
    """
    from seal_friction_ros.offline.replay.replay import chosen_configuration, estimated_run

    run = estimated_run(Path(bag), namespace, _mapping(mapping), chosen_configuration(params, seals))
    columns = Columns({name: values for name, values in vars(run).items() if isinstance(values, np.ndarray)})
    columns.start = run.start
    if run.configurations:
        columns.configuration = parse_snapshot(run.configurations[-1][1]).configuration
    return columns


def _mapping(name: Name | None) -> 'MappingFile | None':
    from seal_friction_ros.offline.bags.mapped_bag import read_mapping

    return None if name is None else read_mapping(str(name))


class Estimator:
    """The estimator of the live node and of replay, in a program of one's own, to the same numbers.

    Args:
        seals: Seal file of every seal, or a list as of the parameter ``seals``: ``['rod@a', 'piston@difference']``.
        params: ROS parameter file of ``friction_estimator``.
        configuration: Instead of both, as `Columns.configuration` has it.
    """

    @_one_line
    def __init__(
        self,
        seals: Name | Sequence[Name] = (),
        params: Name | None = None,
        *,
        configuration: Configuration | None = None,
    ) -> None:
        from seal_friction_ros.offline.replay.replay import chosen_configuration

        chosen = configuration or chosen_configuration(params, seals)
        if chosen is None:
            raise ValueError('Estimator: no seals: name a seal file, or a parameter file with the parameter seals')
        self.configuration = chosen
        self.feedforward: FeedForward | None = None
        """the newest feed-forward; None before the first reference"""
        self._parameters = chosen.parameters()
        self._state = init(self._parameters)

    def receive(self, message: Input, received: int | None = None, sent: int | None = None) -> list[Output]:
        """Answers to one message of the node's inputs, given in the order of receipt: estimates and feed-forwards.

        Args:
            message: A record of ``core.messages.records``; its stamp is in ns.
            received: Time of receipt on a steady clock [ns]; None: the stamp.
            sent: When it was sent, on the same clock [ns]; None: when it was received.
        """
        arrived = message.stamp if received is None else received
        return self._taken(lambda emit: receive(self._parameters, self._state, message, arrived, emit, sent))

    def _taken(self, take: Callable[[Emit], None]) -> list[Output]:
        """Answers that a call makes."""
        answers: list[Output] = []
        take(lambda answer, _: answers.append(answer))
        forces = [answer for answer in answers if isinstance(answer, FeedForward)]
        self.feedforward = forces[-1] if forces else self.feedforward
        return answers

    def step(
        self,
        time: float,
        velocity: float,
        pressure_a: float,
        pressure_b: float = 0.0,
        force_sum: float = math.nan,
        *,
        reference_velocity: float = math.nan,
        reference_acceleration: float = math.nan,
        temperature: float = math.nan,
    ) -> FrictionEstimate:
        """Estimate at one sample; `feedforward` is then the newest one.

        NaN: there is no new sample of this input (of both pressures, for ``pressure_a``); the last one holds until it
        is too old.

        Args:
            time: [s], finite and increasing.
            velocity: [m/s] of the rod.
            pressure_a: [Pa, gauge]
            pressure_b: [Pa, gauge]
            force_sum: [N] every axial force on the moving mass except seal friction.
            reference_velocity: [m/s] wanted.
            reference_acceleration: [m/s^2] wanted.
            temperature: [degC] of the seals.
        """
        if not math.isfinite(time):
            raise ValueError(f'time = {time} s is not finite: give the time of the sample')
        sample = LoopSample(
            round(time * 1e9), float(velocity), float(pressure_a), float(pressure_b), float(force_sum),
            float(reference_velocity), float(reference_acceleration), float(temperature),
        )  # fmt: skip
        answers = self._taken(lambda emit: receive_sample(self._parameters, self._state, sample, emit))
        return next(answer for answer in answers if isinstance(answer, FrictionEstimate))

    def over(self, samples: Mapping[str, ArrayLike]) -> Columns:
        """Estimates of samples in columns (a dict, `Columns`, a DataFrame) that are named as the arguments of `step`.

        Returns:
            ``time`` as given, the fields of ``FrictionEstimate.msg``, and ``feedforward_force``, NaN before the first.
        """
        known = [*signature(self.step).parameters]
        columns = {name: np.asarray(samples[name], float) for name in known if name in samples}
        if missing := [name for name in known[:3] if name not in columns]:
            raise ValueError(f'samples have no column {missing[0]}: there are {", ".join(columns) or "none"}')
        if len({column.shape for column in columns.values()}) > 1 or columns['time'].ndim != 1:
            raise ValueError('samples: the columns differ in length')
        estimates, forces = [], []
        for row in zip(*(column.tolist() for column in columns.values()), strict=True):
            estimates.append(self.step(**dict(zip(columns, row, strict=True))))
            forces.append(self.feedforward.force if self.feedforward else math.nan)
        made = {name: np.array([getattr(one, name) for one in estimates]) for name in FrictionEstimate._fields[1:]}
        found = Columns({'time': columns['time'], **made, 'feedforward_force': np.array(forces)})
        found.configuration = self.configuration
        return found


@_one_line
def replay(
    bag: Name,
    *,
    seals: Name | Sequence[Name] = (),
    params: Name | None = None,
    out: Name | None = None,
    namespace: str = '',
    workers: 'Workers' = 1,
) -> 'ReplayResult':
    """Replay a bag through the estimator: ``result.identical`` tells whether every recorded answer came out again.

    Args:
        bag: The bag.
        seals: As of `Estimator`, in place of the recorded ones.
        params: ROS parameter file, in place of the recorded parameters.
        out: Bag to write with inputs and new answers; must not exist.
        namespace: As of `read_bag`.
        workers: Processes that share a long bag.
    """
    from seal_friction_ros.offline.replay.parallel_replay import verify, verify_shared
    from seal_friction_ros.offline.replay.replay import chosen_configuration
    from seal_friction_ros.offline.replay.replay import replay as replay_and_write

    override = chosen_configuration(params, seals)
    if out is not None:
        return replay_and_write(Path(bag), override, Path(out), namespace)
    shared = verify_shared(Path(bag), namespace, workers) if override is None else None
    return shared or verify(Path(bag), override, namespace)


@_one_line
def compare(
    a: Name,
    b: Name,
    *,
    atol: float = 0.0,
    rtol: float = 0.0,
    tolerances: Mapping[str, float | None] | None = None,
    topic: str = '',
    namespace: str = '',
    mapping: Name | None = None,
) -> 'BagComparison':
    """Compare the messages of equal stamp in two bags: ``result.agree``, ``result.fields['friction_force'].largest``.

    Args:
        a: First bag, the reference.
        b: Second bag.
        atol: Absolute tolerance, in the unit of each field.
        rtol: Relative tolerance [-].
        tolerances: Field that decides -> its absolute tolerance, None: ``atol``; by default the friction decides.
        topic: By default that of the friction estimates.
        namespace: As of `read_bag`.
        mapping: As of `read_bag`.
    """
    from seal_friction_ros.offline.replay import compare as bags

    return bags.compare(
        Path(a), Path(b), topic, atol, rtol, tolerances=tolerances, namespace=namespace, mapping=_mapping(mapping)
    )


@_one_line
def identify(
    sources: Name | Sequence[Name],
    *,
    name: str = 'seal',
    out: Name | None = None,
    chambers: Sequence[str] | None = None,
    rig: Name | None = None,
    seal: Name | None = None,
    law: str | None = None,
    presliding: bool = False,
    namespace: str = '',
    mapping: Name | None = None,
    workers: 'Workers' = 1,
) -> 'Identification':
    """Identify a seal from bags, logs, tables or data sheets: ``result.document`` is the seal file, checked.

    Args:
        sources: Paths or URLs.
        name: Of the seal.
        out: Seal file to write, which `load_seal` and the node read.
        chambers: What each seal sees: a, b, difference or ambient; None: as the sources tell.
        rig: Rig file of the logs.
        seal: Seal file with the geometry of the ring.
        law: Law to save instead of the recommended one.
        presliding: Identify the elasticity of the seals, too.
        namespace: As of `read_bag`.
        mapping: As of `read_bag`.
        workers: Processes; the result does not depend on their number.
    """
    from seal_friction_ros.offline.identification import pipeline
    from seal_friction_ros.offline.identification.sources import SourceOptions
    from seal_friction_ros.offline.work.places import place_of
    from seal_friction_ros.offline.work.seal_writer import write_seal
    from seal_friction_ros.offline.work.targets import SEAL_FILE, checked_targets, mark

    places = [place_of(str(path)) for path in ([sources] if isinstance(sources, str | Path) else sources)]
    of_sources = SourceOptions(
        rig=None if rig is None else str(rig),
        chambers=None if chambers is None else tuple(chambers),
        namespace=namespace,
        mapping=_mapping(mapping),
    )
    ring = None if seal is None else str(seal)
    options = pipeline.IdentifyOptions(sources=of_sources, seal=ring, law=law, presliding=presliding)
    targets = [] if out is None else [(Path(out), SEAL_FILE)]
    with checked_targets('identify', targets, [place for place in places if isinstance(place, Path)], force=False):
        found = pipeline.identify(places, options, name, workers)
        for path, _ in targets:
            write_seal(found.document, path, f'Seal file, {mark("identify")}.')
    return found


@_one_line
def tune(
    bag: Name | None = None,
    *,
    settings: TuningSettings | RecordedAxisSettings | None = None,
    seals: Name | Sequence[Name] = (),
    params: Name | None = None,
    out: Name | None = None,
    namespace: str = '',
    mapping: Name | None = None,
    machine: Name | None = None,
) -> 'BagTuning | SimulatorTuning':
    """Tune the feed-forward: ``result.found.feedforward`` has its parameters, ``result.numbers`` what they are worth.

    Args:
        bag: Bag of a real axis; None: the simulated servo.
        settings: `RecordedAxisSettings` of a bag, `TuningSettings` of the simulated servo.
        seals: As of `Estimator`.
        params: ROS parameter file of the estimator.
        out: ROS parameter file to write.
        namespace: As of `read_bag`.
        mapping: As of `read_bag`.
        machine: Parameter file of ``servo_simulator``, the simulated servo.
    """
    from seal_friction_ros.offline.bags.actuator_bag import open_actuator
    from seal_friction_ros.offline.replay.replay import chosen_configuration
    from seal_friction_ros.offline.tuning import tune as tuning
    from seal_friction_ros.offline.work.targets import PARAMETER_FILE, checked_targets

    targets = [] if out is None else [(Path(out), PARAMETER_FILE)]
    kind = TuningSettings if bag is None else RecordedAxisSettings
    given, chosen = kind() if settings is None else settings, chosen_configuration(params, seals)
    found: BagTuning | SimulatorTuning
    with checked_targets('tune', targets, [] if bag is None else [Path(bag)], force=False):
        if isinstance(given, TuningSettings) and bag is None:
            servo = tuning.DEFAULT_MACHINE if machine is None else tuning.load_machine(Path(machine))
            found = tuning.tune_simulator(given, chosen, servo)
        elif isinstance(given, RecordedAxisSettings) and bag is not None:
            found = tuning.tune_bag(open_actuator(Path(bag), namespace, _mapping(mapping)), given, chosen)
        else:
            raise ValueError(f'tune: settings are {type(given).__name__}, but {kind.__name__} are needed')
        for path, _ in targets:
            tuning.write_parameters(path, found, found.actuator)
    return found


@_one_line
def report(bag: Name, out: Name, *, namespace: str = '', mapping: Name | None = None) -> dict[str, Any]:
    """Write the page of a bag with figures and verdict to ``out`` (HTML); returns its numbers, as ``--json`` does."""
    from seal_friction_ros.offline.reports.bag_report import write_report
    from seal_friction_ros.offline.work.targets import PAGE, checked_targets

    with checked_targets('report', [(Path(out), PAGE)], [Path(bag)], force=False):
        return write_report(Path(bag), Path(out), namespace, _mapping(mapping)).numbers
