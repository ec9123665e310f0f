"""The exported C library in this process: messages in, answers as bytes out."""

import ctypes
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

from paths import ROOT

from seal_friction_ros.core.estimation.configuration import Configuration
from seal_friction_ros.core.estimation.pipeline import PipelineParameters, PipelineState
from seal_friction_ros.core.messages.coder import encode, type_of
from seal_friction_ros.offline.bags.actuator_bag import first_snapshot, open_actuator
from seal_friction_ros.offline.export.c_library import ANSWERS, sources
from seal_friction_ros.offline.export.c_types import fields_of, snake

_NUMBERS = {float: ctypes.c_double, int: ctypes.c_int64, bool: ctypes.c_bool}


@cache
def struct_of(kind: Any) -> Any:
    """The struct of C for a record."""
    if kind in _NUMBERS:
        return _NUMBERS[kind]
    members = [(name, struct_of(each)) for name, each in fields_of(kind).items()]
    return type(kind.__name__, (ctypes.Structure,), {'_fields_': members})


def to_struct(record: Any) -> Any:
    """A record of Python in C."""
    kind = type(record)
    values = (getattr(record, name) for name in fields_of(kind))
    return struct_of(kind)(*(each if type(each) in _NUMBERS else to_struct(each) for each in values))


def to_record(kind: Any, struct: Any) -> Any:
    """Inverse of `to_struct`."""
    if kind in _NUMBERS:
        return struct
    return kind(**{name: to_record(each, getattr(struct, name)) for name, each in fields_of(kind).items()})


def first_configuration(bag: str) -> Configuration:
    """Configuration at the beginning of a reference bag."""
    source = open_actuator(ROOT / 'bags' / bag)
    first = first_snapshot(source.path, source.messages(), source.topics.configuration)
    assert first is not None
    configuration: Configuration = first.configurations['']
    return configuration


class CEstimator:
    """One estimator of an exported library."""

    def __init__(self, parameters: PipelineParameters, folder: Path, name: str = 'seal_friction') -> None:
        for file, text in sources(parameters, '{}', name).items():
            (folder / file).write_text(text)
        subprocess.run(['make', '-s', '-C', str(folder), 'lib', 'CFLAGS=-O1 -Werror'], check=True)
        self.library, self.name = ctypes.CDLL(str(folder / f'lib{name}.so')), name
        self.state, self._answers = struct_of(PipelineState)(), struct_of(ANSWERS)()
        self.call('init')

    def call(self, function: str, *arguments: Any, returns: Any = None) -> Any:
        """Call a function of the library on the state."""
        called = getattr(self.library, f'{self.name}_{function}')
        called.restype = returns
        return called(ctypes.byref(self.state), *arguments)

    def receive(self, message: Any, received: int, sent: int, frame_id: bytes = b'') -> list[tuple[str, bytes]]:
        """Answers to a message, as `pipeline.answered` gives them."""
        times = ctypes.c_int64(received), ctypes.c_int64(sent)
        function = f'receive_{snake(type(message).__name__)}'
        arguments = to_struct(message), *times, ctypes.byref(self._answers)
        assert self.call(function, *arguments, returns=ctypes.c_bool)
        return self._encoded(frame_id)

    def step(self, sample: Any) -> list[tuple[str, bytes]]:
        """Answers to a sample of a loop."""
        arguments = ctypes.byref(to_struct(sample)), ctypes.byref(self._answers)
        assert self.call('step', *arguments, returns=ctypes.c_bool)
        return self._encoded(b'')

    def known(self) -> PipelineState:
        """The state as a record of Python."""
        state: PipelineState = to_record(PipelineState, self.state)
        return state

    def _encoded(self, frame_id: bytes) -> list[tuple[str, bytes]]:
        found = []
        for name, kind in fields_of(ANSWERS).items():
            if kind is not bool and getattr(self._answers, f'has_{name}'):
                record = to_record(kind, getattr(self._answers, name))
                found.append((type_of(record), encode(record, frame_id)))
        return found
