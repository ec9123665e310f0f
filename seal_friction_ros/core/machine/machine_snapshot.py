"""Everything that the next answer of a machine depends on besides the messages to come, as one text.

It holds the mapping file, and of each actuator the snapshot of its configuration and state and what the newest
messages held. A bag begins with it, so that it replays without any other file. The definitions of the message types
are in the bag beside the messages. With the built-in mapping, the text is the snapshot of the only actuator, as in
bags from before there were machines.
"""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

from seal_friction_ros.core.estimation.configuration import (
    Configuration,
    Recorded,
    Snapshot,
    first_snapshot,
    parse_snapshot_document,
    snapshot_document,
    snapshot_text,
)
from seal_friction_ros.core.foundation.documents import parse_json
from seal_friction_ros.core.machine.machine import (
    ActuatorState,
    Machine,
    MachineState,
    Memory,
    first_memory,
    make_machine,
    memory_document,
    parse_memory,
)
from seal_friction_ros.core.machine.machine_file import MachineFile, own_file, parse_machine
from seal_friction_ros.core.messages.definitions import Definition

_WHERE = 'configuration: machine'


class ActuatorSnapshot(NamedTuple):
    """Everything that the next answer of one actuator depends on."""

    snapshot: Snapshot
    memory: Memory | None = None  # None: before the first message, and with the built-in mapping, which has none
    force: float = 0.0  # [N] newest feed-forward


class MachineSnapshot(NamedTuple):
    """Everything that the next answer of a machine depends on."""

    file: MachineFile
    actuators: Mapping[str, ActuatorSnapshot]  # by name

    @property
    def configurations(self) -> dict[str, Configuration]:
        """Name of each actuator -> its configuration."""
        return {name: one.snapshot.configuration for name, one in self.actuators.items()}

    @property
    def tells_sending(self) -> bool:
        """Whether a bag that begins with it tells when messages were sent, see `Configuration.tells_sending`."""
        return any(configuration.tells_sending for configuration in self.configurations.values())

    @property
    def version(self) -> int:
        """Version of the algorithm that made it."""
        return min(one.snapshot.version for one in self.actuators.values())

    @property
    def is_replayed(self) -> bool:
        """Whether the answers in its bag are replayed, so that they did not act."""
        return any(one.snapshot.recorded is not None for one in self.actuators.values())

    def replayed(self, override: Configuration | None) -> 'MachineSnapshot':
        """The same in a bag of a replay: with the settings that acted, and the configuration used if there is one."""
        return MachineSnapshot(self.file, {name: _replayed(one, override) for name, one in self.actuators.items()})


def _replayed(given: ActuatorSnapshot, override: Configuration | None) -> ActuatorSnapshot:
    configuration, state, _, recorded = given.snapshot
    acted = recorded or Recorded(configuration.feedforward)
    return given._replace(snapshot=Snapshot(override or configuration, state, recorded=acted))


def own_snapshot(snapshot: Snapshot) -> MachineSnapshot:
    """Snapshot of a machine with the built-in mapping."""
    return MachineSnapshot(own_file(snapshot.configuration.selection), {'': ActuatorSnapshot(snapshot)})


def first_of_replay(configuration: Configuration) -> MachineSnapshot:
    """Snapshot at the beginning of the replay of a bag that has none: nobody knows what acted."""
    return own_snapshot(first_snapshot(configuration)._replace(recorded=Recorded(None)))


def snapshot_of(machine: Machine, state: MachineState) -> MachineSnapshot:
    """Snapshot of a running machine."""
    actuators = {
        actuator.name: ActuatorSnapshot(Snapshot(actuator.configuration, known.pipeline), known.memory, known.force)
        for actuator, known in zip(machine.actuators, state.actuators, strict=True)
    }
    return MachineSnapshot(machine.file, actuators)


def machine_of(
    snapshot: MachineSnapshot, definitions: Mapping[str, Definition], topics: Mapping[str, str] | None = None
) -> tuple[Machine, MachineState]:
    """Machine and state of a snapshot; ``topics`` -> message types replace those of the built-in mapping.

    Arguments and errors otherwise as of `make_machine`.
    """
    file = snapshot.file if topics is None else snapshot.file._replace(topics=topics)
    machine = make_machine(file, snapshot.configurations, definitions)
    states = []
    for actuator in machine.actuators:
        known = snapshot.actuators[actuator.name]
        states.append(ActuatorState(known.snapshot.state, known.memory or first_memory(actuator), known.force))
    return machine, MachineState(tuple(states))


def machine_text(snapshot: MachineSnapshot) -> str:
    """Snapshot as JSON; equal snapshots give equal text. Numbers of the state are hexadecimal, NaN included."""
    if snapshot.file.document is None:
        return snapshot_text(snapshot.actuators[''].snapshot)
    actuators = {
        name: {
            'snapshot': snapshot_document(one.snapshot),
            'memory': memory_document(one.memory) if one.memory is not None else None,
            'force': one.force.hex(),
        }
        for name, one in snapshot.actuators.items()
    }
    return json.dumps({'machine': snapshot.file.document, 'actuators': actuators}, allow_nan=False)


def parse_machine_text(text: str) -> MachineSnapshot:
    """Snapshot from the text of `machine_text`; ValueError if it is none, or a value in it is not valid."""
    document = parse_json(text, 'configuration')
    if not isinstance(document, dict) or not {'machine', 'actuators'} & document.keys():
        return own_snapshot(parse_snapshot_document(document))
    if not {'machine', 'actuators'} <= document.keys():
        raise ValueError(f'{_WHERE}: not the JSON of a snapshot: no machine and actuators in it')
    file = parse_machine(document['machine'], _WHERE)
    try:
        given = document['actuators']
        return MachineSnapshot(file, {actuator.name: _actuator(given[actuator.name]) for actuator in file.actuators})
    except (TypeError, AttributeError, LookupError, OverflowError) as error:
        raise ValueError(f'{_WHERE}: not the JSON of a snapshot: {type(error).__name__}: {error}') from None


def _actuator(document: Any) -> ActuatorSnapshot:
    memory = document['memory']
    return ActuatorSnapshot(
        parse_snapshot_document(document['snapshot']),
        None if memory is None else parse_memory(memory),
        float.fromhex(document['force']),
    )
