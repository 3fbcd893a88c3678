"""Subscription to one recorded topic, whose QoS follows that of the publishers."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy as Durability
from rclpy.qos import QoSHistoryPolicy as History
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy as Reliability
from rclpy.subscription import Subscription

from slosh_bag.bag_writer import Qos
from slosh_msgs_py.node.rivals import node_of

# Several seconds at 1 kHz: a stalled process must not lose messages before it sees them.
DEPTH = 5000

FORGIVEN = 1_000_000
"""A larger leap is no loss, but another publisher."""


class Received(NamedTuple):
    """A received serialised message with its times.

    Attributes:
        arrived_ns: when it was received, by the system's clock [ns].
        sent_ns: when it was sent, by the sender's system clock [ns]; 0: unknown.
        topic: its topic.
        data: CDR bytes.
    """

    arrived_ns: int
    sent_ns: int
    topic: str
    data: bytes


class Publisher(NamedTuple):
    """A publisher of a topic: its globally unique id and its QoS profile."""

    identity: bytes
    profile: QoSProfile


class TopicInput:
    """Subscribes to a topic and polls its serialised messages in batches.

    An executor would wake up for each message: at 1 kHz that costs twice what DDS itself takes.
    The middleware notes when each message came, so nothing is lost by asking a little later.

    Args:
        node: the node; its executor must leave this subscription alone.
        topic: the topic.
        type_name, message_type: its type's name and class.
        now: the steady time [s].
    """

    def __init__(
        self, node: Node, topic: str, type_name: str, message_type: Any, now: float
    ) -> None:
        self.topic = topic
        self.type_name = type_name
        self._gaps = SequenceGaps()
        self._turns = 0
        self.silent_since: float | None = None
        self._node = node
        self.message_type = message_type
        self._known: frozenset[bytes] = frozenset()
        self._ever: set[bytes] = set()  # of all publishers so far
        publishers = self._publishers()
        self.profile = matching([publisher.profile for publisher in publishers])
        self.subscription = self._subscribe()
        self.watch(now)

    @property
    def lost(self) -> int:
        """Number of messages that were sent but not received."""
        return self._gaps.lost

    def settle(self) -> None:
        """Confirms the counted message losses at the end of the recording."""
        self._gaps.settle(new_publishers=False)

    def is_mixed(self) -> bool:
        """Whether messages of several publishers have alternated since the last call."""
        turns, self._turns = self._gaps.turns - self._turns, self._gaps.turns
        return turns > 1

    def publisher_nodes(self) -> list[str]:
        """Returns the full names of the nodes that publish the topic, one per publisher."""
        infos = self._node.get_publishers_info_by_topic(self.topic)
        return sorted(node_of(info) for info in infos)

    def watch(self, now: float) -> str:
        """Checks the topic's publishers and renews the subscription if their QoS has changed.

        Args:
            now: the steady time [s].

        Returns:
            what has changed, or an empty text.
        """
        publishers = self._publishers()
        identities = frozenset(publisher.identity for publisher in publishers)
        self._gaps.settle(new_publishers=not identities <= self._ever)
        self._ever |= identities
        if not publishers:
            if self.silent_since is None:
                self.silent_since = now
                return "publisher lost"
            return ""
        back, self.silent_since = self.silent_since is not None, None
        wish = wanted(self.profile, publishers, self._known)
        self._known = identities
        if wish is not None:
            self._node.destroy_subscription(self.subscription)
            self.profile = wish
            self.subscription = self._subscribe()
            return "the publishers' QoS has changed; subscribed again"
        return "has a publisher again" if back else ""

    def take(self, give: Callable[[Received], None]) -> None:
        """Calls a function with each message received since the last call."""
        with self.subscription.handle:
            take = self.subscription.handle.take_message
            for _ in range(DEPTH):  # not for ever where they come faster than they are taken
                taken = take(self.message_type, True)
                if taken is None:
                    return
                data, info = taken
                arrived_ns = info["received_timestamp"] or time.time_ns()
                self._gaps.take(info.get("publication_sequence_number"), len(self._known))
                give(Received(arrived_ns, info["source_timestamp"], self.topic, data))

    def _publishers(self) -> list[Publisher]:
        return [
            Publisher(bytes(info.endpoint_gid), info.qos_profile)
            for info in self._node.get_publishers_info_by_topic(self.topic)
            if info.topic_type == self.type_name
        ]

    def _subscribe(self) -> Subscription:
        events = SubscriptionEventCallbacks(use_default_callbacks=False)
        return self._node.create_subscription(
            self.message_type, self.topic, _ignore, self.profile, event_callbacks=events, raw=True
        )


def _ignore(_: bytes) -> None:
    """Does nothing; placeholder callback, since messages are polled."""


def matching(offered: Sequence[QoSProfile]) -> QoSProfile:
    """Returns the strictest QoS profile that is compatible with every publisher."""
    reliable = bool(offered) and all(p.reliability == Reliability.RELIABLE for p in offered)
    latched = bool(offered) and all(p.durability == Durability.TRANSIENT_LOCAL for p in offered)
    return _profile(reliable, latched)


def wanted(
    present: QoSProfile, publishers: Sequence[Publisher], known: frozenset[bytes]
) -> QoSProfile | None:
    """Returns the QoS profile for a new subscription, or None if the present profile is right.

    Publishers that offer less would not be heard; of those that offer more, large messages would
    get lost on the way, or the latched ones of before. A new subscription to latched messages
    hears again what is recorded already: it is made only where all publishers are new.

    Args:
        present: the subscription's profile.
        publishers: the topic's publishers, at least one.
        known: identities of those that the subscription has heard.
    """
    best = matching([publisher.profile for publisher in publishers])
    strangers = all(publisher.identity not in known for publisher in publishers)
    more_latched = best.durability == Durability.TRANSIENT_LOCAL and strangers
    latched_now = present.durability == Durability.TRANSIENT_LOCAL
    less_latched = latched_now and best.durability != Durability.TRANSIENT_LOCAL
    same = present.reliability == best.reliability
    if same and not less_latched and (latched_now or not more_latched):
        return None
    return _profile(best.reliability == Reliability.RELIABLE, more_latched)


def _profile(reliable: bool, latched: bool) -> QoSProfile:
    return QoSProfile(
        history=History.KEEP_LAST,
        depth=DEPTH,
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
    )


def noted(profile: QoSProfile) -> Qos:
    """Converts an rclpy QoS profile to the form that bags store."""
    return Qos(
        "reliable" if profile.reliability == Reliability.RELIABLE else "best_effort",
        "transient_local" if profile.durability == Durability.TRANSIENT_LOCAL else "volatile",
    )


class SequenceGaps:
    """Counts missing messages by gaps in their sequence numbers.

    Each publisher counts its messages. The middleware hands the number over, though not whose it
    is: where several publish, a number belongs to the one whose next number it is, or else to the
    one that comes nearest before it. (The middleware's own event for lost messages is not used: in
    a process that was stopped and goes on, its query may wait for ever for a lock.)

    Attributes:
        lost: numbers that were left out, so far as `settle` has confirmed them.
        turns: how often a publisher went on after another one had spoken. Where one took the
            place of another there is none; where two speak, there are many.
    """

    def __init__(self) -> None:
        self.lost = self.turns = 0
        self._unconfirmed = 0
        self._newest: int | None = None
        self._last: list[int] = []  # of each publisher

    def take(self, number: int | None, publishers: int = 1) -> None:
        """Counts the messages that are missing before a received sequence number.

        Args:
            number: None: the middleware gives none.
            publishers: how many there are on the topic.
        """
        if number is None:
            return
        newest, self._newest = self._newest, number
        last = self._last
        if number - 1 in last:
            last[last.index(number - 1)] = number
            self.turns += newest != number - 1
            return
        before = max((one for one in last if one < number), default=None)
        if before is None or len(last) < publishers or number - before > FORGIVEN:
            # One that is new here, or has begun to count anew.
            last.append(number)
            del last[: max(len(last) - max(publishers, 1), 0)]
            return
        self._unconfirmed += number - before - 1
        last[last.index(before)] = number

    def settle(self, *, new_publishers: bool) -> None:
        """Confirms the losses counted since the last call, or discards them.

        Args:
            new_publishers: whether publishers have come that were never there before. Numbers of
                theirs may have been taken for gaps of another.
        """
        if new_publishers:
            self._last.clear()
        else:
            self.lost += self._unconfirmed
        self._unconfirmed = 0
