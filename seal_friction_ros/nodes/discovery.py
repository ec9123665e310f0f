"""How the middleware is set up where no ROS distribution has done that: config/fastdds.xml, and this machine only."""

import os

from seal_friction_ros.files import share_directory

PROFILES = ('FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE')
"""Variables of the environment that name a file of profiles for Fast DDS."""


def set_up_discovery() -> None:
    """Look for nodes on this machine only, and find them at once, unless the environment says otherwise.

    The Fast DDS of the wheels has no security plugins, so whoever is found can command. A distribution is left as its
    user set it up. To be called before the first context is initialised; processes started later inherit it.
    """
    if 'ROS_DISTRO' in os.environ:
        return
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    if not any(name in os.environ for name in PROFILES):
        profiles = share_directory('seal_friction_ros', __file__) / 'config' / 'fastdds.xml'
        os.environ[PROFILES[0]] = str(profiles)
