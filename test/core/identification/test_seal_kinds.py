"""Several kinds of seals in one cylinder: told apart where their pressures varied by themselves, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.friction.mounting import pressures_at_seals
from seal_friction_ros.core.identification.candidate_laws import (
    OperatingConditions,
    SealKind,
    columns_of,
    law_of_all_terms,
)
from seal_friction_ros.core.identification.fitting import covariance_of_terms, fit
from seal_friction_ros.core.identification.friction_model import Told
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.seal_kinds import (
    LARGEST_KIND_ERROR,
    _multiple_correlation,
    advice,
    area_errors,
    check_kinds,
    check_told_apart,
    kinds_readings,
    moved_together,
    poorly_told_apart,
    pressure_sums,
    proposed_conditions,
    told_apart,
)
from seal_friction_ros.core.identification.selection import variation_of
from seal_friction_ros.core.identification.validation import cross_validate

BAR = 1e5  # [Pa]
ROD, PISTON = SealKind('rod seals', ('a', 'a')), SealKind('piston seal', ('difference',))
PAIRS = [(5, 5), (30, 5), (60, 5), (60, 60), (30, 30), (60, 30), (5, 60), (30, 60), (5, 30)]  # [bar]
CONSTANT, VISCOUS, OFFSET = 12.0, 150.0, 7.0  # [N], [N s/m], [N]
AREAS = (4e-6, -3e-6)  # [m^2]


def rod(bar):
    """Friction of both rod seals that rises with the pressure [N]."""
    return 2.0 * 0.5 * bar**0.85


def piston(difference):
    return 1.5 * np.abs(difference)


def cylinder(
    pairs=PAIRS, noise=0.0, viscous=VISCOUS, areas=AREAS, speeds=(0.02, 0.06), kinds=(ROD, PISTON), seed=0, count=1
):
    """Strokes in both directions at each speed with each pair of pressures."""
    rows = [(a, b, side * v) for a, b in pairs for v in speeds for side in (1.0, -1.0) for _ in range(count)]
    a, b, velocity = np.array(rows).T
    friction = CONSTANT + viscous * np.abs(velocity) + rod(a) + piston(a - b)
    scatter = 1.0 + noise * np.random.default_rng(seed).normal(size=len(a))
    both = np.column_stack((a, b)) * BAR
    force = np.sign(velocity) * friction * scatter + OFFSET + both @ np.array(areas)
    chambers = [chamber for kind in kinds for chamber in kind.chambers]
    at = OperatingConditions(pressures_at_seals(chambers, *both.T), velocity, np.sign(velocity))
    zeros = np.zeros(len(a), dtype=int)
    plain = FrictionReadings(at, force, zeros, zeros, zeros, ('log',), 'pressure', False, chamber_pressures=both)
    return kinds_readings(plain, kinds)


def law_of(data):
    return law_of_all_terms(variation_of(data), data.kinds)


def checked(data, largest_error=LARGEST_KIND_ERROR):
    """The law of all kinds, fitted to readings that tell them apart, and how well."""
    check_kinds(data)
    found = fit(law_of(data), data)
    told = told_apart(found.model, data)
    check_told_apart(told, found.model, data, largest_error)
    return found, told


def right_areas(data):
    """The readings with the areas of the force sum corrected."""
    found = area_errors(data, Told(viscous=True, stribeck=True, asymmetry=True, areas=True))
    return replace(data, force=data.force + data.chamber_pressures @ np.array(found.areas)), found


@pytest.fixture(scope='module')
def exact():
    data, _ = right_areas(cylinder())
    return data, *checked(data)


def test_each_pair_of_pressures_is_a_condition_that_is_left_out_as_a_whole():
    data = cylinder()
    assert len(data.groups) == len(PAIRS)
    assert {len({*map(tuple, data.chamber_pressures[out].tolist())}) for out in data.groups} == {1}
    assert data.left_out_by == 'pressure'
    assert [columns_of(data.kinds, k) for k in range(2)] == [slice(0, 2), slice(2, 3)]
    np.testing.assert_allclose(pressure_sums(data)[:, 0], 2.0 * data.chamber_pressures[:, 0] / BAR)
    swept = replace(data, are_samples=True)
    np.testing.assert_array_equal(kinds_readings(swept, data.kinds).level, swept.level)


def test_a_cylinder_without_noise_is_found_again_with_every_part(exact):
    data, found, told = exact
    model = found.model
    assert model.exponents == pytest.approx((0.85, 1.0), abs=0.05)
    assert model.rises == pytest.approx([0.5, 1.5], rel=0.2)
    assert (model.constant, model.viscous) == pytest.approx((CONSTANT, VISCOUS), rel=0.1)
    assert found.offsets == pytest.approx([OFFSET], abs=0.1)
    assert cross_validate(found.law, data, found.values).deviation == pytest.approx(np.zeros(36), abs=1.0)
    a, b = (data.chamber_pressures / BAR).T
    parts = np.array([rod(a).mean(), piston(a - b).mean()])
    assert told.rising == pytest.approx(parts, rel=0.02)
    assert model.division == pytest.approx(parts / parts.sum(), abs=0.01)
    undivided = (CONSTANT + VISCOUS * np.abs(data.at.velocity))[:, np.newaxis] * parts / parts.sum()
    frictions = np.column_stack((rod(a), piston(a - b))) + undivided
    assert found.law.frictions(data.at, found.values) == pytest.approx(frictions, abs=0.5)
    assert told.friction == pytest.approx(frictions.mean(axis=0), abs=0.1)
    coulomb = found.law.coulomb_friction(data.at, found.values)
    assert coulomb == pytest.approx(CONSTANT + rod(a) + piston(a - b), abs=0.5)


def test_the_parameters_of_one_seal_of_each_kind_give_the_friction_of_the_model(exact):
    data, found, _ = exact
    assert found.friction(data.at) == pytest.approx(found.model.friction(data.at), rel=1e-9)


def test_errors_of_the_areas_are_found_and_only_such_as_are_there():
    data, found = right_areas(cylinder())
    assert found.is_significant
    assert found.areas == pytest.approx([-area for area in AREAS], rel=0.05)
    assert data.force == pytest.approx(cylinder(areas=(0.0, 0.0)).force, abs=1.5)
    assert not right_areas(cylinder(noise=0.01, areas=(0.0, 0.0)))[1].is_significant


def test_friction_that_no_pressure_divides_is_divided_with_its_standard_deviation(exact):
    _, found, told = exact
    share = found.model.division
    undivided = CONSTANT + VISCOUS * 0.04
    assert told.division_std == pytest.approx(undivided * np.sqrt(share * (1.0 - share) / 3.0), rel=0.05)
    assert told.apart_std == pytest.approx(np.hypot(found.model.errors, told.division_std))
    vector = found.model.vector.copy()
    vector[1:3] = 0.0
    flat = replace(found.model, vector=vector)
    assert flat.division == pytest.approx([2.0 / 3.0, 1.0 / 3.0])  # without any rise each seal has the same


def test_terms_that_are_not_there_are_small():
    found = checked(cylinder(noise=0.01, viscous=0.0, areas=(0.0, 0.0)))[0].model
    assert found.viscous * 0.06 < 0.02 * found.size
    assert found.stribeck[0] < 0.05 * found.size
    assert abs(found.asymmetry) < 0.02


def test_standard_errors_hold_what_the_parts_are_off_by():
    truth = np.array([rod(np.array(PAIRS)[:, 0]).mean(), piston(np.ptp(PAIRS, axis=1)).mean()])
    off = []
    for seed in range(20):
        model = checked(cylinder(noise=0.03, count=3, seed=seed, areas=(0.0, 0.0)), 9.0)[0].model
        off.append((model.parts - truth) / model.errors)
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_the_terms_of_one_seal_scatter_by_their_standard_errors():
    """Also the friction that no pressure divides, since its division follows from the rises.

    At four speeds: two tell no viscous friction from Stribeck friction, which is in the standard errors.
    """
    names = ('friction_at_no_pressure', 'friction_at_one_bar', 'pressure_exponent', 'viscous_friction')
    found, errors = [], []
    for seed in range(20):
        data = cylinder(noise=0.03, count=3, seed=seed, areas=(0.0, 0.0), speeds=(0.01, 0.02, 0.04, 0.08))
        law = law_of(data)

        def of_one_seal(values, law=law):
            return np.ravel([[of_kind[name] for name in names] for of_kind in law.of_one_seal(values)])

        each = fit(law, data)
        found.append(of_one_seal(each.values))
        errors.append(np.sqrt(np.diag(covariance_of_terms(each, 3, of_one_seal))))
    ratio = np.sqrt(np.mean(np.square(errors), axis=0)) / np.std(found, axis=0, ddof=1)
    assert ratio.min() > 0.7
    assert ratio.max() < 3.0


def test_the_left_out_condition_is_predicted_by_the_others():
    data = cylinder(noise=0.03, count=3, areas=(0.0, 0.0))
    out = data.groups[2]
    force = data.force.copy()
    force[out] += data.at.direction[out] * 40.0
    wild = replace(data, force=force)
    calm, moved = (cross_validate(law_of(one), one, {}) for one in (data, wild))
    more = [(moved.deviation - calm.deviation)[group].mean() for group in data.groups]
    assert np.argmax(more) == 2
    assert more[2] > 20.0
    measured = moved.predicted + moved.deviation
    assert measured[out] == pytest.approx(data.at.direction[out] * (force[out] - OFFSET), rel=0.2)


def test_multiple_correlation_is_that_of_a_regression_on_the_other_kinds():
    third = SealKind('other rod seal', ('b',))
    data = cylinder(kinds=(ROD, PISTON, third))
    pressures = pressure_sums(data)
    for k, found in enumerate(moved_together(data)):
        others = np.column_stack((np.delete(pressures, k, axis=1), np.ones(len(pressures))))
        left = pressures[:, k] - others @ np.linalg.lstsq(others, pressures[:, k], rcond=None)[0]
        assert found**2 == pytest.approx(1.0 - left.var() / pressures[:, k].var(), abs=1e-9)
    both = cylinder()
    a, difference = pressure_sums(both).T
    assert moved_together(both) == pytest.approx([abs(np.corrcoef(a, difference)[0, 1])] * 2)
    assert moved_together(cylinder([(30, 5), (30, 60), (30, 30)])) == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize(
    ('pairs', 'kinds', 'reason'),
    [
        (
            [(5, 0), (30, 0), (60, 0)],
            (ROD, PISTON),
            'rod seals and piston seal cannot be told apart: .*correlation \\+1',
        ),
        ([(30, 5), (30, 30), (30, 60)], (ROD, PISTON), 'rod seals saw 30 to 30 bar only'),
        (PAIRS, (ROD, SealKind('wiper', ('ambient',))), 'wiper sees no pressure'),
    ],
)
def test_kinds_that_the_pressures_do_not_tell_apart_are_refused_with_what_to_measure(pairs, kinds, reason):
    with pytest.raises(ValueError, match=f'^log: {reason}'):
        check_kinds(cylinder(pairs, kinds=kinds, areas=(0.0, 0.0)))


@pytest.mark.parametrize(('low', 'told'), [(54.5, False), (53.5, True)])
def test_a_kind_has_to_see_a_tenth_of_its_highest_pressure_more_than_its_lowest(low, told):
    pairs = [(low, 5), (60, 60), (low, 60), (60, 30), (low, 30), (60, 5)]
    if told:
        check_kinds(cylinder(pairs, areas=(0.0, 0.0), viscous=0.0))
    else:
        with pytest.raises(ValueError, match=r'rod seals saw 54.5 to 60 bar only'):
            check_kinds(cylinder(pairs))


@pytest.mark.parametrize(('asymmetry', 'area'), [(0.12, 0.0), (0.0, 4e-6), (0.0, 0.0)])
def test_an_asymmetry_is_no_error_of_an_area(asymmetry, area):
    """Friction that is larger one way grows with the pressure, as the offset by a wrong area does."""
    plain = cylinder(noise=0.005, areas=(area, 0.0), count=2)
    uneven = (1.0 + asymmetry * plain.at.direction) * (plain.force - OFFSET - area * plain.chamber_pressures[:, 0])
    data = replace(plain, force=uneven + OFFSET + area * plain.chamber_pressures[:, 0])
    found = area_errors(data, Told(viscous=True, stribeck=True, asymmetry=True, areas=True))
    assert found.is_significant is (area > 0.0)
    assert found.areas == pytest.approx((-area, 0.0), abs=0.2 * area)


def test_friction_lost_in_the_noise_is_refused_unless_its_error_is_accepted():
    data = cylinder(noise=0.25, seed=1)
    with pytest.raises(
        ValueError, match=r'cannot be told from that of the others: .* --largest-kind-error 0\.\d\d'
    ) as no:
        checked(data)
    accepted = float(str(no.value).rpartition(' ')[2])
    found, told = checked(data, accepted)
    poor = poorly_told_apart(told, data.kinds)
    assert poor
    means = found.law.frictions(data.at, found.values).mean(axis=0)
    for name, friction, error in poor:
        k = [kind.name for kind in data.kinds].index(name)
        assert friction == pytest.approx(means[k])
        assert error == pytest.approx(found.model.errors[k])
        assert error > 0.1 * friction
        assert error > 0.05 * means.sum()
        assert accepted - 0.05 <= error / friction <= accepted or len(poor) > 1


def test_proposed_pressures_part_the_kinds():
    together = cylinder([(5, 0), (30, 0), (60, 0)])
    conditions, largest = proposed_conditions(together)
    assert largest <= 0.5
    assert 1 <= len(conditions) <= 4
    assert {pressure / 60e5 for pair in conditions for pressure in pair} <= {0.0, 0.5, 1.0}
    assert advice(together).startswith('drive both directions also with chambers a and b at ')
    apart = cylinder()
    assert moved_together(apart).max() < 0.5
    assert proposed_conditions(apart) == ((), moved_together(apart).max())
    assert advice(apart) == 'measure more strokes at each pair of pressures, in both directions'


def test_where_the_friction_is_known_least_is_proposed_first(exact):
    data, found, _ = exact
    model = found.model
    covariance = np.zeros_like(model.covariance)
    covariance[2, 2] = 0.25  # of the piston seal
    ((_, _, bend), *_) = model.averaged

    def known_by(posterior):
        return replace(
            model, averaged=((1.0, model.chosen._replace(covariance=posterior), bend._replace(variance=0.0)),)
        )

    unsure = known_by(covariance)
    conditions, _ = proposed_conditions(data, unsure)
    # Beside no friction of the rod seals that of the piston seal is the largest share.
    assert [(pair.a / 1e5, pair.b / 1e5) for pair in conditions] == [(0, 60), (0, 30), (60, 0), (30, 0)]
    text = advice(data, unsure)
    assert text == 'drive both directions also with chambers a and b at 0 and 60, 0 and 30, 60 and 0, 30 and 0 bar'
    sure = known_by(0.001 * covariance)
    assert proposed_conditions(data, sure)[0] == ()


# --- parts of the fit ---


def other_source(data, offset):
    """The same strokes of a second log with another offset [N]."""
    at = data.at._replace(pressure=np.tile(data.at.pressure, (2, 1)), velocity=np.tile(data.at.velocity, 2),
                          direction=np.tile(data.at.direction, 2))  # fmt: skip
    force = np.concatenate((data.force, data.force + offset - OFFSET))
    source = np.repeat([0, 1], data.count)
    both = np.tile(data.chamber_pressures, (2, 1))
    level = np.tile(data.level, 2)
    return replace(
        data, at=at, force=force, source=source, group=source, level=level, names=('a', 'b'), chamber_pressures=both
    )


def test_each_log_has_its_own_offset_also_if_it_was_left_out():
    data = other_source(cylinder(areas=(0.0, 0.0)), -30.0)
    found, _ = checked(data)
    assert found.offsets == pytest.approx([OFFSET, -30.0], abs=0.2)
    assert cross_validate(found.law, data, {}).deviation == pytest.approx(np.zeros(72), abs=0.3)
    # A log in one direction has none: its offset of -30 N is friction of it.
    one_way = data.taken((data.source == 0) | (data.at.direction > 0.0))
    assert checked(one_way, 9.0)[0].offsets[1] == 0.0


def test_held_pressures_of_both_directions_of_a_log_are_one_condition():
    """A regulator holds 30 bar on extension and 31 bar on retraction; in another log 40 and 30 bar are two."""
    plain = cylinder([(30, 5), (60, 5), (60, 60)])
    chambers = cylinder([(30, 5), (60, 5), (60, 60)]).chamber_pressures.copy()
    off = (chambers[:, 0] == 30e5) & (plain.at.direction < 0.0)
    chambers[off, 0] = 31e5
    pressure = pressures_at_seals(('a', 'a', 'difference'), *chambers.T)
    data = kinds_readings(replace(plain, at=plain.at._replace(pressure=pressure)), (ROD, PISTON))
    assert len(data.levels) == 3
    chambers[off, 0] = 40e5
    pressure = pressures_at_seals(('a', 'a', 'difference'), *chambers.T)
    data = kinds_readings(replace(plain, at=plain.at._replace(pressure=pressure)), (ROD, PISTON))
    assert len(data.levels) == 4


@pytest.mark.parametrize(('share', 'poor'), [(0.099, False), (0.101, True)])
def test_a_kind_is_poorly_told_apart_beyond_a_tenth_of_it_and_a_twentieth_of_all(exact, share, poor):
    data, _, told = exact
    means = told.friction
    assert means[1] > 0.5 * means.sum()  # the piston seal

    def poorly(*errors, most=LARGEST_KIND_ERROR):
        return poorly_told_apart(told._replace(errors=np.array(errors)), data.kinds, most)

    found = poorly(0.0, share * means[1])
    assert found == ([('piston seal', pytest.approx(means[1]), pytest.approx(share * means[1]))] if poor else [])
    for of_all, counts in ((0.049, 0), (0.051, 1)):
        small = of_all * means.sum()
        assert small > 0.1 * means[0]
        assert len(poorly(small, 0.0)) == counts
        assert poorly(small, 0.0, most=0.9) == []


def test_a_pressure_is_held_if_it_changes_by_less_than_a_fiftieth_of_the_highest():
    x, z = np.array([-1.0, -1.0, 1.0, 1.0]), np.array([-1.0, 1.0, -1.0, 1.0])
    for std, held in ((0.0199, True), (0.0206, False)):  # of the highest, which is 1 + std
        pressures = np.column_stack((1.0 + std * x, 1.0 + 0.5 * z))
        assert (_multiple_correlation(pressures) == 1.0).all() == held
    skew = np.column_stack((10.0 + x, 10.0 + 0.6 * x + 0.8 * z))
    assert _multiple_correlation(skew) == pytest.approx([0.6, 0.6])
    assert _multiple_correlation(np.column_stack((10.0 + x, 10.0 + z))) == pytest.approx([0.0, 0.0], abs=1e-6)


def test_the_first_condition_is_that_which_parts_the_kinds_most():
    """Twelve readings with b at 0 bar: a condition weighs as much as three of them."""
    data = cylinder([(5, 0), (30, 0), (60, 0)])
    conditions, largest = proposed_conditions(data)
    grid = [(a, b) for a in (0.0, 30.0, 60.0) for b in (0.0, 30.0, 60.0)]
    rows = [(2.0 * a, abs(a - b)) for a, b in (data.chamber_pressures / BAR).tolist()]

    def correlation(chosen):
        more = [(2.0 * a, abs(a - b)) for a, b in chosen for _ in range(3)]
        return abs(np.corrcoef(np.array(rows + more).T)[0, 1])

    expected = []
    while correlation(expected) > 0.5:
        expected.append(min((p for p in grid if p not in expected), key=lambda p: correlation([*expected, p])))
    assert np.array(conditions) / BAR == pytest.approx(np.array(expected))
    assert largest == pytest.approx(correlation(expected))
