"""Tests side views of bodies of revolution against rendered images with exact truth."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slosh_camera.calibrate.camera_file import format_calibration, parse_any_calibration
from slosh_camera.calibrate.scale import calibrate_by_scale
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag
from slosh_camera.optics.round_body import RoundBody, RoundView
from slosh_camera.rectangle.detector import SideViewDetector
from slosh_model import Cylinder
from slosh_model.shapes import Ellipsoid, Frustum, LyingCylinder, Revolution, Tray

CUP = Frustum(bottom_radius=0.028, top_radius=0.04, height=0.09, fill_height=0.055)
BOWL = Ellipsoid(radius=0.06, semi_height=0.05, fill_height=0.035, rim_height=0.05)
FLASK = Revolution(
    profile=((0.0, 0.0), (0.045, 0.0), (0.015, 0.09), (0.015, 0.12)), fill_height=0.045
)
SIZE, FOCAL, DISTANCE = (320, 260), 1000.0, 0.45
STEPS = 160


def drawn(body, a, b, above=0.0, *, mirror=False):
    """Dark liquid whose surface is the plane z = a x + b y, seen from (0, -DISTANCE, above).

    Seen from above, a surface that mirrors the background is as bright as it.
    """
    _, levels, radii = body.wall_line
    u, v = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    slope_x, slope_z = (u - 0.5 * (SIZE[0] - 1)) / FOCAL, -(v - 0.5 * (SIZE[1] - 1)) / FOCAL
    dark = np.zeros(u.shape)
    shade = 0.0
    for sub in (-0.25, 0.25):
        wet, dry = np.zeros(u.shape, bool), np.zeros(u.shape, bool)
        for y in np.linspace(-radii.max(), radii.max(), STEPS):
            x = (slope_x + sub / FOCAL) * (DISTANCE + y)
            z = above + (slope_z + sub / FOCAL) * (DISTANCE + y)
            wall = np.interp(z, levels, radii, left=0.0, right=0.0)
            inside, under = x * x + y * y < wall * wall, z < a * x + b * y
            wet |= inside & under & ~dry
            dry |= inside & ~under & ~wet & mirror
        dark += 0.5 * wet
    shade = 200.0 - 150.0 * dark
    noise = np.random.default_rng(1).normal(0.0, 1.0, u.shape)
    return np.clip(shade + noise, 0, 255).astype(np.uint8)


def calibrated(body, above=0.0, distance=DISTANCE):
    seen = RoundBody.of(body)
    half = 0.5 * seen.width
    across = FOCAL * half / math.sqrt(DISTANCE**2 - half**2)
    u, v = 0.5 * (SIZE[0] - 1), 0.5 * (SIZE[1] - 1) + FOCAL * above / DISTANCE
    return calibrate_by_scale(
        SIZE, (u - across, v), (u + across, v), seen.width, body.fill_height,
        body=seen, distance=distance,
    )  # fmt: skip


def wall_height(body, slope):
    """Returns the height at which the plane z = slope r meets the wall [m]."""
    _, levels, radii = body.wall_line
    return float(np.interp(0.0, levels - slope * radii, levels))


@pytest.mark.parametrize("body", [CUP, BOWL, FLASK], ids=["cup", "bowl", "flask"])
@pytest.mark.parametrize(("a", "b"), [(0.2, 0.0), (-0.15, 0.1), (0.1, -0.15)])
def test_the_heights_at_both_ends_are_those_of_the_wall(body, a, b):
    detector = SideViewDetector(calibrated(body))
    detector.learn_still(drawn(body, 0.0, 0.0))
    found = detector.measure(0, drawn(body, a, b))
    assert Flag.NOT_FOUND not in found.flags
    assert found.sh_left == pytest.approx(wall_height(body, -a), abs=4e-4)
    assert found.sh_right == pytest.approx(wall_height(body, a), abs=4e-4)
    highest = wall_height(body, math.hypot(a, b))
    assert abs(found.msh - highest) < max(6e-4, 2.5 * found.msh_stddev)


def test_a_wave_along_the_view_is_told_by_its_perspective_where_it_is_large():
    detector = SideViewDetector(calibrated(CUP))
    detector.learn_still(drawn(CUP, 0.0, 0.0))
    for slope in (0.4, -0.4):
        found = detector.measure(0, drawn(CUP, 0.0, slope))
        assert found.azimuth == pytest.approx(math.copysign(0.5 * math.pi, slope), abs=0.05)
        assert found.msh == pytest.approx(wall_height(CUP, 0.4), abs=4e-4)
    small = detector.measure(0, drawn(CUP, 0.0, 0.05))
    assert math.isnan(small.azimuth)
    assert abs(small.msh - wall_height(CUP, 0.05)) < 3.0 * small.msh_stddev
    across = detector.measure(0, drawn(CUP, 0.1, 0.0))
    assert across.azimuth == pytest.approx(0.0, abs=0.1)


def test_the_file_of_a_calibration_gives_the_same_view():
    calibration = calibrated(BOWL, above=0.01)
    again = parse_any_calibration(format_calibration(calibration))
    assert isinstance(again.view, RoundView)
    x, z = np.array([-0.05, 0.0, 0.04]), np.array([0.01, -0.02, 0.0])
    np.testing.assert_allclose(
        again.view.project_face(x, z), calibration.view.project_face(x, z), atol=1e-9
    )
    np.testing.assert_allclose(
        again.view.on_face(again.view.project_face(x, z)), [x, z], atol=1e-9
    )


def test_what_cannot_be_measured_is_refused_with_the_reason():
    with pytest.raises(SloshCameraError, match="distance: is needed for a body of revolution"):
        calibrated(CUP, distance=None)
    with pytest.raises(SloshCameraError, match=r"must be more than the container's width"):
        calibrated(CUP, distance=0.05)
    with pytest.raises(SloshCameraError, match="a tray has no silhouette"):
        RoundBody.of(Tray(width=0.2, depth=0.1, corner_radius=0.02, fill_height=0.02))
    with pytest.raises(SloshCameraError, match=r"along its y it is a rectangle of width 0\.3 m"):
        RoundBody.of(LyingCylinder(radius=0.05, length=0.3, fill_height=0.02))
    with pytest.raises(SloshCameraError, match="a cylinder has no silhouette"):
        RoundBody.of(Cylinder(0.04, 0.06))
    with pytest.raises(SloshCameraError, match="measured from the side only"):
        calibrated(CUP, above=0.052)
    tilted = drawn(replace(CUP), 0.0, -0.2)
    with pytest.raises(SloshCameraError, match="bent as seen from"):
        SideViewDetector(calibrated(CUP)).learn_still(tilted)


@pytest.mark.parametrize(("above", "slope"), [(0.005, 0.06), (0.005, -0.06), (-0.005, 0.06)])
def test_heights_count_from_the_line_at_rest_of_the_half_that_is_seen(above, slope):
    """A camera 5 mm above sees the near line at rest 1.6 mm below the far one."""
    detector = SideViewDetector(calibrated(BOWL, above))
    detector.learn_still(drawn(BOWL, 0.0, 0.0, above, mirror=True))
    found = detector.measure(0, drawn(BOWL, 0.02, slope, above, mirror=True))
    assert found.flags & Flag.NOT_FOUND == Flag.NONE
    highest = wall_height(BOWL, math.hypot(0.02, slope))
    assert found.msh == pytest.approx(highest, abs=5e-4)
    assert found.azimuth == pytest.approx(math.atan2(slope, 0.02), abs=0.15)
