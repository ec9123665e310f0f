"""The reference program of the spool-valve paper, from the configuration of the simulator."""

from paths import ROOT

from seal_friction_ros.core.servo.motions import Trapezoid
from seal_friction_ros.files import read_yaml


def spool_cycles(distance: float) -> Trapezoid:
    """Wave of ``config/programs/spool_cycles_*.yaml`` with a stroke of ``distance`` [m]."""
    path = ROOT / f'config/programs/spool_cycles_{distance * 1e3:.1f}mm.yaml'.replace('.', '_', 1)
    parameters = read_yaml(path)['/servo_simulator']['ros__parameters']
    assert parameters['wave'] == 'trapezoid'
    assert parameters['trapezoid']['distance'] == distance
    return Trapezoid(**parameters['trapezoid'])
