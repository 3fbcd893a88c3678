"""Node base class that takes messages in batches, at its own pace.

An executor that woke up for each message of a fast topic would cost more than all the rest of a
node that only looks at the newest ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from slosh_msgs_py.node.guarded import GuardedNode


class PolledNode(GuardedNode):
    """A node with subscriptions that no executor serves; `take` yields their messages."""

    def __init__(self, name: str) -> None:
        self._polled: set[Subscription] = set()
        super().__init__(name)

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Yields the subscriptions for the executor, without those that are polled in batches."""
        return (entry for entry in super().subscriptions if entry not in self._polled)

    def subscribe_polled(self, kind: Any, topic: str, profile: QoSProfile) -> Subscription:
        """Creates a subscription whose messages wait until `take` is called."""
        events = SubscriptionEventCallbacks(use_default_callbacks=False)
        made = self.create_subscription(
            kind, topic, lambda message: None, profile, event_callbacks=events
        )
        self._polled.add(made)
        return made

    def drop_polled(self, subscription: Subscription | None) -> None:
        """Ends a subscription that is polled; does nothing for None."""
        if subscription is not None:
            self._polled.discard(subscription)
            self.destroy_subscription(subscription)


def take(subscription: Subscription, kind: Any, most: int) -> Iterator[Any]:
    """Yields the waiting messages of a subscription that is not served by an executor.

    Args:
        subscription: of a PolledNode.
        kind: class of its messages.
        most: number of messages that are taken at most.
    """
    with subscription.handle:
        for _ in range(most):
            taken = subscription.handle.take_message(kind, False)
            if taken is None:
                return
            yield taken[0]
