"""Compares the lens in the driver's camera_info with the calibration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo

from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera, camera_from_info
from slosh_msgs_py import qos, topics

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
        camera: of the calibration.
        width: of the driver's images [px]; 0: it does not say.
        height: likewise.
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
        node: the node.
        camera: of the calibration.
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
