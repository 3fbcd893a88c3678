"""QoS profiles: reliable for publishers, compatible with any publisher for subscriptions.

A reader that asks for less than the writer offers is always matched; the other way round it gets
nothing. No profile has a deadline: a reader with one hears nothing from a writer without.
"""

from __future__ import annotations

from typing import Final

from rclpy.qos import QoSDurabilityPolicy as Durability
from rclpy.qos import QoSHistoryPolicy as History
from rclpy.qos import QoSLivelinessPolicy as Liveliness
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy as Reliability

STREAM_DEPTH: Final = 1000
"""One second of messages at 1 kHz: longer than any pause of a process that is alive."""


def _profile(reliability: Reliability, durability: Durability, depth: int) -> QoSProfile:
    return QoSProfile(
        history=History.KEEP_LAST,
        depth=depth,
        reliability=reliability,
        durability=durability,
        liveliness=Liveliness.AUTOMATIC,
    )


STREAM_OUT: Final = _profile(Reliability.RELIABLE, Durability.VOLATILE, STREAM_DEPTH)
"""To publish accelerations, estimates, measurements."""
LATCHED_STREAM: Final = _profile(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, 1)
"""To publish what a late reader needs at once, and what comes again and again."""
STREAM_IN: Final = _profile(Reliability.BEST_EFFORT, Durability.VOLATILE, STREAM_DEPTH)
"""To read them: sensor data, with room for a pause."""
NEWEST_IN: Final = _profile(Reliability.BEST_EFFORT, Durability.VOLATILE, 1)
"""To look at the newest of them, now and then."""
IMAGE_OUT: Final = _profile(Reliability.RELIABLE, Durability.VOLATILE, 10)
"""To publish images."""
IMAGE_IN: Final = _profile(Reliability.BEST_EFFORT, Durability.VOLATILE, 1)
"""To process images of any publisher: the newest alone."""
IMAGE_RELIABLE_IN: Final = _profile(Reliability.RELIABLE, Durability.VOLATILE, 1)
"""The same where it is offered: of large images read as best effort Fast DDS loses many."""
PLANNED_IN: Final = _profile(Reliability.RELIABLE, Durability.VOLATILE, 10)
"""To read trajectories: too large for best effort, and whoever plans publishes reliable."""
EVENT: Final = _profile(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, 100)
"""Events and latched facts, both ends: a late joiner receives the latest ones."""
DIAGNOSTICS: Final = _profile(Reliability.RELIABLE, Durability.VOLATILE, 10)
"""/diagnostics, as its usual publishers and viewers have it."""
