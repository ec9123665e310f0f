"""``seal_friction section``: contact, normal force and friction of a seal from its drawing or a shape."""

import argparse
from pathlib import Path
from typing import Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import SEAL_FILE


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = cli.add_command(
        commands, 'section', run, 'compute contact and friction of a seal of any section, from a drawing or a shape',
        'section x_ring --height 3.53mm --rod 19.346mm --gland 25.7mm --sliding bore --pressure 7bar',
        'section my_seal.dxf --rod 36mm --gland 46mm --pressure 50bar --reading 50bar,0.1,40N --out seal.yaml',
    )  # fmt: skip
    text = 'x_ring, u_cup, lip_seal, wiper, capped_ring, circle, or the outline in a file: CSV (r [mm], z [mm]) or DXF'
    parser.add_argument('drawing', metavar='SHAPE|FILE', help=text)
    cli.add_options(parser, _OPTIONS)
    parser.add_argument('--mirrored', action='store_true', help='swap the inner and the outer side of the section')
    cli.add_shared(parser, '--reading', '--film')
    cli.add_target(parser, '--out', SEAL_FILE, metavar='SEAL.yaml', help='seal file to write')
    cli.add_page(parser, '--report', required=False)


def _diameter(what: str, **settings: Any) -> tuple[str, cli.Settings]:
    return f'{what}, in m or with a unit', {'type': cli.quantity('m'), 'metavar': 'D', **settings}


_OPTIONS: dict[str, tuple[str, cli.Settings]] = {
    '--rod': _diameter('diameter of the inner wall: rod, or groove of a piston', required=True),
    '--gland': _diameter('diameter of the outer wall: gland, or bore', required=True),
    '--sliding': ('wall that slides, default rod', {'choices': ('rod', 'bore'), 'default': 'rod'}),
    '--height': _diameter('free height of the section along the radius; default: that of the drawing'),
    '--inner': _diameter('free inner diameter of the seal; default: as drawn, or in the middle of the gap'),
    '--groove': _diameter('width of the groove; default: 1.25 times the length of the section'),
    '--clearance': _diameter('diametral clearance behind the seal, default 0', default=0.0),
    '--corner-radius': _diameter(
        'radius of the corners that face the sliding wall; default: 2 %% of the height, of a drawing as drawn'
    ),
    '--pressure': cli.PRESSURE,
    '--hardness': ('of the rubber, Shore A, default 70', {'type': float, 'default': 70.0, 'metavar': 'A'}),
    '--test': ('tension test of the rubber: CSV (strain [1], stress [MPa])', {'type': Path, 'metavar': 'FILE'}),
    '--model': ('of the rubber of --test, default yeoh', {'choices': ('mooney', 'yeoh', 'ogden'), 'default': 'yeoh'}),
    '--lines': ('of the mesh, as numerics.lines of a case', {'type': cli.at_least(13), 'metavar': 'N'}),
    '--name': ('of the seal; default: of the drawing', {'default': ''}),
}


def run(arguments: argparse.Namespace) -> int:
    """Compute on three meshes, and write seal file and page."""
    from dataclasses import asdict

    from seal_friction_ros.core.oring_contact.ring_friction import Reading
    from seal_friction_ros.offline.contact.oring_runs import Task, compute_file, seal_comment, seal_document
    from seal_friction_ros.offline.contact.section_files import read_tension
    from seal_friction_ros.offline.contact.section_runs import Gland, case_of, section_document
    from seal_friction_ros.offline.reports.oring_report import numbers_text, write_oring_report
    from seal_friction_ros.offline.work.seal_writer import write_seal

    gland = Gland(**{name: getattr(arguments, name) for name in Gland._fields})
    rubber: dict[str, Any] = {'hardness': arguments.hardness}
    if arguments.test:
        rubber = asdict(read_tension(arguments.test, arguments.model))
    document = section_document(
        arguments.drawing, gland, name=arguments.name, rubber=rubber, mirrored=arguments.mirrored
    )
    pressures = sorted({0.0, *arguments.pressure})
    file = case_of(document, pressures, arguments.lines)
    readings = [Reading(*reading) for reading in arguments.reading]
    task = Task(readings=readings, for_seal_file=True, fluid=arguments.film, meshes=True)
    computed = compute_file(file, Path(arguments.drawing), task)
    if arguments.report:
        write_oring_report(computed, arguments.report)
    if arguments.out:
        write_seal(seal_document(computed), arguments.out, seal_comment(computed))
    return cli.print_result(arguments, cli.json_value(computed.numbers()), numbers_text(computed))
