"""Several kinds of seals in one cylinder: told apart where their pressures varied by themselves, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from seal_friction_ros.core.friction.mounting import pressures_at_seals
from seal_friction_ros.core.identification.candidate_laws import OperatingConditions
from seal_friction_ros.core.identification.readings import FrictionReadings
from seal_friction_ros.core.identification.several_kinds import (
    KindsRung,
    SealKind,
    _rivals,
    _rows,
    advice,
    fit_kinds,
    kinds_readings,
    moved_together,
    poorly_told_apart,
    proposed_conditions,
)

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
    at = OperatingConditions(pressures_at_seals(chambers, *both.T), None, velocity, np.sign(velocity))
    zeros = np.zeros(len(a), dtype=int)
    plain = FrictionReadings(at, force, zeros, zeros, zeros, ('log',), 'pressure', are_samples=False)
    return kinds_readings(plain, both, kinds)


@pytest.fixture(scope='module')
def exact():
    return fit_kinds(cylinder())


def test_each_pair_of_pressures_is_a_condition_that_is_left_out_as_a_whole():
    data = cylinder()
    assert len(data.readings.groups) == len(PAIRS)
    assert {len({*map(tuple, data.chamber_pressures[out].tolist())}) for out in data.readings.groups} == {1}
    assert data.readings.left_out_by == 'pressure'
    assert (data.columns_of(0), data.columns_of(1)) == (slice(0, 2), slice(2, 3))
    np.testing.assert_allclose(data.power_sum(0, 0.85), 2.0 * (data.chamber_pressures[:, 0] / BAR) ** 0.85)
    swept = replace(data.readings, are_samples=True)
    assert kinds_readings(swept, data.chamber_pressures, data.kinds).readings is swept


def test_a_cylinder_without_noise_is_found_again_with_every_part(exact):
    found = exact.fit
    assert found.rung == ((0.85, 1.0), True, True)
    assert found.rises == pytest.approx([0.5, 1.5])
    assert (found.constant, found.viscous) == pytest.approx((CONSTANT, VISCOUS))
    assert found.offsets == pytest.approx([OFFSET])
    assert found.areas == pytest.approx(AREAS)
    assert exact.deviation == pytest.approx(np.zeros(36), abs=1e-6)
    a, b = (found.data.chamber_pressures / BAR).T
    speed = np.abs(found.data.readings.at.velocity)
    assert exact.predicted == pytest.approx(CONSTANT + VISCOUS * speed + rod(a) + piston(a - b))
    parts = np.array([rod(a).mean(), piston(a - b).mean()])
    assert found.parts == pytest.approx(parts)
    assert found.division == pytest.approx(parts / parts.sum())
    undivided = (CONSTANT + VISCOUS * speed)[:, np.newaxis] * parts / parts.sum()
    assert found.frictions(found.data.readings.at) == pytest.approx(
        np.column_stack((rod(a), piston(a - b))) + undivided
    )
    assert found.coulomb_friction(found.data.readings.at) == pytest.approx(CONSTANT + rod(a) + piston(a - b))
    corrected = found.corrected_readings()
    assert corrected.force == pytest.approx(found.data.readings.force - found.data.chamber_pressures @ AREAS)


def test_what_no_pressure_divides_is_divided_with_its_standard_deviation(exact):
    share = exact.fit.division
    undivided = CONSTANT + VISCOUS * 0.04
    assert exact.division_std == pytest.approx(undivided * np.sqrt(share * (1.0 - share) / 3.0))
    assert exact.apart_std == pytest.approx(np.sqrt(exact.errors**2 + exact.spread**2 + exact.division_std**2))
    flat = replace(exact.fit, rises=np.zeros(2))
    assert flat.division == pytest.approx([2.0 / 3.0, 1.0 / 3.0])  # without any rise each seal has the same


def test_terms_that_are_not_there_are_not_taken():
    found = fit_kinds(cylinder(noise=0.01, viscous=0.0, areas=(0.0, 0.0))).fit
    assert (found.rung.viscous, found.rung.areas) == (False, False)
    assert (found.viscous, found.areas.tolist()) == (0.0, [0.0, 0.0])
    assert found.rung.parameters == 3
    assert found.rung._replace(viscous=True, areas=True).parameters == 6
    assert found.parts == pytest.approx(found.parts, rel=0.05)


def test_standard_errors_are_the_larger_of_those_of_least_squares_and_of_the_jackknife():
    data = cylinder(noise=0.03, count=3)
    result = fit_kinds(data)
    found, readings = result.fit, data.readings
    powers = [data.power_sum(k, m) for k, m in enumerate(found.rung.exponents)]
    friction = [*powers, np.ones(readings.count), *([np.abs(readings.at.velocity)] if found.rung.viscous else [])]
    free = [*(data.chamber_pressures.T if found.rung.areas else ()), np.ones(readings.count)]
    design = np.column_stack([*(readings.at.direction * column for column in friction), *free])
    design = design / readings.scale[:, np.newaxis]
    measured = readings.force / readings.scale
    values = np.linalg.lstsq(design, measured, rcond=None)[0]
    assert found.rises == pytest.approx(values[:2], rel=1e-4)
    left = measured - design @ values
    covariance = np.linalg.inv(design.T @ design) * (left @ left) / (readings.count - design.shape[1])
    without = np.array([np.linalg.lstsq(design[~out], measured[~out], rcond=None)[0][:2] for out in readings.groups])
    groups = len(without)
    grouped = np.sqrt((groups - 1) / groups * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
    sizes = np.array([power.mean() for power in powers])
    expected = np.maximum(np.sqrt(np.diag(covariance)[:2]), grouped) * sizes
    assert result.errors == pytest.approx(expected, rel=1e-3)
    std = np.sqrt(np.diag(covariance)[:2])
    assert result.correlation == pytest.approx(covariance[:2, :2] / np.outer(std, std), rel=1e-3)
    assert sum(weight for weight, _ in result.rivals) == pytest.approx(1.0, abs=0.02)
    assert result.tried == 4 * 81


def test_the_left_out_condition_is_predicted_by_the_others():
    data = cylinder(noise=0.03, count=3)
    out = data.readings.groups[2]
    force = data.readings.force.copy()
    force[out] += data.readings.at.direction[out] * 40.0
    wild = replace(data, readings=replace(data.readings, force=force))
    calm, moved = fit_kinds(data), fit_kinds(wild, 1.0)
    more = [(moved.deviation - calm.deviation)[group].mean() for group in data.readings.groups]
    assert np.argmax(more) == 2
    assert more[2] > 20.0
    measured = moved.predicted + moved.deviation
    assert measured[out] == pytest.approx(data.readings.at.direction[out] * (force[out] - OFFSET), rel=0.2)


def test_multiple_correlation_is_that_of_a_regression_on_the_other_kinds():
    third = SealKind('other rod seal', ('b',))
    data = cylinder(kinds=(ROD, PISTON, third))
    pressures = np.column_stack([data.power_sum(k, 1.0) for k in range(3)])
    for k, found in enumerate(moved_together(data)):
        others = np.column_stack((np.delete(pressures, k, axis=1), np.ones(len(pressures))))
        left = pressures[:, k] - others @ np.linalg.lstsq(others, pressures[:, k], rcond=None)[0]
        assert found**2 == pytest.approx(1.0 - left.var() / pressures[:, k].var(), abs=1e-9)
    both = cylinder()
    a, difference = (both.power_sum(k, 1.0) for k in range(2))
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
        (
            [(5, 0), (20, 0), (40, 0), (60, 0), (60, 60)],
            (ROD, PISTON),
            'only the readings with chambers a and b at 60 and 60',
        ),
    ],
)
def test_kinds_that_the_pressures_do_not_tell_apart_are_refused_with_what_to_measure(pairs, kinds, reason):
    with pytest.raises(ValueError, match=f'^log: {reason}'):
        fit_kinds(cylinder(pairs, kinds=kinds, areas=(0.0, 0.0)))


@pytest.mark.parametrize(('low', 'told'), [(54.5, False), (53.5, True)])
def test_a_kind_has_to_see_a_tenth_of_its_highest_pressure_more_than_its_lowest(low, told):
    pairs = [(low, 5), (60, 60), (low, 60), (60, 30), (low, 30), (60, 5)]
    if told:
        fit_kinds(cylinder(pairs, areas=(0.0, 0.0), viscous=0.0), 9.0)
    else:
        with pytest.raises(ValueError, match=r'rod seals saw 54.5 to 60 bar only'):
            fit_kinds(cylinder(pairs))


def test_friction_lost_in_the_noise_is_refused_unless_its_error_is_accepted():
    data = cylinder(noise=0.25)
    with pytest.raises(
        ValueError, match=r'cannot be told from that of the others: .* --largest-kind-error 0\.\d\d'
    ) as no:
        fit_kinds(data)
    accepted = float(str(no.value).rpartition(' ')[2])
    found = fit_kinds(data, accepted)
    poor = poorly_told_apart(found)
    assert poor
    means = found.fit.frictions(data.readings.at).mean(axis=0)
    for name, friction, error in poor:
        k = [kind.name for kind in data.kinds].index(name)
        assert friction == pytest.approx(means[k])
        assert error == pytest.approx(np.hypot(found.errors[k], found.spread[k]))
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


def test_where_the_laws_disagree_is_proposed_with_the_largest_disagreement_first(exact):
    data = exact.fit.data
    steeper = replace(exact.fit, rises=np.array([0.5, 2.0]))
    conditions, _ = proposed_conditions(data, ((0.5, exact.fit), (0.5, steeper)))
    # Beside no friction of the rod seals that of the piston seal is the largest share.
    assert [(pair.a / 1e5, pair.b / 1e5) for pair in conditions] == [(0, 60), (0, 30), (60, 0), (30, 0)]
    slightly = replace(exact.fit, rises=np.array([0.5, 1.51]))
    assert proposed_conditions(data, ((0.5, exact.fit), (0.5, slightly)))[0] == ()


def test_what_is_tried_follows_what_was_varied():
    """81 pairs of exponents, without and with areas, and viscous friction where the speed varied."""

    def tried(**changes):
        return fit_kinds(cylinder(**changes), 1e9).tried

    assert tried() == 4 * 9**2
    assert tried(speeds=(0.02, 0.029)) == 2 * 9**2
    assert tried(speeds=(0.02, 0.031)) == 4 * 9**2
    assert tried(kinds=(ROD, PISTON, SealKind('other rod seal', ('b',)))) == 4 * 4**3


# --- parts of the fit ---


def other_source(data, offset):
    """The same strokes of a second log with another offset [N]."""
    r = data.readings
    at = r.at._replace(pressure=np.tile(r.at.pressure, (2, 1)), velocity=np.tile(r.at.velocity, 2),
                       direction=np.tile(r.at.direction, 2))  # fmt: skip
    force = np.concatenate((r.force, r.force + offset - OFFSET))
    source = np.repeat([0, 1], r.count)
    joined = replace(r, at=at, force=force, source=source, group=source, level=np.tile(r.level, 2), names=('a', 'b'))
    return replace(data, readings=joined, chamber_pressures=np.tile(data.chamber_pressures, (2, 1)))


RUNG = KindsRung((0.85, 1.0), viscous=True, areas=True)


def test_each_log_has_its_own_offset_also_if_it_was_left_out():
    data = other_source(cylinder(), -30.0)
    result = fit_kinds(data)
    found = result.fit
    assert found.rung == RUNG
    assert found.offsets == pytest.approx([OFFSET, -30.0])
    assert found.rises == pytest.approx([0.5, 1.5])
    assert found.areas == pytest.approx(AREAS)
    assert result.deviation == pytest.approx(np.zeros(72), abs=1e-5)
    assert result.predicted == pytest.approx(found.frictions(data.readings.at).sum(axis=1))
    # A log in one direction has none: its offset of -30 N is friction of it.
    forward = (data.readings.source == 0) | (data.readings.at.direction > 0.0)
    one_way = replace(data, readings=data.readings.taken(forward), chamber_pressures=data.chamber_pressures[forward])
    result = fit_kinds(one_way, 1e9)
    assert result.fit.offsets[1] == 0.0
    assert result.deviation[one_way.readings.source == 1].mean() == pytest.approx(-30.0, rel=0.15)


def test_held_pressures_of_both_directions_of_a_log_are_one_condition():
    """A regulator holds 30 bar on extension and 31 bar on retraction; in another log 40 and 30 bar are two."""
    plain = cylinder([(30, 5), (60, 5), (60, 60)]).readings
    chambers = cylinder([(30, 5), (60, 5), (60, 60)]).chamber_pressures.copy()
    off = (chambers[:, 0] == 30e5) & (plain.at.direction < 0.0)
    chambers[off, 0] = 31e5
    pressure = pressures_at_seals(('a', 'a', 'difference'), *chambers.T)
    data = kinds_readings(replace(plain, at=plain.at._replace(pressure=pressure)), chambers, (ROD, PISTON))
    assert len(data.readings.levels) == 3
    chambers[off, 0] = 40e5
    pressure = pressures_at_seals(('a', 'a', 'difference'), *chambers.T)
    data = kinds_readings(replace(plain, at=plain.at._replace(pressure=pressure)), chambers, (ROD, PISTON))
    assert len(data.readings.levels) == 4


def test_a_rival_weighs_as_much_as_its_loss_is_likely():
    """Nine conditions: a loss of 1.2 times the least has the likelihood 1.2^-9, one of 4 times none."""
    data = cylinder()
    rows = _rows(data)
    left = [(RUNG, np.full(9, 2.0)), (RUNG._replace(viscous=False), np.full(9, 2.4)), (RUNG, np.full(9, 8.0))]
    found = _rivals(data, rows, rows.matrix.T @ rows.matrix, left)
    total = 1.0 + 1.2**-9 + 4.0**-9
    assert [weight for weight, _ in found] == pytest.approx([1.0 / total, 1.2**-9 / total])
    assert [fit.rung.viscous for _, fit in found] == [True, False]
    assert found[1][1].viscous == 0.0


def test_the_spread_of_a_kind_is_that_of_its_rivals_by_their_weight(exact):
    steeper = replace(exact.fit, rises=np.array([0.5, 3.0]))
    found = replace(exact, rivals=((0.75, exact.fit), (0.25, steeper)))
    at = exact.fit.data.readings.at
    off = steeper.frictions(at).mean(axis=0) - exact.fit.frictions(at).mean(axis=0)
    assert found.spread == pytest.approx(np.abs(off) * 0.5)


@pytest.mark.parametrize(('share', 'poor'), [(0.099, False), (0.101, True)])
def test_a_kind_is_poorly_told_apart_beyond_a_tenth_of_it_and_a_twentieth_of_all(exact, share, poor):
    means = exact.fit.frictions(exact.fit.data.readings.at).mean(axis=0)
    assert means[1] > 0.5 * means.sum()  # the piston seal
    errors = np.array([0.0, share * means[1]])
    certain = replace(exact, rivals=())
    found = poorly_told_apart(replace(certain, errors=errors))
    assert found == ([('piston seal', pytest.approx(means[1]), pytest.approx(errors[1]))] if poor else [])
    for of_all, counts in ((0.049, 0), (0.051, 1)):
        small = np.array([of_all * means.sum(), 0.0])
        assert small[0] > 0.1 * means[0]
        assert len(poorly_told_apart(replace(certain, errors=small))) == counts
        assert poorly_told_apart(replace(certain, errors=small), 0.9) == []


def test_a_pressure_is_held_if_it_changes_by_less_than_a_fiftieth_of_the_highest():
    x, z = np.array([-1.0, -1.0, 1.0, 1.0]), np.array([-1.0, 1.0, -1.0, 1.0])
    for std, held in ((0.0199, True), (0.0206, False)):  # of the highest, which is 1 + std
        assert (moved_together(at_pressures(1.0 + std * x, 1.0 + 0.5 * z)) == 1.0).all() == held
    assert moved_together(at_pressures(10.0 + x, 10.0 + 0.6 * x + 0.8 * z)) == pytest.approx([0.6, 0.6])
    assert moved_together(at_pressures(10.0 + x, 10.0 + z)) == pytest.approx([0.0, 0.0], abs=1e-6)


def at_pressures(a, b):
    """Four strokes with these pressures [bar] at one seal in each chamber."""
    data = cylinder([(1, 1)], speeds=(0.02, 0.06), kinds=(SealKind('one', ('a',)), SealKind('other', ('b',))))
    at = data.readings.at._replace(pressure=np.column_stack((a, b)) * BAR)
    return replace(data, readings=replace(data.readings, at=at))


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


def test_advice_names_the_pressures_of_both_chambers(exact):
    steeper = replace(exact.fit, rises=np.array([0.5, 2.0]))
    text = advice(exact.fit.data, ((0.5, exact.fit), (0.5, steeper)))
    pairs = '0 and 60, 0 and 30, 60 and 0, 30 and 0'
    assert text == f'drive both directions also with chambers a and b at {pairs} bar'


@pytest.mark.parametrize(('off', 'noticed'), [(0.0199, False), (0.0201, True)])
def test_laws_disagree_from_a_fiftieth_on(exact, off, noticed):
    """Two laws of equal weight, each as much off their middle of 100 N at every pressure."""
    flat = replace(exact.fit, rises=np.zeros(2), viscous=0.0)
    rivals = tuple((0.5, replace(flat, constant=100.0 * (1.0 + side * off))) for side in (1.0, -1.0))
    conditions, _ = proposed_conditions(exact.fit.data, rivals)
    assert len(conditions) == (4 if noticed else 0)
