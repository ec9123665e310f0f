"""ROS parameters declared from the dataclasses that hold them: one place for default, unit, bounds and meaning."""

import dataclasses
from typing import Any, NamedTuple, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterUninitializedException
from rclpy.node import Node

from seal_friction_ros.core.foundation.parameters import Meaning, check, meanings, parameter

Record = TypeVar('Record')


@dataclasses.dataclass(frozen=True)
class StartOptions:
    """How a node starts, one field per ROS parameter."""

    autostart: bool = parameter(True, unit='', live=False, description='Configure and activate by itself at start.')
    realtime_priority: int = parameter(
        0,
        unit='',
        lower=0,
        upper=99,
        live=False,
        description='SCHED_FIFO priority of the whole process from configuration on; 0: none.',
    )


@dataclasses.dataclass(frozen=True)
class InputOptions:
    """Who may send inputs, one field per ROS parameter."""

    refuse_second_publisher: bool = parameter(
        False,
        unit='',
        description='While an input, or what this node publishes, has more than one publisher, no input counts: '
        'the estimate is invalid and the feed-forward fades out.',
    )


@dataclasses.dataclass(frozen=True)
class RecordingOptions:
    """What is recorded and where, one field per ROS parameter.

    Raises:
        ValueError: The name of the bag is not a plain name: it could lead out of the folder. Or files would be so small
            that a bag has thousands of them.
    """

    record: bool = parameter(False, unit='', live=False, description='Record from activation on.')
    record_directory: str = parameter('.', unit='', description='Folder in which bags are made.')
    record_name: str = parameter(
        '', unit='', description='Name of the bag; never overwritten. Empty: friction_ and the time of its start.'
    )
    record_split_size: int = parameter(
        0,
        unit='bytes',
        lower=0,
        upper=10**15,
        description='A new file of the bag begins where one would grow larger; 0: never.',
    )
    record_split_duration: float = parameter(
        0.0,
        unit='s',
        lower=0.0,
        upper=1e9,
        description='A new file of the bag begins where one would become longer; 0: never.',
    )

    def __post_init__(self) -> None:
        check(self)
        for name, least in (('record_split_size', 1_000_000), ('record_split_duration', 10.0)):
            value = getattr(self, name)
            if 0 < value < least:
                raise ValueError(f'RecordingOptions.{name} = {value} makes too many files: 0 or at least {least}')
        if '/' in self.record_name or not self.record_name.isprintable() or self.record_name in ('.', '..'):
            raise ValueError(f'RecordingOptions.record_name = {self.record_name!r} is not a plain name of a folder')


class Group(NamedTuple):
    """ROS parameters that one dataclass holds."""

    record_type: type
    prefix: str = ''
    """what their names begin with, its dot included"""
    live: bool = True
    """False: none of them changes while the node is configured"""

    def names(self) -> dict[str, str]:
        """Name of each ROS parameter -> field of the dataclass."""
        return {self.prefix + name: name for name in meanings(self.record_type)}

    def fixed(self) -> set[str]:
        """ROS parameters that do not change while the node is configured."""
        described = meanings(self.record_type).items()
        return {self.prefix + name for name, meaning in described if not (self.live and meaning.live)}


def declare(node: Node, group: Group) -> None:
    """Declare every described field of a dataclass as a parameter of the node.

    Raises:
        rclpy.exceptions.ParameterException: An override has the wrong type or is out of bounds.
    """
    defaults = {field.name: field.default for field in dataclasses.fields(group.record_type)}
    fixed = group.fixed()
    for name, meaning in meanings(group.record_type).items():
        default = defaults[name]
        value = list(default) if isinstance(default, tuple) else default
        where = group.prefix + name
        node.declare_parameter(where, value, _descriptor(meaning, default, where not in fixed))


def read(node: Node, record_type: type[Record], prefix: str = '', **changed: Any) -> Record:
    """Make the dataclass from the parameters of the node, with ``changed`` in place of those it names.

    Raises:
        ValueError: The values make no sense; one line that names field, value and bound.
    """
    try:
        values = {name: changed.get(name, node.get_parameter(prefix + name).value) for name in meanings(record_type)}
    except ParameterUninitializedException as error:  # an empty list has no type, so it counts as none
        raise ValueError(f'{record_type.__name__}: a list is empty: {error}') from None
    return record_type(**{name: tuple(v) if isinstance(v, list) else v for name, v in values.items()})


def _descriptor(meaning: Meaning, default: Any, live: bool) -> ParameterDescriptor:
    unit = f' [{meaning.unit}]' if meaning.unit else ''
    descriptor = ParameterDescriptor(description=f'{meaning.description}{unit}')
    if not live:
        descriptor.additional_constraints = 'Can only change while the node is unconfigured.'
    if meaning.lower is not None and meaning.upper is not None:
        if isinstance(default, float):
            bounds = FloatingPointRange(from_value=float(meaning.lower), to_value=float(meaning.upper))
            descriptor.floating_point_range = [bounds]
        else:
            descriptor.integer_range = [IntegerRange(from_value=int(meaning.lower), to_value=int(meaning.upper))]
    return descriptor
