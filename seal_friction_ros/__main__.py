"""``python -m seal_friction_ros``: the command ``seal_friction``."""

from seal_friction_ros.offline.commands.entry_point import seal_friction

if __name__ == '__main__':
    seal_friction()
