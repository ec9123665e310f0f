"""What the nodes of this package have in common: lifecycle, parameters from dataclasses, diagnostics once a second."""

from typing import Any, TypeVar

import seal_friction_msgs.msg
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from seal_friction_ros.nodes.parameters import Group, StartOptions, declare, read
from seal_friction_ros.nodes.realtime import take_realtime_priority

Record = TypeVar('Record')

_DIAGNOSTICS_PERIOD = 1.0  # [s]


def message_class(type_name: str) -> Any:
    """Class of a message of this project, for rclpy, from its full name."""
    return getattr(seal_friction_msgs.msg, type_name.rpartition('/')[2])


class ManagedNode(LifecycleNode):
    """Lifecycle node that configures and activates itself unless told not to, and refuses parameters without sense.

    A node of its own overrides `make`, `release`, `start`, `finish`, `diagnostics` and, if it likes, `check_change` and
    `on_change`.

    Raises:
        ValueError: A parameter is of the wrong type or out of bounds.
    """

    def __init__(self, name: str, groups: tuple[Group, ...], **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self.active = False
        self.configured = False
        self._groups = {group.record_type: group for group in (Group(StartOptions), *groups)}
        self._diagnostics_timer: Any = None
        self._diagnostics_publisher: Any = None
        try:
            for group in self._groups.values():
                declare(self, group)
        except ParameterException as error:
            raise ValueError(str(error)) from None
        # rclpy passes over what nobody declares, so a misspelt name would leave its default without a word.
        given = getattr(self, '_parameter_overrides', {})
        unknown = sorted(n for n in given if not n.startswith('qos_overrides') and not self.has_parameter(n))
        if unknown:
            self.get_logger().warning(f'no such parameter: {", ".join(unknown)}')
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self.add_post_set_parameters_callback(self._on_parameters_set)

    # --- what a node of its own does ---

    def make(self) -> None:
        """Make what the node needs while it is configured.

        Raises:
            Exception: It cannot be made: said in the log, and the node stays unconfigured.
        """

    def release(self) -> None:
        """Give back whatever `make` made, also after it failed half-way."""

    def start(self) -> None:
        """Begin to work: called while the node gets active."""

    def finish(self) -> None:
        """End work: called before the node gets inactive, and at its end whatever happened."""

    def diagnostics(self) -> dict[str, DiagnosticStatus]:
        """State of each part of the node, by the name of the part."""
        return {}

    def end_interval(self) -> None:
        """Begin a new interval of what is counted between two diagnostics; called once a second."""

    def check_change(self, changed: dict[type, Any]) -> None:
        """Refuse, by a ValueError, a change of parameters that makes no sense with the others."""

    def on_change(self) -> None:
        """Take changed parameters over; called while the node is configured."""

    # --- parameters ---

    def settings(self, record_type: type[Record], **changed: Any) -> Record:
        """The dataclass made from the parameters as they are, with ``changed`` in place of those it names.

        Raises:
            ValueError: The values make no sense.
        """
        return read(self, record_type, self._groups[record_type].prefix, **changed)

    def _on_set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Accept or refuse a set of changes as a whole."""
        values = {p.name: p.value for p in parameters}
        made: dict[type, Any] = {}
        for record_type, group in self._groups.items():
            names = {name: field for name, field in group.names().items() if name in values}
            fixed = sorted(names.keys() & group.fixed())
            if fixed and self.configured:
                reason = f'{", ".join(fixed)}: can only change while the node is unconfigured; clean it up first'
                return SetParametersResult(successful=False, reason=reason)
            if not names:
                continue
            try:
                made[record_type] = self.settings(record_type, **{f: values[name] for name, f in names.items()})
            except (ValueError, TypeError) as error:
                return SetParametersResult(successful=False, reason=str(error))
        try:
            self.check_change(made)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _on_parameters_set(self, parameters: list[Parameter]) -> None:
        del parameters
        if self.configured:
            self.on_change()

    # --- lifecycle ---

    def autostart(self) -> bool:
        """Configure and activate, if the parameters say so; False if that failed, which is logged."""
        if not self.settings(StartOptions).autostart:
            return True
        success = TransitionCallbackReturn.SUCCESS
        return self.trigger_configure() == success and self.trigger_activate() == success

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Make what the node needs."""
        try:
            self._diagnostics_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
            self.make()
            take_realtime_priority(self.settings(StartOptions).realtime_priority)
            # By steady time diagnostics go on while simulated time stands still.
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._diagnostics_timer = self.create_timer(_DIAGNOSTICS_PERIOD, self._on_timer, clock=steady)
        except Exception as error:  # noqa: BLE001  rclpy swallows what a transition raises, so it is said here
            self.get_logger().error(str(error))
            self._release()
            return TransitionCallbackReturn.FAILURE
        self.configured = True
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to work."""
        result = super().on_activate(state)
        try:
            self.start()
        except Exception as error:  # noqa: BLE001  as above
            self.get_logger().error(f'not activated: {error!r}')
            return TransitionCallbackReturn.FAILURE
        self.active = True
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End work."""
        self.finish()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give back what was made."""
        self._release()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End work and give everything back."""
        self.finish()
        self._release()
        return super().on_shutdown(state)

    def _release(self) -> None:
        self.configured = False
        if self._diagnostics_timer is not None:
            self.destroy_timer(self._diagnostics_timer)
        if self._diagnostics_publisher is not None:
            self.destroy_publisher(self._diagnostics_publisher)
        self._diagnostics_timer = self._diagnostics_publisher = None
        self.release()

    def on_matched(self, _: Any) -> None:
        """Say at once, in diagnostics, that a publisher came or went."""
        if self._diagnostics_timer is not None:
            self.publish_diagnostics()

    def _on_timer(self) -> None:
        self.publish_diagnostics()
        self.end_interval()

    def publish_diagnostics(self) -> None:
        """Say now how the node is."""
        message = DiagnosticArray()
        for part, status in self.diagnostics().items():
            status.name = f'{self.get_fully_qualified_name()}: {part}'
            message.status.append(status)
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics_publisher.publish(message)
