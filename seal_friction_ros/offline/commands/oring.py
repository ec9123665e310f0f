"""``seal_friction oring`` and ``section``: contact and friction of a ring, from a case, a drawing or a shape."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seal_friction_ros.offline.commands import command_line as cli
from seal_friction_ros.offline.work.targets import SEAL_FILE

if TYPE_CHECKING:
    from seal_friction_ros.offline.contact.oring_runs import Computed
    from seal_friction_ros.offline.contact.uncertainty import Uncertainty


def add_parser(commands: Any) -> None:
    """Add the commands."""
    oring = cli.add_command(
        commands, 'oring', run_oring,
        'compute contact stress, normal force and friction of an O-ring by finite elements',
        'oring ms28775_114 --out my_seal.yaml --report oring.html',
        'oring my_ring.yaml --reading 35bar,10mm/s,21N --out my_seal.yaml',
        'oring other_size.yaml --law-from my_seal.yaml --out other_seal.yaml',
        'oring ms28775_114 --uncertain 100 --out my_seal.yaml --work build/oring',
    )  # fmt: skip
    section = cli.add_command(
        commands, 'section', run_section,
        'compute contact and friction of a seal of any section, from a drawing or a shape',
        'section x_ring --height 3.53mm --rod 19.346mm --gland 25.7mm --sliding bore --pressure 7bar',
        'section my_seal.dxf --rod 36mm --gland 46mm --pressure 50bar --reading 50bar,0.1,40N --out seal.yaml',
    )  # fmt: skip
    cli.add_file(oring, 'case', 'oring', 'case file', metavar='CASE')
    text = 'gauge pressures, instead of those in the file'
    oring.add_argument('--pressures', type=float, nargs='+', default=(), metavar='PA', help=text)
    text = 'x_ring, u_cup, lip_seal, wiper, capped_ring, circle, or the outline in a file: CSV (r [mm], z [mm]) or DXF'
    section.add_argument('drawing', metavar='SHAPE|FILE', help=text)
    cli.add_options(section, _OF_SECTION)
    section.add_argument('--mirrored', action='store_true', help='swap the inner and the outer side of the section')
    for parser in (oring, section):
        cli.add_shared(parser, '--reading', '--film')
        cli.add_target(parser, '--out', SEAL_FILE, metavar='SEAL.yaml', help='seal file to write')
        cli.add_page(parser, '--report', required=False)
    text = 'seal file of another ring of the same rubber, wall and lubricant, for its shear law'
    cli.add_file(oring, '--law-from', 'seals', text, metavar='SEAL')
    cli.add_shared(oring, '--uncertain', '--seed')
    cli.add_workers(oring, 'samples')
    cli.add_shared(oring, '--work')


def _diameter(what: str, **settings: Any) -> tuple[str, cli.Settings]:
    return f'{what}, in m or with a unit', {'type': cli.quantity('m'), 'metavar': 'D', **settings}


_OF_SECTION: dict[str, tuple[str, cli.Settings]] = {
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


def run_oring(arguments: argparse.Namespace) -> int:
    """Compute, and write seal file and page."""
    from seal_friction_ros.core.oring_contact.ring_friction import Reading
    from seal_friction_ros.files import config_path
    from seal_friction_ros.offline.contact.oring_runs import Task, compute_case

    samples, workers = cli.samples_of(arguments), cli.workers_of(arguments)
    if not samples:
        cli.check_only_for(arguments, ('workers', 'scheduler', 'work'), '--uncertain N')
    elif arguments.reading:
        raise ValueError('--uncertain is for a ring without a --reading, which leaves its own deviation')
    task = Task(
        arguments.pressures,
        readings=[Reading(*reading) for reading in arguments.reading],
        law_from=config_path('seals', arguments.law_from) if arguments.law_from else None,
        for_seal_file=arguments.out is not None,
        for_samples=bool(samples),
        fluid=arguments.film,
        meshes=True,
    )
    computed = compute_case(config_path('oring', arguments.case), task)
    if not samples:
        return _finished(arguments, computed)
    from seal_friction_ros.offline.contact.sampling import uncertain_ring

    found = uncertain_ring(computed, *samples, workers, arguments.work)
    more = {'uncertainty': found.numbers()}
    return _finished(arguments, computed, found.friction or found.normal_force, more, found.summary())


def run_section(arguments: argparse.Namespace) -> int:
    """Compute on three meshes, and write seal file and page."""
    from dataclasses import asdict

    from seal_friction_ros.core.oring_contact.ring_friction import Reading
    from seal_friction_ros.offline.contact.oring_runs import Task, compute_file
    from seal_friction_ros.offline.contact.section_files import read_tension
    from seal_friction_ros.offline.contact.section_runs import Gland, case_of, section_document

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
    return _finished(arguments, compute_file(file, Path(arguments.drawing), task))


def _finished(
    arguments: argparse.Namespace,
    computed: 'Computed',
    uncertainty: 'Uncertainty | None' = None,
    more: dict[str, Any] | None = None,
    *texts: str,
) -> int:
    """Write page and seal file, and print the numbers and some ``more``."""
    from seal_friction_ros.offline.contact.oring_runs import seal_comment, seal_document
    from seal_friction_ros.offline.reports.oring_report import numbers_text, write_oring_report
    from seal_friction_ros.offline.work.seal_writer import write_seal

    if arguments.report:
        write_oring_report(computed, arguments.report, uncertainty)
    if arguments.out:
        write_seal(seal_document(computed, uncertainty), arguments.out, seal_comment(computed))
    numbers = cli.json_value(computed.numbers()) | (more or {})
    return cli.print_result(arguments, numbers, '\n'.join([numbers_text(computed), *texts]))
