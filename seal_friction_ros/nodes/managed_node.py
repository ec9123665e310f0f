"""Base class of the nodes: lifecycle, parameters from dataclasses, diagnostics once a second."""

import dataclasses
import inspect
import os
import re
import time
from collections.abc import Callable, Collection, Mapping
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException, ParameterUninitializedException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter

from seal_friction_ros.core.estimation.node_options import FEEDFORWARD_PREFIX, StartOptions
from seal_friction_ros.core.foundation.parameters import Meaning, ParameterGroup, meanings
from seal_friction_ros.files import unknown_parameters

Record = TypeVar('Record')

_DIAGNOSTICS_PERIOD = 1.0  # [s]
OVERDUE = 50_000_000  # [ns] by which a timer may be late
_SIMILAR = 0.8  # [-] of `difflib`; our choice


def message_class(type_name: str) -> Any:
    """Python class of a message, from its full type name; ValueError if the type is not installed."""
    package, _, name = type_name.partition('/msg/')
    try:
        return getattr(import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError):
        raise ValueError(f'{type_name} is not installed: install the package {package}') from None


def take_realtime_priority(priority: int) -> None:
    """Schedule every present and future thread of this process with SCHED_FIFO, 1 (lowest) to 99; 0 changes nothing.

    ValueError: the system does not grant the priority.
    """
    if not priority:
        return
    try:
        for thread in Path('/proc/self/task').iterdir():
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, AttributeError) as error:
        hint = f'give the user an rtprio limit of {priority} (/etc/security/limits.conf) or the process CAP_SYS_NICE'
        reason = f'realtime_priority = {priority} is not granted: {error}'
        raise ValueError(f'{reason}: {hint}, or set realtime_priority to 0') from None


def _may_limit_force(unknown: str, declared: Collection[str]) -> bool:
    """Whether who gave an unknown parameter may have meant one of the feed-forward: its off switch, for example.

    Names of a machine begin with the name of an actuator.
    """
    parts, letters = unknown.split('.'), re.sub('[^a-z]', '', unknown.lower())
    wanted = [name for name in declared if FEEDFORWARD_PREFIX in name]
    is_similar = bool(get_close_matches(unknown, wanted, n=1, cutoff=_SIMILAR))
    return 'feedforward' in letters or parts[-1] == 'scale' or is_similar


def status_of(level: bytes, message: str, values: Mapping[str, object] | None = None) -> DiagnosticStatus:
    """Status of a part of a node, with values by name and unit."""
    pairs = [KeyValue(key=key, value=str(value)) for key, value in (values or {}).items()]
    return DiagnosticStatus(level=level, message=message, values=pairs)


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


class _SteadyTimer:
    """When a timer with a period [ns] was called last."""

    def __init__(self, callback: Callable[[], None], period: int) -> None:
        self._callback, self._period, self._called = callback, period, time.monotonic_ns()

    def call(self) -> None:
        """Call it now."""
        self._called = time.monotonic_ns()
        self._callback()

    def was_just_called(self) -> bool:
        """Whether less than half a period has passed: after a call out of turn."""
        return 2 * (time.monotonic_ns() - self._called) < self._period

    def is_overdue(self) -> bool:
        """Whether the executor is late."""
        return time.monotonic_ns() - self._called > self._period + OVERDUE


class ManagedNode(LifecycleNode):
    """Lifecycle node that configures and activates automatically (``autostart``) and rejects invalid parameters.

    A subclass overrides `make`, `release`, `start`, `finish`, `diagnostics` and optionally `check_change`, `on_change`
    and `end_interval`. ValueError: A parameter has the wrong type or is out of bounds.
    """

    def __init__(self, name: str, groups: tuple[ParameterGroup, ...], **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self.active = False
        self.configured = False
        self._groups = groups
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._steady_timers: dict[Any, _SteadyTimer] = {}
        self._diagnostics_publisher: Any = None
        try:
            for group in groups:
                declare(self, group)
            self._groups += self.more_groups()
            for group in self._groups[len(groups) :]:
                declare(self, group)
        except ParameterException as error:
            raise ValueError(str(error)) from None
        # rclpy ignores overrides of undeclared parameters silently.
        given = getattr(self, '_parameter_overrides', {})
        unknown = [n for n in given if not n.startswith('qos_overrides') and not self.has_parameter(n)]
        declared = [n for group in self._groups for n in group.names()]
        if any(_may_limit_force(n, declared) for n in unknown):
            raise ValueError(unknown_parameters(name, unknown, declared))
        if unknown:
            self.get_logger().warning(f'ignored: {unknown_parameters(name, unknown, declared)}')
        floats = {name for group in self._groups for name in numbers(group)}
        self.add_pre_set_parameters_callback(lambda changes: [with_declared_type(p, floats) for p in changes])
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self.add_post_set_parameters_callback(self._on_parameters_set)

    # --- overridden by subclasses ---

    def more_groups(self) -> tuple[ParameterGroup, ...]:
        """Groups of parameters that depend on other parameters, which are declared already."""
        return ()

    def make(self) -> None:
        """Create everything that the node needs while it is configured.

        If it raises, the node logs the error and stays unconfigured.
        """

    def release(self) -> None:
        """Destroy everything that `make` created, also after `make` failed half-way."""

    def start(self) -> None:
        """Start work; called during activation."""

    def finish(self) -> None:
        """Stop work; called before deactivation and at the end of the process."""

    def diagnostics(self) -> dict[str, DiagnosticStatus]:
        """Status of each part of the node, by the name of the part."""
        return {}

    def end_interval(self) -> None:
        """Start a new counting interval; called once a second after the diagnostics."""

    def check_change(self, changed: Mapping[ParameterGroup, Any]) -> None:
        """Reject changed records, by group, that contradict other parameters, by a ValueError."""

    def on_change(self, changed: Collection[Parameter]) -> None:
        """Apply changed parameters; called while the node is configured."""

    # --- parameters ---

    def settings(self, record_type: type[Record], prefix: str | None = None, **changed: Any) -> Record:
        """The dataclass made from the present parameters; ``changed`` overrides fields.

        ValueError if a value is invalid. Without a ``prefix`` it is that of the first group of the type.
        """
        found = (group.prefix for group in self._groups if group.record_type is record_type)
        return read(self, record_type, next(found) if prefix is None else prefix, **changed)

    def _on_set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Accept or reject a set of changes as a whole."""
        values = {p.name: p.value for p in parameters}
        made: dict[ParameterGroup, Any] = {}
        try:
            for group in self._groups:
                names = {name: field for name, field in group.names().items() if name in values}
                fixed = sorted(names.keys() & group.fixed())
                if fixed and self.configured:
                    what = 'can only change while the node is unconfigured; clean it up first'
                    raise ValueError(f'{", ".join(fixed)}: {what}')
                if names:
                    changed = {field: values[name] for name, field in names.items()}
                    made[group] = self.settings(group.record_type, group.prefix, **changed)
            self.check_change(made)
        except (ValueError, TypeError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _on_parameters_set(self, parameters: list[Parameter]) -> None:
        if self.configured:
            self.on_change(parameters)

    # --- lifecycle ---

    def autostart(self) -> bool:
        """Configure and activate if ``autostart`` is set; False if a transition failed, with the error logged."""
        if not self.settings(StartOptions).autostart:
            return True
        success = TransitionCallbackReturn.SUCCESS
        return self.trigger_configure() == success and self.trigger_activate() == success

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Create everything that the node needs."""
        try:
            self._diagnostics_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
            self.make()
            take_realtime_priority(self.settings(StartOptions).realtime_priority)
            self.create_steady_timer(_DIAGNOSTICS_PERIOD, self._on_timer)
        except Exception as error:  # noqa: BLE001  rclpy swallows exceptions of transitions
            self.get_logger().error(str(error))
            self._release()
            return TransitionCallbackReturn.FAILURE
        self.configured = True
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start work."""
        result = super().on_activate(state)
        try:
            self.start()
        except Exception as error:  # noqa: BLE001  see above
            self.get_logger().error(f'not activated: {error!r}')
            return TransitionCallbackReturn.FAILURE
        self.active = True
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop work."""
        self.finish()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy everything that was created."""
        self._release()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop work and destroy everything that was created."""
        self.finish()
        self._release()
        return super().on_shutdown(state)

    def _release(self) -> None:
        self.configured = False
        for timer in self._steady_timers:
            self.destroy_timer(timer)
        self._steady_timers.clear()
        if self._diagnostics_publisher is not None:
            self.destroy_publisher(self._diagnostics_publisher)
        self._diagnostics_publisher = None
        self.release()

    def create_steady_timer(self, period: float, callback: Callable[[], None]) -> Any:
        """Timer with ``period`` [s] of steady time, which continues while simulated time stands still, until `release`.

        An executor may call a timer that was due just before its destruction: unconfigured, the node ignores the call.
        """
        made = _SteadyTimer(callback, round(period * 1e9))

        def call() -> None:
            if self.configured and not made.was_just_called():
                made.call()

        # rclpy asks for the signature at every call; without a ready one that is most of the time of a short callback.
        vars(call)['__signature__'] = inspect.Signature()
        timer = self.create_timer(period, call, clock=self._steady_clock)
        self._steady_timers[timer] = made
        return timer

    def call_overdue_timers(self) -> None:
        """Call the timers that the executor has not called in time.

        An executor that is behind with messages takes these first: on a machine that is too busy a timer comes seconds
        late. A node calls this after a message.
        """
        for made in list(self._steady_timers.values()):
            if self.configured and made.is_overdue():
                made.call()

    def _on_timer(self) -> None:
        self.publish_diagnostics()
        self.end_interval()

    def publish_diagnostics(self) -> None:
        """Publish the present diagnostics."""
        self._diagnostics_publisher.publish(self.status_array(self.diagnostics()))

    def status_array(self, parts: Mapping[str, DiagnosticStatus]) -> DiagnosticArray:
        """Message of the status of parts of this node."""
        message = DiagnosticArray()
        for part, status in parts.items():
            status.name = f'{self.get_fully_qualified_name()}: {part}'
            message.status.append(status)
        message.header.stamp = self.get_clock().now().to_msg()
        return message
