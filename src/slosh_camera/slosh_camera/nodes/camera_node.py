"""Camera node: measures free-surface heights in camera images and publishes them."""

from __future__ import annotations

import math
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sensor_msgs.msg import CompressedImage, Image

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compilation import load_telling
from slosh_base.compiled.compile_cache import sources_digest
from slosh_base.files.nanoseconds import SECOND
from slosh_camera.calibrate.camera_file import read_any_calibration
from slosh_camera.detection.detectors import learnt_detector
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image as Pixels
from slosh_camera.images.decoding import decode_compressed, to_image
from slosh_camera.measurement import Flag, Measurement, bad_image
from slosh_camera.nodes.camera_input import DriverInfo, FollowingDetector, FrameGaps, NewestImage
from slosh_msgs.msg import FreeSurface
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.images import image_bytes
from slosh_msgs_py.node.diagnostics import ERROR, OK, STALE, WARN, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_msgs_py.node.readiness import Progress
from slosh_msgs_py.node.rivals import Rivals
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.node.settings import SettingsPublisher
from slosh_msgs_py.node.silence import SilentTopic
from slosh_msgs_py.stamps import MAXIMUM, to_nanoseconds

MANY = 0.25
"""Where this share of the images is dropped between two reports, the node cannot keep pace."""
PARAMETERS = (
    ParameterSpec("calibration", "", "camera.yaml: camera, container and pose"),
    ParameterSpec(
        "still_image",
        "",
        "image of the liquid at rest, used as reference; empty: the one in camera.yaml",
    ),
    ParameterSpec("transport", "raw", "kind of images to read", choices=("raw", "compressed")),
    ParameterSpec("container_frame", "container", "container's frame in all published messages"),
    ParameterSpec(
        "container",
        "",
        "name of the container on a tray that the camera sees, used as frame in all messages "
        "and as part of the topic names; empty: the first container, or the only one",
    ),
    ParameterSpec(
        "frame_rate",
        0.0,
        "image rate of the camera, to count missing images [Hz]; 0: determined from the stamps",
        (0.0, 1000.0),
    ),
)

PERIOD_NS = 5 * SECOND
_MOST = 5


class CameraNode(PreparedNode):
    """Node that measures the newest camera image and publishes the free surface.

    Args:
        later: it gets ready by `run_node`.
    """

    def __init__(self, *, later: bool = False) -> None:
        super().__init__("camera")
        self._given = given = declare(self, PARAMETERS)
        self._container = given["container"]
        self._frame = self._container or given["container_frame"]
        self._calibration = read_any_calibration(given["calibration"])
        self._rim = self._calibration.view.container.rim_level
        self._is_raw = given["transport"] == "raw"
        self._image = self._named(topics.IMAGE if self._is_raw else topics.IMAGE_COMPRESSED)
        surfaces = self._named(topics.FREE_SURFACE)
        self._settings = SettingsPublisher(
            self, sources_digest("slosh_camera"), arithmetic_fingerprint(), given,
            (self._image, surfaces),
        )  # fmt: skip
        text = Path(given["calibration"]).read_text(encoding="utf-8")
        self._settings.publish({"calibration": text})
        self._publisher = self.create_publisher(FreeSurface, surfaces, qos.STREAM_OUT)
        self._gaps = FrameGaps(given["frame_rate"])
        self._flags: Counter[Flag] = Counter()
        self._recent = Flag.NONE
        self._levels = LevelChanges()
        self._images = self._reported = self._refused = self._dropped = 0
        self._contested = ""
        self._complaints = Complaints(self.get_logger().error)
        self._watch(self._health, self._facts)
        self._get_ready(later=later)

    def _named(self, topic: str) -> str:
        """Returns a topic's name with the name of the container that the camera sees."""
        return topics.of_container(topic, self._container)

    def prepare(self, progress: Progress) -> None:
        """Compiles or loads the detector and passes it the image of the liquid at rest."""
        load_telling(progress, "slosh_camera")
        still_image = self._given["still_image"] or None
        self._detector = learnt_detector(self._calibration, still_image)
        if self._detector.doubt:
            self.get_logger().warning(f"still image: {self._detector.doubt}")

    def begin(self) -> None:
        """Subscribes to the camera images."""
        kind, use = (Image, self._on_image)
        if not self._is_raw:
            kind, use = (CompressedImage, self._on_compressed)
        self._looking = FollowingDetector(
            self, self._calibration, self._detector, self._container, self._settings
        )
        type_name = f"sensor_msgs/msg/{kind.__name__}"
        self._topic = SilentTopic(self, self._image, type_name)
        self._rivals = Rivals(self, self._image, type_name)
        self._driver = DriverInfo(self, self._calibration.view.camera, self._container)
        self._input = NewestImage(self, kind, self._image, use)

    def _on_image(self, message: Image) -> None:
        self._measure(
            message.header.stamp,
            lambda: to_image(
                message.encoding,
                message.height,
                message.width,
                message.step,
                image_bytes(message),
                big_endian=bool(message.is_bigendian),
            ),
        )

    def _on_compressed(self, message: CompressedImage) -> None:
        self._measure(
            message.header.stamp, lambda: decode_compressed(message.format, image_bytes(message))
        )

    def _measure(self, stamp: Any, decode: Callable[[], Pixels]) -> None:
        self._images += 1
        self._report.counts["image"] += 1
        stamp_ns = to_nanoseconds(stamp)
        if not 0 <= stamp_ns <= MAXIMUM:
            self._refused += 1
            self._recent |= Flag.BAD_IMAGE
            self._complain(f"image: invalid stamp of {stamp_ns} ns; check the camera's driver")
            return
        self._gaps.add(stamp_ns)
        try:
            measurement = self._looking.update(stamp_ns, decode())
        except SloshCameraError as error:
            self._complain(str(error))
            measurement = bad_image(stamp_ns)
        if self._contested:
            measurement = measurement.flagged(Flag.CONTESTED)
        self._recent |= measurement.flags
        self._flags.update(measurement.flags)
        self._levels.add(measurement)
        self._publisher.publish(surface_message(measurement, self._frame, self._rim))
        self._report.counts["measurement"] += 1
        self._report.latency(int(self.get_clock().now().nanoseconds) - stamp_ns)

    def _complain(self, complaint: str) -> None:
        self._complaints.add(complaint, time.monotonic_ns())

    def _health(self) -> Health:
        measured, self._reported = self._images - self._reported, self._images
        dropped, self._dropped = self._input.dropped - self._dropped, self._input.dropped
        recent, self._recent = self._recent, Flag.NONE
        level = self._levels.report(measured, told=self._looking.is_told)
        self._contested = self._rivals.look()
        if not measured:
            return STALE, f"no image for {self._topic.seconds:.0f} s: {self._topic.reason()}"
        self._topic.heard()
        if self._contested:
            return ERROR, self._contested
        why_not, wrong = self._looking.why_not
        if why_not:
            return ERROR if wrong else OK, why_not
        if Flag.BAD_IMAGE in recent:
            return ERROR, self._complaints.last
        if self._driver.contradiction:
            return WARN, self._driver.contradiction
        if level:
            return WARN, level
        if recent:
            names = ", ".join(str(flag.name) for flag in recent)
            return WARN, f"measuring, with flags: {names}"
        if dropped > MANY * (measured + dropped):
            return WARN, (
                f"measuring {measured} of {measured + dropped} images: they arrive faster than "
                "they can be measured; reduce the camera's image rate or size"
            )
        return OK, "measuring"

    def _facts(self) -> dict[str, Any]:
        flags = {f"flag {flag.name}": count for flag, count in self._flags.items()}
        still = self._given["still_image"] or self._calibration.still_image
        return {
            "still image": str(still or "none"),
            "missing images": self._gaps.missing,
            "dropped images": self._input.dropped,
            "dropped: impossible stamp": self._refused,
            **flags,
            **self._topic.facts(self._images),
        }


def surface_message(measurement: Measurement, frame: str, rim: float | None) -> FreeSurface:
    """Converts a measurement to a FreeSurface message; `rim` is the rim's height [m]."""
    return filled(
        FreeSurface,
        stamp_ns=measurement.stamp_ns,
        frame_id=frame,
        msh=measurement.msh,
        msh_stddev=measurement.msh_stddev,
        azimuth=measurement.azimuth,
        fitted_msh=measurement.fitted_msh,
        fitted_msh_stddev=measurement.fitted_msh_stddev,
        fitted_azimuth=measurement.fitted_azimuth,
        sh_left=measurement.sh_left,
        sh_right=measurement.sh_right,
        azimuth_left=measurement.azimuth_left,
        azimuth_right=measurement.azimuth_right,
        distance_to_rim=(math.nan if rim is None else rim) - measurement.msh,
        slope_angle=measurement.slope_angle,
        profile_azimuth=measurement.profile_azimuth,
        profile_height=measurement.profile_height,
        peak_u=measurement.peak_pixel[0],
        peak_v=measurement.peak_pixel[1],
        peak_side=int(measurement.peak_side),
        flags=int(measurement.flags),
    )


class Complaints:
    """Logs warnings at most once per period, and only a few different ones."""

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._told: set[str] = set()
        self._begin_ns: int | None = None
        self.last = ""

    def add(self, complaint: str, now_ns: int) -> None:
        """Logs a warning unless it was logged recently.

        Args:
            now_ns: by a clock that never jumps [ns].
        """
        self.last = complaint
        if self._begin_ns is None or now_ns - self._begin_ns >= PERIOD_NS:
            self._begin_ns, self._told = now_ns, set()
        if complaint not in self._told and len(self._told) < _MOST:
            self._told.add(complaint)
            self._tell(complaint)


class LevelChanges:
    """Counts measured images that show a changed liquid level, for a warning."""

    def __init__(self) -> None:
        self._changes: list[tuple[float, float]] = []

    def add(self, measurement: Measurement) -> None:
        """Counts one measurement and whether it shows a changed level."""
        if Flag.LEVEL_CHANGED in measurement.flags:
            self._changes.append((measurement.level_change, measurement.level_change_stddev))

    def report(self, images: int, *, told: bool = False) -> str:
        """Returns a warning if most images since the last call show a changed level; else empty.

        Args:
            images: how many there were since the last report.
            told: whether the level is that of a fill height that was told, not of a still image.
        """
        changes, self._changes = self._changes, []
        if 2 * len(changes) <= images:
            return ""
        level, stddev = (statistics.median(part) for part in zip(*changes, strict=True))
        size = f"{1e3 * level:+.1f} ± {max(1e3 * stddev, 0.1):.1f} mm"
        seen = f"({len(changes)} of {images} images)"
        if told:
            return (
                f"the liquid's level is {size} from the fill height that was set {seen}: check "
                "the fill height, and which container it is"
            )
        return (
            f"the liquid's level has changed by {size} since the still image {seen}: heights "
            "refer to the old level; record a new still image and correct the fill height of "
            "camera and model"
        )


def main() -> int:
    """Runs the camera node."""
    return run_node(lambda: CameraNode(later=True))


if __name__ == "__main__":
    sys.exit(main())
