"""First loading of unsheared elements: a branch after a reversal is twice as large (Masing)."""

from seal_friction_ros.core.friction.presliding import NO_ELEMENTS, PreslidingNumbers, element_forces


def initial_loading(numbers: PreslidingNumbers, displacement: float, friction: float) -> float:
    r"""Friction [N] over the first displacement of unsheared elements [m, >= 0], at a constant sliding friction [N].

    .. math:: \Phi(x) = \sum_i \min(k_i x, w_i Y)

    After a reversal at x_0 with a force F_0, :math:`F = F_0 \mp 2 \Phi(|x - x_0| / 2)` (Masing), until the branch meets
    the one that it left (Madelung).
    """
    return element_forces(numbers, NO_ELEMENTS, displacement, friction)[1]
