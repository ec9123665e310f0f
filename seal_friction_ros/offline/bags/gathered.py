"""Messages one by one as blocks of messages."""

from collections.abc import Callable, Iterable, Iterator
from itertools import islice

import numpy as np

from seal_friction_ros.core.messages.blocks import MOST_MESSAGES, Messages
from seal_friction_ros.offline.bags.bag import BagMessage

KindOf = Callable[[str, str], int]
"""Topic and message type -> kind of its messages, for example a `Kind`; below 255."""


def gathered(messages: Iterable[BagMessage], kind_of: KindOf) -> Iterator[Messages]:
    """Messages of the general reader in blocks."""
    source = iter(messages)
    while block := list(islice(source, MOST_MESSAGES // 4)):
        kinds = np.array([kind_of(message.topic, message.type_name) for message in block], np.uint8)
        sizes = np.array([len(message.data) for message in block], np.int64)
        data = np.frombuffer(b''.join(message.data for message in block), np.uint8)
        times = np.array([message.log_time for message in block], np.int64)
        sent = [message.log_time if message.publish_time is None else message.publish_time for message in block]
        yield Messages(data, kinds, np.cumsum(sizes) - sizes, sizes, times, np.array(sent, np.int64))
