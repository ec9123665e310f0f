"""The door through which YAML comes in, for nodes and tools alike: seal files and parameter files."""

from collections import Counter
from pathlib import Path
from typing import Any

import yaml

from seal_friction_ros.core.estimation.configuration import Configuration, SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.foundation.parameters import from_mapping, meanings, plain
from seal_friction_ros.core.friction.actuator import MountedSeal

_CONSTRUCTOR_ERRORS = (ValueError, TypeError, LookupError, AttributeError)  # what PyYAML lets out for '!!int foo'
_OF_THE_NODE = (
    'autostart',
    'record',
    'record_directory',
    'record_name',
    'record_split_size',
    'record_split_duration',
    'use_sim_time',
    'qos_overrides',
)
DEFAULT_FEEDFORWARD = FeedForwardSettings()
_LARGEST_YAML = 1 << 16  # [bytes] a seal or parameter file has a few thousand
_DEEPEST_YAML = 40  # levels
_LONGEST_SCALAR = 1 << 14  # characters without quotes: a number of base 60 takes the square of its length


class _PlainLoader(yaml.CSafeLoader):
    """Safe loader that takes no duplicate keys."""

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Mapping of a node, unless a key stands in it twice."""
        keys = Counter(str(key.value) for key, _ in node.value)
        doubled = sorted(key for key, count in keys.items() if count > 1)
        if doubled:
            raise yaml.YAMLError(f'{", ".join(doubled)} stands twice in one mapping')
        return super().construct_mapping(node, deep)


def _check_plain(text: str) -> None:
    """Refuse what takes more memory or time to load than its length suggests.

    Raises:
        yaml.YAMLError: The text has aliases (a few lines of them can unfold to gigabytes), or is too deep.
    """
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError('aliases (*name) are not allowed')
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST_YAML:
            raise yaml.YAMLError(f'more than {_DEEPEST_YAML} levels deep')
        if isinstance(event, yaml.ScalarEvent) and event.implicit[0] and len(event.value) > _LONGEST_SCALAR:
            raise yaml.YAMLError(f'a value of {len(event.value)} characters without quotes')


def read_yaml(path: Path, largest: int = _LARGEST_YAML) -> Any:
    """Document of a YAML file, plain data only.

    Args:
        path: The file.
        largest: Size beyond which it is refused [bytes].

    Raises:
        ValueError: The file is missing, not readable, too large or not plain YAML; one line that names it.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # a pipe or a device never ends
            raise ValueError(f'{path}: not a file')
        with path.open('rb') as file:
            data = file.read(largest + 1)
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror}') from None
    return parse_yaml(data, str(path), largest)


def parse_yaml(data: bytes, where: str, largest: int = _LARGEST_YAML) -> Any:
    """Document in YAML, plain data only; ``where`` it is from is for the error message.

    Raises:
        ValueError: It is larger than ``largest`` bytes, or not plain YAML.
    """
    if len(data) > largest:
        raise ValueError(f'{where}: larger than {largest} bytes, not a file of this kind')
    try:
        text = data.decode('utf-8')
        _check_plain(text)
        return _PlainLoader(text).get_single_data()
    except (yaml.YAMLError, RecursionError, *_CONSTRUCTOR_ERRORS) as error:
        raise ValueError(f'{where}: not plain YAML: {" ".join(str(error).split())}') from None


def share_directory(package: str, module_file: str) -> Path:
    """Folder that holds what a package installs besides code.

    Looked for beside and above the code: ``share/<package>`` of an install prefix, or the source tree itself.

    Raises:
        FileNotFoundError: There is none.
    """
    paths = (Path(module_file), Path(module_file).resolve())  # a colcon --symlink-install has links into the source
    for parent in (parent for path in paths for parent in path.parents):
        for candidate in (parent / 'share' / package, parent):
            manifest = candidate / 'package.xml'
            if manifest.is_file() and f'<name>{package}</name>' in manifest.read_text(encoding='utf-8'):
                return candidate
    raise FileNotFoundError(f'no share folder of {package} above {module_file}')


def config_path(kind: str, name: str) -> Path:
    """Path of a configuration file: ``name`` itself if it is a path, else ``config/<kind>/<name>.yaml``."""
    if '/' in name or name.endswith('.yaml'):
        try:
            return Path(name).expanduser()
        except RuntimeError as error:
            raise ValueError(f'{name}: {error}') from None
    return share_directory('seal_friction_ros', __file__) / 'config' / kind / f'{name}.yaml'


def load_configuration(
    selection: SealSelection, settings: EstimatorSettings, feedforward: FeedForwardSettings = DEFAULT_FEEDFORWARD
) -> Configuration:
    """Configuration with the seal files that ``selection`` names.

    Raises:
        ValueError: A seal file cannot be read or makes no sense; one line that names file, field, value and bound.
    """
    paths = [config_path('seals', name) for name in selection.seals]
    configuration = Configuration(selection, tuple(read_yaml(path) for path in paths), settings, feedforward)
    try:
        configuration.parameters()
    except ValueError as error:
        raise ValueError(f'{", ".join(sorted({str(p) for p in paths}))}: {error}') from None
    return configuration


def load_seals(selection: SealSelection) -> tuple[MountedSeal, ...]:
    """The seals that ``selection`` names.

    Raises:
        ValueError: As `load_configuration`.
    """
    return load_configuration(selection, EstimatorSettings()).parameters().estimator.seals


def default_configuration() -> Configuration:
    """Configuration of a node that was told nothing."""
    return load_configuration(SealSelection(), EstimatorSettings())


FEEDFORWARD_PREFIX = 'feedforward.'
"""What the ROS parameters of the feed-forward begin with."""


def load_parameter_file(path: Path) -> tuple[SealSelection, EstimatorSettings, FeedForwardSettings]:
    """What the parts of a ROS parameter file that are for ``friction_estimator`` or every node say.

    A file with one node only is for that node, whatever its name. Parameters of the node that are not the estimator's
    (recording, QoS) are passed over.

    Raises:
        ValueError: The file is no parameter file, or a value makes no sense.
    """
    document = read_yaml(path)
    values: dict[str, Any] = {}
    try:
        for node, content in document.items():
            if len(document) == 1 or str(node).rsplit('/', maxsplit=1)[-1] in ('friction_estimator', '*', '**'):
                values.update(_flat(content['ros__parameters']))
    except (AttributeError, KeyError, TypeError):
        raise ValueError(f'{path}: not a ROS parameter file (NODE: ros__parameters: NAME: VALUE)') from None
    chosen: dict[type, dict[str, Any]] = {SealSelection: {}, EstimatorSettings: {}, FeedForwardSettings: {}}
    known: dict[str, tuple[type, str]] = {
        name: (record, name) for record in (SealSelection, EstimatorSettings) for name in meanings(record)
    }
    known |= {FEEDFORWARD_PREFIX + name: (FeedForwardSettings, name) for name in meanings(FeedForwardSettings)}
    unknown = sorted(name for name in values if name not in known and name.split('.')[0] not in _OF_THE_NODE)
    if unknown:
        raise ValueError(f'{path}: friction_estimator has no parameter {", ".join(map(plain, unknown))}')
    for name, value in values.items():
        if name in known:
            record, field = known[name]
            chosen[record][field] = value
    return (
        from_mapping(SealSelection, chosen[SealSelection], str(path)),
        from_mapping(EstimatorSettings, chosen[EstimatorSettings], str(path)),
        from_mapping(FeedForwardSettings, chosen[FeedForwardSettings], str(path)),
    )


def _flat(values: Any, above: str = '') -> dict[str, Any]:
    """Parameters with the dotted names that ROS gives to nested ones."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f'{above}{name}.') if isinstance(value, dict) else {f'{above}{name}': value}
    return flat
