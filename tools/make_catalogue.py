"""The seal files of config/seals/catalogue, computed from common sizes: ``python tools/make_catalogue.py``.

O-rings and X-rings: rings of AS568 in the gland of a dynamic seal, without back-up ring, of the Seal Design Guide of
Apple Rubber (Table A). U-cups and capped rings: common sizes, with our proportions of the section.
"""

import sys
from pathlib import Path
from typing import Any

from seal_friction_ros.core.foundation.units import BAR, INCH, MM
from seal_friction_ros.core.oring_contact.oring_case_file import parse_oring_case
from seal_friction_ros.offline.contact.oring_runs import Task, compute_file, seal_comment, seal_document
from seal_friction_ros.offline.work.seal_writer import write_seal

FOLDER = Path(__file__).parents[1] / 'config' / 'seals' / 'catalogue'
GLANDS = {0.103: (0.0885, 0.145), 0.139: (0.121, 0.185)}  # section -> depth and width of the gland [in]
CLEARANCE = 0.005  # [in] diametral
RINGS = {'114': (0.612, 0.103), '210': (0.734, 0.139), '214': (0.984, 0.139), '218': (1.234, 0.139),
         '222': (1.484, 0.139), '226': (1.984, 0.139)}  # fmt: skip  # AS568 -> inner diameter, section [in]
RODS = {'114': 0.625, '210': 0.75, '214': 1.0, '218': 1.25, '222': 1.5, '226': 2.0}  # [in]
BORES = {'210': 1.0, '214': 1.25, '222': 1.75, '226': 2.25}  # [in]
SEALS = [
    *(('o_ring', dash, 'rod') for dash in RODS),
    *(('o_ring', dash, 'bore') for dash in BORES),
    *(('x_ring', dash, 'rod') for dash in ('210', '214', '222')),
    *(('x_ring', dash, 'bore') for dash in ('214', '222')),
]
COMPUTED = 'Computed, no reading: friction within a factor of 4.'
SHAPES = {'o_ring': 'O-ring', 'x_ring': 'X-ring'}
OTHERS: list[dict[str, Any]] = [
    {'name': f'u_cup_{rod}_rod', 'what': 'U-cup of polyurethane, Shore A 93', 'rod': rod, 'gland': rod + 10,
     'height': 5.7, 'groove': 10.0, 'section': {'shape': 'u_cup'}, 'sliding': 'rod', 'hardness': 93.0,
     'bar': (0, 50, 100, 150)}
    for rod in (36, 50)
] + [
    {'name': 'lip_seal_36_rod', 'what': 'Asymmetric lip seal of nitrile, Shore A 85', 'rod': 36.0, 'gland': 46.0,
     'height': 5.7, 'groove': 10.0, 'section': {'shape': 'lip_seal'}, 'sliding': 'rod', 'hardness': 85.0,
     'bar': (0, 20, 50)},
    {'name': 'wiper_36_rod', 'what': 'Wiper of polyurethane, Shore A 93', 'rod': 36.0, 'gland': 46.0, 'height': 5.5,
     'groove': 8.0, 'section': {'shape': 'wiper'}, 'sliding': 'rod', 'hardness': 93.0, 'bar': (0,)},
    {'name': 'capped_ring_50_bore', 'what': 'PTFE cap on a ring of nitrile, Shore A 70', 'rod': 39.0, 'gland': 50.0,
     'height': 5.9, 'groove': 7.5, 'section': {'shape': 'capped_ring', 'mirrored': True}, 'sliding': 'bore',
     'hardness': 70.0, 'bar': (0, 50, 100)},
]  # fmt: skip


def ring_document(shape: str, dash: str, sliding: str) -> dict[str, Any]:
    """Case of a ring of AS568 on a rod, or on a piston in a bore."""
    inner, section = RINGS[dash]
    depth, width = GLANDS[section]
    rod, gland = (RODS[dash], RODS[dash] + 2 * depth) if sliding == 'rod' else (BORES[dash] - 2 * depth, BORES[dash])
    hardness = 70.0 if shape == 'o_ring' else 80.0
    what = f'{SHAPES[shape]} AS568-{dash} of nitrile, Shore A {hardness:.0f}'
    document = {
        'name': f'as568_{dash}_{shape}_{sliding}',
        'source': f'{COMPUTED} {what}, gland of a dynamic seal (Apple Rubber).',
        'geometry': {
            'section_diameter': section * INCH,
            'ring_inner_diameter': inner * INCH,
            'rod_diameter': rod * INCH,
            'gland_diameter': gland * INCH,
            'sliding_wall': sliding,
        },
        'groove': {'width': width * INCH, 'diametral_clearance': CLEARANCE * INCH},
        'rubber': {'hardness': hardness},
        'pressures': [0.0, 20 * BAR, 50 * BAR, (100 if shape == 'o_ring' else 70) * BAR],
    }
    return document if shape == 'o_ring' else {**document, 'section': {'shape': shape}}


def other_document(seal: dict[str, Any]) -> dict[str, Any]:
    """Case of a seal of `OTHERS`, sizes in mm; it lies in the middle of the gap."""
    inner = 0.5 * (seal['rod'] + seal['gland']) - seal['height']
    return {
        'name': seal['name'],
        'source': f'{COMPUTED} {seal["what"]}; section with our proportions.',
        'geometry': {
            'section_diameter': seal['height'] * MM,
            'ring_inner_diameter': inner * MM,
            'rod_diameter': seal['rod'] * MM,
            'gland_diameter': seal['gland'] * MM,
            'sliding_wall': seal['sliding'],
        },
        'section': seal['section'],
        'groove': {'width': seal['groove'] * MM, 'diametral_clearance': 0.1 * MM},
        'rubber': {'hardness': seal['hardness']},
        'pressures': [pressure * BAR for pressure in seal['bar']],
    }


def main() -> None:
    """Compute and write them all, or those whose names contain the argument."""
    documents = [ring_document(*seal) for seal in SEALS] + [other_document(seal) for seal in OTHERS]
    for document in documents:
        if len(sys.argv) < 2 or sys.argv[1] in document['name']:
            path = FOLDER / f'{document["name"]}.yaml'
            computed = compute_file(parse_oring_case(document), path, Task(for_seal_file=True, meshes=True))
            comment = 'Made by tools/make_catalogue.py; see docs/seal_from_drawing.md.\n'
            write_seal(seal_document(computed), path, comment + seal_comment(computed).partition('\n')[2])


if __name__ == '__main__':
    main()
