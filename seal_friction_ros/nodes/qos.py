"""Quality of service of the topics, and how a user overrides it."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

STREAM = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
"""Inputs and estimates: nothing lost; a hundred samples are a tenth of a second at 1 kHz."""

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Configuration: whoever comes late still gets the last one."""

CLOCK = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
"""Simulated time."""


def overridable() -> QoSOverridingOptions:
    """Let ``qos_overrides.<topic>.<publisher or subscription>.<policy>`` change history, depth and reliability."""
    return QoSOverridingOptions.with_default_policies()


def best_effort(profile: QoSProfile) -> QoSProfile:
    """Return the same profile for a publisher that does not offer reliability."""
    return QoSProfile(depth=profile.depth, reliability=ReliabilityPolicy.BEST_EFFORT, durability=profile.durability)
