"""Calls on a Dask cluster of processes on the loopback interface: the same bytes, and one line for what goes wrong."""

import json
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import pytest
from harness.compensation import compensating
from harness.dask_cluster import ENVIRONMENT, DaskCluster, begun, dask_cluster, wait_for
from harness.example_bags import write_inputs, write_recorded
from paths import ROOT

from seal_friction_ros.offline.bags.actuator_bag import find_topics
from seal_friction_ros.offline.commands.main import main
from seal_friction_ros.offline.replay import replay as replay_module
from seal_friction_ros.offline.replay.replay import replay
from seal_friction_ros.offline.replay.shared_replay import verify_stretches
from seal_friction_ros.offline.work.cluster import Cluster, completed_on
from seal_friction_ros.offline.work.outcome import Outcome

distributed = pytest.importorskip('distributed')
COMMAND = [sys.executable, '-m', 'seal_friction_ros']
CASE = """name: tiny
motion: {cycles: 1}
numerics: {cells: 32, time_step: 50.0e-3}
study: {solid_shear_stresses: [1.0e+6, 2.0e+6]}
map: {velocity_min: 2.0e-2, velocity_max: 1.0e-1, velocities: 3, pressure_max: 1.0e+5, pressures: 2}
unknown: {seal.solid_shear_stress: {factor: 2.0}}
"""
RIG = """name: rig
time: {column: 0, unit: ms}
chamber_a: {terms: [{column: 1, unit: bar}]}
chamber_b: {constant: 0.0}
force_sum: {terms: [{column: 2, unit: N}]}
velocity: {terms: [{column: 3, unit: mm/s}]}
"""


@pytest.fixture(scope='module')
def cluster(tmp_path_factory) -> Iterator[DaskCluster]:
    with dask_cluster(tmp_path_factory.mktemp('cluster')) as running:
        yield running


@pytest.fixture(scope='module')
def doomed(tmp_path_factory) -> Iterator[DaskCluster]:
    """A cluster whose processes tests may kill: a worker, and at last the scheduler."""
    with dask_cluster(tmp_path_factory.mktemp('doomed')) as running:
        yield running


def started(*words: str, folder: Path = ROOT) -> subprocess.Popen[str]:
    return subprocess.Popen(
        words, cwd=folder, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def done(*words: str, folder: Path = ROOT) -> tuple[int, str, str]:
    process = started(*words, folder=folder)
    out, errors = process.communicate(timeout=120.0)
    return process.returncode, out, errors


PROGRAM = """
import json, os, sys
from functools import partial
from pathlib import Path
from harness import dask_cluster as calls
from seal_friction_ros.offline.work import cluster
from seal_friction_ros.offline.work.cluster import Cluster
from seal_friction_ros.offline.work.executor import run_all, try_all
from seal_friction_ros.offline.work.finished_parts import Part, run_parts
workers = Cluster(sys.argv[1]) if '://' in sys.argv[1] else int(sys.argv[1])
folder = Path(sys.argv[2])
try:
    print(json.dumps({}))
except ValueError as error:
    sys.exit(str(error))
"""


def program(expression: str, workers: str, folder: Path) -> list[str]:
    """A program that prints the value of an expression."""
    return [sys.executable, '-c', PROGRAM.replace('{}', expression), workers, str(folder)]


def last_line(errors: str) -> str:
    assert errors.count('\n') == 1, errors
    return errors


# -- the same bytes ---------------------------------------------------------------------------------------------------


def test_bags_are_replayed_to_the_same_bytes_on_a_cluster_also_by_relative_paths(cluster, tmp_path):
    (tmp_path / 'nothing').mkdir()
    bags = [write_inputs(tmp_path / f'bäg {i}', 40 + 7 * i, compensating()) for i in range(5)]
    names = [bag.name for bag in (*bags, write_recorded(tmp_path), tmp_path / 'nothing')]
    words = [*COMMAND, 'replay', '--verify', *names, '--json']
    here = done(*words, '--workers', '1', folder=tmp_path)
    assert here == done(*words, '--scheduler', cluster.address, folder=tmp_path)
    assert (here[0], here[2].count('nothing: not a rosbag2 bag')) == (2, 1)
    assert [bag.get('identical') for bag in json.loads(here[1])['bags']] == [False] * 5 + [True, None]


def test_one_bag_is_shared_by_the_workers_of_a_cluster(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr(replay_module, 'STATE_PERIOD', 0.5)
    replay(write_inputs(tmp_path / 'inputs', 300, compensating()), out=tmp_path / 'bag')
    monkeypatch.chdir(tmp_path)
    shared = verify_stretches(Path('bag'), find_topics(Path('bag')), Cluster(cluster.address))
    assert shared == replay(tmp_path / 'bag')
    assert shared.identical


@pytest.mark.long
def test_health_and_a_fleet_are_the_same_on_a_cluster(cluster, tmp_path):
    (tmp_path / 'bags').mkdir()
    for number in range(2):
        (tmp_path / f'{number}').mkdir()
        bag = write_recorded(tmp_path / f'{number}', compensating())
        shutil.copytree(bag, tmp_path / 'bags' / f'bag {number}')
    (tmp_path / 'bags' / 'garbage.mcap').write_bytes(b'garbage')
    health = ['health', 'bags/bag 0', 'bags/bag 1', 'bags/garbage.mcap', '--out', 'page.html']
    fleet = ['fleet', 'bags', '--out', 'page.html', '--work', 'work']
    for words in (health, fleet):
        found = []
        for workers in (['--scheduler', cluster.address], ['--workers', '1']):
            said = done(*COMMAND, *words, '--json', *workers, folder=tmp_path)
            page = (tmp_path / 'page.html').read_text()
            assert ' '.join(workers) in page
            found.append((said, page.replace(' '.join(workers), '')))
            (tmp_path / 'page.html').unlink()
            for made in ('work', 'page_figures'):
                shutil.rmtree(tmp_path / made, ignore_errors=True)
        assert found[0] == found[1]
        assert found[0][0][0] == 2
        assert found[0][0][2].count('seal_friction: bags/garbage.mcap: ') == 1


def test_a_url_is_read_where_the_worker_is(cluster, tmp_path):
    bag = write_recorded(tmp_path)
    here, there = f'local://{bag}', 'memory://only/the/command/has/this'
    words = ['replay', here, there, '--verify', '--scheduler', cluster.address]
    program = 'import fsspec, sys; from seal_friction_ros.offline.commands.main import main; '
    program += "fsspec.filesystem('memory').pipe_file('/only/the/command/has/this/metadata.yaml', b''); "
    code, out, errors = done(sys.executable, '-c', f'{program}sys.exit(main(sys.argv[1:]))', *words)
    assert (code, out) == (2, f'{here}: 300 estimates and 200 feed-forwards, identical to the byte\n')
    assert last_line(errors) == f'seal_friction: {there}: there is no such file or bag\n'


def test_logs_are_imported_to_the_same_bytes_on_a_cluster(cluster, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for number in range(3):
        rows = [f'{20 * row},{2 + number},{row % 7},{row % 5 - 2}\n' for row in range(50)]
        (tmp_path / f'log {number}.csv').write_text(''.join(rows))
    (tmp_path / 'bad.csv').write_text('no numbers\n')
    (tmp_path / 'rig.yaml').write_text(RIG)
    logs, found = ['log 0.csv', 'bad.csv', 'log 1.csv', 'log 2.csv'], []
    for workers in (['--workers', '1'], ['--scheduler', cluster.address]):
        said = (main(['import', 'log', *logs, '--rig', './rig.yaml', '--out', 'bags', *workers]), capsys.readouterr())
        bags = (tmp_path / 'bags').rename(tmp_path / f'bags {len(found)}')
        found.append((said, {path.relative_to(bags): path.read_bytes() for path in bags.rglob('*') if path.is_file()}))
    assert found[0] == found[1]
    (code, texts), files = found[0]
    assert (code, texts.err.count('seal_friction: bad.csv: '), len(files)) == (2, 1, 6)
    assert not list(tmp_path.glob('.*'))


@pytest.mark.long
@pytest.mark.parametrize('words', [['study'], ['map', '--uncertain', '2']])
def test_a_study_and_a_map_are_the_same_on_a_cluster(words, cluster, tmp_path):
    case, seal = tmp_path / 'tiny.yaml', tmp_path / 'seal.yaml'
    case.write_text(CASE)
    into = ['--seal-file', str(seal)] if 'map' in words else []
    found = []
    for workers in (['--workers', '1'], ['--scheduler', cluster.address]):
        code, out, errors = done(*COMMAND, 'ehl', words[0], str(case), *words[1:], *into, *workers, '--json')
        assert code == 0, errors
        found.append((out, seal.read_bytes() if into else b''))
    assert found[0] == found[1]
    assert bool(found[0][1]) == bool(into)


@pytest.mark.long
def test_an_identification_is_the_same_on_a_cluster(cluster, tmp_path):
    rows = ['pressure_bar,friction_N,direction']
    for bar in (1, 3, 5, 7):
        rows += [f'{bar},{(2.0 + 0.5 * bar) * (1.0 + 0.01 * ((bar * k) % 3))},extend' for k in range(4)]
    (tmp_path / 'table.csv').write_text('\n'.join(rows))
    found = []
    for workers in (['--workers', '1'], ['--scheduler', cluster.address]):
        said = done(*COMMAND, 'identify', 'table.csv', '--out', 'seal.yaml', '--json', *workers, folder=tmp_path)
        found.append((said, (tmp_path / 'seal.yaml').read_bytes()))
    assert found[0] == found[1]
    assert found[0][0][0] == 0, found[0][0][2]


def test_of_calls_for_one_result_the_first_error_counts_and_a_bug_is_seen(cluster, tmp_path):
    calls = "[partial(calls.square, 2), partial(calls.fail, 'no'), calls.bug, partial(calls.square, 3)]"
    code, out, errors = done(*program(f"try_all('some', {calls}, workers)", cluster.address, tmp_path))
    assert code == 0, errors
    outcomes = json.loads(out)
    assert [outcome[0] for outcome in outcomes] == [{'square': 4}, None, None, {'square': 9}]
    assert outcomes[1][1] == 'no'
    assert 'ended before it was done' in outcomes[2][1]
    assert "KeyError: 'a bug'" in errors
    several = "[partial(calls.fail, f'no {number}') for number in range(1, 50)]"
    assert done(*program(f"run_all('all', {several}, workers)", cluster.address, tmp_path)) == (1, '', 'no 1\n')


def test_a_notification_of_a_call_that_was_taken_before_does_not_lead_into_the_wait_of_dask(cluster, monkeypatch):
    class NotifiedLate(distributed.as_completed):
        """Each wait ends as if notified, soon."""

        def __init__(self, **options):
            super().__init__(**options)
            wait = self.thread_condition.wait
            self.thread_condition.wait = lambda _: wait(0.01) or True

        def __next__(self):
            assert self.has_ready(), 'this wait does not look at workers and scheduler'
            return super().__next__()

    monkeypatch.setattr(distributed, 'as_completed', NotifiedLate)
    calls = [partial(time.sleep, 0.2), partial(time.sleep, 0.0)]
    done = dict(completed_on(Cluster(cluster.address), calls, stop_at_error=False))
    assert done == {number: Outcome(None, '') for number in range(2)}


# -- what ends amid work ----------------------------------------------------------------------------------------------


def test_a_worker_that_is_killed_amid_work_costs_time_only(doomed, tmp_path):
    expression = "run_all('', [partial(calls.square_once_open, folder, number) for number in range(5)], workers)"
    running = started(*program(expression, doomed.address, tmp_path))
    wait_for(lambda: len(begun(tmp_path)) == 2)
    killed = begun(tmp_path)[0]
    next(worker for worker in doomed.workers if worker.pid == killed[1]).kill()
    for number in range(5):
        (tmp_path / f'open {number}').touch()
    out, errors = running.communicate(timeout=120.0)
    assert running.returncode == 0, errors
    assert json.loads(out) == [{'square': number**2} for number in range(5)]
    (again,) = [process for number, process in begun(tmp_path)[1:] if number == killed[0]]
    assert again != killed[1]


@pytest.mark.long  # `test_a_worker_that_is_killed_amid_work_costs_time_only` is its short form
def test_a_call_that_ends_every_worker_has_crashed_and_costs_its_own_result_only(tmp_path):
    environment = {**ENVIRONMENT, 'DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES': '0'}
    with dask_cluster(tmp_path, environment=environment) as cluster:
        expression = "try_all('', [calls.die, partial(calls.square, 2)], workers)"
        code, out, errors = done(*program(expression, cluster.address, tmp_path))
    assert (code, errors) == (0, '')
    crashed, other = json.loads(out)
    assert 'ended before it was done' in crashed[1]
    assert other == [{'square': 4}, '']


def test_a_scheduler_that_is_killed_ends_in_one_line_and_finished_parts_are_not_computed_again(doomed, tmp_path):
    parts = "[Part(f'key{n}', ('square',), partial(calls.square_once_open, folder, n)) for n in range(4)]"
    expression = f"run_parts('', {parts}, workers, folder / 'work')"
    for number in (0, 1):
        (tmp_path / f'open {number}').touch()
    running = started(*program(expression, doomed.address, tmp_path))
    wait_for(lambda: (tmp_path / 'work' / 'key0.json').exists() and (tmp_path / 'work' / 'key1.json').exists())
    doomed.scheduler.kill()
    _, errors = running.communicate(timeout=120.0)
    assert running.returncode == 1
    assert last_line(errors).startswith(f'{doomed.address}: the scheduler has gone before the work was done')
    for number in (2, 3):
        (tmp_path / f'open {number}').touch()
    (tmp_path / 'begun').unlink()
    code, out, errors = done(*program(expression, '1', tmp_path))
    assert (code, errors) == (0, '')
    assert json.loads(out) == [{'square': number**2} for number in range(4)]
    assert [number for number, _ in begun(tmp_path)] == [2, 3]


def test_an_interrupt_ends_the_command_without_a_word(cluster, tmp_path):
    expression = "run_all('', [partial(calls.square_once_open, folder, 0)], workers)"
    words = program(expression, cluster.address, tmp_path)
    words[2] += 'except KeyboardInterrupt:\n    sys.exit(130)\n'
    running = started(*words)
    wait_for(lambda: begun(tmp_path))
    running.send_signal(2)
    _, errors = running.communicate(timeout=60.0)
    (tmp_path / 'open 0').touch()
    assert (running.returncode, errors) == (130, '')


# -- what cannot be used ----------------------------------------------------------------------------------------------


@contextmanager
def stranger(answer: bytes) -> Iterator[str]:
    """Address of a server that answers every caller with these bytes, or not at all."""
    with socket.create_server(('127.0.0.1', 0)) as server:
        kept = []

        def serve() -> None:
            with suppress(OSError):
                while True:
                    connection, _ = server.accept()
                    kept.append(connection)
                    if answer:
                        connection.sendall(answer)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield f'tcp://127.0.0.1:{server.getsockname()[1]}'
        server.shutdown(socket.SHUT_RDWR)
        thread.join()
        for connection in kept:
            connection.close()


def refused(address: str, folder: Path) -> str:
    """The one line that a command says to an address, with little patience."""
    expression = "setattr(cluster, 'ANSWER_TIME', 2.0) or run_all('', [partial(calls.square, 1)], workers)"
    code, out, errors = done(*program(expression, address, folder))
    assert (code, out) == (1, '')
    assert address in last_line(errors)
    return errors


@pytest.mark.parametrize('answer', [b'', b'HTTP/1.1 400 Bad Request\r\n\r\n' * 9, bytes(range(256)) * 8])
def test_a_stranger_at_the_address_is_one_line(answer, tmp_path):
    with stranger(answer) as address:
        assert 'no Dask scheduler answers within 2 s' in refused(address, tmp_path)


def test_an_address_where_nobody_answers_is_one_line(tmp_path):
    with socket.create_server(('127.0.0.1', 0)) as server:
        address = f'tcp://127.0.0.1:{server.getsockname()[1]}'
    assert 'no Dask scheduler answers within 2 s' in refused(address, tmp_path)


SENSELESS = [
    (['--scheduler', 'garbage'], "'garbage' is no address of a scheduler: write tcp://HOST:PORT"),
    (['--scheduler', 'tcp://127.0.0.1:99999'], 'is no address of a scheduler'),
    (['--scheduler', 'inproc://a:1'], 'is no address of a scheduler'),
    (['--scheduler', 'tcp://a\nb:1'], 'is no address of a scheduler'),
    (['--scheduler', ''], "'' is no address of a scheduler"),
    (['--scheduler', 'tls://127.0.0.1:1'], 'belong together'),
    (['--scheduler', 'tls://127.0.0.1:1', '--scheduler-tls', 'a', 'b', 'c'], 'a: no such file'),
    (['--scheduler-tls', 'a', 'b', 'c'], '--scheduler-tls is only for a --scheduler'),
    (['--retry-failed'], '--retry-failed is only for a --work FOLDER'),
]
"""Options, and what is said to them."""
EACH = """
import json, sys
from seal_friction_ros.offline.commands.main import main
codes = [main(['replay', 'bags/pull_test', 'bags/faults', *options]) for options in json.loads(sys.argv[1])]
print(json.dumps([codes, sorted({'dask', 'distributed'} & set(sys.modules))]))
"""


def test_options_that_make_no_sense_are_one_line_and_load_no_dask():
    code, out, errors = done(sys.executable, '-c', EACH, json.dumps([options for options, _ in SENSELESS]))
    assert (code, json.loads(out)) == (0, [[2] * len(SENSELESS), []])
    for line, (options, said) in zip(errors.splitlines(), SENSELESS, strict=True):
        assert said in line, options


@pytest.mark.long
def test_a_worker_of_another_version_or_with_threads_or_none_at_all_is_one_line(tmp_path):
    other = tmp_path / 'other'
    shutil.copytree(
        ROOT / 'seal_friction_ros', other / 'seal_friction_ros', ignore=shutil.ignore_patterns('__pycache__')
    )
    shutil.copy(ROOT / 'package.xml', other)
    with (other / 'seal_friction_ros' / 'core' / '__init__.py').open('a') as file:
        file.write('\n')
    environment = {**ENVIRONMENT, 'PYTHONPATH': f'{other}:{ROOT / "test"}'}
    with dask_cluster(tmp_path / 'a', workers=1, environment=environment) as cluster:
        text = refused(cluster.address, tmp_path)
        assert 'worker tcp://127.0.0.1' in text
        assert 'install the same version everywhere' in text
    with dask_cluster(tmp_path / 'b', workers=1, threads=2) as cluster:
        assert 'it has 2 threads: start it with --nthreads 1' in refused(cluster.address, tmp_path)
    with dask_cluster(tmp_path / 'c', workers=0) as cluster:
        assert 'it has no worker after 2 s' in refused(cluster.address, tmp_path)


@pytest.mark.long
def test_a_worker_without_the_package_or_with_threads_of_linear_algebra_is_one_line(tmp_path):
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'empty' / 'seal_friction_ros.py').touch()
    without = {**ENVIRONMENT, 'PYTHONPATH': str(tmp_path / 'empty')}
    with dask_cluster(tmp_path / 'a', workers=1, environment=without) as cluster:
        assert 'cannot load this version of seal_friction_ros' in refused(cluster.address, tmp_path)
    several = {**ENVIRONMENT, 'OPENBLAS_NUM_THREADS': '4'}
    with dask_cluster(tmp_path / 'b', workers=1, environment=several) as cluster:
        assert 'start it with OPENBLAS_NUM_THREADS=1' in refused(cluster.address, tmp_path)


def test_a_path_that_only_the_client_has_is_one_line(cluster, tmp_path):
    (tmp_path / 'file').write_text('content')
    opened = "Path('/proc/self/fd') / str(os.dup2(os.open(folder / 'file', os.O_RDONLY), 77))"
    expression = f"run_all('', [partial(calls.size, {opened})], workers)"
    code, out, errors = done(*program(expression, cluster.address, tmp_path))
    assert (code, out) == (1, '')
    assert '/proc/self/fd/77 is on the computer of the command, and not where worker tcp://127.0' in last_line(errors)


@pytest.mark.long
@pytest.mark.skipif(shutil.which('openssl') is None, reason='certificates are made by openssl')
def test_with_certificates_everything_is_encrypted_and_a_foreign_authority_is_refused(tmp_path):
    for name in ('ours', 'theirs'):
        subject = ['-subj', '/CN=localhost', '-days', '2', '-newkey', 'rsa:2048', '-nodes', '-x509']
        out = ['-keyout', str(tmp_path / f'{name}.key'), '-out', str(tmp_path / f'{name}.pem')]
        subprocess.run(['openssl', 'req', *subject, *out], check=True, capture_output=True)
    files = {name: [str(tmp_path / f'{name}.{kind}') for kind in ('pem', 'pem', 'key')] for name in ('ours', 'theirs')}
    names = ('--tls-ca-file', '--tls-cert', '--tls-key')
    options = [word for pair in zip(names, files['ours'], strict=True) for word in pair]
    with dask_cluster(tmp_path / 'cluster', workers=1, options=['--protocol', 'tls', *options]) as cluster:
        assert cluster.address.startswith('tls://')
        words = [*COMMAND, 'replay', 'bags/pull_test', '--verify', '--scheduler', cluster.address, '--scheduler-tls']
        code, out, errors = done(*words, *files['ours'])
        assert (code, errors) == (0, '')
        assert 'identical to the byte' in out
        code, out, errors = done(*words, *files['theirs'])
        assert (code, out) == (2, '')
        assert 'no Dask scheduler answers' in last_line(errors)
