"""My robot in a launch file: one estimator for the left cylinder, on the topics of its driver, with its seal file."""

from launch_ros.actions import Node

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """The node configures and activates itself; live_node.py is in place of driver and controller."""
    estimator = Node(
        package='seal_friction_ros',
        executable='friction_estimator',
        namespace='left_cylinder',
        parameters=[{'seals': ['ms28775_114@a', 'ms28775_114@b'], 'stamp_age_max': 0.1}],
        remappings=[('rod_velocity', '/encoder/velocity')],  # topic of the node, topic of the driver
        output='screen',
    )
    return LaunchDescription([estimator])
