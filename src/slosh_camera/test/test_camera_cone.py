"""Tests cups with inclined walls: optics, detection, calibration and file."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from slosh_base.types import Array
from slosh_camera.calibrate.camera_file import format_calibration, parse_any_calibration
from slosh_camera.calibrate.pose import CameraPlace, cone_from_sides, place_of, pose_of
from slosh_camera.calibrate.still import calibrate_by_edges
from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag
from slosh_camera.optics.calibration import Calibration, refilled
from slosh_camera.optics.camera import PinholeCamera, look_at
from slosh_camera.optics.cup import Cup, CupView, Wall
from slosh_model.shapes import Bottle, Frustum

CAMERA = PinholeCamera(480, 360, fx=800.0, fy=800.0, cx=239.5, cy=179.5)
POSE = look_at((0.03, -0.45, 0.09), (0.0, 0.0, 0.0))
PAPER = Frustum(bottom_radius=0.028, top_radius=0.041, height=0.095, fill_height=0.055)
CUP = Cup.of(PAPER, 0.002)
VIEW = CupView(CAMERA, POSE, CUP)
AROUND = np.radians(np.arange(-180.0, 180.0, 1.0))
FINE = 8
TAPERS = (0.137, -0.1, 0.3)


def drawn(view: CupView, height: float, azimuth: float) -> cv2.typing.MatLike:
    """Returns an image of a plane liquid surface with its peak on the wall at an azimuth."""
    cup, image = view.cup, np.full((FINE * 360, FINE * 480), 185, np.uint8)
    line = cup.leaning(cup.upright(height) * np.cos(AROUND - azimuth))
    floor = view.project_wall(AROUND, -cup.fill_height, Wall.FRONT)
    front = view.project_wall(AROUND, line, Wall.FRONT)
    rear = view.project_wall(AROUND, line, Wall.REAR)
    for one, other, grey in ((front, rear, 80), (front, floor, 60)):
        outline = np.vstack((left_to_right(one), left_to_right(other)[::-1]))
        cv2.fillPoly(image, [finer(outline)], (grey,))
    half = view.side_half_angle
    for side in (half, -half):
        levels = np.array([0.0, cup.rim_level or 0.0])
        ends = view.project(cup.outer_points(view.camera_azimuth + side, levels))
        cv2.polylines(image, [finer(ends)], False, (120,), FINE)
    coarse = cv2.resize(image, (480, 360), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(cv2.GaussianBlur(coarse, (0, 0), 0.7), cv2.COLOR_GRAY2BGR)


def finer(pixels: Array) -> cv2.typing.MatLike:
    """Converts pixels (N, 2) to those of an image that is FINE times as large."""
    return np.round(FINE * (pixels + 0.5) - 0.5).astype(np.int32)[:, np.newaxis]


def left_to_right(pixels: Array) -> Array:
    """Returns the visible pixels (N, 2) along half the wall, from left to right."""
    seen = pixels[np.isfinite(pixels[:, 0])]
    ordered: Array = seen[np.argsort(seen[:, 0])]
    return ordered


def optical_length(view: CupView, entry: Array, point: Array) -> Array:
    """Returns optical lengths from the camera via outer wall points to points (N, 3) [m]."""
    outside = np.linalg.norm(entry - view.pose.camera_centre, axis=1)
    way: Array = outside + view.cup.wall_refractive_index * np.linalg.norm(point - entry, axis=1)
    return way


@pytest.mark.parametrize("taper", TAPERS)
@pytest.mark.parametrize("wall", Wall)
def test_pixels_of_wall_points_lead_back_to_them(taper: float, wall: Wall) -> None:
    view = replace(VIEW, cup=replace(CUP, taper=taper))
    heights = 0.01 * np.sin(AROUND)
    pixels = view.project_wall(AROUND, heights, wall)
    seen = np.isfinite(pixels[:, 0])
    assert np.count_nonzero(seen) > 150
    azimuth, height = view.on_wall(pixels[seen], wall)
    assert np.angle(np.exp(1j * (azimuth - AROUND[seen]))) == pytest.approx(0.0, abs=1e-8)
    assert height == pytest.approx(heights[seen], abs=1e-10)


@pytest.mark.parametrize("taper", TAPERS)
def test_light_takes_the_shortest_way_through_the_front_wall(taper: float) -> None:
    cup = replace(CUP, taper=taper)
    view = replace(VIEW, cup=cup)
    azimuth = view.camera_azimuth + np.linspace(-1.2, 1.2, 9)
    points = view.wall_points(azimuth, 0.004)
    origin, rays = view.rays(view.project_wall(azimuth, 0.004, Wall.FRONT))
    # Where the ray meets the outer cone, by bisection along it.
    flat = rays[:, :2]
    near, far = np.zeros(9), -flat @ origin[:2] / np.sum(flat**2, axis=1)
    for _ in range(80):
        middle = 0.5 * (near + far)
        at = origin + middle[:, np.newaxis] * rays
        outside = np.hypot(at[:, 0], at[:, 1]) > cup.outer_radius_at(at[:, 2])
        near, far = np.where(outside, middle, near), np.where(outside, far, middle)
    entry = origin + near[:, np.newaxis] * rays
    angle = np.arctan2(entry[:, 1], entry[:, 0])
    shortest = optical_length(view, entry, points)
    for turn, rise in ((1e-3, 0.0), (-1e-3, 0.0), (0.0, 1e-4), (0.0, -1e-4)):
        beside = cup.outer_points(angle + turn, entry[:, 2] + rise)
        assert np.all(optical_length(view, beside, points) > shortest)


def test_a_hardly_inclined_wall_is_seen_as_a_cylinder() -> None:
    cylinder = replace(VIEW, cup=replace(CUP, taper=0.0))
    cone = replace(VIEW, cup=replace(CUP, taper=1e-7))
    for wall in Wall:
        pixels = [view.project_wall(AROUND, 0.01, wall) for view in (cylinder, cone)]
        assert pixels[0] == pytest.approx(pixels[1], abs=1e-4, nan_ok=True)
    assert cone.tangent_azimuths() == pytest.approx(cylinder.tangent_azimuths(), abs=1e-4)


def test_a_plane_is_a_cosine_on_the_upright_wall() -> None:
    slope = 0.3
    heights = np.zeros(AROUND.size)
    for _ in range(50):
        heights = slope * CUP.radius_at(heights) * np.cos(AROUND)
    upright = CUP.upright(heights)
    assert upright == pytest.approx(slope * CUP.radius * np.cos(AROUND), abs=1e-12)
    assert CUP.leaning(upright) == pytest.approx(heights, abs=1e-15)


@pytest.mark.parametrize(("height", "azimuth"), [(0.012, -1.2), (0.012, 1.7), (0.006, 0.4)])
def test_the_highest_point_of_an_inclined_wall_is_measured(height: float, azimuth: float) -> None:
    detector = FreeSurfaceDetector(Calibration(VIEW))
    assert detector.learn_still(drawn(VIEW, 0.0, 0.0)) == pytest.approx(0.0, abs=2e-4)
    found = detector.measure(0, drawn(VIEW, height, azimuth))
    assert not found.flags & (Flag.NOT_FOUND | Flag.AMBIGUOUS)
    assert found.msh == pytest.approx(height, abs=3e-4)
    assert found.azimuth == pytest.approx(azimuth, abs=0.05)
    # On the inclined wall troughs are not as deep as crests are high.
    line = CUP.leaning(CUP.upright(height) * np.cos(found.profile_azimuth - azimuth))
    assert np.sqrt(np.mean((found.profile_height - line) ** 2)) < 3e-4


def test_two_sides_give_the_axis_of_a_cone() -> None:
    place, azimuth = place_of(POSE)
    side = VIEW.side_half_angle
    rays = []
    for turn in (-side, side):
        points = CUP.outer_points(azimuth + turn, np.array([-0.05, 0.03]))
        rays.append(points @ POSE.rotation.T + POSE.translation)
    cone = cone_from_sides(*rays, CUP.taper)
    assert cone is not None
    tip = float(CUP.outer_radius_at(0.0)) / CUP.taper
    apex = POSE.rotation @ np.array([0.0, 0.0, -tip]) + POSE.translation
    axis, height = cone.at(float(np.linalg.norm(apex)), tip)
    assert axis.place(height).numbers == pytest.approx(place.numbers, abs=1e-9)


@pytest.mark.long
def test_an_image_at_rest_gives_the_pose_of_an_inclined_wall() -> None:
    place = CameraPlace(0.45, 0.09, 0.01, 0.19, 0.005)
    view = CupView(CAMERA, pose_of(place, -0.5 * np.pi), CUP)
    fit = calibrate_by_edges(drawn(view, 0.0, 0.0), CAMERA, CUP, distance=0.44)
    assert fit.place.numbers == pytest.approx(place.numbers, abs=0.008)


def test_a_view_through_an_inclined_wall_is_kept_in_its_file() -> None:
    text = format_calibration(Calibration(VIEW))
    assert "shape: frustum" in text
    assert "view: through_wall" in text
    again = parse_any_calibration(text)
    assert isinstance(again, Calibration)
    assert again.view.cup.radius == pytest.approx(CUP.radius, abs=1e-12)
    assert again.view.cup.taper == pytest.approx(CUP.taper, abs=1e-9)
    with pytest.raises(SloshCameraError, match=r"view: 'sideways', must be side or through_wall"):
        parse_any_calibration(text.replace("through_wall", "sideways"))
    # Without it the camera would have to be level.
    with pytest.raises(SloshCameraError, match="from the side only"):
        parse_any_calibration(text.replace("view: through_wall", "view: side"))


def test_another_fill_of_an_inclined_wall_has_another_radius() -> None:
    fuller = replace(PAPER, fill_height=0.07)
    changed = refilled(Calibration(VIEW), fuller)
    assert isinstance(changed, Calibration)
    assert changed.view.cup == Cup.of(fuller, 0.002)
    floor = [
        view.project_wall(AROUND, -view.cup.fill_height, Wall.FRONT)
        for view in (VIEW, changed.view)
    ]
    assert floor[0] == pytest.approx(floor[1], abs=1e-6, nan_ok=True)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"taper": 0.8}, "from the side only"),
        ({"taper": float("nan")}, "from the side only"),
        ({"taper": 0.4, "fill_height": 0.2, "rim_height": 0.3}, "crosses its axis"),
        ({"taper": 0.3, "wall_thickness": 0.03}, "too thick"),
    ],
)
def test_walls_that_cannot_be_seen_through_are_refused(
    change: dict[str, float], reason: str
) -> None:
    with pytest.raises(SloshCameraError, match=reason):
        replace(VIEW, cup=replace(CUP, **change))


def test_cameras_above_the_cone_and_other_shapes_are_refused() -> None:
    with pytest.raises(SloshCameraError, match="straight above"):
        CupView(CAMERA, look_at((0.0, -0.1, 0.9), (0.0, 0.0, 0.0)), CUP)
    bottle = Bottle(
        radius=0.036, foot_radius=0.006, body_height=0.12, neck_radius=0.014,
        shoulder_height=0.16, height=0.19, fill_height=0.07,
    )  # fmt: skip
    with pytest.raises(SloshCameraError, match=r"cylinder and frustum.*--scale"):
        Cup.of(bottle)
