"""Who may import whom: core stands alone, offline and nodes do not know each other but for the recorder and the page.

Within core and within offline a room imports only from rooms before it.
"""

import ast
import re
import sys

import pytest
from paths import ROOT

PACKAGE, STUDIES = 'seal_friction_ros', 'seal_friction_studies'
SOURCES = ROOT / PACKAGE
ROS = {
    'rclpy', 'rcl_interfaces', 'std_msgs', 'std_srvs', 'diagnostic_msgs', 'lifecycle_msgs', 'seal_friction_msgs',
    'sensor_msgs', 'geometry_msgs', 'trajectory_msgs',
}  # fmt: skip
NOT_PHYSICS = {
    *ROS,
    'asyncio', 'builtins', 'datetime', 'importlib', 'io', 'mcap', 'os', 'pathlib', 'random', 'rosbags', 'secrets',
    'shutil', 'socket', 'subprocess', 'sys', 'tempfile', 'threading', 'time', 'uuid', 'yaml',
}  # fmt: skip
THIRD_PARTY_OF_CORE = {'numpy', 'scipy', 'numba'}
ROOMS = {  # in order; rooms on one line do not import from each other
    'core': (
        ('foundation',),
        ('friction',),
        ('messages',),
        ('estimation', 'identification', 'oring_contact'),
        ('lubrication',),
        ('servo', 'machine'),
        ('tuning',),
    ),
    'offline': (
        ('work',),
        ('bags',),
        ('replay',),
        ('identification', 'tuning', 'contact', 'monitor', 'export'),
        ('reports',),
        ('commands',),
    ),
}
MOST_ROOMS = 10  # of core and of offline: what a newcomer reads at a glance
SHARED_WITH_NODES = {
    f'{PACKAGE}.offline.{part}' for part in ('bags.recorder', 'bags.bag', 'bags.definitions', 'monitor')
}


def imported(source: str) -> set[str]:
    """Full names of the modules (or of what is taken from them) that a source imports anywhere, functions included."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            prefix = '.' * node.level + (node.module or '')
            names |= {f'{prefix}.{alias.name}' for alias in node.names}
    return names


def imports_of(ring: str) -> list[tuple[str, str]]:
    files = sorted((SOURCES / ring).rglob('*.py')) if ring != 'files' else [SOURCES / 'files.py']
    assert files
    return [(file.relative_to(SOURCES).as_posix(), name) for file in files for name in imported(file.read_text())]


def studied(ring: str) -> list[tuple[str, str]]:
    """As `imports_of`, of a ring of the studies."""
    files = sorted((ROOT / STUDIES / ring).rglob('*.py'))
    assert files
    return [(f'{STUDIES}/{ring}/{file.name}', name) for file in files for name in imported(file.read_text())]


def is_below(name: str, module: str) -> bool:
    return name == module or name.startswith(f'{module}.')


def offenders(ring: str, forbidden) -> list[str]:
    return [f'{file} imports {name}' for file, name in imports_of(ring) if forbidden(name)]


def test_the_walk_sees_every_kind_of_import():
    source = 'import os.path as p\nfrom a.b import c, d\ndef f():\n    from . import e\n    from ..g import h\n'
    assert imported(source) == {'os.path', 'a.b.c', 'a.b.d', '..e', '..g.h'}


def test_core_knows_neither_ros_nor_files_nor_clock_nor_chance():
    assert not offenders('core', lambda name: name.split('.')[0] in NOT_PHYSICS)


def test_core_stands_on_the_standard_library_and_numerics_alone():
    def outside(name: str) -> bool:
        top, _, _ = name.partition('.')
        return top not in sys.stdlib_module_names | THIRD_PARTY_OF_CORE and not is_below(name, f'{PACKAGE}.core')

    assert not offenders('core', outside)


def test_the_package_does_not_import_the_studies_in_any_ring():
    """`offline/commands/studies.py` finds their commands by name."""
    everything = [(file, name) for file in SOURCES.rglob('*.py') for name in imported(file.read_text())]
    assert not [f'{file} imports {name}' for file, name in everything if is_below(name, STUDIES)]


def test_core_of_the_studies_stands_on_both_cores_and_numerics_alone():
    own = (f'{PACKAGE}.core', f'{STUDIES}.core')

    def outside(name: str) -> bool:
        known = name.split('.', maxsplit=1)[0] in (sys.stdlib_module_names - NOT_PHYSICS) | THIRD_PARTY_OF_CORE
        return not known and not any(is_below(name, module) for module in own)

    assert not [f'{file} imports {name}' for file, name in studied('core') if outside(name)]


@pytest.mark.parametrize(('ring', 'above'), [('offline', ('commands',)), ('commands', ())])
def test_the_studies_need_no_ros_and_import_from_their_own_rings_below_only(ring, above):
    forbidden = [f'{PACKAGE}.nodes', *ROS, *(f'{STUDIES}.{one}' for one in above)]
    assert not [f'{file} imports {name}' for file, name in studied(ring) if any(is_below(name, m) for m in forbidden)]


def test_core_draws_chance_only_from_a_seed_that_was_passed():
    calls = [
        f'{file.name}: {ast.unparse(node)}'
        for file in (SOURCES / 'core').rglob('*.py')
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Call)
        and 'random.' in ast.unparse(node.func)
        and not (ast.unparse(node.func) == 'np.random.default_rng' and node.args)
    ]
    assert not calls


def test_core_opens_and_prints_nothing():
    calls = [
        f'{file.name}: {node.func.id}'
        for file in (SOURCES / 'core').rglob('*.py')
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in {'open', 'print', 'input', 'eval', 'exec', '__import__'}
    ]
    assert not calls


def test_offline_needs_no_ros_graph():
    assert not offenders('offline', lambda name: name.split('.')[0] in ROS or is_below(name, f'{PACKAGE}.nodes'))


def test_nodes_take_only_the_recorder_the_bag_and_the_page_of_the_view_from_offline():
    def surplus(name: str) -> bool:
        return is_below(name, f'{PACKAGE}.offline') and not any(is_below(name, module) for module in SHARED_WITH_NODES)

    assert not offenders('nodes', surplus)


@pytest.mark.parametrize('ring', ROOMS)
def test_a_room_imports_only_from_rooms_before_it(ring):
    place = {room: number for number, rooms in enumerate(ROOMS[ring]) for room in rooms}
    upwards = []
    for file, name in imports_of(ring):
        room, _, rest = name.removeprefix(f'{PACKAGE}.{ring}.').partition('.')
        here = file.split('/')[1]
        if is_below(name, f'{PACKAGE}.{ring}') and here in place and room != here and rest:
            upwards += [f'{file} imports {name}'] if place[room] >= place[here] else []
    assert not upwards


@pytest.mark.parametrize('ring', ROOMS)
def test_the_rooms_fit_on_a_glance(ring):
    entries = {path.name for path in (SOURCES / ring).iterdir()} - {'__pycache__', '__init__.py'}
    assert entries == {room for rooms in ROOMS[ring] for room in rooms}
    assert len(entries) <= MOST_ROOMS


def circle_among(modules: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle: those left when what imports none of the others is taken away."""
    left = modules
    while leaves := {name for name, needed in left.items() if not needed & left.keys()}:
        left = {name: needed for name, needed in left.items() if name not in leaves}
    while roots := left.keys() - set().union(*left.values()):
        left = {name: needed for name, needed in left.items() if name not in roots}
    return sorted(left)


def test_a_circle_of_imports_is_found():
    chain = {'a': {'b', 'math'}, 'b': {'c'}, 'c': set()}
    assert circle_among(chain) == []
    assert circle_among({**chain, 'b': {'c', 'd'}, 'd': {'b'}, 'e': {'d'}}) == ['b', 'd']


def test_no_modules_import_each_other_in_a_circle():
    """Imports within functions and for types count, too."""
    sources = [*SOURCES.rglob('*.py'), *(ROOT / STUDIES).rglob('*.py')]
    files = {'.'.join(file.relative_to(ROOT).with_suffix('').parts): file for file in sources}
    files = {name.removesuffix('.__init__'): file for name, file in files.items()}
    modules = {name: {part for full in imported(file.read_text()) for part in (full, full.rpartition('.')[0])}
               for name, file in files.items()}  # fmt: skip
    assert not circle_among(modules)


BYTES_OF_MESSAGES = re.compile(
    r"""(?<!messages\.)\bcdr\b | import\ struct\b | unpack_from | \.pack\( | (from|to)_bytes\( | b'\\(x00|0)
    | ENCAPSULATION | _ENDIAN | (SECONDS|LENGTH|FRAME)_AT\b | \bnumbers_at\b | \bstruct_(at|of)\b | \blaid_out\b""",
    re.VERBOSE | re.IGNORECASE,
)
CONTAINERS = {f'offline/bags/{name}.py' for name in ('mcap_reader', 'mcap_writer', 'block_reader')}
"""They lay out the records of MCAP, in which a message is bytes."""


def bytes_of_messages(source: str) -> list[str]:
    """Lines of a source about the bytes of messages."""
    return [line for line in source.splitlines() if BYTES_OF_MESSAGES.search(line)]


def test_what_a_source_says_about_the_bytes_of_messages_is_found():
    for source in (
        'import struct\n', 'x = int.from_bytes(data[12:16])\n', "head = b'\\x00\\x01'\n", '# aligned as in CDR\n',
        'from seal_friction_ros.core.messages.layouts import FRAME_AT\n',
    ):  # fmt: skip
        assert bytes_of_messages(source)
    assert not bytes_of_messages('from seal_friction_ros.core.messages.coder import decode\n')


def test_no_file_outside_the_room_of_the_messages_knows_where_a_number_of_a_message_stands():
    files = {file.relative_to(SOURCES).as_posix(): file.read_text() for file in SOURCES.rglob('*.py')}
    known = {file: lines for file, source in files.items() if (lines := bytes_of_messages(source))}
    room = {file for file in known if file.startswith('core/messages/')}
    assert room
    assert {file: known[file] for file in known.keys() - room - CONTAINERS} == {}


def test_nodes_do_no_arithmetic_with_numpy():
    assert not offenders('nodes', lambda name: name.split('.')[0] in THIRD_PARTY_OF_CORE)


def test_the_yaml_door_knows_only_core():
    own = [name for _, name in imports_of('files') if is_below(name, PACKAGE)]
    assert own
    assert all(is_below(name, f'{PACKAGE}.core') for name in own)


def test_the_python_interface_stands_on_core_and_offline_and_only_commands_on_it():
    face = f'{PACKAGE}.api'
    assert not [name for name in imported((SOURCES / 'api.py').read_text()) if is_below(name, f'{PACKAGE}.nodes')]
    everything = [(file, name) for file in SOURCES.rglob('*.py') for name in imported(file.read_text())]
    users = {file.relative_to(SOURCES).as_posix() for file, name in everything if is_below(name, face)}
    assert users - {'__init__.py'}
    assert all(file.startswith('offline/commands/') for file in users - {'__init__.py'})


@pytest.mark.parametrize('ring', ['core', 'offline', 'nodes', 'files'])
def test_imports_are_written_in_full(ring):
    assert not offenders(ring, lambda name: name.startswith('.'))
