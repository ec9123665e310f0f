"""Build of the ament_python package: `colcon build --base-paths . msg_defs`, or `make setup` on a machine without ROS."""

from glob import glob

from setuptools import find_packages, setup

NAME = 'seal_friction_ros'

setup(
    name=NAME,
    version='0.1.0',
    packages=find_packages(include=[NAME, NAME + '.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + NAME]),
        ('share/' + NAME, ['package.xml']),
        ('share/' + NAME + '/config', glob('config/*.yaml')),
        ('share/' + NAME + '/config/seals', glob('config/seals/*.yaml')),
        ('share/' + NAME + '/config/rigs', glob('config/rigs/*.yaml')),
    ],
    package_data={NAME: ['py.typed']},
    python_requires='>=3.11',
    zip_safe=True,
    maintainer='seal_friction_ros maintainers',
    maintainer_email='maintainers@seal-friction.invalid',
    description='Live, recorded and replayable estimate of hydraulic seal friction for ROS 2.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'seal_friction = seal_friction_ros.offline.cli:main',
            'friction_estimator = seal_friction_ros.nodes.friction_estimator:main',
            'bag_player = seal_friction_ros.nodes.bag_player:main',
        ],
    },
)
