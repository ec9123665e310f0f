"""``friction_estimator``: the node of one actuator, with the built-in mapping of the topics of this project."""

import sys
from typing import Any

from seal_friction_ros.core.estimation.node_options import FRICTION_ESTIMATOR_PARAMETERS
from seal_friction_ros.nodes import estimator_node


class FrictionEstimator(estimator_node.EstimatorNode):
    """`EstimatorNode` under its name, with its parameters."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('friction_estimator', FRICTION_ESTIMATOR_PARAMETERS, **kwargs)


def main() -> int:
    """Run the node: ``friction_estimator --ros-args -p seals:=[...] --params-file FILE``."""
    return estimator_node.main(FrictionEstimator)


if __name__ == '__main__':
    sys.exit(main())
