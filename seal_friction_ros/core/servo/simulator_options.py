"""ROS parameters of the node servo_simulator."""

from dataclasses import dataclass
from typing import Any

from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.node_options import StartOptions
from seal_friction_ros.core.foundation.parameters import CheckedParameters, ParameterGroup, parameter
from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.motions import Chirp, PullTest, Sine, Step, Trapezoid
from seal_friction_ros.core.servo.plant import Cylinder, Load, ServoValve
from seal_friction_ros.core.servo.sensors import SensorSettings

WAVES: dict[str, type[Any]] = {'sine': Sine, 'step': Step, 'trapezoid': Trapezoid, 'chirp': Chirp}
"""Reference programs of the simulator, by the value of ``wave``."""

PLANT: dict[str, type[Any]] = {'valve': ServoValve, 'cylinder': Cylinder, 'load': Load, 'controller': ServoController}
"""Parts of the simulated servo, by the prefix of their parameters."""


@dataclass(frozen=True)
class SimulatorSettings(CheckedParameters):
    """Settings of the simulation, one ROS parameter per field.

    Raises:
        ValueError: A value is out of bounds, ``wave`` is unknown, or ``time_factor`` needs ``publish_clock``.
    """

    wave: str = parameter(
        'sine',
        unit='',
        description='Reference: sine, step, trapezoid, chirp; topic; or pull_test, a rig without servo.',
    )
    reference_resolution: float = parameter(
        0.0, unit='m', lower=0.0, upper=0.1,
        description='Step of the positions of sine to chirp; their differences are its velocity. 0: continuous.'
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
        names = (*WAVES, 'topic', 'pull_test')
        if self.wave not in names:
            raise ValueError(f'SimulatorSettings.wave = {self.wave!r} is none of {", ".join(names)}')
        if self.time_factor != 1.0 and not self.publish_clock:
            raise ValueError(
                f'SimulatorSettings.time_factor = {self.time_factor} needs publish_clock, and use_sim_time elsewhere'
            )


SERVO_SIMULATOR_PARAMETERS = (
    ParameterGroup(StartOptions),
    ParameterGroup(SimulatorSettings),
    ParameterGroup(SealSelection),
    *(ParameterGroup(record_type, f'{name}.', live=False) for name, record_type in PLANT.items()),
    *(ParameterGroup(record_type, f'{name}.') for name, record_type in WAVES.items()),
    ParameterGroup(PullTest, 'pull_test.', live=False),
    ParameterGroup(SensorSettings, 'sensors.'),
)
"""Every parameter that the node ``servo_simulator`` declares."""
