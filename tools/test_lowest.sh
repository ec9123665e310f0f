#!/usr/bin/env bash
# Tests of core and offline with the lowest versions of all packages (requirements/lowest.txt), in an environment of its
# own; the messages are those of .venv. `PYTHON=python3.12 tools/test_lowest.sh [TEST...]` takes another Python.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${PYTHON:-.venv/bin/python}
version=$("$python" -c 'import sys; print(f"{sys.version_info.major}.{sys.version_info.minor}")')
environment=build/lowest-$version
sum=$(sha256sum requirements/lowest.txt tools/test_lowest.sh)
if [ "$(cat "$environment/.done" 2>/dev/null)" != "$sum" ]; then
    rm -rf "$environment"
    "$python" -m venv "$environment"
    "$environment/bin/python" -m pip install --quiet --disable-pip-version-check -r requirements/lowest.txt
    packages=$("$environment/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
    for name in seal_friction_msgs std_msgs sensor_msgs geometry_msgs trajectory_msgs builtin_interfaces; do
        ln -s "$(.venv/bin/python -c "import pathlib, $name as m; print(pathlib.Path(m.__file__).parent)")" "$packages/$name"
    done
    echo "$sum" >"$environment/.done"
fi
# The environment has no rclpy, which makes the messages of some tests.
if [ $# -eq 0 ]; then
    set -- test/core test/offline test/studies
    for file in $(grep -lrE --include='test_*.py' '^from (rclpy|harness\.(machines|standard_bags|live_machine))' "$@"); do
        set -- "$@" --ignore "$file"
    done
fi
exec env PYTHONPATH="$PWD" "$environment/bin/python" -m pytest --numprocesses auto --dist loadfile "$@"
