"""ROS parameters declared from the dataclasses that hold them: one place for default, unit, bounds and meaning."""

import dataclasses
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterUninitializedException
from rclpy.node import Node

from seal_friction_ros.core.validated import Meaning, meanings, parameter

Record = TypeVar('Record')


@dataclasses.dataclass(frozen=True)
class NodeOptions:
    """What the estimator node does besides estimating, one field per ROS parameter.

    Raises:
        ValueError: The name of the bag is not a plain name: it could lead out of the folder.
    """

    autostart: bool = parameter(True, unit='', live=False, description='Configure and activate by itself at start.')
    record: bool = parameter(False, unit='', live=False, description='Record from activation on.')
    record_directory: str = parameter('.', unit='', description='Folder in which bags are made.')
    record_name: str = parameter(
        '', unit='', description='Name of the bag; never overwritten. Empty: friction_ and the time of its start.'
    )

    def __post_init__(self) -> None:
        if '/' in self.record_name or not self.record_name.isprintable() or self.record_name in ('.', '..'):
            raise ValueError(f'NodeOptions.record_name = {self.record_name!r} is not a plain name of a folder')


def declare(node: Node, record_type: type) -> None:
    """Declare every described field of a dataclass as a parameter of the node.

    Raises:
        rclpy.exceptions.ParameterException: An override has the wrong type or is out of bounds.
    """
    defaults = {field.name: field.default for field in dataclasses.fields(record_type)}
    for name, meaning in meanings(record_type).items():
        default = defaults[name]
        value = list(default) if isinstance(default, tuple) else default
        node.declare_parameter(name, value, _descriptor(meaning, default))


def read(node: Node, record_type: type[Record], **changed: Any) -> Record:
    """Make the dataclass from the parameters of the node, with ``changed`` in place of those it names.

    Raises:
        ValueError: The values make no sense; one line that names field, value and bound.
    """
    try:
        values = {name: changed.get(name, node.get_parameter(name).value) for name in meanings(record_type)}
    except ParameterUninitializedException as error:  # an empty list has no type, so it counts as none
        raise ValueError(f'{record_type.__name__}: a list is empty: {error}') from None
    return record_type(**{name: tuple(v) if isinstance(v, list) else v for name, v in values.items()})


def _descriptor(meaning: Meaning, default: Any) -> ParameterDescriptor:
    unit = f' [{meaning.unit}]' if meaning.unit else ''
    descriptor = ParameterDescriptor(description=f'{meaning.description}{unit}')
    if not meaning.live:
        descriptor.additional_constraints = 'Can only change while the node is unconfigured.'
    if meaning.lower is not None and meaning.upper is not None:
        if isinstance(default, float):
            bounds = FloatingPointRange(from_value=float(meaning.lower), to_value=float(meaning.upper))
            descriptor.floating_point_range = [bounds]
        else:
            descriptor.integer_range = [IntegerRange(from_value=int(meaning.lower), to_value=int(meaning.upper))]
    return descriptor
