"""Compiled code on disk refers to the types of records and laws by names from which any process makes them again."""

import gc
import pickle
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest
from numba.core import event

from seal_friction_ros.core.foundation import compiled
from seal_friction_ros.core.foundation.compiled import bound, evaluate, for_compiler, keep, unrolled
from seal_friction_ros.core.friction.actuator import numbers_of_law
from seal_friction_ros.core.friction.laws.constant_coulomb import ConstantCoulomb
from seal_friction_ros.core.friction.laws.friction_coefficient import CoefficientTable
from seal_friction_ros.core.friction.laws.pressure_power_law import PressurePowerLaw, pressure_power_law
from seal_friction_ros.core.servo.plant import Load

LAW = PressurePowerLaw(friction_at_no_pressure=2.0, friction_at_one_bar=0.5, pressure_exponent=0.7)
VALUES = {
    'record': for_compiler(Load()),
    'law': for_compiler(bound(pressure_power_law, LAW)),
    'kept': keep((1.0, 2.0)),
}


@pytest.mark.parametrize('name', VALUES)
def test_another_process_makes_the_type_from_its_name(name):
    made = type(VALUES[name])
    code = f'import pickle; print(pickle.loads({pickle.dumps(made)!r}).__qualname__)'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == made.__qualname__
    assert getattr(compiled, made.__qualname__) is made


def test_compiled_code_on_disk_may_name_a_law_that_is_gone():
    made = getattr(compiled, 'bound:no/such/module:law')
    assert made.__qualname__.encode() in pickle.dumps(made)


@compiled.compiled
def _value(law, pressure):
    return evaluate(law, pressure, 0.0)


@compiled.compiled
def _sum(records, pressure):
    total = 0.0
    for record in unrolled(records):
        total += evaluate(record.law, pressure, 0.0) * record.scale
    return total


@compiled.compiled
def _kept_sum(kept):
    return kept.value[0] + kept.value[1]


def test_garbage_is_seldom_collected_while_a_function_is_compiled_and_as_before_after_it(monkeypatch, tmp_path):
    monkeypatch.setattr('numba.config.CACHE_DIR', str(tmp_path))  # else the second run of the tests compiles nothing
    before, seen = gc.get_threshold(), set()

    class Told(event.Listener):
        def on_start(self, _event):
            seen.add(gc.get_threshold()[0])

        def on_end(self, _event):
            seen.add(gc.get_threshold()[0])

    with event.install_listener('numba:compile', Told()):
        assert compiled.compiled(lambda x: x + 1.0)(1.0) == 2.0
    assert seen == {compiled.NEW_RECORDS}
    assert gc.get_threshold() == before


def test_compiled_code_evaluates_laws_and_tables_as_python_does():
    table = CoefficientTable((10.0, 20.0, 40.0), (0.9, 0.5, 0.4))
    for law, places in ((LAW.bound, (0.0, 1e5, 3e6)), (table.bound, (0.0, 5.0, 10.0, 19.0, 40.0, 99.0))):
        known = for_compiler(law)
        for place in places:
            assert _value(known, place) == law(place, 0.0)


def test_compiled_code_loops_over_records_of_different_laws():
    laws = (LAW, ConstantCoulomb(7.0))
    seals = tuple(numbers_of_law(law)._replace(scale=scale) for law, scale in zip(laws, (2.0, 3.0), strict=True))
    expected = 2.0 * LAW.coulomb_friction(1e6) + 3.0 * 7.0
    assert _sum(for_compiler(seals), 1e6) == expected


def test_tuples_of_numbers_become_arrays_and_dataclasses_records():
    @dataclass(frozen=True)
    class Part:
        sizes: tuple[float, ...]
        inner: tuple[int, bool]
        left_out: str = 'not for the compiler'

        @property
        def total(self) -> float:
            return sum(self.sizes)

        @property
        def text(self) -> str:
            return self.left_out

    record = for_compiler(Part((1.0, 2.0), (3, True)))
    assert record._fields == ('sizes', 'inner', 'total')
    assert (record.sizes.tolist(), record.inner, record.total) == ([1.0, 2.0], (3, True), 3.0)
    assert _kept_sum(keep(np.array([1.0, 2.0]))) == 3.0


def test_another_name_is_no_attribute():
    with pytest.raises(AttributeError, match='no_such_name'):
        compiled.no_such_name  # noqa: B018  the look-up is tested


def test_compiled_code_on_disk_that_knows_a_removed_law_does_not_stop_another_process():
    made = type(for_compiler(PressurePowerLaw(3.0, 0.4, 0.6).bound))
    pickled = pickle.dumps(made).replace(b'pressure_power_law', b'no_longer_here_law')
    gone = pickle.loads(pickled)  # noqa: S301  our own bytes
    assert gone is not made
    assert pickle.loads(pickled) is gone  # noqa: S301  our own bytes
