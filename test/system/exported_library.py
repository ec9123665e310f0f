"""The exported C library against compiled replay: ``python test/system/exported_library.py [--messages 1000000]``.

A row for each actuator: random messages of a rod with sensor faults, among them late ones, and how many answers differ
from those of `compiled_pipeline` in a byte. Then the builds: gcc and clang (package ziglang) with all warnings as
errors, the sanitizers, and valgrind if there is one.
"""

import hashlib
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
from core.estimation.test_compiled_pipeline import ACTUATORS, TYPES, in_memory, noisy, receipts, with_seals
from harness.c_library import CEstimator
from harness.campaign import parser_of, tell

from seal_friction_ros.core.estimation.compiled_pipeline import receive_all
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, init
from seal_friction_ros.core.messages.coder import decode
from seal_friction_ros.offline.export.c_library import example_samples, sources

BLOCK = 20_000  # messages
GCC, CLANG = ['CC=gcc', 'CXX=g++'], ['CC={} -m ziglang cc', 'CXX={} -m ziglang c++']
CLANG = [text.format(sys.executable) for text in CLANG]
BUILDS = {
    'gcc': [*GCC, 'CFLAGS=-O2 -Werror', 'CXXFLAGS=-O2 -Werror'],
    'gcc -O3': [*GCC, 'CFLAGS=-O3 -Werror', 'CXXFLAGS=-O3 -Werror'],
    'clang': [*CLANG, 'CFLAGS=-O2 -Werror', 'CXXFLAGS=-O2 -Werror'],
    'address and undefined behaviour': [
        *GCC, *(f'{name}=-O1 -g -Werror -fsanitize=address,undefined -fno-sanitize-recover=all'
                for name in ('CFLAGS', 'CXXFLAGS')),
    ],
}  # fmt: skip


def blocks(messages: int) -> Iterator[Any]:
    """Messages, their times of receipt and of sending."""
    for seed in range(-(-messages // BLOCK)):
        pieces = noisy(BLOCK // 4, seed)
        times = [1_000_000_000 * 100 * seed + received for received in receipts(pieces)]
        sent = [received - (40_000_000 if i % 50 == 7 else 0) for i, received in enumerate(times)]
        yield pieces, times, sent


def compared(name: str, parameters: PipelineParameters, messages: int, folder: Path) -> dict[str, Any]:
    """Messages, answers, and how many of these differ from compiled replay."""
    library, state, done, answers, differing = CEstimator(parameters, folder, name), init(parameters), 0, 0, 0
    for pieces, times, sent in blocks(messages):
        state, found = receive_all(parameters, state, in_memory(pieces, times, sent))
        places = zip(*(column.tolist() for column in found[1:]), strict=True)
        for (kind, data), received, left, (a, b, c, d) in zip(pieces, times, sent, places, strict=True):
            expected = [found.data[first : first + size].tobytes() for first, size in ((a, b), (c, d)) if size]
            got = [data for _, data in library.receive(decode(TYPES[kind], data), received, left, b'rod')]
            answers, differing = answers + len(got), differing + (got != expected)
        done += len(pieces)
    same = repr(library.known()) == repr(state)
    return {'messages': done, 'answers': answers, 'differing': differing, 'same state': same}


def built(name: str, options: list[str], folder: Path) -> dict[str, Any]:
    """What the examples print in one build; both languages alike."""
    for file, text in sources(with_seals(ACTUATORS['default']), '{}', 'rod').items():
        (folder / file).write_text(text)
    (folder / 'example.csv').write_text(example_samples())
    subprocess.run(['make', '-s', 'clean'], cwd=folder, check=True)
    languages = ('c',) if name == 'clang' else ('c', 'cpp')  # clang of ziglang compiles its C++ library first: minutes
    examples = [f'example_{language}' for language in languages]
    subprocess.run(['make', '-s', 'lib', *examples, *options], cwd=folder, check=True)
    runs = [[f'./{example}', 'example.csv'] for example in examples]
    if name == 'gcc' and shutil.which('valgrind'):
        runs.append(['valgrind', '-q', '--error-exitcode=9', '--leak-check=full', *runs[0]])
    printed = {subprocess.run(run, cwd=folder, check=True, capture_output=True).stdout for run in runs}
    first = sorted(printed)[0]
    digest = hashlib.sha256(first).hexdigest()[:8]  # one for all builds
    return {'runs': len(runs), 'lines': first.count(b'\n'), 'different outputs': len(printed), 'digest': digest}


def main() -> None:
    """Compare, build and print."""
    arguments = parser_of(__doc__ or '', messages=(1_000_000, 'messages for each actuator')).parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases = {'default': {}, 'others': {'presliding': True}}
        found = {case: compared(case, with_seals(ACTUATORS[case], **changes), arguments.messages, folder)
                 for case, changes in cases.items()}  # fmt: skip
        tell(found, as_json=arguments.json, title='C against compiled replay')
        tell({case: built(case, options, folder) for case, options in BUILDS.items()}, as_json=arguments.json)


if __name__ == '__main__':
    main()
