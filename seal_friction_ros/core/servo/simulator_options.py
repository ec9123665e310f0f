"""ROS parameters of the node servo_simulator."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.node_options import StartOptions
from seal_friction_ros.core.foundation.parameters import CheckedParameters, ParameterGroup, parameter
from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.cylinder import Cylinder
from seal_friction_ros.core.servo.elastic_plant import ELASTICITIES, RIGID, seals_of_plant
from seal_friction_ros.core.servo.hydraulics import ServoValve
from seal_friction_ros.core.servo.motions import Chirp, PullTest, Sine, Step, Trapezoid
from seal_friction_ros.core.servo.plant import Load
from seal_friction_ros.core.servo.pneumatics import PneumaticValve
from seal_friction_ros.core.servo.position_servo import ServoParameters
from seal_friction_ros.core.servo.sensors import SensorSettings

WAVES: dict[str, type[Any]] = {'sine': Sine, 'step': Step, 'trapezoid': Trapezoid, 'chirp': Chirp}
"""Reference programs of the simulator, by the value of ``wave``."""

PLANT: dict[str, type[Any]] = {
    'valve': ServoValve,
    'pneumatic_valve': PneumaticValve,
    'cylinder': Cylinder,
    'load': Load,
    'controller': ServoController,
}
"""Parts of the simulated servo, by the prefix of their parameters."""

VALVES: dict[str, type[Any]] = {'hydraulic': ServoValve, 'pneumatic': PneumaticValve}
"""Valve of the plant, by the value of ``fluid``."""


@dataclass(frozen=True)
class SimulatorSettings(CheckedParameters):
    """Settings of the simulation, one ROS parameter per field.

    ValueError: a value is out of bounds or unknown, ``time_factor`` needs ``publish_clock``, or standard messages have
    no form of ``wave``.
    """

    wave: str = parameter(
        'sine',
        unit='',
        choices=(*WAVES, 'topic', 'pull_test'),
        description='Reference: sine, step, trapezoid, chirp; topic; or pull_test, a rig without servo.',
    )
    reference_resolution: float = parameter(
        0.0, unit='m', lower=0.0, upper=0.1,
        description='Step of the positions of sine to chirp; their differences are its velocity. 0: continuous.'
    )  # fmt: skip
    fluid: str = parameter(
        'hydraulic', unit='', choices=VALVES, live=False, description='hydraulic, or pneumatic: pneumatic_valve.'
    )
    seal_elasticity: str = parameter(
        RIGID, unit='', choices=ELASTICITIES, live=False,
        description='Seals of the plant: rigid; elements: presliding of the seal files; lugre: LuGre as stiff as those.'
    )  # fmt: skip
    messages: str = parameter(
        'own', unit='', choices=('own', 'standard'), live=False,
        description='own: the messages of this package; standard: those of sensor_msgs and geometry_msgs only.'
    )  # fmt: skip
    feedforward_message: str = parameter(
        'own', unit='', choices=('own', 'joint_state', 'array'), live=False,
        description='own: friction_feedforward; joint_state: effort of the joint in effort_command; array: first value '
        'of effort_commands, as a controller of efforts takes it.'
    )  # fmt: skip
    use_feedforward: bool = parameter(True, unit='', description='Add friction_feedforward to the force command.')
    feedforward_timeout: float = parameter(
        0.05, unit='s', lower=1e-3, upper=10.0, description='An older feed-forward counts as 0 N.'
    )
    reference_timeout: float = parameter(
        0.5, unit='s', lower=1e-3, upper=60.0, description='wave: topic. The position of an older reference is held.'
    )
    rate: float = parameter(
        1000.0, unit='Hz', lower=10.0, upper=10000.0, live=False, description='Samples and control steps per second.'
    )
    inner_step: float = parameter(
        1e-4, unit='s', lower=1e-6, upper=0.1, live=False, description='Longest time step of valve, cylinder and load.'
    )
    start_position: float = parameter(
        0.0, unit='m', lower=-10.0, upper=10.0, live=False, description='Rod position at the start.'
    )
    publish_clock: bool = parameter(
        False, unit='', live=False, description='Publish /clock, from 0 s, for nodes with use_sim_time.'
    )
    time_factor: float = parameter(
        1.0, unit='1', lower=0.01, upper=1000.0, live=False,
        description='Simulated time per real time; a value other than 1 needs publish_clock.'
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.messages == 'standard' and self.wave not in WAVES:
            raise ValueError(f'SimulatorSettings.wave = {self.wave!r} needs messages: own')
        if self.time_factor != 1.0 and not self.publish_clock:
            needed = 'needs publish_clock, and use_sim_time elsewhere'
            raise ValueError(f'SimulatorSettings.time_factor = {self.time_factor} {needed}')


@dataclass(frozen=True)
class StandardMessages(CheckedParameters):
    """What a simulated axis with standard messages publishes.

    ValueError: the joint has no name, or ``reference`` is unknown.
    """

    joint: str = parameter('rod', unit='', description='Name of the joint in every JointState.')
    velocity: bool = parameter(True, unit='', description='false: joint_states has positions only, as of an encoder.')
    load_cell: bool = parameter(True, unit='', description='false: no load_cell, an axis without force sensor.')
    reference: str = parameter(
        'joint_state', unit='', choices=('joint_state', 'trajectory_point'),
        description='joint_state: joint_reference; trajectory_point: reference_point.'
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.joint:
            raise ValueError('StandardMessages.joint is empty: give the joint a name')


def servo_parameters(
    settings: SimulatorSettings, parts: Mapping[type, Any], seals: tuple[MountedSeal, ...]
) -> ServoParameters:
    """The simulated servo, with a record for each type in `PLANT`; the valve of the other fluid is not used.

    ValueError: the servo cannot work, see `ServoParameters`, or no seal file has the elasticity that is wanted.
    """
    period = 1.0 / settings.rate
    return ServoParameters(
        valve=parts[VALVES[settings.fluid]],
        cylinder=parts[Cylinder],
        load=parts[Load],
        controller=parts[ServoController],
        seals=seals,
        elastic=seals_of_plant(settings.seal_elasticity, seals, parts[Load].mass),
        control_period=period,
        inner_step=period / math.ceil(period / settings.inner_step - 1e-9),
    )


SERVO_SIMULATOR_PARAMETERS = (
    ParameterGroup(StartOptions),
    ParameterGroup(SimulatorSettings),
    ParameterGroup(SealSelection),
    *(ParameterGroup(record_type, f'{name}.', live=False) for name, record_type in PLANT.items()),
    *(ParameterGroup(record_type, f'{name}.') for name, record_type in WAVES.items()),
    ParameterGroup(PullTest, 'pull_test.', live=False),
    ParameterGroup(StandardMessages, 'standard.', live=False),
    ParameterGroup(SensorSettings, 'sensors.'),
)
"""Every parameter that the node ``servo_simulator`` declares."""
