"""A recording to a seal file: the friction law of the seals from a pull test in a bag, and how sure it is."""

from pathlib import Path

from seal_friction_ros import identify, load_seal

ROOT = Path(__file__).parents[1]

found = identify(ROOT / 'bags' / 'pull_test', name='from_bag')  # chambers and geometry are those in the bag
print(found.selection.law.name, found.document['identified_pressure'])
for level in found.levels:
    print(f'{level.pressure / 1e5:5.1f} bar: measured {level.measured:5.1f} N, fitted {level.fitted:5.1f} N')
assert len(found.levels) == 3
assert max(abs(level.fitted / level.measured - 1.0) for level in found.levels) < 0.02

# The catalogue seal is the mean of more readings than this bag has, so it is off by more than the fit here.
catalogue = load_seal('ms28775_114')
errors = [2 * catalogue.friction(level.pressure, 0.05) / level.measured - 1.0 for level in found.levels]
print('catalogue:', *(f'{error:+.1%}' for error in errors))
assert max(map(abs, errors)) < 0.15
