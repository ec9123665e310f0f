"""A rod that friction alone loads: its pressures are the effect of the friction, and no law may rise with them."""

import numpy as np
import pytest

from seal_friction_ros.core.identification.prepare_readings import prepare_logs
from seal_friction_ros.core.identification.readings import RecordedLog
from seal_friction_ros.core.identification.selection import variation_of
from seal_friction_ros.core.identification.signal_preparation import Signals, Sliding

BAR = 1e5  # [Pa]
BORE, ANNULUS = 1.96e-3, 1.65e-3  # [m^2]


def log(returns=(2.0,), loads=(0.0,), with_load_cell=True, scatter=0.03, strokes=48):
    """A cylinder with 600 N + 20 kN s/m of friction; each stroke with the next return pressure [bar] and load [N]."""
    rng = np.random.default_rng(1)
    rows = []
    for k in range(strokes):
        side, speed = (1.0, -1.0)[k % 2], (4e-3, 8e-3, 12e-3)[k // 2 % 3]
        friction = side * (600.0 + 2e4 * speed) * (1.0 + scatter * rng.normal())
        back, load = returns[k // 6 % len(returns)] * BAR, loads[k // 6 % len(loads)]
        a, b = back, back
        if side > 0.0:
            a = (friction + load + back * ANNULUS) / BORE
        else:
            b = (back * BORE - friction - load) / ANNULUS
        rows += [(side * speed, a, b, load * with_load_cell)] * 100 + [(0.0, back, back, load)] * 20
    velocity, a, b, load = np.array(rows).T
    force = a * BORE - b * ANNULUS - load
    return RecordedLog('log', Signals(np.arange(len(a)) * 0.01, velocity, a, b, force), Sliding())


def test_friction_that_makes_the_pressures_tells_no_dependence_on_them():
    readings = prepare_logs([log()], ['a', 'b']).readings
    assert readings.free_rod is not None
    assert readings.free_rod.areas == pytest.approx((BORE, -ANNULUS), rel=0.05)
    assert readings.free_rod.paid == pytest.approx(760.0 / BORE, rel=0.1)
    assert variation_of(readings).pressures == 0
    assert variation_of(readings).speeds


@pytest.mark.parametrize(
    'moved',
    [{'returns': (2.0, 10.0, 30.0, 60.0)}, {'loads': (1000.0, 4000.0, 9000.0), 'returns': (80.0,)}],
    ids=['return pressures', 'loads'],
)
def test_pressures_that_something_else_moved_tell_it(moved):
    readings = prepare_logs([log(**moved)], ['a', 'b']).readings
    assert readings.free_rod is None
    assert variation_of(readings).pressures == 3


def test_one_constant_load_tells_no_more_than_none():
    assert prepare_logs([log(loads=(2500.0,), returns=(80.0,))], ['a', 'b']).readings.free_rod is not None


def test_a_free_rod_is_known_by_half_the_pressure_that_friction_takes():
    assert prepare_logs([log(returns=(2.0, 3.5))], ['a', 'b']).readings.free_rod is not None
