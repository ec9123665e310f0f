"""ROS parameters declared and read from the dataclasses that hold them."""

import dataclasses
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterUninitializedException
from rclpy.node import Node
from rclpy.parameter import Parameter

from seal_friction_ros.core.foundation.parameters import Meaning, ParameterGroup, meanings

Record = TypeVar('Record')


def declare(node: Node, group: ParameterGroup) -> None:
    """Declare the parameters of a group; a number may be given as a whole number.

    rclpy.exceptions.ParameterException: an override has the wrong type or is out of bounds.
    """
    defaults = {field.name: field.default for field in dataclasses.fields(group.record_type)}
    if group.defaults is not None:
        defaults = {name: getattr(group.defaults, name) for name in defaults}
    described, fixed = meanings(group.record_type), group.fixed()
    for name, field in group.names().items():
        default = defaults[field]
        value = list(default) if isinstance(default, tuple) else default
        descriptor = _descriptor(described[field], default, name not in fixed)
        given = getattr(node, '_parameter_overrides', {}).get(name)
        taken = given and with_declared_type(given, numbers(group))
        if taken is given:
            node.declare_parameter(name, value, descriptor)
        else:
            node.declare_parameter(name, taken.value, descriptor, ignore_override=True)


def numbers(group: ParameterGroup) -> set[str]:
    """Parameters of a group that are floating-point numbers."""
    defaults = {field.name: field.default for field in dataclasses.fields(group.record_type)}
    return {name for name, field in group.names().items() if isinstance(defaults[field], float)}


def with_declared_type(parameter: Parameter, numbers: set[str]) -> Parameter:
    """The parameter, a whole number as a floating-point number if it is one of ``numbers``.

    ROS refuses ``ros2 param set NODE feedforward.force_limit 0`` otherwise, since 0 is an integer in YAML.
    """
    if parameter.name in numbers and parameter.type_ == Parameter.Type.INTEGER:
        return Parameter(parameter.name, Parameter.Type.DOUBLE, float(parameter.value))
    return parameter


def read(node: Node, record_type: type[Record], prefix: str = '', **changed: Any) -> Record:
    """Make the dataclass from the parameters of the node; ``changed`` overrides fields.

    ValueError, in one line that names field, value and bound: a value is invalid.
    """
    try:
        values = {name: changed.get(name, node.get_parameter(prefix + name).value) for name in meanings(record_type)}
    except ParameterUninitializedException as error:  # an empty list has no type: rclpy treats it as not set
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
