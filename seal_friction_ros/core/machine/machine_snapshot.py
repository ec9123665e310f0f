"""Everything that the next answer of a machine depends on besides the messages to come, as one text.

It holds the mapping file, and of each actuator the snapshot of its configuration and state and what the newest
messages held. A bag begins with it, so that it replays without any other file. The definitions of the message types
are in the bag beside the messages.
"""

import json
from collections.abc import Mapping
from typing import Any

from seal_friction_ros.core.estimation.configuration import Configuration, Snapshot, parse_snapshot, snapshot_text
from seal_friction_ros.core.foundation.documents import parse_json
from seal_friction_ros.core.machine.machine import (
    ActuatorState,
    Machine,
    MachineState,
    make_machine,
    memory_document,
    parse_memory,
)
from seal_friction_ros.core.machine.machine_file import MachineFile, parse_machine
from seal_friction_ros.core.machine.message_fields import Definition

_WHERE = 'configuration: machine'


def machine_text(document: Mapping[str, Any], machine: Machine, state: MachineState) -> str:
    """Snapshot as JSON; equal snapshots give equal text. Numbers of the state are hexadecimal, NaN included.

    Args:
        document: Mapping file of the machine.
        machine: Made from it.
        state: Its state.
    """
    actuators = {}
    for actuator, known in zip(machine.actuators, state.actuators, strict=True):
        snapshot = json.loads(snapshot_text(Snapshot(actuator.configuration, known.pipeline)))
        memory = memory_document(known.memory)
        actuators[actuator.name] = {'snapshot': snapshot, 'memory': memory, 'force': known.force.hex()}
    return json.dumps({'machine': document, 'actuators': actuators}, allow_nan=False)


def is_machine_text(text: str) -> bool:
    """Whether the text of a configuration is that of a machine."""
    try:
        document = parse_json(text, _WHERE)
    except ValueError:
        return False
    return isinstance(document, dict) and 'machine' in document


def machine_of_text(text: str) -> MachineFile:
    """Mapping file in a snapshot.

    Raises:
        ValueError: It is not valid.
    """
    return parse_machine(_document(text)['machine'], _WHERE)


def actuator_text(text: str, name: str) -> str:
    """Configuration and state of one actuator in a snapshot, as the text of `configuration.snapshot_text`.

    Raises:
        ValueError: The text is no snapshot of a machine with this actuator.
    """
    try:
        return json.dumps(_document(text)['actuators'][name]['snapshot'], sort_keys=True, allow_nan=False)
    except (TypeError, LookupError) as error:
        raise ValueError(f'{_WHERE}: no snapshot of {name} in it: {type(error).__name__}: {error}') from None


def parse_machine_text(text: str, definitions: Mapping[str, Definition]) -> tuple[Machine, MachineState]:
    """Machine and state from the text of `machine_text`.

    Args:
        text: JSON.
        definitions: Of the type of each topic, see `machine.make_machine`.

    Raises:
        ValueError: The text is not such a snapshot, or a value in it is not valid.
    """
    file, given = machine_of_text(text), _document(text)['actuators']
    try:
        snapshots = {name: parse_snapshot(json.dumps(one['snapshot'])) for name, one in given.items()}
        configurations: dict[str, Configuration] = {name: one.configuration for name, one in snapshots.items()}
        machine = make_machine(file, configurations, definitions)
        states = [
            ActuatorState(
                snapshots[actuator.name].state,
                parse_memory(given[actuator.name]['memory']),
                float.fromhex(given[actuator.name]['force']),
            )
            for actuator in machine.actuators
        ]
    except (TypeError, AttributeError, LookupError, OverflowError) as error:
        raise ValueError(f'{_WHERE}: not the JSON of a snapshot: {type(error).__name__}: {error}') from None
    return machine, MachineState(tuple(states))


def _document(text: str) -> Any:
    document = parse_json(text, _WHERE)
    if not isinstance(document, dict) or not {'machine', 'actuators'} <= document.keys():
        raise ValueError(f'{_WHERE}: not the JSON of a snapshot: no machine and actuators in it')
    return document
