"""Detector of the camera node that adapts when the robot picks up another container."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from rclpy.node import Node

from slosh_camera.detection.detectors import SurfaceDetector, detector_for
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image
from slosh_camera.measurement import Flag, Measurement
from slosh_camera.optics.calibration import AnyCalibration
from slosh_camera.optics.refilled import refilled
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.model_text import parse_model
from slosh_model.tray import parse_tray
from slosh_msgs.msg import ContainerChange
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds


class _Looking(NamedTuple):
    """The detector in use, and the reason if images cannot be measured.

    Attributes:
        detector: the detector.
        why_not: why nothing can be measured; empty: it can.
        wrong: whether that is a fault.
    """

    detector: SurfaceDetector
    why_not: str = ""
    wrong: bool = False


class FollowingDetector:
    """Measures each image with the calibration of the container held at its stamp.

    Args:
        node: the node.
        calibration: of the container that was calibrated.
        detector: of that one, with what its still image taught.
        place: name of the container on a tray; empty: the first, or the only one.
        changed: is told the calibration that holds from a stamp on [ns].
    """

    def __init__(
        self,
        node: Node,
        calibration: AnyCalibration,
        detector: SurfaceDetector,
        place: str,
        changed: Callable[[AnyCalibration, int], None],
    ) -> None:
        self._node, self._calibration, self._changed = node, calibration, changed
        self._place = place
        self._start = self._now = self._next = _Looking(detector)
        self._next_ns, self._is_first = 0, True
        node.create_subscription(
            ContainerChange, topics.CONTAINER, self._on_change, qos.LATCHED_STREAM
        )

    def update(self, stamp_ns: int, image: Image) -> Measurement:
        """Measures the next image with the detector for the current container.

        Raises:
            SloshCameraError: it does not fit the camera.
        """
        if self._now is not self._next and stamp_ns > self._next_ns:
            self._now = self._next
        if self._now.why_not:
            return Measurement(stamp_ns=stamp_ns, flags=Flag.NOT_FOUND)
        return self._now.detector.update(stamp_ns, image)

    @property
    def is_told(self) -> bool:
        """Whether the still level comes from a new container or fill, not the calibration."""
        return self._now.detector is not self._start.detector

    @property
    def why_not(self) -> tuple[str, bool]:
        """The reason why images cannot be measured, else empty; and whether it is a fault."""
        return self._now.why_not, self._now.wrong

    def _on_change(self, message: ContainerChange) -> None:
        stamp_ns = to_nanoseconds(message.header.stamp)
        try:
            self._look(message, stamp_ns)
        except (SloshCameraError, SloshModelError) as error:
            text = f"{topics.CONTAINER}: this container cannot be measured: {error}"
            self._node.get_logger().error(text)
            self._next, self._next_ns = _Looking(self._start.detector, text, wrong=True), stamp_ns

    def _look(self, message: ContainerChange, stamp_ns: int) -> None:
        before, is_first = self._next, self._is_first
        self._is_first = False
        if not message.model:  # the estimator has started
            if before is not self._start:
                self._next, self._next_ns = self._start, stamp_ns
                self._changed(self._calibration, stamp_ns)
            return
        place, held = self._held(message)
        if message.tray and not is_first and message.tray_place != place:
            return  # another place of the tray has changed
        if held is None:
            looking = before._replace(why_not="no container: the gripper is empty", wrong=False)
        elif not self._place and math.isnan(message.fill_height):
            looking = before  # another model of what is there
        else:
            found = refilled(self._calibration, held.container)
            same = found is self._calibration
            looking = self._start if same else _Looking(detector_for(found))
            self._changed(found, stamp_ns)
        if looking is not before:
            self._next, self._next_ns = looking, stamp_ns

    def _held(self, message: ContainerChange) -> tuple[str, Model | None]:
        """Returns the tray place that the camera sees, and the model of the container there.

        The name is empty where there is no tray, the model None where the place is empty.

        Raises:
            SloshCameraError: the tray has no such place.
            SloshModelError: the message cannot be read.
        """
        if message.tray:
            tray = parse_tray(message.tray, f"{topics.CONTAINER}.tray")
            place = self._place or tray.first.name
            if place not in tray.names:
                raise SloshCameraError(f"container = {place}: the tray has no such container")
            one = tray.containers[tray.names.index(place)]
            return place, None if one.empty else one.model
        held = parse_model(message.model, f"{topics.CONTAINER}.model")
        return "", held if message.present else None
