#!/usr/bin/env bash
# Set up .venv, once: `tools/setup.sh run` for what the package needs, `tools/setup.sh dev` for the tests as well.
# Without ROS the ROS 2 wheels of requirements/run.txt make .venv an ament underlay of its own; with ROS_DISTRO set
# (a sourced installation, Jazzy or newer) that ROS is used and only the other packages are installed.
set -euo pipefail
cd "$(dirname "$0")/.."
profile=${1:-run}
log=build/setup.log

say() { printf 'setup: %s\n' "$1" >&2; }
fail() { say "$1"; exit 2; }

wanted='import sys, sysconfig, venv, ensurepip, pathlib
assert (3, 11) <= sys.version_info < (3, 14)
assert pathlib.Path(sysconfig.get_path("include"), "Python.h").exists()'

find_python() {
    local candidate
    for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11 /usr/bin/python3}; do
        if "$candidate" -c "$wanted" >/dev/null 2>&1; then
            "$candidate" -c 'import sys; print(sys.executable)'
            return
        fi
    done
    fail "no Python 3.11, 3.12 or 3.13 with venv and headers among: ${PYTHON:-python3, python3.13, python3.12, python3.11} (Debian: apt-get install python3-venv python3-dev; or set PYTHON=/path/to/python)"
}

# A stage is done when what it was made from has not changed since: `stage NAME FILES... -- COMMAND`.
stage() {
    local name=$1 files=() sum
    shift
    while [ "$1" != -- ]; do files+=("$1"); shift; done
    shift
    sum=$({ cat "${files[@]}"; printf '%s\n' "$PWD" "${PYTHON:-}" "${ROS_DISTRO:-wheels}"; } | sha256sum)
    [ "$(cat ".venv/.done-$name" 2>/dev/null)" = "$sum" ] && return
    say "$name"
    "$@"
    mkdir -p .venv && printf '%s\n' "$sum" >".venv/.done-$name"
}

# What the log says last, every second on a terminal, else every 20 s; until this script ends it.
show_log() {
    local began=$SECONDS line
    while sleep 1 && kill -0 $$ 2>/dev/null; do
        line=$(tail -c 400 "$log" | tr '\r' '\n' | grep -a -v '^ *$' | tail -n 1 | cut -c 1-90) || line=
        if [ -t 2 ]; then
            printf '\r\033[Ksetup: %3d s  %s' "$SECONDS" "$line" >&2
        elif [ $((SECONDS - began)) -ge 20 ]; then
            began=$SECONDS
            say "$SECONDS s  $line"
        fi
    done
}

run_logged() {
    local code=0 watch
    show_log & watch=$!
    "$@" >>"$log" 2>&1 || code=$?
    kill "$watch" 2>/dev/null || true
    wait "$watch" 2>/dev/null || true
    [ ! -t 2 ] || printf '\r\033[K' >&2
    [ $code = 0 ] || fail "'$1 ${2:-} ${3:-}' failed; the last lines of $log: $(tail -n 3 "$log" | tr '\n' ' ')"
}

install_requirements() {
    # With a distribution ROS, its build tools and the numpy that its messages were built against come from there.
    if [ -n "${ROS_DISTRO:-}" ]; then
        grep -v -E '^(ros-|colcon|cmake==|empy==|catkin-pkg==|lark-parser==|numpy==)' "$1" >build/requirements.txt
    else
        cp "$1" build/requirements.txt
    fi
    run_logged .venv/bin/python -m pip install --disable-pip-version-check -r build/requirements.txt
}

build_messages() {
    local colcon=.venv/bin/colcon prefix=$PWD/.venv
    if [ -n "${ROS_DISTRO:-}" ]; then
        colcon=colcon prefix=${CMAKE_PREFIX_PATH:-$AMENT_PREFIX_PATH}
    else
        run_logged .venv/bin/python tools/patch_wheels.py
    fi
    run_logged env PATH="$PWD/.venv/bin:$PATH" AMENT_PREFIX_PATH="${AMENT_PREFIX_PATH:-$prefix}" CMAKE_PREFIX_PATH="$prefix" \
        "$colcon" --log-base build/log build --base-paths msg_defs --build-base build/messages \
        --install-base .venv --merge-install \
        --cmake-args -DPython3_EXECUTABLE="$PWD/.venv/bin/python" -DBUILD_TESTING=OFF
}

make_environment() {
    local python
    command -v "${CC:-cc}" >/dev/null || fail "no C compiler (${CC:-cc}): on Debian or Ubuntu, apt-get install build-essential"
    command -v "${CXX:-c++}" >/dev/null || fail "no C++ compiler (${CXX:-c++}): on Debian or Ubuntu, apt-get install build-essential"
    python=$(find_python) || exit 2
    if [ -n "${ROS_DISTRO:-}" ]; then
        command -v colcon >/dev/null || fail "ROS_DISTRO is $ROS_DISTRO but there is no colcon: apt-get install python3-colcon-common-extensions"
        [ -n "${AMENT_PREFIX_PATH:-}" ] || fail "ROS_DISTRO is $ROS_DISTRO but AMENT_PREFIX_PATH is not set: source /opt/ros/$ROS_DISTRO/setup.bash"
    fi
    rm -rf .venv build/messages
    say "making .venv with $("$python" --version), ROS 2 from ${ROS_DISTRO:-wheels}: a minute or two, once"
    if [ -n "${ROS_DISTRO:-}" ]; then
        run_logged "$python" -m venv --system-site-packages .venv
    else
        run_logged "$python" -m venv .venv
    fi
    touch .venv/COLCON_IGNORE
    install_requirements requirements/run.txt
}

install_package() { run_logged .venv/bin/python -m pip install --disable-pip-version-check --no-deps --no-build-isolation --editable .; }

mkdir -p build && touch build/COLCON_IGNORE && : >"$log"
stage environment requirements/run.txt tools/setup.sh tools/patch_wheels.py -- make_environment
stage messages msg_defs/CMakeLists.txt msg_defs/package.xml msg_defs/msg/*.msg -- build_messages
stage package setup.py setup.cfg -- install_package
[ "$profile" = run ] || stage tests requirements/dev.txt -- install_requirements requirements/dev.txt
