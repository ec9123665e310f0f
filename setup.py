"""Build of the package: `pip install .` without ROS, `colcon build --base-paths . msg_defs` or `make setup` with it.

With ROS the requirements come by package.xml or requirements/run.txt; the packages of ROS are not on PyPI. The lowest
versions are those of requirements/lowest.txt.
"""

from pathlib import Path

from setuptools import find_packages, setup

NAME = 'seal_friction_ros'
STUDIES = 'seal_friction_studies'  # a second package of this distribution; NAME knows it by name only


def shared(folder: str, pattern: str) -> tuple[str, list[str]]:
    """Where files of a folder of the source tree are installed."""
    return f'share/{NAME}/{folder}', sorted(str(path) for path in Path(folder).glob(pattern))


setup(
    name=NAME,
    version='0.2.0',
    packages=find_packages(include=[NAME, NAME + '.*', STUDIES, STUDIES + '.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + NAME]),
        ('share/' + NAME, ['package.xml']),
        shared('config', '*.yaml'),
        shared('config', '*.xml'),
        shared('config/seals', '*.yaml'),
        shared('config/seals/catalogue', '*.yaml'),
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
        shared('msg_defs/msg', '*.msg'),  # to write bags without ROS
        shared('launch', '*.launch.py'),
    ],
    package_data={
        NAME: ['py.typed'],
        f'{NAME}.offline.reports': ['templates/*.html', 'templates/*.js'],
        f'{NAME}.offline.export': ['templates/*'],
        f'{NAME}.offline.monitor': ['page/*'],
        STUDIES: ['py.typed'],
        f'{STUDIES}.offline': ['templates/*.html'],
    },
    python_requires='>=3.11',
    install_requires=[
        'numpy>=1.26.4',
        'PyYAML>=6.0.1',  # seal, rig and parameter files
        'mcap>=1.5.0',  # bags; brings lz4 and zstandard
        'rosbags>=0.11.9',  # message types, for bags without definitions
        'scipy>=1.11.4',  # identify, O-rings, seals with a table
        'numba>=0.58.1',  # tune, servo, ehl; long replays
        'matplotlib>=3.6.3',  # pages
        'Jinja2>=3.1.2',  # pages
        'tornado>=6.4',  # monitor BAG
        'rich>=13.7.1',  # progress
        'argcomplete>=3.1.4',  # completion in a shell
    ],
    zip_safe=False,
    # Commands on a Dask cluster, and tables for it; the versions of requirements/dev.txt.
    extras_require={
        'cluster': [
            'dask==2026.8.0',
            'distributed==2026.8.0',
            'cloudpickle==3.1.2',
            'pyarrow==26.0.1',
            'fsspec==2026.9.0',
        ],
        'drawings': ['ezdxf==1.4.5'],  # DXF of a seal section
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
