"""Reports in tests: figures are drawn, but rendered only in tests that are marked ``renders``."""

from harness.unrendered import unrendered  # noqa: F401
