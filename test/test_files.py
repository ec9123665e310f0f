"""YAML files give plain data, valid records, or an error of one line that names the file."""

import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from harness.machines import BENCH, parsed
from hypothesis import given
from hypothesis import strategies as st
from paths import ROOT

from seal_friction_ros.core.estimation.adaptation import AdaptationSettings
from seal_friction_ros.core.estimation.configuration import SealSelection
from seal_friction_ros.core.estimation.estimator import EstimatorSettings
from seal_friction_ros.core.estimation.feedforward import FeedForwardSettings
from seal_friction_ros.files import (
    config_path,
    default_configuration,
    load_configuration,
    load_parameter_file,
    load_seals,
    machine_configurations,
    read_machine,
    read_yaml,
    share_directory,
)
from seal_friction_ros.offline.replay.replay import chosen_configuration

GOOD = (ROOT / 'config' / 'seals' / 'ms28775_114.yaml').read_text()


@pytest.fixture
def written(tmp_path):
    def write(content: str | bytes, name: str = 'file.yaml') -> Path:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def complaint(function, path: Path) -> str:
    text = refusal(function, path)
    assert str(path) in text
    return text


def refusal(function, value) -> str:
    with pytest.raises(ValueError) as refused:
        function(value)
    text = str(refused.value)
    assert '\n' not in text
    return text


# --- YAML ---


def test_plain_data_comes_back_as_written(written):
    text = 'a: 1\nb: [1.5, x, null, true]\nc: {d: 2.0e-3}\n'
    assert read_yaml(written(text)) == {'a': 1, 'b': [1.5, 'x', None, True], 'c': {'d': 2e-3}}


@pytest.mark.parametrize(
    ('content', 'expected'),
    [
        ('a: &x [1]\nb: *x\n', 'aliases (*name) are not allowed'),
        ('a: &x [*x]\n', 'aliases (*name) are not allowed'),
        ('a: 1\na: 2\n', 'a appears twice in one mapping'),
        ('x: {b: 1, c: 2, b: 1}\n', 'b appears twice in one mapping'),
        ('a: [1, 2\n', 'not plain YAML'),
        ('a: b: c\n', 'not plain YAML'),
        ('\tx: 1\n', 'not plain YAML'),
        ('a: 1\n---\nb: 2\n', 'expected a single document'),
        ('{[1]: 2}\n', 'unhashable key'),
        ('a: !!python/object/apply:os.system [ls]\n', 'could not determine a constructor'),
        ('a: !mine 5\n', 'could not determine a constructor'),
        (b'\xff\xfe\x00binary\x80', 'not plain YAML'),
        (b'\x7fELF\x02\x01\x01' + bytes(64), 'not plain YAML'),
        (bytes(range(256)), 'not plain YAML'),
        ('[' * 50_000, 'not plain YAML'),
        ('{a: ' * 10_000, 'not plain YAML'),
        ('- ' * 30_000, 'not plain YAML'),
    ],
    ids=lambda value: repr(value)[:24],
)
def test_a_file_that_is_not_plain_yaml_is_rejected_in_one_line_that_names_the_file(written, content, expected):
    assert expected in complaint(read_yaml, written(content))


def test_nested_aliases_are_rejected(written):
    laughs = 'a: &a [ha]\n' + ''.join(f'{y}: &{y} [{", ".join([f"*{x}"] * 9)}]\n' for x, y in pairwise('abcdefghi'))
    assert 'aliases' in complaint(read_yaml, written(laughs))


def test_a_huge_file_is_rejected_before_parsing(written):
    assert 'larger than 65536 bytes' in complaint(read_yaml, written(b'# ' + b'x' * (1 << 16)))


def test_a_missing_file_and_a_folder_are_rejected(tmp_path):
    assert complaint(read_yaml, tmp_path / 'none.yaml').endswith('No such file or directory')
    assert complaint(read_yaml, tmp_path).endswith('Is a directory')


@given(st.binary(max_size=60) | st.text('{}[]:,-?&*!|>\'"%@`#a1. \n\t', max_size=30).map(str.encode))
def test_any_bytes_are_data_or_a_value_error(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / 'any.yaml'
    path.write_bytes(content)
    try:
        read_yaml(path)
    except ValueError as error:
        reason = str(error)
    else:
        return
    assert reason.startswith(str(path))


# --- names and places ---


def test_a_bare_name_is_a_shipped_file_and_anything_with_a_slash_or_ending_is_a_path():
    assert config_path('seals', 'ms28775_114') == ROOT / 'config' / 'seals' / 'ms28775_114.yaml'
    assert config_path('seals', './x') == Path('x')
    assert config_path('seals', 'x.yaml') == Path('x.yaml')
    assert config_path('seals', '~/x.yaml') == Path.home() / 'x.yaml'


def test_the_share_folder_of_an_install_is_found_above_the_code(tmp_path):
    share = tmp_path / 'share' / 'some_package'
    code = tmp_path / 'lib' / 'python3' / 'site-packages' / 'some_package' / 'code.py'
    share.mkdir(parents=True)
    (share / 'package.xml').write_text('<package><name>some_package</name></package>')
    assert share_directory('some_package', str(code)) == share
    with pytest.raises(FileNotFoundError, match='no share folder of other_package above'):
        share_directory('other_package', str(code))


# --- configurations ---


def load(path: Path):
    return load_configuration(SealSelection((str(path),), ('a',)), EstimatorSettings())


def test_the_default_configuration_is_a_placeholder_with_the_numbers_of_the_thesis():
    configuration = default_configuration()
    assert configuration.has_placeholder
    seals = configuration.parameters().estimator.seals
    assert [(m.seal.name, m.chamber) for m in seals] == [('placeholder', 'a'), ('placeholder', 'b')]
    thesis = load_seals(SealSelection(('ms28775_114', 'ms28775_114')))
    assert [replace(m.seal, name='ms28775_114') for m in seals] == [m.seal for m in thesis]
    assert not load_configuration(SealSelection(('ms28775_114',), ('a',)), EstimatorSettings()).has_placeholder


# --- mounting ---


@pytest.fixture
def seal_file(tmp_path):
    def write(name: str, *chambers: str) -> str:
        path = tmp_path / f'{name}.yaml'
        path.write_text(GOOD + (f'mounting: {{chambers: [{", ".join(chambers)}]}}\n' if chambers else ''))
        return str(path)

    return write


def mounted_on(selection: SealSelection) -> list[tuple[str, str]]:
    configuration = load_configuration(selection, EstimatorSettings())
    mounted = configuration.parameters().estimator.seals
    assert len(mounted) == len(configuration.selection.seals) == len(configuration.seal_documents)
    assert tuple(m.chamber for m in mounted) == configuration.selection.seal_chambers
    return list(
        zip([Path(name).stem for name in configuration.selection.seals], [m.chamber for m in mounted], strict=True)
    )


def test_seals_are_mounted_as_their_files_say_unless_chambers_are_given(seal_file):
    rod, piston = seal_file('rod', 'a', 'a'), seal_file('piston', 'difference')
    assert mounted_on(SealSelection((piston,))) == [('piston', 'difference')]
    assert mounted_on(SealSelection((rod, piston))) == [('rod', 'a'), ('rod', 'a'), ('piston', 'difference')]
    assert mounted_on(SealSelection((rod, piston, rod))) == mounted_on(SealSelection((rod, piston)))
    assert mounted_on(SealSelection((piston,), ('b',))) == [('piston', 'b')]
    assert mounted_on(SealSelection((rod,), ('ambient',))) == [('rod', 'ambient')]


def test_a_chamber_that_is_given_twice_is_refused(seal_file):
    rod = seal_file('rod', 'a')
    assert mounted_on(SealSelection((f'{rod}@b', f'{rod}@ambient'))) == [('rod', 'b'), ('rod', 'ambient')]
    expected = f'seals has {rod}@a and seal_chambers is given: set seal_chambers to [mounting]'
    assert refusal(mounted_on, SealSelection((f'{rod}@a',), ('b',))) == expected


def test_two_seals_without_mounting_are_one_at_each_end_and_others_need_their_chambers(seal_file):
    plain, other, rod = seal_file('plain'), seal_file('other'), seal_file('rod', 'a')
    assert mounted_on(SealSelection((plain, other))) == [('plain', 'a'), ('other', 'b')]
    for seals in ((plain,), (plain, plain, other), (plain, rod)):
        assert f'{plain} has no mounting: give every entry its chamber' in refusal(mounted_on, SealSelection(seals))


def test_a_file_named_more_often_than_it_has_chambers_is_refused(seal_file):
    rod = seal_file('rod', 'a')
    expected = f'seals has {rod} 2 times but its mounting has 1 chambers: name it once, or give every entry'
    assert expected in refusal(mounted_on, SealSelection((rod, rod)))


@pytest.mark.parametrize(
    ('mounting', 'expected'),
    [
        ('{chambers: [c]}', "mounting: Mounting.chambers = ['c']: 'c' is not a, b, difference or ambient"),
        ('{chambers: []}', 'mounting: Mounting.chambers is empty: give one chamber a seal'),
        ('{chambers: a}', "mounting.chambers = 'a' is not a list"),
        ('[a]', 'mounting is not a mapping of names to values'),
        ('{}', 'mounting lacks chambers'),
        ('{chambers: [a], chamber: b}', 'mounting has no chamber: it has chambers; did you mean chambers?'),
    ],
)
def test_a_wrong_mounting_is_refused_also_where_chambers_are_given(written, mounting, expected):
    path = written(f'{GOOD}mounting: {mounting}\n')
    assert expected in complaint(load, path)
    assert expected in refusal(mounted_on, SealSelection((str(path),)))


def test_a_replay_with_a_seal_file_has_as_many_seals_as_the_file_says(seal_file, tmp_path):
    one, plain = seal_file('one', 'a'), seal_file('plain')
    params = tmp_path / 'params.yaml'

    def replayed(seal: str, text: str = '') -> tuple[str, ...]:
        params.write_text(f'/**:\n  ros__parameters: {{{text}}}\n')
        configuration = chosen_configuration(params if text else None, Path(seal))
        return configuration.selection.seal_chambers

    assert replayed(one) == ('a',)
    assert replayed(plain) == ('a', 'b')
    assert replayed(one, 'seals: [x, x, x]') == ('a',)
    for text in ('seals: [x, x], seal_chambers: [b, ambient]', 'seals: [x@b, x@ambient]'):
        assert replayed(one, text) == ('b', 'ambient')


@pytest.mark.parametrize(
    ('content', 'expected'),
    [
        ('', 'a seal file is a mapping of names to values, not NoneType'),
        ('- a\n', 'a seal file is a mapping of names to values, not list'),
        ('just text\n', 'a seal file is a mapping of names to values, not str'),
        (GOOD.replace('stiction: 0.724347', 'stiction: -1'), 'Seal.stiction = -1.0 N is below its lower bound 0.0 N'),
        (GOOD.replace('stiction:', 'sticktion:'), 'physics_based has no sticktion'),
        (GOOD.replace('stiction:', 'sticktion:'), '; did you mean stiction?'),
        (GOOD.replace('law: power_law', 'law: power'), "friction_coefficient: law = 'power' is not one of power_law"),
        (
            GOOD.replace('exponent: 0.562321', 'exponent: 1'),
            'PowerLaw.exponent = 1.0 1 is above its upper bound 0.99 1',
        ),
        (GOOD + 'stiction: 3.0\n', 'stiction appears twice in one mapping'),
        (GOOD.replace('stiction: 0.724347', 'stiction: .nan'), 'Seal.stiction = nan N is not finite'),
    ],
)
def test_an_invalid_seal_file_is_rejected_in_one_line_with_file_and_field(written, content, expected):
    assert expected in complaint(load, written(content))


def test_an_unknown_seal_is_rejected_with_the_path_that_was_tried():
    with pytest.raises(
        ValueError, match=r'config/seals has no no_such_seal: .*there are .*placeholder; name a file by its path'
    ):
        load_configuration(SealSelection(('no_such_seal',), ('a',)), EstimatorSettings())


# --- parameter files ---


def test_a_parameter_file_gives_selection_and_settings_of_any_node_name(written):
    path = written(
        '/ns/some_node:\n  ros__parameters:\n    seals: [x]\n    seal_chambers: [b]\n    stick_velocity: 0\n'
    )
    expected = (
        SealSelection(('x',), ('b',)),
        EstimatorSettings(stick_velocity=0.0),
        FeedForwardSettings(),
        AdaptationSettings(),
    )
    assert load_parameter_file(path) == expected


@pytest.mark.parametrize('content', ['{feedforward: {scale: 0.5}}', '{feedforward.scale: 0.5}'])
def test_settings_of_the_feed_forward_may_be_nested_or_dotted_as_in_ros(written, content):
    path = written(f'/**:\n  ros__parameters: {content}\n')
    assert load_parameter_file(path)[2] == FeedForwardSettings(scale=0.5)


def test_the_shipped_parameter_file_holds_the_defaults():
    expected = (SealSelection(), EstimatorSettings(), FeedForwardSettings(), AdaptationSettings())
    assert load_parameter_file(ROOT / 'config' / 'friction_estimator.yaml') == expected


@pytest.mark.parametrize(
    'others',
    [
        'record: true, record_split_size: 1000000, record_directory: /tmp',
        'autostart: false, realtime_priority: 50',
        'refuse_second_publisher: true',
        'use_sim_time: true, start_type_description_service: false',
        'qos_overrides: {/rod_velocity: {subscription: {depth: 7}}}',
        'qos_overrides./rod_velocity.subscription.depth: 7',
    ],
)
def test_parameters_of_the_node_that_a_replay_does_not_need_are_accepted(written, others):
    path = written(f'/**:\n  ros__parameters: {{{others}, use_stiction: false}}\n')
    expected = (SealSelection(), EstimatorSettings(use_stiction=False), FeedForwardSettings(), AdaptationSettings())
    assert load_parameter_file(path) == expected


def test_later_sections_of_a_parameter_file_override_earlier_ones(written):
    nodes = (
        '/**:\n  ros__parameters: {force_max: 5.0}\n/left/friction_estimator:\n  ros__parameters: {force_max: 7.0}\n'
    )
    assert load_parameter_file(written(nodes))[1].force_max == 7.0


def test_sections_of_other_nodes_in_a_parameter_file_are_ignored(written):
    nodes = '/**:\n  ros__parameters: {force_max: 5.0}\nother:\n  ros__parameters: {force_max: 7.0, gain: 1}\n'
    assert load_parameter_file(written(nodes))[1].force_max == 5.0


@pytest.mark.parametrize(
    ('name', 'expected'),
    [
        ('stick_velocty', 'no parameter stick_velocty (did you mean stick_velocity?)'),
        ('feedforward.scal', '(did you mean feedforward.scale?)'),
        ('feedforward.coulomb_scale', '(replaced by feedforward.scale)'),
        ('feedforward.viscous_friction', '(replaced by velocity_terms of the seal file)'),
        ('scale', '(did you mean feedforward.scale?)'),
        ('feedforward.stick_velocity', '(did you mean stick_velocity?)'),
        ('refuse_second_publishers', '(did you mean refuse_second_publisher?)'),
        ('wave', 'no parameter wave (a parameter of servo_simulator)'),
        ('sensors.delay', '(a parameter of servo_simulator)'),
        ('zzz', 'friction_estimator has no parameter zzz'),
    ],
)
def test_an_unknown_parameter_is_rejected_with_a_suggestion(written, name, expected):
    refusal = complaint(load_parameter_file, written(f'/**:\n  ros__parameters: {{{name}: 0.5}}\n'))
    assert refusal.endswith(expected)


def test_of_thousands_of_unknown_parameters_ten_get_a_hint(written):
    """Comparing every name of a hostile file with all that are known would take minutes."""
    names = ', '.join(f'stick_velocit{number}: 1' for number in range(2500))
    refusal = complaint(load_parameter_file, written(f'/**: {{ros__parameters: {{{names}}}}}'))
    assert 'stick_velocit2499' in refusal
    assert refusal.count('did you mean') == 10


def test_a_pipe_is_rejected_without_waiting(tmp_path):
    os.mkfifo(tmp_path / 'pipe')
    assert complaint(read_yaml, tmp_path / 'pipe').endswith('not a file')


def test_a_link_into_the_source_tree_finds_the_share_folder_of_the_install(tmp_path):
    for prefix, package in (('source', 'outer'), ('install/share/inner', 'inner')):
        (tmp_path / prefix).mkdir(parents=True)
        (tmp_path / prefix / 'package.xml').write_text(f'<name>{package}</name>')
    (tmp_path / 'source' / 'inner.py').touch()
    (tmp_path / 'install' / 'lib').mkdir()
    (tmp_path / 'install' / 'lib' / 'inner.py').symlink_to(tmp_path / 'source' / 'inner.py')
    assert share_directory('inner', str(tmp_path / 'install' / 'lib' / 'inner.py')) == tmp_path / 'install/share/inner'


@pytest.mark.parametrize('content', ['', '5', '[1]', 'a: 5', 'a: {b: 1}', 'a: {ros__parameters: }', 'a: [1]'])
def test_a_file_that_is_not_a_parameter_file_is_rejected(written, content):
    assert 'not a ROS parameter file (NODE: ros__parameters: NAME: VALUE)' in complaint(
        load_parameter_file, written(content)
    )


@pytest.mark.parametrize(
    ('parameters', 'expected'),
    [
        ('{stick_velocity: 5.0}', 'EstimatorSettings.stick_velocity = 5.0 m/s is above its upper bound 1.0 m/s'),
        ('{stick_velocity: fast}', "stick_velocity = 'fast' is not a number"),
        ('{use_stiction: 1}', 'use_stiction = 1 is not true or false'),
        ('{seals: ms28775_114}', "seals = 'ms28775_114' is not a list"),
        ('{seals: [x], seal_chambers: [a, b]}', 'has 2 entries but there are 1 seals'),
        ('{seals: [x@a, y]}', 'give every seal its chamber (NAME@CHAMBER), or none'),
        ('{seals: [x@top]}', "'top' is not a, b, difference or ambient"),
        ('{realtime_priority: 100}', 'StartOptions.realtime_priority = 100  is above its upper bound 99'),
        ('{record_split_size: 5}', 'record_split_size = 5 is too small'),
        ('{refuse_second_publisher: 1}', 'refuse_second_publisher = 1 is not true or false'),
    ],
)
def test_an_invalid_parameter_is_rejected_with_file_field_and_bound(written, parameters, expected):
    assert expected in complaint(load_parameter_file, written(f'/**:\n  ros__parameters: {parameters}\n'))


@pytest.mark.parametrize(
    'content',
    [
        'a: !!int foo', 'a: !!bool foo', 'a: !!float x', 'a: !!map [b]', 'a: !!timestamp x', 'a: 2001-13-45', 'a: 0x_',
        'a: ' + '1' * 5000,
    ],
    ids=lambda content: content[:16],
)  # fmt: skip
def test_a_value_that_contradicts_its_tag_is_rejected_with_the_file(written, content):
    assert 'not plain YAML' in complaint(read_yaml, written(content))


@pytest.mark.parametrize('name', ['~no_such_user_here/x.yaml'])
def test_a_path_of_an_unknown_user_is_rejected_with_its_name(name):
    with pytest.raises(ValueError, match='no_such_user_here'):
        load_configuration(SealSelection((name,), ('a',)), EstimatorSettings())


@pytest.mark.parametrize('parameters', ['ab', '[[stick_velocity, 0.0]]', '{stick_velocity: 1' + '0' * 400 + '}'])
def test_parameters_that_are_not_a_mapping_or_too_large_are_rejected_with_the_file(written, parameters):
    refusal = complaint(load_parameter_file, written(f'/**: {{ros__parameters: {parameters}}}'))
    assert 'ros__parameters' in refusal or 'stick_velocity' in refusal


def test_the_seal_files_of_a_machine_are_relative_to_its_mapping_file(tmp_path, monkeypatch):
    (tmp_path / 'seals').mkdir()
    text = config_path('seals', 'ms28775_114').read_text()
    (tmp_path / 'seals' / 'rod.yaml').write_text(text.replace('name: ', 'name: my_', 1))
    (tmp_path / 'robot.yaml').write_text(BENCH.replace('ms28775_114@a', 'seals/rod.yaml@a', 1))
    monkeypatch.chdir('/')
    file = read_machine(str(tmp_path / 'robot.yaml'))
    (configuration,) = machine_configurations(file, 'robot.yaml').values()
    assert configuration.seal_documents[0]['name'].startswith('my_')
    assert file.actuators[0].selection.seals[1:] == parsed(BENCH).actuators[0].selection.seals[1:]
