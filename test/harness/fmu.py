"""An exported FMU in this process, driven through FMPy."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave


@contextmanager
def running(path: Path) -> Iterator[tuple[Any, dict[str, Any]]]:
    """An instance of an FMU after its initialisation, and its variables by name."""
    description, folder = read_model_description(path), extract(path)
    kind = FMU2Slave if description.fmiVersion == '2.0' else FMU3Slave
    identifier = description.coSimulation.modelIdentifier
    fmu = kind(guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName='one')
    fmu.instantiate()
    if kind is FMU2Slave:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    yield fmu, {variable.name: variable for variable in description.modelVariables}
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(folder)


def put(fmu: Any, variables: dict[str, Any], record: Any) -> None:
    """Set the inputs that are named as fields of a record."""
    names = [name for name in record._fields if name != 'stamp']
    function = fmu.setReal if isinstance(fmu, FMU2Slave) else fmu.setFloat64
    function([variables[name].valueReference for name in names], [getattr(record, name) for name in names])


def got(fmu: Any, variables: dict[str, Any], names: Sequence[str]) -> list[float]:
    """Values of the outputs of these names."""
    of_reals, of_integers = ('getReal', 'getInteger') if isinstance(fmu, FMU2Slave) else ('getFloat64', 'getInt64')
    known = [variables[name] for name in names]
    reals = [each.valueReference for each in known if each.type in ('Real', 'Float64')]
    integers = [each.valueReference for each in known if each.valueReference not in reals]
    values = dict(zip(reals, getattr(fmu, of_reals)(reals), strict=True))
    values |= zip(integers, getattr(fmu, of_integers)(integers), strict=True)
    return [values[each.valueReference] for each in known]
