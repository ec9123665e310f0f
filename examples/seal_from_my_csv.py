"""My readings to a seal file: a CSV table of pressure, direction and friction, and the error on readings left out."""

import tempfile
from pathlib import Path

from seal_friction_ros import identify, load_seal

ROOT = Path(__file__).parents[1]
TABLE = ROOT / 'data' / 'thesis' / 'friction_tests.csv'
# test,pressure_psig,kind,direction,friction_lbf
# 1,0,static,retract,3.0

with tempfile.TemporaryDirectory() as folder:
    out = Path(folder) / 'my_seal.yaml'
    found = identify(TABLE, name='my_seal', chambers=('a', 'b'), out=out)  # two seals shared the friction
    seal = load_seal(out)  # the node takes the same file: -p seals:=[my_seal.yaml]

about = found.document['identification']
print(f'law {found.selection.law.name} from {about["readings"]} readings')
error = found.selection.validation.error
print(f'error on readings that the fit did not see: {error:.1%}')
assert error < 0.1
for warning in found.warnings:
    print('warning:', warning)

catalogue = load_seal('ms28775_114')  # made from the same readings, with the normal force of finite elements
for bar in (10, 35, 60):
    mine, theirs = seal.friction(bar * 1e5, 0.05), catalogue.friction(bar * 1e5, 0.05)
    print(f'{bar} bar: {mine:.1f} N, catalogue {theirs:.1f} N')
    assert abs(mine / theirs - 1.0) < 0.05
