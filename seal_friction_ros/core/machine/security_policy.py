"""SROS2 policy of the node `machine_estimator` for one machine: its topics and services, without wildcards.

Source: the format of policies, version 0.2.0, of the SROS 2 design (design.ros2.org, "ROS 2 Access Control Policies").
"""

from collections.abc import Iterable
from xml.sax.saxutils import escape

from seal_friction_ros.core.machine.machine_file import MachineFile
from seal_friction_ros.core.messages.layouts import OUTPUTS

_CLOCK = '/clock'  # where use_sim_time is set
_OWN_TOPICS = (
    '~/configuration', '~/health', '~/monitor', '~/transition_event', '/diagnostics', '/parameter_events', '/rosout',
)  # fmt: skip
_SERVICES = (
    'reset_adaptation', 'start_recording', 'stop_recording', 'change_state', 'get_state', 'get_available_states',
    'get_available_transitions', 'get_transition_graph', 'get_type_description', 'describe_parameters',
    'get_parameter_types', 'get_parameters', 'list_parameters', 'set_parameters', 'set_parameters_atomically',
)  # fmt: skip


def security_policy(file: MachineFile, made_by: str) -> str:
    """Policy of the node with a mapping file, without a namespace, as XML; ``made_by`` is its first comment."""
    answers = ['~/friction'] if file.together else [f'{a.name}/{topic}' for a in file.actuators for topic in OUTPUTS]
    commands = dict.fromkeys(actuator.output.topic for actuator in file.actuators if actuator.output)
    parts = [
        *_allowed('topic', 'subscribe', [*(topic for topic in file.topics if topic not in commands), _CLOCK]),
        *_allowed('topic', 'publish', [*answers, *commands, *_OWN_TOPICS]),
        *_allowed('service', 'reply', [f'~/{name}' for name in _SERVICES]),
    ]
    return '\n'.join(
        (
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<!-- {escape(made_by).replace("--", "- -")} -->',
            '<policy version="0.2.0">',
            '  <enclaves>',
            '    <enclave path="/seal_friction/machine_estimator">',
            '      <profiles>',
            '        <profile ns="/" node="machine_estimator">',
            *(f'          {part}' for part in parts),
            '        </profile>',
            '      </profiles>',
            '    </enclave>',
            '  </enclaves>',
            '</policy>',
            '',
        )
    )


def _allowed(kind: str, right: str, names: Iterable[str]) -> list[str]:
    return [f'<{kind}s {right}="ALLOW">', *(f'  <{kind}>{escape(name)}</{kind}>' for name in names), f'</{kind}s>']
