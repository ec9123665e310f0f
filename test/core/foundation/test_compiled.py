"""Compiled code on disk refers to the types of records and laws by names from which any process makes them again."""

import pickle
import subprocess
import sys

import pytest

from seal_friction_ros.core.foundation import compiled
from seal_friction_ros.core.foundation.compiled import bound, for_compiler, keep
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


def test_another_name_is_no_attribute():
    with pytest.raises(AttributeError, match='no_such_name'):
        compiled.no_such_name  # noqa: B018


def test_compiled_code_on_disk_that_knows_a_removed_law_does_not_stop_another_process():
    made = compiled._bound_type(pressure_power_law)
    pickled = pickle.dumps(made).replace(b'pressure_power_law', b'no_longer_here_law')
    gone = pickle.loads(pickled)  # noqa: S301
    assert gone is not made
    assert pickle.loads(pickled) is gone  # noqa: S301
