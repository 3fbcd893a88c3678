"""The detector that fits a calibration."""

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
    """What every detector can do; images are (height, width) or (height, width, 3)."""

    @property
    def still_offset(self) -> float:
        """Height that was measured on the liquid at rest and is subtracted since [m]."""

    @property
    def doubt(self) -> str:
        """What the still image leaves open of the heights to come, in words; empty: nothing."""

    def learn_still(self, image: Image, /) -> float:
        """Learn from an image of the liquid at rest; the offset of its level [m]."""

    def measure(self, stamp_ns: int, image: Image, /) -> Measurement:
        """Measure one image by itself."""

    def update(self, stamp_ns: int, image: Image, /) -> Measurement:
        """Measure the next image of a sequence; flags it where it repeats the one before."""

    def look(self, image: Image, /) -> Any:
        """What an image shows by itself: most of the work, alike in every process."""

    def follow(self, stamp_ns: int, sighting: Any, /) -> Measurement:
        """The measurement of the next image of a sequence, from what `look` told of it."""


def detector_for(
    calibration: AnyCalibration, settings: DetectionSettings | None = None
) -> FreeSurfaceDetector | SideViewDetector:
    """Detector for a calibration: of a cylinder or of a rectangular container's side view.

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
