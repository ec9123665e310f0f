"""Reader of one untrusted SQLite file of a rosbag2 bag: plain tables only, no views, no journal files.

Ours, since ``rosbags`` computes whatever columns a database has, reads values of any size, and leaves the order of
equal times open.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from seal_friction_ros.core.messages.cdr import ENCODING
from seal_friction_ros.offline.bags.mcap_reader import LARGEST_CHUNK, BagMessage, Channel
from seal_friction_ros.offline.bags.mcap_writer import Description

_TOPICS = 'SELECT id, name, type FROM topics'
_COUNTS = 'SELECT topic_id, count(*) FROM messages GROUP BY topic_id'
_MESSAGES = 'SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id'
_DEFINITIONS = 'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
_HAS_DEFINITIONS = "SELECT count(*) FROM sqlite_schema WHERE name = 'message_definitions'"
_MOST_DEFINITIONS = 10_000
_LONGEST_NAME = 1024  # characters of a topic or a type


def file_channels(path: Path) -> list[tuple[Channel, int]]:
    """Channels and their numbers of messages. A file of Humble and before has no definitions.

    Raises ValueError if it is not such a database, sqlite3.Error if it is damaged; `file_messages` likewise.
    """
    with _opened(path) as database:
        counts = {number: int(count) for number, count in database.execute(_COUNTS)}
        definitions = {}
        if database.execute(_HAS_DEFINITIONS).fetchone() != (0,):
            _check_plain(database, 'message_definitions')
            rows = database.execute(_DEFINITIONS).fetchmany(_MOST_DEFINITIONS)
            definitions = {row[0]: row[1:] for row in rows if all(isinstance(text, str) for text in row)}
        found = []
        for number, name, type_name in _names(database):
            encoding, text = definitions.get(type_name, ('', ''))
            channel = Channel(name, ENCODING, Description(type_name, encoding, text.encode(), {}))
            found.append((channel, counts.get(number, 0)))
        return found


def file_messages(path: Path) -> Iterator[BagMessage]:
    """Messages in order of log time; no publish times."""
    with _opened(path) as database:
        names = {number: (name, type_name) for number, name, type_name in _names(database)}
        for number, log_time, data in database.execute(_MESSAGES):
            if number not in names or not isinstance(log_time, int) or not isinstance(data, bytes):
                raise ValueError(f'a message of topic {number!r} at {log_time!r} is invalid')
            yield BagMessage(*names[number], log_time, data)


def file_ends(path: Path) -> list[int]:
    """Last log time [ns]."""
    with _opened(path) as database:
        return [int(time or 0) for (time,) in database.execute('SELECT max(timestamp) FROM messages')]


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(f'{path.resolve().as_uri()}?mode=ro&immutable=1', uri=True)) as database:
        try:
            database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_CHUNK)
            database.execute('PRAGMA trusted_schema = OFF')
            for table in ('topics', 'messages'):
                _check_plain(database, table)
            yield database
        except MemoryError:  # SQLite raises it for damaged sizes, without allocating
            raise ValueError('a size in it is invalid') from None


def _check_plain(database: sqlite3.Connection, table: str) -> None:
    """Refuse views, virtual tables and computed columns, since reading them may not end."""
    stored = "SELECT count(*) FROM sqlite_schema WHERE name = ? AND type = 'table' AND rootpage > 0"
    computed = 'SELECT count(*) FROM pragma_table_xinfo(?) WHERE hidden'
    if database.execute(stored, (table,)).fetchone() != (1,) or any(*database.execute(computed, (table,))):
        raise ValueError(f'no plain table of {table} in it')


def _names(database: sqlite3.Connection) -> Iterator[tuple[int, str, str]]:
    for number, *names in database.execute(_TOPICS):
        if not all(isinstance(name, str) and name.isprintable() and len(name) <= _LONGEST_NAME for name in names):
            raise ValueError(f'topic {number!r} has no valid name or type')
        yield number, names[0], names[1]
