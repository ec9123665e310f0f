"""A disk that takes no write until it is released."""

import os
import threading

_TIMEOUT = 60.0  # [s] ends a test that hangs


class BlockedDisk:
    """Stands in for ``os`` in `mcap_writer`: each write blocks until `release`."""

    def __init__(self) -> None:
        self._is_blocking = threading.Event()
        self._released = threading.Event()

    def __getattr__(self, name: str) -> object:
        return getattr(os, name)

    @property
    def is_blocking(self) -> bool:
        """Whether a write has been blocked."""
        return self._is_blocking.is_set()

    def wait_until_blocking(self) -> None:
        """Wait for the first write.

        Raises:
            TimeoutError: Nothing is written.
        """
        if not self._is_blocking.wait(_TIMEOUT):
            raise TimeoutError('nothing is written to the disk')

    def release(self) -> None:
        """Let all writes through from now on."""
        self._released.set()

    def pwrite(self, handle: int, data: bytes, offset: int) -> int:
        """Write once the disk is released."""
        self._is_blocking.set()
        self._released.wait(_TIMEOUT)
        return os.pwrite(handle, data, offset)
