"""Selects the detector of a calibration."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Measurement
from slosh_camera.optics.calibration import AnyCalibration, Calibration, SideCalibration
from slosh_camera.rectangle.detector import SideViewDetector
from slosh_camera.settings import DetectionSettings

Image = NDArray[np.uint8]


class SurfaceDetector(Protocol):
    """Interface of all detectors; images are (height, width) or (height, width, 3)."""

    @property
    def still_offset(self) -> float:
        """Offset measured on the liquid at rest, which is subtracted from heights [m]."""

    @property
    def doubt(self) -> str:
        """Describes ambiguities of the still image; empty: none."""

    def learn_still(self, image: Image, /) -> float:
        """Learns from an image of the liquid at rest; returns the offset of its level [m]."""

    def measure(self, stamp_ns: int, image: Image, /) -> Measurement:
        """Measures one image by itself."""

    def update(self, stamp_ns: int, image: Image, /) -> Measurement:
        """Measures the next image of a sequence; flags it if it repeats the previous one."""

    def look(self, image: Image, /) -> Any:
        """Analyses an image by itself: most of the work, the same in every process."""

    def follow(self, stamp_ns: int, sighting: Any, /) -> Measurement:
        """Measures the next image of a sequence from the result of `look`."""


def detector_for(
    calibration: AnyCalibration, settings: DetectionSettings | None = None
) -> FreeSurfaceDetector | SideViewDetector:
    """Makes the detector of a calibration: cylinder, or side view of a rectangle.

    Args:
        calibration: what the camera looks at.
        settings: settings; None: those of the calibration.

    Returns:
        The detector; it is a SurfaceDetector.

    Raises:
        SloshCameraError: too little of the container is inside the image, or this is no
            calibration.
    """
    if isinstance(calibration, SideCalibration):
        return SideViewDetector(calibration, settings)
    if isinstance(calibration, Calibration):
        return FreeSurfaceDetector(calibration, settings)
    raise SloshCameraError(f"calibration: {type(calibration).__name__} is not a calibration")
