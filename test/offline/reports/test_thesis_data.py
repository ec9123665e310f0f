"""The points of the thesis in SI."""

import numpy as np
import pytest

from seal_friction_ros.core.foundation.units import INCH, LBF, PSI
from seal_friction_ros.offline.reports.thesis_data import (
    appendix_b,
    dynamic_readings,
    mean_dynamic_friction,
    thesis_columns,
)


def test_appendix_b_is_read_in_si():
    assert list(appendix_b()) == [0.0, 250.0, 500.0, 750.0, 1000.0]
    contact = appendix_b()[1000.0]
    assert contact.peak_stress == pytest.approx(1187.3 * PSI)
    assert contact.normal_force == pytest.approx(91.1 * 4.448, rel=1e-3)
    assert contact.width == pytest.approx(0.05 * INCH)
    assert contact.stress.max() == contact.peak_stress
    assert np.all(np.diff(contact.position) > 0.0)


def test_the_66_dynamic_readings_and_their_means():
    pressure, friction = dynamic_readings()
    levels, means = mean_dynamic_friction()
    assert (len(pressure), len(friction), len(levels)) == (66, 66, 11)
    assert levels == pytest.approx(100.0 * PSI * np.arange(11))
    assert means[5] / LBF == pytest.approx(9.5, abs=0.005)
    assert means.mean() == pytest.approx(friction.mean())


def test_columns_come_in_the_order_they_are_named_in():
    normal, pressure = thesis_columns('normal_force', normal_force_lbf=LBF, pressure_psig=PSI)
    assert pressure[1] == pytest.approx(250.0 * PSI)
    assert normal[1] == pytest.approx(22.4 * LBF)
