"""Where the tree of the project is, for tests."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
