"""A C++ program builds against the messages and the middleware of the wheels."""

import os
import subprocess
from pathlib import Path

import pytest
from paths import ROOT

CMAKE = """
cmake_minimum_required(VERSION 3.20)
project(user CXX)
set(CMAKE_CXX_STANDARD 17)
find_package(seal_friction_msgs REQUIRED)
find_package(fastdds REQUIRED)
find_package(tracetools REQUIRED)
add_executable(user user.cpp)
target_link_libraries(user
  seal_friction_msgs::seal_friction_msgs__rosidl_typesupport_cpp fastdds tracetools::tracetools)
"""
SOURCE = """
#include <rosidl_typesupport_cpp/message_type_support.hpp>
#include <seal_friction_msgs/msg/rod_velocity.hpp>
int main() {
  return !rosidl_typesupport_cpp::get_message_type_support_handle<seal_friction_msgs::msg::RodVelocity>();
}
"""


@pytest.mark.skipif('ROS_DISTRO' in os.environ, reason='with a distribution there are no wheels')
def test_a_program_in_cpp_builds_and_runs(tmp_path: Path):
    (tmp_path / 'CMakeLists.txt').write_text(CMAKE)
    (tmp_path / 'user.cpp').write_text(SOURCE)
    prefix = ROOT / '.venv'
    environment = {
        **os.environ,
        'PATH': f'{prefix}/bin:{os.environ["PATH"]}',
        'AMENT_PREFIX_PATH': str(prefix),
        'CMAKE_PREFIX_PATH': str(prefix),
        'LD_LIBRARY_PATH': f'{prefix}/lib',
    }
    for command in (f'cmake -B build -DPython3_EXECUTABLE={prefix}/bin/python', 'cmake --build build', 'build/user'):
        result = subprocess.run(
            command.split(), cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert result.returncode == 0, result.stdout + result.stderr
