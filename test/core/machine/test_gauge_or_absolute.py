"""The lowest pressures tell whether a sensor is gauge or absolute, as far as they can."""

import math

import pytest
from harness.machines import BENCH, parsed

from seal_friction_ros.core.estimation.records import NO_PRESSURE, Pressure
from seal_friction_ros.core.machine.gauge_or_absolute import Lowest, pressure_remarks

AMBIENT, LOADED = 1.0e5, 3.0e6  # [Pa]


def remarks(pressures, absolute, kind='sensor_msgs/msg/FluidPressure'):
    """Remarks on a test bench after some pairs of pressures, as the estimator gets them."""
    inputs = {'velocity': '/joint_states velocity[axis]'}
    for chamber in 'ab':
        field = 'fluid_pressure' if kind.startswith('sensor') else 'data[0]'
        inputs[f'pressure_{chamber}'] = {'topic': f'/p_{chamber}', 'field': field, 'absolute': absolute}
    file = parsed(BENCH.replace('sensor_msgs/msg/FluidPressure', kind), inputs=inputs)
    lowest = Lowest().after(NO_PRESSURE)
    for number, pair in enumerate(pressures):
        lowest = lowest.after(Pressure(number, *pair))
    return pressure_remarks(file, file.actuators[0], lowest)


@pytest.mark.parametrize('kind', ['sensor_msgs/msg/FluidPressure', 'std_msgs/msg/Float64MultiArray'])
def test_absolute_pressures_taken_for_gauge_are_named_once_the_machine_is_unloaded(kind):
    said = remarks([(LOADED, LOADED), (AMBIENT, AMBIENT), (LOADED, AMBIENT)], False, kind)
    assert len(said) == 2
    assert all('write absolute: true' in line for line in said)


def test_a_fluid_pressure_is_doubted_under_load_already_and_another_message_is_not():
    assert len(remarks([(LOADED, LOADED)], False)) == 2
    assert not remarks([(LOADED, LOADED)], False, 'std_msgs/msg/Float64MultiArray')


@pytest.mark.parametrize('kind', ['sensor_msgs/msg/FluidPressure', 'std_msgs/msg/Float64MultiArray'])
def test_gauge_pressures_that_were_at_0_in_one_chamber_are_not_doubted(kind):
    assert not remarks([(LOADED, LOADED), (2e3, AMBIENT)], False, kind)


def test_gauge_pressures_with_ambient_pressure_taken_off_are_named():
    (line,) = remarks([(LOADED, LOADED), (LOADED, -AMBIENT)], True)
    assert 'pressure_b' in line
    assert 'write absolute: false' in line
    assert not remarks([(LOADED, 0.0), (0.0, LOADED)], True)


def test_without_a_pressure_and_with_nan_nothing_is_said():
    assert not remarks([], False)
    assert not remarks([(math.nan, math.nan)], False)
