"""A position servo with seals that rub.

``state = init(parameters)``, then ``state, outputs = step(parameters, state, reference, feedforward)``: one sample of
the controller, through which valve, cylinder and load advance in inner steps. `control` and `advance` are its
halves, for who wants sensors (noise, delay) between them, or a rig without a controller.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from seal_friction_ros.core.foundation.arrays import FloatArray
from seal_friction_ros.core.foundation.compiled import compiled, keep
from seal_friction_ros.core.foundation.parameters import check, parameter
from seal_friction_ros.core.friction.actuator import MountedSeal, friction_of_seals
from seal_friction_ros.core.friction.states import state_friction
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
from seal_friction_ros.core.servo.motions import Reference
from seal_friction_ros.core.servo.plant import (
    Constants,
    Cylinder,
    Load,
    PlantState,
    ServoValve,
    chamber_pressure,
    constants,
    fastest_rate,
    force_sum,
    init_plant,
    inner_step,
)

LARGEST_RATE_TIMES_STEP = 2.5  # [-] Runge-Kutta of fourth order is stable to 2.78 on the real axis


@dataclass(frozen=True, kw_only=True)
class ServoParameters:
    """Everything about the servo. Without seals it is the same servo without friction.

    Raises:
        ValueError: A value is out of bounds, an inner step does not divide the sample or is too long for the fastest
            part of the plant, or the closed loop is unstable.
    """

    valve: ServoValve = field(default_factory=ServoValve)
    cylinder: Cylinder = field(default_factory=Cylinder)
    load: Load = field(default_factory=Load)
    controller: ServoController = field(default_factory=ServoController)
    seals: tuple[MountedSeal, ...]
    control_period: float = parameter(
        5e-4, unit='s', lower=1e-6, upper=0.1, description='Sample time of the controller, and of one step.'
    )
    inner_step: float = parameter(
        1e-4, unit='s', lower=1e-8, upper=0.1, description='Time step of valve, cylinder and load.'
    )
    inner_steps: int = field(init=False, repr=False, compare=False)
    constants: Constants = field(init=False, repr=False, compare=False)
    gains: Gains = field(init=False, repr=False, compare=False)
    kept: Any = field(init=False, repr=False, compare=False)
    """constants and gains, for compiled code"""

    def __post_init__(self) -> None:
        check(self)
        steps = round(self.control_period / self.inner_step)
        if steps < 1 or abs(steps * self.inner_step - self.control_period) > 1e-9 * self.control_period:
            raise ValueError(
                f'ServoParameters.control_period = {self.control_period} s is not a multiple of '
                f'inner_step = {self.inner_step} s'
            )
        self._check_inner_step()
        c = constants(self.valve, self.cylinder, self.load, self.seals)
        g = gains(self.controller, c, self.control_period)
        radius = spectral_radius(g, c)
        if radius > 1.0 + 1e-9:
            raise ValueError(
                f'ServoParameters: the closed loop is unstable, its largest eigenvalue from sample to sample is '
                f'{radius:.4f}: lower position_gain, velocity_compensation or force_bandwidth, or control_period'
            )
        for name, value in (('inner_steps', steps), ('constants', c), ('gains', g), ('kept', keep((c, g)))):
            object.__setattr__(self, name, value)  # frozen: the only way to keep what was built from the fields

    def _check_inner_step(self) -> None:
        rate, part = fastest_rate(self.valve, self.cylinder, self.load, self.seals)
        if rate * self.inner_step > LARGEST_RATE_TIMES_STEP:
            raise ValueError(
                f'ServoParameters.inner_step = {self.inner_step} s is too long: at most '
                f'{LARGEST_RATE_TIMES_STEP / rate:.3g} s for the fastest part, {part}'
            )


class ServoState(NamedTuple):
    """What one step leaves for the next."""

    plant: PlantState
    controller: ControllerState


class ServoOutputs(NamedTuple):
    """The servo at the end of a step. No noise, no delay."""

    position: float
    """[m]"""
    velocity: float
    """[m/s] exactly 0.0 at rest"""
    pressure_a: float
    """[Pa, gauge]"""
    pressure_b: float
    """[Pa, gauge]"""
    spool: float
    """[-] -1 to 1"""
    force_sum: float
    """[N] every axial force on the moving mass except seal friction"""
    friction_force: float
    """[N] ``m a = force_sum - friction_force``"""
    coulomb_friction: float
    """[N]"""
    breakaway_force: float
    """[N]"""
    friction_state: int
    """a `FrictionState`"""
    direction: int
    """-1, 0 or 1"""
    command: Command
    """what the controller wanted at the start of the step"""


def init(parameters: ServoParameters, position: float = 0.0) -> ServoState:
    """Servo at rest at ``position`` [m], valve closed, chambers half-way between supply and return.

    Raises:
        ValueError: The position is not between the end stops.
    """
    if not abs(position) <= parameters.constants.limit:
        raise ValueError(f'position = {position} m is not within the stroke, +-{parameters.constants.limit} m')
    return ServoState(init_plant(parameters.constants, position), ControllerState(position, 0.0))


@compiled
def advance_plant(
    kept: Any, state: PlantState, command: float, load_force: float, inner_step_time: float, inner_steps: int
) -> PlantState:
    """``inner_steps`` inner steps with spool command and load force held."""
    c, _gains = kept.value
    for _ in range(inner_steps):
        state = inner_step(c, state, command, load_force, inner_step_time)
    return state


def advance(parameters: ServoParameters, state: PlantState, spool: float, load_force: float = 0.0) -> PlantState:
    """Valve, cylinder and load over one sample, with the spool command [-1 to 1] and a force on the rod [N] held."""
    command = min(max(spool, -1.0), 1.0)
    return advance_plant(parameters.kept, state, command, load_force, parameters.inner_step, parameters.inner_steps)


class RodForces(NamedTuple):
    """Forces on the rod and of its seals [N]."""

    force_sum: float
    coulomb_friction: float
    breakaway_force: float
    sliding_friction: float
    """at the velocity of the rod, as a magnitude; at rest the Coulomb friction"""


@compiled
def measure(c: Constants, state: PlantState) -> Measurement:
    """What perfect sensors read."""
    return Measurement(
        state.position,
        state.velocity,
        chamber_pressure(state.charge_a, c.vapour),
        chamber_pressure(state.charge_b, c.vapour),
    )


@compiled
def rod_forces(kept: Any, plant: PlantState, load_force: float) -> RodForces:
    """Forces in a state of the plant."""
    c, _gains = kept.value
    y = plant[:8]
    a, b = chamber_pressure(y[2], c.vapour), chamber_pressure(y[3], c.vapour)
    friction = friction_of_seals(c.seals, a, b, plant.velocity)
    coulomb = friction.coulomb_friction
    sliding = coulomb + friction.velocity_friction
    return RodForces(force_sum(c, y, load_force), coulomb, coulomb + friction.stiction, sliding)


@compiled
def _step(
    kept: Any,
    state: ServoState,
    reference: Reference,
    feedforward: float,
    load_force: float,
    inner_step_time: float,
    inner_steps: int,
) -> tuple[ServoState, Command, RodForces]:
    c, g = kept.value
    controller, command = control(g, c, state.controller, measure(c, state.plant), reference, feedforward)
    plant = advance_plant(kept, state.plant, command.spool, load_force, inner_step_time, inner_steps)
    return ServoState(plant, controller), command, rod_forces(kept, plant, load_force)


def step(
    parameters: ServoParameters,
    state: ServoState,
    reference: Reference,
    feedforward: float = 0.0,
    load_force: float = 0.0,
) -> tuple[ServoState, ServoOutputs]:
    """One sample: the controller sees the rod as it is, the plant follows to the next sample.

    Args:
        parameters: The servo.
        state: From `init` or the step before.
        reference: What the rod shall do; a bad one is limited and flagged in ``outputs.command.limited``.
        feedforward: Friction feed-forward [N], positive on extension; likewise.
        load_force: Force from outside on the rod [N], positive on extension, held through the step.
    """
    state, command, forces = _step(
        parameters.kept, state, reference, feedforward, load_force, parameters.inner_step, parameters.inner_steps
    )
    return state, _outputs(parameters.constants, state.plant, command, forces)


NO_COMMAND = Command(0.0, 0.0, 0)


def outputs(
    parameters: ServoParameters, plant: PlantState, command: Command = NO_COMMAND, load_force: float = 0.0
) -> ServoOutputs:
    """What the servo does in a state of its plant."""
    c = parameters.constants
    return _outputs(c, plant, command, rod_forces(parameters.kept, plant, load_force))


def _outputs(c: Constants, plant: PlantState, command: Command, forces: RodForces) -> ServoOutputs:
    """Friction by the equation of the estimator, at rest where V = 0 exactly."""
    acting = state_friction(
        plant.velocity, forces.force_sum, plant.velocity == 0.0, forces.sliding_friction, forces.breakaway_force
    )
    return ServoOutputs(
        plant.position,
        plant.velocity,
        max(plant.charge_a, c.vapour),
        max(plant.charge_b, c.vapour),
        plant.spool,
        forces.force_sum,
        acting.friction_force,
        forces.coulomb_friction,
        forces.breakaway_force,
        acting.state,
        acting.direction,
        command,
    )


class Trajectory(NamedTuple):
    """The servo after each of n steps; every array of shape (n,), units as in `ServoOutputs`."""

    position: FloatArray
    velocity: FloatArray
    pressure_a: FloatArray
    pressure_b: FloatArray
    spool: FloatArray
    force_sum: FloatArray
    coulomb_friction: FloatArray
    breakaway_force: FloatArray
    limited: FloatArray


@compiled
def _simulate(
    kept: Any,
    state: ServoState,
    inputs: Any,
    inner_step_time: float,
    inner_steps: int,
    rows: Any,
) -> ServoState:
    for i in range(len(inputs)):
        row = inputs[i]
        wanted = Reference(row[0], row[1], row[2])
        state, command, forces = _step(kept, state, wanted, row[3], row[4], inner_step_time, inner_steps)
        measured = measure(kept.value[0], state.plant)
        rows[i, 0], rows[i, 1] = measured.position, measured.velocity
        rows[i, 2], rows[i, 3] = measured.pressure_a, measured.pressure_b
        rows[i, 4] = state.plant.spool
        rows[i, 5], rows[i, 6], rows[i, 7] = forces.force_sum, forces.coulomb_friction, forces.breakaway_force
        rows[i, 8] = command.limited
    return state


def simulate(
    parameters: ServoParameters,
    state: ServoState,
    references: Iterable[Reference],
    feedforward: float | FloatArray = 0.0,
    load_force: float | FloatArray = 0.0,
) -> tuple[ServoState, Trajectory]:
    """As many `step` as there are references, in one compiled go.

    Args:
        parameters: The servo.
        state: From `init` or a step before.
        references: Reference of each step, n of them.
        feedforward: Friction feed-forward [N], one for all or shape (n,).
        load_force: Force from outside on the rod [N], one for all or shape (n,).
    """
    wanted = np.array([*references], dtype=float).reshape(-1, 3)
    inputs = np.empty((len(wanted), 5))
    inputs[:, :3], inputs[:, 3], inputs[:, 4] = wanted, feedforward, load_force
    rows = np.empty((len(wanted), len(Trajectory._fields)))
    state = _simulate(parameters.kept, state, inputs, parameters.inner_step, parameters.inner_steps, rows)
    return state, Trajectory(*rows.T)
