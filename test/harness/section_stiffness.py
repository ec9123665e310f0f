"""How stiff the section of a seal is along the wall."""

import numpy as np

from seal_friction_ros.core.lubrication.seal_section import SealSection, nothing_around
from seal_friction_ros.core.oring_contact.compliance import small_displacements
from seal_friction_ros.core.oring_contact.equilibrium import unstressed_state


def axial_stiffness(section: SealSection) -> float:
    """Axial force spread over the middle half of the face, over its mean displacement [N/m]."""
    model = section.model
    middle = np.abs(section.place) <= 0.25 * np.ptp(section.place)
    load = np.zeros((model.mesh.nodes.size, 1))
    load[2 * section.face + 1, 0] = middle / middle.sum()
    moved = small_displacements(model, nothing_around(model), unstressed_state(model), load, held=section.held)
    return 1.0 / float(load[:, 0] @ moved[:, 0])
