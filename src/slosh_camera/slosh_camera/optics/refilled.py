"""A calibration for another container, or another fill, in the same place."""

from __future__ import annotations

from dataclasses import replace

from slosh_camera.optics.calibration import AnyCalibration, Calibration
from slosh_camera.optics.pose import Pose
from slosh_model.containers import Container, Cylinder, Rectangle


def refilled(calibration: AnyCalibration, container: Container) -> AnyCalibration:
    """The calibration of what the camera sees once a container stands where the other one stood.

    The inner floor stays where it was calibrated, so the frame's origin, the centre of the still
    surface, moves along the container's axis by the difference of the fill heights. A cylinder's
    radius, a rectangle's width and depth, and the rim are those of the container; the walls are
    the calibrated ones. The still image goes: it shows the level of before.

    Args:
        calibration: of the container that was calibrated.
        container: the new one; of another shape its fill height and rim alone count.

    Returns:
        The calibration itself where nothing differs.

    Raises:
        SloshCameraError: the camera cannot see that container from there.
    """
    view = calibration.view
    rise = container.fill_height - _filled(calibration)
    pose = Pose(view.pose.rotation, view.pose.translation + rise * view.pose.rotation[:, 2])
    heights = {"fill_height": container.fill_height}
    if container.rim_height is not None:
        heights["rim_height"] = container.rim_height
    if isinstance(calibration, Calibration):
        cup = calibration.view.cup
        radius = container.radius if isinstance(container, Cylinder) else cup.radius
        changed_cup = replace(cup, radius=radius, **_rimmed(heights, cup.rim_height))
        if changed_cup == cup:
            return calibration
        seen = replace(calibration.view, pose=pose, cup=changed_cup)
        return replace(calibration, view=seen, still_image=None)
    box = calibration.view.box
    sides: dict[str, float] = {}
    if isinstance(container, Rectangle):
        sides = {"width": container.width}
        sides |= {"depth": container.depth} if box.depth and container.depth else {}
    changed_box = replace(box, **sides, **_rimmed(heights, box.rim_height))
    if changed_box == box:
        return calibration
    side = replace(calibration.view, pose=pose, box=changed_box)
    return replace(calibration, view=side, still_image=None)


def _filled(calibration: AnyCalibration) -> float:
    if isinstance(calibration, Calibration):
        return calibration.view.cup.fill_height
    return calibration.view.box.fill_height


def _rimmed(heights: dict[str, float], rim: float | None) -> dict[str, float | None]:
    """The heights, with no rim where the calibrated one would lie below the liquid."""
    if "rim_height" in heights or rim is None or rim > heights["fill_height"]:
        return dict(heights)
    return {**heights, "rim_height": None}
