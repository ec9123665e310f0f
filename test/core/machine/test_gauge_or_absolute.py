"""The lowest pressures tell whether a sensor is gauge or absolute, as far as they can."""

import math

import pytest
from harness.machines import BENCH, parsed

from seal_friction_ros.core.machine.gauge_or_absolute import Lowest, pressure_remarks
from seal_friction_ros.core.messages.records import NO_PRESSURE, Pressure

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


def test_an_absolute_pressure_in_kpa_that_is_taken_for_pascal_gets_a_hint():
    (line, _) = remarks([(601.0 - 101_325.0, 2100.0 - 101_325.0)], True)
    assert 'if it is in kPa, write unit: kPa (601 in the message)' in line
    assert 'kPa' not in remarks([(LOADED, -101_325.0)], True)[0]


def test_without_a_pressure_and_with_nan_nothing_is_said():
    assert not remarks([], False)
    assert not remarks([(math.nan, math.nan)], False)


OTHER = 'std_msgs/msg/Float64MultiArray'


@pytest.mark.parametrize(
    ('lowest', 'absolute', 'kind', 'said'),
    [
        (-5.0e4, True, OTHER, ''),  # a chamber that cavitates
        (-5.01e4, True, OTHER, 'write absolute: false'),
        (9.0e4, False, OTHER, ''),
        (9.01e4, False, OTHER, 'write absolute: true'),
        (1.15e5, False, OTHER, 'write absolute: true'),  # ambient pressure
        (1.151e5, False, OTHER, ''),
        (9.01e4, False, 'sensor_msgs/msg/FluidPressure', 'write absolute: true'),
        (9.0e4, False, 'sensor_msgs/msg/FluidPressure', ''),
        (LOADED, True, OTHER, ''),
    ],
)
def test_a_pressure_is_doubted_up_to_the_bounds_of_cavitation_and_weather(lowest, absolute, kind, said):
    found = remarks([(LOADED, LOADED), (lowest, lowest), (LOADED, LOADED)], absolute, kind)
    assert len(found) == (2 if said else 0)
    for name, line in zip(('pressure_a', 'pressure_b'), found, strict=False):
        assert line.startswith(name)
        assert f'{lowest:.3g} Pa' in line
        assert said in line


@pytest.mark.parametrize('order', [1, -1])
def test_one_chamber_below_ambient_pressure_clears_the_other(order):
    assert not remarks([(2e3, AMBIENT)[::order]], False)
    assert len(remarks([(9.1e4, AMBIENT)[::order]], False)) == 2


def test_the_lowest_pressure_of_each_chamber_is_kept():
    lowest = Lowest()
    assert lowest == (math.inf, math.inf)
    for number, pair in enumerate([(3.0, 5.0), (4.0, 2.0), (math.nan, 9.0), (1.0, math.nan)]):
        lowest = lowest.after(Pressure(number, *pair))
    assert lowest == (1.0, 2.0)
    assert lowest.after(NO_PRESSURE) == lowest


def test_a_constant_pressure_is_not_doubted():
    inputs = {'velocity': '/joint_states velocity[axis]', 'pressure_a': '/p_a', 'pressure_b': 1e5}
    file = parsed(BENCH, inputs=inputs, force_sum={'load': 'none', 'pressures': True})
    assert pressure_remarks(file, file.actuators[0], Lowest(2e5, -1e9)) == []
    (line,) = pressure_remarks(file, file.actuators[0], Lowest(-1e5, -1e9))
    assert line.startswith('pressure_a')
