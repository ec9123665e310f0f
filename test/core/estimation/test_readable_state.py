"""Records are read by the names of their fields: nothing takes a long one apart by the places of its values."""

import ast

from paths import ROOT

MOST = 5  # names on the left of one assignment


def names_in(target: ast.expr) -> int:
    return sum(map(names_in, target.elts)) if isinstance(target, ast.Tuple | ast.List) else 1


def unpacked(source: str) -> list[int]:
    """How many names each assignment and loop takes out of one value."""
    found = []
    for node in ast.walk(ast.parse(source)):
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, 'target', None)]
        value = getattr(node, 'value', None)
        found += [
            names_in(target)
            for target in targets
            if isinstance(target, ast.Tuple | ast.List) and not isinstance(value, ast.Tuple)
        ]
    return found


def test_no_record_is_taken_apart_into_more_than_five_names():
    files = sorted((ROOT / 'seal_friction_ros' / 'core' / 'estimation').glob('*.py'))
    counts = {path.name: max(unpacked(path.read_text()), default=0) for path in files}
    assert counts['estimator.py'] > 1
    assert {name: count for name, count in counts.items() if count > MOST} == {}


def test_every_way_of_taking_apart_is_seen():
    source = 'a, b, (c, [d, e]) = f\nfor g, h in i: pass\n[j for j, k, m in n]\no = p\nq, r = 1, 2'
    assert sorted(unpacked(source)) == [2, 3, 5]
