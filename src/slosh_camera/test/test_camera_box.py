import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from slosh_camera.calibrate.camera_file import (
    format_calibration,
    parse_any_calibration,
    parse_calibration,
)
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.box import Box, BoxView
from slosh_camera.optics.calibration import SideCalibration
from slosh_camera.optics.camera import PinholeCamera, Pose, look_at

CAMERA = PinholeCamera(640, 480, 1600.0, 1600.0, 319.5, 239.5, (-0.1, 0.02, 0.001, -0.001, 0.0))
BOX = Box(0.08, 0.06, 0.04, 0.003, 1.49, 0.11)
TEXT = """\
image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [1600, 0, 319.5, 0, 1600, 239.5, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
container: {shape: rectangle, width: 0.08, fill_height: 0.06, depth: 0.04,
            wall_thickness: 0.002, rim_height: 0.11}
pose: {rotation: [1, 0, 0, 0, 0, -1, 0, 1, 0], translation: [0, 0, 0.42]}
"""


def view(box=BOX, centre=(0.05, -0.4, 0.03)):
    return BoxView(CAMERA, look_at(centre, (0.0, 0.0, 0.01)), box)


def test_a_place_on_the_face_is_found_again_from_its_pixel():
    x, z = (grid.ravel() for grid in np.meshgrid([-0.04, 0.0, 0.03], [-0.05, 0.0, 0.04]))
    seen = view()
    back_x, back_z = seen.on_face(seen.project_face(x, z))
    assert_allclose(back_x, x, atol=1e-9)
    assert_allclose(back_z, z, atol=1e-9)


def test_the_way_through_the_wall_obeys_snells_law():
    seen = view()
    point = np.array([0.03, -0.02, 0.035])
    pixel = seen.project_face(point[0], point[2])
    ray = (CAMERA.rays(pixel) @ seen.pose.rotation)[0]
    ray /= np.linalg.norm(ray)
    centre = seen.pose.camera_centre
    outer = centre + ray * (-0.023 - centre[1]) / ray[1]
    inside = (point - outer) / np.linalg.norm(point - outer)
    sines = [np.hypot(direction[0], direction[2]) for direction in (ray, inside)]
    assert sines[0] == pytest.approx(1.49 * sines[1], abs=1e-9)
    assert_allclose(np.cross(ray, inside)[1], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("width", 0.0),
        ("width", np.nan),
        ("fill_height", -0.1),
        ("depth", np.inf),
        ("wall_thickness", -0.001),
        ("wall_refractive_index", 0.5),
        ("rim_height", 0.05),
    ],
)
def test_a_box_that_cannot_be_is_refused(key, value):
    with pytest.raises(SloshCameraError, match=rf"^{key}: "):
        replace(BOX, **{key: value})


@pytest.mark.parametrize(
    ("centre", "target", "word"),
    [
        ((0.0, 0.4, 0.0), (0.0, 0.0, 0.0), "from outside"),
        ((0.0, -0.4, 0.0), (0.0, -0.8, 0.0), "in front"),
    ],
)
def test_a_camera_that_does_not_see_the_face_is_refused(centre, target, word):
    with pytest.raises(SloshCameraError, match=word):
        BoxView(CAMERA, look_at(centre, target), BOX)


def test_a_container_lying_on_its_side_is_refused():
    upright = look_at((0.0, -0.4, 0.0), (0.0, 0.0, 0.0))
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = Pose(quarter @ upright.rotation, quarter @ upright.translation)
    with pytest.raises(SloshCameraError, match="rolled"):
        BoxView(CAMERA, turned, BOX)


def test_the_file_of_a_rectangular_container():
    calibration = parse_any_calibration(TEXT)
    assert isinstance(calibration, SideCalibration)
    assert calibration.view.box == Box(0.08, 0.06, 0.04, 0.002, 1.49, 0.11)
    again = parse_any_calibration(format_calibration(calibration))
    assert again.view.box == calibration.view.box
    assert format_calibration(again) == format_calibration(calibration)


def test_a_reader_of_cylinders_says_what_it_needs():
    with pytest.raises(
        SloshCameraError, match=r"camera\.yaml: container\.shape: this is a side view"
    ):
        parse_calibration(TEXT)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("shape: rectangle", "shape: heart", "container.shape"),
        ("shape: rectangle", "shape: 3", "container.shape"),
        ("shape: rectangle", "shape: [rectangle]", "container.shape"),
        ("shape: rectangle, ", "", "container.width"),
        ("width: 0.08", "radius: 0.08", "container.radius"),
        ("width: 0.08, ", "", "container.width"),
        ("width: 0.08", "width: .nan", "container.width"),
        ("depth: 0.04", "depth: 0", "container.depth"),
        ("depth: 0.04", "depth: deep", "container.depth"),
        ("[0, 0, 0.42]", "[0, 0, -0.42]", "pose"),
    ],
)
def test_a_wrong_value_of_a_rectangle_is_named(old, new, key):
    assert old in TEXT
    with pytest.raises(SloshCameraError) as caught:
        parse_any_calibration(TEXT.replace(old, new, 1))
    assert re.match(rf"camera\.yaml(:\d+)?: {re.escape(key)}", str(caught.value))
    assert "\n" not in str(caught.value)
