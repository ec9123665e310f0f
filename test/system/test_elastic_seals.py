"""The feed-forward with fitted elasticity, on a plant of the same kind and on a structurally different one."""

from dataclasses import replace

import pytest
from system.elastic_seals import (
    MOTIONS,
    PLANTS,
    estimate_errors,
    identified,
    least_in_band,
    on_random_motions,
    result,
    tracking,
)

from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.core.friction.presliding import Presliding
from seal_friction_ros.core.servo.motions import Sine


@pytest.mark.parametrize(
    ('plant', 'less', 'against'),
    [('elements, 1e5 N/m', 0.60, 0.80), ('elements, 4e5 N/m', 0.80, 0.90), ('LuGre, 3e5 N/m', 0.65, 0.90)],
)
@pytest.mark.long  # `core/tuning/test_other_plants.py` has a shorter form
def test_the_elastic_feed_forward_reduces_the_tracking_error(plant, less, against):
    found = result(PLANTS[plant], identified(PLANTS[plant]).presliding)
    assert found.elastic < (1.0 - less) * found.without
    assert found.against < (1.0 - against) * found.without
    assert max(found.softer, found.stiffer) < 0.45 * found.without
    assert max(found.against_softer, found.against_stiffer) < 0.4 * found.without
    assert found.elastic < 0.5 * found.rigid


@pytest.mark.long
@pytest.mark.parametrize('against', [False, True])
def test_a_stiffness_that_is_a_tenth_of_the_right_one_is_not_worse_than_no_feed_forward(against):
    off = FeedForwardSettings(scale=0.0, slew_limit=1e9)
    on = replace(off, scale=1.0, presliding=True, presliding_against_motion=against)
    plant = PLANTS['elements, 1e6 N/m']
    assert tracking(plant, Presliding(stiffness=1e5), on) < 0.9 * tracking(plant, None, off)


FOUND = Presliding(stiffness=6.22e5, yield_exponent=2.32, memory_length=4e-4, relative_std=0.004)
"""What `identified` finds on the LuGre plant, so that no log is simulated here; see `test_the_fit_is_known`."""


@pytest.mark.long
def test_the_fit_is_known():
    found = identified(PLANTS['LuGre, 3e5 N/m']).presliding
    assert found.stiffness == pytest.approx(FOUND.stiffness, rel=0.01)
    assert found.yield_exponent == pytest.approx(FOUND.yield_exponent, rel=0.02)


@pytest.mark.long  # `test_sheared_seals` has other structures
def test_on_another_structure_the_estimate_follows_the_shear_and_status_0_holds():
    wave, duration = MOTIONS['5 mm at 0.5 Hz']
    rigid, elastic = (estimate_errors(PLANTS['LuGre, 3e5 N/m'], model, wave, duration) for model in (None, FOUND))
    assert elastic.rms < 0.15 * rigid.rms
    assert elastic.in_band > 0.97
    assert elastic.good > 0.6
    assert rigid.rms_good > 2.0 * elastic.rms_good


@pytest.mark.long  # compiles the elastic plant; `test_sheared_seals` has heavy loads
def test_status_0_holds_with_a_heavy_load():
    model = Presliding(stiffness=4e5, yield_exponent=1.0)
    found = estimate_errors(PLANTS['elements, 4e5 N/m'], model, Sine(5e-3, 2.0), 3.0, 100.0)
    assert found.in_band > 0.97
    assert found.good > 0.4


@pytest.mark.long
@pytest.mark.parametrize('plant', PLANTS)
def test_on_every_plant_samples_with_status_0_are_in_their_band(plant):
    model = identified(PLANTS[plant]).presliding
    for wave, duration in MOTIONS.values():
        rigid, elastic = (estimate_errors(PLANTS[plant], seals, wave, duration) for seals in (None, model))
        assert elastic.rms < 0.6 * rigid.rms
        assert not elastic.in_band < 0.95  # NaN: no sample is good on soft seals and a short stroke


@pytest.mark.long
def test_on_random_motions_of_heavy_and_light_loads_samples_with_status_0_are_in_their_band():
    assert least_in_band(on_random_motions(12)) > 95.0
