"""Compiled code shared by all processes of the tests; to be imported before anything is compiled."""

from paths import ROOT

from seal_friction_ros.compiled_code import keep_compiled_code, use_folder

FOLDER = ROOT / 'build' / 'numba'

keep_compiled_code(FOLDER)
use_folder(FOLDER)  # commands that a test starts before it compiles anything take it, too
