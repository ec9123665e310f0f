"""Settings and results of the tuning of a simulated and of a recorded axis."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar

from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter

if TYPE_CHECKING:  # loads numpy, which `seal_friction tune --help` does not need
    from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings

FORCE_MARGIN = 1.5  # force limit over the largest friction found (our choice)


@dataclass(frozen=True)
class TuningSettings(CheckedParameters):
    """Task of a simulated axis, and the errors of its model."""

    amplitude: float = parameter(
        0.001, unit='m', lower=1e-6, upper=1.0, description='Amplitude of the sine, half peak to peak.'
    )
    frequency: float = parameter(5.0, unit='Hz', lower=0.05, upper=50.0, description='Frequency of the sine.')
    delay: float = parameter(
        0.001,
        unit='s',
        lower=0.0,
        upper=0.1,
        description='Time from velocity sample to its feed-forward in the controller.',
    )
    friction_error: float = parameter(
        0.3, unit='1', lower=0.0, upper=0.9, description='Largest relative error of the friction model.'
    )
    delay_error: float = parameter(
        0.2, unit='1', lower=0.0, upper=1.0, description='Largest relative error of the delay to force on the rod.'
    )
    overshoot_limit: float = parameter(
        0.05, unit='1', lower=0.0, upper=1.0, description='Largest overshoot of a move in any case, over its distance.'
    )
    hold_time: float = parameter(
        2.0, unit='s', lower=0.05, upper=60.0, description='Rest after each motion, watched for a limit cycle.'
    )
    pressure_noise: float = parameter(
        2e3, unit='Pa', lower=0.0, upper=1e6, description='Standard deviation of the noise of each pressure.'
    )
    force_noise: float = parameter(1.0, unit='N', lower=0.0, upper=1e4, description='The same for the force sum.')
    velocity_noise: float = parameter(
        2e-4, unit='m/s', lower=0.0, upper=1.0, description='The same for the velocity; only the estimator sees it.'
    )
    seed: int = parameter(1, unit='', lower=0, upper=2**31 - 1, description='Seed of the noise.')


@dataclass(frozen=True)
class RecordedAxisSettings(CheckedParameters):
    """Known properties of a recorded axis, besides its recording."""

    mass: float = parameter(0.0, unit='kg', lower=0.0, upper=1e6, description='Moving mass; 0: fitted.')
    whole_delay: float = parameter(
        0.0,
        unit='s',
        lower=0.0,
        upper=0.5,
        description='Time from a velocity sample to the force on the rod; 0: unknown.',
    )
    friction_error: float = parameter(
        0.3, unit='1', lower=0.0, upper=0.9, description='Largest relative error of the friction model.'
    )
    delay_error: float = parameter(
        0.2, unit='1', lower=0.0, upper=1.0, description='Largest relative error of the whole delay.'
    )
    area_a: float = parameter(
        0.0, unit='m2', lower=0.0, upper=10.0, description='Area of chamber a, for --command-topic.'
    )
    area_b: float = parameter(
        0.0, unit='m2', lower=0.0, upper=10.0, description='Area of chamber b, for --command-topic.'
    )


class Outcome(Protocol):
    """Quality of the feed-forward in one case: `Performance` or `Residual`."""

    def better_than(self, other: Any) -> bool:
        """Whether this outcome is better than another one."""


OutcomeType = TypeVar('OutcomeType', bound=Outcome)


class RobustnessCase(NamedTuple, Generic[OutcomeType]):
    """Outcome with an error of the friction model and of the delay."""

    friction_error: float  # [-] the model gives ``1 + friction_error`` times the friction
    delay_error: float  # [-] the whole delay is ``1 + delay_error`` times as long
    outcome: OutcomeType

    @property
    def is_nominal(self) -> bool:
        """Whether both errors are 0."""
        return not (self.friction_error or self.delay_error)


@dataclass(frozen=True)
class TunedFeedForward(Generic[OutcomeType]):
    """A tuned feed-forward and its robustness."""

    feedforward: 'FeedForwardSettings'
    without: OutcomeType  # outcome without feed-forward
    cases: tuple[RobustnessCase[OutcomeType], ...]  # nine, by friction error, then by delay error
    largest_friction: float  # [N] found on the axis; ``force_limit`` is `FORCE_MARGIN` times as large

    @property
    def nominal(self) -> OutcomeType:
        """Outcome without errors of model and delay."""
        return next(case.outcome for case in self.cases if case.is_nominal)

    @property
    def better_in_every_case(self) -> bool:
        """Whether every case is better than without feed-forward."""
        return all(case.outcome.better_than(self.without) for case in self.cases)
