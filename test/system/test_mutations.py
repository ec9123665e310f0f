"""The mutation run: what it changes, what it leaves alone, and which tests it asks."""

import ast

import mutations
import pytest

SOURCE = '''"""Docstring with 1 number."""
__all__ = ['f']


class Settings:
    """Settings."""

    width: float = parameter(0.5, unit='m', description='Of 2 rods.')


@decorated(3)
def f(x: Literal[4], y: float = 0.0) -> float:
    """Take 5."""
    if not x < y:
        raise ValueError(f'{x} is above {6}')
    g(x)
    return -abs(x) + y if x and y else max(x, 7)
'''
EXPECTED = [
    '0.5 -> (1.0)',
    '0.0 -> (1.0)',
    'not x < y -> (x < y)',
    'x < y -> (x <= y)',
    'x < y -> (x >= y)',
    "raise ValueError(f'{x} is above {6}') -> pass",
    'g(x) -> pass',
    '-abs(x) -> (abs(x))',
    'abs(x) -> (x)',
    '-abs(x) + y -> (-abs(x) - y)',
    '-abs(x) + y if x and y else max(x, 7) -> (max(x, 7) if x and y else -abs(x) + y)',
    'return -abs(x) + y if x and y else max(x, 7) -> return None',
    'x and y -> (x or y)',
    'max(x, 7) -> (min(x, 7))',
    '7 -> (8)',
]


def test_code_is_changed_and_texts_annotations_and_decorators_are_not(tmp_path, monkeypatch):
    monkeypatch.setattr(mutations, 'TREE', tmp_path)
    file = tmp_path / mutations.PACKAGE / 'module.py'
    file.parent.mkdir()
    file.write_text(SOURCE)
    found = mutations.mutants_of(file)
    assert sorted(f'{m.before} -> {m.after}' for m in found) == sorted(EXPECTED)
    for mutant in found:
        ast.parse(SOURCE[: mutant.start] + mutant.after + SOURCE[mutant.end :])
        assert SOURCE[: mutant.start].count('\n') + 1 == mutant.line


def test_a_sample_is_spread_over_all_mutants_and_the_same_for_a_seed():
    numbers = list(range(1000))
    assert mutations.sample(numbers, 2000, 1) == numbers
    for seed in range(5):
        drawn = mutations.sample(numbers, 10, seed)
        assert drawn == mutations.sample(numbers, 10, seed)
        assert [n // 100 for n in drawn] == list(range(10))
    assert mutations.sample(numbers, 10, 1) != mutations.sample(numbers, 10, 2)


@pytest.mark.parametrize(
    ('file', 'first', 'without'),
    [
        ('core/estimation/feedforward.py', 'test_feedforward.py', 'test_compiled_pipeline.py'),
        ('core/estimation/compiled_pipeline.py', 'test_compiled_pipeline.py', 'test_feedforward.py'),
        ('core/friction/geometry.py', 'test_geometry.py', 'test_pipeline.py'),
    ],
)
def test_the_mirrored_tests_come_first(file: str, first: str, without: str):
    tests = mutations.tests_of(mutations.TREE, file)
    assert tests[0].endswith(f'/{first}')
    assert not any(name.endswith(without) for name in tests)
