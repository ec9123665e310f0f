"""Compiled code shared by all processes of the tests; to be imported before anything is compiled."""

from paths import ROOT

from seal_friction_ros.compiled_code import keep_compiled_code

keep_compiled_code(ROOT / 'build' / 'numba')
