"""README and docs are true: tables follow from the code, commands run, figures are there and made by a command."""

import os
import re
import signal
import subprocess
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from typing import Any

import demo
import make_docs
import pytest
import yaml
from harness.processes import free_domain, graph_environment
from harness.spin_nodes import SpunNodes, ros_context
from paths import ROOT
from rclpy.duration import Duration
from rclpy.node import Node
from seal_friction_msgs.msg import FrictionFeedForward
from std_msgs.msg import Header

from seal_friction_ros.core.estimation.node_options import FRICTION_ESTIMATOR_PARAMETERS
from seal_friction_ros.core.messages.layouts import INPUTS
from seal_friction_ros.core.messages.records import Limited, Status
from seal_friction_ros.core.servo.simulator_options import SERVO_SIMULATOR_PARAMETERS
from seal_friction_ros.nodes.estimator_diagnostics import EstimatorDiagnostics
from seal_friction_ros.nodes.graph_watch import GraphFindings
from seal_friction_ros.offline.replay.replay import replay

TIMEOUT = 120.0  # [s] ends a command that hangs
PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').glob('*.md'))]
README = (ROOT / 'README.md').read_text()


def commands(kind: str, page: str = README) -> list[str]:
    """Lines of the blocks of one kind in a page, by default the README."""
    blocks = re.findall(rf'```bash{kind}\n(.*?)```', page, re.DOTALL)
    return [line for block in blocks for line in block.splitlines()]


PLAIN = [line for line in commands('') if not line.startswith(('make ', 'colcon ', 'source '))]


def link_tree(folder: Path) -> None:
    """The tree as a reader has it, in a folder of its own, so that commands may write."""
    for name in ('.venv', 'bags', 'bench', 'config', 'data', 'msg_defs', 'resource', 'seal_friction_ros', 'test'):
        (folder / name).symlink_to(ROOT / name)
    for name in ('package.xml', 'setup.py', 'setup.cfg'):
        (folder / name).write_bytes((ROOT / name).read_bytes())


@pytest.fixture(scope='module')
def checkout(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp('checkout')
    link_tree(folder)
    (folder / 'build').mkdir()
    return folder


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """The tree in a folder of its own, where nothing is built."""
    link_tree(tmp_path)
    return tmp_path


def run(command: str, folder: Path, timeout: float = TIMEOUT) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ['bash', '-c', command],
        cwd=folder,
        env=graph_environment(free_domain()),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


@contextmanager
def running(command: str, folder: Path, environment: dict[str, str], log: Path) -> Iterator[None]:
    """Run a command while the block runs, then end it by SIGINT; its exit code has to be 0."""
    words = command.replace('.venv/bin', str(ROOT / '.venv' / 'bin')).split()
    with log.open('w') as output, subprocess.Popen(words, cwd=folder, env=environment, stderr=output) as process:
        try:
            yield
        finally:
            process.send_signal(signal.SIGINT)
            code = process.wait(TIMEOUT)
    assert code == 0, log.read_text()


def wait_until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


QUICK_SEARCH = ' --amplitude 5e-4 --frequency 25 --hold-time 0.05 --friction-error 0 --delay-error 0'


def shortened(command: str, folder: Path) -> str:
    """A command of the README with a task that takes seconds instead of minutes."""
    if ' oring ms28775_114 ' in command:
        case = yaml.safe_load((ROOT / 'config' / 'oring' / 'ms28775_114.yaml').read_text())
        (folder / 'build' / 'coarse.yaml').write_text(yaml.safe_dump(case | {'numerics': {'lines': 9}}))
        return command.replace(' ms28775_114 ', ' build/coarse.yaml ')
    return command + QUICK_SEARCH if ' tune ' in command else command


SLOW = (' tune ', ' servo ', ' identify ', ' oring ')


def is_slow(command: str) -> bool:
    return any(name in command for name in SLOW)


def check_commands(chosen: list[str], checkout: Path) -> None:
    for command in chosen:
        result = run(shortened(command, checkout), checkout)
        expected = (0, 1) if ' compare ' in command else (0,)
        assert result.returncode in expected, f'{command}: {result.stderr}'


def test_every_quick_command_of_the_readme_runs(checkout: Path):
    quick = [command for command in PLAIN if not is_slow(command)]
    assert len(quick) >= 8
    check_commands(quick, checkout)


def test_the_python_of_the_readme_runs(checkout: Path):
    (code,) = re.findall(r'```python\n(.*?)```', README, re.DOTALL)
    result = run(f'.venv/bin/python - <<"EOF"\n{code}EOF', checkout)
    friction, largest = map(float, result.stdout.split())
    assert 0.0 < friction < largest


def test_the_readme_is_short():
    assert len(README.split()) <= 900


@pytest.mark.long  # every one of these commands has tests of its own
def test_every_slow_command_of_the_readme_runs(workspace: Path):
    (workspace / 'build').mkdir()
    chosen = [command for command in PLAIN if is_slow(command) or ' import thesis ' in command]
    assert len(chosen) == len(SLOW) + 2
    check_commands(chosen, workspace)


def test_the_recipe_for_ci_passes_with_the_seal_of_the_bag_and_fails_with_another(checkout: Path):
    *before, compare = commands(' ci', (ROOT / 'docs' / 'recording.md').read_text())
    for command in (*before, compare):
        assert run(command, checkout).returncode == 0, command
    _, other = (one.replace('ms28775_114.', 'ms28775_114_table.').replace('/ci', '/other') for one in before)
    assert run(other, checkout).returncode == 0
    assert run(compare.replace('/ci', '/other'), checkout).returncode == 1


def test_the_command_that_proposes_the_next_readings_runs(checkout: Path):
    page = (ROOT / 'docs' / 'identification.md').read_text()
    (command,) = (line for line in commands('', page) if ' --next ' in line)
    result = run(f'.venv/bin/{command}', checkout)
    assert result.returncode == 0, result.stderr
    assert (checkout / 'next.csv').read_text().startswith('# seal friction data sheet')


def test_the_node_runs_as_the_readme_says_and_records(checkout: Path):
    *settings, command = commands(' live')
    environment = graph_environment(free_domain())
    environment |= dict(setting.removeprefix('export ').split('=') for setting in settings)
    log = checkout / 'build' / 'live.log'
    with running(command, checkout, environment, log):
        wait_until(lambda: list(checkout.glob('build/bags/*/metadata.yaml')) and 'estimating' in log.read_text())


def test_the_servo_on_the_desk_runs_as_the_readme_says_and_gets_its_feed_forward(checkout: Path):
    domain, feedforwards = free_domain(), []
    simulator, estimator = (command.replace('build/bags', 'build/desk') for command in commands(' desk'))
    environment, logs = graph_environment(domain), [checkout / f'build/desk_{i}.log' for i in range(2)]
    with (
        running(simulator, checkout, environment, logs[0]),
        running(estimator, checkout, environment, logs[1]),
        ros_context(domain) as context,
    ):
        listener = Node('listener', context=context)
        listener.create_subscription(FrictionFeedForward, 'friction_feedforward', feedforwards.append, 100)
        assert SpunNodes(context, listener).spin_until(lambda: len(feedforwards) > 500)
        listener.destroy_node()
    (bag,) = (path.parent for path in checkout.glob('build/desk/*/metadata.yaml'))
    verdict = replay(bag)
    assert verdict.identical
    assert verdict.recorded_feedforwards > 500


def test_the_subscriber_for_controllers_takes_a_fresh_force_and_0_n_after_50_ms():
    (code,) = re.findall(r'```python\n(.*?)```', (ROOT / 'docs' / 'controllers.md').read_text(), re.DOTALL)
    page: dict[str, Any] = {}
    exec(code, page)  # noqa: S102  our own page
    with ros_context() as context:
        nodes = controller, sender = (Node('controller', context=context), Node('sender', context=context))
        taken: list[FrictionFeedForward] = []
        feedforward = page['FeedForward'](controller)
        controller.create_subscription(FrictionFeedForward, 'friction_feedforward', taken.append, 10)
        publisher = sender.create_publisher(FrictionFeedForward, 'friction_feedforward', 10)
        spun = SpunNodes(context, *nodes)
        spun.connect()

        def send(force: float, age: float) -> int:
            stamp = sender.get_clock().now() - Duration(seconds=age)
            publisher.publish(FrictionFeedForward(header=Header(stamp=stamp.to_msg()), force=force))
            return stamp.nanoseconds

        def is_taken() -> bool:
            send(12.0, 0.0)
            return spun.spin_until(lambda: feedforward.force() == 12.0, 0.02)

        assert feedforward.force() == 0.0
        wait_until(is_taken)
        last = send(12.0, 0.0)
        wait_until(lambda: spun.spin_until(lambda: feedforward.force() == 0.0, 0.02))
        assert sender.get_clock().now().nanoseconds - last > page['OLDEST']
        for late in (0.06, -0.1):
            for _ in range(5):
                send(7.0, late)
            count = len(taken)
            assert spun.spin_until(lambda before=count: len(taken) >= before + 5)
            assert feedforward.force() == 0.0
        for node in nodes:
            node.destroy_node()


def test_the_commands_of_the_live_view_print_an_address_that_answers(checkout: Path):
    lines = [*commands(' monitor'), *commands(' monitor', (ROOT / 'docs' / 'monitor.md').read_text())]
    assert len(lines) == 4
    for command in lines:
        words = command.replace('.venv/bin', str(ROOT / '.venv' / 'bin')).split()
        environment = graph_environment(free_domain())
        with subprocess.Popen(words, cwd=checkout, env=environment, stdout=subprocess.PIPE, text=True) as process:
            address = process.stdout.readline().split()[1]
            try:
                with urllib.request.urlopen(address, timeout=TIMEOUT) as answer:  # noqa: S310  our own server
                    assert b'<title>Seal friction: monitor</title>' in answer.read()
            finally:
                process.send_signal(signal.SIGINT)
                assert process.wait(TIMEOUT) == 0


SKIP_MESSAGES = '--packages-skip seal_friction_msgs'


@pytest.mark.parametrize(
    'options', [SKIP_MESSAGES, pytest.param('', marks=pytest.mark.long)], ids=['messages of .venv', 'all']
)
def test_the_workspace_builds_and_runs_as_the_readme_says(workspace: Path, options: str):
    """The messages take a minute: `tools/setup.sh` has built them with colcon; here colcon finds them."""
    build, source = (line for line in commands('') if line.startswith(('colcon ', 'source ')))
    (ros_run,) = (line for line in commands(' ros') if line.startswith('ros2 run'))
    prefix = os.environ.get('AMENT_PREFIX_PATH', str(ROOT / '.venv'))
    exports = f'export PATH={ROOT}/.venv/bin:$PATH AMENT_PREFIX_PATH={prefix} CMAKE_PREFIX_PATH={prefix}'
    cmake = f'--cmake-args -DPython3_EXECUTABLE={ROOT}/.venv/bin/python -DBUILD_TESTING=OFF'
    fast = 'export CFLAGS=-O0 CXXFLAGS=-O0'
    result = run(f'{exports}; {fast}; {build} {options} {cmake}', workspace, 10 * TIMEOUT)
    assert result.returncode == 0, result.stderr
    assert 'ignoring unknown package' not in result.stderr
    node = ros_run.replace('ros2 run seal_friction_ros ', 'install/seal_friction_ros/lib/seal_friction_ros/')
    (workspace / 'node.sh').write_text(f'{exports}; {source}; exec {node}\n')
    log = workspace / 'node.log'
    with running('bash node.sh', workspace, graph_environment(free_domain()), log):
        wait_until(lambda: '[left_actuator.friction_estimator]: estimating' in log.read_text())


def test_services_named_in_the_readme_are_those_of_the_node():
    (call,) = (line for line in commands(' ros') if line.startswith('ros2 service call'))
    source = (ROOT / 'seal_friction_ros' / 'nodes' / 'estimator_node.py').read_text()
    assert call.split()[3] == '/left_actuator/friction_estimator/start_recording'
    assert "('start_recording', " in source
    assert "create_service(Trigger, f'~/{service}'" in source
    assert call.split()[4] == 'std_srvs/srv/Trigger'


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_tables_are_those_of_the_code(page: Path):
    assert make_docs.filled(page.read_text()) == page.read_text()


def test_every_measured_figure_has_the_command_that_makes_it_with_commit_and_date():
    """Where there is a digit between two headings there is a command, and one stands above each table."""
    sections = re.split(r'^#+ .*$', make_docs.MEASURED_PAGE.read_text(), flags=re.MULTILINE)[2:]
    for section in sections:
        assert not re.search(r'\d', section) or make_docs.COMMAND.search(section), section
        assert section.count('<!-- measured') == len(make_docs.MEASURED.findall(section)), section
        for found in make_docs.COMMAND.finditer(section):
            date.fromisoformat(found['date'])
            for script in re.findall(r'\S+\.py', found['command']):
                assert (ROOT / script).is_file(), script


def test_every_script_of_the_measured_figures_prints_json():
    for script in {found['script'] for found in make_docs.COMMAND.finditer(make_docs.MEASURED_PAGE.read_text())}:
        if script.endswith('.py'):
            assert re.search(r'--json|parser_of\(', (ROOT / script).read_text()), script


def test_readme_and_docs_have_at_most_38000_words():
    pages = [ROOT / 'README.md', *(ROOT / 'docs').glob('*.md')]
    assert sum(len(page.read_text().split()) for page in pages) <= 38_000


def test_measuring_again_writes_table_commit_and_date_and_leaves_the_others(tmp_path: Path):
    bench = tmp_path / 'bench.py'
    bench.write_text('print(\'{"one": {"us": 1.2345, "deep": {"x": 2}}, "two": {"us": 3.0, "deep": {"x": [4, 5]}}}\')')
    block = '`python {} --fast` (0123abcd, 2020-01-01)\n\n<!-- measured{} -->\nold\n<!-- end -->\n'
    other = block.format('bench/step.py', '')
    text = make_docs.measured_again(block.format(bench, ': deep: x') + other, str(bench), 'fedc3210')
    table = '|  | deep: x |\n|---|---|\n| one | 2 |\n| two | 4, 5 |'
    head = f'`python {bench} --fast` (fedc3210, {time.strftime("%Y-%m-%d")})'
    assert text == f'{head}\n\n<!-- measured: deep: x -->\n{table}\n<!-- end -->\n{other}'
    assert make_docs.figures_table({'a': 1.23456, 'b': 2}, ['a']) == '| figure | value |\n|---|---|\n| a | 1.23 |'
    assert make_docs.figures_table([{'rate': 5, 'ok': True}]) == '| rate | ok |\n|---|---|\n| 5 | True |'
    with pytest.raises(ValueError, match=r'bench/none.py: no table of measured.md is of it'):
        make_docs.measured_again(other, 'bench/none.py', 'fedc3210')


def test_the_parameter_file_of_the_simulator_lists_those_of_the_code():
    text = make_docs.SIMULATOR_FILE.read_text()
    assert make_docs.filled_parameter_file(text) == text


@pytest.mark.parametrize('page', [*PAGES, ROOT / 'CHANGELOG.rst'], ids=lambda page: page.name)
def test_parameters_with_a_prefix_exist(page: Path):
    groups = (*FRICTION_ESTIMATOR_PARAMETERS, *SERVO_SIMULATOR_PARAMETERS)
    prefixes = '|'.join({re.escape(group.prefix) for group in groups if group.prefix})
    named = set(re.findall(rf'`((?:{prefixes})\w+)', page.read_text()))
    assert named <= {name for group in groups for name in group.names()}


def test_parameters_of_the_configuration_are_those_of_the_docs():
    """Names and defaults; the bounds are checked where the file is loaded."""
    text = (ROOT / 'config' / 'friction_estimator.yaml').read_text()
    values = yaml.safe_load(text)['/**']['ros__parameters']
    for prefix in ('feedforward', 'adaptation'):
        values |= {f'{prefix}.{name}': value for name, value in values.pop(prefix).items()}
    defaults = {
        name: group.record_type.__dataclass_fields__[field].default
        for group in FRICTION_ESTIMATOR_PARAMETERS
        for name, field in group.names().items()
    }
    for name, value in values.items():
        assert (tuple(value) if isinstance(value, list) else value) == defaults[name], name


def test_keys_of_the_diagnostics_and_status_bits_are_in_the_docs():
    report = EstimatorDiagnostics().report(False, False, GraphFindings(dict.fromkeys(INPUTS, 0), [], [], {}))
    page = (ROOT / 'docs' / 'interfaces.md').read_text()
    for item in report.values:
        key = re.sub('|'.join(INPUTS), 'INPUT', item.key)
        key = re.sub('|'.join(rf'\b{bit.name}\b' for bit in (*Status, *Limited)), 'BIT', key)
        assert f'`{key}`' in page, item.key
    for bit in Status:
        assert f'`{bit.name}`' in (ROOT / 'docs' / 'degradation.md').read_text(), bit


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_links_and_figures_are_there(page: Path):
    for file, anchor in re.findall(r'\]\((?!http)([^)#]*)#?([^)]*)\)', page.read_text()):
        target = page.parent / file if file else page
        assert target.exists(), file
        assert not anchor or anchor in anchors(target), f'{file}#{anchor}'


def anchors(page: Path) -> set[str]:
    """Anchors of the headings of a page, as GitHub makes them."""
    headings = re.findall(r'^#+ (.*)$', page.read_text(), re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-') for heading in headings}


def test_every_figure_is_made_by_a_command_and_shown():
    source = (ROOT / 'tools' / 'make_figures.py').read_text()
    docs = '\n'.join(page.read_text() for page in PAGES)
    for figure in (ROOT / 'docs' / 'figures').iterdir():
        assert f'figures/{figure.name})' in docs
        assert f"'{figure.name}'" in source or f'--figure docs/figures/{figure.name}' in docs


def test_the_units_are_in_the_table_of_the_demo():
    headings = [str(column.header) for column in (*demo.friction_table([]).columns, *demo.run_table([]).columns)]
    assert {'pressure [bar]', 'measured [N]', 'p99 [us]'} <= set(headings)


def test_the_demo_says_when_the_machine_was_too_busy():
    figures = {'missed ticks': '30', 'ticks': '20000'}
    assert demo.busy_text(0.2, 2, figures) == ''
    assert '1.9 processes ran before the demo began, on 2 cores' in demo.busy_text(1.9, 2, figures)
    assert 'missed 1.5 % of its ticks' in demo.busy_text(0.2, 2, {'missed ticks': '300', 'ticks': '20000'})
