"""ROS parameters of the friction estimator: the table of their groups, and the options of the node itself.

The ROS declaration (``nodes/estimator_node.py``), the check of a parameter file (``files.load_parameter_file``) and
the tables in docs/interfaces.md (``tools/make_docs.py``) follow from the table.
"""

from dataclasses import dataclass

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.foundation.parameters import ParameterGroup, check, parameter

_SMALLEST = {  # besides 0
    'record_split_size': 1_000_000,  # [bytes]
    'record_split_duration': 10.0,  # [s]
    'record_state_period': 0.5,  # [s]
    'record_keep_size': 10_000_000,  # [bytes]
}


@dataclass(frozen=True)
class StartOptions:
    """Start of a node, one ROS parameter per field.

    Raises:
        ValueError: A value is out of bounds.
    """

    autostart: bool = parameter(True, unit='', live=False, description='Configure and activate automatically at start.')
    realtime_priority: int = parameter(
        0,
        unit='',
        lower=0,
        upper=99,
        live=False,
        description='SCHED_FIFO priority of the whole process from configuration on; 0: none.',
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class InputOptions:
    """Acceptance of inputs, one ROS parameter per field."""

    refuse_second_publisher: bool = parameter(
        True,
        unit='',
        description='Reject all inputs while an input or output topic has more than one publisher: the estimate is '
        'invalid and the feed-forward fades out.',
    )


@dataclass(frozen=True)
class RecordingOptions:
    """Recording, one ROS parameter per field.

    Raises:
        ValueError: A value is out of bounds, the name of the bag could lead out of the folder, or bags, their files
            or the time between two states would be so small that there are thousands of them.
    """

    record: bool = parameter(False, unit='', live=False, description='Start recording at activation.')
    record_directory: str = parameter('.', unit='', description='Parent folder of the bags.')
    record_name: str = parameter(
        '', unit='', description='Name of the bag, never overwritten. Empty: friction_ and the start time.'
    )
    record_split_size: int = parameter(
        0, unit='bytes', lower=0, upper=10**15, description='Largest size of one file of the bag; 0: no limit.'
    )
    record_split_duration: float = parameter(
        0.0, unit='s', lower=0.0, upper=1e9, description='Longest duration of one file of the bag; 0: no limit.'
    )
    record_state_period: float = parameter(
        60.0,
        unit='s',
        lower=0.0,
        upper=1e9,
        description='friction_estimator only: time between two snapshots of configuration and state in a bag, for '
        'replay by several workers; 0: one at its beginning. A change acts on the next recording.',
    )
    record_free_space: int = parameter(
        1_000_000_000,
        unit='bytes',
        lower=0,
        upper=10**15,
        description='Space that recording leaves free on the disk: it stops before, and continues in a new bag once '
        'there is room again. 0: it stops when the disk is full.',
    )
    record_keep_size: int = parameter(
        0,
        unit='bytes',
        lower=0,
        upper=10**15,
        description='Largest size of all bags of this node in record_directory: it deletes its oldest finished ones, '
        'and begins a new bag after each tenth of this size. 0: keep all.',
    )

    def __post_init__(self) -> None:
        check(self)
        for name, least in _SMALLEST.items():
            value = getattr(self, name)
            if 0 < value < least:
                raise ValueError(f'RecordingOptions.{name} = {value} is too small: 0 or at least {least}')
        if '/' in self.record_name or not self.record_name.isprintable() or self.record_name in ('.', '..'):
            raise ValueError(f'RecordingOptions.record_name = {self.record_name!r} is not a plain name of a folder')


FEEDFORWARD_PREFIX = 'feedforward.'
"""Start of the names of the feed-forward parameters."""

ADAPTATION_PREFIX = 'adaptation.'
"""Start of the names of the parameters of the adaptation."""

FRICTION_ESTIMATOR_PARAMETERS = (
    ParameterGroup(StartOptions),
    ParameterGroup(SealSelection),
    ParameterGroup(EstimatorSettings),
    ParameterGroup(FeedForwardSettings, FEEDFORWARD_PREFIX),
    ParameterGroup(AdaptationSettings, ADAPTATION_PREFIX),
    ParameterGroup(InputOptions),
    ParameterGroup(RecordingOptions),
)
"""Every parameter that the node ``friction_estimator`` declares."""


@dataclass(frozen=True)
class MachineOptions:
    """The machine, one ROS parameter per field."""

    machine: str = parameter(
        '', unit='', live=False, description='Mapping file: a path, or the name of one in config/machines.'
    )


MACHINE_ESTIMATOR_PARAMETERS = (
    ParameterGroup(StartOptions),
    ParameterGroup(MachineOptions),
    ParameterGroup(InputOptions),
    ParameterGroup(RecordingOptions),
)
"""Every parameter that the node ``machine_estimator`` declares; those of each actuator come from its mapping file."""

_VELOCITY_TERMS = 'velocity_terms of the seal file'
REMOVED_PARAMETERS = {
    'feedforward.coulomb_scale': 'feedforward.scale',
    'feedforward.viscous_scale': 'feedforward.scale',
    'feedforward.stribeck_scale': 'feedforward.scale',
    'feedforward.viscous_friction': _VELOCITY_TERMS,
    'feedforward.stribeck_velocity': _VELOCITY_TERMS,
    'feedforward.stribeck_exponent': _VELOCITY_TERMS,
}
"""Parameter of an earlier version -> what replaces it."""

ROS_PARAMETERS = ('use_sim_time', 'start_type_description_service', 'qos_overrides')
"""Parameters and parameter groups that rclpy declares for every node."""
