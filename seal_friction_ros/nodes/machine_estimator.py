"""``machine_estimator``: the node of a machine with messages of any type, by a mapping file, see `core.machine`."""

import sys
from typing import Any

from seal_friction_ros.core.estimation.node_options import MACHINE_ESTIMATOR_PARAMETERS
from seal_friction_ros.nodes import estimator_node


class MachineEstimator(estimator_node.EstimatorNode):
    """`EstimatorNode` under its name, with its parameters."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('machine_estimator', MACHINE_ESTIMATOR_PARAMETERS, **kwargs)


def main() -> int:
    """Run the node: ``machine_estimator --ros-args -p machine:=robot.yaml``."""
    return estimator_node.main(MachineEstimator)


if __name__ == '__main__':
    sys.exit(main())
