"""Film, roughness and elastic seal together: the limits that have a closed form, and what every step must hold."""

import json
import math
import os
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from paths import ROOT

from seal_friction_ros.core.foundation.errors import NotConvergedError
from seal_friction_ros.core.lubrication import contact as contact_module
from seal_friction_ros.core.lubrication.contact import (
    ContactState,
    LubricatedContact,
    contact_step,
    dry_contact,
    film_properties,
)
from seal_friction_ros.core.lubrication.elasticity import ElasticBody, half_plane
from seal_friction_ros.core.lubrication.flow_factors import shear_stress_coefficients, shear_stress_factors
from seal_friction_ros.core.lubrication.grease import Grease
from seal_friction_ros.core.lubrication.model import fluid_shear, real_area_share, solid_shear
from seal_friction_ros.core.lubrication.reynolds import FilmEnds
from seal_friction_ros.core.lubrication.topography import Topography

LENGTH, RADIUS, MODULUS, DEPTH = 0.6e-3, 1e-3, 14.28e6, 1e-3  # [m], [m], [Pa], [m]
OIL = Grease(yield_stress=0.0, consistency_index=0.0, base_viscosity=0.5)
ROUGH, GREASE = Topography(), Grease()
SMOOTH = Topography(rms_height=0.05e-6, rms_slope=0.05)


def profile(cells: int, interference: float = 36e-6):
    x = (np.arange(cells) + 0.5) * LENGTH / cells - 0.5 * LENGTH
    return x**2 / (2.0 * RADIUS) - interference


def made(cells: int, topography: Topography = ROUGH, grease: Grease = GREASE) -> LubricatedContact:
    return LubricatedContact(half_plane(cells, LENGTH / cells, MODULUS, DEPTH), topography, grease)


def slid(
    contact: LubricatedContact,
    state: ContactState,
    velocity: float,
    shares=(0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 20, 100, math.inf),
):
    """Steady sliding, by ever longer steps."""
    for share in shares:
        old = state.gap * state.saturation
        step = contact_step(
            contact, state, profile(len(old)), -velocity, FilmEnds(), old, share * LENGTH / abs(velocity)
        )
        state = step.state
    return step


class Shear(NamedTuple):
    """Shear forces [N/m]."""

    solid: float
    fluid: float


def shear(
    contact: LubricatedContact, state: ContactState, wall_velocity: float, solid_shear_stress: float, ends: FilmEnds
):
    width = contact.body.cell_width
    fluid = fluid_shear(*state, wall_velocity, contact.grease.numbers, width, ends, contact.stress_roughness)
    return Shear(solid_shear(contact, state.gap, solid_shear_stress), float(fluid))


def dry(contact: LubricatedContact) -> ContactState:
    gap = dry_contact(contact, profile(contact.body.cells))
    return ContactState(gap, np.zeros_like(gap), np.ones_like(gap))


def thick_film(cells: int, velocity: float = 0.2):
    """Smooth soft contact, fully lifted: the dry rough contact gives a first guess."""
    rough = made(cells)
    gap = dry_contact(rough, profile(cells))
    pressure, _ = rough.asperity_pressure(gap)
    smooth = made(cells, SMOOTH, OIL)
    return smooth, slid(
        smooth, ContactState(gap + 1e-6, pressure, np.ones(cells)), velocity, (0.01, 0.1, 1, 10, 100, math.inf)
    )


def test_dry_contact_carries_nearly_the_pressure_of_hertz():
    contact = made(226, Topography(rms_height=0.2e-6, rms_slope=0.9, roll_off_length=2e-6))
    state = dry(contact)
    pressure, _ = contact.asperity_pressure(state.gap)
    load = pressure.sum() * LENGTH / 226
    assert pressure.max() == pytest.approx(math.sqrt(load * MODULUS / (math.pi * RADIUS)), rel=0.02)


def test_dry_limit_gives_solid_shear_stress_times_real_area_exactly():
    contact = made(226)
    state = dry(contact)._replace(saturation=np.zeros(226))
    area = real_area_share(contact, state.gap).sum() * LENGTH / 226
    forces = shear(contact, state, -0.034, 1.5e6, FilmEnds())
    assert forces.fluid == 0.0
    assert forces.solid == pytest.approx(1.5e6 * area, rel=1e-15)
    assert solid_shear(contact, state.gap, 3e6) == 2.0 * forces.solid


def test_full_film_between_plates_shears_like_newton():
    n = 50
    state = ContactState(np.full(n, 3e-6), np.full(n, 1e5), np.ones(n))
    ends = FilmEnds(1e5, 1e5)
    smooth = (0.0, shear_stress_coefficients(1.0))
    force = fluid_shear(*state, -0.2, OIL.numbers, LENGTH / n, ends, smooth)
    assert force == pytest.approx(-0.5 * 0.2 / 3e-6 * LENGTH, rel=1e-13)


def test_roughness_raises_the_shear_between_plates_by_its_factor():
    n, coefficients = 50, shear_stress_coefficients(1.0)
    state = ContactState(np.full(n, 3e-6), np.full(n, 1e5), np.ones(n))
    smooth, rough = (
        fluid_shear(*state, -0.2, OIL.numbers, LENGTH / n, FilmEnds(1e5, 1e5), (height, coefficients))
        for height in (0.0, 2e-6)
    )
    assert rough == pytest.approx(shear_stress_factors(coefficients, 1.5)[0] * smooth, rel=1e-13)
    assert rough / smooth > 2.0


def test_full_film_limit_of_the_soft_contact_is_newtonian_shear_alone():
    contact, step = thick_film(226)
    gap, pressure, saturation = step.state
    slope = np.gradient(pressure, LENGTH / 226)
    newton = (saturation * (0.5 * -0.2 / gap - 0.5 * gap * slope)).sum() * LENGTH / 226
    forces = shear(contact, step.state, -0.2, 1.5e6, FilmEnds())
    assert forces.fluid == pytest.approx(newton, rel=1e-3)
    assert forces.solid < 1e-9 * abs(forces.fluid)


def test_film_of_a_smooth_soft_contact_is_that_of_its_steepest_pressure_with_second_order():
    """h* = sqrt(8 eta U / (9 |dp/dx|max)), Blok's inverse theory; h* the height that flows."""
    errors = []
    for cells in (113, 226, 452):
        _, step = thick_film(cells)
        steepest = np.abs(np.diff(step.state.pressure)[cells // 2 :]).max() / (LENGTH / cells)
        height = -step.flow[cells // 2] / 0.1
        errors.append(abs(height / math.sqrt(8.0 * 0.5 * 0.2 / (9.0 * steepest)) - 1.0))
    assert errors[1] < 5e-4
    assert all(order > 1.8 for order in np.log2(np.array(errors[:-1]) / errors[1:]))


def test_film_of_a_smooth_soft_contact_is_near_the_formula_for_line_contacts():
    """Isoviscous-elastic: h W / (eta u R) = 3.10 (W / sqrt(eta u E' R))^0.8, u the mean velocity, E' = 2 E*."""
    _, step = thick_film(226)
    load = step.state.pressure.sum() * LENGTH / 226
    rate = 0.5 * 0.1 * RADIUS
    film = step.state.gap.min() * load / rate
    assert film == pytest.approx(3.10 * (load / math.sqrt(rate * 2.0 * MODULUS)) ** 0.8, rel=0.05)


def test_every_step_conserves_mass_and_keeps_film_and_void_apart():
    contact = made(226)
    state = dry(contact)
    for i in range(40):
        velocity = 0.034 * math.sin(0.2 * i)
        old = state.gap * state.saturation
        step = contact_step(contact, state, profile(226), -velocity, FilmEnds(), old, 5e-4)
        state = step.state
        volume = (state.gap * state.saturation).sum() * LENGTH / 226
        gained = (step.flow[0] - step.flow[-1]) * 5e-4
        assert abs(volume - old.sum() * LENGTH / 226 - gained) <= 1e-12 * volume
        assert np.abs(state.pressure / 1e6 * (1.0 - state.saturation)).max() <= 1e-12
        assert state.pressure.min() >= -1e-6
        solid, _ = contact.asperity_pressure(state.gap)
        elastic = state.gap - profile(226) - contact.body.matrix @ (state.pressure + solid)
        assert np.abs(elastic).max() <= 2e-13


def test_faster_sliding_lifts_the_seal_off_its_asperities():
    contact = made(113)
    state = dry(contact)
    solid, fluid = [solid_shear(contact, state.gap, 1.5e6)], [0.0]
    for velocity in (0.001, 0.01, 0.1):
        step = slid(contact, state, velocity)
        forces = shear(contact, step.state, -velocity, 1.5e6, FilmEnds())
        solid.append(forces.solid)
        fluid.append(-forces.fluid)
    assert solid == sorted(solid, reverse=True)
    assert fluid == sorted(fluid)
    assert solid[-1] < 0.5 * solid[0]


def test_steady_friction_converges_with_the_grid():
    found = []
    for cells in (64, 128, 256, 512):
        contact = made(cells)
        step = slid(contact, dry(contact), 0.034)
        found.append(shear(contact, step.state, -0.034, 1.5e6, FilmEnds()).solid)
    changes = np.abs(np.diff(found))
    assert changes[-1] < 1e-3 * found[-1]
    assert all(np.log2(changes[:-1] / changes[1:]) > 0.9)


def test_jacobian_makes_newton_converge_quadratically(monkeypatch):
    """From a state that is off by little, three iterations must do: a wrong derivative needs many."""
    contact = made(113)
    steady = slid(contact, dry(contact), 0.02)
    monkeypatch.setattr(contact_module, '_GMRES_TOLERANCE', 1e-8)
    old = steady.state.gap * steady.state.saturation
    step = contact_step(contact, steady.state, profile(113) + 1e-11, -0.02, FilmEnds(), old, 1e-3)
    assert step.iterations <= 3


def test_surfaces_that_would_overlap_are_an_error():
    flat = made(64, Topography(rms_height=0.3e-6, rms_slope=0.1))
    rough = dry(made(64))
    old = rough.gap * 0.0
    with pytest.raises(NotConvergedError, match=r'the surfaces overlap by .* give it a larger rms_height'):
        contact_step(
            flat,
            rough._replace(saturation=np.zeros(64)),
            profile(64),
            0.0,
            FilmEnds(saturation_left=0.0, saturation_right=0.0),
            old,
            1e-3,
        )


def test_step_that_does_not_converge_is_an_error_that_says_what_is_left(monkeypatch):
    monkeypatch.setattr(contact_module, '_ITERATIONS', 2)
    contact = made(64)
    monkeypatch.setattr(contact_module, '_GMRES_TOLERANCE', 0.5)
    state = ContactState(profile(64) + 40e-6, np.zeros(64), np.ones(64))
    with pytest.raises(NotConvergedError, match=r'not converged after 2 iterations: .* m of elastic equation'):
        contact_step(contact, state, profile(64), -0.034, FilmEnds(), state.gap, 1e-3)


def test_compiled_and_plain_python_agree():
    """The functions are compiled for speed only."""
    code = (
        'import json, sys; sys.path[:0] = ["test", "test/core/lubrication"]; from test_contact import *\n'
        'contact = made(40); state = dry(contact)\n'
        'step = contact_step(contact, state, profile(40), -0.02, FilmEnds(), state.gap, 1e-3)\n'
        'print(json.dumps([step.state.gap.tolist(), step.state.pressure.tolist()]))'
    )
    environment = {**os.environ, 'PYTHONPATH': str(ROOT), 'NUMBA_DISABLE_JIT': '1'}
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    gap, pressure = json.loads(done.stdout)
    contact = made(40)
    state = dry(contact)
    step = contact_step(contact, state, profile(40), -0.02, FilmEnds(), state.gap, 1e-3)
    assert step.state.gap == pytest.approx(gap, rel=1e-12)
    assert step.state.pressure == pytest.approx(pressure, rel=1e-9, abs=1e-3)


def test_a_number_that_is_not_finite_never_comes_out():
    contact = made(64)
    state = dry(contact)
    with pytest.raises(NotConvergedError, match='not converged after 1 iterations'):
        contact_step(contact, state._replace(gap=np.full(64, np.nan)), profile(64), 0.01, FilmEnds(), state.gap, 1e-3)


def test_what_does_not_converge_says_which_part_of_it(monkeypatch):
    contact = made(64)
    state = dry(contact)
    monkeypatch.setattr(contact_module, '_GMRES_TOLERANCE', 1e-12)
    monkeypatch.setattr(contact_module, '_GMRES_ITERATIONS', 1)
    with pytest.raises(NotConvergedError, match=r'^contact step: GMRES: not solved after 1 iterations$'):
        contact_step(contact, state, profile(64), -0.02, FilmEnds(), state.gap, 1e-3)
    monkeypatch.setattr(contact_module, '_ITERATIONS', 1)
    with pytest.raises(NotConvergedError, match=r'^dry contact: .* m left after 1 iterations$'):
        dry_contact(contact, profile(64))


class Counted:
    """A body that counts how often it is deflected."""

    def __init__(self, body: ElasticBody) -> None:
        self._body, self.deflections = body, 0

    def __getattr__(self, name):
        return getattr(self._body, name)

    def deflection(self, pressure):
        self.deflections += 1
        return self._body.deflection(pressure)


@pytest.mark.parametrize('compliance_factor', [1.0, 0.25, 0.0625])
def test_banded_stiffness_prepares_the_elastic_equation_whatever_share_of_the_compliance_acts(compliance_factor):
    """A solve of GMRES that is well prepared needs few products, each one deflection; so does the whole step."""
    body = Counted(half_plane(96, LENGTH / 96, MODULUS, DEPTH))
    contact = LubricatedContact(body, ROUGH, GREASE)
    start = dry(contact)
    rigid = profile(96) + (1.0 - compliance_factor) * (start.gap - profile(96))  # the rest has crept
    body.deflections = 0
    step = contact_step(contact, start, rigid, -0.02, FilmEnds(), start.gap, 1e-3, compliance_factor)
    assert body.deflections <= 6 * (step.iterations + 1)


def test_grease_is_thinned_by_shear_in_the_mobility():
    rough = made(16).rough
    gap = np.array([2e-6])
    slow, fast = (film_properties(gap, speed, Grease().numbers, rough)[0, 0] for speed in (1e-4, 1e-1))
    assert fast > 5.0 * slow


@pytest.mark.parametrize('velocity', [1e-6, -1e-6])
def test_plates_that_creep_under_high_pressure_carry_their_film_along(velocity):
    """Gap 0.1 mm, oil of 0.1 Pa s, 10 MPa on both sides: the smallest rounding error of a pressure moves more oil.

    That error over a cell, 2e-9 Pa / 19 um, moves 8e-17 m^2/s; the walls move 5e-11 m^2/s, and have to within 1e-13.
    """
    oil = Grease(yield_stress=0.0, consistency_index=0.0, base_viscosity=0.1)
    contact = LubricatedContact(half_plane(32, LENGTH / 32, 1e13, DEPTH), ROUGH, oil)
    even, rigid = np.ones(32), np.full(32, 1e-4)
    gap = rigid + contact.body.deflection(1e7 * even)
    away = ContactState(gap, 1e7 * (1.0 + 1e-9 * np.sin(np.arange(32.0))), even)
    step = contact_step(contact, away, rigid, velocity, FilmEnds(1e7, 1e7), gap, 1e-3)
    assert step.state.pressure == pytest.approx(1e7 * even, rel=1e-9)
    assert step.state.gap == pytest.approx(gap, abs=1e-12)
    assert step.flow == pytest.approx(np.full(33, 0.5 * velocity * 1e-4), rel=1e-4)
