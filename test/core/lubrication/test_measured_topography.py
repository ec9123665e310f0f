"""Statistics of measured surfaces against those of surfaces whose power spectrum is given."""

import math

import numpy as np
import pytest

from seal_friction_ros.core.lubrication.measured_topography import measured_roughness, topography_of
from seal_friction_ros.core.lubrication.topography import Topography

STEP, LONGEST, HEIGHT, HURST = 1e-6, 40e-6, 0.5e-6, 0.8  # [m], [m], [m], [-]


def surface(count: int = 1024, along: float = 1.0) -> np.ndarray:
    """Self-affine heights of a roll-off at `LONGEST` across and ``along`` times that along the motion, periodic."""
    random = np.random.default_rng(7)
    q = 2.0 * np.pi * np.fft.fftfreq(count, STEP)
    size = np.hypot(q[:, None], along * q[None, :])
    inside = (size >= 2.0 * np.pi / LONGEST) & (size <= np.pi / STEP)
    power = np.where(inside, np.maximum(size, 1.0) ** (-2.0 - 2.0 * HURST), 0.0)
    noise = np.fft.fft2(random.normal(size=(count, count)))
    rough = np.fft.ifft2(noise * np.sqrt(power)).real
    return HEIGHT * rough / rough.std()


def test_a_map_gives_height_roll_off_and_slope_of_its_spectrum_back():
    heights = surface()
    found = measured_roughness(heights, (STEP, STEP))
    surface_as_input = Topography(**topography_of(found, None))
    assert found.rms_height == pytest.approx(HEIGHT, rel=0.02)
    assert surface_as_input.roll_off_length == pytest.approx(LONGEST, rel=0.1)
    low, high = 2.0 * np.pi / LONGEST, np.pi / STEP
    # of C ~ q^(-2 - 2H): h'^2 / h^2 = H / (1 - H) q_0^2 (q_1 / q_0)^(2 - 2H)
    slope = HEIGHT * low * math.sqrt(HURST / (1.0 - HURST) * ((high / low) ** (2.0 - 2.0 * HURST) - 1.0))
    assert found.rms_slope == pytest.approx(slope, rel=0.1)  # differences are a little less than slopes
    assert (surface_as_input.wall_share, surface_as_input.peklenik_number) == (1.0, 1.0)


def test_a_profile_of_it_gives_the_same_and_neither_tilt_nor_curvature_counts():
    heights = surface()
    flat = measured_roughness(heights, (STEP, STEP))
    x = np.linspace(-1.0, 1.0, heights.shape[1])
    found = [measured_roughness(row[None] + 20e-6 * x + 5e-6 * x**2, (1.0, STEP)) for row in heights[::64]]
    assert np.mean([one.rms_height for one in found]) == pytest.approx(flat.rms_height, rel=0.1)
    assert np.mean([one.rms_slope for one in found]) == pytest.approx(flat.rms_slope, rel=0.05)
    assert np.mean([one.autocorrelation_length for one in found]) == pytest.approx(
        flat.autocorrelation_length, rel=0.15
    )


def test_roughness_that_is_longer_along_the_motion_has_its_peklenik_number():
    found = measured_roughness(surface(along=6.0), (STEP, STEP))
    assert found.peklenik_number == pytest.approx(6.0, rel=0.25)
    assert topography_of(None, found)['peklenik_number'] == 6.0


def test_heights_and_slopes_of_wall_and_seal_add_by_their_squares():
    one = measured_roughness(surface(), (STEP, STEP))
    both = topography_of(one, one._replace(rms_height=2.0 * one.rms_height, autocorrelation_length=1e-5))
    assert both['rms_height'] == pytest.approx(math.sqrt(5.0) * one.rms_height)
    assert both['rms_slope'] == pytest.approx(math.sqrt(2.0) * one.rms_slope)
    assert both['wall_share'] == pytest.approx(0.2)
    ratio = both['roll_off_length'] / topography_of(one, None)['roll_off_length']
    assert ratio == pytest.approx(0.2 + 0.8e-5 / one.autocorrelation_length)


@pytest.mark.parametrize(
    ('heights', 'reason'),
    [
        (np.zeros((1, 10)), 'needs 64 finite heights or more along the motion, not 10'),
        (np.zeros((1, 100)), 'the surface is level'),
        (np.full((1, 100), np.nan), 'finite heights'),
        (np.sin(np.linspace(0.0, 2.0 * np.pi, 200))[None], 'shorter than 10 of its autocorrelation lengths'),
    ],
)
def test_what_is_no_rough_surface_is_refused(heights: np.ndarray, reason: str):
    with pytest.raises(ValueError, match=reason):
        measured_roughness(heights, (1.0, STEP))
