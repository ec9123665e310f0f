"""Topics of the estimator in a bag, found by message type."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from seal_friction_ros.core.messages import layouts
from seal_friction_ros.offline.bags.bag import (
    CONFIGURATION_TOPIC,
    ESTIMATE_TOPIC,
    FEEDFORWARD_TOPIC,
    STATE_NAME,
    TEMPERATURE_TOPIC,
    BagError,
    TopicInfo,
    bag_topics,
)

ANSWER_TOPICS = {layouts.ESTIMATE_TYPE: ESTIMATE_TOPIC, layouts.FEEDFORWARD_TYPE: FEEDFORWARD_TOPIC}
"""Message type of an answer -> topic, if the bag has no topic of that type."""


RECORDED = '_recorded'
"""End of the name of the topic that keeps the feed-forward that acted, in a bag of ``seal_friction replay``."""


class Topics(NamedTuple):
    """Names of the estimator's topics in a bag; empty if there is no such topic."""

    pressure: str
    velocity: str
    force: str
    reference: str
    position: str
    estimate: str
    feedforward: str
    configuration: str
    tick: str
    temperature: str
    clock: str

    @property
    def inputs(self) -> set[str]:
        """Topics that the estimator takes."""
        used = self.pressure, self.velocity, self.force, self.reference, self.tick, self.temperature, self.clock
        return set(used) - {''}

    @property
    def answers(self) -> dict[str, str]:
        """Message type of an answer -> its topic; empty if there is no such topic."""
        return {layouts.ESTIMATE_TYPE: self.estimate, layouts.FEEDFORWARD_TYPE: self.feedforward}

    @property
    def state(self) -> str:
        """Topic of the states amid the bag, if there are any."""
        return f'{(self.configuration or CONFIGURATION_TOPIC).rpartition("/")[0]}/{STATE_NAME}'


TYPES = Topics(
    pressure=layouts.PRESSURE_TYPE,
    velocity=layouts.VELOCITY_TYPE,
    force=layouts.FORCE_TYPE,
    reference=layouts.REFERENCE_TYPE,
    position=layouts.POSITION_TYPE,
    estimate=layouts.ESTIMATE_TYPE,
    feedforward=layouts.FEEDFORWARD_TYPE,
    configuration=layouts.CONFIGURATION_TYPE,
    tick=layouts.TICK_TYPE,
    temperature=layouts.TEMPERATURE_TYPE,
    clock=layouts.CLOCK_TYPE,
)
"""Message type of each topic."""


def find_topics(bag: Path, namespace: str = '', known: Mapping[str, TopicInfo] | None = None) -> Topics:
    """The estimator's topics in a bag, found by message type, so that names and remapping do not matter.

    Args:
        bag: The bag.
        namespace: Use only topics below it; for bags of several actuators.
        known: Result of `bag_topics`, if already known.

    Raises:
        BagError: There is no velocity topic, or a type of this project has several topics.
    """
    known = bag_topics(bag) if known is None else known
    result = Topics(*(find_topic(bag, wanted, namespace, known) for wanted in TYPES))
    if not result.velocity:
        raise BagError(
            f'{bag}: no message of {TYPES.velocity} in it, so nothing to estimate from: a bag of another machine needs '
            'its mapping file (--mapping, or seal_friction import bag)'
        )
    return result


def find_topic(bag: Path, wanted: str, namespace: str, known: Mapping[str, TopicInfo]) -> str:
    """The topic of a message type, see `find_topics`; empty if there is none.

    Raises:
        BagError: A type of this project has several topics.
    """
    below = f'/{namespace.strip("/")}/'.replace('//', '/')
    found = [
        topic
        for topic, info in sorted(known.items())
        if info.type_name == wanted and info.message_count and not topic.endswith(RECORDED)
        if topic.startswith(below) or wanted == TYPES.clock  # simulated time is one for all
    ]
    if len(found) > 1 and wanted == TYPES.temperature:  # a standard type: others may be of a motor or a battery
        found = [topic for topic in found if topic.endswith(TEMPERATURE_TOPIC)]
    if len(found) > 1:
        raise BagError(f'{bag}: several topics of {wanted}: {", ".join(found)}: choose with --namespace')
    return found[0] if found else ''
