"""The loop of a lubricated seal by the elastic model, with parameters from its friction map alone."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.friction.presliding import NOT_SHEARED, Slide, presliding_numbers, presliding_of_map, shear
from seal_friction_ros.core.friction.seal_file import parse_seal
from seal_friction_ros.offline.contact.lubrication_runs import run_map, seal_document
from seal_friction_studies.core.transient import last_cycle, run_transient
from seal_friction_studies.offline.study_runs import single_case


def figure_14(groove_friction):
    """The stroke of Figure 14 of the paper, with a coefficient of friction between seal and groove."""
    case = single_case('inner_seal_groove', 'loop')
    return replace(case, groove=replace(case.groove, friction_coefficient=groove_friction))


CASES = {
    'inner_seal': (single_case('inner_seal', 'loop'), 0.1),
    'Figure 14': (figure_14(0.15), 0.1),  # the coefficient of the paper
    'Figure 14, smooth groove': (figure_14(0.0), 0.25),  # two seats, between which the seal jumps: no element does
}


@pytest.fixture(scope='module')
def computed():
    return run_map(single_case('inner_seal', 'map'), 1)


@pytest.mark.long  # whole maps
@pytest.mark.parametrize('name', CASES)
def test_the_loop_of_the_seal_follows_from_the_map(name):
    case, largest = CASES[name]
    law, run = run_map(case, 1).law, run_transient(case)
    numbers, state, found = presliding_numbers([presliding_of_map(law)]), NOT_SHEARED, []
    coulomb = law.coulomb_friction(0.0)
    stiction = law.sliding_friction(0.0, law.speeds[0]) - coulomb
    ways, steps = np.diff(run.position, prepend=run.position[0]), np.diff(run.time, prepend=run.time[0])
    for way, step, velocity in zip(ways.tolist(), steps.tolist(), run.velocity.tolist(), strict=True):
        excess = law.sliding_friction(0.0, abs(velocity)) - coulomb
        state, friction = shear(numbers, state, Slide(way, step, coulomb, excess, stiction))
        found.append(friction)
    last = last_cycle(run)
    error = (np.array(found) - run.friction)[last]
    assert np.sqrt(np.mean(error**2)) < largest * np.ptp(run.friction[last])


@pytest.mark.long  # a whole map
def test_the_seal_file_of_a_map_has_its_elasticity(computed):
    seal = parse_seal(seal_document(computed, 'inner'))
    assert seal.presliding.stiffness == pytest.approx(computed.case.groove.stiffness, rel=1e-6)
    assert seal.presliding.memory_length == pytest.approx(computed.law.memory_length, rel=1e-6)
