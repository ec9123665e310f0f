"""Writes test/corpus: small good and evil files from which the fuzzing of each reader starts.

``python tools/make_corpus.py`` writes it anew; the evil ones are each a known way to hurt a reader. Files whose names
begin with ``found_`` were found by fuzzing, and stay.
"""

import sqlite3
import struct
import sys
import tempfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import zstandard
from mcap.writer import CompressionType, Writer

from seal_friction_ros.core.estimation.configuration import first_snapshot, snapshot_text
from seal_friction_ros.core.estimation.pipeline import answered, init
from seal_friction_ros.core.friction.states import FrictionState
from seal_friction_ros.core.messages.coder import decode, encode, encode_text
from seal_friction_ros.core.messages.layouts import (
    CONFIGURATION_TYPE,
    ESTIMATE_TYPE,
    FEEDFORWARD_TYPE,
    FORCE_TYPE,
    POSITION_TYPE,
    PRESSURE_TYPE,
    REFERENCE_TYPE,
    VELOCITY_TYPE,
)
from seal_friction_ros.core.messages.records import (
    FeedForward,
    Force,
    FrictionEstimate,
    Position,
    Pressure,
    ServoReference,
    Velocity,
)
from seal_friction_ros.files import default_configuration
from seal_friction_ros.offline.bags.mcap_reader import MAGIC

CORPUS = Path(__file__).parents[1] / 'test' / 'corpus'
STAMP = 1_500_000_000
MESSAGES = {
    PRESSURE_TYPE: encode(Pressure(STAMP, 2e6, 5e5), b'rod'),
    FORCE_TYPE: encode(Force(STAMP, 20.0), b'rod'),
    VELOCITY_TYPE: encode(Velocity(STAMP, 0.1, b'')),
    POSITION_TYPE: encode(Position(STAMP, 0.01), b'frame'),
    REFERENCE_TYPE: encode(ServoReference(STAMP, 0.01, 0.1, 0.0, b'rod')),
    ESTIMATE_TYPE: encode(FrictionEstimate(STAMP, 40.0, 2.0, 45.0, 40.0, FrictionState.SLIDING, 1, 0, 0.001), b'rod'),
    FEEDFORWARD_TYPE: encode(FeedForward(STAMP, 36.0, 1.0, 0), b'rod'),
    CONFIGURATION_TYPE: encode_text('{}'),
}
_OF_A_BAG = (PRESSURE_TYPE, VELOCITY_TYPE, ESTIMATE_TYPE)
HUGE = 1 << 40  # [bytes]


def mcap(compression: CompressionType = CompressionType.NONE, **options: bool) -> bytes:
    """A whole small file: three chunks, or no chunks at all."""
    file = BytesIO()
    writer = Writer(file, compression=compression, **options)
    writer.start(profile='ros2', library='corpus')
    channels = []
    for type_name in _OF_A_BAG:
        schema = writer.register_schema(type_name, 'ros2msg', b'float64 x')
        channels.append(writer.register_channel('/' + type_name[-8:], 'cdr', schema, {'topic_type_hash': 'RIHS01_0'}))
    for moment in range(3):
        for channel, type_name in zip(channels, _OF_A_BAG, strict=True):
            writer.add_message(channel, moment * 100 + channel, MESSAGES[type_name], moment)
        writer.flush()
    writer.finish()
    return file.getvalue()


def record(opcode: int, content: bytes, length: int | None = None) -> bytes:
    """One record, with a length that may be a lie."""
    return struct.pack('<BQ', opcode, len(content) if length is None else length) + content


def chunk(data: bytes, compression: bytes = b'', unpacked_size: int | None = None, size: int | None = None) -> bytes:
    """A chunk with sizes that may be lies."""
    times_and_sizes = struct.pack('<QQQI', 0, 1 << 61, len(data) if unpacked_size is None else unpacked_size, 0)
    name = struct.pack('<I', len(compression)) + compression
    return record(6, times_and_sizes + name + struct.pack('<Q', size or len(data)) + data)


def evil_mcaps() -> dict[str, bytes]:
    """Small files that claim much."""
    begin = MAGIC + record(1, struct.pack('<I4sI', 4, b'ros2', 0))
    end = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC
    zeros = zstandard.ZstdCompressor().compress(bytes(1 << 28))  # 256 MB in 8 kB
    message = record(5, struct.pack('<HIQQ', 1, 0, 5, 5))
    type_named = record(3, struct.pack('<HI1sII', 1, 1, b't', 0, 0))
    named = type_named + record(4, struct.pack('<HHI2sII', 1, 1, 2, b'/t', 0, 0))
    many = named + 3000 * message
    statistics = record(11, struct.pack('<QHIIIIQQI', 2**63, 9, 9, 9, 9, 9, 0, 9, 2**31))
    return {
        'claims_1_tb_record': begin + record(5, b'', HUGE) + end,
        'claims_1_tb_chunk': begin + chunk(b'x' * 50, unpacked_size=HUGE, size=HUGE) + end,
        'claims_1_tb_unpacked': begin + chunk(zstandard.compress(b'x'), b'zstd', HUGE) + end,
        'zstd_bomb': begin + chunk(zeros, b'zstd', 1 << 28) + end,
        'zstd_bomb_that_lies': begin + chunk(zeros, b'zstd', 1000) + end,
        'message_in_message': begin + named + record(5, struct.pack('<HIQQ', 1, 0, 5, 5) + message) + end,
        'many_empty_messages': begin + chunk(zstandard.compress(many), b'zstd', len(many)) + end,
        'statistics_claim_much': begin + record(15, bytes(4)) + statistics + record(2, bytes(20)) + MAGIC,
        'name_of_4_gb': begin + record(3, struct.pack('<HI', 1, 2**32 - 1)) + end,
        'footer_points_to_itself': begin + record(15, bytes(4)) + record(2, struct.pack('<QQI', 37, 37, 0)) + MAGIC,
        'only_magic': MAGIC,
        'empty': b'',
    }


def metadata() -> dict[str, str]:
    """Texts of metadata.yaml; the file that they name is there."""
    good = (
        'rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n'
        '  relative_file_paths: [bag_0.mcap]\n  compression_format: ""\n  compression_mode: ""\n'
    )
    return {
        'good': good,
        'leads_up': good.replace('bag_0', '../../bag_0'),
        'absolute': good.replace('bag_0.mcap', '/etc/passwd'),
        'device': good.replace('bag_0.mcap', '/dev/zero'),
        'folder': good.replace('bag_0.mcap', '.'),
        'aliases': 'a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\n' + good,
        'deep': '[' * 3000,
        'sexagesimal': f'a: {":".join(["59"] * 2000)}\n' + good,
        'object': '!!python/object/apply:os.system ["true"]',
        'sqlite': good.replace('mcap', 'sqlite3', 1),
        'packed': good.replace('mode: ""', 'mode: message'),
    }


GEOMETRY = (
    'name: a\nstiction: 2.5\nuncertainty: {relative_std: 0.08, absolute_std: 0.3}\nidentified_pressure: [0.0, 6.9e+6]\n'
    'geometry: {section_diameter: 2.69e-3, ring_inner_diameter: 15.54e-3, rod_diameter: 15.875e-3,\n'
    '  gland_diameter: 20.853e-3}\n'
)
SEALS = {  # short, so that a mutation hits something that counts
    'power_law': GEOMETRY + 'coulomb_law: physics_based\n'
    'normal_force: {law: area_deformation_gain, area_deformation_gain: 0.39, radial_force: 9.3}\n'
    'friction_coefficient: {law: power_law, coefficient: 2.1, exponent: 0.56}\n',
    'tables': GEOMETRY + 'coulomb_law: physics_based\n'
    'normal_force: {law: monotone_table, pressures: [0.0, 1.0e+6], normal_forces: [9.0, 90.0]}\n'
    'friction_coefficient: {law: monotone_table, normal_forces: [9.0, 90.0], coefficients: [0.3, 0.1]}\n',
}
RIG = (
    'name: r\nsource: s\nheader: row\nskip_rows: 0\nstart: 1.0\ntime: {column: 0, unit: ms}\n'
    'chamber_a: {terms: [{column: 1, unit: bar}]}\nchamber_b: {constant: 0.0}\n'
    'force_sum: {terms: [{column: 2, unit: lbf, gain: -2.0}]}\n'
)
RIGS = {
    'velocity': RIG + 'velocity: {terms: [{column_name: v, unit: mm/s}]}\n',
    'position': RIG + 'velocity: {terms: [{column: 3, unit: mm}], savitzky_golay: {window: 0.1, largest_gap: 0.05}}\n',
}
LOGS = {
    'commas': 't,p,f,v\n' + ''.join(f'{20 * i},{i % 7}.5,{10 * i},{i}e-1\n' for i in range(12)),
    'spaces': '# remark\nt p f v\n' + ''.join(f'{20 * i}   {i} nan -inf\n' for i in range(8)),
    'evil': '\ufefft;p;f;v\n1e308;2;3;4\n\n1e309;0x1;"3";\'4\'\n' + '9' * 400 + ';1;1;1\n',
}
PARAMETERS = {
    'flat': '/**:\n  ros__parameters:\n    seals: [ms28775_114]\n    seal_chambers: [a]\n    stick_velocity: 0.001\n',
    'nested': 'friction_estimator:\n  ros__parameters:\n    feedforward: {slew_limit: 5.0e+4}\n    record: true\n'
    'other:\n  ros__parameters: {x: 1}\n',
}


def snapshots() -> dict[str, str]:
    """Snapshots at the start and on the way."""
    configuration = default_configuration()
    documents = tuple({k: v for k, v in seal.items() if k != 'source'} for seal in configuration.seal_documents)
    configuration = replace(configuration, seal_documents=documents)
    parameters = configuration.parameters()
    state = init(parameters)
    start = snapshot_text(first_snapshot(configuration))
    for type_name in (PRESSURE_TYPE, FORCE_TYPE, REFERENCE_TYPE, VELOCITY_TYPE):
        record = decode(type_name, MESSAGES[type_name])
        state, _ = answered(parameters, state, record, record.stamp)
    running = snapshot_text(first_snapshot(configuration)._replace(state=state))
    return {
        'start': start,
        'running': running,
        'deep': '[' * 5000,
        'huge_number': '{"a": 1e9999, "b": ' + '9' * 5000 + '}',
    }


_TABLE = 'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)'
_VIEW = (
    'CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) '
    "SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM n"
)


def sqlite() -> dict[str, bytes]:
    """A small rosbag2 file of SQLite, cut down to a few pages, and one with a view without end."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, script in (
            ('good', _TABLE),
            ('view_without_end', _VIEW),
            ('computed_column', _TABLE.replace('BLOB', 'BLOB AS (zeroblob(1000000000))')),
        ):
            path = Path(folder) / f'{name}.db3'
            with sqlite3.connect(path) as database:
                database.execute('PRAGMA page_size = 512')
                database.execute('CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)')
                database.execute(script)
                database.execute('INSERT INTO topics VALUES (1, ?, ?)', ('/v', VELOCITY_TYPE))
                if name == 'good':
                    rows = [(i, 1, i * 10, MESSAGES[VELOCITY_TYPE]) for i in range(5)]
                    database.executemany('INSERT INTO messages VALUES (?, ?, ?, ?)', rows)
            database.close()
            found[name] = path.read_bytes()
    return found


def main() -> int:
    """Write all of it."""
    files = {
        'mcap': {
            'plain': mcap(),
            'no_checksums': mcap(enable_crcs=False),
            'zstd': mcap(CompressionType.ZSTD, enable_crcs=False),
            'lz4': mcap(CompressionType.LZ4, enable_crcs=False),
            'no_chunks': mcap(use_chunking=False),
            'no_summary': mcap(repeat_channels=False, repeat_schemas=False, use_statistics=False),
            'unfinished': mcap()[:900],
            **evil_mcaps(),
        },
        'metadata': metadata(),
        'sqlite': sqlite(),
        'seal': SEALS,
        'rig': RIGS,
        'parameters': PARAMETERS,
        'log': LOGS,
        'snapshot': snapshots(),
        'wire': {type_name.rsplit('/', 1)[-1]: data for type_name, data in MESSAGES.items()},
    }
    for reader, seeds in files.items():
        (CORPUS / reader).mkdir(parents=True, exist_ok=True)
        for name, content in seeds.items():
            (CORPUS / reader / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return 0


if __name__ == '__main__':
    sys.exit(main())
