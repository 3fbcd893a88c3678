"""Distinguishes a topic without messages from a node that fails to receive them.

The middleware cannot tell: to both of them all is well connected. So what a node does not hear is
listened to for a moment by somebody else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

TRIAL = 5.0
"""Somebody else listens so long, so long after the node said so and after the last trial [s]."""
ENOUGH = 5
"""Messages that come in a trial from a publisher that is at work."""
CERTAIN = 3.0
"""So long the others hear and the node does not [s]: it reports once a second."""
AGAIN = 300.0
"""A node that stays deaf is not found so sooner [s]: to start it anew was of no use."""


class Probe(Protocol):
    """Interface of a temporary subscription that counts a topic's messages."""

    @property
    def count(self) -> int:
        """Number of messages received so far."""

    def close(self) -> None:
        """Removes the temporary subscription to the topic."""


@dataclass(slots=True)
class _Doubt:
    """A node and a topic whose messages it may fail to receive.

    Attributes:
        topic: and its type.
        since: when it said so first, or the last trial began or ended [s].
        probe: listens beside it; None: there is no trial now.
        heard: since when the probe has heard enough [s].
    """

    topic: str
    since: float
    probe: Probe | None = None
    heard: float = math.inf

    def end_trial(self, now: float) -> None:
        """Ends the temporary subscription to the topic."""
        if self.probe is not None:
            self.probe.close()
        self.probe, self.since, self.heard = None, now, math.inf


class Deafness:
    """Finds nodes that fail to receive a topic, by means of temporary subscriptions.

    Args:
        listen: begins to listen to a topic of a type; None: it cannot.
    """

    def __init__(self, listen: Callable[[str, str], Probe | None]) -> None:
        self._listen = listen
        self._doubts: dict[str, _Doubt] = {}
        self._found: dict[str, float] = {}

    def look(self, unheard: Mapping[str, str], now: float) -> dict[str, str]:
        """Returns each node that fails to receive a topic, while other subscribers receive it.

        Args:
            unheard: topic and type that nodes say they hear nothing on, by node.
            now: steady time [s].
        """
        for node, doubt in [*self._doubts.items()]:
            if unheard.get(node) != doubt.topic:
                doubt.end_trial(now)
                del self._doubts[node]
        deaf = {}
        for node, topic in unheard.items():
            doubt = self._doubts.setdefault(node, _Doubt(topic, now))
            recently = now - self._found.get(node, -math.inf) < AGAIN
            if not recently and self._is_deaf(doubt, now):
                self._found[node] = now
                deaf[node] = topic.partition(" ")[0]
        return deaf

    def _is_deaf(self, doubt: _Doubt, now: float) -> bool:
        """Starts, checks or ends a test of one node; returns whether it fails to receive."""
        if doubt.probe is None:
            if now - doubt.since >= TRIAL:
                topic, _, type_name = doubt.topic.partition(" ")
                doubt.probe, doubt.since = self._listen(topic, type_name), now
            return False
        if doubt.probe.count >= ENOUGH:
            doubt.heard = min(doubt.heard, now)
        deaf = now - doubt.heard >= CERTAIN
        if deaf or (doubt.heard == math.inf and now - doubt.since >= TRIAL):
            doubt.end_trial(now)
        return deaf
