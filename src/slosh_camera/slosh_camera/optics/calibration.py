"""A calibration: a container in one camera's view, and the detection settings."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.box import BoxView
from slosh_camera.optics.cup import CupView
from slosh_camera.settings import DetectionSettings, RegionOfInterest

_View = TypeVar("_View", CupView, BoxView)


@dataclass(frozen=True, slots=True, eq=False)
class CameraCalibration(Generic[_View]):
    """Everything that is needed to convert a pixel to a height on a container's wall.

    Attributes:
        view: camera, pose and container.
        region: region of interest; None: the container as projected.
        still_image: image of the liquid at rest, from which the detector learns at start; None:
            there is none.
    """

    view: _View
    camera_name: str = "camera"
    region: RegionOfInterest | None = None
    detection: DetectionSettings = field(default_factory=DetectionSettings)
    still_image: Path | None = None

    def __post_init__(self) -> None:
        """Raises SloshCameraError if the region of interest exceeds the image."""
        region, camera = self.region, self.view.camera
        if region is not None and (
            region.x_offset + region.width > camera.width
            or region.y_offset + region.height > camera.height
        ):
            raise SloshCameraError(
                f"region_of_interest: leaves the image of {camera.width} x {camera.height} pixels"
            )


class Calibration(CameraCalibration[CupView]):
    """Calibration of a camera that views a cylinder or frustum through its wall."""

    __slots__ = ()


class SideCalibration(CameraCalibration[BoxView]):
    """Calibration of a camera that views a container from the side."""

    __slots__ = ()


AnyCalibration = Calibration | SideCalibration
