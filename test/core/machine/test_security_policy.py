"""The policy of a machine allows what its mapping file names and nothing else."""

from xml.etree import ElementTree

import yaml
from harness.machines import BENCH, EXCAVATOR, parsed

from seal_friction_ros.core.machine.machine_file import parse_machine
from seal_friction_ros.core.machine.security_policy import security_policy


def allowed(file, kind='topics', right='subscribe') -> list[str]:
    policy = ElementTree.fromstring(security_policy(file, 'a -- b').encode())  # noqa: S314  our own text
    (profile,) = policy.iter('profile')
    return [one.text for part in profile.iter(kind) if part.get(right) == 'ALLOW' for one in part]


def test_the_node_hears_its_inputs_and_the_clock_once_each():
    assert sorted(allowed(parsed(EXCAVATOR))) == ['/a', '/b', '/clock', '/joint_states', '/set']
    with_ambient = parse_machine(
        yaml.safe_load(BENCH) | {
            'topics': yaml.safe_load(BENCH)['topics'] | {'/weather': 'sensor_msgs/msg/FluidPressure'},
            'ambient_pressure': '/weather',
        },
        'robot.yaml',
    )  # fmt: skip
    assert '/weather' in allowed(with_ambient)


def test_the_node_publishes_the_answers_of_each_actuator_or_one_for_all_and_the_commands():
    each = allowed(parsed(EXCAVATOR), right='publish')
    assert {f'{name}/friction_estimate' for name in ('boom', 'arm', 'bucket')} < set(each)
    assert each.count('/effort') == 1
    assert '~/friction' not in each
    together = allowed(parse_machine(yaml.safe_load(EXCAVATOR) | {'answers': 'together'}, 'x'), right='publish')
    assert '~/friction' in together
    assert 'boom/friction_estimate' not in together
    without = allowed(parsed(BENCH), right='publish')
    assert set(without) - set(each) == {'axis/friction_estimate', 'axis/friction_feedforward'}


def test_a_service_is_allowed_by_its_name_without_wildcards():
    services = allowed(parsed(EXCAVATOR), 'services', 'reply')
    assert '~/start_recording' in services
    assert not [name for name in services if '*' in name]
