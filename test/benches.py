"""Benches as a user runs them, each a process."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
ENVIRONMENT = {**os.environ, 'PYTHONPATH': str(ROOT)}


def bench(name: str, *arguments: str) -> dict:
    """What a bench says as JSON."""
    command = [sys.executable, str(ROOT / 'bench' / f'{name}.py'), *arguments, '--json']
    result = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert result.stdout, result.stderr
    return json.loads(result.stdout)
