"""What a tuning is told: of an axis that is simulated, and of one that was recorded."""

from dataclasses import dataclass

from seal_friction_ros.core.foundation.parameters import check, parameter


@dataclass(frozen=True)
class TuningSettings:
    """What the axis shall do, and how well it is known.

    Raises:
        ValueError: A value is out of bounds.
    """

    amplitude: float = parameter(0.001, unit='m', lower=1e-6, upper=1.0, description='Half the way of the sine.')
    frequency: float = parameter(5.0, unit='Hz', lower=0.05, upper=50.0, description='Of the sine.')
    delay: float = parameter(
        0.001,
        unit='s',
        lower=0.0,
        upper=0.1,
        description='From a velocity sample until its feed-forward is in the controller.',
    )
    friction_error: float = parameter(
        0.3, unit='1', lower=0.0, upper=0.9, description='The model of the friction may be wrong by this share.'
    )
    delay_error: float = parameter(
        0.2,
        unit='1',
        lower=0.0,
        upper=1.0,
        description='Likewise the whole delay from velocity sample to force on the rod.',
    )
    overshoot_limit: float = parameter(
        0.05, unit='1', lower=0.0, upper=1.0, description='Largest overshoot of a move in any case, share of its way.'
    )
    hold_time: float = parameter(
        2.0, unit='s', lower=0.05, upper=60.0, description='Rest after each motion that is watched for a limit cycle.'
    )
    pressure_noise: float = parameter(
        2e3, unit='Pa', lower=0.0, upper=1e6, description='Standard deviation of the noise of each pressure.'
    )
    force_noise: float = parameter(1.0, unit='N', lower=0.0, upper=1e4, description='Likewise of the force sum.')
    velocity_noise: float = parameter(
        2e-4, unit='m/s', lower=0.0, upper=1.0, description='Likewise of the velocity; all before the estimator.'
    )
    seed: int = parameter(1, unit='', lower=0, upper=2**31 - 1, description='Of the noise.')

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class MatchSettings:
    """What is known of a recorded axis besides its recording.

    Raises:
        ValueError: A value is out of bounds.
    """

    mass: float = parameter(0.0, unit='kg', lower=0.0, upper=1e6, description='Moving mass; 0: it is fitted.')
    whole_delay: float = parameter(
        0.0,
        unit='s',
        lower=0.0,
        upper=0.5,
        description='From a velocity sample until its feed-forward is force on the rod; 0: not known.',
    )
    friction_error: float = parameter(
        0.3, unit='1', lower=0.0, upper=0.9, description='The model of the friction may be wrong by this share.'
    )
    delay_error: float = parameter(0.2, unit='1', lower=0.0, upper=1.0, description='Likewise the whole delay.')

    def __post_init__(self) -> None:
        check(self)
