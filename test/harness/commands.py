"""Campaigns and benches run as a user runs them, each in a process of its own."""

import json
import os
import subprocess
import sys
from typing import Any

from paths import ROOT

ENVIRONMENT = {**os.environ, 'PYTHONPATH': str(ROOT)}


def run_json(script: str, *arguments: str) -> Any:
    """What ``python SCRIPT ARGUMENTS --json`` prints; the path of the script is relative to the project."""
    command = [sys.executable, str(ROOT / script), *arguments, '--json']
    result = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert result.stdout, result.stderr
    return json.loads(result.stdout)
