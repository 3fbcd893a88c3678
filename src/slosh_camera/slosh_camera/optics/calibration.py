"""A calibration: a container in one camera's view, and the detection settings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Generic, TypeVar

from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.box import BoxView
from slosh_camera.optics.camera import Pose
from slosh_camera.optics.cup import Cup, CupView
from slosh_camera.settings import DetectionSettings, RegionOfInterest
from slosh_model.containers import Container
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.shapes.round_cups import Frustum

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


def refilled(calibration: AnyCalibration, container: Container) -> AnyCalibration:
    """Returns the calibration for another container that stands in the same place.

    The inner floor stays where it was calibrated, so the frame's origin, the centre of the still
    surface, moves along the container's axis by the difference of the fill heights. A cup's
    radius and taper, a rectangle's width and depth, and the rim are those of the container; the
    walls are the calibrated ones. The still image goes: it shows the level of before.

    Args:
        calibration: of the container that was calibrated.
        container: the new one; of another shape its fill height and rim alone count.

    Returns:
        The calibration itself where nothing differs.

    Raises:
        SloshCameraError: the camera cannot see that container from there.
    """
    if isinstance(calibration, Calibration):
        cup = calibration.view.cup
        rise = container.fill_height - cup.fill_height
        changed_cup = replace(
            cup, radius=float(cup.radius_at(rise)), fill_height=container.fill_height,
            rim_height=_rim(container, cup.rim_height),
        )  # fmt: skip
        if isinstance(container, Cylinder | Frustum):
            own = Cup.of(container)
            changed_cup = replace(changed_cup, radius=own.radius, taper=own.taper)
        if changed_cup == cup:
            return calibration
        pose = _risen(calibration.view.pose, rise)
        seen = replace(calibration.view, pose=pose, cup=changed_cup)
        return Calibration(
            seen, calibration.camera_name, calibration.region, calibration.detection
        )
    assert isinstance(calibration, SideCalibration)
    box = calibration.view.box
    width, depth = box.width, box.depth
    if isinstance(container, Rectangle):
        width, depth = container.width, depth and container.depth
    changed_box = replace(
        box, width=width, depth=depth, fill_height=container.fill_height,
        rim_height=_rim(container, box.rim_height),
    )  # fmt: skip
    if changed_box == box:
        return calibration
    pose = _risen(calibration.view.pose, container.fill_height - box.fill_height)
    side = replace(calibration.view, pose=pose, box=changed_box)
    return SideCalibration(
        side, calibration.camera_name, calibration.region, calibration.detection
    )


def _risen(pose: Pose, rise: float) -> Pose:
    """Returns the pose after moving the container frame up along its own z axis [m]."""
    return Pose(pose.rotation, pose.translation + rise * pose.rotation[:, 2])


def _rim(container: Container, calibrated: float | None) -> float | None:
    """Returns the new container's rim height, else the calibrated rim height; None if unknown."""
    if container.rim_height is not None:
        return container.rim_height
    above = calibrated is not None and calibrated > container.fill_height
    return calibrated if above else None
