"""The rig of the thesis's friction test as a simulation: both ports on one pressure, a spring scale on the rod."""

from typing import NamedTuple

from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.motions import PullTest
from seal_friction_ros.core.servo.plant import Cylinder, PlantState, ServoValve
from seal_friction_ros.core.servo.position_servo import ServoOutputs, ServoParameters, advance, init, outputs


class PullRig(NamedTuple):
    """The rig, once for each pressure of the plan."""

    plan: PullTest
    servos: tuple[ServoParameters, ...]


class PullRigState(NamedTuple):
    """What one step leaves for the next."""

    test: int
    """number of the test, counted from 0"""
    plant: PlantState


def pull_rig(plan: PullTest, seals: tuple[MountedSeal, ...], period: float) -> PullRig:
    """The rig for a plan, stepped with ``period`` [s].

    Supply and return are one line, and the valve stands open and is wide, so that it holds the rod back by little.
    Sizes of valve and hoses are our choice.

    Raises:
        ValueError: The period does not suit the plant.
    """
    pressures = [plan.pressure_max * i / plan.intervals for i in range(plan.intervals + 1)]
    idle = ServoController(force_bandwidth=50.0, position_gain=1e3)  # not used: the spool stands open
    return PullRig(
        plan,
        tuple(
            ServoParameters(
                valve=ServoValve(supply_pressure=pressure, return_pressure=pressure, rated_flow=2.5e-4),
                cylinder=Cylinder(dead_volume=2e-5),
                controller=idle,
                seals=seals,
                control_period=period,
                inner_step=period / max(round(period / 2e-4), 1),
            )
            for pressure in pressures
        ),
    )


def init_pull_rig(rig: PullRig) -> PullRigState:
    """At rest in mid-stroke, at the first pressure."""
    return PullRigState(0, init(rig.servos[0]).plant)


def step_pull_rig(rig: PullRig, state: PullRigState, time: float) -> tuple[PullRigState, ServoOutputs]:
    """One sample of the test at ``time`` [s]: where the rod rests, the next pressure is there at once."""
    command = rig.plan.at(time)
    servo = rig.servos[command.test % len(rig.servos)]
    plant = state.plant
    if command.test != state.test:
        plant = init(servo, plant.position).plant
    force = rig.plan.force(command, plant.position)
    plant = advance(servo, plant, 1.0, force)
    return PullRigState(command.test, plant), outputs(servo, plant, load_force=force)
