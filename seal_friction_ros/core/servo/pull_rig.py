"""Simulated rig of the friction test of the thesis: both ports at one pressure, a spring scale on the rod."""

from typing import NamedTuple

from seal_friction_ros.core.friction.actuator import MountedSeal
from seal_friction_ros.core.servo.controller import ServoController
from seal_friction_ros.core.servo.cylinder import Cylinder
from seal_friction_ros.core.servo.hydraulics import ServoValve
from seal_friction_ros.core.servo.motions import PullTest
from seal_friction_ros.core.servo.plant import PlantState
from seal_friction_ros.core.servo.position_servo import ServoOutputs, ServoParameters, advance, init, outputs


class PullRig(NamedTuple):
    """Plan of the test, and one plant for each pressure of the plan."""

    plan: PullTest
    servos: tuple[ServoParameters, ...]


class PullRigState(NamedTuple):
    """State between two samples."""

    test: int  # index of the test, from 0
    plant: PlantState


def pull_rig(plan: PullTest, seals: tuple[MountedSeal, ...], period: float) -> PullRig:
    """Rig for a plan, with the sample time ``period`` [s].

    Supply and return are one line. The valve is wide and fully open, so it hardly brakes the rod. Sizes of valve and
    hoses are our choice. ValueError: the period is too long for the plant.
    """

    def servo(pressure: float) -> ServoParameters:
        """The rig with both lines at ``pressure`` [Pa]."""
        return ServoParameters(
            valve=ServoValve(supply_pressure=pressure, return_pressure=pressure, rated_flow=2.5e-4),
            cylinder=Cylinder(dead_volume=2e-5),
            controller=ServoController(force_bandwidth=50.0, position_gain=1e3),  # not used: the spool stands open
            seals=seals,
            control_period=period,
            inner_step=period / max(round(period / 2e-4), 1),
        )

    pressures = [plan.pressure_max * i / plan.intervals for i in range(plan.intervals + 1)]
    return PullRig(plan, tuple(servo(pressure) for pressure in pressures))


def init_pull_rig(rig: PullRig) -> PullRigState:
    """At rest in mid-stroke, at the first pressure."""
    return PullRigState(0, init(rig.servos[0]).plant)


def step_pull_rig(rig: PullRig, state: PullRigState, time: float) -> tuple[PullRigState, ServoOutputs]:
    """One sample of the test at ``time`` [s]; a new test starts at rest, with its pressure in both chambers."""
    command = rig.plan.at(time)
    servo, plant = rig.servos[command.test % len(rig.servos)], state.plant
    if command.test != state.test:
        plant = init(servo, plant.position).plant
    force = rig.plan.force(command, plant.position)
    plant = advance(servo, plant, 1.0, force)
    return PullRigState(command.test, plant), outputs(servo, plant, load_force=force)
