"""What comes to the camera node: images, another container, and the driver's camera_info."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo

from slosh_base.files.nanoseconds import SECOND
from slosh_camera.calibrate.camera_file import format_calibration
from slosh_camera.detection.detectors import SurfaceDetector, detector_for
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image
from slosh_camera.measurement import Flag, Measurement
from slosh_camera.optics.calibration import AnyCalibration, refilled
from slosh_camera.optics.camera import PinholeCamera, camera_from_info
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.model_text import parse_model
from slosh_model.tray import parse_tray
from slosh_msgs.msg import ContainerChange
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.settings import SettingsPublisher
from slosh_msgs_py.node.speakers import WithInfo
from slosh_msgs_py.stamps import to_nanoseconds

_REMEMBERED = 40
_ENOUGH = 8


class _Looking(NamedTuple):
    """The detector in use, and the reason if images cannot be measured.

    Attributes:
        why_not: why nothing can be measured; empty: it can.
        wrong: whether that is a fault.
    """

    detector: SurfaceDetector
    why_not: str = ""
    wrong: bool = False


class FollowingDetector:
    """Measures each image with the calibration of the container held at its stamp.

    Args:
        calibration: of the container that was calibrated.
        detector: of that one, with what its still image taught.
        place: name of the container on a tray; empty: the first, or the only one.
        settings: takes the calibration that holds from a stamp on.
    """

    def __init__(
        self,
        node: Node,
        calibration: AnyCalibration,
        detector: SurfaceDetector,
        place: str,
        settings: SettingsPublisher,
    ) -> None:
        self._node, self._calibration = node, calibration
        self._place, self._settings = place, settings
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

    def _changed(self, found: AnyCalibration, stamp_ns: int) -> None:
        self._settings.publish({"calibration": format_calibration(found)}, stamp_ns)

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


DIFFERENT = 0.02
"""Focal lengths that differ by this share, or middles by this share of the image's size, are of
another lens, mode or crop: a height would be wrong by as much."""
_GRID = 5
"""Places along each side of the image at which two lenses are compared."""


def contradiction(
    camera: PinholeCamera,
    width: int,
    height: int,
    k: Sequence[float],
    lens: tuple[str, Sequence[float]] | None = None,
) -> str:
    """Describes how a driver's camera_info contradicts the calibration; empty if it agrees.

    Args:
        width: of the driver's images [px]; 0: it does not say.
        k: its camera matrix, nine numbers row by row [px]; the first is 0: it does not say.
        lens: its distortion model and coefficients; None: they do not apply to these images.
    """
    told = ""
    if width and height and (width, height) != camera.size:
        told = f"{width} x {height} pixels, the calibration {camera.width} x {camera.height}"
    elif k[0] > 0.0:
        pairs = {
            "fx": (k[0], camera.fx, camera.fx),
            "fy": (k[4], camera.fy, camera.fy),
            "cx": (k[2], camera.cx, camera.width),
            "cy": (k[5], camera.cy, camera.height),
        }
        for name, (said, known, scale) in pairs.items():
            if abs(said - known) > DIFFERENT * scale:
                told = f"{name} = {said:.6g} px, the calibration {known:.6g} px"
                break
        if not told and lens is not None:
            told = _other_lens(camera, width, height, k, lens)
    remedy = (
        "calibrate again with the camera's present settings, or correct the driver's configuration"
    )
    return f"camera_info gives {told}: {remedy}" if told else ""


def _other_lens(
    camera: PinholeCamera,
    width: int,
    height: int,
    k: Sequence[float],
    lens: tuple[str, Sequence[float]],
) -> str:
    """Describes how far the driver's lens model shifts pixels; empty if the shift is small."""
    model, coefficients = lens
    try:
        driver = camera_from_info(k, coefficients, width, height, model)
    except SloshCameraError:
        return f"a lens {model!r} with {len(coefficients)} coefficients, which is not supported"
    across, down = np.meshgrid(
        np.linspace(0.0, width - 1, _GRID), np.linspace(0, height - 1, _GRID)
    )
    pixels = np.column_stack((across.ravel(), down.ravel()))
    moved = np.linalg.norm(driver.project(camera.rays(pixels)) - pixels, axis=1)
    if not np.any(moved > 0.5 * DIFFERENT * width):
        return ""
    return (
        f"a lens {driver.distortion_model} that moves pixels by up to {np.nanmax(moved):.0f} px "
        f"against the calibration's {camera.distortion_model}"
    )


class DriverInfo:
    """Subscribes to the driver's camera_info and compares it with the calibration.

    Args:
        container: that the camera sees on a tray; empty: the first, or the only one.

    Attributes:
        contradiction: what it says otherwise than the calibration, in one line; empty: nothing.
    """

    def __init__(self, node: Node, camera: PinholeCamera, container: str = "") -> None:
        self.contradiction = ""
        self._camera, self._logger = camera, node.get_logger()
        images, info = (
            topics.of_container(name, container) for name in (topics.IMAGE, topics.CAMERA_INFO)
        )
        # Rectified images have no distortion left, whatever camera_info says of the raw ones.
        self._raw = "rect" not in node.resolve_topic_name(images)
        node.create_subscription(CameraInfo, info, self._take, qos.NEWEST_IN)

    def _take(self, message: CameraInfo) -> None:
        # Of a part of the sensor, or of binned pixels, the numbers are not those of the image.
        whole = message.binning_x <= 1 and message.binning_y <= 1 and not message.roi.width
        k = message.k.tolist()
        lens = (message.distortion_model, message.d.tolist()) if self._raw else None
        found = (
            contradiction(self._camera, message.width, message.height, k, lens) if whole else ""
        )
        if found and found != self.contradiction:
            self._logger.warning(found)
        self.contradiction = found


class NewestImage:
    """Image subscription that drops all waiting images except the newest.

    The queue holds one image, so that work never lags behind by more than that. It reads
    reliably: of large images read as best effort Fast DDS loses many. Where a publisher offers
    no more than best effort, that is taken.

    Attributes:
        dropped: images that were published and not read: a newer one came, or they were lost.
    """

    def __init__(self, node: Node, kind: Any, topic: str, use: Callable[[Any], None]) -> None:
        """Creates the subscription to the image topic."""
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
