"""Subscribes to images, passes on only the newest one and counts missing frames."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node

from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py import qos
from slosh_msgs_py.node.speakers import WithInfo

_REMEMBERED = 40
_ENOUGH = 8


class NewestImage:
    """Image subscription that drops all waiting images except the newest.

    The queue holds one image, so that work never lags behind by more than that. It reads
    reliably: of large images read as best effort Fast DDS loses many. Where a publisher offers
    no more than best effort, that is taken.

    Attributes:
        dropped: images that were published and not read: a newer one came, or they were lost.
    """

    def __init__(self, node: Node, kind: Any, topic: str, use: Callable[[Any], None]) -> None:
        """Creates the subscription to the image topic.

        Args:
            node: the node.
            kind: Image or CompressedImage.
            topic: where the images are.
            use: gets each image.
        """
        self._node, self._kind, self._topic, self._use = node, kind, topic, use
        self.dropped = 0
        self._last: int | None = None
        self._subscription = self._subscribe(qos.IMAGE_RELIABLE_IN)

    @property
    def is_reliable(self) -> bool:
        """Whether the subscription's QoS is reliable."""
        return bool(self._subscription.qos_profile == qos.IMAGE_RELIABLE_IN)

    def _subscribe(self, profile: Any) -> Any:
        events = SubscriptionEventCallbacks(
            incompatible_qos=self._on_incompatible, use_default_callbacks=False
        )
        callback = WithInfo(self._on_image)
        return self._node.create_subscription(
            self._kind, self._topic, callback, profile, event_callbacks=events
        )

    def _on_incompatible(self, event: Any) -> None:
        if self.is_reliable:
            self._node.get_logger().warning(
                f"{self._topic}: a publisher offers best effort only, some images may be lost"
            )
            reliable = self._subscription
            self._subscription = self._subscribe(qos.IMAGE_IN)
            self._node.destroy_subscription(reliable)
            self._last = None

    def _on_image(self, message: Any, info: Mapping[str, Any]) -> None:
        number = info.get("publication_sequence_number")
        if number is not None:
            # A publisher that starts anew counts from the beginning.
            if self._last is not None and number > self._last:
                self.dropped += number - self._last - 1
            self._last = number
        self._use(message)


class FrameGaps:
    """Counts frames that are missing in an image stream.

    A gap of more than a second is a pause of the camera, not a loss. Where every second frame is
    lost from the start, nothing in the stamps shows it: then only a stated rate does.

    Args:
        rate: frames per second of the camera [Hz]; 0: the one that the stamps show.
    """

    def __init__(self, rate: float = 0.0) -> None:
        self._period_ns = SECOND / rate if rate > 0.0 else 0.0
        self._intervals: deque[int] = deque(maxlen=_REMEMBERED)
        self._last_ns: int | None = None
        self.missing = 0

    def add(self, stamp_ns: int) -> None:
        """Adds the stamp of the next frame [ns]; a decreasing stamp resets the counter."""
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if last_ns is None or not 0 < stamp_ns - last_ns <= SECOND:
            return
        interval = stamp_ns - last_ns
        period = self._period_ns or self._learned()
        self._intervals.append(interval)
        if period > 0.0:
            self.missing += max(round(interval / period) - 1, 0)

    def _learned(self) -> float:
        if len(self._intervals) < _ENOUGH:
            return 0.0
        # The lower quartile: right as long as three of four gaps may be due to losses.
        return float(sorted(self._intervals)[len(self._intervals) // 4])
