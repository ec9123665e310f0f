"""Build of the ament_python package: `colcon build --base-paths . msg_defs`, or `make setup` without ROS."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = 'seal_friction_ros'
STUDIES = 'seal_friction_studies'  # a second package of this distribution; NAME knows it by name only


def shared(folder: str, pattern: str) -> tuple[str, list[str]]:
    """Where files of a folder of the source tree are installed."""
    return f'share/{NAME}/{folder}', sorted(str(path) for path in Path(folder).glob(pattern))


setup(
    name=NAME,
    version='0.1.0',
    packages=find_packages(include=[NAME, NAME + '.*', STUDIES, STUDIES + '.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + NAME]),
        ('share/' + NAME, ['package.xml']),
        shared('config', '*.yaml'),
        shared('config', '*.xml'),
        shared('config/seals', '*.yaml'),
        shared('config/layouts', '*.json'),
        shared('config/layouts', '*.xml'),
        shared('config/machines', '*.yaml'),
        shared('config/programs', '*.yaml'),
        shared('config/security', '*.xml'),
        shared('config/rigs', '*.yaml'),
        shared('config/oring', '*.yaml'),
        shared('config/ehl', '*.yaml'),
        shared('config/simulated_machines', '*.yaml'),
        shared('data/thesis', '*.csv'),
        shared('launch', '*.launch.py'),
    ],
    package_data={
        NAME: ['py.typed'],
        f'{NAME}.offline.reports': ['templates/*.html', 'templates/*.js'],
        f'{NAME}.offline.monitor': ['page/*'],
        STUDIES: ['py.typed'],
        f'{STUDIES}.offline': ['templates/*.html'],
    },
    python_requires='>=3.11',
    # What no distribution packages; the rest comes by package.xml, or by requirements/run.txt.
    install_requires=['mcap>=1.5.0', 'rosbags>=0.11.9'],
    zip_safe=False,
    # Commands on a Dask cluster, and tables for it; the versions of requirements/dev.txt.
    extras_require={
        'cluster': [
            'dask==2026.8.0',
            'distributed==2026.8.0',
            'cloudpickle==3.1.2',
            'pyarrow==26.0.1',
            'fsspec==2026.9.0',
        ]
    },
    maintainer='seal_friction_ros maintainers',
    maintainer_email='maintainers@seal-friction.invalid',
    description='Live, recorded and replayable estimate of hydraulic seal friction for ROS 2.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'seal_friction = seal_friction_ros.offline.commands.entry_point:seal_friction',
            'friction_estimator = seal_friction_ros.nodes.entry_points:friction_estimator',
            'machine_estimator = seal_friction_ros.nodes.entry_points:machine_estimator',
            'servo_simulator = seal_friction_ros.nodes.entry_points:servo_simulator',
            'friction_monitor = seal_friction_ros.nodes.entry_points:friction_monitor',
            'bag_player = seal_friction_ros.nodes.entry_points:bag_player',
        ],
    },
)
