"""What the camera's driver says of its lens, held against the calibration."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.node import Node
from sensor_msgs.msg import CameraInfo

from slosh_camera.optics.camera import PinholeCamera
from slosh_msgs_py import qos, topics

DIFFERENT = 0.02
"""Focal lengths that differ by this share, or middles by this share of the image's size, are of
another lens, mode or crop: a height would be wrong by as much."""


def contradiction(camera: PinholeCamera, width: int, height: int, k: Sequence[float]) -> str:
    """What a driver says otherwise than the calibration, in one line; empty: nothing.

    Args:
        camera: of the calibration.
        width: of the driver's images [px]; 0: it does not say.
        height: likewise.
        k: its camera matrix, nine numbers row by row [px]; the first is 0: it does not say.
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
    remedy = "calibrate anew with this camera as it is set, or mend what its driver is told"
    return f"camera_info says {told}: {remedy}" if told else ""


class DriverInfo:
    """Listens to the driver's camera_info. Where none is published there is nothing to hold.

    Attributes:
        contradiction: what it says otherwise than the calibration, in one line; empty: nothing.
    """

    def __init__(self, node: Node, camera: PinholeCamera) -> None:
        self.contradiction = ""
        self._camera, self._logger = camera, node.get_logger()
        node.create_subscription(CameraInfo, topics.CAMERA_INFO, self._take, qos.NEWEST_IN)

    def _take(self, message: CameraInfo) -> None:
        # Of a part of the sensor, or of binned pixels, the numbers are not those of the image.
        whole = message.binning_x <= 1 and message.binning_y <= 1 and not message.roi.width
        k = message.k.tolist()
        found = contradiction(self._camera, message.width, message.height, k) if whole else ""
        if found and found != self.contradiction:
            self._logger.warning(found)
        self.contradiction = found
