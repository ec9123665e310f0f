"""The elastic seal: limits, closed forms, nested loops, energy, no drift."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seal_friction_ros.core.foundation.compiled import compiled
from seal_friction_ros.core.friction.laws.friction_map import FrictionMap
from seal_friction_ros.core.friction.presliding import (
    NO_ELEMENTS,
    NOT_SHEARED,
    RIGID,
    SLOTS,
    Elements,
    LuGreNumbers,
    Presliding,
    PreslidingNumbers,
    Shear,
    Slide,
    element_forces,
    lugre,
    presliding_numbers,
    presliding_of_map,
    shear,
    stored_energy,
)
from seal_friction_ros.core.friction.states import (
    BREAKAWAY,
    SLIDING,
    STUCK,
    FrictionState,
    StateFriction,
    sign,
    state_friction,
)
from test.harness.masing import initial_loading

FRICTION = 20.0  # [N]
SEAL = Presliding(stiffness=1e5, yield_exponent=1.5)
ONE = presliding_numbers([SEAL])
preslidings = st.builds(
    Presliding,
    stiffness=st.floats(1e3, 1e7),
    elements=st.integers(1, SLOTS),
    yield_exponent=st.floats(0.0, 5.0),
)


def friction_over(numbers, positions, friction=FRICTION):
    """Friction force at each position of a rod that begins unsheared at 0 [N]."""
    forces, last, out = NO_ELEMENTS, 0.0, []
    for position in positions:
        forces, force = element_forces(numbers, forces, position - last, friction)
        last = position
        out.append(force)
    return np.array(out)


def yield_displacement(numbers, friction=FRICTION):
    """Displacement at which the last element yields [m]."""
    return numbers.shares.last * friction / numbers.stiffnesses.last


def acting_friction(
    numbers: PreslidingNumbers,
    state: Shear,
    force: float,
    slide: Slide,
    at_rest: bool,
    velocity: float,
    force_sum: float,
) -> StateFriction:
    """Friction that acts on the rod and its state, after `shear` made ``state`` and ``force`` [N] of ``slide``.

    Sliding or breakaway where every element yields, stuck below. Rigid seals have the six states of `state_friction`,
    with its arguments.
    """
    if math.isinf(numbers.stiffness):
        coulomb = slide.coulomb_friction
        return state_friction(velocity, force_sum, at_rest, coulomb + slide.sliding_excess, coulomb + slide.stiction)
    direction = sign(force)
    if abs(force) < slide.coulomb_friction + state.excess:
        return StateFriction(STUCK, direction, force)
    return StateFriction(BREAKAWAY if at_rest else SLIDING, direction, force)


class TestLimits:
    @given(
        velocities=st.lists(st.sampled_from([0.0, 1e-3, -1e-3, 0.2, -0.2]), min_size=1, max_size=20),
        stiction=st.sampled_from([0.0, 3.0]),
        excess=st.sampled_from([0.0, 1.7]),
    )
    def test_a_rigid_seal_slides_at_its_friction_and_at_rest_keeps_what_its_breakaway_holds(
        self, velocities, stiction, excess
    ):
        state, expected = NOT_SHEARED, 0.0
        for velocity in velocities:
            slide = Slide(velocity * 1e-3, 1e-3, FRICTION, excess, stiction)
            state, force = shear(RIGID, state, slide)
            held = min(max(expected, -FRICTION - stiction), FRICTION + stiction)
            expected = math.copysign(FRICTION + excess, velocity) if velocity else held
            assert force == expected

    def test_the_stiffer_the_seal_the_closer_to_the_rigid_one(self):
        positions = 1e-3 * np.sin(np.linspace(0.0, 12.0, 400))
        rigid = friction_over(RIGID, positions)
        misses = []
        for stiffness in (1e6, 1e7, 1e8, 1e9):
            elastic = friction_over(presliding_numbers([replace(SEAL, stiffness=stiffness)]), positions)
            misses.append(np.mean(np.abs(elastic - rigid)))
        assert all(b < 0.5 * a for a, b in itertools.pairwise(misses) if a > 0.0)
        assert misses[-1] == 0.0

    def test_states_of_an_elastic_seal_are_stuck_until_every_element_yields(self):
        state, far = NOT_SHEARED, yield_displacement(ONE)
        seen = []
        for displacement, velocity in ((0.5 * far, 0.1), (0.6 * far, 0.1), (0.0, 0.0), (-0.1 * far, -0.1)):
            slide = Slide(displacement, 1e-3, FRICTION, 0.0, 0.0)
            state, force = shear(ONE, state, slide)
            seen.append(acting_friction(ONE, state, force, slide, velocity == 0.0, velocity, 0.0))
        states = [FrictionState(acting.state).name for acting in seen]
        assert states == ['STUCK', 'SLIDING', 'BREAKAWAY', 'STUCK']
        assert [acting.direction for acting in seen] == [1, 1, 1, 1]  # the spring still pushes back after a reversal


class TestClosedForm:
    def test_equal_yields_are_one_spring_and_one_slider(self):
        numbers = presliding_numbers([Presliding(stiffness=1e5, yield_exponent=0.0)])
        x = np.linspace(0.0, 4e-4, 41)
        np.testing.assert_allclose(friction_over(numbers, x), np.minimum(1e5 * x, FRICTION), rtol=1e-12)

    @given(preslidings)
    def test_stiffness_after_a_reversal_is_the_total_one_and_friction_ends_at_the_sliding_friction(self, seal):
        numbers = presliding_numbers([seal])
        smallest = min(w / k for w, k in zip(numbers.shares, numbers.stiffnesses, strict=True) if k) * FRICTION
        first = initial_loading(numbers, 0.5 * smallest, FRICTION)
        assert first == pytest.approx(seal.stiffness * 0.5 * smallest, rel=1e-12)
        assert initial_loading(numbers, 1.001 * yield_displacement(numbers), FRICTION) == FRICTION

    def test_exponent_1_is_a_parabola_to_the_width_of_an_element(self):
        numbers = presliding_numbers([Presliding(stiffness=1e5, yield_exponent=1.0)])
        end = 2.0 * FRICTION / 1e5  # K integral of (1 - x/end) from 0 to end is the friction
        x = np.linspace(0.0, end, 101)
        parabola = 1e5 * x * (1.0 - x / (2.0 * end))
        assert np.max(np.abs(friction_over(numbers, x) - parabola)) < FRICTION / SLOTS**2

    def test_seals_add_up(self):
        two = presliding_numbers([SEAL, SEAL])
        x = 1e-3 * np.sin(np.linspace(0.0, 9.0, 300))
        np.testing.assert_allclose(friction_over(two, x, 2.0 * FRICTION), 2.0 * friction_over(ONE, x), atol=1e-12)
        unlike = presliding_numbers([SEAL, Presliding(stiffness=4e5, elements=3, yield_exponent=0.3)])
        assert math.fsum(unlike.stiffnesses) == pytest.approx(5e5, rel=1e-14)
        assert math.fsum(unlike.shares) == pytest.approx(1.0, rel=1e-14)

    def test_friction_follows_a_change_of_speed_over_the_memory_length(self):
        numbers = presliding_numbers([replace(SEAL, memory_length=1e-4)])
        state, _ = shear(numbers, NOT_SHEARED, Slide(0.01, 0.1, FRICTION, 6.0, 0.0))
        for _ in range(100):
            state, _ = shear(numbers, state, Slide(1e-3, 0.1, FRICTION, 6.0, 0.0))
        assert state.excess == pytest.approx(6.0, rel=1e-12)
        passed = 0.0
        for _ in range(20):
            state, force = shear(numbers, state, Slide(2e-5, 1e-3, FRICTION, 1.0, 0.0))
            passed += 2e-5
            assert force - FRICTION == pytest.approx(1.0 + 5.0 * math.exp(-passed / 1e-4), rel=1e-9)

    def test_stiction_grows_with_the_dwell(self):
        numbers = presliding_numbers([replace(SEAL, dwell_time=2.0)])
        peaks = []
        for dwell in (0.0, 1.0, 2.0, 60.0):
            state, _ = shear(numbers, NOT_SHEARED, Slide(1.0, 1.0, FRICTION, 0.0, 5.0))
            state, _ = shear(numbers, state, Slide(0.0, dwell, FRICTION, 0.0, 5.0))
            peak = 0.0
            for _ in range(1000):
                state, force = shear(numbers, state, Slide(1e-6, 0.0, FRICTION, 0.0, 5.0))
                peak = max(peak, force)
            peaks.append(peak - FRICTION)
        one_step = numbers.stiffnesses.last * 1e-6  # [N] the rod breaks away within a step
        assert peaks == pytest.approx([5.0 * (1.0 - math.exp(-t / 2.0)) for t in (0.0, 1.0, 2.0, 60.0)], abs=one_step)


class TestElements:
    @pytest.mark.parametrize(('exponent', 'parts'), [(0.0, (1, 1, 1)), (1.0, (1, 3, 5)), (2.0, (1, 9, 25))])
    def test_equal_stiffnesses_and_yields_by_the_power_law_the_last_ranks_first(self, exponent, parts):
        numbers = presliding_numbers([Presliding(stiffness=3e5, elements=3, yield_exponent=exponent)])
        assert numbers.stiffnesses == pytest.approx((0.0, 0.0, 0.0, 1e5, 1e5, 1e5))
        assert numbers.shares == pytest.approx([0.0] * 3 + [part / sum(parts) for part in parts])

    def test_lengths_times_and_shares_of_unlike_seals_are_weighted_with_their_stiffness(self):
        soft = Presliding(stiffness=1e5, elements=1, memory_length=1e-3, dwell_time=2.0)
        stiff = Presliding(stiffness=3e5, elements=2, yield_exponent=1.0, memory_length=2e-3, dwell_time=4.0)
        numbers = presliding_numbers([soft, stiff])
        assert numbers.stiffness == 4e5
        assert (numbers.memory_length, numbers.dwell_time) == pytest.approx((1.75e-3, 3.5))
        assert numbers.shares == pytest.approx((0.0, 0.0, 0.0, 0.0, 0.75 * 0.25, 0.25 + 0.75 * 0.75))

    def test_springs_store_half_force_times_stretch_and_rigid_seals_store_nothing(self):
        three = presliding_numbers([Presliding(stiffness=3e5, elements=3, yield_exponent=0.0)])
        forces = Elements(0.0, 0.0, 0.0, 3.0, -2.0, 1.0)
        assert stored_energy(three, Shear(forces, 4.0)) == pytest.approx((9.0 + 4.0 + 1.0) / 2.0 / 1e5)
        assert stored_energy(RIGID, Shear(NO_ELEMENTS._replace(last=FRICTION), 0.0)) == 0.0

    def test_a_map_with_a_presliding_length_is_one_spring_that_yields_over_it(self):
        table = {'speeds': (1e-3, 1e-1), 'pressures': (0.0, 5e6), 'frictions': (8.0, 6.0, 30.0, 20.0)}
        law = FrictionMap(**table, reference_speed=0.01, memory_length=2e-3, presliding_length=4e-5)
        seal = presliding_of_map(law)
        numbers = presliding_numbers([seal])
        assert [initial_loading(numbers, x, 8.0) for x in (1e-5, 3.9e-5, 4.1e-5)] == pytest.approx([2.0, 7.8, 8.0])
        assert numbers.memory_length == pytest.approx(2e-3)
        assert 0.1 * seal.stiffness == seal.relative_std * seal.stiffness  # a tenth: nothing is measured
        assert presliding_of_map(replace(law, presliding_length=0.0)) is None


class TestSymmetry:
    """Laws of nature know no unit and no side: exact, since powers of two do not round."""

    slides = st.lists(
        st.builds(
            lambda micrometres, elapsed, *forces: Slide(1e-6 * micrometres, float(elapsed), *map(float, forces)),
            st.sampled_from([0, 1, -1]) | st.integers(-1000, 1000),
            st.integers(0, 3),
            st.integers(0, 20),
            st.integers(-25, 5),
            st.integers(0, 5),
        ),
        min_size=1,
        max_size=8,
    )
    numbers = st.just(RIGID) | st.builds(
        lambda seal, memory, dwell: presliding_numbers([replace(seal, memory_length=memory, dwell_time=dwell)]),
        preslidings,
        st.sampled_from([0.0, 1e-4]),
        st.sampled_from([0.0, 2.0]),
    )

    @staticmethod
    def run(numbers, slides, force=1.0, length=1.0, side=1.0):
        """Friction, excess, state and direction after each slide, in other units or on the other side."""
        stiffness = force / length
        numbers = numbers._replace(
            stiffness=numbers.stiffness * stiffness,
            stiffnesses=Elements(*(k * stiffness for k in numbers.stiffnesses)),
            memory_length=numbers.memory_length * length,
        )
        state, seen = NOT_SHEARED, []
        for displacement, elapsed, *forces in slides:
            slide = Slide(side * length * displacement, elapsed, *(force * f for f in forces))
            state, friction = shear(numbers, state, slide)
            velocity, at_rest = side * displacement, displacement == 0.0
            acting = acting_friction(numbers, state, friction, slide, at_rest, velocity, side * force * 7.0)
            energy = stored_energy(numbers, state)
            seen.append((friction, state.excess, acting.friction_force, energy, acting.state, acting.direction))
        return seen

    @given(numbers, slides)
    def test_a_thousandth_of_all_forces_gives_a_thousandth_of_the_friction(self, numbers, slides):
        unit = 2.0**-10
        expected = self.run(numbers, slides)
        for (force, excess, acting, energy, *states), found in zip(
            expected, self.run(numbers, slides, force=unit), strict=True
        ):
            assert found == (unit * force, unit * excess, unit * acting, unit * energy, *states)

    @given(numbers, slides)
    def test_a_thousandth_of_all_lengths_gives_the_same_friction(self, numbers, slides):
        unit = 2.0**-10
        for (*forces, energy, state, direction), found in zip(
            self.run(numbers, slides), self.run(numbers, slides, length=unit), strict=True
        ):
            assert found == (*forces, unit * energy, state, direction)

    @given(numbers, slides)
    def test_the_other_way_round_friction_is_the_opposite(self, numbers, slides):
        for (force, excess, acting, energy, state, direction), found in zip(
            self.run(numbers, slides), self.run(numbers, slides, side=-1.0), strict=True
        ):
            assert found == (-force, excess, -acting, energy, state, -direction)


class TestExcess:
    def test_an_excess_that_takes_all_friction_away_leaves_none(self):
        numbers = presliding_numbers([replace(SEAL, memory_length=1e-3)])
        state, force = shear(numbers, Shear(NO_ELEMENTS, -30.0), Slide(1e-4, 0.1, FRICTION, -24.0, 5.0))
        assert state.excess == pytest.approx(-24.0 - 6.0 * math.exp(-0.1))  # the whole contact slides from the start
        assert force == 0.0
        assert state.forces == NO_ELEMENTS

    def test_a_rigid_seal_that_comes_to_rest_holds_no_more_than_its_breakaway_force(self):
        state, force = shear(RIGID, NOT_SHEARED, Slide(1e-3, 1e-3, FRICTION, 6.0, 2.0))
        assert force == FRICTION + 6.0
        _, held = shear(RIGID, state, Slide(0.0, 1e-3, FRICTION, 0.0, 2.0))
        assert held == FRICTION + 2.0

    @pytest.mark.parametrize('side', [1, -1])
    def test_an_elastic_seal_slides_only_at_its_friction_with_the_excess(self, side):
        spring = presliding_numbers([Presliding(stiffness=1e5, yield_exponent=0.0)])
        slide = Slide(side * 1e-2, 1e-3, FRICTION, 4.0, 4.0)
        state, force = shear(spring, NOT_SHEARED, slide)
        assert acting_friction(spring, state, force, slide, False, side, 0.0) == (
            FrictionState.SLIDING,
            side,
            side * 24.0,
        )
        back = Slide(-side * 5e-5, 1e-3, FRICTION, 4.0, 4.0)  # 24 N - 1e5 N/m * 50 um = 19 N, below 24 N
        state, force = shear(spring, state, back)
        acting = acting_friction(spring, state, force, back, True, 0.0, 0.0)
        assert (acting.state, acting.direction) == (FrictionState.STUCK, side)
        assert side * acting.friction_force == pytest.approx(19.0)


class TestHysteresis:
    @given(preslidings, st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12))
    def test_shear_is_independent_of_the_rate_to_the_bit(self, seal, turns):
        numbers = presliding_numbers([seal])
        slow, fast = NOT_SHEARED, NOT_SHEARED
        for turn in turns:
            displacement = turn * yield_displacement(numbers)
            slow, at_leisure = shear(numbers, slow, Slide(displacement, 1e3, FRICTION, 0.0, 0.0))
            fast, in_haste = shear(numbers, fast, Slide(displacement, 1e-6, FRICTION, 0.0, 0.0))
            assert at_leisure == in_haste

    @given(preslidings, st.floats(0.05, 3.0), st.floats(0.01, 1.0))
    def test_masing_a_branch_is_the_initial_loading_doubled(self, seal, turn, way):
        numbers = presliding_numbers([seal])
        far = yield_displacement(numbers)
        start = turn * far
        at_turn = initial_loading(numbers, start, FRICTION)
        back = way * 2.0 * min(start, far)
        after = friction_over(numbers, [start, start - back])[1]
        assert after == pytest.approx(
            at_turn - 2.0 * initial_loading(numbers, back / 2.0, FRICTION), abs=1e-9 * FRICTION
        )

    @given(preslidings, st.lists(st.floats(0.05, 0.95), min_size=1, max_size=6))
    def test_madelung_a_closed_inner_loop_leaves_no_trace(self, seal, shares):
        """Each turn lies inside the branch before, so on the way back every loop closes at the point where it began."""
        numbers = presliding_numbers([seal])
        far = yield_displacement(numbers)
        low, high, turns = -far, far, [far, -far]
        for i, share in enumerate(shares):
            point = low + share * (high - low)
            turns.append(point)
            low, high = (low, point) if i % 2 == 0 else (point, high)
        forward = friction_over(numbers, turns)
        # back through the inner turns in reverse order: at each of them the force is the one of the first passage
        path = turns + turns[-2:0:-1]
        again = friction_over(numbers, path)[len(turns) :]
        np.testing.assert_allclose(again, forward[-2:0:-1], atol=1e-9 * FRICTION)

    def test_a_closed_loop_never_gives_energy(self):
        """1e5 random closed motions with random friction on the way: pressure, speed and dwell change it."""
        rng = np.random.default_rng(19)
        worst, most = math.inf, 0.0
        for _ in range(500):
            seal = Presliding(
                stiffness=10.0 ** rng.uniform(3, 7), elements=int(rng.integers(1, 7)), yield_exponent=rng.uniform(0, 5)
            )
            numbers = presliding_numbers([seal])
            steps = rng.normal(size=(200, 7)) * yield_displacement(numbers)
            steps[:, -1] = -steps[:, :-1].sum(axis=1)
            others = np.stack([FRICTION * rng.uniform(0.2, 2.0, steps.shape), rng.normal(size=steps.shape)], axis=-1)
            taken = _energy_taken(numbers, steps, others)
            worst, most = min(worst, taken.min()), max(most, taken.max())
        assert worst >= -1e-12
        assert most > 1e-4


@compiled
def _energy_taken(numbers, motions, others):
    """Energy [J] that each closed motion takes, without what the springs then store more than before.

    The work of a step is exact: element by element, spring and slider, at the friction of the end of the step.
    """
    state = NOT_SHEARED
    taken = np.zeros(len(motions))
    for i in range(len(motions)):
        before = stored_energy(numbers, state)
        for j in range(motions.shape[1]):
            dx, friction = motions[i, j], others[i, j, 0]
            new, _ = shear(numbers, state, Slide(dx, 0.1, friction, others[i, j, 1], 5.0 * abs(others[i, j, 1])))
            for e in range(SLOTS):
                k, limit = numbers.stiffnesses[e], numbers.shares[e] * max(friction + new.excess, 0.0)
                if k > 0.0:
                    start = min(max(state.forces[e], -limit), limit)  # at once, without displacement
                    end = new.forces[e]
                    stretch = (end - start) / k
                    taken[i] += 0.5 * (start + end) * stretch + end * (dx - stretch)
            state = new
        taken[i] -= stored_energy(numbers, state) - before
    return taken


@compiled
def _creep(numbers, load, ramp, mass, damping, step, seconds):
    """Position of a mass on an elastic seal, one minute after the ramp to a constant load [N], and at the end [m]."""
    state, position, velocity, soon, rounds = NOT_SHEARED, 0.0, 0.0, 0.0, round(seconds / step)
    force = 0.0
    for i in range(rounds):
        velocity += step / mass * (load * min(i * step / ramp, 1.0) - force - damping * velocity)
        state, force = shear(numbers, state, Slide(step * velocity, step, FRICTION, 0.0, 5.0))
        position += step * velocity
        if i == round((ramp + 60.0) / step):
            soon = position
    return soon, position


class TestDrift:
    def test_no_creep_in_one_hour_at_99_percent_of_breakaway(self):
        breakaway = FRICTION + 5.0
        soon, end = _creep(ONE, 0.99 * breakaway, 10.0, 5.0, 400.0, 1e-3, 3600.0)
        assert end == soon
        assert 0.5 * yield_displacement(ONE, breakaway) < end < yield_displacement(ONE, breakaway)

    def test_above_breakaway_the_rod_slides(self):
        _, end = _creep(ONE, 1.01 * (FRICTION + 5.0), 10.0, 5.0, 400.0, 1e-3, 60.0)
        assert end > 0.1

    def test_under_vibration_below_breakaway_lugre_drifts_and_the_elements_do_not(self):
        loads = (0.6 + 0.3 * np.sin(np.arange(200) * 2.0 * math.pi / 200)) * FRICTION
        elements, bristle = [], []
        forces, x = NO_ELEMENTS, 0.0
        deflection, y, bristles = 0.0, 0.0, LuGreNumbers(1e5, 0.0)
        for i in range(200 * 20):
            step = solved(lambda d, f=forces: element_forces(ONE, f, d, FRICTION)[1], loads[i % 200])
            forces, _ = element_forces(ONE, forces, step, FRICTION)
            x += step
            step = solved(lambda d, z=deflection: lugre(bristles, z, d, 0.0, FRICTION)[1], loads[i % 200])
            deflection, _ = lugre(bristles, deflection, step, 0.0, FRICTION)
            y += step
            if i % 200 == 199:
                elements.append(x)
                bristle.append(y)
        assert abs(elements[-1] - elements[1]) < 1e-12
        assert bristle[-1] - bristle[1] > 1e-6


def solved(force, load):
    """Displacement [m] at which a monotone friction force meets a load [N]."""
    low, high = -1e-3, 1e-3
    for _ in range(80):
        middle = 0.5 * (low + high)
        if force(middle) < load:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def test_lugre_at_even_speed_is_its_sliding_friction_and_its_first_slope_is_the_bristle():
    numbers = LuGreNumbers(1e5, 300.0)
    deflection, force = lugre(numbers, 0.0, 0.1, 0.05, FRICTION)
    assert force == pytest.approx(FRICTION, rel=1e-12)
    assert lugre(LuGreNumbers(1e5, 0.0), 0.0, 1e-9, 0.0, FRICTION)[1] == pytest.approx(1e5 * 1e-9, rel=1e-4)
    assert deflection == pytest.approx(FRICTION / 1e5)


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize('friction', [0.5, FRICTION])
def test_lugre_relaxes_over_the_yield_of_its_bristles_and_its_damping_acts_on_their_rate(side, friction):
    bristles, far, before = LuGreNumbers(1e5, 300.0), friction / 1e5, -0.4 * friction / 1e5
    deflection, force = lugre(bristles, side * before, side * 2.0 * far, side * 0.05, friction)
    assert side * deflection == pytest.approx(far * (1.0 - 1.4 * math.exp(-2.0)))
    rate = 0.05 * (1.0 - side * deflection / far)
    assert side * force == pytest.approx(1e5 * side * deflection + 300.0 * rate)
    assert lugre(bristles, before, 0.0, 0.0, friction) == (before, 1e5 * before)  # at rest nothing relaxes


def test_lugre_without_friction_is_none():
    assert lugre(LuGreNumbers(1e5, 300.0), 1e-4, 1e-3, 0.05, 0.0) == (0.0, 0.0)


@compiled
def _shear_compiled(numbers, state, slide):
    return shear(numbers, state, slide)


@given(preslidings, st.lists(st.floats(-1e-3, 1e-3), min_size=1, max_size=10), st.floats(0.0, 1e-3))
def test_compiled_and_python_agree_to_the_bit(seal, displacements, length):
    numbers = presliding_numbers([replace(seal, memory_length=length, dwell_time=0.3)])
    python, fast = NOT_SHEARED, NOT_SHEARED
    for displacement in displacements:
        slide = Slide(displacement, 1e-3, FRICTION, 2.0, 5.0)
        python, force = shear(numbers, python, slide)
        fast, same = _shear_compiled(numbers, fast, slide)
        assert (force, tuple(python.forces), python.excess) == (same, tuple(fast.forces), fast.excess)


def test_no_seal_is_rigid_and_bounds_are_checked():
    assert presliding_numbers([]) is RIGID
    assert isinstance(NOT_SHEARED, Shear)
    assert Elements._fields[-1] == 'last'
    with pytest.raises(ValueError, match=r'Presliding.stiffness = 0.0 N/m is below its lower bound'):
        Presliding(stiffness=0.0)
