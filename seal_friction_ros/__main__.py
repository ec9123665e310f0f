"""``python -m seal_friction_ros``: the command ``seal_friction``."""

from seal_friction_ros.offline.commands.main import run_and_exit

if __name__ == '__main__':
    run_and_exit()
