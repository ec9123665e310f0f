"""Small cases of the lubricated contact."""

from harness.ehl_cases import ring, small  # noqa: F401
