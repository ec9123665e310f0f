r"""Whether the friction has changed since it was last known well: a cumulative sum over the reversals.

.. math:: S^\pm_k = \max(0,\ S^\pm_{k-1} \pm (z_k - z_0) / \sigma - \kappa)

with z the friction over that of the law at each reversal (`adaptation`), z0 and sigma its mean and standard deviation
over the first `REFERENCE_REVERSALS`. A sum above `THRESHOLD` is a change, which began when the sum was last 0; then a
new reference begins. sigma counts as `LEAST_STD` at least, since a smaller change means nothing, and one reversal
counts as `LARGEST_TERM` at most, so that no single load step is a change.

Source: [Page1954]_; numbers are our choice.
"""

import math
from typing import NamedTuple

from seal_friction_ros.core.foundation.limits import between
from seal_friction_ros.core.messages.records import NEVER

REFERENCE_REVERSALS = 20
LEAST_STD = 0.02  # [-]
ALLOWANCE = 0.5  # [-] kappa, in standard deviations
THRESHOLD = 12.0  # [-] likewise
LARGEST_TERM = 3.0  # [-] likewise


class FrictionChange(NamedTuple):
    """What is known after a reversal."""

    reversals: int = 0  # since the reference began
    reference: float = 0.0  # [-] z0
    squares: float = 0.0  # [-] sum of squared deviations of the reference
    rise: float = 0.0  # S+
    fall: float = 0.0  # S-
    rise_began: int = NEVER  # [ns] when S+ was last 0
    fall_began: int = NEVER  # [ns]
    changes: int = 0  # found so far
    changed_at: int = NEVER  # [ns] when the last of them began
    before: float = 0.0  # [-] z0 before the last change


def watch(known: FrictionChange, stamp: int, ratio: float) -> FrictionChange:
    """Take the ratio z of one reversal, at ``stamp`` [ns]."""
    count = known.reversals + 1
    if count <= REFERENCE_REVERSALS:
        deviation = ratio - known.reference
        reference = known.reference + deviation / count
        squares = known.squares + deviation * (ratio - reference)
        return known._replace(reversals=count, reference=reference, squares=squares, rise_began=stamp, fall_began=stamp)
    std = max(math.sqrt(known.squares / (REFERENCE_REVERSALS - 1)), LEAST_STD)
    term = between(-LARGEST_TERM, (ratio - known.reference) / std, LARGEST_TERM)
    rise, fall = max(0.0, known.rise + term - ALLOWANCE), max(0.0, known.fall - term - ALLOWANCE)
    rise_began = known.rise_began if rise else stamp
    fall_began = known.fall_began if fall else stamp
    if max(rise, fall) > THRESHOLD:
        began = rise_began if rise > fall else fall_began
        return FrictionChange(changes=known.changes + 1, changed_at=began, before=known.reference)
    return known._replace(reversals=count, rise=rise, fall=fall, rise_began=rise_began, fall_began=fall_began)
