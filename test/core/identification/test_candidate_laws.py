"""Candidate laws: what is fitted is what the node runs, and each law has the limits that its physics has."""

from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np
import pytest

from seal_friction_ros.core.foundation.parameters import parameter
from seal_friction_ros.core.foundation.units import INCH, LBF
from seal_friction_ros.core.friction.actuator import MountedSeal, actuator_friction
from seal_friction_ros.core.friction.geometry import SealGeometry, squeeze_force
from seal_friction_ros.core.friction.laws import FRICTION_LAWS
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.normal_force import AreaDeformationGain
from seal_friction_ros.core.friction.seal_file import law_document, parse_seal
from seal_friction_ros.core.identification.candidate_laws import (
    COMPILED_FROM,
    FittedParameter,
    OperatingConditions,
    Variation,
    candidate_laws,
    normal_forces,
    with_velocity_terms,
)

THESIS_RING = SealGeometry(0.106 * INCH, 0.612 * INCH, 0.625 * INCH, 0.821 * INCH)
VALUES = {
    'coulomb_friction_at_any_pressure': 12.0,
    'friction_at_no_pressure': 5.0,
    'friction_at_one_bar': 0.8,
    'pressure_exponent': 0.7,
    'coefficient': 2.0,
    'exponent': 0.56,
    'viscous_friction': 150.0,
    'stribeck_friction': 4.0,
    'stribeck_velocity': 0.02,
    'asymmetry': 0.1,
}
NORMAL_FORCE_LAW = AreaDeformationGain(0.3925, 9.3)
BASES = candidate_laws(Variation(), THESIS_RING, NORMAL_FORCE_LAW)
PHYSICS = next(law for law in BASES if law.name == 'physics_based')
ALL = (*BASES, *with_velocity_terms(PHYSICS, Variation()))


def conditions(rows=50) -> OperatingConditions:
    """Two seals, one on each chamber, at any pressures and speeds."""
    rng = np.random.default_rng(4)
    pressure = rng.uniform(0.0, 5e6, (rows, 2))
    velocity = rng.uniform(-0.2, 0.2, rows)
    return OperatingConditions(pressure, velocity, np.sign(velocity))


def values_of(law):
    """Parameters of a law: those of `VALUES`, else the first guess."""
    guess = law.first_guess(conditions(), 12.0)
    return {name: VALUES.get(name, value) for name, value in guess.items()} | law.fixed


def seal_of(law):
    """The seal of the seal file that `identify` writes for these values."""
    terms = {name: VALUES[name] for name in law.velocity_terms}
    document = {
        'name': 'test',
        **law_document(law.friction_law(values_of(law))),
        'uncertainty': {'relative_std': 0.1},
        'identified_pressure': [0.0, 5e6],
    }
    return parse_seal(document | ({'velocity_terms': terms} if terms else {}))


@pytest.mark.parametrize('law', ALL, ids=lambda law: law.name)
def test_what_is_fitted_is_what_the_node_runs(law):
    at = conditions()
    seal = seal_of(law)
    mounted = (MountedSeal(seal, 'a'), MountedSeal(seal, 'b'))
    node = []
    for (a, b), v in zip(at.pressure, at.velocity, strict=True):
        found = actuator_friction(mounted, a, b, v)
        node.append(found.coulomb_friction + found.velocity_friction)
    assert law.friction(at, values_of(law)) == pytest.approx(np.array(node), rel=1e-12)


def test_the_candidates_are_ordered_from_constant_to_physics_based():
    names = [law.name for law in ALL]
    assert names[0] == 'constant_coulomb'
    order = ['constant_coulomb', 'coulomb_viscous', 'pressure_power_law', 'physics_based', 'physics_based_stribeck']
    assert [name for name in names if name in order] == order
    assert names[-1] == 'physics_based_asymmetric'
    assert all(law.depends_on_pressure is not law.name.startswith(('constant', 'coulomb')) for law in ALL)


def test_a_law_that_depends_on_speed_needs_speeds_and_has_no_velocity_terms(monkeypatch):
    @dataclass(frozen=True)
    class Fading(ConstantCoulomb):
        NAME = 'fading'
        reference_speed: float = parameter(0.0, unit='m/s', lower=0.0, upper=1.0, description='Of Coulomb friction.')

    registry = 'seal_friction_ros.core.identification.candidate_laws.FRICTION_LAWS'
    monkeypatch.setattr(registry, [*FRICTION_LAWS, Fading])
    fading = candidate_laws(Variation())[-1]
    assert (fading.name, fading.depends_on_speed, PHYSICS.depends_on_speed) == ('fading', True, False)
    assert with_velocity_terms(fading, Variation()) == ()
    assert 'fading' not in [law.name for law in candidate_laws(Variation(speeds=False))]


def test_without_geometry_or_speeds_the_laws_that_need_them_are_not_there():
    bare = candidate_laws(Variation(speeds=False))
    powers = ['pressure_power_law_2_3', 'pressure_power_law_1', 'pressure_power_law_3_2', 'pressure_power_law_2']
    names = [law.name for law in bare]
    assert 'physics_based' not in names
    assert names[:6] == ['constant_coulomb', *powers, 'pressure_power_law']
    assert not any(law.parts or law.velocity_terms for law in bare)


def test_few_pressures_get_fixed_exponents():
    laws = [law for law in candidate_laws(Variation(exponent=False)) if law.name.startswith('pressure_power_law')]
    assert [law.fixed['pressure_exponent'] for law in laws] == pytest.approx([2.0 / 3.0, 1.0, 1.5, 2.0])
    for law in laws:
        assert [p.name for p in law.parameters] == ['friction_at_no_pressure', 'friction_at_one_bar']


@pytest.mark.parametrize(
    ('pressures', 'fitted'), [(1, ['friction_at_one_bar']), (2, ['friction_at_no_pressure', 'friction_at_one_bar'])]
)
def test_one_or_two_pressures_get_the_exponent_of_a_prior(pressures, fitted):
    (law,) = candidate_laws(Variation(pressures=pressures))
    assert [p.name for p in law.parameters] == fitted
    assert law.fixed['pressure_exponent'] == pytest.approx(2.0 / 3.0)


def test_asymmetry_is_tried_only_where_it_is_no_offset():
    law = PHYSICS
    assert [each.name for each in with_velocity_terms(law, Variation(speeds=False, asymmetry=False))] == []
    assert len(with_velocity_terms(law, Variation())) == 3


def test_at_no_pressure_and_at_one_bar_the_power_law_is_what_its_parameters_say():
    (law,) = (r for r in ALL if r.name == 'pressure_power_law')
    at = OperatingConditions(np.array([[0.0], [1e5]]), np.zeros(2), np.ones(2))
    assert law.friction(at, VALUES) == pytest.approx([5.0, 5.8])


def test_stribeck_friction_has_faded_to_37_percent_at_its_velocity():
    (law,) = (r for r in ALL if r.name == 'coulomb_stribeck')
    at = OperatingConditions(np.zeros((2, 1)), np.array([0.0, -0.02]), np.array([1.0, -1.0]))
    viscous = np.array([0.0, 0.02 * 150.0])
    assert law.friction(at, VALUES) - 12.0 - viscous == pytest.approx([4.0, 4.0 * np.exp(-1.0)])


@pytest.mark.parametrize('law', ALL, ids=lambda law: law.name)
def test_many_readings_are_computed_by_compiled_code_to_the_same_bits(law):
    at, part = conditions(rows=400), COMPILED_FROM // 2 - 1
    few = [law.friction(at.taken(np.arange(i, min(i + part, 400))), values_of(law)) for i in range(0, 400, part)]
    assert law.friction(at, values_of(law)).tobytes() == np.concatenate(few).tobytes()


def test_squeeze_force_of_the_thesis_ring_is_near_that_of_our_finite_elements():
    assert squeeze_force(THESIS_RING) == pytest.approx(30.2, abs=0.1)
    assert squeeze_force(THESIS_RING) == pytest.approx(6.23 * LBF, rel=0.1)  # docs/oring.md: blind, 0 psi


def test_squeeze_force_rises_with_squeeze():
    tight = SealGeometry(0.110 * INCH, 0.612 * INCH, 0.625 * INCH, 0.821 * INCH)
    assert squeeze_force(tight) > 1.5 * squeeze_force(THESIS_RING)


def test_a_first_guess_takes_the_highest_pressure_and_speed_and_the_mean_normal_force():
    at = OperatingConditions(
        np.array([[1e5, 3e5], [5e5, 2e5], [0.0, 0.0]]), np.array([0.02, -0.05, np.nan]), np.array([1.0, -1.0, 1.0])
    )
    names = ('friction', 'pressure', 'speed', 'normal_force')
    shown = tuple(FittedParameter(name, '', 0.0, 1.0, attrgetter(name), '') for name in names)
    (constant, *_) = candidate_laws(Variation())
    rigid = replace(constant, parameters=shown)
    assert list(rigid.first_guess(at, 7.0).values()) == pytest.approx([7.0, 5e5, 0.05, np.nan], nan_ok=True)
    assert rigid.first_guess(at._replace(velocity=np.full(3, np.nan)), 7.0)['speed'] == 0.0
    ring = {'geometry': THESIS_RING, 'normal_force_law': NORMAL_FORCE_LAW}
    loaded = replace(rigid, parts=ring).first_guess(at, 7.0)['normal_force']
    assert loaded == pytest.approx(normal_forces(at.pressure, **ring).mean())
    taken = at.taken(np.array([2, 0]))
    assert taken.pressure.tolist() == [[0.0, 0.0], [1e5, 3e5]]
    assert taken.direction.tolist() == [1.0, 1.0]


def test_a_fit_has_the_bounds_of_physics():
    bounds = {p.name: (p.lower, p.upper) for law in ALL for p in law.parameters}
    assert bounds['coulomb_friction_at_any_pressure'] == (0.0, 1e6)  # [N]
    assert bounds['friction_at_one_bar'] == (0.0, 1e6)
    assert bounds['pressure_exponent'] == (0.05, 2.0)
    assert bounds['viscous_friction'] == (0.0, 1e7)  # [N s/m]
    assert bounds['stribeck_velocity'] == (1e-4, 1.0)  # [m/s]
    assert bounds['asymmetry'] == (-0.9, 0.9)


def test_an_unknown_speed_counts_as_none():
    law = next(law for law in ALL if law.name == 'coulomb_viscous')
    at = OperatingConditions(np.zeros((2, 2)), np.array([np.nan, -0.1]), np.array([1.0, -1.0]))
    assert law.friction(at, VALUES) == pytest.approx([24.0, 24.0 + 2.0 * 15.0])
    assert law.coulomb_friction(at, VALUES) == pytest.approx([24.0, 24.0])
    assert law.velocity_terms == ('viscous_friction',)


def test_a_formula_says_what_was_added_and_which_exponent_was_fixed():
    formulas = {law.name: law.formula for law in ALL}
    power = formulas['pressure_power_law']
    assert '^m' in power
    for name, exponent in (('2_3', '^(2/3)'), ('1', ''), ('3_2', '^(3/2)'), ('2', '^2')):
        assert formulas[f'pressure_power_law_{name}'] == power.replace('^m', exponent)
    assert formulas['coulomb_stribeck'] == formulas['constant_coulomb'] + ' + viscous + Stribeck'
    (prior,) = candidate_laws(Variation(pressures=1))
    assert prior.formula == power.replace('^m', '^(2/3)') + ', rise over pressure from a prior'
    assert (prior.name, prior.fixed['friction_at_no_pressure']) == ('pressure_power_law_2_3', 0.0)
    assert 'friction_at_no_pressure' not in candidate_laws(Variation(pressures=2))[0].fixed
    (alone,) = with_velocity_terms(BASES[0], Variation(speeds=False))
    assert (alone.name, alone.formula) == ('coulomb_asymmetric', formulas['constant_coulomb'] + ' + asymmetry')
    assert [p.name for p in alone.parameters] == ['coulomb_friction_at_any_pressure', 'asymmetry']
    terms = [[p.name for p in law.parameters][1:] for law in with_velocity_terms(BASES[0], Variation())]
    assert terms == [['viscous_friction'], ['viscous_friction', 'stribeck_friction', 'stribeck_velocity'],
                     ['viscous_friction', 'asymmetry']]  # fmt: skip
    symmetric = [law.name for law in candidate_laws(Variation(asymmetry=False))]
    assert 'coulomb_asymmetric' not in symmetric
    assert 'coulomb_stribeck' in symmetric


def test_normal_forces_are_those_of_each_pressure():
    pressure = np.array([[0.0, 1e6], [1e6, 2e6]])
    found = normal_forces(pressure, THESIS_RING, NORMAL_FORCE_LAW)
    zero, one, two = (normal_forces(np.array([[p]]), THESIS_RING, NORMAL_FORCE_LAW)[0, 0] for p in (0.0, 1e6, 2e6))
    assert zero < one < two
    assert found.tolist() == [[zero, one], [one, two]]
