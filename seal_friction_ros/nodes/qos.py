"""Quality of service (QoS) of the topics."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

STREAM = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
"""Inputs and estimates: reliable; 100 samples are 0.1 s at 1 kHz."""

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Configuration: late subscribers receive the last message."""

CLOCK = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
"""Simulated time."""


def overridable() -> QoSOverridingOptions:
    """Let ``qos_overrides.<topic>.<publisher or subscription>.<policy>`` change history, depth and reliability."""
    return QoSOverridingOptions.with_default_policies()


def best_effort(profile: QoSProfile) -> QoSProfile:
    """The same profile with best-effort reliability."""
    return QoSProfile(depth=profile.depth, reliability=ReliabilityPolicy.BEST_EFFORT, durability=profile.durability)
