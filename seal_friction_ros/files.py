"""Reads YAML for nodes and commands: seal files and ROS parameter files."""

from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.configuration import (
    MOUNTING,
    Configuration,
    SealSelection,
    mounted,
    names_chamber,
)
from seal_friction_ros.core.estimation.estimator import DEFAULT_ADAPTATION, EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.estimation.node_options import (
    FRICTION_ESTIMATOR_PARAMETERS,
    MACHINE_ESTIMATOR_PARAMETERS,
    REMOVED_PARAMETERS,
    ROS_PARAMETERS,
)
from seal_friction_ros.core.foundation.documents import DEEPEST
from seal_friction_ros.core.foundation.errors import named_errors
from seal_friction_ros.core.foundation.parameters import ParameterGroup, from_mapping, meant, printable, similar_names
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.friction.seal_file import mounting_of
from seal_friction_ros.core.machine.machine_file import Actuator, MachineFile, parse_machine
from seal_friction_ros.core.machine.outputs import check_outputs

_CONSTRUCTOR_ERRORS = (ValueError, TypeError, LookupError, AttributeError)  # PyYAML raises these for '!!int foo'
DEFAULT_FEEDFORWARD = FeedForwardSettings()
_LARGEST_YAML = 1 << 16  # [bytes] seal and parameter files have a few thousand
_LONGEST_SCALAR = 1 << 14  # characters without quotes: the time to parse a base-60 number grows with its length squared


class _UniqueKeyLoader(yaml.CSafeLoader):
    """Safe loader that rejects duplicate keys."""

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Mapping of a node; raises YAMLError for a duplicate key."""
        keys = Counter(str(key.value) for key, _ in node.value)
        duplicates = sorted(key for key, count in keys.items() if count > 1)
        if duplicates:
            raise yaml.YAMLError(f'{", ".join(duplicates)} appears twice in one mapping')
        return super().construct_mapping(node, deep)


def _check_cost(text: str) -> None:
    """Check that the memory and the time to load a text are proportional to its length.

    yaml.YAMLError: The text has aliases (a few lines can expand to gigabytes), too many levels, or a long scalar.
    """
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError('aliases (*name) are not allowed')
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise yaml.YAMLError(f'more than {DEEPEST} levels deep')
        if isinstance(event, yaml.ScalarEvent) and event.implicit[0] and len(event.value) > _LONGEST_SCALAR:
            raise yaml.YAMLError(f'a value of {len(event.value)} characters without quotes')


def read_yaml(path: Path, largest: int = _LARGEST_YAML) -> Any:
    """Document of a YAML file, plain data only.

    ValueError: The file is missing, not readable, above ``largest`` [bytes] or not plain YAML; one line that names it.
    """
    with named_errors(path, OSError):
        if path.exists() and not (path.is_file() or path.is_dir()):  # reading a pipe or a device may never end
            raise ValueError(f'{path}: not a file')
        with path.open('rb') as file:
            data = file.read(largest + 1)
    return parse_yaml(data, str(path), largest)


def parse_yaml(data: bytes, where: str, largest: int = _LARGEST_YAML) -> Any:
    """Document in YAML, plain data only; ``where`` names its source in the error message.

    ValueError: The document is larger than ``largest`` bytes, or not plain YAML.
    """
    if len(data) > largest:
        raise ValueError(f'{where}: larger than {largest} bytes, not a file of this kind')
    try:
        text = data.decode('utf-8')
        _check_cost(text)
        return _UniqueKeyLoader(text).get_single_data()
    except (yaml.YAMLError, RecursionError, *_CONSTRUCTOR_ERRORS) as error:
        raise ValueError(f'{where}: not plain YAML: {" ".join(str(error).split())}') from None


def share_directory(package: str, module_file: str) -> Path:
    """Share folder of a package: ``share/<package>`` of an install prefix, or the source tree itself.

    The search goes upward from the folder of ``module_file``. FileNotFoundError: The search finds no share folder.
    """
    paths = (Path(module_file), Path(module_file).resolve())  # colcon --symlink-install links into the source tree
    for parent in (parent for path in paths for parent in path.parents):
        for candidate in (parent / 'share' / package, parent):
            manifest = candidate / 'package.xml'
            if manifest.is_file() and f'<name>{package}</name>' in manifest.read_text(encoding='utf-8'):
                return candidate
    raise FileNotFoundError(f'no share folder of {package} above {module_file}')


def package_version() -> str:
    """Version of this package, from its manifest."""
    text = (share_directory('seal_friction_ros', __file__) / 'package.xml').read_text(encoding='utf-8')
    return text.partition('<version>')[2].partition('</version>')[0]


def config_path(kind: str, name: str) -> Path:
    """Path of a configuration file: ``name`` itself if it is a path, else ``config/<kind>/<name>.yaml``.

    ValueError: The path starts with an unknown user (``~user``), or there is no file of this name.
    """
    if '/' in name or name.endswith('.yaml'):
        with named_errors(name, RuntimeError):
            return Path(name).expanduser()
    path = share_directory('seal_friction_ros', __file__) / 'config' / kind / f'{name}.yaml'
    if not path.is_file():
        names = config_names(kind)
        raise ValueError(f'config/{kind} has no {name}: {meant(name, names)}; name a file by its path, ./{name}.yaml')
    return path


def config_names(kind: str) -> list[str]:
    """Names of the files in ``config/KIND``."""
    folder = share_directory('seal_friction_ros', __file__) / 'config' / kind
    return sorted(path.stem for path in folder.glob('*.yaml'))


def load_configuration(
    selection: SealSelection,
    settings: EstimatorSettings,
    feedforward: FeedForwardSettings = DEFAULT_FEEDFORWARD,
    adaptation: AdaptationSettings = DEFAULT_ADAPTATION,
) -> Configuration:
    """Configuration with the seal files that ``selection`` names.

    ValueError: A seal file cannot be read or is invalid; one line that names file, field, value and bound.
    """
    twice = [name for name in selection.seals if names_chamber(name)]  # without seal_chambers they have been split
    if twice:
        raise ValueError(f'seals has {twice[0]} and seal_chambers is given: set seal_chambers to [mounting]')
    paths = [config_path('seals', name) for name in selection.seals]
    documents = [read_yaml(path) for path in paths]
    with named_errors(', '.join(sorted({str(path) for path in paths}))):
        configuration = Configuration(*mounted(selection, documents), settings, feedforward, adaptation)
        configuration.parameters()
    return configuration


def with_seal(selection: SealSelection, seal: str) -> SealSelection:
    """Selection with a seal file for every seal; its mounting says how many they are, unless chambers are given.

    ValueError: The seal file cannot be read, or its mounting is not valid.
    """
    by_file = selection.seal_chambers == MOUNTING and mounting_of(read_yaml(config_path('seals', seal)))
    return replace(selection, seals=(seal,) * (1 if by_file else len(selection.seals)))


def load_seals(selection: SealSelection) -> tuple[MountedSeal, ...]:
    """The seals that ``selection`` names.

    ValueError: As `load_configuration`.
    """
    return load_configuration(selection, EstimatorSettings()).parameters().estimator.seals


def default_configuration() -> Configuration:
    """Configuration of a node without parameter overrides."""
    return load_configuration(SealSelection(), EstimatorSettings())


def load_parameter_file(path: Path) -> tuple[SealSelection, EstimatorSettings, FeedForwardSettings, AdaptationSettings]:
    """Seals, estimator, feed-forward and adaptation from a ROS parameter file of ``friction_estimator``.

    ValueError: As of `read_parameters`.
    """
    made = read_parameters(path, 'friction_estimator', FRICTION_ESTIMATOR_PARAMETERS)
    return made[SealSelection], made[EstimatorSettings], made[FeedForwardSettings], made[AdaptationSettings]


def read_parameters(path: Path, node: str, groups: Iterable[ParameterGroup]) -> dict[type, Any]:
    """A record for each group of parameters of a node, by its type, from a ROS parameter file.

    The sections of the node, ``*`` and ``**`` of any namespace count, and the only section of a file whatever its name.
    Later sections override earlier ones. All parameters of the node are checked. ValueError: The file is not a
    parameter file, the node has no such parameter, or a value is invalid.
    """
    document = read_yaml(path)
    values: dict[str, Any] = {}
    try:
        for name, content in document.items():
            if len(document) == 1 or str(name).rsplit('/', maxsplit=1)[-1] in (node, '*', '**'):
                values.update(_flat(content['ros__parameters']))
    except (AttributeError, KeyError, TypeError):
        raise ValueError(f'{path}: not a ROS parameter file (NODE: ros__parameters: NAME: VALUE)') from None
    groups = tuple(groups)
    known = {name for group in groups for name in group.names()}
    unknown = [name for name in values if name not in known and name.split('.')[0] not in ROS_PARAMETERS]
    if unknown:
        raise ValueError(f'{path}: {unknown_parameters(node, unknown)}')
    made: dict[type, Any] = {}
    for group in groups:
        given = {field: values[name] for name, field in group.names().items() if name in values}
        made[group.record_type] = from_mapping(group.record_type, given, str(path))
    return made


def read_machine(name: str) -> MachineFile:
    """Mapping file of a machine: a path, or the name of one in ``config/machines``; its seal files are relative to it.

    ValueError: It cannot be read or is invalid; one line that names file, actuator and key.
    """
    path = config_path('machines', name)
    file = parse_machine(read_yaml(path), str(path))
    with named_errors(path):
        check_outputs(file)
    return file._replace(actuators=tuple(_with_paths(one, path.parent) for one in file.actuators))


def _with_paths(actuator: Actuator, folder: Path) -> Actuator:
    """Actuator whose seal files that are named by a relative path are in ``folder``."""
    seals = [
        str(folder / name) if ('/' in name or name.endswith('.yaml')) and name[0] not in '~/' else name
        for name in actuator.selection.seals
    ]
    return replace(actuator, selection=replace(actuator.selection, seals=tuple(seals)))


def machine_configurations(file: MachineFile, where: str) -> dict[str, Configuration]:
    """Configuration of each actuator of a machine, with its seal files; ``where`` names the mapping file.

    ValueError: A seal file cannot be read or is invalid; one line that names the actuator.
    """
    configurations = {}
    for actuator in file.actuators:
        with named_errors(f'{where}: {actuator.name}'):
            configurations[actuator.name] = load_configuration(
                actuator.selection, actuator.settings, actuator.feedforward, actuator.adaptation
            )
    return configurations


def unknown_parameters(node: str, names: Iterable[str], declared: Collection[str] = ()) -> str:
    """One line that says which parameters a node lacks, with the node that has them or the most similar name.

    ``declared`` are those that it has, if they depend on others.
    """
    from seal_friction_ros.core.servo.simulator_options import (  # noqa: PLC0415  loads scipy, which the node does not
        SERVO_SIMULATOR_PARAMETERS,
    )

    tables = {
        'friction_estimator': FRICTION_ESTIMATOR_PARAMETERS,
        'machine_estimator': MACHINE_ESTIMATOR_PARAMETERS,
        'servo_simulator': SERVO_SIMULATOR_PARAMETERS,
    }
    owners = {name: other for other, groups in tables.items() for group in groups for name in group.names()}
    names = sorted(names)
    similar = similar_names(names, declared or [name for group in tables[node] for name in group.names()])
    hints = {name: f' (did you mean {other}?)' for name, other in similar.items()}
    hints |= {name: f' (a parameter of {owners[name]})' for name in names if name in owners}
    hints |= {name: f' (replaced by {REMOVED_PARAMETERS[name]})' for name in names if name in REMOVED_PARAMETERS}
    texts = [printable(name) + hints.get(name, '') for name in names]
    return f'{node} has no parameter {", ".join(texts)}'


def _flat(values: Any, above: str = '') -> dict[str, Any]:
    """Nested parameters with their dotted ROS names."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f'{above}{name}.') if isinstance(value, dict) else {f'{above}{name}': value}
    return flat
