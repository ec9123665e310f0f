"""The live node (needs ROS): starts live_node.launch.py, publishes what drivers publish, and receives the friction."""

import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import rclpy
from seal_friction_msgs.msg import CylinderPressure, ForceSum, FrictionEstimate, RodVelocity

from seal_friction_ros import load_seal

LAUNCH = ['ros2', 'launch', str(Path(__file__).with_name('live_node.launch.py'))]
WHEELS = [  # without the package launch: the same, as one command
    str(Path(sys.executable).with_name('friction_estimator')), '--ros-args', '-r', '__ns:=/left_cylinder',
    '-p', "seals:=['ms28775_114@a', 'ms28775_114@b']", '-p', 'stamp_age_max:=0.1',
    '-r', 'rod_velocity:=/encoder/velocity',
]  # fmt: skip

rclpy.init()
driver, estimates = rclpy.create_node('driver'), []
pressure = driver.create_publisher(CylinderPressure, '/left_cylinder/cylinder_pressure', 10)
force = driver.create_publisher(ForceSum, '/left_cylinder/force_sum', 10)
velocity = driver.create_publisher(RodVelocity, '/encoder/velocity', 10)
driver.create_subscription(FrictionEstimate, '/left_cylinder/friction_estimate', estimates.append, 10)
with subprocess.Popen(LAUNCH if find_spec('launch_ros') else WHEELS) as node:
    end = time.monotonic() + 90.0
    while time.monotonic() < end and not (estimates and estimates[-1].status == 0 and estimates[-1].state == 1):
        for publisher, message in (
            (pressure, CylinderPressure(chamber_a=35e5, chamber_b=35e5)),
            (force, ForceSum(force=43.0)),
            (velocity, RodVelocity(velocity=0.05)),
        ):
            message.header.stamp = driver.get_clock().now().to_msg()
            publisher.publish(message)
        rclpy.spin_once(driver, timeout_sec=0.01)  # [s]
    node.terminate()
assert estimates, 'no estimate within 90 s: see the output of the node'
print(f'{len(estimates)} estimates, the last {estimates[-1].friction_force:.1f} N, status {estimates[-1].status}')
assert abs(estimates[-1].friction_force - 2 * load_seal('ms28775_114').friction(35e5, 0.05)) < 1e-9
rclpy.shutdown()
