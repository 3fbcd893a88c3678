"""The free-surface detector for a calibration, initialised with an image of the liquid at rest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from slosh_base.compiled.compilation import load_all
from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image
from slosh_camera.images.decoding import read_image
from slosh_camera.measurement import Measurement
from slosh_camera.optics.calibration import AnyCalibration, Calibration, SideCalibration
from slosh_camera.rectangle.detector import SideViewDetector
from slosh_camera.settings import DetectionSettings


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


def learnt_detector(
    calibration: AnyCalibration, still_image: str | Path | None = None
) -> SurfaceDetector:
    """Creates a calibration's detector, initialised with an image of the liquid at rest.

    Args:
        calibration: what the camera looks at.
        still_image: the image; None: the one that the calibration names, if it names one.

    Returns:
        The detector; without any still image one that takes the calibration's level for zero.

    Raises:
        SloshCameraError: the calibration or the still image cannot be used; the text names the
            file.
    """
    if still_image is not None:
        calibration = replace(calibration, still_image=Path(still_image))
    detector = detector_for(calibration)
    if isinstance(detector, FreeSurfaceDetector):
        load_all(package="slosh_camera")  # so that the first image does not wait for it
    if calibration.still_image is None:
        return detector
    image = read_still_image(calibration)
    try:
        detector.learn_still(image)
    except SloshCameraError as error:
        raise SloshCameraError(f"{calibration.still_image}: {error}") from None
    return detector


def still_doubt(calibration: AnyCalibration, image: Image) -> str:
    """Returns why a camera's images may be unmeasurable, by its image of the liquid at rest.

    Args:
        calibration: what the camera looks at.

    Returns:
        One line; empty: nothing speaks against it.
    """
    detector = detector_for(calibration)
    try:
        detector.learn_still(image)
    except SloshCameraError as error:
        return str(error)
    return detector.doubt


def read_still_image(calibration: AnyCalibration) -> Image:
    """Reads the image of the liquid at rest that a calibration refers to.

    Returns:
        (height, width) grey or (height, width, 3) blue-green-red.

    Raises:
        SloshCameraError: no image is named, the file cannot be read, holds no image, or one of
            another size than the camera's.
    """
    path, camera = calibration.still_image, calibration.view.camera
    if path is None:
        raise SloshCameraError("still_image: the calibration has none")
    image = read_image(path)
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise SloshCameraError(
            f"{path}: has {width} x {height} pixels, the calibration is for {camera.width} x "
            f"{camera.height}"
        )
    return image
