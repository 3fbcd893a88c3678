from dataclasses import replace

import numpy as np
import pytest

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.detection.drawing import captions, draw_detail, draw_measurement
from slosh_camera.measurement import Flag, Measurement, bad_image
from slosh_camera.optics.box import Box, BoxView
from slosh_camera.optics.calibration import SideCalibration
from slosh_camera.optics.camera import Pose


def test_line_and_peak_are_drawn_where_they_are(make_scene):
    scene = make_scene()
    calibration = scene.calibration()
    image = scene.draw(0.02, -1.6)
    before = image.copy()
    result = FreeSurfaceDetector(calibration).update(0, image)
    picture = draw_measurement(image, calibration, result)
    np.testing.assert_array_equal(image, before)
    assert picture.shape == (480, 640, 3)
    u, v = (round(value) for value in result.edge_pixels[60])
    blue, green, red = (int(value) for value in picture[v, u])
    assert green > blue + 50
    assert green > red + 50
    u, v = (round(value) for value in result.peak_pixel)
    assert np.any(picture[v - 9 : v - 4, u - 2 : u + 3, 2].astype(int) > 200)


def test_flags_are_written(make_scene):
    scene = make_scene()
    calibration = scene.calibration()
    dark = np.zeros((480, 640, 3), np.uint8)
    empty = draw_measurement(dark, calibration, bad_image(0))
    result = FreeSurfaceDetector(calibration).update(0, dark[..., 0])
    assert Flag.TOO_DARK in result.flags
    flagged = draw_measurement(dark, calibration, result)
    assert np.any(empty[:30, :200] == 255)
    assert np.any(empty[:30, :200] != flagged[:30, :200])
    assert not np.any(dark)


def yellow(picture, pixel):
    """Returns the number of pixels near a position with the fitted surface's colour."""
    u, v = (round(float(value)) for value in pixel)
    near = picture[v - 2 : v + 3, u - 4 : u + 5].astype(int)
    return np.count_nonzero((near[..., 2] > 200) & (near[..., 1] > 170) & (near[..., 0] < 120))


@pytest.fixture
def side(make_scene):
    camera = make_scene().calibration().view.camera
    pose = Pose(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), [0.0, 0.0, 0.45])
    return SideCalibration(BoxView(camera, pose, Box(0.1, 0.06, rim_height=0.12)))


def test_a_side_view_gets_its_straight_line(side):
    x = np.linspace(-0.05, 0.05, 51)
    height = 0.2 * x + 0.001
    measurement = Measurement(
        0,
        msh=0.011,
        msh_stddev=1e-4,
        slope_angle=np.arctan(0.2),
        profile_x=x,
        profile_height=np.where(abs(x) < 0.01, np.nan, height),
    )
    picture = draw_measurement(np.zeros((480, 640), np.uint8), side, measurement)
    pixels = side.view.project_face(x, height)
    assert sum(yellow(picture, pixel) > 0 for pixel in pixels) > 40
    assert "slope 11.31 deg" in captions(measurement)
    unknown = replace(measurement, slope_angle=np.nan)
    picture = draw_measurement(np.zeros((480, 640), np.uint8), side, unknown)
    assert not any(yellow(picture, pixel) for pixel in pixels)


def test_a_detail_shows_the_whole_container_and_its_line(make_scene, side):
    image = np.full((480, 640), 90, np.uint8)
    pixel = side.view.project_face(0.0, 0.02)
    measurement = Measurement(0, edge_pixels=pixel)
    plain, marked = (
        draw_detail(image, side, one, (300, 260)) for one in (bad_image(0), measurement)
    )
    assert plain.shape == (260, 300, 3)
    changed = np.argwhere(np.any(plain != marked, axis=2))
    assert 0 < len(changed) < 60
    v, u = changed.mean(axis=0)
    # The face with a margin and the scale is what fills the height.
    assert 0.3 * 300 < u < 0.6 * 300
    assert 0.2 * 260 < v < 0.5 * 260
