"""Returns a node's unused memory to the operating system."""

from __future__ import annotations

import ctypes
import gc

from rclpy.node import Node

LARGE = 10_000
"""Points of a message whose memory is given back to the system after it."""


def give_back_memory() -> None:
    """Returns the process's unused memory to the operating system.

    A large message is unpacked into many small objects; when they are gone the C library keeps
    their memory. Only glibc can be asked for it; elsewhere nothing happens.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


class LargeMessages:
    """Returns memory to the operating system after large messages have been processed.

    Args:
        node: whose messages they are.
    """

    def __init__(self, node: Node) -> None:
        self._was_large = False
        node.create_timer(1.0, self._give_back)

    def add(self, points: int) -> None:
        """Counts a received message by its number of trajectory points."""
        self._was_large |= points > LARGE

    def _give_back(self) -> None:
        if self._was_large:
            self._was_large = False
            give_back_memory()
