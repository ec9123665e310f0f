"""Who publishes a topic: one node should. Several are noticed, and one that cannot be heard is said, each by name."""

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, QoSProfile, ReliabilityPolicy, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo


def publishers(node: Node, topic: str) -> list[TopicEndpointInfo]:
    """Publishers of a topic that the node has discovered, in order of their names."""
    return sorted(node.get_publishers_info_by_topic(topic), key=full_name)


def full_name(publisher: TopicEndpointInfo) -> str:
    """Name of the node that publishes, with its namespace."""
    return f'{publisher.node_namespace}/{publisher.node_name}'.replace('//', '/')


def offers_best_effort_only(publisher: TopicEndpointInfo) -> bool:
    """Whether nothing reliable can be had from a publisher."""
    return bool(publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT)


def why_unheard(publisher: TopicEndpointInfo, type_name: str, wanted: QoSProfile) -> str:
    """Why a subscription for ``type_name`` with the quality ``wanted`` hears nothing of it; empty if it should."""
    if publisher.topic_type != type_name:
        return f'{full_name(publisher)} publishes {publisher.topic_type}, not {type_name}'
    compatibility, reason = qos_check_compatible(publisher.qos_profile, wanted)
    if compatibility == QoSCompatibility.ERROR:
        return f'{full_name(publisher)} offers incompatible quality of service: {reason.strip().rstrip(";")}'
    return ''
