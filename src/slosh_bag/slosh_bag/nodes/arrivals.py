"""The order in which messages came on all topics together."""

from __future__ import annotations

from slosh_bag.nodes.topic_input import Received


class Arrivals:
    """Sorts messages that are taken topic by topic, while others still come.

    A message is held back until those that came before it on other topics must have been taken,
    and no longer than until the next call: a step of the clock holds nothing back for good.
    """

    def __init__(self) -> None:
        self._held: list[Received] = []

    def sort(self, taken: list[Received], settled: int) -> list[Received]:
        """Takes messages; returns those whose order is known, in that order.

        Args:
            taken: of all topics, since the last call.
            settled: what came up to then has been taken, on every topic [ns].
        """
        # One pass over the topics may last for seconds: what was held since then is settled, too.
        until = max([settled, *(received.arrived_ns for received in self._held)])
        waiting = sorted([*self._held, *taken], key=lambda received: received.arrived_ns)
        self._held = [received for received in waiting if received.arrived_ns > until]
        return waiting[: len(waiting) - len(self._held)]

    def rest(self) -> list[Received]:
        """What is held back; nothing follows."""
        held, self._held = self._held, []
        return held
