"""Starts one estimator: ``ros2 launch seal_friction_ros friction_estimator.launch.py namespace:=left``."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription

INPUTS = ('cylinder_pressure', 'rod_velocity', 'force_sum', 'servo_reference')


def generate_launch_description() -> LaunchDescription:
    """The node with its parameter file and the topics of the drivers; it configures and activates itself."""
    parameters = PathJoinSubstitution([FindPackageShare('seal_friction_ros'), 'config', 'friction_estimator.yaml'])
    arguments = [
        DeclareLaunchArgument('namespace', default_value='', description='Namespace of the actuator.'),
        DeclareLaunchArgument('params_file', default_value=parameters, description='Parameter file of the node.'),
        *(
            DeclareLaunchArgument(name, default_value=name, description=f'Topic that publishes {name}.')
            for name in INPUTS
        ),
    ]
    node = Node(
        package='seal_friction_ros',
        executable='friction_estimator',
        namespace=LaunchConfiguration('namespace'),
        parameters=[LaunchConfiguration('params_file')],
        remappings=[(name, LaunchConfiguration(name)) for name in INPUTS],
        output='screen',
    )
    return LaunchDescription([*arguments, node])
