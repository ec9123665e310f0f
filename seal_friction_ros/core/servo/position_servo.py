"""Position servo with seal friction.

``state = init(parameters)``, then ``state, outputs = step(parameters, state, reference, feedforward)``: one sample of
the controller, over which valve, cylinder and load advance in inner steps. `advance` is for a rig without controller.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import compilable, compiled, keep
from seal_friction_ros.core.foundation.parameters import CheckedParameters, parameter
from seal_friction_ros.core.friction.actuator import MountedSeal, breakaway_in, friction_of_seals
from seal_friction_ros.core.friction.states import sign, state_friction
from seal_friction_ros.core.servo.controller import (
    Command,
    ControllerState,
    Gains,
    Measurement,
    ServoController,
    control,
    gains,
    spectral_radius,
)
from seal_friction_ros.core.servo.cylinder import Cylinder
from seal_friction_ros.core.servo.elastic_plant import NO_SHEAR, ElasticSeals, SealShear, elastic_step, for_elastic_step
from seal_friction_ros.core.servo.hydraulics import ServoValve
from seal_friction_ros.core.servo.motions import Setpoint
from seal_friction_ros.core.servo.plant import (
    Constants,
    Load,
    PlantState,
    Valve,
    chamber_pressures,
    constants,
    fastest_rate,
    force_sum,
    inner_step,
    pressures_at_rest,
)
from seal_friction_ros.core.servo.pneumatics import REFERENCE_TEMPERATURE

LARGEST_RATE_TIMES_STEP = 2.5  # [-] the stability limit of Runge-Kutta of fourth order is 2.78 on the real axis


@dataclass(frozen=True, kw_only=True)
class ServoParameters(CheckedParameters):
    """Parameters of the servo; without seals it has no seal friction.

    ValueError: a value is out of bounds, the inner step does not divide the sample time or is too long for the fastest
    part of the plant, or the closed loop is unstable.
    """

    valve: Valve = field(default_factory=ServoValve)  # its type says what the fluid is
    cylinder: Cylinder = field(default_factory=Cylinder)
    load: Load = field(default_factory=Load)
    controller: ServoController = field(default_factory=ServoController)
    seals: tuple[MountedSeal, ...]
    elastic: ElasticSeals | None = None  # None: the seals are rigid
    control_period: float = parameter(5e-4, unit='s', lower=1e-6, upper=0.1, description='Controller sample time.')
    inner_step: float = parameter(1e-4, unit='s', lower=1e-8, upper=0.1, description='Time step of the plant.')
    constants: Constants = field(init=False, repr=False, compare=False)
    gains: Gains = field(init=False, repr=False, compare=False)
    kept: Any = field(init=False, repr=False, compare=False)
    """constants, gains, inner step, number of inner steps, and elasticity or None for compiled code"""

    def __post_init__(self) -> None:
        super().__post_init__()
        steps = round(self.control_period / self.inner_step)
        step = f'inner_step = {self.inner_step} s'
        if steps < 1 or abs(steps * self.inner_step - self.control_period) > 1e-9 * self.control_period:
            raise ValueError(f'ServoParameters.control_period = {self.control_period} s is not a multiple of {step}')
        rate, part = fastest_rate(self.valve, self.cylinder, self.load, self.seals)
        limits = [(rate, f'fastest part, {part}')]
        if self.elastic is not None:
            damping = max(self.elastic.bristle_damping, 0.0) / self.load.mass
            swing = math.sqrt(self.elastic.stiffness / self.load.mass) + damping
            limits.append((swing, 'mass on its elastic seals'))
        for rate, part in limits:
            if rate * self.inner_step > LARGEST_RATE_TIMES_STEP:
                longest = f'{LARGEST_RATE_TIMES_STEP / rate:.3g} s for the {part}'
                raise ValueError(f'ServoParameters.{step} is too long: at most {longest}')
        c = constants(self.valve, self.cylinder, self.load, self.seals)
        elastic = for_elastic_step(self.elastic, c)
        g = gains(self.controller, c, self.control_period)
        radius = spectral_radius(g, c)
        if radius > 1.0 + 1e-9:
            what = f'unstable, the largest eigenvalue of its transition matrix is {radius:.4f}'
            hint = 'lower position_gain, velocity_compensation or force_bandwidth, or control_period'
            raise ValueError(f'ServoParameters: the closed loop is {what}: {hint}')
        for name, value in (('constants', c), ('gains', g), ('kept', keep((c, g, self.inner_step, steps, elastic)))):
            object.__setattr__(self, name, value)  # frozen dataclass: derived fields


class ServoState(NamedTuple):
    """State between two samples."""

    plant: PlantState
    controller: ControllerState
    seals: SealShear = NO_SHEAR  # of elastic seals


class ServoOutputs(NamedTuple):
    """True values at the end of a step, without noise or delay."""

    position: float  # [m]
    velocity: float  # [m/s] exactly 0.0 at rest
    pressure_a: float  # [Pa, gauge]
    pressure_b: float  # [Pa, gauge]
    spool: float  # [-] -1 to 1
    force_sum: float  # [N] every axial force on the moving mass except seal friction
    friction_force: float  # [N] ``m a = force_sum - friction_force``
    coulomb_friction: float  # [N]
    breakaway_force: float  # [N]
    friction_state: int  # a `FrictionState`
    direction: int  # -1, 0 or 1
    command: Command  # outputs of the controller at the start of the step


NO_COMMAND = Command(0.0, 0.0, 0)


def init(parameters: ServoParameters, position: float = 0.0) -> ServoState:
    """Servo at rest at ``position`` [m], valve closed, chambers at `pressures_at_rest`; ValueError beyond a stop."""
    if not abs(position) <= parameters.cylinder.limit:
        raise ValueError(f'position = {position} m is not within the stroke, +-{parameters.cylinder.limit} m')
    a, b = pressures_at_rest(parameters.valve, parameters.cylinder)
    temperature = getattr(parameters.valve, 'temperature', REFERENCE_TEMPERATURE)
    plant = PlantState(position, 0.0, a, b, 0.0, 0.0, 0.0, 0.0, temperature, temperature, 0, 0)
    return ServoState(plant, ControllerState(position, 0.0), NO_SHEAR)


@compilable
def _advance_elastic(
    c: Constants,
    elastic: Any,
    inner: tuple[float, int],
    plant: PlantState,
    seals: SealShear,
    force: tuple[float, float],
) -> tuple[PlantState, SealShear]:
    """Plant and seals over one sample, with spool command and load force [N] in ``force``.

    Compiled code has only one of the two branches: the compiler knows whether ``elastic`` is None.
    """
    time, steps = inner
    command, load_force = force
    if elastic is None:
        for _ in range(steps):
            plant = inner_step(c, plant, command, load_force, time)
    else:
        for _ in range(steps):
            plant, seals = elastic_step(c, elastic, plant, seals, command, load_force, time)
    return plant, seals


@compiled
def _advance(
    kept: Any, plant: PlantState, seals: SealShear, command: float, load_force: float
) -> tuple[PlantState, SealShear]:
    """Plant and seals over one sample, with constant spool command [-1 to 1] and load force [N]."""
    c, _gains, time, steps, elastic = kept.value
    return _advance_elastic(c, elastic, (time, steps), plant, seals, (command, load_force))


def advance(parameters: ServoParameters, state: PlantState, spool: float, load_force: float = 0.0) -> PlantState:
    """Valve, cylinder and load over one sample, with constant spool command [-1 to 1] and force on the rod [N].

    ValueError: the seals are elastic: their state is in `ServoState`, so `step` it.
    """
    if parameters.elastic is not None:
        raise ValueError('advance: the seals of this servo are elastic; use step, or ServoParameters.elastic = None')
    return _advance(parameters.kept, state, NO_SHEAR, min(max(spool, -1.0), 1.0), load_force)[0]


@compilable
def measure(cylinder: Cylinder, state: PlantState) -> Measurement:
    """Measurement of ideal sensors."""
    pressure_a, pressure_b = chamber_pressures(cylinder, state[:10])
    return Measurement(state.position, state.velocity, pressure_a, pressure_b)


@compiled
def _outputs(kept: Any, plant: PlantState, shear: SealShear, command: Command, load_force: float) -> ServoOutputs:
    """Outputs in a state of the plant; friction by `state_friction` of the estimator, at rest where V = 0 exactly.

    The friction of elastic seals is the force of their shear.
    """
    c, _gains, _time, _steps, elastic = kept.value
    a, b = chamber_pressures(c.cylinder, plant[:10])
    force = force_sum(c.cylinder, c.load, plant[:10], load_force)
    seals = friction_of_seals(c.seals, a, b, plant.velocity)
    coulomb = seals.coulomb_friction
    sliding = coulomb + seals.velocity_friction
    ahead = sign(plant.velocity if plant.velocity != 0.0 else force)
    breakaway = breakaway_in(seals, ahead, with_stiction=True)
    acting = state_friction(plant.velocity, force, plant.velocity == 0.0, sliding, breakaway)
    friction = acting.friction_force if elastic is None else shear.friction
    measured = (plant.position, plant.velocity, a, b, plant.spool, force)
    return ServoOutputs(*measured, friction, coulomb, breakaway, acting.state, acting.direction, command)


def outputs(
    parameters: ServoParameters, plant: PlantState, command: Command = NO_COMMAND, load_force: float = 0.0
) -> ServoOutputs:
    """Outputs of the servo in a state of its plant, with a force from outside on the rod [N]; seals not sheared."""
    return _outputs(parameters.kept, plant, NO_SHEAR, command, load_force)


@compiled
def _step(
    kept: Any, state: ServoState, measured: Measurement, reference: Setpoint, feedforward: float, load_force: float
) -> tuple[ServoState, ServoOutputs]:
    c, g, _time, _steps, _elastic = kept.value
    controller, command = control(g, c, state.controller, measured, reference, feedforward)
    plant, shear = _advance(kept, state.plant, state.seals, command.spool, load_force)
    return ServoState(plant, controller, shear), _outputs(kept, plant, shear, command, load_force)


def step(
    parameters: ServoParameters,
    state: ServoState,
    reference: Setpoint,
    feedforward: float = 0.0,
    load_force: float = 0.0,
    measured: Measurement | None = None,
) -> tuple[ServoState, ServoOutputs]:
    """One sample: the controller acts, then the plant advances to the next sample.

    The state is from `init` or the previous step. An invalid reference or ``feedforward`` [N], positive on extension,
    is limited and flagged in ``outputs.command.limited``. The ``load_force`` from outside on the rod [N], positive on
    extension, is constant over the step. The controller has what its sensors ``measured``; None: the truth.
    """
    seen = measured or measure(parameters.cylinder, state.plant)
    return _step(parameters.kept, state, seen, reference, feedforward, load_force)


class Trajectory(NamedTuple):
    """The servo after each of n steps; arrays of shape (n,), units as in `ServoOutputs`."""

    position: FloatArray
    velocity: FloatArray
    pressure_a: FloatArray
    pressure_b: FloatArray
    spool: FloatArray
    force_sum: FloatArray
    friction_force: FloatArray
    coulomb_friction: FloatArray
    breakaway_force: FloatArray
    limited: FloatArray


@compiled
def _simulate(kept: Any, state: ServoState, inputs: Any, rows: Any) -> ServoState:
    for i in range(len(inputs)):
        x, v, a, feedforward, load_force = [float(inputs[i, j]) for j in range(5)]
        measured = measure(kept.value[0].cylinder, state.plant)
        state, out = _step(kept, state, measured, Setpoint(x, v, a), feedforward, load_force)
        for column, value in enumerate(out[:9]):
            rows[i, column] = value
        rows[i, 9] = out.command.limited
    return state


def simulate(
    parameters: ServoParameters,
    state: ServoState,
    references: Iterable[Setpoint],
    feedforward: float | FloatArray = 0.0,
    load_force: float | FloatArray = 0.0,
) -> tuple[ServoState, Trajectory]:
    """One `step` for each of n references, in one compiled loop; both forces [N] are scalar or of shape (n,)."""
    setpoints = np.array([*references], dtype=float).reshape(-1, 3)
    inputs = np.empty((len(setpoints), 5))
    inputs[:, :3], inputs[:, 3], inputs[:, 4] = setpoints, feedforward, load_force
    rows = np.empty((len(setpoints), len(Trajectory._fields)))
    state = _simulate(parameters.kept, state, inputs, rows)
    return state, Trajectory(*rows.T)
