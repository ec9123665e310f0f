"""Middleware settings for ROS 2 from wheels: ``config/fastdds.xml``, and discovery on this machine only."""

import os

from seal_friction_ros.files import share_directory

PROFILES = ('FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE')
"""Environment variables that name a profile file of Fast DDS."""
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'


def set_up_discovery() -> None:
    """Restrict discovery to this machine, by UDP alone, and speed it up, unless the environment has other settings.

    rclpy adds shared memory to any profile of the range LOCALHOST, so the profile itself keeps to this machine.

    The Fast DDS of the wheels has no security plugins, so every discovered node could send commands. The settings of a
    ROS distribution are not changed. Call this function before the first context is initialised; child processes
    inherit the settings.
    """
    if 'ROS_DISTRO' in os.environ:
        return
    reach = os.environ.setdefault(RANGE, 'LOCALHOST')
    if reach == 'LOCALHOST' and not any(name in os.environ for name in PROFILES):
        os.environ[PROFILES[0]] = str(share_directory('seal_friction_ros', __file__) / 'config' / 'fastdds.xml')
        os.environ[RANGE] = 'SYSTEM_DEFAULT'
