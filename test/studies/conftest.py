"""Small cases; figures are drawn, but rendered only in tests that are marked ``renders``."""

from harness.ehl_cases import ring, small  # noqa: F401
from harness.unrendered import unrendered  # noqa: F401
