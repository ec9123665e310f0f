"""What a law is: a frozen record of parameters, and one scalar function that takes them.

The function is written once, in plain Python on numbers (and on tuples of numbers, for tables), and compiles as it
stands. The live node, replay, the servo plant and identification all call it as `Law.bound`.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, cast

from seal_friction_ros.core.foundation.compiled import Bound, bound
from seal_friction_ros.core.foundation.parameters import CheckedParameters, meanings


@dataclasses.dataclass(frozen=True)
class Law(CheckedParameters):
    """Parameters of a law, each a field made by `parameter`, and its function.

    A subclass sets ``function``. It takes parameters named after attributes of the record (a number, a tuple of
    numbers, another law, a table), and then its two arguments. A law that is a ``table`` has the function of that.
    """

    function: ClassVar[Callable[..., float] | None] = None
    bound: Bound = dataclasses.field(init=False, repr=False, compare=False)  # the function of the two arguments alone

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_together()
        function = type(self).function
        made = bound(function, self) if function else cast(Any, self).table.bound
        object.__setattr__(self, 'bound', made)

    def check_together(self) -> None:
        """Check what the bounds of each parameter alone cannot; called once these hold.

        ValueError: two parameters contradict each other.
        """

    def check_rises(self, name: str) -> None:
        """Check that the values of a field, one for each pressure, do not fall; ValueError if they do."""
        values, unit = list(getattr(self, name)), meanings(self)[name].unit
        if values != sorted(values):
            raise ValueError(f'{type(self).__name__}.{name} = {values} {unit} falls with pressure')

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the parameters only: the rest follows from them."""
        return type(self), tuple(getattr(self, f.name) for f in dataclasses.fields(self) if f.init)


class TypicalReading(NamedTuple):
    """Sizes that occur in a set of readings, for the first guess of a fit."""

    friction: float  # [N] mean, of one seal
    pressure: float  # [Pa] highest
    speed: float  # [m/s] highest
    normal_force: float  # [N] mean, of one seal; NaN where the geometry is not known


@dataclasses.dataclass(frozen=True)
class FrictionLaw(Law):
    """Magnitude of the sliding friction of one seal [N] over pressure [Pa, gauge, >= 0] and speed [m/s, >= 0].

    A law that depends on the speed has a parameter ``reference_speed``: its Coulomb friction is the friction at that
    speed, and a seal with such a law has no velocity terms.
    """

    NAME: ClassVar[str]  # name in a seal file
    FORMULA: ClassVar[str]  # for people
    PART: ClassVar[str] = ''  # key of the seal file that holds its parameters; empty: the name of the law
    FITTED_PART: ClassVar[tuple[str, type[Law]] | None] = None
    """field that identification fits, and the law that it fits there; None: the parameters of the law itself"""

    @property
    def depends_on_speed(self) -> bool:
        """Whether the friction depends on the speed."""
        return hasattr(self, 'reference_speed')

    @property
    def coulomb_speed(self) -> float:
        """Speed [m/s] at which the Coulomb friction is taken; 0 if the friction does not depend on the speed."""
        return float(getattr(self, 'reference_speed', 0.0))

    def coulomb_friction(self, pressure: float) -> float:
        """Magnitude of the Coulomb friction [N] at ``pressure`` [Pa, gauge, >= 0]."""
        return self.bound(pressure, self.coulomb_speed)

    def sliding_friction(self, pressure: float, speed: float) -> float:
        """Magnitude of the sliding friction [N] at ``pressure`` [Pa, gauge, >= 0] and ``speed`` [m/s, >= 0]."""
        return self.bound(pressure, speed)
