"""Chooses the free-surface detector for a calibration."""

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
    """Interface of all free-surface detectors."""

    @property
    def still_offset(self) -> float:
        """Offset measured on the liquid at rest, which is subtracted from heights [m]."""

    @property
    def doubt(self) -> str:
        """Describes why the image of the liquid at rest is ambiguous; empty if it is not."""

    def learn_still(self, image: Image, /) -> float:
        """Takes an image of the liquid at rest as reference; returns its level above zero [m]."""

    def measure(self, stamp_ns: int, image: Image, /) -> Measurement:
        """Measures the free surface in a single image, without using other images."""

    def update(self, stamp_ns: int, image: Image, /) -> Measurement:
        """Measures the next image of a sequence, and flags an image that repeats earlier ones."""

    def look(self, image: Image, /) -> Any:
        """Analyses a single image, which is most of the work and can run in any process."""

    def follow(self, stamp_ns: int, sighting: Any, /) -> Measurement:
        """Completes the measurement of a sequence's next image from the result of `look`."""


def detector_for(
    calibration: AnyCalibration, settings: DetectionSettings | None = None
) -> FreeSurfaceDetector | SideViewDetector:
    """Creates the detector for a calibration of a cylinder or of a side view.

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
